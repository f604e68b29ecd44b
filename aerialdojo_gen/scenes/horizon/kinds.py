"""The kinds of country beyond a scene's edge, and which of them a type of scene has by default."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Literal

from aerialdojo_gen.scenes.recipe import HorizonHead

Houses = Literal["none", "detached", "terraces", "blocks", "sheds", "farms", "cubes", "cabins"]
Tree = Literal["round", "spire", "palm", "scrub"]


@dataclass(frozen=True)
class Kind:
    """A kind of country."""

    ground: str = ""  # Material of the land; that of the scene's own edge where empty
    fields: tuple[str, ...] = ()  # Materials of fields or quarters further off
    near_m: float = 1.5  # Height of the relief up to some hundred metres
    hills_m: float = 40.0  # Height of the farthest hills
    steep: bool = False  # Whether hills are crests
    far: str = "meadow:#6d7f55"  # Material of the hills
    trees_ha: float = 12.0  # Trees a hectare, up to 200 m
    trees: tuple[Tree, ...] = ("round",)
    crowns: tuple[str, ...] = ("foliage", "foliage:#5d8440", "foliage:#46702f")
    wood: float = 0.25  # Share of the land under woods
    houses: Houses = "none"
    houses_ha: float = 0.0  # Houses a hectare, up to 300 m
    wet: bool = False  # Whether trees and houses stand in water too


_GREEN = ("meadow", "grass:#6f8f46", "meadow:#a39a58")
KINDS: dict[str, Kind] = {
    "city": Kind(
        fields=("paving:#9c968c",), near_m=0.6, hills_m=30, houses="blocks", houses_ha=7.0, trees_ha=14, wood=0.05
    ),
    "town": Kind(fields=("grass:#6f8f46",), near_m=1.0, houses="terraces", houses_ha=9.0, trees_ha=22, wood=0.1),
    "suburb": Kind(fields=_GREEN[:2], houses="detached", houses_ha=9.0, trees_ha=32, wood=0.2),
    "works": Kind(
        fields=("grass:#75864f", "gravel:#8c867c", "meadow:#86894f"), near_m=0.5, houses="sheds", houses_ha=4.0,
        trees_ha=12, wood=0.1,
    ),
    "fields": Kind(fields=(*_GREEN, "dirt:#8f7a58"), near_m=2.5, houses="farms", houses_ha=0.5, trees_ha=7, wood=0.2),
    "woods": Kind(near_m=5.0, hills_m=70, trees_ha=150, trees=("round", "spire"), wood=0.95, far="meadow:#55703f"),
    "mountains": Kind(
        near_m=6.0, hills_m=420, steep=True, far="rock:#8f8b86", trees_ha=40, trees=("spire",), wood=0.5,
        crowns=("needles", "needles:#46703e"),
    ),
    "snow": Kind(ground="snow", near_m=5.0, hills_m=170, steep=True, far="snow:#dde5ee", trees_ha=0, wood=0.0),
    "alps": Kind(
        ground="snow", near_m=7.0, hills_m=380, steep=True, far="snow:#dde5ee", trees_ha=60, trees=("spire",),
        wood=0.45, crowns=("needles:#3f5c46", "needles:#557062"), houses="cabins", houses_ha=0.7,
    ),
    "desert": Kind(
        near_m=7.0, hills_m=90, far="sand:#cfae7d", trees_ha=1.0, trees=("scrub",), wood=0.0,
        crowns=("foliage:#7d7f4a",),
    ),
    "canyon": Kind(
        near_m=6.0, hills_m=190, steep=True, far="rock:#a9663f", trees_ha=5, trees=("scrub",), wood=0.0,
        crowns=("foliage:#7d7f4a",),
    ),
    "coast": Kind(fields=_GREEN[:2], near_m=5.0, hills_m=90, houses="detached", houses_ha=1.5, trees_ha=10, wood=0.2),
    "tropics": Kind(
        near_m=5.0, hills_m=160, steep=True, far="meadow:#4f7a48", trees_ha=60, trees=("palm", "round"), wood=0.8,
        crowns=("foliage:#4c8a35", "foliage:#6a9a40"),
    ),
    "flood": Kind(fields=_GREEN, near_m=0.8, houses="farms", houses_ha=1.2, trees_ha=9, wood=0.1, wet=True),
}  # fmt: skip
# By the word of a scene's name that says its type.
_OF_TYPE = {
    "Mall": "town", "ParkingLot": "city", "Stadium": "town", "ConstructionSite": "town", "Alley": "city",
    "Community": "city", "Neighborhood": "suburb", "Park": "suburb", "Factory": "works", "Bridge": "fields",
    "Harbor": "town", "RailCorridor": "town", "Coast": "coast", "Desert": "desert", "Forest": "woods",
    "Island": "coast", "Mountain": "mountains", "Snowfield": "snow", "Earthquake": "town", "Explosion": "works",
    "Flood": "flood",
}  # fmt: skip
_OTHERWISE = "fields"


def kind_of(scene: str, head: HorizonHead) -> Kind | None:
    """Give the country that a plan asks for, or that its type has; None for ``"none"``."""
    words = re.split(r"[_-]", scene)  # ``N_Coast_0``, and of worlds ``N_Coast-1000``
    name = head.kind or _OF_TYPE.get(words[1] if len(words) > 1 else "", _OTHERWISE)
    if name == "none":
        return None
    kind = KINDS[name]
    hills_m = kind.hills_m if head.hills_m is None else head.hills_m
    return replace(kind, hills_m=hills_m, ground=head.ground or kind.ground)
