"""Phrases about a category's appearance, and what each claims of the mesh."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.scenes.colours import COLOURS
from aerialdojo_gen.scenes.materials import refuse_unknown

FORMS = ("round", "boxy", "flat", "slender", "tapering", "pointed", "sloping", "upright", "level")
MEASURES = ("length", "width", "height")
RELATIONS = ("above", "below", "in front of", "behind", "beside", "inside", "around")
PLACES = ("on top", "at the bottom", "in the middle")
_SAYS = ("say", "also", "adjective", "clause")
_KEYS = (*_SAYS, "has", "lacks", "count", "form", "colour", "material", "size", "order")
_SUBJECTS = ("it", "its", "they", "their", "one", "there")
_TERM = r"(?:(?P<{0}p>[a-z0-9_|]+)\.)?(?P<{0}m>length|width|height)"
_SIZE = re.compile(
    _TERM.format("a") + r"\s*(?P<sign>[<>])\s*(?P<factor>\d+(?:\.\d+)?)?(?:\s*\*\s*)?(?:" + _TERM.format("b") + r")?"
)
_ORDER = re.compile(
    r"(?P<a>[a-z0-9_|]+) (?:(?P<relation>" + "|".join(RELATIONS) + r") (?P<b>[a-z0-9_|]+)|(?P<place>"
    + "|".join(PLACES) + r"))"
)  # fmt: skip


@dataclass(frozen=True)
class Comparison:
    """A measure of the body or a part, compared with a number or ``factor`` times another measure; metres."""

    part: str  # Empty for the whole body
    measure: str  # One of `MEASURES`
    greater: bool  # Whether it must be the greater of the two
    factor: float  # The number, or the factor of the other measure
    other: tuple[str, str] | None  # (str, str) or None; part and measure compared with
    text: str  # As it was written


@dataclass(frozen=True)
class Order:
    """Position of a part: relative to another one, or in the body."""

    part: str
    relation: str  # One of `RELATIONS`, or of `PLACES`
    other: str  # The other part; empty for places
    text: str  # As it was written


@dataclass(frozen=True)
class Appearance:
    """A phrase and its claims."""

    phrase: str  # Its first wording, which is its key in the catalogue
    also: tuple[str, ...] = ()  # More phrases like it, which assert no more
    adjectives: tuple[str, ...] = ()  # The same before the name: ``"slatted"``
    clauses: tuple[str, ...] = ()  # The same as a clause: ``"it lies on its roof"``
    has: tuple[str, ...] = ()  # Parts that the body must have, or must not; ``"a|b"`` is either
    lacks: tuple[str, ...] = ()
    count: Mapping[str, tuple[int, int]] = field(default_factory=dict)  # Copies of a part
    form: Mapping[str, str] = field(default_factory=dict)  # One of `FORMS`, of each copy of a part
    colour: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    material: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    size: tuple[Comparison, ...] = ()
    order: tuple[Order, ...] = ()

    @property
    def details(self) -> tuple[str, ...]:
        """Noun phrases that follow "with" or "it has"."""
        return () if self.phrase in self.adjectives else (self.phrase, *self.also)

    @property
    def wordings(self) -> tuple[str, ...]:
        """Ways to say it that a text can be searched for: it may give an adjective to another thing."""
        return (*self.details, *self.clauses)

    @property
    def parts(self) -> tuple[str, ...]:
        """All parts that its claims require."""
        ordered = [name for o in self.order for name in (o.part, o.other) if name]
        sized = [name for c in self.size for name in (c.part, c.other[0] if c.other else "") if name]
        return tuple(
            dict.fromkeys([*self.has, *self.count, *self.form, *self.colour, *self.material, *sized, *ordered])
        )


def parse_appearances(raw: Any, names: Sequence[str], materials: Sequence[str], where: str) -> tuple[Appearance, ...]:
    """Parse a category's looks."""
    if not isinstance(raw, list):
        raise AssetError(f"{where}: looks must be an array of tables")
    appearances = tuple(_appearance(entry, names, materials, f"{where} looks[{k}]") for k, entry in enumerate(raw))
    said: set[str] = set()
    for k, appearance in enumerate(appearances):
        for wording in (*appearance.wordings, *appearance.adjectives):
            if wording in said:
                raise AssetError(f"{where} looks[{k}]: duplicate phrase {wording!r}")
            said.add(wording)
    return appearances


