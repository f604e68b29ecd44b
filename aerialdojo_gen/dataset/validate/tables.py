"""Checks of every table by itself, and of what one says of another.

By itself: values that are there, finite, known words, and keys that name one row. Of another: ids that exist, and
things said twice that agree.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.constants import MODALITIES
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import (
    ALWAYS_AFTER,
    START,
    Ints,
    Rows,
    SceneData,
    UncheckedError,
    at,
    differing,
    pose_text,
    repeated,
)
from aerialdojo_gen.geometry.frames import compass_direction
from aerialdojo_gen.pipeline.stages.work.rules import settings_of
from aerialdojo_gen.store.layout import partition
from aerialdojo_gen.store.schemas import DIRECTIONS, FAMILIES, SETTINGS, SPLIT_COLUMNS, VIEWS

_WORDS = {
    "modality": MODALITIES,
    "setting": SETTINGS,
    "subset": ("train", "test"),
    "direction": DIRECTIONS,
    "family": (*FAMILIES.values(), "Custom"),
    "partition": ("ID", "OOD"),
    "selected_by": ("annotation", "auto"),
    "visible_view_at_start": VIEWS,
    "target_split": ("train", "test"),
}
_SAME_PLACE_M = 1e-6
_SHARED = (
    "family", "scene_type", "partition", "subset", "setting", "action_budget", *START, "target_name", "landmark",
    "direction", *SPLIT_COLUMNS,
)  # fmt: skip
_SAID_OF_ROUTE = (
    "duplicate_key", "task_in_both_subsets", "task_without_route", "task_instances", "task_scene", "task_setting",
    "task_budget", "task_start", "task_goal", "task_text", "telling_number", "telling_text", "telling_id",
)  # fmt: skip


@check("*")
def null_value(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """No null where the schema has none."""
    for field in rows.spec.schema:
        if field.nullable:
            continue
        column = rows.column(field.name)
        for row in pc.indices_nonzero(pc.is_null(column)).to_pylist():
            yield Finding(row, f"{field.name} is null", "a value")
        if pa.types.is_list(column.type):
            for row in _rows_with(column, pc.is_null):
                yield Finding(row, f"a null in {field.name}", "a value")


@check("*")
def not_finite(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """No NaN and no infinity."""
    for field in rows.spec.schema:
        if pa.types.is_floating(field.type.value_type if pa.types.is_list(field.type) else field.type):
            wrong = _rows_with(rows.column(field.name), lambda v: pc.invert(pc.fill_null(pc.is_finite(v), True)))
            for row in wrong:
                yield Finding(row, f"{field.name} is not finite", "a finite number")


def _rows_with(column: pa.Array, test: Callable[[pa.Array], pa.Array]) -> list[int]:
    """Rows whose value, or one of whose list of values, passes a test."""
    if not pa.types.is_list(column.type):
        return list(pc.indices_nonzero(test(column)).to_pylist())
    parents = pc.list_parent_indices(column)
    return list(pc.unique(parents.filter(test(pc.list_flatten(column)))).to_pylist())


@check("*")
def unknown_word(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Settings, modalities, directions and the like are the known words."""
    for name, words in _WORDS.items():
        if name not in rows.spec.schema.names:
            continue
        column = rows.column(name)
        known = pc.or_(pc.is_in(column, value_set=pa.array(words, pa.string())), pc.is_null(column))
        for row in np.flatnonzero(~known.to_numpy(zero_copy_only=False)):
            yield Finding(int(row), f"{name} = {column[int(row)].as_py()!r}", f"one of {', '.join(words)}")


