"""AerialVLN: episodes with instructions, NED metres, quaternions wxyz."""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.exchange.actions import Move, move, replay, replay_error_m
from aerialdojo_gen.exchange.fields import BadField, Fields, Floats, shown
from aerialdojo_gen.exchange.task import Context, Instance, Route, Task

MOVES = {
    0: move("stop"), 1: move("forward 5 m", forward=5), 2: move("turn left 15°", turn_deg=15),
    3: move("turn right 15°", turn_deg=-15), 4: move("up 2 m", up=2), 5: move("down 2 m", up=-2),
    6: move("left 5 m", left=5), 7: move("right 5 m", left=-5),
}  # fmt: skip


def named(numbers: list[int], moves: dict[int, Move]) -> list[Move]:
    """Look actions up by their numbers; BadField where there is no such action."""
    for k, number in enumerate(numbers):
        if number not in moves:
            raise BadField(f"actions[{k}]", f"unknown action {number}: known are {', '.join(map(str, moves))}")
    return [moves[number] for number in numbers]


def paired(moves: list[Move], poses: Floats, context: Context) -> Route:
    """Join actions and poses; where they are not one a pose, the poses stand and the actions keep their own names."""
    names = [m.name for m in moves]
    done = moves[:-1] if moves[-1].name == "stop" else moves
    if "stop" in names[: len(done)]:
        raise BadField(f"actions[{names.index('stop')}]", "stop before the end")
    error = replay_error_m(done, poses)
    if len(done) != len(poses) - 1:
        context.notes["not one action a pose: action is null, source_action has them"] += 1
        return Route(poses, None, names, error)
    ours = [m.ours for m in done]
    if any(action is None for action in ours):
        context.notes["has actions that are none of ours: action is null, source_action has them"] += 1
        return Route(poses, None, names, error)
    return Route(poses, [a for a in ours if a is not None] + [0], names, error)


def read(record: Fields, context: Context) -> Task:
    """Read an episode. Its path has positions; yaws follow from the start's and the turns."""
    w, x, y, z = record.quaternion("start_rotation").tolist()
    start = context.upright_pose(record.position("start_position"), np.array([x, y, z, w]))
    goals = [Fields(goal, f"goals[{i}]") for i, goal in enumerate(record.items("goals"))]
    goal = context.frame.positions_to_world(goals[0].position("position"))
    instruction = record.child("instruction")
    route = None
    if record.has("reference_path"):
        rows = record.items("reference_path")
        for i, row in enumerate(rows):
            if not isinstance(row, list) or len(row) not in (3, 6, 7):
                raise BadField(f"reference_path[{i}]", f"expected x, y, z, maybe an attitude, found {shown(row)}")
        if any(len(row) > 3 for row in rows):
            context.notes["reference_path has attitudes: yaws are taken from start_rotation and the turns"] += 1
        points = context.frame.positions_to_world(record.positions_of([row[:3] for row in rows], "reference_path"))
        route = _route(record, context, start, points)
    if len(goals) > 1:
        context.notes["has several goals: the first is kept"] += 1
    record.has("trajectory_id") and record.name("trajectory_id")
    return Task(
        source_id=record.name("episode_id"),
        scene=record.name("scene_id"),
        start=start,
        goal=goal,
        instances=[Instance("semantic", instruction.text("instruction_text", empty=False))],
        route=route,
    )


def _route(record: Fields, context: Context, start: Floats, points: Floats) -> Route | None:
    if not record.has("actions"):
        context.notes["reference_path without actions, hence without yaws: left aside"] += 1
        return None
    moves = named(record.whole_numbers("actions"), MOVES)
    done = moves[:-1] if moves[-1].name == "stop" else moves
    if len(done) == len(points) - 1:
        yaws = replay(start, np.array([m.step for m in done], np.float64).reshape(-1, 4))[:, 3]
    else:
        yaws = np.full(len(points), start[3])
    return paired(moves, np.column_stack([points, yaws]), context)
