"""Checks of what a release says of difficulty and of its splits, each figure found anew by another way."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Mask, Rows, SceneData, UncheckedError, at
from aerialdojo_gen.geometry.cameras import Camera, project, view_pose
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, replay
from aerialdojo_gen.geometry.rays import instance_caster
from aerialdojo_gen.pipeline.stages.work.pair_objects import surface_points
from aerialdojo_gen.pipeline.stages.work.rules import settings_of
from aerialdojo_gen.pipeline.stages.work.split import held_out, key_of, nav_id
from aerialdojo_gen.store.schemas import APPROACH, DIFFICULTY_COLUMNS, SETTINGS, SPLIT_COLUMNS, STOP, VIEWS

# Shapes of imported meshes have no digest: `task_goal` compares that column, null or not.
_SPLITS = tuple(name for name in SPLIT_COLUMNS if name != "shape_seen_in_train")
_LENGTH_M = 1e-6
# What FCL says of a body this much thinner or thicker counts: rounding does not.
_THICKNESS_M = 1e-3
# How much the 24-gon's prism sticks out of the unit sphere: an Approach of a metre saves no more than this.
_SAVED_BY_APPROACH = math.hypot(1.0, 1.0 / math.cos(math.pi / 24)) - 1.0
# Where something is seen its view is known; 0 with the word, and a share without, are not.
# Of a point: a share times the number of points is whole.
_WHOLE = 1e-6
# Rays to points of the object that meet its own edges: so many at least, and one in so many.
_EITHER_WAY, _ONE_IN = 2, 128
# So far before a point rays end (`aerialdojo_gen.geometry.rays`), give or take.
_RAYS_END_M, _GIVE_M = 5e-3, 5e-4
# Sine of the angle between a ray and a face, below which it is met centimetres before or behind.
_EDGE_ON = 2e-3
_UNSEEN = "nothing is seen, and no view is named"
_OF_ROUTE = (
    "list_lengths_differ", "action_order", "n_actions", "route_length", "euclidean_distance", "replay_differs",
    "start_anchor", "goal_anchor", "end_position", "stops_far", "out_of_bounds", "route_collision",
    "replay_collision", "unknown_target", "unknown_start", "duplicate_key", "duplicate_route", "keeping_rule",
)  # fmt: skip
_OF_TASK = (
    "duplicate_key", "task_in_both_subsets", "task_without_route", "task_instances", "task_start", "telling_number",
)  # fmt: skip


def _known(rows: Rows, names: Sequence[str]) -> Mask:
    """Which of some columns every row says, (n, columns) bool."""
    return np.column_stack([rows.valid(name) for name in names])


def _silent(rows: Rows, names: Sequence[str]) -> Iterator[Finding]:
    """Rows that do not say all of some columns, where any row says any."""
    known = _known(rows, names)
    for row in np.flatnonzero(known.any() & ~known.all(axis=1)).tolist():
        yield Finding(row, f"no {names[int(known[row].argmin())]}", f"a value, as other {rows.name} have")


@check("routes", after=_OF_ROUTE)
def difficulty_told(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Every route says how hard it is, unless an older version wrote the release and none does."""
    yield from _silent(rows, [name for name in DIFFICULTY_COLUMNS if name != "visible_view_at_start"])


