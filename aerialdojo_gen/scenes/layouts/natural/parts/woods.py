"""Woods: trees by habitat and neighbourhood, and what grows and lies under them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.kit.natural_ground import downhill_deg, settled_z
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.site import Site

Field = Callable[[float, float], float]

# Where not even a stem has room, nothing need be grown to find that out.
_STEM_M = 0.3


@dataclass(frozen=True)
class Species:
    """A tree and where it likes to stand.

    Attributes
    ----------
    category : str
        Of the catalogue.
    habitat : callable
        ``(x, y) -> float``: how well the place suits it, 0 or more.
    crowding : float
        Share of the density at which it stands: below 1 for broad crowns.
    variant : str or None
        None draws one for every tree.
    """

    category: str
    habitat: Field
    crowding: float = 1.0
    variant: str | None = None


def patches(seed: int, wavelength_m: float, sharpness: float = 2.5) -> Field:
    """Make a field of patches, about 1 on average, that rises to exp(sharpness) where a species has taken over."""
    noise = OpenSimplex(seed=seed)

    def value(x: float, y: float) -> float:
        return float(np.exp(sharpness * noise.noise2(x / wavelength_m, y / wavelength_m)))

    return value


def near(area: BaseGeometry, reach_m: float) -> Field:
    """Make a field that is 1 on an area and falls to 0 at `reach_m` from it."""
    shapely.prepare(area)

    def value(x: float, y: float) -> float:
        return max(0.0, 1.0 - float(shapely.distance(area, shapely.Point(x, y))) / reach_m)

    return value


def plant(
    site: Site,
    area: BaseGeometry,
    spacing_m: float,
    density: Field,
    species: Sequence[Species],
    words: Mapping[str, str],
) -> list[Instance]:
    """Grow trees over an area.

    Parameters
    ----------
    site : Site
        Gets the trees where their footprints are free.
    area : shapely geometry
        World frame, metres.
    spacing_m : float
        Least distance of trees where the density is 1, metres.
    density : callable
        ``(x, y) -> float`` in 0 to 1.
    species : sequence of Species
        One is drawn at every place by habitat.
    words : mapping of str to str
        Attributes of every tree.
    """
    rng = site.rng_for("woods", species[0].category, spacing_m)
    out = []
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density):
        if not site.is_free(x, y, _STEM_M):
            continue
        suits = np.array([s.habitat(x, y) for s in species])
        pick = species[int(rng.choice(len(species), p=suits / suits.sum()))]
        if rng.random() > pick.crowding:
            continue
        z = settled_z(site, x, y, 0.3)
        tree = site.try_place(pick.category, x, y, yaw, z=z, variant=pick.variant, attributes=words)
        if tree is not None:
            out.append(tree)
    return out


def strew(
    site: Site,
    category: str,
    area: BaseGeometry,
    spacing_m: float,
    density: Field,
    limit: int,
    **options: object,
) -> list[Instance]:
    """Strew undergrowth or stones over an area, where there is room; things that lie are turned along the slope."""
    rng = site.rng_for("strew", category)
    out: list[Instance] = []
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density, limit * 3):
        if len(out) >= limit:
            break
        if not site.is_free(x, y, _STEM_M):
            continue
        turn = downhill_deg(site, x, y) if category == "fallen_log" else yaw
        thing = site.try_place(category, x, y, turn, z=settled_z(site, x, y), **options)
        if thing is not None:
            out.append(thing)
    return out
