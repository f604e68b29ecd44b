"""Phrases of place: the conditions that each one is bound to, and whether they hold of an instance.

`places/<scene type>.toml` has one table per scene and one phrase per line:

    [U_Factory_0]
    "in the coal yard" = { surface = "dirt*", near = "coal_heap*", also = ["among the coal heaps"] }

All conditions must hold of the built mesh. Things are patterns of node names or categories, with alternatives
separated by ``|``; surfaces are patterns of materials. A word means the distance that it means in `relations`.
`also` gives other wordings, true under the same conditions; `say` one that texts use instead of the phrase itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fnmatch import fnmatchcase
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from aerialdojo_gen.annotations.relations import AT_M, BESIDE_M, NEAR_M, TOUCHING_M, SceneGeometry
from aerialdojo_gen.annotations.vocabulary import GROUND, ground_triangles
from aerialdojo_gen.base.cached import cached_method
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.base.safe_parse import read_toml

Conditions = Mapping[str, Any]

# Keys of a phrase's table that are no conditions: wordings.
_WORDS = frozenset({"say", "also"})
_FOLDER = Path(__file__).parent / "places"
_PARTS = frozenset(f"{a}{b}" for a in ("", "north", "south") for b in ("", "east", "west")) - {""} | {"middle"}
# Farthest things that make a place: the heaps of a yard, the rows of a street.
_MAX_PLACE_M = 15.0


@cache
def places_of(scene: str) -> Mapping[str, Conditions] | None:
    """Look up the phrases of place of a scene."""
    path = _FOLDER / f"{scene.rpartition('_')[0]}.toml"
    tables = read_toml(path, AnnotationError) if path.is_file() else {}
    if scene not in tables:
        return None
    check_phrases(f"{path.name}: [{scene}]", tables[scene])
    return dict(tables[scene])


def check_phrases(where: str, phrases: Mapping[str, Any]) -> None:
    """Raise an `AnnotationError` if a phrase's conditions are invalid, or if two phrases share a wording."""
    said: dict[str, str] = {}
    for phrase, entry in phrases.items():
        check_conditions(f"{where} {phrase!r}", entry)
        for wording in sorted({phrase, *_wordings(phrase, entry)}):
            other = said.setdefault(wording.lower(), phrase)
            if other != phrase:
                raise AnnotationError(f"{where} {phrase!r}: {wording!r} is a wording of {other!r} too")


def _wordings(phrase: str, entry: Conditions) -> tuple[str, ...]:
    return entry.get("say", phrase), *entry.get("also", ())


def check_conditions(where: str, conditions: Any) -> None:
    """Raise an `AnnotationError` that begins with `where` if the conditions are invalid."""
    if not isinstance(conditions, dict) or not conditions.keys() - _WORDS:
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
        and _text(value[1]) and _number(value[2]) and 0 < value[2] <= _MAX_PLACE_M
    )  # fmt: skip


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(map(_text, value)) and 0 < len(set(value)) == len(value)


_STEP_M, _RISE_M = 0.4, 3.0
_SLAB_SHARE = 0.06  # of the outline: smaller level surfaces are sills or stairs
_STOREY_M = 1.6
_CORNERS: Mapping[str, tuple[int, int]] = {
    "north": (0, 1), "south": (0, -1), "east": (1, 0), "west": (-1, 0),
    "northeast": (1, 1), "northwest": (-1, 1), "southeast": (1, -1), "southwest": (-1, -1),
}  # fmt: skip


