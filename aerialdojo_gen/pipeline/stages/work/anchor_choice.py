"""Anchors chosen by a person: their checks, and their rank among the sampled anchors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.config.sections import AnchorSampleConfig
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.part_visibility import FRONT_RAD
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.pipeline.scoring.ensemble import SCORERS
from aerialdojo_gen.pipeline.scoring.geometric import judge
from aerialdojo_gen.pipeline.stage import Job
from aerialdojo_gen.pipeline.stages.work.anchor_pictures import CandidateViews
from aerialdojo_gen.pipeline.stages.work.anchor_world import Candidates, World

Floats = NDArray[np.float64]

# Tolerance of the distance for hand-placed anchors.
SLACK_M = 0.5
# Files hold millimetres and hundredths of a degree.
_SAME_M, _SAME_RAD = 2e-3, math.radians(0.02)


def judge_anchor(
    position_m: Floats, yaw_rad: float, item: dict[str, Any], world: World, job: Job, config: AnchorSampleConfig
) -> tuple[dict[str, Any], list[str]]:
    """Check a viewpoint (world metres, radians) against all rules for anchors (paper: anchors): row, faults."""
    k = world.index[item["mesh_node"]]
    instance = world.scene.instances[k]
    surface = Surface.of(instance)
    place = position_m[None]
    radius = job.embodiment.radius_m
    faults = []
    low, high = world.scene.bounds
    inside = bool(((position_m >= low + radius) & (position_m <= high - radius)).all())
    if not inside:
        faults.append("it is outside the flight volume")
    clearance = float(world.free.distance_m(position_m)[0])
    if clearance < radius + config.margin_m:
        faults.append(f"it is in collision: the nearest surface is {clearance:.2f} m away, the body needs "
                      f"{radius + config.margin_m:.2f} m")  # fmt: skip
    elif inside and world.free.below_ground(position_m):
        faults.append("it is below the ground")
    elif inside and not world.free.reachable(position_m):
        faults.append("no way leads there from the open sky")
    distance = float(surface.distance_m(place)[0])
    if abs(distance - config.standoff_m) > SLACK_M:
        side = "near" if distance < config.standoff_m else "far"
        faults.append(f"it is too {side}: {distance:.2f} m from the object's surface, not about "
                      f"{config.standoff_m:g} m")  # fmt: skip
    points = surface.sample(config.surface_points, generator(job.seed, "anchor-sample", job.scene, item["object_id"]))
    candidates = Candidates(world, k, points, place, np.array([yaw_rad]), radius, config)
    share = float(candidates.views.visible_fraction[0])
    if share <= 0 or share < config.min_visible_fraction:
        faults.append(f"it does not see the object: {share:.0%} of what it faces, {config.min_visible_fraction:.0%} "
                      "is the least")  # fmt: skip
    candidate_views = CandidateViews.of(candidates, np.zeros(1, np.int64))
    picture = candidate_views.picture(0, config.picture_px)
    parts = judge(picture, radius, config.standoff_m)
    row = {
        "scene": job.scene,
        "object_id": item["object_id"],
        **candidates.row(0, distance),
        "no_front_reason": None,
        "step_back_m": float(candidate_views.step_back_m[0]),
        # The other scorers compare candidates; there is only one here.
        "score": parts.score,
        **{f"score_{name}": parts.score if name == "geometric" else None for name in SCORERS},
        **parts.columns,
        "thumbnail": picture.jpeg(),
    }
    return row, faults


def with_choice(
    rows: list[dict[str, Any]],
    choice: dict[str, Any],
    item: dict[str, Any],
    world: World,
    job: Job,
    config: AnchorSampleConfig,
) -> list[dict[str, Any]]:
    """Put the chosen anchor first among an object's anchors, and select it."""
    same = [row for row in rows if is_same(row, choice)]
    if same:
        first = same[0]
    else:
        position = np.array([choice["x_m"], choice["y_m"], choice["z_m"]])
        first, faults = judge_anchor(position, choice["yaw_rad"], item, world, job, config)
        if faults:
            raise AnnotationError(
                f"{job.scene}: the anchor chosen for object {item['object_id']} ({item['name']}) will not do: "
                f"{'; '.join(faults)}. Choose another one: {command('annotate', scene=job.scene)}"
            )
    ordered = [first, *(row for row in rows if row is not first)][: config.shortlist]
    return [
        row
        | {
            "anchor_id": rank,
            "selected": rank == 0,
            "selected_by": "annotation" if rank == 0 else "auto",
            "no_front_reason": _off_front(row) if rank == 0 else None,
        }
        for rank, row in enumerate(ordered)
    ]


def _off_front(row: dict[str, Any]) -> str | None:
    return None if row["off_front_rad"] is None or row["off_front_rad"] <= FRONT_RAD else "chosen"


def is_same(row: dict[str, Any], choice: dict[str, Any]) -> bool:
    """Whether a choice equals a sampled anchor to the annotation file's precision."""
    turn = abs(float(wrap_angle_rad(row["yaw_rad"] - choice["yaw_rad"])))
    return turn <= _SAME_RAD and math.dist(
        [row[a] for a in ("x_m", "y_m", "z_m")], [choice[a] for a in ("x_m", "y_m", "z_m")]
    ) <= _SAME_M  # fmt: skip
