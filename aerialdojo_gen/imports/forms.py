"""What a thing of a foreign mesh looks like: its colour, its form, and its size beside its like."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.annotations.vocabulary import SHADES, UNKNOWN
from aerialdojo_gen.imports.naming import word_list
from aerialdojo_gen.imports.raw import RawNode
from aerialdojo_gen.scenes.colours import colour_words, shown_colours
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Material, Part

_NOTABLY, _LARGER = 1.4, 1.5


def is_unnamed(node: str, category: str) -> bool:
    """Whether nothing but the form of a thing is known."""
    return category in word_list("forms") and node.startswith(f"{UNKNOWN}_")


def form_of(vertices: NDArray[np.float64]) -> str:
    """Name the form of a thing: one of the list `forms`."""
    from scipy.spatial import ConvexHull, QhullError  # half a second, and `annotate` asks for no form

    low, height = float(vertices[:, 2].min()), float(np.ptp(vertices[:, 2]))
    outline = _outline(vertices)
    try:
        full = float(ConvexHull(vertices).volume) / (outline.area * height)
    except (QhullError, ValueError, ZeroDivisionError):
        return UNKNOWN
    rectangle = shapely.minimum_rotated_rectangle(outline)
    short, long = sorted(math.dist(rectangle.exterior.coords[k], rectangle.exterior.coords[k + 1]) for k in (0, 1))
    rise = (vertices[:, 2] - low) / height
    roof, foot = (_outline(vertices[rows]).area / outline.area for rows in (rise > 0.9, rise < 0.1))
    # A disc fills 0.785 of the square around it, an octagon 0.828; a cone a third of its cylinder, a ball two thirds.
    corners = outline.area / rectangle.area
    # The walls of scans lean outwards.
    upright, rounded = full > 0.8 or (roof > 0.22 and foot > 0.5), corners < 0.85 and long < 1.15 * short
    if upright and height >= 2.5 * long:
        tall, thin = ("tower" if height >= 6.0 and long > 1.5 else "pillar"), ("pole" if height >= 2.5 else "post")
        return tall if long > 0.6 else thin
    if upright and corners > 0.8 and long >= 4.0 * short and short <= 2.0 and height >= max(0.8, 0.7 * short):
        return "wall"
    if rounded and upright and height > 0.3 * long:
        return "drum" if long <= 1.5 else "cylinder"
    if 0.4 < full < 0.8 and roof < 0.22 and corners < 0.93 and foot > 0.6 and height <= 1.3 * long:
        return "mound"
    if full > 0.55 and corners > 0.9 and foot > 0.8 and short >= 4.0 and height >= 3.0:
        return "building"
    if upright and corners > 0.9 and height > 0.2 * short:
        return "box" if max(long, height) <= 5.5 else "block"
    return "ball" if rounded and 0.55 < full < 0.75 and foot < 0.5 and height < 1.2 * long else UNKNOWN


def grown(form: str, colour: str, height_m: float) -> str:
    """Name the form of a thing that is green: mostly a plant."""
    if "green" not in colour.split():
        return form
    rounded = "tree" if height_m >= 2.5 else "bush"
    return {"wall": "hedge", "mound": rounded, "ball": rounded}.get(form, form)


def _outline(vertices: NDArray[np.float64]) -> BaseGeometry:
    return shapely.convex_hull(shapely.multipoints(vertices[:, :2]))


def size_words(sizes_m: Sequence[NDArray[np.float64]]) -> list[str]:
    """Say of each of several like things, by its extents in metres, how it differs in size; mostly nothing."""
    extents = np.array(sizes_m)
    middle = np.median(extents, axis=0) if len(extents) > 1 else extents[0]
    whole = np.linalg.norm(extents, axis=1) / max(float(np.linalg.norm(middle)), 1e-9)
    height = extents[:, 2] / max(float(middle[2]), 1e-9)
    differs = [height > _NOTABLY, height < 1 / _NOTABLY, whole > _LARGER, whole < 1 / _LARGER]
    return [str(word) for word in np.select(differs, ["tall", "low", "large", "small"], "")]


def colour_of(parts: Sequence[Part], materials: Mapping[str, Material], said: str) -> str:
    """Name a thing's colour: as its file says, where its surface has that colour, else as it is measured."""
    measured = colour_words(*shown_colours(parts, materials))
    return said if SHADES.get(said, frozenset()) & set(measured.split()) else measured


def material_shares(body: RawNode) -> dict[str, float]:
    """Share of a body's surface by the names of its materials in the file, largest first."""
    if body.surface is None or not body.surfaces:
        return {}
    size = areas(body.vertices, body.faces.astype(np.int32))
    whole = max(float(size.sum()), 1e-12)
    shares: dict[str, float] = {}
    for k in np.unique(body.surface[body.surface >= 0]):
        name = body.surfaces[k].name
        shares[name] = shares.get(name, 0.0) + float(size[body.surface == k].sum()) / whole
    return dict(sorted(shares.items(), key=lambda item: (-item[1], item[0])))
