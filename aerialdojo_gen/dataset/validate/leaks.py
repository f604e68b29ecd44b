"""Checks that `tasks` tells an agent nothing of the target's place, and that no task stands there twice."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Rows, SceneData, repeated

_START = ("start_x_m", "start_y_m", "start_z_m", "start_yaw_rad")
_SAME_M = 1e-9
# Digits with a decimal point: no description of the project's has any, a coordinate always does.
_DECIMAL = re.compile(r"\d[.,]\d")


@check("tasks")
def telling_id(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Ids are the scene and a hash: an agent reads no object out of them."""
    nav = re.compile(re.escape(data.scene) + r"-[0-9a-f]{12}")
    columns = (rows.texts("nav_id"), rows.texts("task_id"), rows.texts("modality"), rows.texts("reference_image_id"))
    for row, (nav_id, task_id, modality, image) in enumerate(zip(*columns, strict=True)):
        if not nav.fullmatch(str(nav_id)):
            yield Finding(row, f"nav_id = {nav_id!r}", f"{data.scene}-<12 hexadecimal digits>")
        elif task_id != f"{nav_id}-{str(modality)[:1]}":
            yield Finding(row, f"task_id = {task_id!r}", f"{nav_id}-{str(modality)[:1]}")
        elif image is not None and not re.fullmatch(r"ref_[0-9a-f]{12}", image):
            yield Finding(row, f"reference_image_id = {image!r}", "ref_<12 hexadecimal digits>")


@check("tasks", needs=("objects",))
def telling_text(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Names and descriptions hold no coordinate and no node of the mesh."""
    nodes = {node for node in data["objects"].texts("mesh_node") if node and re.search(r"_\d+$", node)}
    names = ("target_name", "landmark", "description")
    judged: dict[str | None, str] = {None: ""}
    for name in names:
        for row, text in enumerate(rows.texts(name)):
            if text not in judged:
                leaked = next((w for w in re.split(r"[^A-Za-z0-9_]+", str(text)) if w in nodes), "")
                judged[text] = leaked or (m[0] if (m := _DECIMAL.search(str(text))) else "")
            if judged[text]:
                yield Finding(row, f"{name} tells {judged[text]!r}", "words alone")


@check("tasks", needs=("routes", "objects"))
def telling_number(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """No number of a task's row is a coordinate of its goal or of its target, unless the start shares it."""
    routes, paths = data["routes"], data.paths
    secret = np.full((len(routes) + 1, 6), np.nan)
    secret[:-1, :3] = routes.floats("goal_x_m", "goal_y_m", "goal_z_m")
    centres = np.vstack([data["objects"].floats("x_m", "y_m", "z_m").reshape(-1, 3), np.full((1, 3), np.nan)])
    secret[:-1, 3:] = centres[data.target_of_route]
    starts = np.full((len(routes) + 1, 4), np.nan)
    starts[paths.rows] = paths.starts
    own, theirs = rows.floats(*_START), secret[data.route_of_task]
    leaked = _leaked(own, theirs, starts[data.route_of_task])
    for row in np.flatnonzero(leaked.any(axis=1)):
        name = _START[int(leaked[row].argmax())]
        yield Finding(int(row), f"{name} = {own[row, int(leaked[row].argmax())]:.9g}", "nothing of the goal")


def _leaked(own: Floats, secret: Floats, start: Floats) -> Floats:
    """Which numbers of a row stand in the goal and are not the start's own."""
    alike = (np.abs(own[:, :, None] - secret[:, None, :]) <= _SAME_M).any(axis=2)
    return np.asarray(alike & ~(np.abs(own - start) <= _SAME_M))


@check("routes", after=("duplicate_key", "route_in_both_subsets"))
def duplicate_route(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A start anchor and a target make one navigation task."""
    columns = [rows.ints(name).tolist() for name in ("start_object_id", "start_anchor_id", "target_object_id")]
    nav_ids = rows.texts("nav_id")
    for row, first in repeated(zip(*columns, strict=True)):
        start, anchor, target = (column[row] for column in columns)
        yield Finding(row, f"start and target {start}_{anchor}__{target} as {nav_ids[first]}", "each pair once")
