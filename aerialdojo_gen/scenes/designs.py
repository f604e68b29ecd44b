"""Designs: the forms that things of one category come in, as its table in the catalogue lists or names them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.scenes.materials import read_toml, refuse_unknown

Side = Literal["train", "held_out", "plain"]
_KEYS = ("name", "stretch", "params", "without", "held_out")
_LEAST, _MOST = 0.5, 2.0


@dataclass(frozen=True)
class Design:
    """How a design differs from what the category's parts say."""

    name: str
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)  # Factors along the thing's own x, y and z
    params: Mapping[str, float] = field(default_factory=dict)
    without: frozenset[str] = frozenset()
    held_out: bool = False  # Whether it stands in no scene of the training side


PLAIN = Design("plain")
DesignSets = Mapping[str, tuple[Design, ...]]


def of_side(designs: Sequence[Design], side: Side) -> Sequence[Design]:
    """Designs that a scene of one side may have: the first where it has no other."""
    if side == "plain":
        return designs[:1]
    return [one for one in designs if one.held_out == (side == "held_out")] or designs[:1]


def parse_designs(raw: Any, params: Mapping[str, Any], tags: set[str], where: str) -> tuple[Design, ...]:
    """Check a list of designs."""
    if not isinstance(raw, list) or not raw:
        raise AssetError(f"{where}: designs must be an array of tables, or the name of a set")
    designs = tuple(_design(one, params, tags, f"{where}[{k}]") for k, one in enumerate(raw))
    names = [one.name for one in designs]
    if len(set(names)) < len(names):
        raise AssetError(f"{where}: two designs have one name ({', '.join(names)})")
    if designs[0].held_out:
        raise AssetError(f"{where}[0]: the first design is not held out: it is the one that all others differ from")
    return designs


def _design(raw: Any, params: Mapping[str, Any], tags: set[str], where: str) -> Design:
    if not isinstance(raw, dict) or not isinstance(raw.get("name"), str) or not raw["name"].isidentifier():
        raise AssetError(f"{where}: name is missing: letters, digits and _")
    refuse_unknown(raw, _KEYS, where)
    stretch = raw.get("stretch", [1.0, 1.0, 1.0])
    if not isinstance(stretch, list) or len(stretch) != 3 or not all(_is_factor(value) for value in stretch):
        raise AssetError(f"{where}: stretch must be three factors from {_LEAST:g} to {_MOST:g}, got {stretch!r}")
    own, without = raw.get("params", {}), raw.get("without", [])
    if not isinstance(own, dict) or not all(isinstance(value, int | float) for value in own.values()):
        raise AssetError(f"{where}: params must be numbers by name, got {own!r}")
    refuse_unknown(own, params, f"{where} params")
    for tag in without if isinstance(without, list) else [without]:
        if not isinstance(tag, str) or tag not in tags:
            raise AssetError(f"{where}: without names the unknown tag {tag!r}{nearest(str(tag), tags)}")
    if not isinstance(raw.get("held_out", False), bool):
        raise AssetError(f"{where}: held_out must be true or false, got {raw['held_out']!r}")
    x, y, z = (float(value) for value in stretch)
    numbers = {name: float(value) for name, value in own.items()}
    return Design(raw["name"], (x, y, z), numbers, frozenset(without), raw.get("held_out", False))


def _is_factor(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and _LEAST <= value <= _MOST


def load_sets(path: Path) -> DesignSets:
    """Read the designs that categories share; without the file there are none."""
    body = read_toml(path) if path.is_file() else {}
    return {name: parse_designs(raw, {}, set(), f"{path}: {name}") for name, raw in body.items()}
