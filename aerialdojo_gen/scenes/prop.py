"""Categories of the catalogue as data: read from TOML tables and checked to the last key."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from aerialdojo_gen.base.errors import AssetError, ShapeError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.scenes.appearances import Appearance, parse_appearances
from aerialdojo_gen.scenes.builders import builders
from aerialdojo_gen.scenes.designs import PLAIN, Design, DesignSets, parse_designs
from aerialdojo_gen.scenes.materials import MaterialLibrary, refuse_unknown
from aerialdojo_gen.scenes.model import FRONTS
from aerialdojo_gen.scenes.vocabulary import ARRAY_KEYS, PLACEMENT_KEYS, RING_KEYS, SHAPES, names_used, shape_keys

KINDS = ("prop", "vegetation", "vehicle", "building", "landmark", "life")
Range = tuple[float, float]
_CATEGORY_KEYS = ("name", "kind", "params", "roles", "parts", "builder", "variants", "looks", "front", "tells",
                  "designs", "scale")  # fmt: skip
_VARIANT_KEYS = ("name", "attributes", "roles", "params", "without", "weight", "tells")
_MIRRORS = ("x", "y", "xy")
_MAX_PARTS = 1000
_MAX_VALUE = 10_000.0
_MIN_SCALE, _MAX_SCALE = 0.1, 10.0


@dataclass(frozen=True)
class Variant:
    """A variant of a category: its differences from the default."""

    name: str
    attributes: Mapping[str, str]
    roles: Mapping[str, str]
    params: Mapping[str, Range]
    without: frozenset[str]
    weight: float
    identifying_parts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Category:
    """A category of props."""

    category: str  # Its key, e.g. ``"delivery_van"``
    name: str  # Common noun, e.g. ``"delivery van"``
    kind: str  # One of `KINDS`
    looks: tuple[Appearance, ...]
    params: Mapping[str, Range]  # Sizes drawn once an instance; a fixed one has low == high
    roles: Mapping[str, str]  # Default material of every role
    parts: tuple[Mapping[str, Any], ...]  # Tables of the parts; empty where a builder makes them
    builder: str | None  # Name of the builder
    variants: tuple[Variant, ...]  # At least one; a category without variants has one of an empty name
    source: str  # File and category, for messages
    target: bool = True  # Whether tasks may ask for it: false of landmarks and of scenery
    front: str = ""
    identifying_parts: tuple[str, ...] = ()  # Parts that make its name true; empty where the whole body does
    designs: tuple[Design, ...] = (PLAIN,)  # Forms that it comes in; the first is what its parts say
    scale: float = 1.0  # Factor of all that its parts or its builder say

    def design(self, name: str) -> Design:
        """Look a design up; an `AssetError` names the nearest one."""
        for one in self.designs:
            if one.name == name:
                return one
        raise AssetError(f"{self.source}: unknown design {name!r}{nearest(name, [one.name for one in self.designs])}")

    def variant(self, name: str) -> Variant:
        """Look a variant up; an `AssetError` names the nearest one."""
        for v in self.variants:
            if v.name == name:
                return v
        known = [v.name for v in self.variants]
        raise AssetError(f"{self.source}: unknown variant {name!r}{nearest(name, known)}")


class Entry(NamedTuple):
    """A category as its file has it: what is said of it without a look at its parts."""

    category: str
    body: Mapping[str, Any]
    source: str  # File and category, for messages
    target: bool

    @property
    def name(self) -> str:
        """Common noun, e.g. ``"delivery van"``."""
        return str(self.body["name"])

    @property
    def kind(self) -> str:
        """One of `KINDS`."""
        return str(self.body.get("kind", "prop"))


def parse_entry(path: Path, category: str, body: Any, target: bool = True) -> Entry:
    """Check the head of one category's table: its keys, name and kind."""
    where = f"{path}: [{category}]"
    if not isinstance(body, dict):
        raise AssetError(f"{where} is no table")
    if not category.isidentifier() or category != category.lower():
        raise AssetError(f"{where}: a category is named in snake_case")
    refuse_unknown(body, _CATEGORY_KEYS, where)
    name, kind = body.get("name"), body.get("kind", "prop")
    if not isinstance(name, str) or not name.strip():
        raise AssetError(f"{where}: name is missing: what a person calls it")
    if kind not in KINDS:
        raise AssetError(f"{where}: unknown kind {kind!r}{nearest(str(kind), KINDS)} (one of {', '.join(KINDS)})")
    return Entry(category, body, where, target)


