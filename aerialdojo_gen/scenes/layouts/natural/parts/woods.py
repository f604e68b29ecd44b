"""Woods as the layouts of code grow them, by functions of x and y."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.kit import woods
from aerialdojo_gen.scenes.plans.fields import Field as Varying
from aerialdojo_gen.scenes.plans.fields import PointFunction, near, patches
from aerialdojo_gen.scenes.site import Site

__all__ = ["Field", "Species", "near", "patches", "plant", "strew"]
Field = PointFunction


@dataclass(frozen=True)
class Species:
    """A tree and where it likes to stand; see `woods.Species`."""

    category: str
    habitat: Field
    crowding: float = 1.0
    variant: str | None = None


def plant(
    site: Site, area: BaseGeometry, spacing_m: float, density: Field, species: Sequence[Species],
    words: dict[str, str],
) -> None:  # fmt: skip
    """Grow trees over an area."""
    kinds = [woods.Species(f"{s.category}:{s.variant or ''}", _field(s.habitat), s.crowding) for s in species]
    place = words.get("place", "")
    woods.woods(site, area=area, spacing_m=spacing_m, species=kinds, density=_field(density), place=place)


def strew(
    site: Site, category: str, area: BaseGeometry, spacing_m: float, density: Field, limit: int,
    variant: str | None = None, **options: Any,
) -> None:  # fmt: skip
    """Strew undergrowth or stones over an area."""
    of = f"{category}:{variant or ''}"
    woods.strew(site, of=of, area=area, spacing_m=spacing_m, density=_field(density), limit=limit, **options)


def _field(function: PointFunction) -> Varying:
    return Varying(lambda _site: function)