@check("routes", after=(*_OF_ROUTE, "difficulty_told"))
def free_length(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The shortest length without obstacles is no more than level flight and a climb, and no Approach saves more."""
    paths, stored = data.paths, rows.floats("free_length_m")
    way = paths.ends[:, :3] - paths.starts[:, :3]
    bearing = np.arctan2(way[:, 1], way[:, 0]) - paths.starts[:, 3]
    turn = math.pi / 12
    # Two headings enclose the way: flown in turn, they add up to so much.
    offset = np.mod(bearing, turn)
    level = np.hypot(way[:, 0], way[:, 1]) * (np.sin(offset) + np.sin(turn - offset)) / math.sin(turn)
    most = level + np.abs(way[:, 2])
    least = np.maximum(paths.euclidean_m, most - _SAVED_BY_APPROACH * data.pipeline.plan.max_approach_m)
    off = (stored < least - _LENGTH_M) | (stored > np.minimum(most, paths.length_m) + _LENGTH_M)
    for row in np.flatnonzero(off).tolist():
        yield Finding(row, f"{stored[row]:.9g} m", f"{least[row]:.6g} to {most[row]:.6g} m")


@check("routes", after=(*_OF_ROUTE, "difficulty_told", "free_length"))
def plan_detour(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """`plan_detour` is L over the shortest length without obstacles, and never less than 1."""
    ratio = np.maximum(data.paths.length_m / np.maximum(rows.floats("free_length_m"), 1e-12), 1.0)
    yield from _unlike(rows, "plan_detour", ratio)


@check("routes", after=(*_OF_ROUTE, "difficulty_told"))
def climb(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """`climb_m` is the metres that the actions fly upwards, the Approach's among them."""
    paths = data.paths
    up = np.maximum(DISPLACEMENTS[np.clip(paths.action, STOP, APPROACH), 2], 0.0)
    rise = np.append(np.diff(paths.xyz[:, 2]), 0.0)
    up = np.where(paths.action == APPROACH, np.maximum(rise, 0.0), up)
    yield from _unlike(rows, "climb_m", paths.sums(up))


def _unlike(rows: Rows, name: str, expected: Floats) -> Iterator[Finding]:
    stored = rows.floats(name)
    for row in np.flatnonzero(np.abs(stored - expected) > _LENGTH_M).tolist():
        yield Finding(row, f"{name} = {stored[row]:.9g}", f"{expected[row]:.9g}")


@check("routes", after=(*_OF_ROUTE, "difficulty_told"))
def agent_action(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """`agent_action` has the 16 actions alone, ends in Stop, and leads to within an Approach of the goal in time."""
    budgets = {s: rule.action_budget for s, rule in zip(SETTINGS, settings_of(data.pipeline.filter), strict=True)}
    paths, settings = data.paths, rows.texts("setting")
    lists = rows.column("agent_action")
    ends, actions = lists.offsets.to_numpy(), lists.values.to_numpy(zero_copy_only=False)
    most_m = data.pipeline.plan.max_approach_m + _LENGTH_M
    for row in np.flatnonzero(paths.fit & rows.valid("agent_action")).tolist():
        flown = np.nan_to_num(actions[ends[row] : ends[row + 1]], nan=-1).astype(np.int64)
        if not len(flown) or flown[-1] != STOP or (flown[:-1] <= STOP).any() or (flown >= APPROACH).any():
            yield Finding(row, f"agent_action = {flown.tolist()[-8:]}", "actions 1 to 15, and Stop (0) at the end")
            continue
        off = float(np.linalg.norm(replay(paths.starts[row], flown)[-1, :3] - paths.ends[row, :3]))
        budget = budgets.get(str(settings[row]), len(flown))
        if off > most_m or len(flown) > budget:
            landed = f"Stop at {off:.3f} m from the goal after {len(flown)} actions"
            yield Finding(row, landed, f"{most_m:.3g} m and {budget} actions at most")


@check("routes", after=(*_OF_ROUTE, "difficulty_told"), samples=True)
def straight_line(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """`straight_line_free` is true where the body's sweep from start to goal touches nothing, else false."""
    world, radius = data.world, data.pipeline.embodiment.radius_m
    paths, stored = data.paths, rows.floats("straight_line_free")
    for row in data.sampled(rows).tolist():
        if not np.isfinite(stored[row]):
            continue
        start, goal = paths.starts[row, :3], paths.ends[row, :3]
        free = bool(stored[row])
        if free == world.segment_in_collision(start, goal, radius + (-_THICKNESS_M if free else _THICKNESS_M)):
            yield Finding(row, f"straight_line_free = {free}", str(not free))


@check("routes", after=(*_OF_ROUTE, "difficulty_told"), samples=True)
def start_view(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """What the start sees of the target is what its pictures would show, and the view is the one that shows most."""
    paths, n = data.paths, data.pipeline.pair_objects.surface_points
    things = {item.node: item for item in data.mesh.instances}
    nodes, ids = data["objects"].texts("mesh_node"), data["objects"].ints("object_id").tolist()
    stored, views = rows.floats("target_visible_at_start"), rows.texts("visible_view_at_start")
    of_target: dict[int, list[int]] = {}
    for row in data.sampled(rows).tolist():
        if np.isfinite(stored[row]):
            of_target.setdefault(int(data.target_of_route[row]), []).append(row)
    for target, routes in of_target.items():
        item = things.get(str(nodes[target])) if target >= 0 else None
        if item is None:
            continue
        points, normals = surface_points(data.scene, ids[target], item, n)
        starts = np.repeat(paths.starts[routes], n, axis=0)
        aims = np.tile(points, (len(routes), 1))
        alone = instance_caster(item)
        facing = alone.unobstructed(starts[:, :3], aims)
        free = np.flatnonzero(facing)
        free = free[data.rays.visible(starts[free, :3], aims[free])]
        inside = _in_pictures(starts[free], aims[free])
        by_view = np.stack([np.bincount(free[shown] // n, minlength=len(routes)) for shown in inside])
        in_any = np.bincount(free[inside.any(axis=0)] // n, minlength=len(routes))
        for row, seen, some, bare in zip(routes, by_view.T, in_any, facing.reshape(-1, n).sum(axis=1), strict=True):
            whole = max(int(bare), 1)
            share, best = float(some) / whole, {VIEWS[view] for view in np.flatnonzero(seen == seen.max())}
            # A ray along an edge may go either way, the object's own edge too; points are whole all the same.
            either_way = max(_EITHER_WAY, n // _ONE_IN)
            if not _is_share(stored[row], share, whole, either_way):
                start = paths.starts[row, :3]
                either_way += _edge_on(start, points, normals)
                either_way += _at_the_end(start, points, (alone.unobstructed, data.rays.visible))
            if not _is_share(stored[row], share, whole, either_way):
                yield Finding(row, f"target_visible_at_start = {stored[row]:.3f}", f"{share:.3f}")
            elif (views[row] is None) != (stored[row] == 0.0) or (share and stored[row] and views[row] not in best):
                expected = " or ".join(sorted(best)) if share else _UNSEEN
                yield Finding(row, f"visible_view_at_start = {views[row]}", expected)


def _is_share(stored: float, share: float, whole: int, either_way: int) -> bool:
    """Whether a stored share is one of about so many whole points, and near the one found anew."""
    counted = stored * np.arange(max(whole - either_way, 1), whole + either_way + 1)
    return bool(
        abs(share - stored) <= (either_way + 0.5) / whole and np.abs(counted - np.rint(counted)).min() <= _WHOLE
    )


def _edge_on(start: Floats, points: Floats, normals: Floats) -> int:
    """Count the points (m, 3) whose face is seen edge-on: rays in single precision meet it anywhere along itself."""
    rays = points - start
    return int((np.abs((normals * rays).sum(axis=1)) < _EDGE_ON * np.linalg.norm(rays, axis=1)).sum())


def _at_the_end(start: Floats, points: Floats, casts: Sequence[Callable[..., Mask]]) -> int:
    """Count the points (m, 3) with a surface just where rays to them end: parts often lie 5 mm apart."""
    starts, count = np.broadcast_to(start, points.shape), 0
    for cast in casts:
        near, far = (cast(starts, points, tolerance_m=_RAYS_END_M + give) for give in (-_GIVE_M, _GIVE_M))
        count += int((near != far).sum())
    return count


def _in_pictures(starts: Floats, points: Floats) -> Mask:
    """Whether points (n, 3) are inside the pictures of each view from their starts (n, 4): (views, n)."""
    off = points - starts[:, :3]
    c, s = np.cos(starts[:, 3]), np.sin(starts[:, 3])
    local = np.column_stack([c * off[:, 0] + s * off[:, 1], c * off[:, 1] - s * off[:, 0], off[:, 2]])
    camera = Camera(2, 2, 90.0)
    inside = []
    for view in VIEWS:
        uv, depth = project(camera, view_pose(np.zeros(3), 0.0, view), local)
        inside.append((depth > 0.0) & (uv >= 0.0).all(axis=-1) & (uv <= (camera.width, camera.height)).all(axis=-1))
    return np.array(inside)


@check("tasks", after=_OF_TASK)
def seen_in_train(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """`target_`, `start_` and `pair_seen_in_train` are true where a training task has that target, start, pair."""
    train = rows.texts("subset") == "train"
    ends = (data["routes"].ints(f"{end}_object_id") for end in ("start", "target"))
    start, target = (at(ids, data.route_of_task).tolist() for ids in ends)
    poses = [tuple(pose) for pose in rows.floats("start_x_m", "start_y_m", "start_z_m", "start_yaw_rad").tolist()]
    for what, own in (("target", target), ("start", poses), ("pair", list(zip(start, target, strict=True)))):
        seen = {key for key, trains in zip(own, train, strict=True) if trains}
        name = f"{what}_seen_in_train"
        stored = rows.floats(name)
        expected = np.fromiter((key in seen for key in own), dtype=np.float64, count=len(own))
        for row in np.flatnonzero(np.isfinite(stored) & (stored != expected)):
            yield Finding(int(row), f"{name} = {bool(stored[row])}", str(bool(expected[row])))


@check("tasks", after=_OF_TASK)
def split_by_objects(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """`target_split` is train where neither end of the task is at an object that is held out, and test elsewhere."""
    routes, fraction = data["routes"], data.pipeline.split.held_out_fraction
    ids = data["objects"].ints("object_id").tolist()
    key = key_of(data.pipeline.split.salt, data.pipeline.seed)
    # One id says whether the release was made with this salt.
    made = [nav_id(data.scene, pair, key) for pair in routes.pairs()[:1]]
    out = held_out(data.scene, ids, fraction, key) if made == routes.texts("nav_id")[:1].tolist() else None
    complete = _known(rows, _SPLITS).all(axis=1)
    split = rows.texts("target_split")
    is_held_out = {end: rows.floats(f"{end}_held_out") for end in ("target", "start")}
    ends = {end: at(routes.ints(f"{end}_object_id"), data.route_of_task).tolist() for end in is_held_out}
    known: dict[int, bool] = {}
    for row in np.flatnonzero(complete).tolist():
        side = "test" if is_held_out["target"][row] or is_held_out["start"][row] else "train"
        if split[row] != side:
            yield Finding(row, f"target_split = {split[row]}", side)
            continue
        for end, own in ends.items():
            # Without the salt an object is what the first task says it is.
            expected = own[row] in out if out is not None else known.setdefault(own[row], bool(is_held_out[end][row]))
            if bool(is_held_out[end][row]) != expected:
                yield Finding(row, f"{end}_held_out = {bool(is_held_out[end][row])}", str(expected))
                break


@check("tasks")
def splits_told(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Every task says on which sides of the splits it is, unless an older version wrote the release and none does."""
    if not _known(rows, _SPLITS).any():
        raise UncheckedError("the release does not say: an older version wrote it")
    yield from _silent(rows, _SPLITS)
