"""The court of `rendered` as a data directory with routes, and runs of the stage `render` on it."""

from __future__ import annotations

import math

from support.handmade import job_of, write_rows, write_scene, xyz
from support.rendered import courtyard

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.pipeline import runner
from aerialdojo_gen.pipeline.options import RunOptions
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.pipeline.stages.work import render
from aerialdojo_gen.rendering.sample import n_parts
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.tables import check_table

SCENE = "U_Court_0"
CONFIG = RenderConfig(width=64, height=64, limit=1, trajectories_per_part=1, renderer="pybullet")
# In the court, from its middle: forward 3 m, up 1 m, a turn to the left, left 1 m, and on to the anchor.
ROUTE = {
    "x_m": [-3.0, 0.0, 0.0, 0.0, -0.2588190451, -0.5],
    "y_m": [0.0, 0.0, 0.0, 0.0, 0.9659258263, 1.2],
    "z_m": [2.0, 2.0, 3.0, 3.0, 3.0, 3.2],
    "yaw_rad": [0.0, 0.0, 0.0, math.radians(15), math.radians(15), math.radians(15)],
    "action": [2, schemas.MOVE_UP_1, schemas.TURN_LEFT, 4, schemas.APPROACH, schemas.STOP],
}
# Into the blue cube and out again.
BAD = ROUTE | {"x_m": [-5.0, -2.0, -2.0, -2.0, -2.0, 1.0], "y_m": [-5.0] * 6, "z_m": [1.0] * 6, "yaw_rad": [0.0] * 6}


def route_row(nav_id, setting, lists):
    goal = [lists[name][-1] for name in ("x_m", "y_m", "z_m")]
    row = {"nav_id": nav_id, "setting": setting, "target_object_id": 1, "n_actions": len(lists["action"])}
    return {**row, **xyz(goal, "goal_{}_m"), **lists}


def write_inputs(data, bad=BAD, n_long=10):
    """Write the tables that recording reads; the route nav_b is `bad`, `n_long` more are of the longest setting."""
    scene = courtyard()
    write_scene(data, scene)
    anchors = (
        (0, 0, 4.0, 1.5, 1.5, True), (0, 1, 4.0, 1.0, 1.5, False),
        (1, 0, 0.0, -5.0, 1.0, True),  # looks away from its object
    )  # fmt: skip
    rows = {
        "objects": [
            {"object_id": k, "mesh_node": node, **xyz(scene[node].centroid)}
            for k, node in enumerate(("red_cube", "blue_cube", "west"))
        ],
        "anchors": [
            {"object_id": k, "anchor_id": a, **xyz(place), "selected": selected} for k, a, *place, selected in anchors
        ],
        "routes/train": [
            route_row("nav_a", "base", ROUTE), route_row("nav_b", "standard", bad),
            *(route_row(f"nav_{k:02}", "long_horizon", ROUTE) for k in range(n_long)),
        ],
        "routes/test": [],
    }  # fmt: skip
    for table, content in rows.items():
        write_rows(data, table, content, SCENE)


def run_all(data, config, stage=render, name="render"):
    parts = n_parts(data, SCENE, config) if name == "render" else 1
    outputs = [stage.run(job_of(name, data, SCENE, k, parts), config) for k in range(parts)]
    for output in outputs:
        for table, rows in output.tables.items():
            check_table(store.LAYOUT[table].spec, rows)
    return outputs


def run_whole(data, config, workers=1, reporter=None, **options):
    """Run the stage as the command does."""
    options, roots = RunOptions(workers, **options), job_of("render", data, SCENE).roots
    stages, pipeline = [BY_NAME["render"]], Pipeline(render=config)
    return runner.run(stages, [SCENE], pipeline, roots, options=options, reporter=reporter)


def files_of(data):
    """Every file that recording wrote, by its path in the data directory, and its bytes."""
    found = (p for folder in ("recordings", "frames", "media") for p in sorted((data / folder).rglob("*")))
    return {str(p.relative_to(data)): p.read_bytes() for p in found if p.is_file()}