@check("*")
def wrong_part(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Rows stand in the part of their own scene, partition and subset."""
    scene = rows.texts("scene")
    for row in np.flatnonzero(scene != data.scene):
        yield Finding(int(row), f"scene = {scene[row]!r}", data.scene)
    if rows.name != "tasks":
        return
    subset = rows.texts("subset")
    for k, part in enumerate(rows.parts):
        folder = part.split("/")[-2]
        expected = folder.removeprefix(f"{partition(data.scene)}_")
        for row in np.flatnonzero((rows.part_of == k) & (subset != expected)):
            yield Finding(int(row), f"subset = {subset[row]!r}", f"{expected!r}, as its folder {folder}")


@check("*")
def duplicate_key(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A key names one row of a part."""
    keys = [(*rows.spec.key,)] + ([("task_id",)] if rows.name == "tasks" else [])
    seen_rows: set[int] = set()
    for names in keys:
        columns = [rows.texts(name) for name in names]
        for row, _ in repeated(zip(rows.part_of.tolist(), *columns, strict=True)):
            if row not in seen_rows:
                seen_rows.add(row)
                yield Finding(row, f"{', '.join(names)} stand twice", "once")


@check("*", after=("duplicate_key",))
def unsorted_rows(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Rows of a part are sorted by the table's order, so that a filter on it reads little."""
    begin = 0
    for end in rows.ends:
        part = rows.table.select(list(rows.spec.order)).slice(begin, end - begin)
        if not part.equals(part.sort_by([(k, "ascending") for k in rows.spec.order])):
            columns = [[(v is None, v) for v in part.column(k).to_pylist()] for k in rows.spec.order]
            keys = list(zip(*columns, strict=True))
            row = next((i for i in range(1, len(keys)) if keys[i] < keys[i - 1]), 0)
            yield Finding(begin + row, f"stands after a row with greater {', '.join(rows.spec.order)}", "sorted rows")
        begin = end


@check("tasks")
def task_in_both_subsets(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Both instances of a navigation task train, or both test."""
    yield from _in_both(rows)


@check("routes")
def route_in_both_subsets(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A route is of train or of test."""
    yield from _in_both(rows)


def _in_both(rows: Rows) -> Iterator[Finding]:
    nav_ids = rows.texts("nav_id")
    for row, first in repeated(nav_ids):
        if rows.part(first) != rows.part(row):
            yield Finding(row, f"{nav_ids[row]} stands in {rows.part(first)} too", "one side of the split")


@check("objects")
def unknown_landmark(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's landmark exists."""
    landmarks = data["landmarks"].find("landmark_id", rows.column("landmark_id"))
    yield from _unknown(rows, landmarks, "landmark_id", "a landmark")


@check("objects", after=("unknown_landmark",))
def landmark_nearest(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's landmark is the nearest in the plane."""
    landmarks = data["landmarks"]
    if not len(landmarks):
        raise UncheckedError("there is no landmark")
    ids, own = landmarks.ints("landmark_id"), landmarks.find("landmark_id", rows.column("landmark_id"))
    away = rows.floats("x_m", "y_m")[:, None] - landmarks.floats("x_m", "y_m")[None]
    distance = np.linalg.norm(away, axis=2)
    for row in np.flatnonzero(distance[np.arange(len(rows)), own] > distance.min(axis=1) + _SAME_PLACE_M):
        nearest = ids[distance[row].argmin()]
        yield Finding(int(row), f"landmark_id = {ids[own[row]]}", f"{nearest}, which is nearer")


@check("objects", after=("unknown_landmark",))
def landmark_direction(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object's direction is the one from its landmark."""
    landmarks = data["landmarks"]
    own = landmarks.find("landmark_id", rows.column("landmark_id"))
    away = rows.floats("x_m", "y_m") - at(landmarks.floats("x_m", "y_m").reshape(-1, 2), own)
    for row, (stated, (dx, dy)) in enumerate(zip(rows.texts("direction"), away.tolist(), strict=True)):
        known = math.isfinite(dx + dy) and (dx or dy)
        if known and (actual := compass_direction(dx, dy)) != stated:
            yield Finding(row, str(stated), actual)


@check("anchors")
def unknown_object(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor's object exists."""
    yield from _unknown(rows, data.objects_of(rows), "object_id", "an object")


@check("viewpoints")
def viewpoint_object(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A viewpoint is one of an object that there is."""
    yield from _unknown(rows, data.objects_of(rows), "object_id", "an object")


@check("objects")
def selected_anchor(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object with anchors has exactly one that is selected."""
    anchors = data["anchors"]
    ids = anchors.ints("object_id")
    has = set(ids.tolist())
    selected = Counter(ids[anchors.floats("selected") == 1.0].tolist())
    for row, object_id in enumerate(rows.ints("object_id").tolist()):
        if object_id in has and selected[object_id] != 1:
            yield Finding(row, f"{selected[object_id]} selected anchors", "1")


@check("routes")
def unknown_target(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A route's target exists."""
    yield from _unknown(rows, data.target_of_route, "target_object_id", "an object")


def _unknown(rows: Rows, found: Ints, name: str, what: str) -> Iterator[Finding]:
    """Rows whose id was not found in its table."""
    ids = rows.ints(name)
    for row in np.flatnonzero(found < 0).tolist():
        yield Finding(row, f"{name} = {ids[row]}", f"{what} of the scene")


@check("routes")
def unknown_start(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A route's start anchor exists."""
    for row in np.flatnonzero(data.start_of_route < 0):
        start = f"anchor {rows.ints('start_anchor_id')[row]} of object {rows.ints('start_object_id')[row]}"
        yield Finding(int(row), start, "an anchor of the scene")


@check("routes")
def route_without_task(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A route has its task instances."""
    for row in np.flatnonzero(data["tasks"].find("nav_id", rows.column("nav_id")) < 0):
        yield Finding(int(row), "no row of tasks", "two instances")


@check("tasks", after=("duplicate_key", "task_in_both_subsets"))
def task_without_route(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A task has its route, on the same side of the split."""
    routes = data["routes"]
    sides = np.array([part.split("/")[-2] for part in routes.parts], dtype=object)
    side = sides[routes.part_of]
    for row, route in enumerate(data.route_of_task):
        own = rows.part(row).split("/")[-2]
        if route < 0:
            yield Finding(row, "no row of routes", f"one in routes/{own}")
        elif side[route] != own:
            yield Finding(row, f"its route stands in routes/{side[route]}", f"routes/{own}")


@check("tasks", after=("duplicate_key", "task_in_both_subsets", "task_without_route"))
def task_instances(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A navigation task has one semantic and one image instance."""
    copies = data.flagged("tasks", ("duplicate_key", "task_in_both_subsets"))
    unfit = data.flagged("tasks", ALWAYS_AFTER)
    found: dict[str | None, list[str]] = {}
    first: dict[str | None, int] = {}
    skip = set()
    for row, (nav_id, modality) in enumerate(zip(rows.texts("nav_id"), rows.texts("modality"), strict=True)):
        if unfit[row]:
            skip.add(nav_id)
        if not copies[row]:
            found.setdefault(nav_id, []).append(str(modality))
            first.setdefault(nav_id, row)
    for nav_id, modalities in found.items():
        if nav_id not in skip and sorted(modalities) != ["image", "semantic"]:
            yield Finding(first[nav_id], " and ".join(sorted(modalities)), "image and semantic")


@check("tasks")
def task_scene(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A task's family, scene type and partition are its scene's."""
    for name in ("family", "scene_type", "partition"):
        own, expected = rows.texts(name), data.scene_row[name]
        for row in np.flatnonzero(own != expected):
            yield Finding(int(row), f"{name} = {own[row]!r}", repr(expected))


@check("tasks")
def task_setting(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A task's setting is its route's."""
    theirs, fit = data["routes"].take("setting", data.route_of_task), data.comparable("routes", data.route_of_task)
    for row, own, expected in differing(rows.column("setting"), theirs, fit):
        yield Finding(row, own or "", expected)


@check("tasks", after=("task_setting",))
def task_budget(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A task's action budget is that of its setting."""
    budgets = {s: rule.action_budget for s, rule in zip(SETTINGS, settings_of(data.pipeline.filter), strict=True)}
    own, expected = rows.ints("action_budget"), np.array([budgets.get(str(s), -1) for s in rows.texts("setting")])
    for row in np.flatnonzero(own != expected):
        yield Finding(int(row), str(own[row]), str(expected[row]))


@check("tasks", after=("telling_number",))
def task_start(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A task starts at the first pose of its route."""
    own, theirs = rows.floats(*START), at(data.paths.starts, data.route_of_task)
    off = np.abs(own - theirs).max(axis=1) > _SAME_PLACE_M
    for row in np.flatnonzero(off & data.comparable("routes", data.route_of_task)):
        yield Finding(int(row), pose_text(own[row]), pose_text(theirs[row]))


@check("tasks")
def goal_of_modality(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A semantic task has a description and no picture, an image task a picture and no description."""
    modality = rows.texts("modality")
    for name, expected in (("description", "semantic"), ("reference_image_id", "image")):
        for row, (own, value) in enumerate(zip(modality, rows.texts(name), strict=True)):
            if (own == expected) != (value is not None):
                yield Finding(row, f"{name} = {value!r} in a {own} task", "a text" if own == expected else "null")


@check("tasks", after=("goal_of_modality", "telling_text", "telling_id"))
def task_goal(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """What a task says of its goal is what stands of the target in objects."""
    objects, landmarks = data["objects"], data["landmarks"]
    target = data.target_of_task
    landmark = at(landmarks.find("landmark_id", objects.column("landmark_id")), target)
    theirs = {
        "target_name": objects.take("name", target),
        "landmark": landmarks.take("name", landmark),
        "direction": objects.take("direction", target),
        "reference_image_id": objects.take("reference_image_id", target),
        "image_distance_m": objects.take("step_back_m", target),
        "shape_seen_in_train": pc.invert(objects.take("shape_held_out", target)),
    }
    fit = data.comparable("objects", target) & data.comparable("routes", data.route_of_task)
    for name, column in theirs.items():
        # The other modality's goal is null, and `goal_of_modality` sees to that.
        both = rows.valid(name) & column.is_valid().to_numpy(zero_copy_only=False)
        if name == "shape_seen_in_train" and rows.valid(name).any():
            # A release of an older version has nulls alone, an imported scene has them on both sides.
            both = np.True_
        for row, own, expected in differing(rows.column(name), column, fit & both):
            yield Finding(row, f"{name} = {own!r}", repr(expected))


@check("tasks", after=("goal_of_modality", "telling_text", "telling_id"))
def task_text(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A task's description is one of its target's, and `frame_seen_in_train` says whether that is not held out."""
    objects, target = data["objects"], data.target_of_task
    fit = data.comparable("objects", target) & data.comparable("routes", data.route_of_task)
    paraphrases, firsts = objects.column("paraphrases").to_pylist(), objects.texts("description")
    # A release of an older version has one description an object.
    in_training = [
        {one["text"]: not one["held_out"] for one in texts or ()} or {first: True}
        for texts, first in zip(paraphrases, firsts, strict=True)
    ]
    seen = rows.column("frame_seen_in_train").to_pylist()
    own, names = rows.texts("description"), rows.texts("nav_id")
    # An image task is of the navigation task that its twin describes.
    said = {name: text for name, text in zip(names, own, strict=True) if text is not None}
    for row, name in enumerate(names):
        text = own[row] if own[row] is not None else said.get(name)
        if text is None or not fit[row]:
            continue
        known = in_training[target[row]]
        if text not in known and own[row] is not None:
            yield Finding(row, f"description = {text!r}", "one of the target's paraphrases")
        elif text in known and seen[row] is not None and seen[row] != known[text]:
            yield Finding(row, f"frame_seen_in_train = {seen[row]}", str(known[text]))


@check("tasks", after=_SAID_OF_ROUTE)
def instances_agree(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Both instances of a navigation task share everything but the goal's representation."""
    first = rows.find("nav_id", rows.column("nav_id"))
    # A task that does not agree with its route has been named: its twin is not to blame.
    fit = ~data.flagged("tasks", (*ALWAYS_AFTER, *_SAID_OF_ROUTE))[first]
    for name in _SHARED:
        for row, own, theirs in differing(rows.column(name), rows.take(name, first), fit):
            yield Finding(row, f"{name} = {own}", f"{theirs}, as its twin")