def _appearance(entry: Any, names: Sequence[str], materials: Sequence[str], where: str) -> Appearance:
    if not isinstance(entry, dict) or not {"say", "adjective"} & set(entry):
        raise AssetError(f"{where}: must be a table with say or adjective: its words, and what they claim")
    refuse_unknown(entry, _KEYS, where)
    if "also" in entry and "say" not in entry:
        raise AssetError(f"{where}: also needs say")
    say, also = _words(entry, "say", where), _words(entry, "also", where)
    adjectives, clauses = _words(entry, "adjective", where), _words(entry, "clause", where)
    said = (*say, *also, *adjectives, *clauses)
    for clause in clauses:
        if clause.split(" ")[0] not in _SUBJECTS:
            raise AssetError(f"{where}: clause {clause!r} must begin with one of {', '.join(_SUBJECTS)}")
    if not all(wording.strip() == wording != "" for wording in said):
        raise AssetError(f"{where}: a wording is empty, or has blanks at its ends")
    if not set(entry) - set(_SAYS):
        claims = ", ".join(_KEYS[len(_SAYS) :])
        raise AssetError(f"{where}: {said[0]!r} claims nothing that can be checked: add {claims}")
    appearance = Appearance(
        said[0],
        also,
        adjectives,
        clauses,
        has=_words(entry, "has", where),
        lacks=_words(entry, "lacks", where),
        count={name: _range(n, f"{where} count {name}") for name, n in _table(entry, "count", where).items()},
        form={name: str(form) for name, form in _table(entry, "form", where).items()},
        colour=_choices(entry, "colour", COLOURS, where),
        material=_choices(entry, "material", materials, where),
        size=tuple(_comparison(text, where) for text in _words(entry, "size", where)),
        order=tuple(_order(text, where) for text in _words(entry, "order", where)),
    )
    for name in (*appearance.parts, *appearance.lacks):
        for one in name.split("|"):
            if one not in names:
                raise AssetError(f"{where}: no part {one!r}{nearest(one, names)}: parts are named by tag or role")
    for form in appearance.form.values():
        if form not in FORMS:
            raise AssetError(f"{where}: unknown form {form!r}{nearest(form, FORMS)} (one of {', '.join(FORMS)})")
    return appearance


def _table(entry: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
    value = entry.get(key, {})
    if not isinstance(value, dict) or (key in entry and not value):
        raise AssetError(f"{where}: {key} must be a table of parts")
    return value


def _words(entry: Mapping[str, Any], key: str, where: str) -> tuple[str, ...]:
    value = entry.get(key, [])
    value = [value] if isinstance(value, str) else value
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value) or (key in entry and not value):
        raise AssetError(f"{where}: {key} must be a list of words")
    return tuple(value)


def _choices(entry: Mapping[str, Any], key: str, known: Sequence[str], where: str) -> dict[str, tuple[str, ...]]:
    out = {}
    for name, value in _table(entry, key, where).items():
        words = tuple(value.split("|")) if isinstance(value, str) else ()
        refuse_unknown(words or (str(value),), known, f"{where} {key}", key)
        out[name] = words
    return out


def _range(value: Any, where: str) -> tuple[int, int]:
    ends = value if isinstance(value, list) else [value, value]
    if len(ends) != 2 or not all(type(n) is int for n in ends) or not 0 < ends[0] <= ends[1]:
        raise AssetError(f"{where}: must be a whole number or [least, most], got {value!r}")
    return ends[0], ends[1]


def _comparison(text: str, where: str) -> Comparison:
    m = _SIZE.fullmatch(text.strip())
    if m is None or (m["factor"] is None and m["bm"] is None):
        raise AssetError(f'{where} size: {text!r} is no comparison like "height > 1.9" or "length > 3 * width"')
    other = None if m["bm"] is None else (m["bp"] or "", m["bm"])
    return Comparison(m["ap"] or "", m["am"], m["sign"] == ">", float(m["factor"] or 1.0), other, text)


def _order(text: str, where: str) -> Order:
    m = _ORDER.fullmatch(text.strip())
    if m is None:
        known = ", ".join([*(f'"a {r} b"' for r in RELATIONS), *(f'"a {p}"' for p in PLACES)])
        raise AssetError(f"{where} order: {text!r} is none of {known}")
    return Order(m["a"], m["relation"] or m["place"], m["b"] or "", text)
