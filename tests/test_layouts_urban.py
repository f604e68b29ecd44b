"""Parking lots, neighbourhoods, alleys and communities: each stands up to a look from close by."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
import shapely
import trimesh
from layout_checks import catalogue, glb_bytes, props_of, scene_of

from aerialdojo_gen.common.paper import paper_counts
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes.footprints import footprint
from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle, house
from aerialdojo_gen.scenes.grammar_props import deal, next_variant
from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.recipe import Recipe
from aerialdojo_gen.scenes.site import Site

SCENES = [
    f"U_{kind}_{k}" for kind in ("ParkingLot", "Neighborhood", "Alley", "Community") for k in (0, 1)
]  # fmt: skip
each_scene = pytest.mark.parametrize("name", SCENES)


@each_scene
def test_scenes_are_as_rich_as_the_paper_asks(name):
    scene, known = scene_of(name), catalogue()
    n_landmarks, n_objects = paper_counts()[name]
    kinds = Counter(known[i.category].kind for i in props_of(scene))
    targets = [i for i in props_of(scene) if known[i.category].kind != "landmark"]
    looks = {(i.category, i.variant) for i in targets if known[i.category].kind != "vegetation"}
    assert 30_000 <= scene.n_triangles <= 200_000
    assert kinds["landmark"] >= n_landmarks
    assert len(looks) >= 1.2 * n_objects
    assert len({i.category for i in targets}) >= 40
    assert 12 <= scene.ceiling_m <= 30


@each_scene
def test_props_stand_on_something(name):
    scene = scene_of(name)
    structure = tuple(i for i in scene.instances if i.category not in catalogue())
    cast = RayCaster(Scene(name, structure, scene.materials, scene.bounds))
    floating = []
    for prop in props_of(scene):
        if prop.category in ("shop_sign", "wall_banner", "wall_clock", "storefront"):
            continue
        bottom = float(prop.bounds[0, 2])
        low = prop.vertices[prop.vertices[:, 2] < bottom + 0.25]
        feet = np.array([low[:, :2].mean(axis=0), *low[:: max(len(low) // 8, 1), :2]])
        # Some props reach into what they stand on: rays start at several heights above the lowest point.
        heights = bottom + np.arange(0.05, 0.9, 0.15)
        origins = np.array([(x, y, z) for x, y in feet for z in heights])
        distance, _ = cast.first_hit(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)))
        bears = origins[:, 2] - distance > bottom - 0.12
        if not bears.any():
            floating.append(prop.node)
    assert not floating


@each_scene
def test_props_do_not_stand_in_one_another(name):
    props = props_of(scene_of(name))
    outlines = [footprint(p, float(p.bounds[0, 2])) for p in props]
    tree = shapely.STRtree(outlines)
    clashes = []
    for a, b in zip(*tree.query(outlines, predicate="intersects"), strict=True):
        low = max(props[a].bounds[0, 2], props[b].bounds[0, 2])
        high = min(props[a].bounds[1, 2], props[b].bounds[1, 2])
        if a < b and high - low > 0.2:
            shared = outlines[a].intersection(outlines[b]).area
            if shared > 0.2 * min(outlines[a].area, outlines[b].area):
                clashes.append((props[a].node, props[b].node))
    assert not clashes


@each_scene
def test_props_do_not_stand_in_structure(name):
    scene, known = scene_of(name), catalogue()
    solids = [
        trimesh.Trimesh(i.vertices, i.faces, process=False)
        for i in scene.instances
        if i.category in ("house", "town_house", "flats", "office_block", "workshop", "ticket_office")
    ]
    props = [i for i in props_of(scene) if known[i.category].kind != "building"]
    above = np.array([[*p.centroid[:2], p.bounds[1, 2] + 0.05] for p in props])
    for solid in solids:
        low, high = solid.bounds
        near = ((above > low) & (above < high)).all(axis=1)
        if near.any():
            # A roof over the top of a prop that stands inside the walls' outline: it is in a room.
            crossings = [
                len(solid.ray.intersects_location([p], [[0.0, 0.0, 1.0]], multiple_hits=True)[0]) for p in above[near]
            ]
            sunk = [p.node for p, n in zip(np.array(props, dtype=object)[near], crossings, strict=True) if n % 2]
            assert not sunk


@pytest.mark.parametrize("name", ["U_ParkingLot_1", "U_Alley_1"])
def test_bytes_are_the_same_every_time(name, tmp_path):
    first, second = glb_bytes(name, tmp_path)
    assert first == second


@pytest.mark.parametrize("kind", ["ParkingLot", "Neighborhood", "Alley", "Community"])
def test_the_two_scenes_of_a_type_differ(kind):
    first, second = (scene_of(f"U_{kind}_{k}") for k in (0, 1))
    assert not np.array_equal(first.bounds, second.bounds)
    structure = [
        {tuple(np.round(i.bounds.ravel(), 1)) for i in s.instances if i.category not in catalogue()}
        for s in (first, second)
    ]
    assert len(structure[0] & structure[1]) <= 1
    things = [{(i.category, i.variant) for i in props_of(s)} for s in (first, second)]
    assert len(things[0] ^ things[1]) > 0.3 * len(things[0] | things[1])


def blank() -> Site:
    return Site("U_T_0", Recipe(layout="none", size_m=(60, 60), ceiling_m=20), catalogue())


def test_frames_agree_with_turned_coordinates():
    frame = Frame(3.0, -2.0, 90.0)
    assert frame.at(1.0, 0.0) == pytest.approx((3.0, -1.0))
    assert frame.at(0.0, 1.0) == pytest.approx((2.0, -2.0))
    assert frame.pose(1.0, 0.0, -90.0) == pytest.approx((3.0, -1.0, 0.0))


@pytest.mark.parametrize("yaw", [0.0, 37.0, 180.0])
@pytest.mark.parametrize("garage", [-1, 0, 1])
def test_houses_take_their_ground_and_face_their_street(yaw, garage):
    site = blank()
    style = HouseStyle(garage=garage, porch_m=2.0, door="#123456")
    frame = Frame(1.0, 2.0, yaw)
    built = house(site, frame, style)
    assert not site.is_free(1.0, 2.0, 0.2)
    assert not site.is_free(*frame.at(style.depth_m / 2 + 1.0, 3.0), 0.2)
    assert site.is_free(*frame.at(style.depth_m / 2 + 1.0, garage * (style.width_m / 2 + 1.8) or 6.0), 0.2)
    if garage:
        assert not site.is_free(*frame.at(1.0, garage * (style.width_m / 2 + 1.8)), 0.2)
    door = next(p for p in built.parts if p.material == "#123456")
    assert door.vertices[:, :2].mean(axis=0) == pytest.approx(frame.at(style.depth_m / 2 + 0.06, 0.0), abs=0.05)


@pytest.mark.parametrize("kind", ["picket", "board", "hedge", "wall", "railing"])
def test_fences_bar_the_way_along_their_whole_path(kind):
    site = blank()
    path = [(-6.0, -3.0), (4.0, -3.0), (4.0, 5.0)]
    fence(site, path, kind)
    cast = RayCaster(site.scene())
    for (ax, ay), (bx, by) in pairwise(path):
        t = np.linspace(0.05, 0.95, 40)
        middle = np.column_stack(
            [ax + (bx - ax) * t, ay + (by - ay) * t, np.full(40, 0.8 if kind == "picket" else 0.6)]
        )
        if kind == "railing":
            middle[:, 2] = 1.15
        across = np.array([by - ay, ax - bx, 0.0]) / np.hypot(bx - ax, by - ay)
        distance, _ = cast.first_hit(middle - across, np.tile(across, (40, 1)))
        assert (distance < 2.0).mean() > 0.95


def test_dealing_takes_categories_in_turn_and_rare_variants_first():
    site = blank()
    poses = [Pose(-20.0 + 5.0 * k, 0.0, 0.0) for k in range(8)]
    out = deal(site, ["bench", "litter_bin"], poses, "in the yard")
    assert [i.category for i in out] == ["bench", "litter_bin"] * 4
    variants = [i.variant for i in out if i.category == "bench"]
    assert len(set(variants)) == min(4, len(catalogue()["bench"].variants))
    assert all(i.attributes["place"] == "in the yard" for i in out)
    assert deal(site, ["bench"], poses) == []
    used = Counter(variants)
    assert used[next_variant(site, "bench")] == min(used[v.name] for v in catalogue()["bench"].variants)
