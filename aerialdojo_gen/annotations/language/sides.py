"""Which of an object's descriptions are for training, and which for test tasks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa

from aerialdojo_gen.store.schemas.release import PARAPHRASES
from aerialdojo_gen.store.schemas.staged import PARAPHRASE

WRITTEN = "written"  # the level of a text by a person


def of_side(paraphrases: Sequence[Mapping[str, Any]], *, held_out: bool) -> list[Mapping[str, Any]]:
    """Texts for tasks of a side: what a person wrote alone, else the made ones of the side, else all."""
    written = [text for text in paraphrases if text["level"] == WRITTEN]
    return written or [text for text in paraphrases if text["held_out"] == held_out] or list(paraphrases)


def described(objects: pa.Table, descriptions: pa.Table) -> pa.Table:
    """Give objects their paraphrases, and as description the first of them."""
    rows: dict[int, list[dict[str, Any]]] = {}
    for row in descriptions.to_pylist():
        rows.setdefault(row["object_id"], []).append({name.name: row[name.name] for name in PARAPHRASE})
    found = [rows[k] for k in objects["object_id"].to_pylist()]
    objects = objects.append_column("paraphrases", pa.array(found, PARAPHRASES.type))
    firsts = pa.array([texts[0]["text"] for texts in found], pa.string())
    return objects.set_column(objects.column_names.index("description"), "description", firsts)
