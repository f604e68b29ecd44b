"""What worlds ask of the catalogue: colours for things that have too few, and the ground that things take."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.placement import footprint

# What `scenes.colours.colour_name` calls these, and a test holds it, is the key or one of its shades.
PAINTS = {
    "red": ("#b8322a", "#a02824", "#c63d31"), "maroon": ("#6e2428", "#7c2a30"), "orange": ("#d9772b", "#e08a3c"),
    "yellow": ("#e9b52a", "#e3c04a"), "green": ("#3f7d4e", "#2f6f3f", "#56925a"), "olive": ("#6f7434", "#7a7d40"),
    "teal": ("#1f7f80", "#2d8a86"), "blue": ("#2f5f9e", "#3a6fb0", "#274f88"), "navy": ("#1f2f55", "#26375f"),
    "purple": ("#6a4a8a", "#7a579b"), "white": ("#f1f0ea", "#e9e8e2"), "silver": ("#b9bec4", "#aab0b6"),
    "grey": ("#7d8287", "#6e7378"), "black": ("#26282c", "#1d1f21"), "brown": ("#6b4a30", "#7a5638"),
    "beige": ("#d3c4a0", "#c9b791"), "cream": ("#e8dcc0", "#efe4cb"),
}  # fmt: skip
_ROLES = ("body", "paint", "shell", "hull", "frame", "cloth", "canvas")
_REPAINTED = 0.6


@cache
def paintable(catalogue: Catalogue, category: str) -> tuple[str, tuple[str, ...]]:
    """Role of a category's paint and the variants that differ in it alone; empty where there is none."""
    prop = catalogue[category]
    role = next((role for role in _ROLES if role in prop.roles), "")
    plain = tuple(
        v.name for v in prop.variants
        if set(v.attributes) == {"colour"} and v.attributes["colour"] in PAINTS and set(v.roles) <= {role}
        and not v.identifying_parts
    )  # fmt: skip
    return (role, plain) if role and len(plain) > 1 else ("", ())


def repainted(
    catalogue: Catalogue, what: str, pose: tuple[float, float, float], rng: np.random.Generator
) -> list[Any] | dict[str, Any]:
    """Write a thing at a pose (x, y, yaw) as plans do, with a drawn variant, and a colour of its own where it can."""
    category, _, variant = what.partition(":")
    x, y, yaw = pose
    role, plain = paintable(catalogue, category)
    if variant or not role or rng.random() > _REPAINTED:
        drawn = variant or catalogue[category].variants[int(rng.integers(len(catalogue[category].variants)))].name
        return [f"{category}:{drawn}" if drawn else category, x, y, yaw]
    colour = list(PAINTS)[int(rng.integers(len(PAINTS)))]
    shade = PAINTS[colour][int(rng.integers(len(PAINTS[colour])))]
    body = {"what": f"{category}:{plain[int(rng.integers(len(plain)))]}", "at": [x, y], "yaw_deg": yaw}
    return {**body, "roles": {role: shade}, "attributes": {"colour": colour}}


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
