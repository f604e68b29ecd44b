"""Harbours, railways, bridges, factories, building sites and stadiums: each stands up to a look from close by."""

from functools import partial

import numpy as np
import pytest
import shapely
from support.layout_checks import blank_site, catalogue, distances, each_scene, props_of

from aerialdojo_gen.scenes.grammar import s_curve
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.bridges import arcade, bridge_deck, bridge_parapets
from aerialdojo_gen.scenes.kit.concrete import Slab, concrete_frame
from aerialdojo_gen.scenes.kit.halls import HallRoof, hall
from aerialdojo_gen.scenes.kit.rail import RAIL_M, ballast, tracks
from aerialdojo_gen.scenes.kit.stands import Tier, gangways, passage, tier_parts
from aerialdojo_gen.scenes.kit.steelwork import guard_rails
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.placement import footprint

_AFLOAT = {"freighter", "fishing_boat", "tugboat", "sailboat", "motor_yacht", "rowing_boat", "buoy"}


def land(scene: Scene) -> shapely.Geometry:
    """What of the ground lies above the water."""
    ground = next(i for i in scene.instances if i.category == "ground")
    corners = ground.vertices[ground.faces]
    level = (np.ptp(corners[:, :, 2], axis=1) < 1e-6) & (corners[:, 0, 2] > 1.0)
    return shapely.union_all(shapely.make_valid(shapely.polygons(corners[level][:, :, :2])), grid_size=0.01)


@each_scene(["I_Harbor_0", "I_Harbor_1"])
def test_boats_float_clear_of_the_quays(scene_of, name):
    scene = scene_of(name)
    boats = [i for i in props_of(scene) if i.category in _AFLOAT]
    dry = land(scene)
    assert len(boats) >= 10
    for boat in boats:
        assert boat.bounds[0, 2] < 0.05
        hull = footprint(boat, 0.0)
        assert hull.intersection(dry).area < 0.02 * hull.area, boat.node


blank_line = partial(blank_site, "I_T_0")
ROLLING = ("locomotive", "steam_locomotive", "passenger_carriage", "freight_wagon", "tank_wagon", "handcar")


@each_scene(["I_RailCorridor_0", "I_RailCorridor_1"])
def test_wheels_stand_on_rails(scene_of, name):
    scene = scene_of(name)
    tracks = tuple(i for i in scene.instances if i.category == "track")
    rails = Scene(name, tracks, scene.materials, scene.bounds)
    stock = [i for i in props_of(scene) if i.category in ROLLING]
    assert len(stock) >= 6
    for car in stock:
        low = car.vertices[car.vertices[:, 2] < RAIL_M + 0.02]
        on = np.abs(distances(rails, low + np.array([0.0, 0.0, 0.3]), (0.0, 0.0, -1.0)) - 0.3) < 0.05
        assert on.mean() > 0.3, car.node


@each_scene(["I_Bridge_0", "I_Bridge_1"])
def test_one_can_fly_under_the_bridge_and_not_through_its_road(scene_of, name):
    scene = scene_of(name)
    x = np.linspace(-12.0, 12.0, 13)
    assert (distances(scene, [(u, 0.3, 0.5) for u in x], (0.0, 0.0, -1.0)) < 0.6).all()
    # From one side to the other, well below the deck and above the water.
    across = distances(scene, [(u, -7.0, -6.0) for u in x], (0.0, 1.0, 0.0))
    assert (across > 14.0).sum() >= 5


def test_tracks_carry_rails_at_their_height():
    site = blank_line()
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
    a, b, c = (wall.vertices[wall.faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(2.0 * solid, rel=0.02)


def test_parapets_are_open_at_their_gaps():
    ends = {"x0": -10.0, "x1": 10.0, "half_m": 4.5}
    whole = bridge_parapets(**ends, frame="iron")
    gapped = bridge_parapets(**ends, frame="iron", gaps=[(-2.0, 2.0, 1)])
    assert sum(len(m.faces) for _, m in gapped) != sum(len(m.faces) for _, m in whole)
    site = blank_line()
    site.add("deck", "bridge_deck", [*bridge_deck(**ends, road_m=3.0), *gapped])
    far = distances(site.scene(), [(0.0, 0.0, 0.7), (5.0, 0.0, 0.7)], (0.0, 1.0, 0.0))
    assert far[0] > 10.0
    assert far[1] < 4.6


blank = partial(blank_site, "U_T_0")


@each_scene(f"U_{kind}_{k}" for kind in ("Factory", "ConstructionSite") for k in (0, 1))
def test_things_stand_at_many_heights(scene_of, name):
    scene = scene_of(name)
    targets = set(catalogue().targets)
    heights = np.array([p.bounds[0, 2] for p in props_of(scene) if p.category in targets])
    assert np.percentile(heights, 95) - np.percentile(heights, 5) > 3.5


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


@each_scene(["U_Stadium_0"])
def test_one_flies_from_the_pitch_through_a_portal_and_out_of_the_ground(scene_of, name):
    # Under the upper rows and through the outer wall; beside the portal the front wall bars the way.
    xs = (-12.0, 0.0, 12.0)
    eyes = [*((x + 1.1, -10.9, 2.0) for x in xs), *((x + 1.9, -10.9, 0.9) for x in xs)]
    through, beside = distances(scene_of(name), eyes, (0.0, -1.0, 0.0)).reshape(2, 3)
    assert (through > 9.0).all()
    assert (beside < 1.5).all()


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
