"""Whatever cell of a release is changed, the row it stands in is named; nothing in one ends in a crash."""

import math

import pyarrow as pa
import pytest
from support.layout_checks import drawn
from support.planting import check, check_of, named

from aerialdojo_gen.dataset.contents import SHARDS
from aerialdojo_gen.store import shards as store

# Every fourth pixel is looked at: a box that is off by one is within what that can tell.
# Of the points of a target one or two may be seen or not: rays along an edge.
UNTOLD = {"box_u0_px", "box_v0_px", "box_u1_px", "box_v1_px", "target_visible_at_start"}
# What others say or refer to is told at them.
TOLD_ELSEWHERE = {
    "landmark_id": "unknown_landmark", "selected": "selected_anchor", "description": "task_text", "name": "task_goal",
    "paraphrases": "task_text", "reference_image_id": "task_goal", "shape_held_out": "task_goal",
}  # fmt: skip


def other(value, kind):
    """Another value of a column's type, near the first where that is hardest to see."""
    if pa.types.is_list(kind):
        return [value[0], other(value[1], kind.value_type), *value[2:]]
    if isinstance(value, dict):
        return value | {"text": value["text"][:-3] + "xyz"}
    if value is None:
        return "x" if pa.types.is_string(kind) else b"x" if pa.types.is_binary(kind) else 1
    if isinstance(value, bool):
        return not value
    if isinstance(value, float):
        return value + 0.05
    if isinstance(value, int):
        return value + 1 if value < 100 else value - 1
    return value[:-3] + (b"xyz" if isinstance(value, bytes) else "x")


@pytest.mark.parametrize("key", drawn([key for key in SHARDS if not key.endswith("/test")], 2))
def test_every_cell_is_held_to_something(planted, key):
    spec = store.LAYOUT[key].spec
    columns = [field for field in spec.schema if field.name not in UNTOLD]
    clean = planted.rows(key)
    tables = {"*", spec.name, *(("objects", "tasks") if TOLD_ELSEWHERE.keys() & set(spec.schema.names) else ())}
    while columns:
        rows = [dict(row) for row in clean]
        # A row a column, as many as there are rows, so that each fault stands in a row of its own.
        now, columns = columns[: len(rows)], columns[len(rows) :]
        wanted = {}
        for row, field in zip(rows, now, strict=False):
            before = dict(row)
            row[field.name] = other(row[field.name], field.type)
            wanted[field.name] = {named(key, r) for r in (before, row)}
        planted.write(key, rows)
        found = check_of(planted, *tables)
        told = {row for rows in found.values() for row in rows}
        untold = {name for name, keys in wanted.items() if not keys & told}
        assert untold <= {name for name, by in TOLD_ELSEWHERE.items() if by in found}


@pytest.mark.parametrize("value", drawn([None, math.nan, -1, 2**31 - 1, 1e300, ""], 1))
def test_no_value_is_too_strange_to_be_judged(planted, value):
    for key in SHARDS:
        rows = planted.rows(key)
        for field in store.LAYOUT[key].spec.schema:
            kind = field.type.value_type if pa.types.is_list(field.type) else field.type
            if pa.types.is_struct(kind):
                continue  # its fields are not nullable
            try:
                strange = pa.scalar(value, kind).as_py()
            except (pa.ArrowInvalid, pa.ArrowTypeError, OverflowError):
                continue
            for row in rows[::2]:
                row[field.name] = [strange] * 3 if pa.types.is_list(field.type) and value is not None else strange
        planted.write(key, rows, sort=False)
    assert check(planted, sample=5)
