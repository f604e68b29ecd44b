"""People and animals stand on the right ground with room, and no text names them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from shapely.geometry import Point
from support import layout_checks
from support.layout_checks import ASSETS, nightly_unless

from aerialdojo_gen.annotations.claims import SceneClaims
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes.catalogue import Overrides
from aerialdojo_gen.scenes.checks import clashes, floating
from aerialdojo_gen.scenes.kit.life import WALKED, life
from aerialdojo_gen.scenes.kit.resting import perch_on_wires
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.plans.build import build_site
from aerialdojo_gen.scenes.site import Site

SCENES = ("U_Alley_0", "D_Flood_1", "I_RailCorridor_0")
POSTURES = {"standing": 0, "walking": 1, "sitting": 2, "at work": 3, "on the phone": 4}


@cache
def site_of(name: str) -> Site:
    path = ASSETS / "scenes" / f"{name}.toml"
    return build_site(name, read_toml(path, AssetError), layout_checks.catalogue(), name, path.parent)[0]


@cache
def scene_of(name: str) -> Scene:
    return site_of(name).scene()


@pytest.fixture(params=[nightly_unless(name != "D_Flood_1", name) for name in SCENES])
def built(request) -> Site:
    return site_of(request.param)


def living(catalogue, instances, kinds=None):
    return [i for i in instances if i.category in catalogue and catalogue[i.category].kind == "life"
            and (kinds is None or i.category in kinds)]  # fmt: skip


@pytest.mark.parametrize("posture", POSTURES)
def test_a_body_is_closed_and_stands_on_its_feet(catalogue, posture):
    names = [v.name for v in catalogue["person"].variants]
    assert len(names) >= 24
    for name in names:
        one = catalogue.instantiate(
            "person", "p", generator(1, name), variant=name, own=Overrides({"posture": POSTURES[posture]})
        )
        low, high = one.bounds[:, 2]
        assert -0.05 < low < 0.02, name
        upright = {"sitting": 0.53, "at work": 0.88}.get(posture, 1.06)
        assert 0.45 < high < 1.9 * upright, (name, high)
        assert len(one.faces) < 1250
        for part in one.parts:
            a, b, c = part.vertices[part.faces].transpose(1, 0, 2)
            # Every limb is closed: its faces' normals add up to nothing.
            assert np.abs(np.cross(b - a, c - a).sum(axis=0)).max() < 1e-4


def test_people_stand_where_people_walk(catalogue, built):
    on = next((e for e in reversed(built.head.site) if e.get("make") == "life"), {})
    people = living(catalogue, built.instances, {"person"})
    assert on["people"] * 0.8 <= len(people) <= on["people"]
    for person in people:
        x, y, _ = person.centroid
        if person.bounds[0, 2] > built.ground_z(float(x), float(y)) + 0.4:
            assert on["decks"]
            continue
        assert built.ground_material(float(x), float(y)).partition(":")[0] in on.get("ground", WALKED)
        assert np.abs(person.centroid[:2]).max() < max(built.head.size_m) / 2 - 3.0
    assert len({p.variant for p in people}) >= min(len(people), 6)


def test_people_stand_on_platforms(catalogue):
    """Away from the edges, and no more than two in five."""
    scene = scene_of("I_RailCorridor_0")
    tops = [i.bounds for i in scene.instances if i.category == "platform"]
    people = living(catalogue, scene.instances, {"person"})
    above = [
        p for p in people for low, high in tops
        if (p.centroid[:2] > low[:2] + 0.4).all() and (p.centroid[:2] < high[:2] - 0.4).all()
        and abs(p.bounds[0, 2] - high[2]) < 0.1
    ]  # fmt: skip
    assert 3 <= len(above) <= 0.4 * len(people) + 1


def test_nobody_floats_or_stands_in_another(catalogue, built):
    scene = scene_of(built.name)
    nodes = {i.node for i in living(catalogue, scene.instances)}
    assert nodes
    assert not nodes & set(floating(scene, catalogue))
    assert not [pair for pair in clashes(scene, catalogue) if nodes & set(pair)]


def test_birds_stand_on_what_is_high(catalogue, built):
    birds = living(catalogue, built.instances, {"pigeon", "gull", "crow"})
    assert len(birds) >= 3
    for bird in birds:
        x, y, _ = bird.centroid
        assert bird.bounds[0, 2] - built.ground_z(float(x), float(y)) > 1.5


def test_no_claim_is_about_somebody_who_moves(catalogue):
    scene = scene_of("U_Alley_0")
    kinds = {i.node: i.category for i in living(catalogue, scene.instances)}
    claims = SceneClaims(Vocabulary(scene, catalogue), ())
    named = [m.node for k, i in enumerate(scene.instances) if i.category in catalogue.targets
             for claim in claims.of(k) for m in claim.things]  # fmt: skip
    assert named
    assert not kinds.keys() & set(named)


def test_an_unknown_group_of_people_is_named(catalogue, built):
    with pytest.raises(AssetError, match=r"'towm'.*town"):
        life(built, people=1, who=["towm"])


TRAFFIC = {"cyclist", "motorcyclist", "estate_car", "coach", "lorry", "minibus"}


def tops_under(caster, points):
    """Heights of what is next below points, from 5 cm above them."""
    away, _ = caster.first_hit(points + np.array([0.0, 0.0, 0.05]), np.tile([0.0, 0.0, -1.0], (len(points), 1)))
    return points[:, 2] + 0.05 - away


@pytest.mark.parametrize("name", ["U_Alley_0", "I_RailCorridor_0"])
def test_who_sits_touches_a_seat_with_feet_on_the_ground(catalogue, name):
    scene = scene_of(name)
    sitters = living(catalogue, scene.instances, {"sitter"})
    assert len(sitters) >= 2
    others = [i for i in scene.instances if i.category not in catalogue or catalogue[i.category].kind != "life"]
    caster = TriangleRayCaster(*soup([part for i in others for part in i.parts]))
    for one in sitters:
        foot, v = one.bounds[0, 2], one.vertices
        feet = v[v[:, 2] < foot + 0.02]
        assert np.abs(tops_under(caster, feet) - feet[:, 2]).min() < 0.05
        thighs = v[(v[:, 2] > foot + 0.35) & (v[:, 2] < foot + 0.56)]
        gaps = thighs[:, 2] - tops_under(caster, thighs)
        borne = (np.abs(gaps) < 0.04) & (thighs[:, 2] - gaps > foot + 0.3)
        assert borne.sum() >= 3, one.node


def test_traffic_stands_in_its_lane_on_the_carriageway(catalogue):
    site = site_of("U_Alley_0")
    traffic = living(catalogue, site.instances, TRAFFIC)
    assert len(traffic) >= 2
    for one in traffic:
        x, y = one.centroid[:2].tolist()
        assert abs(one.bounds[0, 2] - site.ground_z(x, y)) < 0.03
        assert site.ground_material(x, y).partition(":")[0] in {"asphalt", "marking"}
        line, lane_m = min(site.lanes, key=lambda lane: lane[0].distance(Point(x, y)))
        assert line.distance(Point(x, y)) < lane_m / 2
        s = line.project(Point(x, y))
        a, b = line.interpolate(s - 0.5), line.interpolate(s + 0.5)
        way = np.array([b.x - a.x, b.y - a.y])
        off = one.vertices[:, :2] - one.centroid[:2]
        across = np.ptp(off[:, 0] * way[1] - off[:, 1] * way[0])
        assert across < 0.65 * np.ptp((off * way).sum(axis=1))
        lamps = [part.vertices[:, :2].mean(axis=0) for part in one.parts if part.material == "#f3ead0"]
        # Along the lane, not against it; a bicycle has no lamp.
        assert all(((lamp - one.centroid[:2]) * way).sum() > 0.3 for lamp in lamps)
        assert lamps or one.category == "cyclist"


def test_no_vehicle_in_traffic_has_a_target_s_colour(catalogue):
    """A text about the red sedan is not true of an estate car in a lane."""
    vehicles = [catalogue[name] for name in catalogue.targets if catalogue[name].kind == "vehicle"]
    taken = {
        colour for one in vehicles for v in one.variants for colour in (dict(one.roles) | dict(v.roles)).values()
    }
    for name in TRAFFIC:
        one = catalogue[name]
        assert name not in catalogue.targets
        assert not one.looks
        for variant in one.variants:
            assert not variant.attributes
            surfaces = dict(one.roles) | dict(variant.roles)
            assert not {surfaces[role] for role in ("body", "cab", "cover", "frame") if role in surfaces} & taken, (
                name
            )


def test_birds_stand_on_wires(catalogue):
    scene = scene_of("I_RailCorridor_0")
    wires = [part for i in scene.instances if i.category == "overhead_wire" for part in i.parts]
    caster = TriangleRayCaster(*soup(wires))
    on = 0
    for bird in living(catalogue, scene.instances, {"pigeon"}):
        feet = bird.vertices[bird.vertices[:, 2] < bird.bounds[0, 2] + 0.01]
        on += bool((np.abs(tops_under(caster, feet) - feet[:, 2]) < 0.015).any())
    assert on >= 3


def test_birds_on_several_faces_of_a_wire_keep_apart(catalogue):
    site = site_of("U_Alley_1")
    before = len(site.instances)
    for k in range(12):
        perch_on_wires(site, "pigeon", 20, generator(k, "birds"))
        birds, site.instances[before:] = tuple(site.instances[before:]), []
        assert len(birds) > 2
        assert clashes(Scene("birds", birds, {}, np.zeros((2, 3))), catalogue, 0.1) == []
