"""What the phrases of place claim: `places/<scene type>.toml`, a table a scene, a phrase a line.

    [U_Factory_0]
    "in the coal yard" = { surface = "dirt*", near = "coal_heap*" }

A phrase is bound to conditions, all of which must hold of the built mesh (`places.Places`). Things are named by
patterns of node names or categories, alternatives parted by ``|``; a surface by patterns of materials. Lengths are
fixed by the word: who writes *beside* means at most 5 m.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.base.safe_parse import read_toml

Conditions = Mapping[str, Any]

# Patterns of things.
THINGS = frozenset({"on", "roof", "under", "inside", "hull", "touching", "beside", "at", "near", "over"})
# Beyond the middle of things, by the compass.
SIDES = frozenset({"north_of", "south_of", "east_of", "west_of"})
_FOLDER = Path(__file__).parent / "places"
_PARTS = frozenset(f"{a}{b}" for a in ("", "north", "south") for b in ("", "east", "west")) - {""} | {"middle"}
_MOST_AMONG_M = 15.0


@cache
def places_of(scene: str) -> Mapping[str, Conditions] | None:
    """Look up the phrases of place of a scene."""
    path = _FOLDER / f"{scene.rpartition('_')[0]}.toml"
    tables = read_toml(path, AnnotationError) if path.is_file() else {}
    if scene not in tables:
        return None
    for phrase, conditions in tables[scene].items():
        check_conditions(f"{path.name}: [{scene}] {phrase!r}", conditions)
    return dict(tables[scene])


def check_conditions(where: str, conditions: Any) -> None:
    """Refuse what is no binding of a phrase; an `AnnotationError` begins with `where`."""
    if not isinstance(conditions, dict) or not conditions:
        raise AnnotationError(f"{where}: must be a table of at least one condition")
    for key, value in conditions.items():
        if key not in _FORMS:
            raise AnnotationError(f"{where}: unknown condition {key!r}{nearest(key, _FORMS)}")
        if not _FORMS[key](value):
            raise AnnotationError(f"{where}: {key} = {value!r} is not what it takes")


def _text(value: Any) -> bool:
    return isinstance(value, str) and bool(value)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _among(value: Any) -> bool:
    return (
        isinstance(value, list) and len(value) == 3 and isinstance(value[0], int) and value[0] > 0
        and _text(value[1]) and _number(value[2]) and 0 < value[2] <= _MOST_AMONG_M
    )  # fmt: skip


_FORMS: Mapping[str, Callable[[Any], bool]] = {
    **dict.fromkeys(THINGS | SIDES | {"surface", "by"}, _text),
    "floor": lambda v: isinstance(v, list) and len(v) == 2 and isinstance(v[0], int) and _text(v[1]),
    "between": lambda v: isinstance(v, list) and len(v) == 2 and all(map(_text, v)),
    "z": lambda v: isinstance(v, list) and len(v) == 2 and all(map(_number, v)) and v[0] < v[1],
    "high": _number,
    "among": _among,
    "part": lambda v: v in _PARTS,
}
