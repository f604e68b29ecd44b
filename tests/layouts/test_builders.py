"""Builders of structure, each by itself: what it makes holds together, takes its ground, and can be flown through."""

from __future__ import annotations

from collections import Counter
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
import shapely
from support.layout_checks import blank_site, catalogue, clashes, distances, floating

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes.grammar import Frame, Pose, blob, ragged_outline, s_curve
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.bridges import arcade, bridge_deck, bridge_parapets
from aerialdojo_gen.scenes.kit.concrete import Slab, concrete_frame
from aerialdojo_gen.scenes.kit.fences import fence
from aerialdojo_gen.scenes.kit.halls import HallRoof, hall
from aerialdojo_gen.scenes.kit.houses import HouseStyle, house
from aerialdojo_gen.scenes.kit.quays import pier
from aerialdojo_gen.scenes.kit.rail import RAIL_M, ballast, tracks
from aerialdojo_gen.scenes.kit.rubble import slab_pile, strew_things
from aerialdojo_gen.scenes.kit.ruins import damaged_building
from aerialdojo_gen.scenes.kit.stands import Tier, gangways, passage, tier_parts
from aerialdojo_gen.scenes.kit.steelwork import guard_rails
from aerialdojo_gen.scenes.kit.wreckage import Bite, Style, Wreck, broken_edge, torn_floor, torn_wall
from aerialdojo_gen.scenes.placement import Placement

blank = partial(blank_site, "U_T_0")
DOWN = (0.0, 0.0, -1.0)
BITE = Bite(0.0, -4.0, 2.0, 4.0, seed=3)


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


def test_bites_start_at_their_foot_and_widen():
    bite = Bite(1.0, 2.0, 2.0, 5.0, 1.0, 11.0, seed=4)
    assert bite.area(0.9).is_empty
    assert bite.area(1.0).area < bite.area(6.0).area < bite.area(20.0).area
    assert bite.area(20.0).area == pytest.approx(bite.area(20.5).area)


def test_walls_lose_what_a_bite_takes_and_no_more():
    rng = np.random.default_rng(1)
    face = rectangle(0.0, 0.0, 20.0, 9.0)
    whole = torn_wall((-10.0, -4.0), (10.0, -4.0), face, (), rng, thickness_m=0.3)
    torn = torn_wall((-10.0, -4.0), (10.0, -4.0), face, (BITE,), rng, thickness_m=0.3)
    assert whole.volume_m3 == pytest.approx(20.0 * 9.0 * 0.3)
    assert 0.3 * whole.volume_m3 < torn.volume_m3 < 0.85 * whole.volume_m3
    upper = torn.vertices[torn.vertices[:, 2] > 6.0]
    assert np.abs(upper[:, 0]).min() > 1.0
    assert torn_wall((0.0, 0.0), (1.0, 0.0), rectangle(0, 1, 1, 3), (Bite(0.5, 0.0, 9.0, 9.0),), rng).volume_m3 == 0.0


def test_floors_end_where_bars_stick_out():
    plan = rectangle(-10.0, -5.0, 10.0, 5.0)
    floor = torn_floor(plan, 3.0, (BITE,))
    assert floor.volume_m3 == pytest.approx(0.25 * plan.difference(BITE.area(3.0)).area, rel=1e-6)
    edge = broken_edge(plan, 3.0, (BITE,))
    assert edge
    for at, yaw in edge:
        assert shapely.Point(at).distance(BITE.area(3.0).boundary) < 0.05
        ahead = shapely.Point(at[0] + 0.4 * np.cos(np.radians(yaw)), at[1] + 0.4 * np.sin(np.radians(yaw)))
        assert BITE.area(3.0).contains(ahead)


def test_a_leaning_building_tips_over_its_front():
    site = blank()
    for x, lean_deg in ((-15.0, 0.0), (15.0, 8.0)):
        one = {"node": f"lean_{lean_deg:.0f}", "at": (x, 0.0), "size_m": (12.0, 8.0), "storeys": 4, "style": Style()}
        assert damaged_building(site, **one, lean_deg=lean_deg, sunk_m=0.5) == -0.5
    straight, leaning = site.instances
    assert leaning.bounds[0, 1] < straight.bounds[0, 1] - 1.0
    assert leaning.bounds[1, 2] > straight.bounds[1, 2]


