"""What grows where there is room: woods by habitat and neighbourhood, and what grows and lies under them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field
from shapely import contains_xy
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar import poisson_disc
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.natural_ground import downhill_deg
from aerialdojo_gen.scenes.mesh import Mesh, merge, translated
from aerialdojo_gen.scenes.placement import DRAWN, Placement
from aerialdojo_gen.scenes.plans.fields import ScalarField
from aerialdojo_gen.scenes.plans.values import Area, Material, Number
from aerialdojo_gen.scenes.shapes import crown, cylinder
from aerialdojo_gen.scenes.site import Site


@dataclass(frozen=True)
class Zone:
    """What grows in an area, category after category; anywhere where it has none."""

    of: list[str]
    area: Area | None = None
    steepest_m: Number = 100.0  # Greatest rise of the ground over 2 m


@site_builder
def keep_free(site: Site, *, areas: list[Area], z: tuple[Number, Number] = (-100.0, 1000.0)) -> None:
    """Take areas, between two heights, so that nothing that looks for room stands there later."""
    for area in areas:
        site.occupy(area, *z)


@site_builder
def strew_trees(
    site: Site, *, area: Area, of: Annotated[list[str], Field(min_length=1)],
    spacing_m: Annotated[Number, Field(ge=0.5)],
    stream: str = "trees", limit: Annotated[int, Field(ge=1, le=10_000)] = 10_000,
) -> None:  # fmt: skip
    """Strew trees over an area, of categories in turn; a spot without room stays empty."""
    for k, spot in enumerate(poisson_disc(area, spacing_m, site.rng_for(stream), limit=limit)):
        site.place(Placement(of[k % len(of)], *spot, DRAWN), "skip")


@site_builder
def growth(
    site: Site, *, area: Area, zones: list[Zone], spacing_m: Number, room_m: Number, limit: int,
    settle_m: Number = 0.5, stream: str = "growth", by_pose: bool = False,
) -> None:  # fmt: skip
    """Strew plants over an area where there is room about them; each is of the first zone that it lies in.

    The limit and the categories of a zone count those that stand; `by_pose`, those without room too.
    """
    count = 0
    for k, pose in enumerate(poisson_disc(area, spacing_m, site.rng_for(stream))):
        x, y, _ = pose
        count = k if by_pose else count
        zone = next((one for one in zones if one.area is None or contains_xy(one.area, x, y)), None)
        if count >= limit or zone is None:
            continue
        z = site.foot_z(x, y, settle_m)
        steep = abs(site.ground_z(x + 1.0, y) - site.ground_z(x - 1.0, y))
        if steep <= zone.steepest_m and site.is_free(x, y, room_m, z=z):
            plant = Placement(zone.of[count % len(zone.of)], *pose, DRAWN, z)
            count += site.place(plant, "skip") is not None


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
    site: Site, *, area: Area, spacing_m: Annotated[Number, Field(ge=0.5)],
    species: Annotated[list[Species], Field(min_length=1)], density: ScalarField | None = None, place: str = "",
) -> None:  # fmt: skip
    """Grow trees over an area where there is room, of a species drawn by habitat at every place.

    They stand `spacing_m` apart where the density is 1, and further where it is less.
    """
    named = [one.of.partition(":") for one in species]
    habitats = [one.habitat(site) for one in species]
    rng = site.rng_for("woods", named[0][0], spacing_m)
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density(site) if density else None):
        if not site.is_free(x, y, _STEM_M):
            continue
        suits = np.array([habitat(x, y) for habitat in habitats])
        pick = int(rng.choice(len(species), p=suits / suits.sum()))
        if rng.random() > species[pick].share:
            continue
        category, _, variant = named[pick]
        site.place(Placement(category, x, y, yaw, variant or DRAWN, place=place, settle_m=0.3), "skip")


@site_builder
def strew(
    site: Site, *, of: str, area: Area, spacing_m: Annotated[Number, Field(ge=0.2)],
    limit: Annotated[int, Field(ge=0, le=10_000)], density: ScalarField | None = None, place: str = "",
    scale: Annotated[Number, Field(ge=0.05, le=20)] = 1.0, roles: dict[str, Material] | None = None,
    params: dict[str, Number] | None = None, attributes: dict[str, str] | None = None, solid: bool = True,
) -> None:  # fmt: skip
    """Strew undergrowth or stones over an area, where there is room; things that lie are turned along the slope."""
    category, _, variant = of.partition(":")
    rng = site.rng_for("strew", category)
    words = ({"place": place} if place else {}) | (attributes or {})
    count = 0
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density(site) if density else None, limit * 3):
        if count >= limit:
            break
        if not site.is_free(x, y, _STEM_M):
            continue
        turn = downhill_deg(site, x, y) if category == "fallen_log" else yaw
        thing = Placement(
            category, x, y, turn, variant or DRAWN, scale=scale, roles=roles, params=params, attributes=words,
            solid=solid, settle_m=0.5,
        )  # fmt: skip
        count += site.place(thing, "skip") is not None


@site_builder
def undergrowth(
    site: Site, *, area: Area, kinds: list[Strewn], density: ScalarField | None = None, place: str = ""
) -> None:
    """Strew several things over an area, a kind after the other."""
    for kind in kinds:
        strew(site, area=area, density=density, place=place, **vars(kind))


@site_builder
def broadleaves(
    site: Site, *, area: Area, spacing_m: Annotated[Number, Field(ge=0.5)],
    limit: Annotated[int, Field(ge=1, le=2000)], height_m: tuple[Number, Number],
    density: ScalarField | None = None, leaves: Material = "foliage:#4a7a32",
) -> None:  # fmt: skip
    """Grow round-crowned trees where there is room, as one structure: background that nothing refers to."""
    rng = site.rng_for("broadleaves", round(area.area, 2))
    stems: list[Mesh] = []
    crowns: list[Mesh] = []
    plans: list[BaseGeometry] = []
    for x, y, yaw in poisson_disc(area, spacing_m, rng, density(site) if density else None, 3 * limit):
        high = float(rng.uniform(*height_m))
        if len(stems) >= limit or not site.is_free(x, y, 0.18 * high):
            continue
        z, reach = site.ground_z(x, y), 0.3 * high
        stem = cylinder(radius=0.035 * high, radius_top=0.02 * high, height=0.62 * high + 0.4, segments=7)
        stems.append(translated(stem, (x, y, z - 0.4)))
        for k, (out, share, up) in enumerate(((0.0, 1.0, 0.72), (0.75, 0.7, 0.6), (0.75, 0.6, 0.66))):
            turn = np.radians(yaw + 170.0 * k)
            at = (x + out * reach * float(np.cos(turn)), y + out * reach * float(np.sin(turn)), z + up * high)
            size = [share * reach, share * reach, share * reach * 0.8]
            body = crown(radii=size, noise=0.25, subdivisions=1, seed=int(rng.integers(1, 40)))
            crowns.append(translated(body, at))
        plans.append(shapely.Point(x, y).buffer(0.5, quad_segs=2))
    if stems:
        parts = [("bark", merge(stems)), (leaves, merge(crowns))]
        site.add(None, "broadleaf_trees", parts, footprint=shapely.union_all(plans))
