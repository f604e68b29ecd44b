"""UAV-ON: a list of episodes, NED metres, quaternions xyzw."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerialdojo_gen.exchange.fields import Fields
from aerialdojo_gen.exchange.task import Context, Instance, Task


def read(record: Fields, context: Context) -> Task:
    """Read an episode; it has a target and its places, and no reference trajectory."""
    pose = record.child("start_pose")
    start = context.upright_pose(pose.position("start_position"), pose.quaternion("start_quaternionr"))
    places = context.frame.positions_to_world(record.positions("pose"))
    nearest = places[int(np.argmin(np.linalg.norm(places - start[:3], axis=1)))]
    if len(places) > 1:
        context.notes["pose has several places of the target: the nearest to the start is the goal"] += 1
    scene, node = record.name("map_name"), record.text("object_name", empty=False)
    known: dict[str, Any] = {
        "target_name": record.text("true_name", empty=False),
        "mesh_node": node,
        "category": record.optional_text("category"),
    }
    if record.has("used-in-train"):
        known["subset"] = "train" if record.flag("used-in-train") else "test"
    if record.has("info"):
        info = record.child("info")
        if info.has("geodesic_distance"):
            known["stated_length_m"] = info.number("geodesic_distance")
    return Task(
        source_id=f"{scene}/{record.name('episode_id')}",
        scene=scene,
        start=start,
        goal=nearest,
        instances=[Instance("semantic", record.optional_text("description"))],
        object_key=(node, *nearest.tolist()),
        object_m=nearest,
        known=known,
    )
