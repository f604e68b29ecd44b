"""Builders of the ground: each shape has the heights that its numbers say, and leaves the rest as it was."""

from functools import partial

import numpy as np
import pytest
import shapely
from shapely.geometry import Point
from support.layout_checks import blank_site

from aerialdojo_gen.scenes.expressions import eased
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.ground_cover import steep_area
from aerialdojo_gen.scenes.kit.landforms import (
    banks_beside,
    dunes,
    earth_ramp,
    ground_by_formula,
    inland_m,
    level_area,
    moguls,
    profile_slope,
    sink_area,
    stepped_valley,
    terraces,
)
from aerialdojo_gen.scenes.kit.mountains import Ridge, high_ground, massif, steep_ground
from aerialdojo_gen.scenes.kit.rubble import crater, fault, heap, rises
from aerialdojo_gen.scenes.terrain import flat_terrain, rolling_terrain

blank = partial(blank_site, "N_T_0", seed=3)
FLAT = rolling_terrain((60, 60), 1.0, 1, 0.0, 20.0)
RISING = rises(blank(), FLAT, [(-30.0, 30.0, 6.0)], "y")
ABOVE = float(RISING.z(0.0, 10.0)) + 0.7
ALONG_X = [(-30.0, 0.0), (30.0, 0.0)]


@pytest.mark.parametrize(
    ("made", "heights"),
    [
        (lambda site: fault(site, FLAT, ALONG_X, 1.5, 1.0), {(3, 5): 0, (3, -5): -1.5}),
        (lambda site: crater(site, FLAT, (0.0, 0.0), 6.0, 3.0, 1.0), {(0, 0): -3, (6, 0): 0.8, (19, 0): 0}),
        (lambda site: heap(site, FLAT, rectangle(-5, -5, 5, 5), 2.0, 3), {(0, 0): 2, (8, 0): 0}),
        (lambda site: sink_area(site, FLAT, area=Point(0, 0).buffer(10), depth_m=2.0, blend_m=3.0),
         {(0, 0): -2, (11.5, 0): 0}),
        (lambda site: level_area(site, RISING, area=[rectangle(-10, 5, -4, 12), rectangle(4, 5, 10, 12)],
                                 above=(0.0, 10.0, 0.7), blend_m=2.0), {(-7, 8): ABOVE, (7, 8): ABOVE}),
        (lambda site: terraces(site, FLAT, area=Point(0, 0).buffer(15), steps=[(0, 0), (3, -2), (6, -2), (9, -5)]),
         {(0, 0): -5, (-10.5, 0): -2, (-20, 0): 0}),
        (lambda site: earth_ramp(site, FLAT, start=(-16, 0, 0.0), end=(4, 0, -5.0), width_m=4.0),
         {(x, 0): -(x + 16) / 4 for x in range(-16, 5, 4)}),
        (lambda site: stepped_valley(site, FLAT, cell_m=1.0, bed=ALONG_X, steps=[(4.0, 6.0, 2.0), (12.0, 16.0, 3.0)],
                                     roughness_m=0.0), {(0, 0): 0, (0, 9): 2, (0, 26): 5}),
        (lambda site: banks_beside(site, FLAT, line=ALONG_X, width_m=6.0, height_m=1.0), {(0, 0): 0, (0, 4): 0.88}),
        (lambda site: moguls(site, FLAT, area=rectangle(-10, -10, 10, 10), height_m=1.0),
         {(1, 1): 0.96, (3, 1): 0.01, (20, 20): 0}),
        (lambda site: profile_slope(site, FLAT, profile=[(-30.0, 0.0), (0.0, 0.0), (30.0, 9.0)]),
         {(0, -20): 0, (0, 20): 6}),
    ],
)  # fmt: skip
def test_the_ground_has_the_heights_asked_for(made, heights):
    ground = made(blank())
    for (x, y), z in heights.items():
        assert float(ground.z(x, y)) == pytest.approx(z, abs=0.15), (x, y)


def test_dunes_are_steeper_in_the_lee():
    ground = dunes(blank(80.0), FLAT, cell_m=1.0, height_m=5.0, wavelength_m=24.0, wind_deg=0.0)
    slope = np.diff(ground.heights_m, axis=1)
    assert np.ptp(ground.heights_m) > 4.0
    assert -np.quantile(slope, 0.02) > 1.3 * np.quantile(slope, 0.98)
    assert (slope > 0).mean() > 0.55


def test_mountains_rise_to_their_crests_and_show_rock_where_they_are_steep():
    site, flat = blank(), flat_terrain((60, 60))
    ridge = Ridge([(0.0, 10.0, 20.0)], 25.0, hollow=1.0)
    plain = massif(site, flat, ridges=[ridge], cell_m=1.5, bench_m=0.0, rough_m=0.0)
    assert float(plain.z(0.0, 10.0)) == pytest.approx(20.0, abs=1.5)
    assert float(plain.z(-29.0, -29.0)) == pytest.approx(0.0, abs=1e-9)
    site.set_ground(plain)
    faces, top = steep_ground(site, slope=1.2), high_ground(site, above_m=17.0, slope=2.0)
    assert shapely.contains_xy(top, 0.0, 10.0)
    assert not shapely.contains_xy(top, 0.0, -10.0)
    assert high_ground(site, above_m=50.0, slope=2.0).is_empty
    site.set_ground(massif(site, flat, ridges=[ridge], cell_m=1.5, bench_m=4.0, rough_m=0.0))
    assert faces.area < 0.1 * steep_ground(site, slope=1.2).area


def test_inland_is_positive_on_the_land_and_negative_at_sea():
    away = inland_m(rectangle(-10, -10, 10, 10), np.array([0.0, 9.0, 13.0]), np.zeros(3))
    assert away == pytest.approx([10.0, 1.0, -3.0])
    assert eased(np.array([-1.0, 0.5, 3.0]), 0.0, 1.0) == pytest.approx([0.0, 0.5, 1.0])


def test_steep_ground_is_found():
    site = blank()
    step = ground_by_formula(site, site.terrain, cell_m=2.0, height=lambda at: np.where(at["x"] > 0.0, 8.0, 0.0))
    steep = steep_area(step, 40.0)
    assert steep.contains(Point(1.0, 0.0))
    assert not steep.intersects(rectangle(6.0, -20.0, 25.0, 20.0))
