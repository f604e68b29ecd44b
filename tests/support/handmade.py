"""Small scenes made by hand from trimesh's primitives, for tests that need to know where everything is."""

from __future__ import annotations

import numpy as np
import trimesh

from aerialdojo_gen.pipeline.scoring.geometric import FACTORS, WEIGHTS
from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene
from aerialdojo_gen.store.schemas import DIFFICULTY_COLUMNS, SPLIT_COLUMNS

# Columns of anchors that do not matter to what reads them.
OPINIONS = {
    "score_geometric": 0.5, "score_clip": None, "score_vlm": None,
    **{f"part_{name}": 0.5 for name in (*WEIGHTS, *FACTORS)},
    "part_tells": None, "part_front": None, "off_front_rad": None, "no_front_reason": None, "step_back_m": 0.0,
    "thumbnail": b"",
}  # fmt: skip
# What a table tells of difficulty, of the start's view and of splits, where that does not matter.
UNTOLD = dict.fromkeys(DIFFICULTY_COLUMNS)
UNSEEN = {"target_visible_at_start": None, "visible_view_at_start": None}
UNSPLIT = dict.fromkeys(SPLIT_COLUMNS)


def instance(node: str, *meshes: trimesh.Trimesh, category: str = "thing") -> Instance:
    parts = tuple(
        Part(
            np.asarray(m.vertices, dtype=np.float64),
            np.asarray(m.faces, dtype=np.int32),
            np.zeros((len(m.vertices), 2), dtype=np.float32),
            "grey",
        )
        for m in meshes
    )
    return Instance(node, category, "", {}, parts)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def ground(half: float) -> Instance:
    return instance("ground", box((-half, -half, -0.5), (half, half, 0.0)), category="ground")


def scene(*instances: Instance, half: float = 15.0, ceiling: float = 15.0, name: str = "U_Test_0") -> Scene:
    return Scene(
        name,
        (ground(half + 1), *instances),
        {"grey": Material("grey", (128, 128, 128))},
        np.array([[-half, -half, 0.0], [half, half, ceiling]]),
    )


def mesh_of(item: Instance) -> trimesh.Trimesh:
    return trimesh.Trimesh(item.vertices, item.faces, process=False)
