"""Structure of amusement parks: pavilions, booths, queues, strings of lights, entrance gates, water channels."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from shapely.geometry import LineString, Point
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns, letters
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.shapes import box, cone, cylinder, sphere
from aerialdojo_gen.scenes.shapes_extruded import prism, sweep
from aerialdojo_gen.scenes.site import Site

FLOOR_M, EAVE_M = 0.3, 3.9


def pavilion(
    site: Site, node: str, frame: Frame, size_m: tuple[float, float], *, sign: str, roof: str, trim: str, floor: str
) -> float:
    """Put up a roofed ride hall with open sides, as dodgems have; its front is the +u side.

    Parameters
    ----------
    site : Site
        Where.
    node : str
        Node name.
    frame : Frame
        Middle of its plan.
    size_m : (float, float)
        Along u and v, metres.
    sign : str
        Written over the front.
    roof, trim, floor : str
        Materials.

    Returns
    -------
    float
        Height of the floor, metres; the flat of the roof lies `EAVE_M` + 0.2 over the ground.
    """
    base = site.ground_z(frame.x, frame.y)
    u, v = size_m[0] / 2, size_m[1] / 2
    posts = [(s * (u - 0.3), t) for s in (-1, 1) for t in np.linspace(-v + 0.3, v - 0.3, 4)]
    low, high = EAVE_M - 0.4, EAVE_M + 0.35
    rims = [block(t - 0.06, -v - 0.5, t + 0.06, v + 0.5, low, high) for t in (-u - 0.5, u + 0.5)]
    rims += [block(-u - 0.5, t - 0.06, u + 0.5, t + 0.06, low, high) for t in (-v - 0.5, v + 0.5)]
    top = FLOOR_M + 0.28
    bumpers = [block(-u + 0.05, -v, -u + 0.25, v, FLOOR_M, top)]
    bumpers += [block(-u, t - 0.1, u, t + 0.1, FLOOR_M, top) for t in (-v + 0.15, v - 0.15)]
    parts: Parts = [
        (floor, block(-u, -v, u, v, FLOOR_M - 0.05, FLOOR_M)),
        ("concrete", block(-u - 0.1, -v - 0.1, u + 0.1, v + 0.1, -0.3, FLOOR_M - 0.05)),
        (trim, columns(posts, FLOOR_M, EAVE_M, 0.14)),
        (roof, block(-u - 0.5, -v - 0.5, u + 0.5, v + 0.5, EAVE_M, EAVE_M + 0.2)),
        (trim, merge(rims)),
        ("#26282c", block(u + 0.5, -v * 0.8, u + 0.72, v * 0.8, EAVE_M - 0.1, EAVE_M + 1.0)),
        ("light", letters(sign, 0.66, (u + 0.73, 0.0, EAVE_M + 0.1), 0.0, 0.05)),
        ("rubber", merge(bumpers)),
    ]  # fmt: skip
    bulbs = [
        translated(sphere(radius=0.09, subdivisions=0), (u + 0.62, t, EAVE_M - 0.48)) for t in np.linspace(-v, v, 12)
    ]
    parts.append(("light", merge(bulbs)))
    site.add(node, "ride_hall", frame.parts(parts, base), {"material": "metal"})
    return base + FLOOR_M


def booths(site: Site, node: str, frame: Frame, count: int, colours: Sequence[str], words: Sequence[str]) -> Instance:
    """Put up a row of game booths, 3 m wide each, that look along +u: counters, prizes, striped roofs, signs."""
    base = site.ground_z(frame.x, frame.y)
    half = count * 1.5
    parts: Parts = []
    for k in range(count):
        a, b = -half + 3.0 * k, -half + 3.0 * (k + 1)
        colour, middle = colours[k % len(colours)], (a + b) / 2
        roof = rotated(prism(size=(2.9, 3.2, 0.9)), rotation(0, 0, 0))
        parts += [
            (f"boards:{colour}", block(-1.2, a + 0.05, -1.1, b - 0.05, 0.0, 2.5)),
            (f"boards:{colour}", merge([block(-1.2, v - 0.05, 1.0, v + 0.05, 0.0, 2.5) for v in (a + 0.1, b - 0.1)])),
            (f"boards:{colour}", block(0.9, a + 0.15, 1.0, b - 0.15, 0.0, 0.95)),
            ("wood", block(0.7, a + 0.1, 1.25, b - 0.1, 0.95, 1.02)),
            (f"stripes:{colour}", translated(roof, (0.0, middle, 2.5))),
            ("#f1f0ea", block(1.3, a + 0.3, 1.4, b - 0.3, 2.3, 2.75)),
            (colour, letters(words[k % len(words)], 0.3, (1.41, middle, 2.38), 0.0, 0.03)),
            ("wood", merge([block(-1.1, a + 0.15, -0.7, b - 0.15, z, z + 0.05) for z in (1.1, 1.7)])),
        ]
        for j, tone in enumerate(("#e9b52a", "#d8342c", "#2f6fc0", "#e58fb0", "#3f9a5a")):
            toys = [
                translated(sphere(radius=0.17, subdivisions=0), (-0.9, a + 0.5 + 0.5 * j, z + 0.2))
                for z in (1.1, 1.7)
            ]
            parts.append((tone, merge(toys)))
    area = frame.area(rectangle(-1.3, -half, 1.4, half))
    return site.add(node, "game_booth", frame.parts(parts, base), {"material": "wooden"}, footprint=area)


def queue_rails(site: Site, node: str, frame: Frame, lanes: int, length_m: float) -> Instance:
    """Lay a zigzag of barriers for a queue, lanes 1.2 m wide that run along u."""
    base = site.ground_z(frame.x, frame.y)
    rails, posts = [], []
    for k in range(lanes + 1):
        v = k * 1.2
        a, b = (0.0, length_m - 1.2) if k % 2 else (1.2, length_m)
        if k in (0, lanes):
            a, b = 0.0, length_m
        rails += [sweep(path=[(a, v, z), (b, v, z)], radius=0.035) for z in (0.5, 1.0)]
        posts += [(float(u), v) for u in np.linspace(a, b, 4)]
    parts: Parts = [("steel", merge([*rails, columns(posts, -0.1, 1.03, 0.04, 6)]))]
    return site.add(node, "queue_rails", frame.parts(parts, base))


def light_strings(site: Site, node: str, poles: Sequence[tuple[float, float]], height_m: float = 4.6) -> Instance:
    """Hang strings of coloured bulbs from pole to pole."""
    tones = ("#e9b52a", "#d8342c", "#2f6fc0", "#3f9a5a")
    bulbs: dict[str, list[Mesh]] = {tone: [] for tone in tones}
    wires, masts = [], []
    tops = [(x, y, site.ground_z(x, y) + height_m) for x, y in poles]
    for x, y, z in tops:
        masts.append(
            translated(cylinder(radius=0.08, height=height_m + 0.1, segments=8), (x, y, z - height_m - 0.05))
        )
    for a, b in pairwise(tops):
        t = np.linspace(0.0, 1.0, 9)
        sag = 0.9 * 4.0 * t * (1.0 - t)
        line = np.outer(1.0 - t, a) + np.outer(t, b) - np.column_stack([0 * t, 0 * t, sag])
        wires.append(sweep(path=line.tolist(), radius=0.025, sides=3))
        for k, p in enumerate(line[1:-1]):
            bulbs[tones[k % 4]].append(translated(sphere(radius=0.12, subdivisions=0), p - (0, 0, 0.12)))
    parts: Parts = [("iron", merge([*wires, *masts]))]
    parts += [(tone, merge(many)) for tone, many in bulbs.items() if many]
    return site.add(node, "light_strings", parts)


def entrance_gate(
    site: Site, frame: Frame, name: str, width_m: float, *, wall: str, roof: str, sign: str
) -> Instance:
    """Put up an entrance: two round towers with pointed roofs, and an arched board with the park's name between."""
    base = site.ground_z(frame.x, frame.y)
    half = width_m / 2 + 1.6
    parts: Parts = []
    for s in (-1, 1):
        at = (0.0, s * half, 0.0)
        parts += [
            (wall, translated(cylinder(radius=1.5, height=5.2, segments=14), at)),
            (roof, translated(cone(radius=2.0, height=3.0, segments=14), (0.0, s * half, 5.2))),
            (sign, translated(cylinder(radius=1.56, height=0.5, segments=14), (0.0, s * half, 3.2))),
            ("window", translated(box(size=(3.06, 0.6, 1.2)), (0.0, s * half, 1.4))),
            ("#e9b52a", translated(sphere(radius=0.22), (0.0, s * half, 8.3))),
        ]
    t = np.linspace(0.0, np.pi, 9)
    arch = [(0.0, -(width_m / 2 + 0.2) * float(np.cos(a)), 4.0 + 0.9 * float(np.sin(a))) for a in t]
    parts.append((sign, sweep(path=arch, section=(0.3, 0.5))))
    parts.append((wall, block(-0.15, -width_m / 2 - 0.2, 0.15, width_m / 2 + 0.2, 4.0, 4.25)))
    parts.append(
        (roof, merge([letters(name, 0.75, (s * 0.16, 0.0, 4.95), 0.0 if s > 0 else 180.0, 0.08) for s in (1, -1)]))
    )
    parts.append((sign, block(-0.12, -2.4, 0.12, 2.4, 4.7, 5.85)))
    area = unary_union([frame.area(rectangle(-1.6, s * half - 1.6, 1.6, s * half + 1.6)) for s in (-1, 1)])
    return site.add("entrance_gate", "entrance_gate", frame.parts(parts, base), {"material": "stone"}, footprint=area)


