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
}  # fmt: skip
