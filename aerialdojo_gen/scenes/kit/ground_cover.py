"""What covers natural ground: patches, shores, scree, strips beside a way."""

from __future__ import annotations

from typing import Annotated

import shapely
from pydantic import Field
from shapely.geometry import LineString

from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.plans.values import Area, Box, Line, Material, Number
from aerialdojo_gen.scenes.site import Site

_Radius = Annotated[Number, Field(ge=0.1)]


@site_builder
def paint_patches(
    site: Site, *, materials: Annotated[list[Material], Field(min_length=1)],
    count: Annotated[int, Field(ge=0, le=1000)], radius_m: tuple[_Radius, _Radius], seed: int = 0,
    ragged: Number = 0.55, stream: str = "patches", box: Box | None = None,
    skip: Annotated[int, Field(ge=0, le=1000)] = 0,
) -> None:  # fmt: skip
    """Paint patches about the site, or a box of it, of the materials in turn.

    `seed` is that of the first one's outline; `skip` leaves out patches that another entry of the stream has drawn.
    """
    rng = site.rng_for(stream)
    rng.uniform(size=3 * skip)
    x0, y0, x1, y1 = box or site.extent.bounds
    for k in range(count):
        x, y = float(rng.uniform(x0, x1)), float(rng.uniform(y0, y1))
        patch = blob(x, y, float(rng.uniform(*radius_m)), seed + k, ragged)
        site.paint(patch, materials[k % len(materials)])


@site_builder
def paint_shore(
    site: Site, *, water: Area, material: Material, count: Annotated[int, Field(ge=1, le=1000)] = 60,
    lobe_m: _Radius = 1.4, seed: int = 0, grow_m: Number = 0.6,
) -> None:  # fmt: skip
    """Paint the shore of waters with an uneven outline; the water itself is painted over it."""
    points = [water.boundary.interpolate(k / count, normalized=True) for k in range(count)]
    lobes = [blob(p.x, p.y, lobe_m, seed + k, 0.4) for k, p in enumerate(points)]
    site.paint(shapely.union_all([water.buffer(grow_m, quad_segs=3), *lobes]), material)


@site_builder
def paint_scree(site: Site, *, areas: list[Area], material: Material, seed: int = 0) -> None:
    """Paint what fell from rocks about their feet."""
    for area in areas:
        lobes = [blob(float(x), float(y), 1.5, seed + k, 0.4)
                 for k, (x, y) in enumerate(shapely.get_coordinates(area)[::3])]  # fmt: skip
        site.paint(shapely.union_all([area.buffer(1.1), *lobes]), material)


@site_builder
def strips_beside(
    site: Site, *, line: Line, offsets_m: list[Number], width_m: Annotated[Number, Field(gt=0)], material: Material
) -> None:
    """Paint strips beside a line, such as ruts or the marks of a groomer, left of it at positive offsets."""
    for offset_m in offsets_m:
        strip = LineString(line).offset_curve(offset_m)
        if not strip.is_empty:
            site.paint(strip.buffer(width_m / 2, cap_style="flat", quad_segs=2), material)
