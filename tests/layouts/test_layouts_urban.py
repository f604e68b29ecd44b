"""Parking lots, neighbourhoods, alleys and communities: each stands up to a look from close by."""

from collections import Counter
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from support.layout_checks import blank_site, catalogue

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes.grammar import Frame, Pose
from aerialdojo_gen.scenes.kit.fences import fence
from aerialdojo_gen.scenes.kit.houses import HouseStyle, house
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
