"""One way to place a thing: a `Placement`, and `place`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from shapely.affinity import rotate, translate
from shapely.geometry import MultiPoint
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.expressions import evaluate
from aerialdojo_gen.scenes.grammar_props import next_variant
from aerialdojo_gen.scenes.grammar_scatter import Pose, along, poisson_disc
from aerialdojo_gen.scenes.kit.natural_ground import keep_clear
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.plans.model import Pattern
from aerialdojo_gen.scenes.site import Site, disc

Fit = Literal["as_is", "skip", "must"]


@dataclass(frozen=True)
class Placement:
    """A prop of the catalogue, and where it goes."""

    category: str
    x: float  # Metres, world frame
    y: float
    yaw_deg: float = 0.0  # Direction of its front, counter-clockwise from +x
    variant: str | None = None  # The one used least so far where absent
    z: float | None = None  # Height of its foot; on the ground where absent
    place: str = ""  # Where it is, in words
    node: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)  # scale, params, roles, attributes


def place(
    site: Site, thing: Placement, fit: Fit = "as_is", clear_m: float = 0.0, margin_m: float = 0.0, room_m: float = 0.0
) -> Instance | None:
    """Place a thing; with ``fit="skip"`` None where it has no room, with ``"must"`` an `AssetError`."""
    options = dict(thing.options)
    attributes = {**options.pop("attributes", {}), **({"place": thing.place} if thing.place else {})}
    variant = thing.variant if thing.variant is not None else next_variant(site, thing.category)
    options |= {"z": thing.z, "variant": variant, "attributes": attributes or None}
    if thing.node:
        options["node"] = thing.node
    stand = site.place if fit == "as_is" else site.try_place
    instance = stand(thing.category, thing.x, thing.y, thing.yaw_deg, **options)
    if instance is None:
        if fit == "must":
            raise AssetError(f"no room for {thing.category} at ({thing.x:g}, {thing.y:g})")
        return None
    if clear_m:
        site.occupy(disc(thing.x, thing.y, clear_m))
    if margin_m:
        keep_clear(site, instance, margin_m)
    if room_m:
        low, high = instance.bounds[:, 2]
        room = outline_of(site, thing.category, variant, (thing.x, thing.y), thing.yaw_deg).buffer(
            room_m, quad_segs=2
        )
        site.occupy(room, float(low) - 1.0, float(high) + 6.0)
    return instance


def outline_of(
    site: Site, category: str, variant: str | None, at: tuple[float, float], yaw_deg: float
) -> BaseGeometry:
    """Outline of a thing on the ground, grown by 0.1 m, world frame."""
    trial = site.catalogue.instantiate(
        category, "outline", site.rng_for("outline", category, variant), variant=variant
    )
    shape = MultiPoint(trial.vertices[:, :2]).convex_hull.buffer(0.1, quad_segs=2)
    return translate(rotate(shape, yaw_deg, origin=(0, 0)), *at)


def prop_height(site: Site, category: str, variant: str | None, x: float, y: float) -> float:
    """Height of a thing that stands at z = 0, metres, in the variant that it would have."""
    look = variant if variant is not None else next_variant(site, category)
    return float(
        site.catalogue.instantiate(category, "trial", site.rng_for("trial"), (x, y, 0.0), 0.0, look).bounds[1, 2]
    )


def poses_of(site: Site, pattern: Pattern) -> Iterator[Pose]:
    """Yield the poses of a pattern."""
    if pattern.along is not None:
        yield from along(
            pattern.along, pattern.spacing_m, pattern.offset_m, pattern.start_m, pattern.end_m, pattern.turn_deg
        )
    elif pattern.grid is not None:
        for x in pattern.grid[0]:
            for y in pattern.grid[1]:
                yaw = pattern.yaw
                yield Pose(x, y, evaluate(yaw, {"x": x, "y": y}) if isinstance(yaw, str) else float(yaw))
    elif pattern.ring is not None:
        x, y, radius_m, count, start_deg = pattern.ring
        for k in range(count):
            a = math.radians(start_deg + 360.0 / count * k)
            yield Pose(x + radius_m * math.cos(a), y + radius_m * math.sin(a), math.degrees(a) + pattern.turn_deg)
    elif pattern.scatter is not None:
        stream = site.rng_for(*(pattern.stream or "scatter").split("/"))
        yield from poisson_disc(pattern.scatter, pattern.spacing_m, stream, limit=pattern.limit)
    else:
        yield from (Pose(*pose) for pose in pattern.poses)
