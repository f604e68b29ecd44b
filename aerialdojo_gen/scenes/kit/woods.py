"""Woods: trees by habitat and neighbourhood, and what grows and lies under them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.natural_ground import downhill_deg, settled_z
from aerialdojo_gen.scenes.plans.fields import ScalarField
from aerialdojo_gen.scenes.plans.values import Area, Material, Number
from aerialdojo_gen.scenes.site import Site

# Where not even a stem has room, nothing need be grown to find that out.
_STEM_M = 0.3


@dataclass(frozen=True)
class Species:
    """A tree, how well places suit it, and at which share of them it stands: less than 1 for broad crowns."""

    of: str
    habitat: ScalarField
    share: Number = 1.0


@dataclass(frozen=True)
class Strewn:
    """What is strewn, how far apart, and at most how many; the rest as of `strew`."""

    of: str
    spacing_m: Annotated[Number, Field(ge=0.2)]
    limit: Annotated[int, Field(ge=0, le=10_000)]
    scale: Annotated[Number, Field(ge=0.05, le=20)] = 1.0
    roles: dict[str, Material] | None = None
    params: dict[str, Number] | None = None
    attributes: dict[str, str] | None = None


@site_builder
def woods(
    site: Site,
    *,
    area: Area,
    spacing_m: Annotated[Number, Field(ge=0.5)],
    species: Annotated[list[Species], Field(min_length=1)],
    density: ScalarField | None = None,
    place: str = "",
) -> None:
    """Grow trees over an area where there is room, of a species drawn by habitat at every place.

    They stand `spacing_m` apart where the density is 1, and further where it is less.
    """
    named = [one.of.partition(":") for one in species]
    habitats = [one.habitat.on(site) for one in species]
    rng = site.rng_for("woods", named[0][0], spacing_m)
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density.on(site) if density else None):
        if not site.is_free(x, y, _STEM_M):
            continue
        suits = np.array([habitat(x, y) for habitat in habitats])
        pick = int(rng.choice(len(species), p=suits / suits.sum()))
        if rng.random() > species[pick].share:
            continue
        category, _, variant = named[pick]
        words = {"place": place} if place else None
        site.try_place(category, x, y, yaw, z=settled_z(site, x, y, 0.3), variant=variant or None, attributes=words)


@site_builder
def strew(
    site: Site,
    *,
    of: str,
    area: Area,
    spacing_m: Annotated[Number, Field(ge=0.2)],
    limit: Annotated[int, Field(ge=0, le=10_000)],
    density: ScalarField | None = None,
    place: str = "",
    scale: Annotated[Number, Field(ge=0.05, le=20)] = 1.0,
    roles: dict[str, Material] | None = None,
    params: dict[str, Number] | None = None,
    attributes: dict[str, str] | None = None,
    solid: bool = True,
) -> None:
    """Strew undergrowth or stones over an area, where there is room; things that lie are turned along the slope."""
    category, _, variant = of.partition(":")
    rng = site.rng_for("strew", category)
    options: dict[str, Any] = {"scale": scale, "roles": roles, "params": params, "solid": solid}
    options |= {"variant": variant or None, "attributes": ({"place": place} if place else {}) | (attributes or {})}
    count = 0
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density.on(site) if density else None, limit * 3):
        if count >= limit:
            break
        if not site.is_free(x, y, _STEM_M):
            continue
        turn = downhill_deg(site, x, y) if category == "fallen_log" else yaw
        count += site.try_place(category, x, y, turn, z=settled_z(site, x, y), **options) is not None


@site_builder
def undergrowth(
    site: Site, *, area: Area, kinds: list[Strewn], density: ScalarField | None = None, place: str = ""
) -> None:
    """Strew several things over an area, a kind after the other."""
    for kind in kinds:
        strew(site, area=area, density=density, place=place, **vars(kind))
