"""What hangs on the walls of narrow lanes and across them: balconies, fire escapes, awnings, washing, lights."""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, Point, block, deck, railing, stairs
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.shapes import box, sphere
from aerialdojo_gen.scenes.shapes_extruded import prism, sweep
from aerialdojo_gen.scenes.site import Site

Box = tuple[float, float, float, float]


def town_house(
    site: Site,
    outline: Box,
    storeys: int,
    wall: str,
    roof: str,
    *,
    kind: str = "flat",
    name: str = "",
    foot_m: float = 0.0,
) -> float:
    """Put up a town house on (x0, y0, x1, y1) from `foot_m` upwards; returns the height of its eaves, metres."""
    storey_m = site.catalogue.materials.tile_m(wall) / 2
    attributes = {"place": name} if name else None
    building(site, rectangle(*outline), wall=wall, roof=roof, storeys=storeys, storey_m=storey_m, roof_kind=kind,
             roof_m=2.2, overhang_m=0.25, z=foot_m, category="town_house", attributes=attributes)  # fmt: skip
    return foot_m + storeys * storey_m


def passage_house(
    site: Site, outline: Box, opening: Box, head_m: float, storeys: int, wall: str, base: str, roof: str
) -> float:
    """Put up a house whose ground storey is open over `opening`; returns the height of its eaves, metres."""
    plan, gap = rectangle(*outline), rectangle(*opening)
    low = plan.difference(gap)
    parts: Parts = []
    for piece in getattr(low, "geoms", [low]):
        if piece.area > 1e-6:
            x0, y0, x1, y1 = piece.bounds
            parts.append((base, block(x0, y0, x1, y1, 0.0, head_m)))
    lip = [block(opening[0], opening[1], opening[2], opening[3], head_m - 0.15, head_m)]
    parts.append(("stone", merge(lip)))
    site.add(None, "passage", parts, {"place": "under a house"}, footprint=None if low.is_empty else low)
    return town_house(site, outline, storeys, wall, roof, foot_m=head_m)


def balcony(site: Site, x: float, y: float, yaw_deg: float, z_m: float, *, width_m: float = 3.0, depth_m: float = 1.3,
            floor: str = "concrete", rail: str = "iron") -> Instance:  # fmt: skip
    """Hang a balcony on a wall at (x, y) that faces `yaw_deg`, its floor at `z_m`, with a door behind it."""
    w = width_m / 2
    parts = deck(rectangle(0.0, -w, depth_m, w), 0.0, floor=floor, under=floor, thickness_m=0.18)
    path: list[Point] = [(0.05, -w + 0.05), (depth_m - 0.05, -w + 0.05), (depth_m - 0.05, w - 0.05), (0.05, w - 0.05)]
    parts += railing(path, 0.0, pane=None, frame=rail)
    parts.append(("#e9e4d8", block(-0.02, -0.62, 0.06, 0.62, 0.0, 2.25)))
    parts.append(("window", block(-0.02, -0.5, 0.09, 0.5, 0.05, 2.1)))
    parts += [(rail, block(0.0, v - 0.04, depth_m * 0.7, v + 0.04, -0.42, -0.18)) for v in (-w + 0.4, w - 0.4)]
    return site.add(None, "balcony", Frame(x, y, yaw_deg).parts(parts, z_m))


def fire_escape(
    site: Site, x: float, y: float, yaw_deg: float, storeys: int, storey_m: float, *, frame: str = "iron"
) -> Instance:
    """Hang a fire escape on a wall at (x, y) that faces `yaw_deg`: platforms, flights between them, a ladder."""
    parts: Parts = []
    for k in range(1, storeys):
        z = k * storey_m + 0.1
        parts += deck(rectangle(0.0, -2.9, 1.35, 2.9), z, floor="rust:#5a4a42", under=frame, thickness_m=0.12)
        parts += railing([(0.05, -2.85), (1.3, -2.85), (1.3, 2.85), (0.05, 2.85)], z, pane="chain_link", frame=frame)
        parts.append(("window", block(-0.02, -0.5, 0.08, 0.5, z, z + 1.9)))
        if k + 1 < storeys:
            side = 1 if k % 2 else -1
            parts += stairs((0.75, -side * 2.3), side * 90.0, 0.7, storey_m, 4.2, z_m=z, tread="iron", stringer=frame)
    ladder = [block(1.12, v - 0.03, 1.18, v + 0.03, 0.9, storey_m + 1.1) for v in (2.0, 2.5)]
    ladder += [block(1.12, 2.0, 1.18, 2.5, z, z + 0.04) for z in np.arange(1.1, storey_m + 0.2, 0.32)]
    parts.append((frame, merge(ladder)))
    return site.add(None, "fire_escape", Frame(x, y, yaw_deg).parts(parts))


def awning(site: Site, x: float, y: float, yaw_deg: float, width_m: float, cloth: str, z_m: float = 2.6) -> Instance:
    """Hang a sloping awning on a wall at (x, y) that faces `yaw_deg`, its lower edge at `z_m`."""
    slope = rotated(prism(size=(width_m, 1.5, 0.6), section="wedge"), rotation(0.0, 0.0, 90.0))
    parts: Parts = [
        (cloth, translated(slope, (0.75, 0.0, z_m))),
        (cloth, block(1.45, -width_m / 2, 1.5, width_m / 2, z_m - 0.25, z_m)),
    ]
    return site.add(None, "awning", Frame(x, y, yaw_deg).parts(parts))


def washing_line(site: Site, a: Point, b: Point, z_m: float) -> Instance:
    """Hang a line of washing across a lane: a sagging cord with cloths of several colours."""
    rng = site.rng_for("washing", *a, z_m)
    colours = ("#e8e4da", "#b8443a", "#3f6fa8", "#e0b64a", "#6f9a6a", "#d98aa0")
    line = _sagging(a, b, z_m, 0.35)
    parts: Parts = [("#d8d4c8", sweep(path=line, radius=0.02, sides=4))]
    length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
    yaw = float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0])))
    at = 0.5
    while at < length - 1.0:
        width, drop = float(rng.uniform(0.45, 0.95)), float(rng.uniform(0.6, 1.1))
        t = (at + width / 2) / length
        middle = (a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, z_m - 1.4 * t * (1 - t) - drop)
        cloth = translated(rotated(box(size=(width, 0.03, drop)), rotation(0.0, 0.0, yaw)), middle)
        parts.append((colours[int(rng.integers(len(colours)))], cloth))
        at += width + float(rng.uniform(0.1, 0.4))
    return site.add(None, "washing_line", parts)


def light_string(site: Site, a: Point, b: Point, z_m: float) -> Instance:
    """Hang a string of bulbs across a lane."""
    line = _sagging(a, b, z_m, 0.6)
    bulbs = [translated(sphere(radius=0.09, subdivisions=0), (x, y, z - 0.1)) for x, y, z in line[1:-1]]
    return site.add(None, "light_string", [("iron", sweep(path=line, radius=0.02, sides=4)), ("light", merge(bulbs))])


def pipe(x: float, y: float, z0_m: float, z1_m: float) -> Mesh:
    """Make a downpipe on a wall."""
    return block(x - 0.06, y - 0.06, x + 0.06, y + 0.06, z0_m, z1_m)


def _sagging(a: Point, b: Point, z_m: float, sag_m: float) -> list[tuple[float, float, float]]:
    t = np.linspace(0.0, 1.0, 9)
    return [(a[0] + (b[0] - a[0]) * s, a[1] + (b[1] - a[1]) * s, z_m - 4 * sag_m * s * (1 - s)) for s in t.tolist()]
