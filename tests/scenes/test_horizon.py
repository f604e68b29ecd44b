"""What goes on beyond a scene's edge, and what ends there."""

import numpy as np
from support.layout_checks import catalogue

from aerialdojo_gen.scenes.plans.build import build_tables

SEA, SHALLOWS, RIVER = "water:#2a86ad", "water:#7fd6c6", "water:#4f6a72"
PLAN = {
    "plan": 1, "size_m": [40, 40], "ceiling_m": 20, "horizon": {"kind": "tropics"}, "ground": {"material": SEA},
    "site": [
        {"paint": [10, -5, 20, 5], "material": SHALLOWS},
        {"paint": [-20, -15, -10, 15], "material": "grass"},
        {"paint": [-20, -2, -10, 2], "material": RIVER},
    ],
}  # fmt: skip


def test_shallows_end_at_the_edge_and_rivers_go_on() -> None:
    scene = build_tables("N_Test_0", PLAN, catalogue())
    (beyond,) = scene.backdrop
    reach = {part.material: np.abs(part.vertices[:, :2]).max() for part in beyond.parts}
    assert reach[SHALLOWS] < 25.0
    assert reach[RIVER] > 200.0
    assert reach[SEA] > 1000.0


def test_a_road_goes_on_and_a_yard_ends() -> None:
    size, road, yard = [80, 80], "asphalt:#505050", "paving:#c0b8a8"
    plan = {
        "plan": 1, "size_m": size, "ceiling_m": 20, "horizon": {"kind": "suburb"}, "ground": {"material": "grass"},
        "site": [{"paint": [-40, -4, 40, 4], "material": road}, {"paint": [-40, 10, 40, 38], "material": yard}],
    }  # fmt: skip
    (beyond,) = build_tables("U_Test_0", plan, catalogue()).backdrop
    reach = {part.material: np.abs(part.vertices[:, :2]).max() for part in beyond.parts}
    assert reach[road] > 200.0
    assert 40.0 < reach[yard] < 80.0


def test_a_river_that_is_a_sheet_of_water_over_its_bed_goes_on_between_its_banks() -> None:
    bank, river = "grass:#6f8f46", "water:#4f7f8c"
    plan = {
        "plan": 1, "size_m": [80, 80], "ceiling_m": 20, "horizon": {"kind": "fields", "hills_m": 0},
        "ground": {"material": bank, "steps": [
            {"make": "rolling_ground", "cell_m": 2, "height_m": 0.1, "wavelength_m": 40},
            {"make": "slope", "start_m": -14, "end_m": -10, "to_m": -4, "within": [-14, 0]},
            {"make": "slope", "start_m": 14, "end_m": 10, "to_m": -4, "within": [0, 14]}]},
        "site": [{"node": "river", "parts": [
            {"shape": "block", "role": river, "corners": [-12, -40, 12, 40], "z": [-2, -1]}]}],
    }  # fmt: skip
    scene = build_tables("I_Test_0", plan, catalogue())
    (beyond,) = scene.backdrop
    water = [part for part in beyond.parts if part.material == river]
    assert water
    at = water[0].vertices
    assert np.abs(at[:, 1]).max() > 1000.0
    near = at[np.abs(at[:, 1]) < 43.0]
    np.testing.assert_allclose(near[:, 2], -1.0, atol=1e-6)
    assert np.abs(near[:, 0]).max() <= 14.0
