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