def parse_category(entry: Entry, materials: MaterialLibrary, sets: DesignSets) -> Category:
    """Check the rest of one category's table."""
    category, body, where, target = entry
    front = body.get("front", "")
    if "front" in body and (not isinstance(front, str) or front not in FRONTS):
        raise AssetError(f"{where}: front must be one of {', '.join(FRONTS)}, got {front!r}")
    params = _params(body.get("params", {}), f"{where} params")
    roles = _roles(body.get("roles", {}), None, materials, f"{where} roles")
    builder, parts = body.get("builder"), body.get("parts", [])
    if (builder is None) == (not parts):
        raise AssetError(f"{where}: give parts or a builder, one of them")
    refuse_unknown([] if builder is None else [builder], builders(), where, "builder")
    if not isinstance(parts, list):
        raise AssetError(f"{where}: parts must be an array of tables, [[{category}.parts]]")
    for k, part in enumerate(parts):
        _check_part(part, params, roles, materials, f"{where} parts[{k}]")
    if len(parts) > _MAX_PARTS:
        raise AssetError(f"{where}: {len(parts):,} parts, the maximum is {_MAX_PARTS}")
    tags = {tag for p in parts for tag in tags_of(p)}
    named = sorted({*tags, *roles, *(p["role"] for p in parts)})
    looks = parse_appearances(body.get("looks", []), named, materials.names, where)
    identifying_parts = _identifying_parts(body.get("tells", []), named, where)
    raw = body.get("variants", [])
    if not isinstance(raw, list):
        raise AssetError(f"{where}: variants must be an array of tables, [[{category}.variants]]")
    variants: list[Variant] = []
    for k, v in enumerate(raw):
        variants.append(_variant(v, params, roles, tags, named, materials, f"{where} variants[{k}]"))
        if variants[-1].name in {x.name for x in variants[:-1]}:
            raise AssetError(f"{where} variants[{k}]: duplicate variant {variants[-1].name!r}")
    if not variants:
        variants.append(Variant("", {}, {}, {}, frozenset(), 1.0))
    chosen = body.get("designs", "plain")
    sets = {"plain": (PLAIN,), **sets}
    refuse_unknown([chosen] if isinstance(chosen, str) else [], sets, where, "set of designs")
    designs = sets[chosen] if isinstance(chosen, str) else parse_designs(chosen, params, tags, f"{where} designs")
    scale = body.get("scale", 1.0)
    if not isinstance(scale, int | float) or isinstance(scale, bool) or not _MIN_SCALE <= scale <= _MAX_SCALE:
        raise AssetError(f"{where}: scale must be a number from {_MIN_SCALE:g} to {_MAX_SCALE:g}, got {scale!r}")
    known = [one.name for one in designs]
    for k, part in enumerate(parts):
        refuse_unknown(designs_of(part), known, f"{where} parts[{k}]", "design")
    return Category(
        category,
        entry.name,
        entry.kind,
        looks,
        params,
        roles,
        tuple(parts),
        builder,
        tuple(variants),
        where,
        target,
        front,
        identifying_parts,
        designs,
        float(scale),
    )


def tags_of(part: Mapping[str, Any]) -> tuple[str, ...]:
    """Tags of a part: none, one, or those of a list."""
    tag = part.get("tag", ())
    return (tag,) if isinstance(tag, str) else tuple(tag)


