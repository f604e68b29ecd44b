"""A viaduct under construction: a box girder on piers over a valley, a launching gantry, falsework, and yards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from shapely.geometry import LineString

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc, smooth_path
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.kit.structures import Parts, block, parapet, stairs
from aerialdojo_gen.scenes.layouts.urban.construction_site.concrete import scaffold
from aerialdojo_gen.scenes.layouts.urban.construction_site.earthworks import grid_terrain, roughened
from aerialdojo_gen.scenes.layouts.urban.construction_site.halls import across_x
from aerialdojo_gen.scenes.layouts.urban.construction_site.industry import Point3, bars, guard_rails, posts, trestle
from aerialdojo_gen.scenes.layouts.urban.construction_site.site_yard import (
    aggregate_bays,
    hoarding,
    offices,
    precast_stack,
)
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, rolling_terrain

DECK_M = 9.6
AXIS_M = 4.0
_HALF_M = 5.4
_DEEP_M = 2.2
_PIERS = (-44.0, -22.0, 0.0, 22.0, 44.0)
_PROFILE = (
    (-60, 4.4),
    (-48, 3.8),
    (-36, 1.6),
    (-20, -4.2),
    (-12, -5.0),
    (8, -5.0),
    (20, -2.4),
    (34, 0.8),
    (48, 3.2),
    (60, 4.0),
)
_PADS = (
    (rectangle(-57, 17, -39, 40), 3.0),
    (rectangle(-57, -40, -35, -15), 2.4),
    (rectangle(32, -40, 57, -13), 1.6),
    (rectangle(34, 17, 57, 40), 2.0),
)
_ROAD = [(-58, -9.5), (-38, -10), (-16, -20), (4, -20), (28, -8), (58, -7)]
_STREAM = smooth_path([(-9, -43), (-4, -26), (-7, -12), (-8, 4), (-3, 18), (-8, 30), (-6, 43)])


def build_viaduct(site: Site) -> None:
    """Build the site of 116 by 84 m."""
    _ground(site)
    _deck(site, -58.0, -10.0, "viaduct_deck")
    _deck(site, -5.5, 5.5, "pier_head")
    _piers(site)
    _falsework(site)
    _launching_gantry(site)
    _yards(site)


def plant(site: Site) -> None:
    """Let trees and bushes stand on the meadows, clear of everything that was set out."""
    meadow = rectangle(-56, -40, 56, 40).difference(rectangle(-60, -9, 60, 17)).difference(ribbon(_ROAD, 9.0))
    for pad, _ in _PADS:
        meadow = meadow.difference(pad.buffer(1.5))
    meadow = meadow.difference(ribbon(_STREAM, 9.0))
    rng = site.rng_for("meadow")
    for k, pose in enumerate(poisson_disc(meadow, 7.5, rng, limit=34)):
        category = ("birch_tree", "bush", "oak_tree", "bush", "sapling")[k % 5]
        if site.is_free(pose.x, pose.y, 2.6):
            site.try_place(category, pose.x, pose.y, pose.yaw_deg)


def _ground(site: Site) -> None:
    site.set_ground(_terrain(site), site.material("earth", "meadow:#86894f"))
    earth = site.material("dug", "dirt:#8f775a")
    site.paint(ribbon([(-58, 4), (58, 4)], 21.0), earth)
    haul = site.material("haul", "gravel:#a99c86")
    site.paint(ribbon(smooth_path(_ROAD), 5.6), haul)
    for pad, _ in _PADS:
        site.paint(pad.buffer(-0.6), site.material("yard", "gravel:#b5ac9a"))
    for path in ([(-46, -9.6), (-46, -16)], [(44, -7.5), (44, -14)], [(44, -7.5), (44, 18)], [(-50, -10), (-50, 18)]):
        site.paint(ribbon(path, 4.4), haul)
    site.paint(ribbon(_STREAM, 8.0), "mud:#7a6a50")
    site.paint(ribbon(_STREAM, 4.6), "water:#5f8f8a")
    for x in _PIERS:
        site.paint(rectangle(x - 3.4, AXIS_M - 4.6, x + 3.4, AXIS_M + 4.6), "concrete:#a8a398")


def _terrain(site: Site) -> Terrain:
    terrain = grid_terrain(site.recipe.size_m, 1.5)
    xs, zs = np.array(_PROFILE, dtype=np.float64).T
    rows, columns = terrain.heights_m.shape
    x = terrain.x0_m + np.arange(columns) * terrain.cell_m
    rough = rolling_terrain(site.recipe.size_m, 1.5, site.recipe.seed, 0.7, 34.0)
    terrain = replace(terrain, heights_m=np.tile(np.interp(x, xs, zs), (rows, 1)) + rough.heights_m[:rows, :columns])
    for pad, level in _PADS:
        terrain = terrain.flattened(pad, level, 3.5)
    for pier in _PIERS:
        terrain = terrain.flattened(rectangle(pier - 3, AXIS_M - 4.2, pier + 3, AXIS_M + 4.2), None, 2.0)
    terrain = terrain.graded(smooth_path(_ROAD), 5.4, 2.5, 14.0)
    terrain = roughened(terrain, rectangle(-20, -12, 20, -6), 0.05, site.rng_for("ruts"))
    return terrain.lowered(ribbon(_STREAM, 8.0), 1.1, 2.2)


def _girder(x0: float, x1: float) -> Parts:
    y, top = AXIS_M, DECK_M
    section = [
        (y - _HALF_M, top - 0.25),
        (y - _HALF_M, top),
        (y + _HALF_M, top),
        (y + _HALF_M, top - 0.25),
        (y + 3.0, top - 0.55),
        (y + 2.4, top - _DEEP_M),
        (y - 2.4, top - _DEEP_M),
        (y - 3.0, top - 0.55),
    ]
    return [("concrete:#bdb9ae", across_x(section, x0, x1))]


def _deck(site: Site, x0: float, x1: float, category: str) -> None:
    parts = _girder(x0, x1)
    plan = rectangle(x0, AXIS_M - _HALF_M, x1, AXIS_M + _HALF_M)
    joints = [
        block(x - 0.05, AXIS_M - _HALF_M - 0.03, x + 0.05, AXIS_M + _HALF_M + 0.03, DECK_M - 0.26, DECK_M + 0.01)
        for x in np.arange(x0 + 4.0, x1 - 1.0, 4.0)
    ]
    parts.append(("concrete:#8f8b82", merge(joints)))
    ends = [x1] if category == "viaduct_deck" else [x0, x1]
    if category == "viaduct_deck":
        ends_gap = [rectangle(x0 - 1, -60, x0 + 0.3, 60), rectangle(x1 - 14, -60, x1 + 1, 60)]
        parts.append(("concrete", parapet(plan, DECK_M, 0.9, ends_gap)))
        lines = LineString(
            [
                (x1 - 14, AXIS_M - _HALF_M + 0.15),
                (x1 - 0.2, AXIS_M - _HALF_M + 0.15),
                (x1 - 0.2, AXIS_M + _HALF_M - 0.15),
                (x1 - 14, AXIS_M + _HALF_M - 0.15),
            ]
        )
        parts += guard_rails(lines, DECK_M)
    else:
        parts += guard_rails(plan.buffer(-0.15, join_style="mitre").exterior, DECK_M)
    bristle = []
    for x in ends:
        out = 1.0 if x == x1 else -1.0
        bristle += [
            block(min(x, x + out), y - 0.03, max(x, x + out), y + 0.03, z, z + 0.06)
            for y in np.arange(AXIS_M - 5.0, AXIS_M + 5.1, 0.5)
            for z in (DECK_M - 0.2,)
        ]
        bristle += [
            block(min(x, x + out), y - 0.03, max(x, x + out), y + 0.03, z, z + 0.06)
            for y in (AXIS_M - 2.5, AXIS_M + 2.5)
            for z in np.arange(DECK_M - 2.0, DECK_M - 0.5, 0.35)
        ]
    parts.append(("rust", merge(bristle)))
    site.add(None, category, parts)


def _piers(site: Site) -> None:
    cap = DECK_M - _DEEP_M
    for x in _PIERS:
        foot = site.ground_z(x, AXIS_M) - 0.4
        whole = x < 40.0
        top = cap if whole else foot + 4.6
        parts: Parts = [("concrete", block(x - 2.6, AXIS_M - 3.8, x + 2.6, AXIS_M + 3.8, foot, foot + 0.9))]
        shaft = [
            (AXIS_M - 1.7, foot + 0.9),
            (AXIS_M + 1.7, foot + 0.9),
            (AXIS_M + 1.7, top - 1.6),
            (AXIS_M + 2.9, top - 0.3),
            (AXIS_M + 2.9, top),
            (AXIS_M - 2.9, top),
            (AXIS_M - 2.9, top - 0.3),
            (AXIS_M - 1.7, top - 1.6),
        ]
        if not whole:
            shaft = [(AXIS_M - 1.7, foot + 0.9), (AXIS_M + 1.7, foot + 0.9), (AXIS_M + 1.7, top), (AXIS_M - 1.7, top)]
            bars_at = [(x + i * 0.6, AXIS_M + j * 0.4) for i in (-1, 0, 1) for j in range(-3, 4)]
            parts.append(("rust", posts(bars_at, top, top + 2.2, 0.06)))
        parts.append(("concrete:#b6b2a8", across_x(shaft, x - 0.9, x + 0.9)))
        site.add(None, "bridge_pier", parts)
        site.occupy(rectangle(x - 2.7, AXIS_M - 3.9, x + 2.7, AXIS_M + 3.9), foot - 2.0, foot + 1.2)
        site.occupy(rectangle(x - 1.1, AXIS_M - 2.2, x + 1.1, AXIS_M + 2.2), foot, top)
    for x in (22.0, 44.0):
        z = site.ground_z(x, AXIS_M)
        up = cap - 0.4 if x < 40 else z + 6.0
        scaffold(
            site,
            (x - 2.8, AXIS_M + 4.2),
            (x + 2.8, AXIS_M + 4.2),
            up,
            z0=z - 0.1,
            net="fabric:#c9682c" if x < 40 else "",
        )
        scaffold(site, (x + 2.8, AXIS_M - 4.2), (x - 2.8, AXIS_M - 4.2), up, z0=z - 0.1)


def _falsework(site: Site) -> None:
    """Carry the formwork of the next span on steel trestles; one end of the span is boxed in already."""
    top = DECK_M - _DEEP_M + 0.1
    parts: Parts = []
    towers = []
    for x in (27.0, 33.0, 39.0):
        for y in (AXIS_M - 3.0, AXIS_M + 3.0):
            foot = site.ground_z(x, y) - 0.1
            towers.append(trestle(x, y, foot, top - 0.7, 0.8, 0.12))
            site.occupy(rectangle(x - 1, y - 1, x + 1, y + 1), foot - 0.5, top - 0.8)
    parts.append(("marking_yellow:#d9a32a", merge(towers)))
    parts.append(
        (
            "steel",
            merge(
                [
                    block(24.6, y - 0.2, 41.4, y + 0.2, top - 0.7, top - 0.3)
                    for y in (AXIS_M - 3.8, AXIS_M - 2.2, AXIS_M + 2.2, AXIS_M + 3.8)
                ]
            ),
        )
    )
    parts.append(("planks:#c8a468", block(24.6, AXIS_M - 6.2, 41.4, AXIS_M + 6.2, top - 0.3, top)))
    sides = [block(24.8, y - 0.06, 33.0, y + 0.06, top, top + 1.6) for y in (AXIS_M - 3.0, AXIS_M + 3.0)]
    parts.append(("planks:#d1a03c", merge(sides)))
    studs = [(x, y) for x in np.arange(25.4, 33.0, 1.2) for y in (AXIS_M - 2.5, AXIS_M + 2.5)]
    parts.append(("rust", posts([(float(x), y) for x, y in studs], top, top + 2.0, 0.06)))
    edge = rectangle(24.6, AXIS_M - 6.2, 41.4, AXIS_M + 6.2).buffer(-0.15, join_style="mitre").exterior
    parts += guard_rails(edge, top)
    site.add(None, "falsework", parts)
    site.occupy(rectangle(24.6, AXIS_M - 3.3, 33.2, AXIS_M + 3.3), top - 0.2, top + 2.0)
    z = site.ground_z(43.4, AXIS_M + 12.0)
    site.add(
        None, "flight_of_stairs", stairs((38.0, AXIS_M + 12.4), -90.0, 1.1, top - z, 6.1, z_m=z, tread="sheet_metal")
    )
    site.occupy(rectangle(37.2, AXIS_M + 6.2, 38.8, AXIS_M + 13.0), z - 2, top)


def _launching_gantry(site: Site) -> None:
    """Set the blue truss that lays the girder's segments: two lattice beams from the deck to the next pier."""
    low, high = DECK_M + 3.2, DECK_M + 5.6
    lines: list[tuple[Point3, Point3]] = []
    x0, x1, n = -37.0, 4.0, 14
    step = (x1 - x0) / n
    for y in (AXIS_M - 3.4, AXIS_M + 3.4):
        for z in (low, high):
            lines.append(((x0, y, z), (x1, y, z)))
        for k in range(n):
            a, b = x0 + k * step, x0 + (k + 1) * step
            lines.append(((a, y, low), (b, y, high)) if k % 2 else ((a, y, high), (b, y, low)))
            lines.append(((a, y, low), (a, y, high)))
    for k in range(0, n + 1, 2):
        x = x0 + k * step
        if abs(x + 16) > 4:
            lines.append(((x, AXIS_M - 3.4, high), (x, AXIS_M + 3.4, high)))
    legs = [(x, y) for x in (-35.0, -24.0, 2.0) for y in (AXIS_M - 3.4, AXIS_M + 3.4)]
    trolley = block(-17.6, AXIS_M - 3.8, -14.6, AXIS_M + 3.8, high + 0.1, high + 0.9)
    ropes = posts(
        [(x, y) for x in (-17.0, -15.2) for y in (AXIS_M - 1.5, AXIS_M + 1.5)], DECK_M + 3.0, high + 0.1, 0.06
    )
    parts: Parts = [
        ("paint:#3f6fa8", bars(lines, 0.26)),
        ("paint:#3f6fa8", posts(legs, DECK_M, low, 0.5)),
        ("hazard", trolley),
        ("iron", ropes),
        ("concrete:#c9c5ba", block(-17.6, AXIS_M - 2.6, -14.6, AXIS_M + 2.6, DECK_M + 1.6, DECK_M + 3.0)),
    ]
    site.add(None, "launching_gantry", parts)
    for x, y in legs:
        site.occupy(rectangle(x - 0.5, y - 0.5, x + 0.5, y + 0.5), DECK_M, low)
    site.occupy(rectangle(-17.6, AXIS_M - 2.6, -14.6, AXIS_M + 2.6), DECK_M + 1.5, high)


