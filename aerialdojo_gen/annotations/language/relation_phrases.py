"""Wordings of relations, read from ``relations.toml``, and the conditions under which each is true."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cache
from typing import Any

import numpy as np

from aerialdojo_gen.annotations.claims import SceneClaims
from aerialdojo_gen.annotations.language.grammar import FOLDER
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.base.safe_parse import read_toml

_LEVEL_M = 1.0
STRUCTURE = "structure"  # the kind of what is not in the catalogue


@dataclass(frozen=True)
class RelationPhrase:
    """One wording: {} is the thing, {d} the direction."""

    say: str
    conditions: Mapping[str, Any] = field(default_factory=dict)

    def holds(self, claims: SceneClaims, i: int, j: int) -> bool:
        """Whether it is true of instance `i` and the thing `j`, of which its relation is."""
        return all(_HOLDS[name](claims, i, j, value) for name, value in self.conditions.items())


def _size(claims: SceneClaims, j: int) -> Any:
    return np.ptp(claims.geometry.boxes[j], axis=0)


_HOLDS: Mapping[str, Callable[[SceneClaims, int, int, Any], bool]] = {
    "gap_m": lambda c, i, j, ends: bool(ends[0] <= c.geometry.gap_m(i, j) <= ends[1]),
    "tall_m": lambda c, _, j, least: bool(_size(c, j)[2] >= least),
    "long_m": lambda c, _, j, least: bool(_size(c, j)[:2].max() >= least),
    "level": lambda c, i, j, _: bool(abs(c.geometry.boxes[i, 0, 2] - c.geometry.boxes[j, 0, 2]) <= _LEVEL_M),
    "kinds": lambda c, _, j, kinds: c.vocabulary.kinds.get(c.scene.instances[j].category, STRUCTURE) in kinds,
    "like": lambda c, _, j, like: any(fnmatchcase(c.scene.instances[j].category, one) for one in like.split("|")),
    "smaller": lambda c, i, j, _: bool((_size(c, i) <= _size(c, j)).all()),
}


@cache
def relation_phrases() -> Mapping[str, Mapping[str, tuple[RelationPhrase, ...]]]:
    """Read the wordings, by table and the claim's key."""
    path = FOLDER / "relations.toml"
    tables = read_toml(path, AnnotationError)
    return {
        name: {
            key: tuple(_words(e, f"{path.name}: [{name}] {key}") for e in entries) for key, entries in table.items()
        }
        for name, table in tables.items()
    }


def _words(entry: Any, where: str) -> RelationPhrase:
    if isinstance(entry, str):
        return RelationPhrase(entry)
    conditions = {name: value for name, value in entry.items() if name != "say"}
    for name in conditions:
        if name not in _HOLDS:
            raise AnnotationError(f"{where}: unknown condition {name!r}{nearest(name, tuple(_HOLDS))}")
    return RelationPhrase(entry["say"], conditions)
