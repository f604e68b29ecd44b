"""Small recipes of the layouts whose parameters draw a scene: each stands in one, and builds in a second or two."""

from __future__ import annotations

from typing import Any

_GROUP = {"name": "camp", "at": [8, -8], "radius_m": 5, "place": "in the camp", "yaw_deg": 20, "level": True,
          "facing": "middle", "things": ["bench", "mailbox @ 1 -2.5 90", "bench | beside the track"]}  # fmt: skip
_ROOF = {"name": "roof", "at": [0, 0], "radius_m": 2, "on": "house", "things": ["mailbox @ 0 0 ^ 0.1"]}

RECIPES: dict[str, dict[str, Any]] = {
    "N_Dunes_0": {
        "layout": "desert", "seed": 2, "size_m": [32, 30], "ceiling_m": 16, "parameters": {
            "height_m": 1.5, "hills": [[0, 8, 6, 1.0]], "tracks": [[[-14, -3], [0, -4], [14, -2]]],
            "pond": {"at": [-9, -9], "radius_m": 2.5, "green_m": 1.5, "palms": 2},
            "crops": [{"at": [10, 6], "size_m": [5, 4], "rows": 2}],
            "rocks": [{"name": "butte", "at": [-9, 8], "radius_m": 4, "height_m": 3, "long": 1.3, "yaw_deg": 10}],
            "houses": [{"name": "house", "at": [0, 0], "size_m": [6, 7, 3.4], "yaw_deg": 15}],
            "walls": [{"path": [[6, 11], [11, 11]], "height_m": 2, "decay": 0.4}],
            "groups": [_GROUP, _ROOF], "stones": 3, "shrubs": 2, "trees": 1,
        },
    },
    "N_Wash_0": {
        "layout": "desert", "seed": 3, "size_m": [30, 30], "ceiling_m": 16, "parameters": {
            "ground": "wash", "height_m": 0.6, "bed": [[-15, 0], [0, 2], [15, 0]], "bed_m": 5,
            "steps": [[5, 9, 1.5]], "stones": 2, "shrubs": 1, "trees": 0,
        },
    },
    "N_Slope_0": {
        "layout": "snowfield", "seed": 4, "size_m": [36, 34], "ceiling_m": 20, "parameters": {
            "profile": [[-17, 0], [17, 5]], "lean": 0.02, "hills": [[-8, 8, 5, 1]],
            "pistes": [{"path": [[-12, 15], [-11, 0], [-12, -15]], "width_m": 5, "gates": 2, "moguls_m": 0.3}],
            "huts": [{"name": "hut", "at": [4, 4], "yaw_deg": -90},
                     {"name": "chalet", "kind": "gable", "at": [10, -12], "size_m": [5, 6, 3]}],
            "rocks": [{"name": "rock", "at": [14, 12], "radius_m": 2, "height_m": 2}],
            "lift": [[-5, -14], [-5, 0], [-5, 14]], "cabins": 2,
            "rink": {"at": [4, -6], "size_m": [9, 7], "yaw_deg": 5}, "lake": [14, 3, 2.5],
            "roads": [[[-3, -16], [16, -15]]], "ridges": [[[10, 15], [15, 15]]], "road_m": 2,
            "groups": [{"name": "porch", "at": [4, 4], "radius_m": 3, "on": "hut", "things": ["mailbox @ 0 0"]}],
            "spruces": 2, "boulders": 1,
        },
    },
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