def flume(site: Site, node: str, path: Sequence[tuple[float, float, float]], *, trough: str, leg: str) -> Instance:
    """Lead a water channel along a path of (x, y, height over z = 0): a trough on legs, brim full.

    Parameters
    ----------
    site : Site
        Where.
    node : str
        Node name.
    path : sequence of (x, y, z)
        Underside of the channel, metres, world frame.
    trough, leg : str
        Materials.
    """
    line = np.asarray(path, dtype=np.float64)
    parts: Parts = [(trough, sweep(path=(line + np.array([0.0, 0.0, 0.1])).tolist(), section=(2.2, 0.2)))]
    parts.append(("water", sweep(path=(line + np.array([0.0, 0.0, 0.3])).tolist(), section=(1.8, 0.2))))
    flat = LineString(line[:, :2])
    for side in (-1, 1):
        rim = np.array(flat.offset_curve(side * 1.05, join_style="mitre").coords)
        s = [flat.project(Point(x, y)) for x, y in rim]
        z = np.interp(s, _stations(line), line[:, 2])
        edge = np.column_stack([rim, z + 0.45])
        parts.append((trough, sweep(path=edge.tolist(), section=(0.14, 0.7))))
    legs = []
    for d in np.arange(1.0, flat.length, 3.2):
        p = flat.interpolate(d)
        z = float(np.interp(d, _stations(line), line[:, 2]))
        ground = site.ground_z(p.x, p.y) - 0.2
        if z - ground > 0.4:
            legs += [block(p.x - 0.14, p.y - 0.14, p.x + 0.14, p.y + 0.14, ground, z + 0.02)]
    if legs:
        parts.append((leg, merge(legs)))
    return site.add(node, "log_flume", parts, {"material": "metal"})


def _stations(line: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))])
