"""OpenFly: a list of trajectories, z up, yaw in radians counter-clockwise; which way x points is not stated."""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.exchange.actions import move
from aerialdojo_gen.exchange.aerialvln import named, paired
from aerialdojo_gen.exchange.fields import BadField, Fields
from aerialdojo_gen.exchange.task import Context, Instance, Task

MOVES = {
    0: move("stop"), 1: move("forward 3 m", forward=3), 2: move("turn left 30°", turn_deg=30),
    3: move("turn right 30°", turn_deg=-30), 4: move("up 3 m", up=3), 5: move("down 3 m", up=-3),
    6: move("left 3 m", left=3), 7: move("right 3 m", left=-3), 8: move("forward 6 m", forward=6),
    9: move("forward 9 m", forward=9),
}  # fmt: skip
_FULL_TURN = 2 * np.pi + 1e-6


def read(record: Fields, context: Context) -> Task:
    """Read a trajectory: an instruction and the way it describes; its end is the goal, and no object is named."""
    image_path = record.text("image_path", empty=False)
    points = context.frame.positions_to_world(record.positions("pos"))
    yaws = record.numbers("yaw")
    if len(yaws) != len(points):
        raise BadField("yaw", f"has {len(yaws)} values for {len(points)} positions")
    if np.abs(yaws).max() > _FULL_TURN:
        k = int(np.abs(yaws).argmax())
        raise BadField(f"yaw[{k}]", f"{yaws[k]:g} is more than a turn in radians: degrees?")
    poses = np.column_stack([points, context.frame.yaw_to_world(yaws)])
    try:
        route = paired(named(record.whole_numbers("action"), MOVES), poses, context)
    except BadField as error:
        raise BadField(error.field.replace("actions", "action"), error.why) from None
    return Task(
        source_id=image_path,
        scene=image_path.replace("\\", "/").split("/")[0],
        start=poses[0],
        goal=points[-1],
        instances=[Instance("semantic", record.text("gpt_instruction", empty=False))],
        route=route,
    )
