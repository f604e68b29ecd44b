"""Fences, hedges, railings and garden walls, and the retaining walls of terraces."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from shapely.geometry import LineString
from shapely.ops import unary_union

from aerialdojo_gen.scenes import ground
from aerialdojo_gen.scenes.grammar import Frame, Polyline, along, box_between, leg, slab, stretches, wall
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import block, railing
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.placement import DRAWN, Placement
from aerialdojo_gen.scenes.plans.values import Area, Areas, At, Bodies, Line, Material, Number, Positive
from aerialdojo_gen.scenes.shapes import box, cylinder, sweep
from aerialdojo_gen.scenes.site import Site


@site_builder
def rail_fence(
    site: Site, *, ends: tuple[At, At], posts: int, category: str = "rail_fence", material: Material = "wood"
) -> None:
    """Put up a straight fence of posts and two rails that follows the ground."""
    (x0, y0), (x1, y1) = ends
    path = [(float(x), float(y), site.ground_z(float(x), float(y)))
            for x, y in zip(np.linspace(x0, x1, posts), np.linspace(y0, y1, posts), strict=True)]  # fmt: skip
    bodies = [block(x - 0.06, y - 0.06, x + 0.06, y + 0.06, z - 0.4, z + 1.1) for x, y, z in path]
    bodies += [sweep(path=[(x, y, z + h) for x, y, z in path], section=(0.06, 0.1)) for h in (0.5, 1.0)]
    site.add(None, category, [(material, merge(bodies))])


@site_builder
def railings(
    site: Site, *, runs: list[tuple[At, At]], node: str | None = None, category: str = "railing",
    frame: Material = "iron", pane: Material | None = "glass",
) -> None:  # fmt: skip
    """Put up straight level railings, each at the height of the ground at its lower end, as one structure."""
    parts: Parts = []
    for a, b in runs:
        parts += railing([a, b], min(site.ground_z(*a), site.ground_z(*b)), pane=pane, frame=frame)
    site.add(node, category, parts)


@site_builder
def mesh_fences(
    site: Site, *, lines: list[Line], on: Number = 0.0, height_m: Number = 2.2, material: Material = "chain_link",
    category: str = "mesh_fence",
) -> None:  # fmt: skip
    """Put up fences of wire mesh along lines, on a floor at the height `on`."""
    for line in lines:
        path = [(x, y, on + height_m / 2) for x, y in line]
        site.add(None, category, [(material, sweep(path=path, section=(0.06, height_m)))])


@site_builder
def garden_fences(
    site: Site, *, lines: list[Line], kind: Literal["picket", "board", "hedge", "wall", "railing"],
    material: Material | None = None, piece_m: Annotated[Number, Field(ge=1.0)] | None = None,
) -> None:  # fmt: skip
    """Put up fences about gardens, each on the lowest ground of its line; the kind has a material of its own.

    Where the ground is not level they may be cut into pieces of `piece_m` at least, each on its own ground.
    """
    for line in lines:
        for piece in [line] if piece_m is None else _pieces(line, piece_m):
            fence(site, piece, kind, material)


def _pieces(line: Line, piece_m: float) -> Iterator[Line]:
    for a, b in pairwise(line):
        count = max(int(leg(a, b)[0] / piece_m), 1)
        steps = np.linspace(0.0, 1.0, count + 1)
        yield from (
            list(pair) for pair in pairwise([(a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t) for t in steps])
        )


@site_builder
def bar_fences(site: Site, *, lines: list[Line], height_m: Number = 1.1, material: Material = "iron") -> None:
    """Put up fences of three bars between posts along lines, on the ground at their points."""
    for line in lines:
        parts = [(material, wall(site, line, 0.06, 0.04, z=height_m * share)) for share in (0.2, 0.55, 0.92)]
        middle = LineString(line)
        count = max(round(middle.length / 2.0), 1)
        for at in (middle.interpolate(middle.length * k / count) for k in range(count + 1)):
            post = box(size=(0.06, 0.06, height_m))
            parts.append((material, translated(post, (at.x, at.y, site.ground_z(at.x, at.y)))))
        site.add(None, "railing", parts, footprint=middle.buffer(0.1))


@site_builder
def round_hedge(site: Site, *, disc: tuple[Number, Number, Number], opening: Area) -> None:
    """Plant a hedge around a disc ``[x, y, radius]``, with an opening."""
    left = ground.disc(*disc, 12).exterior.difference(opening)
    for run in getattr(left, "geoms", [left]):
        fence(site, [(float(x), float(y)) for x, y in run.coords], "hedge")


@site_builder
def walls(
    site: Site, *, lines: list[Line], height_m: Positive, material: Material,
    thickness_m: Positive = 0.3, category: str = "wall",
) -> None:  # fmt: skip
    """Put up plain walls along lines, on the ground at their points, each as a structure of its own."""
    for line in lines:
        body = wall(site, line, height_m, thickness_m)
        site.add(None, category, [(material, body)], footprint=LineString(line).buffer(thickness_m / 2 + 0.05))


@site_builder
def yard_walls(
    site: Site, *, boxes: Areas, height_m: Number, wall: Material, coping: Material = "concrete",
    coping_m: Number = 0.15, on: Number = 0.0, node: str | None = None, attributes: dict[str, str] | None = None,
    more: Bodies | None = None,
) -> None:  # fmt: skip
    """Put up walls with a coping on the floor `on` as one structure; `more` belongs to it, such as pillars."""
    top = on + height_m
    parts: Parts = [(wall, slab(box, on, top)) for box in boxes]
    parts += [(coping, slab(box.buffer(0.08, join_style="mitre"), top, top + coping_m)) for box in boxes]
    site.add(node, "wall", parts + (more or []), attributes, footprint=unary_union(boxes))


@site_builder
def fence_panels(
    site: Site, *, of: str, lines: list[Line], panel_m: Annotated[Number, Field(ge=0.2)], turn_deg: Number = 90.0,
    place: str = "", margin_m: Number = 0.0,
) -> None:  # fmt: skip
    """Set a panel of the catalogue in the middle of every stretch of lines, turned with them."""
    category, _, variant = of.partition(":")
    for line in lines:
        for x, y, yaw_deg in stretches(line, panel_m):
            turned = yaw_deg + turn_deg
            site.place(Placement(category, x, y, turned, variant or DRAWN, place=place, margin_m=margin_m))


@site_builder
def palings(
    site: Site, *, lines: list[Line], height_m: Number = 1.1, material: Material = "wood:#b39d7c",
    category: str = "sand_fence",
) -> None:  # fmt: skip
    """Put up palings over uneven ground, as dunes have them: slender pales, two wires, and posts."""
    for line in lines:
        pales = []
        for x, y, yaw in along(line, 0.32):
            pale = rotated(box(size=(0.05, 0.09, height_m)), rotation(0.0, 0.0, yaw + 90.0))
            pales.append(translated(pale, (x, y, site.ground_z(x, y) - 0.1)))
        poses = along(line, 1.6)
        wires = [sweep(path=[(p.x, p.y, site.ground_z(p.x, p.y) + h) for p in poses], radius=0.02, sides=3)
                 for h in (0.25, 0.8)]  # fmt: skip
        posts = [
            translated(cylinder(radius=0.06, height=height_m + 0.4, segments=6),
                       (p.x, p.y, site.ground_z(p.x, p.y) - 0.3))
            for p in poses[::2]
        ]  # fmt: skip
        area = LineString(line).buffer(0.2, cap_style="flat")
        site.add(None, category, [(material, merge([*pales, *wires, *posts]))], footprint=area)


@site_builder
def field_walls(
    site: Site, *, lines: list[Line], height_m: Number = 1.1, material: Material = "blocks:#938c80"
) -> None:
    """Put up dry stone walls over uneven ground."""
    for line in lines:
        path = [(p.x, p.y, site.ground_z(p.x, p.y) + height_m / 2 - 0.25) for p in along(line, 2.0)]
        body = sweep(path=path, section=(0.55, height_m + 0.5))
        area = LineString(line).buffer(0.35, cap_style="flat")
        site.add(None, "stone_wall", [(material, body)], footprint=area)


@site_builder
def terrace_walls(
    site: Site, *, steps: list[tuple[Number, Number, Number]], half_m: Number, stair_m: Number, stone: Material,
    tread: Material, hedge: Material, treads: Annotated[int, Field(ge=2, le=60)] = 10, node: str | None = None,
) -> None:  # fmt: skip
    """Put up planted double walls along x at steps (y, lower level, upper level), with stairs in their middle.

    The walls reach from `stair_m` to `half_m` on both sides; the stairs climb north between two cheeks.
    """
    parts: Parts = []
    areas = []
    for at, low, high in steps:
        for s in (-1, 1):
            x0, x1 = sorted((s * stair_m, s * half_m))
            parts.append((stone, block(x0, at - 0.6, x1, at - 0.25, low - 0.3, high + 0.5)))
            parts.append((stone, block(x0, at + 0.5, x1, at + 0.75, high - 0.6, high + 0.5)))
            parts.append(("soil", block(x0, at - 0.25, x1, at + 0.5, low, high + 0.42)))
            for a in np.arange(x0 + 0.4, x1 - 2.4, 2.9):
                parts.append((hedge, block(a, at - 0.2, a + 2.3, at + 0.45, high + 0.42, high + 1.05)))
            areas.append(rectangle(x0, at - 0.6, x1, at + 0.75))
            a, b = sorted((s * stair_m, s * stair_m - s * 0.4))
            parts.append((stone, block(a, at - 4.2, b, at + 0.75, low - 0.3, high + 0.5)))
        rise, run = (high - low) / treads, 3.6 / treads
        flight = [
            block(-stair_m + 0.4, at - 3.6 + run * i, stair_m - 0.4, at + 0.9, low - 0.1, low + rise * (i + 1))
            for i in range(treads)
        ]
        parts.append((tread, merge(flight)))
    site.add(node, "terrace_wall", parts, {"material": "stone"}, footprint=unary_union(areas))


def fence(site: Site, path: Polyline, kind: str, colour: str | None = None) -> Instance:
    """Put up a picket, board, hedge, wall or railing fence along a path (world metres)."""
    material, height, thickness = {
        "picket": ("#f2efe6", 1.0, 0.05),
        "board": ("boards:#8d6f4c", 1.8, 0.08),
        "hedge": ("hedge", 1.3, 0.7),
        "wall": ("brick:#96604c", 1.2, 0.24),
        "railing": ("iron", 1.2, 0.04),
    }[kind]
    body = colour or material
    z = min(site.ground_z(x, y) for x, y in path)
    parts: Parts = []

    def rail(up: float, section: tuple[float, float]) -> Mesh:
        return sweep(path=[(x, y, z + up) for x, y in path], section=section)

    if kind in ("picket", "railing"):
        step, width, levels = (0.28, 0.14, (0.3, 0.78)) if kind == "picket" else (0.2, 0.035, (0.15, height - 0.05))
        parts += [(body, rail(level, (0.05, 0.08))) for level in levels]
        for a, b in pairwise(path):
            length, yaw = leg(a, b)
            count = max(round(length / step), 1)
            bars = [
                translated(box(size=(width, thickness, height), taper=(0.6, 1.0)), ((k + 0.5) * length / count, 0, 0))
                for k in range(count)
            ]
            parts += Frame(a[0], a[1], yaw).parts([(body, merge(bars))], z + 0.03)
    else:
        parts.append((body, rail(height / 2, (thickness, height))))
        if kind != "hedge":
            parts.append(("concrete" if kind == "wall" else body, rail(height + 0.03, (thickness + 0.1, 0.08))))
        if kind == "board":
            middle = LineString(path)
            for s in np.linspace(0.0, middle.length, max(int(middle.length / 2.4), 1) + 1):
                x, y = middle.interpolate(s).coords[0]
                parts.append(("wood", box_between(x - 0.07, y - 0.07, x + 0.07, y + 0.07, z, z + 1.95)))
    area = LineString(path).buffer(thickness / 2 + 0.02, cap_style="flat", join_style="mitre")
    return site.add(None, f"{kind}_fence" if kind != "hedge" else "garden_hedge", parts, footprint=area)
