"""What goes on beyond a scene's edge, and what ends there."""

import numpy as np
from support.layout_checks import catalogue

from aerialdojo_gen.scenes.model import Part
from aerialdojo_gen.scenes.plans.build import build_tables


def beyond(size_m: int, horizon: dict, ground: dict, *site: dict) -> dict[str, Part]:
    """Parts of the backdrop of a square site by material."""
    head = {"plan": 1, "size_m": [size_m, size_m], "ceiling_m": 20}
    plan = head | {"horizon": horizon, "ground": ground, "site": list(site)}
    (backdrop,) = build_tables("N_Test_0", plan, catalogue()).backdrop
    return {part.material: part for part in backdrop.parts}


def reach(part: Part) -> float:
    return np.abs(part.vertices[:, :2]).max()


def test_shallows_end_at_the_edge_and_rivers_go_on() -> None:
    sea, shallows, river = "water:#2a86ad", "water:#7fd6c6", "water:#4f6a72"
    shown = beyond(
        40, {"kind": "tropics"}, {"material": sea}, {"paint": [10, -5, 20, 5], "material": shallows},
        {"paint": [-20, -15, -10, 15], "material": "grass"}, {"paint": [-20, -2, -10, 2], "material": river},
    )  # fmt: skip
    assert reach(shown[shallows]) < 25.0
    assert reach(shown[river]) > 200.0
    assert reach(shown[sea]) > 1000.0


def test_a_road_goes_on_and_a_yard_ends() -> None:
    road, yard = "asphalt:#505050", "paving:#c0b8a8"
    shown = beyond(
        80, {"kind": "suburb"}, {"material": "grass"}, {"paint": [-40, -4, 40, 4], "material": road},
        {"paint": [-40, 10, 40, 38], "material": yard},
    )  # fmt: skip
    assert reach(shown[road]) > 200.0
    assert 40.0 < reach(shown[yard]) < 80.0


def test_a_river_that_is_a_sheet_of_water_over_its_bed_goes_on_between_its_banks() -> None:
    river = "water:#4f7f8c"
    banks = [{"make": "slope", "start_m": start, "end_m": end, "to_m": -4, "within": within}
             for start, end, within in ((-14, -10, [-14, 0]), (14, 10, [0, 14]))]  # fmt: skip
    hills = {"make": "rolling_ground", "cell_m": 2, "height_m": 0.1, "wavelength_m": 40}
    water = {"shape": "block", "role": river, "corners": [-12, -40, 12, 40], "z": [-2, -1]}
    shown = beyond(
        80, {"kind": "fields", "hills_m": 0}, {"material": "grass:#6f8f46", "steps": [hills, *banks]},
        {"node": "river", "parts": [water]},
    )  # fmt: skip
    at = shown[river].vertices
    assert np.abs(at[:, 1]).max() > 1000.0
    near = at[np.abs(at[:, 1]) < 43.0]
    np.testing.assert_allclose(near[:, 2], -1.0, atol=1e-6)
    assert np.abs(near[:, 0]).max() <= 14.0
