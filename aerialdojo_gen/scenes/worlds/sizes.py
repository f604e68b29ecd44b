"""How much ground the things of the catalogue take."""

from __future__ import annotations

from functools import cache

import numpy as np

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.footprints import footprint


@cache
def extents_m(catalogue: Catalogue, what: str) -> tuple[float, float]:
    """Largest extents on the ground of a category's variants, along their front's direction and across it, metres."""
    category, _, variant = what.partition(":")
    names = [variant] if variant else [one.name for one in catalogue[category].variants]
    sizes = []
    for name in names:
        thing = catalogue.instantiate(category, "size", generator(0, "sizes", category, name), variant=name or None)
        x0, y0, x1, y1 = footprint(thing, 0.0).bounds
        sizes.append((2 * max(-x0, x1), 2 * max(-y0, y1)))
    along, across = np.array(sizes).max(axis=0)
    return float(along), float(across)
