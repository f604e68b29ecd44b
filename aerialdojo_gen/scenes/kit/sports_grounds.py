"""Grounds for sports: pitches and running tracks with their marks."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field
from shapely import contains_xy
from shapely.geometry import LineString, Polygon
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import disc, polygons_of, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Parts, columns
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.plans.values import Area, At, Line, Material, Number
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site


@site_builder
def football_pitch(
    site: Site, *, at: At, half_m: tuple[Number, Number], turf: Material, light: Material,
    stripes: Annotated[int, Field(ge=1, le=60)] = 12, border_m: Number = 1.2,
    penalty_m: tuple[Number, Number] = (7.0, 8.0),
    goal_m: tuple[Number, Number] = (2.6, 4.2), circle_m: Number = 5.0, mark: Material = "marking",
) -> None:  # fmt: skip
    """Paint a football pitch along x about `at`: mown stripes, and marks; its areas are (depth, half width)."""
    (cx, cy), (x, y) = at, half_m
    site.paint(rectangle(cx - x - border_m, cy - y - border_m, cx + x + border_m, cy + y + border_m), turf)
    wide = 2 * x / stripes
    for k in range(0, stripes, 2):
        site.paint(rectangle(cx - x + wide * k, cy - y, cx - x + wide * (k + 1), cy + y), light)
    lines = [rectangle(cx - x, cy - y, cx + x, cy + y).exterior, disc(cx, cy, circle_m, 32).exterior]
    for depth, half in (penalty_m, goal_m):
        lines += [rectangle(cx + s * x, cy - half, cx + s * (x - depth), cy + half).exterior for s in (-1, 1)]
    marks = [line.buffer(0.07, cap_style="flat", join_style="mitre") for line in lines]
    spots = [disc(u, cy, 0.2, 10) for u in (cx - x + 5.0, cx, cx + x - 5.0)]
    for area in polygons_of(unary_union([*marks, *spots, rectangle(cx - 0.07, cy - y, cx + 0.07, cy + y)])):
        site.paint(area, mark)


@site_builder
def running_track(
    site: Site, *, line: Line, inner_m: Number, lanes: Annotated[int, Field(ge=1, le=12)], lane_m: Number,
    track: Material, apron: Material, turf: Material, apron_m: Number = 1.6, mark: Material = "marking",
) -> None:  # fmt: skip
    """Paint a running track about a line, with an apron around it and turf within; `inner_m` is its inner radius."""
    outer_m = inner_m + lanes * lane_m
    site.paint(_about(line, outer_m + apron_m), apron)
    site.paint(_about(line, outer_m), track)
    for k in range(1, lanes):
        site.paint(_about(line, inner_m + k * lane_m).exterior.buffer(0.05), mark)
    site.paint(_about(line, inner_m + 0.12), mark)
    site.paint(_about(line, inner_m), turf)


@site_builder
def track_railing(
    site: Site, *, line: Line, away_m: Number, within: Area, bars: list[tuple[Number, Number]], post_m: Number = 1.0,
    node: str | None = None, material: Material = "#f1f0ea",
) -> None:  # fmt: skip
    """Put up a railing about a line: bars between two heights each, and posts."""
    ring = _about(line, away_m + 0.06).difference(_about(line, away_m - 0.06))
    pieces = polygons_of(ring.intersection(within))
    posts = [(x, y) for x, y in _about(line, away_m).exterior.simplify(0.05).coords if contains_xy(within, x, y)]
    parts: Parts = [(material, merge([slab(piece, *z) for z in bars for piece in pieces]))]
    site.add(node, "track_railing", [*parts, (material, columns(posts, 0.0, post_m, 0.06, 6))])


@site_builder
def bank_kerbs(
    site: Site, *, line: Line, away_m: list[Number], within: Area, gaps_y: list[Number], gap_m: Number = 3.2,
    section: tuple[Number, Number] = (0.3, 0.7), node: str | None = None, material: Material = "planks",
) -> None:  # fmt: skip
    """Set low walls into a bank about a line, at distances from it, open about some y."""
    kerbs = []
    for away in away_m:
        ring = _about(line, away).exterior.intersection(within)
        for leg in getattr(ring, "geoms", [ring]):
            runs: list[list[tuple[float, float, float]]] = [[]]
            for p in (leg.interpolate(s) for s in np.arange(0.0, leg.length, 2.0)):
                if any(abs(p.y - y) < gap_m / 2 for y in gaps_y):
                    runs.append([])
                else:
                    runs[-1].append((p.x, p.y, site.ground_z(p.x, p.y) + 0.15))
            kerbs += [sweep(path=run, section=section) for run in runs if len(run) > 1]
    site.add(node, "bank_steps", [(material, merge(kerbs))])


def _about(line: Line, radius_m: float) -> Polygon:
    if radius_m <= 0.0:
        raise ValueError(f"the distance from a line must be above 0, got {radius_m:g}")
    return LineString(line).buffer(radius_m, quad_segs=12)