def test_a_floor_bears_nothing_where_it_is_gone():
    wreck = Wreck(Frame(0.0, 0.0, 90.0), 16.0, 10.0, 3, Style(), (Bite(0.0, -5.0, 3.0, 6.0, seed=5),))
    assert wreck.bears(6.0, 3.0, 2)
    assert not wreck.bears(0.0, -4.0, 2)


def test_things_are_strewn_where_there_is_room():
    site = blank()
    site.place(Placement("bench", 0.0, 0.0))
    placed = strew_things(site, "on the square", rectangle(-8, -8, 8, 8), ["bench", "stretcher", "bench"], "t")
    assert [i.category for i in placed] == ["bench", "stretcher", "bench"]
    assert not clashes(site.scene())


def test_the_top_of_a_pile_is_level_and_free():
    site = blank()
    z = slab_pile(site, (0.0, 0.0), 30.0, (14.0, 9.0), 4, "t")
    assert site.is_free(1.0, 0.0, 0.5, z=z)
    assert not site.is_free(1.0, 0.0, 0.5, z=z - 1.0)
    site.place(Placement("bench", 1.0, 0.0, z=z))
    assert not floating(site.scene())


def test_tracks_carry_rails_at_their_height():
    site = blank()
    path = [(-20.0, -3.0), *s_curve((-8.0, -3.0), (12.0, 4.0))]
    ballast(site, lines=[path])
    tracks(site, lines=[path])
    laid = site.instances[-1]
    assert laid.bounds[1, 2] == pytest.approx(RAIL_M)
    rails = laid.vertices[laid.vertices[:, 2] > RAIL_M - 0.01]
    line = np.array(path)
    gaps = [float(np.min(np.hypot(*(line - v[:2]).T))) for v in rails[:: max(len(rails) // 10, 1)]]
    assert min(gaps) > 0.5
    assert site.ground_z(-15.0, -3.0) == pytest.approx(0.35)


def test_arcades_open_where_their_arches_are():
    wall = arcade(-10.0, 10.0, 0.0, 8.0, [(0.0, 3.0, 3.0)], 2.0)
    solid = 20.0 * 8.0 - (6.0 * 3.0 + np.pi * 9.0 / 2)
    assert wall.volume_m3 == pytest.approx(2.0 * solid, rel=0.02)


def test_parapets_are_open_at_their_gaps():
    ends = {"x0": -10.0, "x1": 10.0, "half_m": 4.5}
    whole = bridge_parapets(**ends, frame="iron")
    gapped = bridge_parapets(**ends, frame="iron", gaps=[(-2.0, 2.0, 1)])
    assert sum(len(m.faces) for _, m in gapped) != sum(len(m.faces) for _, m in whole)
    site = blank()
    site.add("deck", "bridge_deck", [*bridge_deck(**ends, road_m=3.0), *gapped])
    far = distances(site.scene(), [(0.0, 0.0, 0.7), (5.0, 0.0, 0.7)], (0.0, 1.0, 0.0))
    assert far[0] > 10.0
    assert far[1] < 4.6


def test_a_frame_bears_on_every_floor_and_is_open_between():
    site = blank()
    plan = rectangle(-8, -8, 8, 8)
    void = rectangle(-2, -2, 2, 2)
    grid = [-7.0, 0.0, 7.0]
    concrete_frame(site, xs=grid, ys=grid, slabs=[Slab(plan, 3.6, void), Slab(plan, 7.2)])
    scene = site.scene()
    assert distances(scene, [(4.0, 4.0, 5.0), (1.0, 1.5, 5.0)], (0.0, 0.0, -1.0)) == pytest.approx([1.4, 5.0])
    across = distances(scene, [(-20.0, 3.5, 1.8), (-20.0, 3.5, 4.67)], (1.0, 0.0, 0.0))
    assert across[0] > 30.0
    assert across[1] == pytest.approx(12.1, abs=0.3)
    assert not site.is_free(7.0, 7.0, 0.2)
    assert site.is_free(4.0, 4.0, 1.0, z=3.6)


def test_halls_are_entered_by_their_gates_alone():
    site = blank()
    gates = {"s": [(8.0, 12.0, 0.0, 4.0)]}
    box = (-10.0, -6.0, 10.0, 6.0)
    hall(site, category="hall", box=box, eaves_m=5.0, wall="brick", roof=HallRoof("gravel"), gates=gates)
    feet = [(0.0, -12.0, 1.8), (-6.0, -12.0, 1.8), (6.0, -12.0, 1.0)]
    distance = distances(site.scene(), feet, (0.0, 1.0, 0.0))
    assert distance[0] > 17.0
    assert (distance[1:] < 6.2).all()
    assert site.is_free(0.0, 0.0, 2.0)
    assert not site.is_free(-6.0, -6.0, 0.2)


def test_guard_rails_follow_every_line():
    lines = shapely.MultiLineString([[(0, 0), (6, 0)], [(0, 4), (0, 9)]])
    bodies = dict(guard_rails(lines, 2.0, toe="planks"))
    rail = bodies["marking_yellow"].vertices
    assert bodies["planks"].vertices[:, 2].max() == pytest.approx(2.2)
    assert rail[:, 2].min() == pytest.approx(2.0)
    assert rail[:, 2].max() == pytest.approx(3.1)
    assert rail[:, 0].max() == pytest.approx(6.0, abs=0.1)
    assert rail[:, 1].max() == pytest.approx(9.0, abs=0.1)
    assert "planks" not in dict(guard_rails(lines, 2.0))


def one_tier(**options) -> Tier:
    return Tier(rectangle(-10, -6, 10, 6), 4.0, 8, 1.0, **options)


def test_tiers_rise_a_row_at_a_time():
    tier = one_tier()
    assert [tier.level_m(k) for k in (0, 7)] == pytest.approx([1.0, 1.0 + 7 * 0.42])
    bands = [tier.band(k) for k in range(8)]
    assert shapely.unary_union(bands).area == pytest.approx(tier.plan.area, rel=1e-6)
    assert all(bands[k].intersection(bands[k + 1]).area < 1e-6 for k in range(7))


def test_gangways_lead_straight_out_from_the_front_edge():
    tier = one_tier()
    for foot in gangways(tier, 6.0):
        way = passage(foot, 1.2, tier.rows * tier.tread_m)
        assert way.intersection(tier.edge(0)).area < 1.0
        assert way.difference(tier.edge(0)).difference(tier.plan).area < 0.6


def test_seats_keep_off_gangways_portals_and_what_is_to_stay_clear():
    portal = passage(gangways(one_tier(), 6.0)[0], 3.0, 9.0)
    clear = rectangle(4, 10, 9, 14)
    tier = one_tier(portals=[portal])
    feet = gangways(tier, 6.0)
    parts = dict(
        tier_parts(tier, feet, concrete="concrete", step="steps", seat=lambda x, y, row: "seat", clear=clear)
    )
    seats = parts["seat"].vertices
    assert len(seats) > 16 * 200
    low = seats[seats[:, 2] < tier.head_m]
    assert not shapely.contains_xy(portal, low[:, 0], low[:, 1]).any()
    assert not shapely.contains_xy(clear.buffer(-0.3), seats[:, 0], seats[:, 1]).any()
    for foot in feet:
        way = passage(foot, 1.1, tier.rows * tier.tread_m)
        assert not shapely.contains_xy(way, seats[:, 0], seats[:, 1]).any()


@pytest.mark.parametrize("seed", [0, 1, 7, 123])
def test_blobs_are_simple_round_areas(seed: int) -> None:
    area = blob(3.0, -2.0, 5.0, seed)
    assert area.is_valid
    assert 0.4 * np.pi * 25 < area.area < 2.2 * np.pi * 25
    assert area.centroid.distance(blob(3.0, -2.0, 5.0, seed, ragged=0.0).centroid) < 1.5


def test_coastlines_are_natural_and_always_the_same():
    coarse = shapely.box(-20, -20, 20, 20)
    line = ragged_outline(coarse.exterior, 5, 1.5, 3.0)
    assert line.equals(ragged_outline(coarse.exterior, 5, 1.5, 3.0))
    assert not line.equals(ragged_outline(coarse.exterior, 6, 1.5, 3.0))
    assert line.is_valid
    assert line.area == pytest.approx(1600, rel=0.15)
    assert 0.5 < shapely.hausdorff_distance(line.boundary, coarse.boundary) < 6.0


def test_piers_bear_above_and_are_open_below():
    site = blank()
    pier(site, at=(-15.0, 0.0), yaw_deg=0.0, length_m=30.0, width_m=5.0, z=4.0, bay_m=5.0, rail="iron")
    scene = site.scene()
    down = distances(scene, [(x, 0.4, 9.0) for x in (-12.0, 0.3, 14.0)], DOWN)
    assert 9.0 - down == pytest.approx([4.0] * 3, abs=0.01)
    assert distances(scene, [(-20.0, 1.2, 1.2)], (1.0, 0.0, 0.0))[0] > 30.0
