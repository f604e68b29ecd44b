"""Small plans that call many builders of the kit: each builds in a second or two."""

from __future__ import annotations

from typing import Any

_THINGS = {"place": [["tent:red", -8, -9, 30], ["campfire:out | by the tents", -5, -9]], "phrase": "in the camp",
           "settle_m": 0.5, "room_m": 1, "level": True}  # fmt: skip

PLANS: dict[str, dict[str, Any]] = {
    "N_Peak_0": {
        "plan": 1, "seed": 5, "size_m": [36, 34], "ceiling_m": 30, "palette": {"way": "dirt:#a08a68"},
        "lines": {"stream": {"points": [[-17, -4], [0, -3], [17, -6]], "smooth": 2},
                  "path": {"points": [[-4, -16], [-2, -8], [4, 2]], "smooth": 3}},
        "areas": {"tarn": {"blob": [-9, 4, 2, 5, 0.2]}, "water": {"ribbon": "stream", "width_m": 2, "plus": "tarn"},
                  "slope": {"box": [-16, -15, 16, 15], "minus": {"area": "water", "grow_m": 0.8}}},
        "fields": {"glades": {"patches": [16, 13, 1.2]}, "foot": {"near": "faces", "reach_m": 6},
                   "wooded": "max(0, min(1, (9 - z)/4))*min(1, 0.6*glades)"},
        "ground": {"material": "meadow", "steps": [
            {"make": "massif", "bench_m": 2, "ridges": [
                {"line": [[-10, 14, 9], [10, 14, 12]], "width_m": 14}, {"line": [[14, 0, 6]], "width_m": 8}]},
            {"make": "ground_by_formula", "height": "z + 2*(y/34 + 0.5)"},
            {"make": "hill", "at": [-10, -8], "radius_m": 5, "height_m": 1},
            {"make": "level_along", "lines": ["path"], "width_m": 1.6},
            {"make": "sink_area", "area": {"ribbon": "stream", "width_m": 6}, "depth_m": 1, "blend_m": 2},
            {"make": "level_under_things"},
            {"make": "level_area", "area": {"area": "tarn", "grow_m": 0.4}, "above": [-9, 4, 0]},
        ]},
        "site": [
            {"make": "paint_patches", "materials": ["grass", "moss"], "count": 4, "radius_m": [2, 5]},
            {"make": "steep_ground", "slope": 0.85, "as": "faces"},
            {"paint": {"area": "faces", "grow_m": [1.1, 2]}, "material": "gravel"},
            {"paint": {"ribbon": "path", "width_m": 1.5, "round_ends": True}, "material": "way"},
            {"make": "paint_shore", "water": "water", "material": "mud"},
            {"make": "crags", "materials": ["rock", "rock"], "crags": [
                {"at": [4, -12], "radius_m": 2, "height_m": 3, "blocks": 3}]},
            {"make": "footbridge", "at": [-1.5, -3], "yaw_deg": 90, "span_m": 6, "place": "over the stream"},
            _THINGS,
            {"make": "keep_free", "areas": [{"ribbon": "path", "width_m": 2}, {"disc": [-7, -9, 4]}]},
            {"make": "woods", "area": "slope", "spacing_m": 6, "density": "wooded", "place": "in it", "species": [
                {"of": "spruce_tree", "habitat": "2*glades"}, {"of": "dead_tree:grey", "habitat": 1, "share": 0.5}]},
            {"make": "strew", "of": "boulder", "area": "slope", "density": "0.04 + 0.9*foot", "spacing_m": 3,
             "limit": 3},
        ],
    },
    "N_Abbey_0": {
        "plan": 1, "seed": 6, "size_m": [30, 28], "ceiling_m": 16,
        "ground": {"material": "leaf_litter", "steps": [
            {"make": "rolling_ground", "cell_m": 1.7, "height_m": 1, "wavelength_m": 40, "octaves": 2}]},
        "site": [
            {"make": "roofless_walls", "node": "abbey", "at": [-4, 2], "yaw_deg": 10, "stone": "blocks", "walls": [
                {"ends": [[-5, -3], [5, -3]], "height_m": 4, "openings": [[1, 2, 1, 3]]},
                {"ends": [[5, -3], [5, 3]], "height_m": 2}], "columns": [[0, 0]]},
            {"make": "fence_panels", "of": "wooden_fence:brown", "lines": [[[8, -8], [8, 8]]], "panel_m": 2.4,
             "margin_m": 0.5},
            {"make": "undergrowth", "area": [-14, -13, 14, 13], "density": 0.5, "kinds": [
                {"of": "fern", "spacing_m": 3, "limit": 3}, {"of": "bush", "spacing_m": 4, "limit": 2}]},
        ],
    },
}  # fmt: skip
