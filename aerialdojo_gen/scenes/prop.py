"""Categories of the catalogue as data, their variants and designs: read from TOML tables, checked to the last key."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field

from aerialdojo_gen.base.errors import AssetError, ShapeError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.scenes.appearances import Appearance, both_ends, check_parts, parse_appearances
from aerialdojo_gen.scenes.builders import builders
from aerialdojo_gen.scenes.materials import MaterialLibrary, read_toml, refuse_unknown, validated
from aerialdojo_gen.scenes.model import FRONTS
from aerialdojo_gen.scenes.recipe import Side
from aerialdojo_gen.scenes.vocabulary import ARRAY_KEYS, PLACEMENT_KEYS, RING_KEYS, SHAPES, names_used, shape_keys

KINDS = ("prop", "vegetation", "vehicle", "building", "landmark", "life")
_HEAD_KEYS = ("name", "kind", "front", "looks", "variants", "designs")


def _ascending(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] > ends[1]:
        raise ValueError("must be a number or [low, high]")
    return ends


_Value = Annotated[float, Field(ge=-10_000, le=10_000)]
Range = Annotated[tuple[_Value, _Value], BeforeValidator(both_ends), AfterValidator(_ascending)]
_Factor = Annotated[float, Field(ge=0.5, le=2)]


class Design(BaseModel, frozen=True, extra="forbid"):
    """How a design differs from what the category's parts say."""

    name: Annotated[str, Field(pattern=r"^[^\W\d]\w*$")]
    stretch: tuple[_Factor, _Factor, _Factor] = (1.0, 1.0, 1.0)  # Along the thing's own x, y and z
    params: dict[str, float] = {}
    without: frozenset[str] = frozenset()
    held_out: bool = False  # Whether it stands in no scene of the training side


PLAIN = Design(name="plain")
DesignSets = Mapping[str, tuple[Design, ...]]


class Variant(BaseModel, frozen=True, extra="forbid"):
    """A variant of a category: its differences from the default."""

    name: str
    attributes: dict[str, str] = {}
    roles: dict[str, str] = {}
    params: dict[str, Range] = {}
    without: frozenset[str] = frozenset()
    weight: Annotated[float, Field(gt=0)] = 1.0
    identifying_parts: Annotated[tuple[str, ...], Field(alias="tells")] = ()


class Category(BaseModel, frozen=True, extra="forbid"):
    """A category of props."""

    category: str  # Its key, e.g. ``"delivery_van"``
    name: str  # Common noun, e.g. ``"delivery van"``
    kind: str  # One of `KINDS`
    source: str  # File and category, for messages
    target: bool  # Whether tasks may ask for it: false of landmarks and of scenery
    front: str
    params: dict[str, Range] = {}  # Sizes drawn once an instance; a fixed one has low == high
    roles: dict[str, str] = {}  # Default material of every role
    parts: Annotated[tuple[dict[str, Any], ...], Field(max_length=1000)] = ()  # Empty where a builder makes them
    builder: str | None = None  # Name of the builder
    identifying_parts: Annotated[tuple[str, ...], Field(alias="tells")] = ()  # Empty where the whole body does
    scale: Annotated[float, Field(ge=0.1, le=10, allow_inf_nan=False)] = 1.0  # Of all that its parts or builder say
    looks: tuple[Appearance, ...] = ()
    variants: tuple[Variant, ...] = (Variant(name=""),)  # A category without variants has one of an empty name
    designs: tuple[Design, ...] = (PLAIN,)  # Forms that it comes in; the first is what its parts say

    def design(self, name: str) -> Design:
        """Look a design up; an `AssetError` names the nearest one."""
        return self._named(self.designs, name, "design")

    def variant(self, name: str) -> Variant:
        """Look a variant up; an `AssetError` names the nearest one."""
        return self._named(self.variants, name, "variant")

    def _named(self, several: Sequence[_Named], name: str, what: str) -> _Named:
        refuse_unknown([name], [one.name for one in several], self.source, what)
        return next(one for one in several if one.name == name)


