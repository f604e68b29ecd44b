"""Phrases about a category's appearance, what each claims, and whether that is so of an instance's mesh."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Annotated, Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, PlainValidator, model_validator

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.scenes.colours import COLOURS, colour_name
from aerialdojo_gen.scenes.materials import refuse_unknown, validated
from aerialdojo_gen.scenes.model import Instance, Material

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Copies with centres nearer than this count once: a part in the plane of symmetry is mirrored onto itself.
_SAME_PLACE_M = 0.02
_FEW_DIRECTIONS, _ROUND_SHARE, _BOXY_SHARE = 6, 0.8, 0.9
_FLAT, _SLENDER, _TAPERING, _POINTED = 0.2, 3.5, 0.8, 1 / 3
_SLOPE_COS = (0.15, 0.95)
_SLOPING_SHARE = 0.2
_END = 0.1

FORMS: Mapping[str, Callable[[Body, Ints], bool]] = {
    "round": lambda b, f: b.few_directions(f) <= _ROUND_SHARE,
    "boxy": lambda b, f: b.few_directions(f) >= _BOXY_SHARE,
    "flat": lambda b, f: bool((size := b.extents(f))[0] < _FLAT * size[1]),
    "slender": lambda b, f: bool((size := b.extents(f))[2] > _SLENDER * size[1]),
    "tapering": lambda b, f: b.narrowing(f) <= _TAPERING,
    "pointed": lambda b, f: b.narrowing(f) <= _POINTED,
    "sloping": lambda b, f: b.sloping(f) >= _SLOPING_SHARE,
    "upright": lambda b, f: bool(b.size(f).argmax() == 2),
    "level": lambda b, f: bool(b.size(f).argmin() == 2),
}
_Boxes = Callable[[Floats, Floats], bool]
RELATIONS: Mapping[str, _Boxes] = {
    "above": lambda a, b: bool(a[0, 2] >= b[:, 2].mean()),
    "below": lambda a, b: bool(a[1, 2] <= b[:, 2].mean()),
    "in front of": lambda a, b: bool(a[:, 0].mean() > b[:, 0].mean() and a[1, 0] > b[1, 0] - 1e-3),
    "behind": lambda a, b: bool(a[:, 0].mean() < b[:, 0].mean() and a[0, 0] < b[0, 0] + 1e-3),
    "beside": lambda a, b: bool(
        ((a[0, :2] >= b[:, :2].mean(axis=0)) | (a[1, :2] <= b[:, :2].mean(axis=0))).any()
        and a[0, 2] < b[1, 2]
        and b[0, 2] < a[1, 2]
    ),
    "inside": lambda a, b: bool(((a[0] >= b[0] - 0.05) & (a[1] <= b[1] + 0.05)).all()),
    "around": lambda a, b: bool(((a[0, :2] <= b[0, :2] + 0.01) & (a[1, :2] >= b[1, :2] - 0.01)).all()),
}
PLACES: Mapping[str, _Boxes] = {
    "on top": lambda a, whole: bool(a[1, 2] >= whole[1, 2] - _END * np.ptp(whole[:, 2])),
    "at the bottom": lambda a, whole: bool(a[0, 2] <= whole[0, 2] + _END * np.ptp(whole[:, 2])),
    "in the middle": lambda a, whole: bool(
        (np.abs(a.mean(axis=0) - whole.mean(axis=0))[:2] <= 0.2 * np.ptp(whole[:, :2], axis=0)).all()
    ),
}

_CLAIMS = ("has", "lacks", "count", "form", "colour", "material", "size", "order")
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
    measure: str  # ``"length"``, ``"width"`` or ``"height"``
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


def _comparison(text: Any) -> Comparison:
    m = _SIZE.fullmatch(str(text).strip())
    if m is None or (m["factor"] is None and m["bm"] is None):
        raise ValueError(f'{text!r} is no comparison like "height > 1.9" or "length > 3 * width"')
    other = None if m["bm"] is None else (m["bp"] or "", m["bm"])
    return Comparison(m["ap"] or "", m["am"], m["sign"] == ">", float(m["factor"] or 1.0), other, text)


def _order(text: Any) -> Order:
    m = _ORDER.fullmatch(str(text).strip())
    if m is None:
        known = ", ".join([*(f'"a {r} b"' for r in RELATIONS), *(f'"a {p}"' for p in PLACES)])
        raise ValueError(f"{text!r} is none of {known}")
    return Order(m["a"], m["relation"] or m["place"], m["b"] or "", text)


def _form(name: str) -> str:
    if name not in FORMS:
        raise ValueError(f"unknown form{nearest(name, FORMS)} (one of {', '.join(FORMS)})")
    return name


def both_ends(value: Any) -> Any:
    """Read ``[low, high]``, or one number for both."""
    return tuple(value) if isinstance(value, list) else (value, value)


def _counted(ends: tuple[int, int]) -> tuple[int, int]:
    if not 0 < ends[0] <= ends[1]:
        raise ValueError("must be a whole number or [least, most], 1 or more")
    return ends


_SOME = Field(min_length=1)
_LISTED = BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else (value,))
_Words = Annotated[tuple[str, ...], _LISTED, _SOME]
_Choices = Annotated[tuple[str, ...], BeforeValidator(lambda value: tuple(str(value).split("|")))]
_Count = Annotated[tuple[int, int], BeforeValidator(both_ends), AfterValidator(_counted)]


class Appearance(BaseModel, frozen=True, extra="forbid", arbitrary_types_allowed=True):
    """A phrase and its claims."""

    say: _Words = ()
    also: _Words = ()  # More phrases like it, which assert no more
    adjectives: Annotated[_Words, Field(alias="adjective")] = ()  # The same before the name: ``"slatted"``
    clauses: Annotated[_Words, Field(alias="clause")] = ()  # The same as a clause: ``"it lies on its roof"``
    has: _Words = ()  # Parts that the body must have, or must not; ``"a|b"`` is either
    lacks: _Words = ()
    count: Annotated[dict[str, _Count], _SOME] = {}  # Copies of a part
    form: Annotated[dict[str, Annotated[str, AfterValidator(_form)]], _SOME] = {}  # Of each copy of a part
    colour: Annotated[dict[str, _Choices], _SOME] = {}
    material: Annotated[dict[str, _Choices], _SOME] = {}
    size: Annotated[tuple[Annotated[Comparison, PlainValidator(_comparison)], ...], _LISTED, _SOME] = ()
    order: Annotated[tuple[Annotated[Order, PlainValidator(_order)], ...], _LISTED, _SOME] = ()

    @model_validator(mode="after")
    def _can_be_checked(self) -> Appearance:
        if not (self.say or self.adjectives):
            raise ValueError("must be a table with say or adjective: its words, and what they claim")
        if self.also and not self.say:
            raise ValueError("also needs say")
        for clause in self.clauses:
            if clause.split(" ")[0] not in _SUBJECTS:
                raise ValueError(f"clause {clause!r} must begin with one of {', '.join(_SUBJECTS)}")
        if not all(wording.strip() == wording != "" for wording in self._said):
            raise ValueError("a wording is empty, or has blanks at its ends")
        if not any(getattr(self, claim) for claim in _CLAIMS):
            raise ValueError(f"{self.phrase!r} claims nothing that can be checked: add {', '.join(_CLAIMS)}")
        return self

    @property
    def _said(self) -> tuple[str, ...]:
        return (*self.say, *self.also, *self.adjectives, *self.clauses)

    @property
    def phrase(self) -> str:
        """Its first wording, which is its key in the catalogue."""
        return self._said[0]

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
    appearances, said = [], set[str]()
    for k, entry in enumerate(raw):
        own = f"{where} looks[{k}]"
        one = validated(Appearance, entry, own)
        for key, claimed, known in (("colour", one.colour, COLOURS), ("material", one.material, materials)):
            refuse_unknown([word for words in claimed.values() for word in words], known, f"{own} {key}", key)
        check_parts((*one.parts, *one.lacks), names, own)
        for wording in (*one.wordings, *one.adjectives):
            if wording in said:
                raise AssetError(f"{own}: duplicate phrase {wording!r}")
            said.add(wording)
        appearances.append(one)
    return tuple(appearances)


def check_parts(names: Iterable[str], known: Sequence[str], where: str) -> None:
    """Raise an `AssetError` for the name of a part, or one of several, ``"a|b"``, that a category does not have."""
    hint = f"{where}: parts are named by tag or role"
    refuse_unknown([one for name in names for one in name.split("|")], known, hint, "part")


class Materials(Protocol):
    """Materials by name: a scene's, or the catalogue's library."""

    def __getitem__(self, name: str, /) -> Material:
        """Look one up."""
        ...


class Body:
    """Measurements of an instance's mesh in its own frame."""

    def __init__(self, instance: Instance, materials: Materials) -> None:
        assert instance.anatomy is not None
        self._instance, self._materials = instance, materials
        # Phrases speak of the same few parts.
        self._faces_of, self._copies_of = cache(instance.faces_of), cache(instance.copies_of)
        yaw = instance.anatomy.yaw_rad
        cos, sin = np.cos(yaw), np.sin(yaw)
        x, y, z = (instance.vertices - instance.bounds[0]).T
        self._vertices = np.column_stack([x * cos + y * sin, y * cos - x * sin, z])
        self._faces = instance.faces
        counts = instance.face_counts
        self._part_of = np.repeat(np.arange(len(counts)), counts)

    def false_claims(self, appearance: Appearance) -> list[str]:
        """List the claims of a phrase that do not hold."""
        wrong = [f"has no {name}" for name in appearance.parts if not len(self._faces_of(name))]
        wrong += [f"has {name}" for name in appearance.lacks if len(self._faces_of(name))]
        if wrong:
            return wrong
        for name, (least, most) in appearance.count.items():
            n = self.count(name)
            wrong += [] if least <= n <= most else [f"has {n} x {name}"]
        for name, form in appearance.form.items():
            copies = self._copies_of(name)
            if not all(FORMS[form](self, faces) for faces in copies):
                wrong.append(f"its {name} is not {form}")
        for name, words in appearance.colour.items():
            found = self._shown(name, lambda m: colour_name(m.colour))
            wrong += [] if found in words else [f"its {name} is {found}"]
        for name, words in appearance.material.items():
            found = self._shown(name, lambda m: m.name.partition(":")[0])
            wrong += [] if found in words else [f"its {name} is of {found}"]
        wrong += [f"{c.text} is false" for c in appearance.size if not self._compares(c)]
        wrong += [f"{o.text} is false" for o in appearance.order if not self._ordered(o)]
        return wrong

    def count(self, name: str) -> int:
        """Number of copies of a part; copies at the same place count once."""
        middles = np.array([self._box(faces).mean(axis=0) for faces in self._copies_of(name)])
        return len(np.unique(np.round(middles / _SAME_PLACE_M), axis=0)) if len(middles) else 0

    def _shown(self, name: str, word: Callable[[Material], str]) -> str:
        faces = self._faces_of(name)
        parts = self._part_of[faces].tolist()
        words = {k: word(self._materials[self._instance.parts[k].material]) for k in set(parts)}
        area: defaultdict[str, float] = defaultdict(float)
        for k, size in zip(parts, self._areas[faces].tolist(), strict=True):
            area[words[k]] += size
        return max(sorted(area), key=lambda key: area[key])

    @cached_property
    def _cross(self) -> Floats:
        a, b, c = np.moveaxis(self._vertices[self._faces], 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def _areas(self) -> Floats:
        return np.asarray(np.linalg.norm(self._cross, axis=1) / 2.0)

    def _box(self, faces: Ints) -> Floats:
        points = self._vertices[self._faces[faces]].reshape(-1, 3)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @cached_property
    def _whole(self) -> Floats:
        return self._box(np.arange(len(self._faces)))

    def measure(self, part: str, measure: str) -> float:
        """Length, width or height of the body (part empty) or of a part, metres; of copies the largest."""
        boxes = [self._box(faces) for faces in self._copies_of(part)] if part else [self._whole]
        sizes = np.array([high - low for low, high in boxes])
        across = np.sort(sizes[:, :2], axis=1)
        return float({"length": across[:, 1], "width": across[:, 0], "height": sizes[:, 2]}[measure].max())

    def _compares(self, c: Comparison) -> bool:
        own = self.measure(c.part, c.measure)
        limit = c.factor * (1.0 if c.other is None else self.measure(*c.other))
        return own > limit if c.greater else own < limit

    def _ordered(self, order: Order) -> bool:
        a = self._box(self._faces_of(order.part))
        if not order.other:
            return PLACES[order.relation](a, self._whole)
        return RELATIONS[order.relation](a, self._box(self._faces_of(order.other)))

    def size(self, faces: Ints) -> Floats:
        """Extents of faces along the body's own axes, (3,) float64, metres."""
        low, high = self._box(faces)
        return np.asarray(high - low)

    def extents(self, faces: Ints) -> Floats:
        """Extents of faces along their principal axes, (3,) float64, metres, ascending."""
        points = np.unique(np.round(self._vertices[self._faces[faces]].reshape(-1, 3), 4), axis=0)
        axes = np.linalg.eigh(np.cov(points.T))[1] if len(points) > 3 else np.eye(3)
        along = (points - points.mean(axis=0)) @ axes
        return np.sort(np.ptp(along, axis=0))

    def few_directions(self, faces: Ints) -> float:
        """Share of the faces' area with one of the six most common normals."""
        size = self._areas[faces]
        solid = size > 0
        towards = np.round(self._cross[faces][solid] / (2.0 * size[solid, None]) * 8.0)
        _, which = np.unique(towards, axis=0, return_inverse=True)
        shares = np.sort(np.bincount(which.reshape(-1), size[solid]))[::-1]
        return float(shares[:_FEW_DIRECTIONS].sum() / shares.sum())

    def sloping(self, faces: Ints) -> float:
        """Share of the faces' area that is neither level nor upright."""
        size = self._areas[faces]
        up = np.abs(self._cross[faces][:, 2]) / np.maximum(2.0 * size, 1e-12)
        return float(size[(up > _SLOPE_COS[0]) & (up < _SLOPE_COS[1])].sum() / size.sum())

    def narrowing(self, faces: Ints) -> float:
        """Horizontal extent of the top twentieth of the faces' height, over that of the bottom one."""
        points = self._vertices[self._faces[faces]].reshape(-1, 3)
        low, high = points[:, 2].min(), points[:, 2].max()
        slab = (high - low) / 20.0
        top, bottom = points[points[:, 2] >= high - slab], points[points[:, 2] <= low + slab]
        return float(np.ptp(top[:, :2], axis=0).max() / max(np.ptp(bottom[:, :2], axis=0).max(), 1e-6))


def valid_phrases(every: Iterable[Appearance], instance: Instance, materials: Materials) -> tuple[Appearance, ...]:
    """Phrases without false claims about an instance."""
    if instance.anatomy is None:
        return ()
    body = Body(instance, materials)
    return tuple(one for one in every if not body.false_claims(one))
