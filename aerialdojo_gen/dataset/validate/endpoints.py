"""Checks of where routes begin and end, and of the action sequence between: the anchors and the motion model."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from aerialdojo_gen.base.constants import NEAR_GOAL_M
from aerialdojo_gen.dataset.validate.foreign_keys import sound
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Ints, Rows, SceneData, pose_text
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.motion import TURN_RAD, replay
from aerialdojo_gen.store.schemas import APPROACH

_SAME_M = 1e-6
_SAME_RAD = 1e-6
# A replay adds up a few hundred rounded steps; what it may be off by stands in the README.
_REPLAY = 1e-5
_POSE = ("x_m", "y_m", "z_m", "yaw_rad")


@check("routes", needs=("anchors",), after=("list_lengths_differ", "unknown_start"))
def start_anchor(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """A route starts on its start anchor, turned by 180°."""
    paths = data.paths
    rows, anchor = _anchor_poses(data, data.start_of_route)
    anchor[:, 3] += math.pi
    yield from _off(paths.rows[rows], paths.starts[rows], anchor)


@check("routes", needs=("anchors",), after=("unknown_target",))
def goal_anchor(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The goal is the target's selected anchor."""
    anchors, goal = data["anchors"], data.goal_of_route
    fit = np.flatnonzero(sound(data, "anchors", goal))
    own = rows.floats("goal_x_m", "goal_y_m", "goal_z_m", "goal_yaw_rad")
    yield from _off(fit, own[fit], anchors.floats(*_POSE)[goal[fit]])


@check("routes", needs=("anchors",), after=("list_lengths_differ", "unknown_target"))
def end_position(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """The last position is the target's selected anchor."""
    rows, anchor = _anchor_poses(data, data.goal_of_route)
    ends = data.paths.ends[rows]
    anchor[:, 3] = ends[:, 3]
    yield from _off(data.paths.rows[rows], ends, anchor)


@check("routes", needs=("anchors",), after=("list_lengths_differ", "unknown_target"))
def final_yaw(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """The last yaw is within 7.5° of the anchor's."""
    rows, anchor = _anchor_poses(data, data.goal_of_route)
    off = np.degrees(np.abs(wrap_angle_rad(data.paths.ends[rows, 3] - anchor[:, 3])))
    for k in np.flatnonzero(off > math.degrees(TURN_RAD / 2) + 1e-6):
        yield Finding(int(data.paths.rows[rows[k]]), f"{off[k]:.3f}° off the anchor's yaw", "7.5° at most")


@check("routes", after=("list_lengths_differ", "action_order"))
def replay_differs(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """The actions, replayed through the motion model, give the stored poses (up to the Approach)."""
    paths = data.paths
    skip = data.flagged("routes", ("list_lengths_differ", "action_order"))[paths.rows]
    for k in np.flatnonzero(~skip):
        where = paths.of(int(k))
        poses = np.column_stack([paths.xyz[where], paths.yaw[where]])
        flown = replay(poses[0], paths.action[where][:-1])
        off = np.abs(flown - poses)
        off[:, 3] = np.abs(wrap_angle_rad(off[:, 3]))
        if paths.action[where][-2] == APPROACH:
            off[-1, :3] = 0.0
        if not off.max() <= _REPLAY:
            step = int(np.argmax(off.max(axis=1) > _REPLAY))
            yield Finding(int(paths.rows[k]), f"pose {step} at {pose_text(poses[step])}", f"{pose_text(flown[step])}")


@check("routes", needs=("anchors",), after=("list_lengths_differ", "action_order", "replay_differs", "end_position",
                                            "unknown_target"))  # fmt: skip
def stops_far(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """An agent that flies the actions, which are without the Approach, stops within 1 m of the anchor."""
    paths = data.paths
    rows, anchor = _anchor_poses(data, data.goal_of_route)
    last = paths.first[1:][rows] - 1
    # The replay is the stored poses by the check above: the Approach is all that it leaves out.
    last -= paths.action[last - 1] == APPROACH
    off = np.linalg.norm(paths.xyz[last] - anchor[:, :3], axis=1)
    for k in np.flatnonzero(off > NEAR_GOAL_M + _REPLAY):
        yield Finding(int(paths.rows[rows[k]]), f"{off[k]:.3f} m from the anchor", f"{NEAR_GOAL_M:g} m at most")


def _anchor_poses(data: SceneData, anchor_of_route: Ints) -> tuple[Ints, Floats]:
    """Routes with a sound anchor, as places in `paths`, and that anchor's pose, (n, 4)."""
    anchor = anchor_of_route[data.paths.rows]
    fit = np.flatnonzero(sound(data, "anchors", anchor))
    return fit, data["anchors"].floats(*_POSE).reshape(-1, 4)[anchor[fit]]


def _off(rows: Ints, own: Floats, wanted: Floats) -> Iterator[Finding]:
    """Rows whose pose is not the wanted one."""
    far = np.abs(own[:, :3] - wanted[:, :3]).max(axis=1, initial=0.0) > _SAME_M
    turned = np.abs(wrap_angle_rad(own[:, 3] - wanted[:, 3])) > _SAME_RAD
    for k in np.flatnonzero(far | turned):
        yield Finding(int(rows[k]), pose_text(own[k]), pose_text([*wanted[k, :3], wrap_angle_rad(wanted[k, 3])]))
