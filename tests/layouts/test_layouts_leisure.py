"""Stadiums and amusement parks: each stands up to a look from close by."""

import pytest
import shapely
from support.layout_checks import distances

from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.stands import Tier, gangways, passage, stand_platforms, tier_parts


@pytest.mark.parametrize("x", [-12.0, 0.0, 12.0])
def test_one_flies_from_the_pitch_through_a_portal_and_out_of_the_ground(scene_of, x):
    scene = scene_of("U_Stadium_0")
    # Under the upper rows and through the outer wall; beside the portal the front wall bars the way.
    through, beside = distances(scene, [(x + 1.1, -10.9, 2.0), (x + 1.9, -10.9, 0.9)], (0.0, -1.0, 0.0))
    assert through > 9.0
    assert beside < 1.5


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


def test_platforms_are_level_and_end_at_their_height():
    parts = dict(stand_platforms(areas=[rectangle(0, 0, 3, 2)], z=(0.5, 2.0), floor="floor", rim="rim"))
    assert parts["floor"].vertices[:, 2].min() == 0.5
    assert parts["floor"].vertices[:, 2].max() == 2.0
    assert parts["rim"].vertices[:, 2].max() == pytest.approx(2.12)
