"""Small recipes of the layouts whose parameters draw a scene: each stands in one, and builds in a second or two."""

from __future__ import annotations

from typing import Any

_GROUP = {"name": "camp", "at": [8, -8], "radius_m": 5, "place": "in the camp", "yaw_deg": 20, "level": True,
          "facing": "middle", "things": ["bench", "mailbox @ 1 -2.5 90", "bench | beside the track"]}  # fmt: skip

RECIPES: dict[str, dict[str, Any]] = {
    "N_Peak_0": {
        "layout": "mountain", "seed": 5, "size_m": [36, 34], "ceiling_m": 30, "parameters": {
            "ridges": [{"line": [[-10, 14, 9], [10, 14, 12]], "width_m": 14}, {"line": [[14, 0, 6]], "width_m": 8}],
            "bench_m": 2, "fall_m": 2, "hills": [[-10, -8, 5, 1]], "stream": [[-17, -4], [0, -3], [17, -6]],
            "tarn": {"at": [-9, 4], "radius_m": 2}, "paths": [[[-4, -16], [-2, -8], [4, 2]]],
            "bridges": [[-1.5, -3, 90, 6]], "crags": [{"at": [4, -12], "radius_m": 2, "height_m": 3, "blocks": 3}],
            "snow_z_m": 9, "trees_z_m": 3, "boulders": 2, "groups": [{**_GROUP, "at": [12, -12]}],
        },
    },
    "N_Birch_0": {
        "layout": "forest", "seed": 6, "size_m": [36, 34], "ceiling_m": 20, "parameters": {
            "relief_m": 1, "tree_spacing_m": 9, "undergrowth": 0.1, "birch_wood": {
                "creek": [[-17, -8], [0, -10], [17, -8]], "paths": [[[-15, 14], [0, 13], [15, 14]]],
                "hills": [[10, 5, 5, 1]], "bridges": [[0, -10, 90, 8]], "abbey": [-6, 3, 10],
                "groups": [{**_GROUP, "at": [9, 3], "radius_m": 4}],
            },
        },
    },
}  # fmt: skip