def _yards(site: Site) -> None:
    offices(site, Frame(-56.2, 29.0, 0.0), 5, 2, ["#e0ddd2", "#4f8a5c", "#e0ddd2"], 3.0)
    aggregate_bays(site, Frame(56.2, -33.0, 180.0), ["sand", "gravel"], 5.0, 5.0)
    for k, (x, y) in enumerate(((-53.0, -35.0), (-45.0, -35.0), (37.0, 22.0), (46.0, 34.0))):
        precast_stack(site, Frame(x, y, 90.0 * (k > 1)), 5, 6.0, "concrete:#c2beb4")
    for k in range(3):
        parts = [(m, b) for m, b in _girder(0.0, 2.6)]
        x, y, z = 36.5 + 5.0 * k, -36.0, 1.6 - DECK_M + _DEEP_M
        moved = [
            (m, type(b)(b.vertices + np.array([x, y - AXIS_M + 3.0, z]), b.faces, b.corner_uv)) for m, b in parts
        ]
        site.add(None, "girder_segment", moved, footprint=rectangle(x, y - 2.5, x + 2.6, y + 8.5))
    for path in (
        [(-57.6, -12.6), (-57.6, -41.6), (-18, -41.6)],
        [(14, -41.6), (57.6, -41.6), (57.6, -10.5)],
        [(57.6, -3.5), (57.6, 41.6), (24, 41.6)],
        [(-20, 41.6), (-57.6, 41.6), (-57.6, 12.0)],
    ):
        hoarding(site, path, (site.material("hoarding", "#c8842c"), "#e8e6df"), "")
    z = site.ground_z(-13, -20) + 0.15
    bridge: Parts = [("planks:#8a6d4a", block(-12.4, -22.7, 0.6, -17.3, z - 0.3, z))]
    for y in (-22.5, -17.5):
        bridge += guard_rails(LineString([(-12.2, y), (0.4, y)]), z, material="paint:#6f7f52", toe=None)
    bridge.append(
        ("steel", merge([block(-12.4, y - 0.2, 0.6, y + 0.2, z - 0.9, z - 0.3) for y in (-22.0, -20.0, -18.0)]))
    )
    site.add(None, "site_bridge", bridge)
