"""Designs: the proportions that things of one category come in, `scene_assets/designs.toml`."""

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
# Shapes that turn about their own z axis.
ROUND = frozenset({"cylinder", "cone", "lathe", "torus", "capsule"})
# A part is the body if it takes this share of a thing's extent on the ground.
_BODY_SHARE = 0.55
_LEAST, _MOST = 0.5, 2.0
# Sets that `default_set` names.
_DEFAULTS = ("free", "round", "vehicle", "scaled", "fixed")


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
    """Read the sets of designs that categories share; without the file, or a set, things have one design."""
    body = read_toml(path) if path.is_file() else {}
    sets = {name: parse_designs(raw, {}, set(), f"{path}: {name}") for name, raw in body.items()}
    return {**dict.fromkeys(_DEFAULTS, (PLAIN,)), **sets}


def default_set(kind: str, parts: Sequence[Mapping[str, Any]]) -> str:
    """Name the set of a category that says none, by its kind and its parts."""
    if kind == "landmark" or not parts:
        return "fixed"
    if kind == "vehicle":
        return "vehicle"
    reach = [_reach(part) for part in parts]
    body = [part for part, one in zip(parts, reach, strict=True) if one >= _BODY_SHARE * max(reach)]
    if any(part["shape"] == "sphere" and "radius" in part and not part.get("half") for part in body):
        return "scaled"
    return "round" if any(_is_upright_round(part) for part in body) else "free"


def _is_upright_round(part: Mapping[str, Any]) -> bool:
    """Whether a part turns about an upright axis, by its shape or as a ring."""
    ring = part.get("ring")
    if ring is not None:
        return bool(ring.get("axis", "z") == "z") and part["shape"] != "text"
    return part["shape"] in ROUND and not any(part.get("rotate", ()))


def _reach(part: Mapping[str, Any]) -> float:
    """Rough horizontal extent of a part, metres; expressions count nothing."""
    ring = part.get("ring", {})
    sizes = [
        part.get("radius", 0.0),
        part.get("width", 0.0),
        *(part.get("radii") or [0.0])[:2],
        ring.get("radius", 0.0),
    ]
    sizes += [row[0] for row in part.get("points", []) if isinstance(row, list)]
    out = max((abs(size) for size in sizes if isinstance(size, int | float)), default=0.0) * 2.0
    flat = [size for size in part.get("size", [])[:2] if isinstance(size, int | float)]
    return max([out, *flat])
