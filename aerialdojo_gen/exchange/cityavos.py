"""CityAVOS: a list of missions, metres, z negative above the ground; which way x points is not stated."""

from __future__ import annotations

import math

from aerialdojo_gen.exchange.fields import BadField, Fields, rows_of
from aerialdojo_gen.exchange.folder import check_picture, inside
from aerialdojo_gen.exchange.task import Context, Instance, Task

_FULL_TURN = 2 * math.pi + 1e-6


def read(record: Fields, context: Context) -> Task:
    """Read a mission: a target in words and as a picture, and no reference trajectory."""
    *position, pitch, roll, yaw = rows_of([record.take("initial_pos")], 6, lambda _: "initial_pos")[0].tolist()
    if pitch or roll:
        context.notes["the start's attitude has roll or pitch: only its yaw is kept"] += 1
    start = context.start_pose(record.positions_of([position], "initial_pos")[0], _radians(yaw, context))
    goal = context.frame.positions_to_world(record.position("target_pos"))
    text = record.text("target_text", empty=False)
    instances = [Instance("semantic", text)]
    if context.pictures is not None:
        name = record.text("target_image_path", empty=False)
        try:
            picture = check_picture(inside(context.pictures, name))
        except ValueError as error:
            raise BadField("target_image_path", str(error)) from None
        instances.append(Instance("image", picture=picture))
    return Task(
        source_id=record.name("mission_id"),
        scene=record.name("scene_id"),
        start=start,
        goal=goal,
        instances=instances,
        object_key=tuple(goal.tolist()),
        object_m=goal,
    )


def _radians(yaw: float, context: Context) -> float:
    """The yaw in radians: some of these files have degrees in some rows."""
    if context.angles == "degrees":
        return math.radians(yaw)
    if abs(yaw) <= _FULL_TURN:
        return yaw
    if context.angles == "radians":
        raise BadField(
            "initial_pos[5]", f"yaw {yaw:g} is more than a turn in radians: --angles degrees, or mixed if rows differ"
        )
    context.notes["yaw of more than a turn in radians: taken as degrees, as --angles mixed asks"] += 1
    return math.radians(yaw)
