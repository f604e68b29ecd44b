"""What grows where there is room."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field
from shapely import contains_xy

from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.placement import DRAWN, Placement
from aerialdojo_gen.scenes.plans.values import Area, Number
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
