"""Ground after a disaster: faults, craters, rubble slopes, cracks, and what is strewn or leans on it."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import Field
from shapely.affinity import scale
from shapely.geometry import LineString, Point

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.geometry.portable import atan2, norm, power
from aerialdojo_gen.scenes.grammar import Frame, noise_around, poisson_disc, slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import ground_builder, site_builder
from aerialdojo_gen.scenes.kit.wreckage import bars, chunk, tilted_plate
from aerialdojo_gen.scenes.mesh import Parts, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import Area, At, Line, Material, Number
from aerialdojo_gen.scenes.shapes import sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, smooth

Breadth = Annotated[Number, Field(ge=0.1)]


@ground_builder
def fault(_site: Site, terrain: Terrain, path: Line, drop_m: Number, width_m: Breadth = 1.6) -> Terrain:
    """Let the ground right of a path sink by `drop_m`; the scarp is `width_m` wide. The path crosses the site."""
    line = LineString(path)
    corners = terrain.corners()[:, :2]
    points = shapely.points(corners)
    distance = shapely.distance(line, points)
    at = shapely.line_locate_point(line, points)
    ahead = shapely.get_coordinates(shapely.line_interpolate_point(line, np.minimum(at + 0.1, line.length)))
    behind = shapely.get_coordinates(shapely.line_interpolate_point(line, np.maximum(at - 0.1, 0.0)))
    along, away = ahead - behind, corners - behind
    right = along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0] < 0.0
    t = np.clip(0.5 + np.where(right, distance, -distance) / width_m, 0.0, 1.0)
    return terrain.raised(-drop_m * t)


@ground_builder
def rises(
    _site: Site, terrain: Terrain, stations: list[tuple[Number, Number, Number]], axis: Literal["x", "y"]
) -> Terrain:
    """Let the ground rise along an axis between stations (from, to, rise), smoothly."""
    corners = terrain.corners()[:, "xy".index(axis)]
    rise = np.zeros(len(corners))
    for start, end, height in stations:
        rise += height * smooth((corners - start) / max(end - start, 0.1))
    return terrain.raised(rise)


@ground_builder
def crater(site: Site, terrain: Terrain, at: At, radius_m: Breadth, depth_m: Number, rim_m: Number) -> Terrain:
    """Blast a crater: a bowl of `radius_m` to its crest, thrown-up earth `rim_m` high that runs out at twice that."""
    corners = terrain.corners()[:, :2] - at
    wave = noise_around(site.head.seed, atan2(corners[:, 1], corners[:, 0]), 1.5)
    r = np.hypot(corners[:, 0], corners[:, 1]) / (radius_m * (1.0 + 0.14 * wave))
    bowl = -depth_m + (depth_m + rim_m) * power(np.clip(r, 0.0, 1.0), 2.2)
    slope = rim_m * np.clip(2.0 - r, 0.0, 1.0) ** 2
    return terrain.raised(np.where(r < 1.0, bowl, slope))


@ground_builder
def heap(_site: Site, terrain: Terrain, area: Area, height_m: Number, seed: int) -> Terrain:
    """Pile rubble over an area: steep at its border, lumpy on top."""
    corners = terrain.corners()[:, :2]
    inside = terrain.inside(area).ravel()
    reach = max(float(inside.max()), 0.1)
    noise = OpenSimplex(seed=seed)
    lumps = [noise.noise2(x / 2.3, y / 2.3) if d > 0 else 0.0 for (x, y), d in zip(corners, inside, strict=True)]
    t = power(np.clip(inside / reach, 0.0, 1.0), 0.8)
    return terrain.raised(height_m * t * (1.0 + 0.35 * np.array(lumps)))


@site_builder
def scarp(
    site: Site, *, path: Line, width_m: Breadth, material: Material,
    slips: Annotated[list[Area], Field(max_length=500)],
) -> None:  # fmt: skip
    """Paint the bare earth along a fault, and where more of it slipped."""
    bare = LineString(path).buffer(width_m / 2, quad_segs=2).union(shapely.union_all(slips))
    site.paint(bare.intersection(site.extent), material)


@site_builder
def cracks(site: Site, starts: list[tuple[Number, Number, Number]], length_m: Number, seed: int) -> None:
    """Paint jagged cracks that start at (x, y) and run along a direction in degrees, forking once."""
    rng = site.rng_for("cracks", seed)
    for x, y, yaw in starts:
        for turn, share in ((0.0, 1.0), (float(rng.uniform(25, 50)), 0.45)):
            points, at, heading = [(x, y)], np.array([x, y]), np.radians(yaw + turn)
            for _ in range(int(length_m * share / 0.9)):
                heading += float(rng.uniform(-0.5, 0.5))
                heading -= 0.25 * (heading - np.radians(yaw + turn))
                at = at + 0.9 * np.array([np.cos(heading), np.sin(heading)])
                points.append((float(at[0]), float(at[1])))
            if len(points) > 2:
                widths = np.linspace(0.22, 0.05, len(points))
                legs = [LineString(pair).buffer(float(width), cap_style="square", quad_segs=1)
                        for pair, width in zip(pairwise(points), widths[:-1], strict=True)]  # fmt: skip
                band = shapely.union_all(legs)
                site.paint(band.simplify(0.04).intersection(site.extent), "#2b2926")


@site_builder
def strew_chunks(
    site: Site, area: Area, spacing_m: Breadth, stream: str, *, plate: Material = "concrete",
    lump: Material = "rubble", brick: Material = "brick", beam: Material = "concrete",
    size_m: tuple[Number, Number] = (0.5, 1.9), limit: Annotated[int, Field(ge=1, le=2000)] = 400,
) -> Instance | None:  # fmt: skip
    """Strew loose pieces over free ground of an area; larger pieces take their ground."""
    rng = site.rng_for("chunks", stream)
    kinds = (("slab", plate, 0.34), ("lump", lump, 0.3), ("brick", brick, 0.24), ("beam", beam, 0.12))
    parts: Parts = []
    for pose in poisson_disc(area, spacing_m, rng, limit=limit):
        pick, t = rng.uniform(size=2)
        size = size_m[0] + (size_m[1] - size_m[0]) * float(t) ** 2
        if not site.is_free(pose.x, pose.y, 0.45 * size + 0.15):
            continue
        shares = np.cumsum([share for _, _, share in kinds])
        kind, material, _ = kinds[int(np.searchsorted(shares[:-1], pick, side="right"))]
        at = (pose.x, pose.y, site.ground_z(pose.x, pose.y))
        parts.append((material, translated(chunk(kind, size, rng), at)))
        if kind == "slab" and size > 1.3:
            for _ in range(3):
                yaw = float(rng.uniform(0, 360))
                parts.append(("rust", translated(bars((0.0, 0.0), 0.1, yaw, rng, 1.0 + size / 3), at)))
    return site.add(None, "rubble_field", parts) if parts else None


@site_builder
def strew_about_heaps(
    site: Site, *, heaps: list[Area], spacing_m: Breadth, margin_m: Number = 2.0, plate: Material = "concrete",
    lump: Material = "rubble", brick: Material = "brick", beam: Material = "concrete",
) -> None:  # fmt: skip
    """Strew loose pieces over heaps of rubble and `margin_m` about each."""
    for k, area in enumerate(heaps):
        around = area.buffer(margin_m)
        strew_chunks(site, around, spacing_m, f"heap{k}", plate=plate, lump=lump, brick=brick, beam=beam)


@site_builder
def slab_pile(
    site: Site, at: At, yaw_deg: Number, size_m: tuple[Number, Number], count: Annotated[int, Field(ge=1, le=40)],
    stream: str, *, base_m: Number | None = None, gap_m: Number = 0.75, floor: Material = "concrete",
    wall: Material = "plaster", tilt_deg: Number = 5.0, top: Material | None = None, node: str | None = None,
) -> float:  # fmt: skip
    """Pile up the floors of a pancaked building, crushed walls between them; the top one lies level.

    `at` is its middle, `yaw_deg` the direction of its length, `size_m` (length, width) of the lowest floor; it stands
    at `base_m`, or on the ground in the middle. Floors are about `gap_m` apart, and tilted by `tilt_deg` across at
    most; `top` is the material of the highest where it differs. Gives the height of the level top.
    """
    rng = site.rng_for("pile", stream)
    x, y = at
    base = site.ground_z(x, y) if base_m is None else base_m
    turn = np.radians(yaw_deg)
    parts: Parts = []
    z = base
    for k in range(count):
        z += gap_m * float(rng.uniform(0.8, 1.25))
        level = k == count - 1
        tilt = [0.0, 0.0] if level else (rng.uniform(-tilt_deg, tilt_deg, size=2) * (0.5, 0.25)).tolist()
        shift = rng.uniform(-0.7, 0.7, size=2) * (0.0 if level else 1.0)
        shrink = 1.0 - 0.035 * k
        middle = (x + float(shift[0]), y + float(shift[1]), z)
        size = (size_m[0] * shrink, size_m[1] * shrink)
        yaw = yaw_deg + float(rng.uniform(-4, 4))
        plate = tilted_plate(size, 0.26, middle, (tilt[0], tilt[1]), yaw, rng)
        parts.append(((top or floor) if level else floor, plate))
        for _ in range(int(sum(size_m) / 1.3)):
            # Crushed wall and columns look out between the floors all around.
            edge, s = int(rng.integers(4)), float(rng.uniform(-0.45, 0.45))
            u, v = ((s, -0.42), (0.44, s), (s, 0.42), (-0.44, s))[edge]
            u, v = u * size[0], v * size[1]
            px, py = x + u * np.cos(turn) - v * np.sin(turn), y + u * np.sin(turn) + v * np.cos(turn)
            body = chunk("slab" if rng.uniform() < 0.6 else "brick", float(rng.uniform(1.0, 2.2)), rng)
            material = (wall, floor, "rubble")[int(rng.integers(3))]
            parts.append((material, translated(body, (float(px), float(py), z - gap_m * 0.75))))
            out = math.degrees(math.atan2(py - y, px - x))
            if rng.uniform() < 0.5:
                parts.append(("rust", bars((float(px), float(py)), z - 0.13, out, rng, 1.3)))
    u, v = size_m[0] / 2, size_m[1] / 2
    plan = Frame(x, y, yaw_deg).area(rectangle(-u, -v, u, v))
    parts.append(("rubble", slab(scale(plan, 0.8, 0.72), base - 0.5, z - 0.4)))
    site.add(node, "collapsed_building", parts)
    # What lies on top of it is free to be stood on.
    site.occupy(plan, base - 100.0, z - 0.05)
    return z


@site_builder
def strew_things(
    site: Site, place: str, area: Area, categories: list[str], stream: str, clear_m: Number = 1.4
) -> list[Instance]:
    """Set things out where an area has room for them and for a drone around them, a spot each.

    Categories are set out in their order; what finds no room, with `clear_m` about it, is left out.
    """
    rng = site.rng_for("strew", stream)
    spots = poisson_disc(area, 1.1, rng, limit=2000)
    out: list[Instance] = []
    for category in categories:
        for pose in spots:
            if not site.is_free(pose.x, pose.y, 0.6 + clear_m):
                continue
            z = site.foot_z(pose.x, pose.y)
            thing = site.place(Placement(category, *pose, z=z, place=place), "skip")
            if thing is not None:
                room = rectangle(*thing.bounds[:, :2].ravel()).buffer(clear_m - 0.4, quad_segs=2)
                site.occupy(room, z - 0.5, z + 2.0)
                out.append(thing)
                break
    return out


@site_builder
def leaning_poles(site: Site, poles: list[tuple[Number, Number, Number, Number]], height_m: Number = 8.0) -> None:
    """Put up a line of poles that lean by degrees towards a direction (x, y, lean, yaw), with slack wires between.

    They are structure: nobody can distinguish poles that stand askew.
    """
    wood: Parts = []
    heads: list[tuple[np.ndarray, np.ndarray]] = []
    for x, y, lean, yaw in poles:
        foot = np.array([x, y, site.ground_z(x, y) - 0.4])
        tilt, turn = np.radians(lean), np.radians(yaw)
        axis = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        head = foot + axis * height_m
        wood.append(("wood", sweep(path=[tuple(foot), tuple(head)], radius=0.14, sides=6)))
        heads.append((head, axis))
        site.occupy(Point(x, y).buffer(0.4))
    for k, (head, axis) in enumerate(heads):
        other = heads[min(k + 1, len(heads) - 1)][0] - heads[max(k - 1, 0)][0]
        arm = np.cross(other / max(float(norm(other)), 1e-6), axis)
        arm /= max(float(norm(arm)), 1e-6)
        ends = [tuple(head - 0.35 * axis + s * 0.9 * arm) for s in (-1, 1)]
        wood.append(("wood", sweep(path=ends, section=(0.1, 0.12))))
        if k + 1 < len(heads):
            for s in (-0.8, 0.0, 0.8):
                a, b = head - 0.3 * axis + s * arm, heads[k + 1][0] - 0.3 * heads[k + 1][1] + s * arm
                middle = (a + b) / 2 - (0.0, 0.0, 1.1 + 0.3 * s)
                wood.append(("iron", sweep(path=[tuple(a), tuple(middle), tuple(b)], radius=0.02, sides=3)))
    site.add(None, "power_line", wood)
