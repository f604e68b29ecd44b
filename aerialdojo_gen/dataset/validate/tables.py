"""Checks of every table by itself: values that are there, finite, known words, and keys that name one row."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.constants import MODALITIES
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Rows, SceneData, repeated
from aerialdojo_gen.store.layout import partition
from aerialdojo_gen.store.schemas import DIRECTIONS, FAMILIES, SETTINGS, VIEWS

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


@check("*")
def null_value(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """No null where the schema has none."""
    for field in rows.spec.schema:
        if field.nullable:
            continue
        column = rows.column(field.name)
        for row in np.flatnonzero(pc.is_null(column).to_numpy(zero_copy_only=False)):
            yield Finding(int(row), f"{field.name} is null", "a value")
        if pa.types.is_list(column.type) and pc.list_flatten(column).null_count:
            parents = pc.list_parent_indices(column).filter(pc.is_null(pc.list_flatten(column)))
            for row in pc.unique(parents).to_pylist():
                yield Finding(row, f"a null in {field.name}", "a value")


@check("*")
def not_finite(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """No NaN and no infinity."""
    for field in rows.spec.schema:
        column = rows.column(field.name)
        is_list = pa.types.is_list(field.type)
        values = pc.list_flatten(column) if is_list else column
        if not pa.types.is_floating(values.type):
            continue
        wrong = pc.invert(pc.fill_null(pc.is_finite(values), True))
        where = pc.list_parent_indices(column).filter(wrong) if is_list else pc.indices_nonzero(wrong)
        for row in pc.unique(where).to_pylist():
            yield Finding(row, f"{field.name} is not finite", "a finite number")


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