_Named = TypeVar("_Named", Design, Variant)
_TABLE_KEYS = ("params", "roles", "parts", "builder", "tells", "scale")


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
    refuse_unknown(body, (*_HEAD_KEYS, *_TABLE_KEYS), where)
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
    head = {"category": category, "name": entry.name, "kind": entry.kind, "source": where, "target": target}
    table = {key: body[key] for key in _TABLE_KEYS if key in body}
    prop = validated(Category, {**head, "front": front, **table}, where)
    _check_materials(prop.roles, materials, f"{where} roles")
    if (prop.builder is None) == (not prop.parts):
        raise AssetError(f"{where}: give parts or a builder, one of them")
    refuse_unknown([] if prop.builder is None else [prop.builder], builders(), where, "builder")
    for k, part in enumerate(prop.parts):
        _check_part(part, prop, materials, f"{where} parts[{k}]")
    tags = {tag for part in prop.parts for tag in words_of(part, "tag")}
    named = sorted({*tags, *prop.roles, *(part["role"] for part in prop.parts)})
    looks = parse_appearances(body.get("looks", []), named, materials.names, where)
    check_parts(prop.identifying_parts, named, f"{where}: tells")
    raw = body.get("variants", [])
    if not isinstance(raw, list):
        raise AssetError(f"{where}: variants must be an array of tables, [[{category}.variants]]")
    variants: list[Variant] = []
    for k, one in enumerate(raw):
        variants.append(_variant(one, prop, tags, named, materials, f"{where} variants[{k}]"))
        if variants[-1].name in {v.name for v in variants[:-1]}:
            raise AssetError(f"{where} variants[{k}]: duplicate variant {variants[-1].name!r}")
    chosen = body.get("designs", "plain")
    sets = {"plain": (PLAIN,), **sets}
    refuse_unknown([chosen] if isinstance(chosen, str) else [], sets, where, "set of designs")
    designs = (
        sets[chosen] if isinstance(chosen, str) else parse_designs(chosen, prop.params, tags, f"{where} designs")
    )
    for k, part in enumerate(prop.parts):
        refuse_unknown(words_of(part, "design"), [one.name for one in designs], f"{where} parts[{k}]", "design")
    own = {"looks": looks, "designs": designs} | ({"variants": tuple(variants)} if variants else {})
    return prop.model_copy(update=own)


def words_of(part: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Tags of a part, or names of the designs that have it: none, one, or those of a list."""
    words = part.get(key, ())
    return (words,) if isinstance(words, str) else tuple(words)


def _check_part(part: dict[str, Any], prop: Category, materials: MaterialLibrary, where: str) -> None:
    if "shape" not in part:
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
    if part.get("mirror", "x") not in ("x", "y", "xy"):
        raise AssetError(f"{where}: mirror must be x, y or xy, got {part['mirror']!r}")
    for key in ("tag", "design"):
        words = part.get(key, "")
        if not isinstance(words, str) and not (
            isinstance(words, list) and all(isinstance(one, str) for one in words)
        ):
            raise AssetError(f"{where}: {key} must be a word or a list of words, got {words!r}")
    role = part.get("role")
    if not isinstance(role, str):
        raise AssetError(f"{where}: role is missing: a role of the category or a material")
    if role not in prop.roles:
        is_material = role.startswith("#") or role.partition(":")[0] in materials.names
        if not is_material and (near := nearest(role, prop.roles)):
            raise AssetError(f"{where}: unknown role {role!r}{near}")
        materials.check(role, where)
    try:
        used = sorted(names_used(part))
    except ShapeError as error:
        raise AssetError(f"{where}: {error}") from error
    refuse_unknown(used, prop.params, where, "parameter")


def _variant(
    raw: Any, prop: Category, tags: set[str], named: Sequence[str], materials: MaterialLibrary, where: str
) -> Variant:
    if not isinstance(raw, dict) or not raw.get("name"):
        raise AssetError(f"{where}: name is missing")
    where = f"{where} ({raw['name']})"
    variant = validated(Variant, raw, where)
    refuse_unknown(variant.params, prop.params, f"{where} params")
    refuse_unknown(sorted(variant.without), tags, f"{where} without", "tag")
    refuse_unknown(variant.roles, prop.roles, f"{where} roles")
    _check_materials(variant.roles, materials, f"{where} roles")
    check_parts(variant.identifying_parts, named, f"{where}: tells")
    return variant


def _check_materials(roles: Mapping[str, str], materials: MaterialLibrary, where: str) -> None:
    for role, spec in roles.items():
        materials.check(spec, f"{where} {role}")


def of_side(designs: Sequence[Design], side: Side) -> Sequence[Design]:
    """Designs that a scene of one side may have: the first where it has no other."""
    if side == "plain":
        return designs[:1]
    return [one for one in designs if one.held_out == (side == "held_out")] or designs[:1]


def parse_designs(raw: Any, params: Mapping[str, Any], tags: set[str], where: str) -> tuple[Design, ...]:
    """Check a list of designs."""
    if not isinstance(raw, list) or not raw:
        raise AssetError(f"{where}: designs must be an array of tables, or the name of a set")
    designs = tuple(validated(Design, one, f"{where}[{k}]") for k, one in enumerate(raw))
    for k, one in enumerate(designs):
        refuse_unknown(one.params, params, f"{where}[{k}] params")
        refuse_unknown(sorted(one.without), tags, f"{where}[{k}] without", "tag")
    names = [one.name for one in designs]
    if len(set(names)) < len(names):
        raise AssetError(f"{where}: two designs have one name ({', '.join(names)})")
    if designs[0].held_out:
        raise AssetError(f"{where}[0]: the first design is not held out: it is the one that all others differ from")
    return designs


def load_sets(path: Path) -> DesignSets:
    """Read the designs that categories share; without the file there are none."""
    body = read_toml(path) if path.is_file() else {}
    return {name: parse_designs(raw, {}, set(), f"{path}: {name}") for name, raw in body.items()}