def designs_of(part: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the designs that have a part: none where all have it."""
    design = part.get("design", ())
    return (design,) if isinstance(design, str) else tuple(design)


def _identifying_parts(raw: Any, named: Sequence[str], where: str) -> tuple[str, ...]:
    if not isinstance(raw, list) or not all(isinstance(name, str) for name in raw):
        raise AssetError(f"{where}: tells must be a list of parts, got {raw!r}")
    for name in raw:
        for one in name.split("|"):
            if one not in named:
                raise AssetError(f"{where}: tells: no part {one!r}{nearest(one, named)}: named by tag or role")
    return tuple(raw)


def _check_part(
    part: Any, params: Mapping[str, Range], roles: Mapping[str, str], materials: MaterialLibrary, where: str
) -> None:
    if not isinstance(part, dict) or "shape" not in part:
        raise AssetError(f"{where}: shape is missing")
    shape = part["shape"]
    refuse_unknown([shape], SHAPES, where, "shape")
    where = f"{where} ({shape})"
    required, known = shape_keys(shape)
    refuse_unknown(part, PLACEMENT_KEYS | known, where)
    for key in sorted(required - part.keys()):
        raise AssetError(f"{where}: key {key!r} is missing")
    for key, inner in (("array", ARRAY_KEYS), ("ring", RING_KEYS)):
        if key in part:
            if not isinstance(part[key], dict) or "count" not in part[key]:
                raise AssetError(f"{where}: {key} must be a table with a count")
            refuse_unknown(part[key], inner, f"{where} {key}")
    if part.get("ring", {}).get("axis", "z") not in ("x", "y", "z"):
        raise AssetError(f"{where} ring: axis must be x, y or z")
    if part.get("mirror", "x") not in _MIRRORS:
        raise AssetError(f"{where}: mirror must be x, y or xy, got {part['mirror']!r}")
    tags = part.get("tag", "")
    if not isinstance(tags, str) and not (isinstance(tags, list) and all(isinstance(t, str) for t in tags)):
        raise AssetError(f"{where}: tag must be a word or a list of words, got {tags!r}")
    given = part.get("design", "plain")
    if not isinstance(given, str) and not (isinstance(given, list) and all(isinstance(d, str) for d in given)):
        raise AssetError(f"{where}: design must be a name or a list of names, got {given!r}")
    role = part.get("role")
    if not isinstance(role, str):
        raise AssetError(f"{where}: role is missing: a role of the category or a material")
    if role not in roles:
        _check_material(role, roles, materials, where)
    try:
        used = sorted(names_used(part))
    except ShapeError as error:
        raise AssetError(f"{where}: {error}") from error
    refuse_unknown(used, params, where, "parameter")


def _variant(
    body: Any,
    params: Mapping[str, Range],
    roles: Mapping[str, str],
    tags: set[str],
    named: Sequence[str],
    materials: MaterialLibrary,
    where: str,
) -> Variant:
    if not isinstance(body, dict) or not isinstance(body.get("name"), str) or not body["name"]:
        raise AssetError(f"{where}: name is missing")
    where = f"{where} ({body['name']})"
    refuse_unknown(body, _VARIANT_KEYS, where)
    attributes = body.get("attributes", {})
    if not isinstance(attributes, dict) or not all(isinstance(v, str) for v in attributes.values()):
        raise AssetError(f"{where}: attributes must be words")
    own_params = _params(body.get("params", {}), f"{where} params")
    refuse_unknown(own_params, params, f"{where} params")
    without = body.get("without", [])
    if not isinstance(without, list):
        raise AssetError(f"{where}: without must be a list of tags, got {without!r}")
    for tag in without:
        if not isinstance(tag, str) or tag not in tags:
            raise AssetError(f"{where}: without names the unknown tag {tag!r}{nearest(str(tag), tags)}")
    weight = body.get("weight", 1)
    if not isinstance(weight, int | float) or weight <= 0:
        raise AssetError(f"{where}: weight must be a positive number, got {weight!r}")
    own_roles = _roles(body.get("roles", {}), roles, materials, f"{where} roles")
    identifying_parts = _identifying_parts(body.get("tells", []), named, where)
    return Variant(
        body["name"], attributes, own_roles, own_params, frozenset(without), float(weight), identifying_parts
    )


def _params(body: Any, where: str) -> dict[str, Range]:
    if not isinstance(body, dict):
        raise AssetError(f"{where} is no table")
    out = {}
    for key, value in body.items():
        ends = value if isinstance(value, list) else [value, value]
        if len(ends) != 2 or not all(isinstance(v, int | float) for v in ends) or ends[0] > ends[1]:
            raise AssetError(f"{where}: {key} must be a number or [low, high], got {value!r}")
        if not -_MAX_VALUE <= ends[0] <= ends[1] <= _MAX_VALUE:
            raise AssetError(f"{where}: {key} must lie within {_MAX_VALUE:,.0f}, got {value!r}")
        out[key] = (float(ends[0]), float(ends[1]))
    return out


def _roles(body: Any, known: Mapping[str, str] | None, materials: MaterialLibrary, where: str) -> dict[str, str]:
    if not isinstance(body, dict):
        raise AssetError(f"{where} is no table")
    if known is not None:
        refuse_unknown(body, known, where)
    for role, spec in body.items():
        if not isinstance(spec, str):
            raise AssetError(f"{where}: {role} must be a material, got {spec!r}")
        _check_material(spec, (), materials, f"{where} {role}")
    return dict(body)


def _check_material(spec: str, roles: Mapping[str, str] | tuple[()], materials: MaterialLibrary, where: str) -> None:
    known = spec.startswith("#") or spec.partition(":")[0] in materials.names
    if not known and (near := nearest(spec, roles)):
        raise AssetError(f"{where}: unknown role {spec!r}{near}")
    materials.check(spec, where)
