"""Checks of routes by their stored poses: lists that fit, lengths, the rules of keeping, anchors, actions."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from aerialdojo_gen.base.constants import NEAR_GOAL_M
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import (
    POSE,
    Floats,
    Ints,
    Mask,
    Rows,
    SceneData,
    at,
    place_text,
    pose_text,
)
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.motion import TURN_RAD, replay
from aerialdojo_gen.pipeline.stages.work.rules import KEPT, judge
from aerialdojo_gen.store.schemas import APPROACH, STOP

_LENGTH_M = _SAME_M = _SAME_RAD = 1e-6
# A replay adds up a few hundred rounded steps; what it may be off by stands in the README.
_REPLAY = 1e-5


@check("routes")
def list_lengths_differ(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The five lists of a route are of equal length, two poses at least."""
    lengths = rows.list_lengths()
    for row in np.flatnonzero((lengths != lengths[:, :1]).any(axis=1) | (lengths[:, 0] < 2)):
        yield Finding(int(row), f"lists of {', '.join(str(n) for n in lengths[row])}", "one length, 2 or more")


@check("routes", after=("list_lengths_differ",))
def action_order(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """Actions are those of the set; Stop is the last and no other, Approach the last but one or none."""
    for row in np.flatnonzero(data.paths.fit).tolist():
        actions = data.paths.action[data.paths.of(row)]
        if actions[-1] != STOP or (actions[:-1] <= STOP).any() or (actions > APPROACH).any():
            shown = actions.tolist() if len(actions) <= 8 else f"[… {', '.join(map(str, actions[-8:]))}]"
            yield Finding(row, f"actions {shown}", "Stop (0) at the last pose alone")
        elif (actions[:-2] == APPROACH).any():
            yield Finding(row, f"Approach at pose {int(np.flatnonzero(actions == APPROACH)[0])}", "the last but one")


@check("routes", after=("list_lengths_differ",))
def n_actions(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The number of actions is the length of the list."""
    stored, counted = rows.ints("n_actions"), np.diff(data.paths.first)
    for row in np.flatnonzero(stored != counted):
        yield Finding(int(row), str(stored[row]), str(counted[row]))


@check("routes", after=("list_lengths_differ",))
def route_length(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """L is the sum of the distances between consecutive positions."""
    yield from _differs(rows.floats("length_m"), data.paths.length_m, " m")


@check("routes", after=("list_lengths_differ",))
def euclidean_distance(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """d_E is the distance from the first to the last position."""
    yield from _differs(rows.floats("euclidean_m"), data.paths.euclidean_m, " m")


@check("routes", after=("list_lengths_differ",))
def detour_ratio(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """κ is L / d_E."""
    ratio = data.paths.length_m / np.maximum(data.paths.euclidean_m, 1e-12)
    yield from _differs(rows.floats("detour_ratio"), ratio, "")


@check("routes", after=("list_lengths_differ",))
def keeping_rule(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The route passes the rules of `filter`: d_E, L, κ and the action budget of its setting."""
    reason, _, length, euclidean = _judged(data, rows)
    for row in np.flatnonzero(reason != KEPT):
        measured = f"L = {length[row]:.4f} m, d_E = {euclidean[row]:.4f} m, {np.diff(data.paths.first)[row]} actions"
        yield Finding(int(row), f"{reason[row]}: {measured}", KEPT)


@check("routes", after=("list_lengths_differ", "keeping_rule"))
def route_setting(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The setting is that of the route's length."""
    _, setting, length, _ = _judged(data, rows)
    stored = rows.texts("setting")
    for row in np.flatnonzero(stored != setting.astype(object)):
        yield Finding(int(row), str(stored[row]), f"{setting[row]}, for {length[row]:.4f} m")


@check("routes", after=("list_lengths_differ",))
def out_of_bounds(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """The body never leaves the flight volume."""
    paths, radius = data.paths, data.pipeline.embodiment.radius_m
    low, high = (np.array([data.scene_row[f"{end}_{axis}_m"] for axis in "xyz"]) for end in ("min", "max"))
    outside = ((paths.xyz < low + radius - _LENGTH_M) | (paths.xyz > high - radius + _LENGTH_M)).any(axis=1)
    poses = np.flatnonzero(outside)
    corners = ["(" + ", ".join(f"{v:g}" for v in corner.tolist()) + ") m" for corner in (low, high)]
    box = f"{radius:g} m inside {corners[0]} to {corners[1]}"
    for row, first in zip(*np.unique(paths.route_of(poses), return_index=True), strict=True):
        pose = poses[first]
        yield Finding(int(row), f"pose {pose - paths.first[row]} at {place_text(paths.xyz[pose])}", box)


def _judged(data: SceneData, rows: Rows) -> tuple[np.ndarray, np.ndarray, Floats, Floats]:
    """Reason and setting by the rules of `filter`, with L and d_E as they were judged there."""
    paths = data.paths
    length, euclidean = rows.floats("length_m"), rows.floats("euclidean_m")
    # A stored value that is right but for rounding decides at a threshold, as it did in filter.
    length = np.where(np.abs(length - paths.length_m) <= _LENGTH_M, length, paths.length_m)
    euclidean = np.where(np.abs(euclidean - paths.euclidean_m) <= _LENGTH_M, euclidean, paths.euclidean_m)
    solved = np.full(len(length), "SOLVED")
    actions = np.diff(paths.first).astype(np.int32)
    detour, visible = rows.floats("plan_detour"), rows.floats("target_visible_at_start")
    reason, setting = judge(solved, euclidean, length, actions, data.pipeline.filter, detour, visible)
    return reason, setting, length, euclidean


def _differs(stored: Floats, computed: Floats, unit: str) -> Iterator[Finding]:
    for row in np.flatnonzero(~(np.abs(stored - computed) <= _LENGTH_M)).tolist():
        yield Finding(row, f"{stored[row]:.9g}{unit}", f"{computed[row]:.9g}{unit}")


@check("routes", after=("list_lengths_differ", "unknown_start"))
def start_anchor(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """A route starts on its start anchor, turned by 180°."""
    fit, anchor = _anchor_poses(data, data.start_of_route)
    anchor[:, 3] += math.pi
    yield from _off(fit, data.paths.starts, anchor)


@check("routes", after=("unknown_target",))
def goal_anchor(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The goal is the target's selected anchor."""
    fit, anchor = _anchor_poses(data, data.goal_of_route)
    yield from _off(fit, rows.floats(*(f"goal_{name}" for name in POSE)), anchor)


@check("routes", after=("list_lengths_differ", "unknown_target"))
def end_position(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """The last position is the target's selected anchor."""
    fit, anchor = _anchor_poses(data, data.goal_of_route)
    anchor[:, 3] = data.paths.ends[:, 3]
    yield from _off(fit, data.paths.ends, anchor)


@check("routes", after=("list_lengths_differ", "unknown_target"))
def final_yaw(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """The last yaw is within 7.5° of the anchor's."""
    fit, anchor = _anchor_poses(data, data.goal_of_route)
    off = np.degrees(np.abs(wrap_angle_rad(data.paths.ends[:, 3] - anchor[:, 3])))
    for row in np.flatnonzero(fit & (off > math.degrees(TURN_RAD / 2) + 1e-6)).tolist():
        yield Finding(row, f"{off[row]:.3f}° off the anchor's yaw", "7.5° at most")


@check("routes", after=("list_lengths_differ", "action_order"))
def replay_differs(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The actions, replayed through the motion model, give the stored poses (up to the Approach)."""
    paths = data.paths
    for row in np.flatnonzero(paths.fit & rows.judged).tolist():
        poses, actions = paths.poses(row), paths.action[paths.of(row)]
        flown = replay(poses[0], actions[:-1])
        off = np.abs(flown - poses)
        off[:, 3] = np.abs(wrap_angle_rad(off[:, 3]))
        if actions[-2] == APPROACH:
            off[-1, :3] = 0.0
        if not off.max() <= _REPLAY:
            step = int(np.argmax(off.max(axis=1) > _REPLAY))
            yield Finding(row, f"pose {step} at {pose_text(poses[step])}", f"{pose_text(flown[step])}")


@check("routes", after=("list_lengths_differ", "action_order", "replay_differs", "end_position", "unknown_target"))
def stops_far(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """An agent that flies the actions, which are without the Approach, stops within 1 m of the anchor."""
    paths = data.paths
    fit, anchor = _anchor_poses(data, data.goal_of_route)
    rows = np.flatnonzero(fit & paths.fit)
    last = paths.first[1:][rows] - 1
    # The replay is the stored poses by the check above: the Approach is all that it leaves out.
    last -= paths.action[last - 1] == APPROACH
    off = np.linalg.norm(paths.xyz[last] - anchor[rows, :3], axis=1)
    for row, off_m in zip(rows.tolist(), off, strict=True):
        if off_m > NEAR_GOAL_M + _REPLAY:
            yield Finding(row, f"{off_m:.3f} m from the anchor", f"{NEAR_GOAL_M:g} m at most")


def _anchor_poses(data: SceneData, anchor_of_route: Ints) -> tuple[Mask, Floats]:
    """Which routes have a sound anchor, and every route's anchor's pose, (n, 4)."""
    poses = data["anchors"].floats(*POSE).reshape(-1, 4)
    return data.comparable("anchors", anchor_of_route), at(poses, anchor_of_route)


def _off(fit: Mask, own: Floats, wanted: Floats) -> Iterator[Finding]:
    """Rows that fit whose pose is not the wanted one."""
    far = np.abs(own[:, :3] - wanted[:, :3]).max(axis=1, initial=0.0) > _SAME_M
    turned = np.abs(wrap_angle_rad(own[:, 3] - wanted[:, 3])) > _SAME_RAD
    for row in np.flatnonzero(fit & (far | turned)).tolist():
        expected = [*wanted[row, :3], wrap_angle_rad(wanted[row, 3])]
        yield Finding(row, pose_text(own[row]), pose_text(expected))