class Places:
    """The phrases of place of one scene."""

    def __init__(self, geometry: SceneGeometry, phrases: Mapping[str, Conditions]) -> None:
        self._geometry = geometry
        self._phrases = {phrase.lower(): conditions for phrase, conditions in phrases.items()}
        # By bound phrase, in lower case, what texts may say: it or `say`, then `also`.
        self.wordings = {phrase.lower(): _wordings(phrase, entry) for phrase, entry in sorted(phrases.items())}

    @cached_method
    def fault(self, i: int, phrase: str, slack: float = 1.0) -> str:
        """Return the first condition of a phrase that does not hold for instance `i`; empty if all hold."""
        conditions = {k: v for k, v in self._phrases[phrase].items() if k not in _WORDS}.items()
        wrong = (f"{name} = {value!r}" for name, value in conditions if not _TESTS[name](self, i, value, slack))
        return next(wrong, "")

    @cached_method
    def _match(self, pattern: str) -> frozenset[int]:
        return frozenset(
            k for k, thing in enumerate(self._geometry.scene.instances)
            if any(fnmatchcase(thing.node, one) or thing.category == one for one in pattern.split("|"))
        )  # fmt: skip

    def _within(self, i: int, pattern: str, slack: float, reach_m: float) -> bool:
        most_m = reach_m * slack
        if most_m >= AT_M and i in self._match(pattern):
            return True  # it is itself one of the things that make the place
        close = set(self._geometry.neighbours(i, most_m))
        return any(self._geometry.gap_m(i, j) <= most_m for j in sorted(self._match(pattern) & close))

    def _beyond(self, i: int, pattern: str, _slack: float, direction: str) -> bool:
        """Beyond the centre of things."""
        boxes = self._geometry.boxes[sorted(self._match(pattern) - {i})]
        if len(boxes) == 0:
            return False
        middle = (boxes[:, 0, :2].min(axis=0) + boxes[:, 1, :2].max(axis=0)) / 2.0
        return float((self._geometry.centres[i, :2] - middle) @ _CORNERS[direction]) > 0.0

    def _stack(self, i: int) -> list[int]:
        """Return the chain of instances below an instance that support it."""
        chain: list[int] = []
        at = self._geometry.support(i)
        if at is None:
            at = self._uneven_support(i)
        while at is not None and at not in chain and len(chain) < 5:
            chain.append(at)
            at = self._geometry.support(at)
        return chain

    def _uneven_support(self, i: int) -> int | None:
        """Return the support of an instance on uneven ground: a slope, a rock."""
        low = float(self._geometry.boxes[i, 0, 2])
        found = [
            (float(heights[heights <= low + 2.0 * _STEP_M].max()), j)
            for x, y in self._geometry.probes(i)
            for j, heights in self._geometry.columns(i, x, y)
            if (heights <= low + 2.0 * _STEP_M).any()
        ]
        best = max(found, default=(-math.inf, -1))
        return best[1] if best[0] >= low - 2.0 * _STEP_M else None

    def _on(self, i: int, pattern: str, _slack: float) -> bool:
        return bool(self._match(pattern) & set(self._stack(i)))

    def _roof(self, i: int, pattern: str, slack: float) -> bool:
        """On it, above ground level, and not under any part of it."""
        mine = self._match(pattern) & set(self._stack(i))
        return bool(mine) and not mine & self._overhead(i) and self._high(i, 1.8, slack)

    def _overhead(self, i: int) -> set[int]:
        geometry = self._geometry
        x, y = (float(c) for c in geometry.centres[i, :2])
        top = float(geometry.boxes[i, 1, 2]) - 0.05
        return {j for j, heights in geometry.columns(i, x, y) if (heights >= top).any()}

    def _under(self, i: int, pattern: str, _slack: float) -> bool:
        return bool(self._match(pattern) & self._overhead(i))

    def _inside(self, i: int, pattern: str, slack: float) -> bool:
        return any(self._within_hull(i, [j]) for j in sorted(self._match(pattern) - {i}))

    def _hull(self, i: int, pattern: str, slack: float) -> bool:
        return self._within_hull(i, sorted(self._match(pattern) - {i}))

    def _within_hull(self, i: int, things: list[int]) -> bool:
        if not things:
            return False
        boxes = self._geometry.boxes
        x, y, z = (float(c) for c in self._geometry.centres[i])
        if not boxes[things, 0, 2].min() - 1.0 <= z <= boxes[things, 1, 2].max() + 2.0:
            return False
        low, high = boxes[things, 0, :2].min(axis=0), boxes[things, 1, :2].max(axis=0)
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
            return False
        hull = shapely.convex_hull(shapely.union_all([self._geometry.outline(j) for j in things]))
        return bool(shapely.contains_xy(hull, x, y))

    def _between(self, i: int, patterns: list[str], slack: float) -> bool:
        """Between two things that are at most `_MAX_PLACE_M` away."""
        geometry = self._geometry
        x, y = (float(c) for c in geometry.centres[i, :2])
        close = set(geometry.neighbours(i, _MAX_PLACE_M * slack))
        first, second = (sorted(self._match(pattern) & close) for pattern in patterns)
        for a in first:
            for b in second:
                if a == b or max(geometry.gap_m(i, a), geometry.gap_m(i, b)) > _MAX_PLACE_M * slack:
                    continue
                hull = shapely.convex_hull(shapely.union(geometry.outline(a), geometry.outline(b)))
                if shapely.contains_xy(shapely.buffer(hull, slack), x, y):
                    return True
        return False

    def _over(self, i: int, pattern: str, _slack: float) -> bool:
        """Above a thing, or above ground of a material."""
        geometry = self._geometry
        low = float(geometry.boxes[i, 0, 2])
        for j in sorted(self._match(pattern) - {i}):
            lower = float(geometry.boxes[j, 0, 2]) < low + _STEP_M
            if lower and shapely.intersects(geometry.outline(i), geometry.outline(j)):
                return True
        below = self._materials(i, self._grid(i), lambda heights: heights < low + _STEP_M, ground=True)
        return any(self._named(material, pattern) for material in below)

    def _surface(self, i: int, pattern: str, slack: float) -> bool:
        """At least half of it stands on the material, or floats in it."""
        low, high = (float(z) for z in self._geometry.boxes[i, :, 2])
        points = self._geometry.probes(i)
        dry = self._materials(i, points, lambda z: (z >= low - 0.8) & (z <= low + _STEP_M))
        wet = self._materials(i, points, lambda z: (z >= low - 0.8) & (z <= max(high, low + _STEP_M)))
        found = [m if m and "water" not in n else n for m, n in zip(dry, wet, strict=True)]
        good = sum(self._named(material, pattern) for material in found)
        return good >= (1 if slack > 1.0 else (len([m for m in found if m]) + 1) // 2) and good > 0

    def _by(self, i: int, pattern: str, slack: float) -> bool:
        """Ground of the material is within `BESIDE_M`."""
        tree, corners = self._ground(pattern)
        hits = tree.query(self._geometry.outline(i), predicate="dwithin", distance=BESIDE_M * slack)
        low = float(self._geometry.boxes[i, 0, 2])
        return bool((np.abs(corners[hits, :, 2].mean(axis=1) - low) <= _RISE_M).any())

    @cached_method
    def _ground(self, pattern: str) -> tuple[shapely.STRtree, NDArray[np.float64]]:
        return ground_triangles(self._geometry.scene, pattern)

    @staticmethod
    def _named(material: str, pattern: str) -> bool:
        return any(fnmatchcase(material, one) for one in pattern.split("|"))

    def _grid(self, i: int) -> list[tuple[float, float]]:
        (x0, y0, _), (x1, y1, _) = self._geometry.boxes[i]
        return [(x0 + a * (x1 - x0), y0 + b * (y1 - y0)) for a in (0.2, 0.5, 0.8) for b in (0.2, 0.5, 0.8)]

    def _materials(
        self,
        i: int,
        points: list[tuple[float, float]],
        fits: Callable[[NDArray[np.float64]], Any],
        ground: bool = False,
    ) -> list[str]:
        """Material of the highest matching surface at each point; empty if there is none."""
        found = []
        for x, y in points:
            best, name = -math.inf, ""
            for j, _ in self._geometry.columns(i, x, y):
                if ground and self._geometry.scene.instances[j].category not in GROUND:
                    continue
                for material, heights in self._geometry.surfaces(j, x, y):
                    good = heights[fits(heights)]
                    if len(good) and float(good.max()) > best:
                        best, name = float(good.max()), material
            found.append(name)
        return found

    def _high(self, i: int, least_m: float, _slack: float) -> bool:
        """At least that high above the ground below, if there is any."""
        geometry = self._geometry
        low = float(geometry.boxes[i, 0, 2])
        x, y = (float(c) for c in geometry.centres[i, :2])
        for j, heights in geometry.columns(i, x, y):
            if geometry.scene.instances[j].category in GROUND:
                below = heights[heights <= low + _STEP_M]
                if len(below) and low - float(below.max()) < least_m:
                    return False
        return True

    def _z(self, i: int, ends: list[float], _slack: float) -> bool:
        return ends[0] <= float(self._geometry.boxes[i, 0, 2]) <= ends[1]

    def _floor(self, i: int, value: list[Any], _slack: float) -> bool:
        """On that floor: the number of slabs above the ground floor and not above its bottom."""
        number, pattern = value
        low = float(self._geometry.boxes[i, 0, 2])
        for j in sorted(self._match(pattern) & set(self._stack(i))):
            slabs = self._slab_heights(j)
            if len(slabs) and int((slabs[1:] <= low + _STEP_M).sum()) == number:
                return True
        # The ground floor may be the ground itself.
        return number == 0 and self._inside(i, pattern, 1.0) and not self._high(i, 1.0, 1.0)

    @cached_method
    def _slab_heights(self, j: int) -> NDArray[np.float64]:
        """Heights of a building's floors, ground floor first, metres."""
        instance = self._geometry.scene.instances[j]
        a, b, c = np.moveaxis(instance.vertices[instance.faces], 1, 0)
        normal = np.cross(b - a, c - a)
        area = np.linalg.norm(normal, axis=1) / 2.0
        level = normal[:, 2] > 1.9 * area
        z = np.round((a[:, 2] + b[:, 2] + c[:, 2])[level] / 3.0, 1)
        least = _SLAB_SHARE * float(shapely.area(self._geometry.outline(j)))
        slabs = [self._ground_under(j)]
        for height in np.unique(z):
            if float(area[level][z == height].sum()) >= least and height - slabs[-1] >= _STOREY_M:
                slabs.append(float(height))
        return np.array(slabs)

    def _ground_under(self, j: int) -> float:
        """Median ground height at the corners of a thing's box, metres."""
        geometry = self._geometry
        (x0, y0, low), (x1, y1, _) = geometry.boxes[j]
        heights = []
        for x, y in ((x0 - 1, y0 - 1), (x1 + 1, y0 - 1), (x0 - 1, y1 + 1), (x1 + 1, y1 + 1)):
            for k, found in geometry.columns(j, float(x), float(y)):
                if geometry.scene.instances[k].category in GROUND:
                    heights.append(float(found.max()))
        return float(np.median(heights)) if heights else float(low)

    def _among(self, i: int, value: list[Any], slack: float) -> bool:
        least, pattern, most_m = value
        others = self._match(pattern) - {i}
        near = (j for j in self._geometry.neighbours(i, most_m * slack) if j in others)
        return sum(self._geometry.gap_m(i, j) <= most_m * slack for j in near) >= least

    def _part(self, i: int, part: str, slack: float) -> bool:
        """In that part of the scene: at least 0.2 of the way from centre to edge."""
        (x0, y0, _), (x1, y1, _) = self._geometry.scene.bounds
        x, y = self._geometry.centres[i, :2]
        u, v = (x - (x0 + x1) / 2) / ((x1 - x0) / 2), (y - (y0 + y1) / 2) / ((y1 - y0) / 2)
        if part == "middle":
            return max(abs(u), abs(v)) <= 0.34 * slack
        dx, dy = _CORNERS[part]
        return (dx == 0 or u * dx >= 0.2 / slack) and (dy == 0 or v * dy >= 0.2 / slack)


_REACH_M = {"touching": TOUCHING_M, "beside": BESIDE_M, "at": AT_M, "near": NEAR_M}
_TESTS: Mapping[str, Callable[[Places, int, Any, float], bool]] = {
    "on": Places._on, "roof": Places._roof, "under": Places._under, "inside": Places._inside, "hull": Places._hull,
    "between": Places._between, "over": Places._over, "surface": Places._surface, "by": Places._by,
    "high": Places._high, "z": Places._z, "floor": Places._floor, "among": Places._among, "part": Places._part,
    **{name: partial(Places._within, reach_m=most_m) for name, most_m in _REACH_M.items()},
    **{f"{side}_of": partial(Places._beyond, direction=side) for side in ("north", "south", "east", "west")},
}  # fmt: skip
# What a key's value must be: a pattern of things or materials, where nothing else is said.
_FORMS: Mapping[str, Callable[[Any], bool]] = dict.fromkeys([*_TESTS, "say"], _text) | {
    "also": _texts,
    "floor": lambda v: isinstance(v, list) and len(v) == 2 and isinstance(v[0], int) and _text(v[1]),
    "between": lambda v: isinstance(v, list) and len(v) == 2 and all(map(_text, v)),
    "z": lambda v: isinstance(v, list) and len(v) == 2 and all(map(_number, v)) and v[0] < v[1],
    "high": _number,
    "among": _among,
    "part": lambda v: isinstance(v, str) and v in _PARTS,
}
