"""Parking lots, neighbourhoods, alleys, communities and malls: what stands in them, and where a drone can fly."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from support.layout_checks import DAILY, blank_site, catalogue, nightly_unless, props_of, touching

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.scenes.checks import SITTER
from aerialdojo_gen.scenes.grammar import Frame, Pose
from aerialdojo_gen.scenes.kit.fences import fence
from aerialdojo_gen.scenes.kit.houses import HouseStyle, house
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.placement import Placement

blank = partial(blank_site, "U_T_0")


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


def test_things_have_rare_variants_first_and_no_room_twice():
    site = blank()
    poses = [Pose(-20.0 + 5.0 * k, 0.0, 0.0) for k in range(8)]
    things = [Placement(("bench", "litter_bin")[k % 2], *pose, place="in the yard") for k, pose in enumerate(poses)]
    out = [site.place(thing, "skip") for thing in things]
    variants = [i.variant for i in out if i.category == "bench"]
    assert len(set(variants)) == min(4, len(catalogue()["bench"].variants))
    assert all(i.attributes["place"] == "in the yard" for i in out)
    assert [site.place(thing, "skip") for thing in things] == [None] * 8
    with pytest.raises(AssetError, match=r"no room for bench at \(-20, 0\)"):
        site.place(things[0], "must")
    used = Counter(variants)
    assert used[site.next_variant("bench")] == min(used[v.name] for v in catalogue()["bench"].variants)


@pytest.fixture(scope="module", params=[nightly_unless("U_Mall_0" in DAILY, "U_Mall_0")])
def mall(request: pytest.FixtureRequest, scene_of: Callable[[str], Scene]) -> Scene:
    return scene_of(request.param)


@pytest.fixture(scope="module")
def world(mall: Scene) -> CollisionWorld:
    return CollisionWorld(mall)


def test_every_prop_says_where_it_stands(mall: Scene) -> None:
    for i in props_of(mall):
        assert i.attributes.get("place", "").strip() or catalogue()[i.category].kind == "life", i.node


def test_props_do_not_stand_in_each_other(mall: Scene) -> None:
    pairs = touching(i for i in props_of(mall) if catalogue()[i.category].kind != "building" and i.category != SITTER)
    # Hedges run on from block to block, and trees grow out of them.
    assert [p for p in sorted(pairs) if not any("hedge" in n for n in p)] == []


@pytest.mark.parametrize(
    ("p", "q"),
    [
        ((-10.5, 15.0, 3.2), (-10.5, 60.0, 3.2)),
        ((-29.0, 17.7, 4.3), (8.0, 17.7, 4.3)),
        ((-33.65, 3.0, 3.9), (-33.65, 14.0, 3.9)),
        ((-11.0, -20.0, 3.3), (-11.0, -1.5, 3.3)),
        ((-59.6, 0.0, 4.4), (-59.6, 40.0, 4.4)),
        ((47.0, 18.6, 2.4), (90.0, 18.6, 2.4)),
        ((51.0, 37.0, 6.3), (90.0, 37.0, 6.3)),
        ((57.0, -30.0, 2.9), (57.0, -12.0, 2.9)),
        ((38.0, -14.0, 7.0), (38.0, 50.0, 7.0)),
    ],
    ids=["passage", "north arcade", "west arcade", "gate", "west canopy", "deck", "middle floor", "terrace", "drive"],
)
def test_a_drone_can_fly_under_it(world: CollisionWorld, p: tuple[float, ...], q: tuple[float, ...]) -> None:
    assert not world.segment_in_collision(np.array(p), np.array(q), 0.25)


@pytest.mark.parametrize(
    ("p", "q"),
    [
        ((-20.0, 10.0, 2.0), (-20.0, 55.0, 2.0)),
        ((0.0, 30.0, 12.0), (0.0, 30.0, 3.0)),
        ((65.0, 30.0, 2.0), (65.0, 30.0, 9.0)),
    ],
    ids=["hall", "roof", "slab"],
)
def test_walls_and_floors_stop_it(world: CollisionWorld, p: tuple[float, ...], q: tuple[float, ...]) -> None:
    assert world.segment_in_collision(np.array(p), np.array(q), 0.25)
