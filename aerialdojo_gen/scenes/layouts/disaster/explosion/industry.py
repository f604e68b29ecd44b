"""Industrial structure after a blast: halls with bent frames and torn cladding, burst tanks, broken pipe bridges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from shapely.geometry import Point, Polygon

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.kit.structures import block, columns, railing
from aerialdojo_gen.scenes.layouts.disaster.parts.wreckage import XY, Parts, tilted_plate, torn_wall
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.shapes import box, cylinder
from aerialdojo_gen.scenes.shapes_extruded import extrude, sweep
from aerialdojo_gen.scenes.site import Site


@dataclass(frozen=True)
class Hall:
    """A steel hall in its own frame: x along its length, its front looks along -y.

    Attributes
    ----------
    frame : Frame
        Middle of its plan, and the direction of its length.
    length_m, depth_m, eaves_m, ridge_m : float
        Its size; the ridge runs along x.
    blast : (x, y)
        Where the blast was, in its own frame, metres.
    reach_m : float
        Cladding nearer to the blast than this is gone.
    gallery_m : float
        Height of a gallery along the back wall; 0 for none.
    cladding, steel : str
        Materials.
    """

    frame: Frame
    length_m: float
    depth_m: float
    eaves_m: float
    ridge_m: float
    blast: XY
    reach_m: float
    gallery_m: float = 0.0
    cladding: str = "corrugated:#7d8f96"
    steel: str = "rust"


def steel_hall(site: Site, hall: Hall, base_m: float, node: str) -> Instance:
    """Put up what a blast left of a steel hall: frames bent away from it, sheets torn off or hanging."""
    rng = site.rng_for("hall", node)
    count = max(round(hall.length_m / 5.0), 2)
    stations = np.linspace(-hall.length_m / 2, hall.length_m / 2, count + 1)
    frames = [_portal(hall, float(x), rng) for x in stations]
    steel = [sweep(path=[tuple(p) for p in line], section=(0.26, 0.34)) for line in frames]
    for k in range(1, len(frames[0]) - 1):
        steel.append(sweep(path=[tuple(line[k]) for line in frames], section=(0.14, 0.16)))
    sheets: list[Mesh] = []
    for left, right in pairwise(frames):
        for k in range(len(left) - 1):
            sheets += _sheet(hall, (left[k], right[k], right[k + 1], left[k + 1]), rng)
    parts: Parts = [(hall.steel, merge(steel))]
    if sheets:
        parts.append((hall.cladding, merge(sheets)))
    x, y = hall.length_m / 2, hall.depth_m / 2
    parts.append(("concrete", merge([block(-x, s * y - 0.15, x, s * y + 0.15, -0.8, 0.5) for s in (1,)])))
    if hall.gallery_m:
        parts += _gallery(hall)
    return site.add(node, "wrecked_hall", hall.frame.parts(parts, base_m))


def _portal(hall: Hall, x: float, rng: np.random.Generator) -> list[np.ndarray]:
    y, e, r = hall.depth_m / 2, hall.eaves_m, hall.ridge_m
    line = [
        (x, -y, -0.6),
        (x, -y, e * 0.5),
        (x, -y, e),
        (x, -y / 2, (e + r) / 2),
        (x, 0.0, r),
        (x, y / 2, (e + r) / 2),
        (x, y, e),
        (x, y, e * 0.5),
        (x, y, -0.6),
    ]
    out = []
    for px, py, pz in line:
        away = np.array([px - hall.blast[0], py - hall.blast[1]])
        distance = float(np.linalg.norm(away))
        push = 2.4 * float(np.exp(-((distance / (0.8 * hall.reach_m)) ** 2))) * min(max(pz, 0.0) / e, 1.3)
        shift = away / max(distance, 1e-6) * push + rng.uniform(-0.12, 0.12, size=2) * min(push, 1.0)
        sag = -0.55 * push if pz > e * 0.9 else 0.0
        out.append(np.array([px + shift[0], py + shift[1], pz + sag]))
    return out


def _sheet(hall: Hall, quad: tuple[np.ndarray, ...], rng: np.random.Generator) -> list[Mesh]:
    a, b, c, d = (np.asarray(p, dtype=np.float64) for p in quad)
    middle = (a + b + c + d) / 4
    distance = float(np.hypot(middle[0] - hall.blast[0], middle[1] - hall.blast[1]))
    high = min(a[2], b[2]) > hall.eaves_m * 0.75
    gone = hall.reach_m * (1.25 if high else 1.0) * float(rng.uniform(0.8, 1.2))
    if distance < gone:
        if distance > 0.7 * gone and rng.uniform() < 0.5:
            # It still hangs by its upper edge.
            width = float(np.linalg.norm(b - a)) * 0.8
            top = d if not high else a
            yaw = float(np.degrees(np.arctan2((b - a)[1], (b - a)[0])))
            body = translated(box(size=[width, 0.04, 2.2]), (width / 2, 0, -2.2))
            turn = rotation(float(rng.uniform(-35, 35)), float(rng.uniform(-12, 12)), yaw)
            return [translated(rotated(body, turn), top)]
        return []
    normal = np.cross(b - a, d - a)
    normal /= max(float(np.linalg.norm(normal)), 1e-9)
    if normal @ (middle - np.array([middle[0], 0.0, hall.eaves_m * 0.5])) < 0:
        normal = -normal
    u, v = b - a, d - a
    fray = 0.14 if distance < 1.6 * gone else 0.0
    flat = [
        (0.0, 0.0),
        (1.0, 0.0),
        (1.0, 1.0 - fray * rng.uniform()),
        (0.5, 1.0 - 2 * fray * rng.uniform()),
        (0.0, 1.0 - fray * rng.uniform()),
    ]
    plate = extrude(Polygon(flat), 0.05)
    s, t, w = plate.vertices.T
    warp = np.outer(s * t, (c - b) - (d - a))
    lift = normal * 0.2
    return [Mesh(a + lift + np.outer(s, u) + np.outer(t, v) + warp + np.outer(w, normal), plate.faces)]


def _gallery(hall: Hall) -> Parts:
    x, y, z = hall.length_m / 2 - 1.0, hall.depth_m / 2 - 0.6, hall.gallery_m
    parts: Parts = [("sheet_metal", block(-x, y - 3.0, x, y, z - 0.2, z))]
    posts = [(float(u), y - 2.8) for u in np.linspace(-x + 0.3, x - 0.3, max(int(x / 2.5), 2))]
    parts.append((hall.steel, columns(posts, -0.5, z - 0.2, 0.14, 6)))
    parts += railing([(-x, y - 2.95), (x, y - 2.95)], z, pane="chain_link", frame="marking_yellow")
    return parts


def burst_tank(
    site: Site, x: float, y: float, radius_m: float, height_m: float, blast: XY, node: str, shell: str = "sheet_metal"
) -> Instance:
    """Put up a tank that burst: its shell torn down and folded out on the blast's side, its lid fallen in."""
    rng = site.rng_for("tank", node)
    base = site.ground_z(x, y)
    n = 26
    toward = float(np.arctan2(blast[1] - y, blast[0] - x))
    parts: Parts = [("concrete", translated(cylinder(radius=radius_m + 0.5, height=0.7, segments=n), (0, 0, -0.4)))]
    for k in range(n):
        a0, a1 = (2 * np.pi * (k + j) / n for j in (0, 1))
        mid = (a0 + a1) / 2
        near = float(np.cos(mid - toward))
        top = height_m * (1.0 - max(0.0, near - 0.1) * 0.85)
        p0, p1 = ((radius_m * float(np.cos(a)), radius_m * float(np.sin(a))) for a in (a0, a1))
        length = float(np.hypot(p1[0] - p0[0], p1[1] - p0[1]))
        fray = rng.uniform(-0.5, 0.5, size=3) * (0.12 if near < 0.1 else 1.0)
        face = Polygon(
            [(0, 0.3), (length, 0.3), (length, top + fray[0]), (length / 2, top + fray[1]), (0, top + fray[2])]
        )
        body = torn_wall(p0, p1, face, (), rng, (), 0.08)
        if body is not None:
            parts.append((shell if near < 0.6 else "rust", body))
        if near > 0.45 and k % 2 == 0:
            plate = translated(
                box(size=[height_m * 0.45, length * 1.3, 0.07], taper=(0.6, 1.0)), (height_m * 0.2, 0, 0)
            )
            turn = rotation(0.0, float(rng.uniform(-25, 30)), float(np.degrees(mid)))
            at = (radius_m * float(np.cos(mid)), radius_m * float(np.sin(mid)), max(top, 0.9) * 0.95)
            parts.append(("rust", translated(rotated(plate, turn), at)))
    for band in (0.35, 0.65, 0.95):
        arc = [toward + np.radians(d) for d in np.linspace(70, 290, 12)]
        ring = [
            ((radius_m + 0.06) * float(np.cos(a)), (radius_m + 0.06) * float(np.sin(a)), height_m * band) for a in arc
        ]
        parts.append(("steel", sweep(path=ring, section=(0.08, 0.18))))
    lid = tilted_plate(
        (radius_m * 1.5, radius_m * 1.5),
        0.08,
        (0.0, 0.0, height_m * 0.42),
        (10.0, 28.0),
        float(np.degrees(toward)),
        rng,
    )
    parts.append(("rust", lid))
    area = Point(x, y).buffer(radius_m + 0.6, quad_segs=6)
    return site.add(node, "burst_tank", Frame(x, y).parts(parts, base), footprint=area)


def pipe_bridge(
    site: Site, a: XY, b: XY, z_m: float, gap: tuple[float, float], node: str, walkway_m: float = 2.2,
    pipes: bool = True, category: str = "pipe_bridge",
) -> Instance:  # fmt: skip
    """Put up a pipe bridge at a height over its foot, with a walkway, broken between two shares of its length.

    Parameters
    ----------
    a, b : (x, y)
        Its ends, metres.
    z_m : float
        World height of the walkway, metres.
    gap : (float, float)
        Where it is broken, shares of the length from `a`.
    walkway_m : float
        Width of the walkway, metres.
    pipes : bool
        Whether pipes run beside it; else it is a footbridge.
    category : str
        As in `Site.add`.
    """
    rng = site.rng_for("bridge", node)
    length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
    frame = Frame(a[0], a[1], float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0]))))
    steel, deck = [], []
    runs: dict[str, list[Mesh]] = {}
    for s0, s1 in ((0.0, gap[0] * length), (gap[1] * length, length)):
        w = walkway_m / 2
        deck.append(block(s0, -w, s1, w, z_m - 0.1, z_m))
        steel += [sweep(path=[(s0, v, z_m - 0.22), (s1, v, z_m - 0.22)], section=(0.14, 0.24)) for v in (-w, w)]
        for s in np.linspace(s0 + 0.6, s1 - 0.6, max(round((s1 - s0) / 5.5), 1) + 1):
            foot = site.ground_z(*frame.at(float(s), 0.0)) - 0.4
            for v in (-w, w):
                steel.append(sweep(path=[(float(s), v * 1.25, foot), (float(s), v, z_m - 0.2)], section=(0.2, 0.2)))
            steel.append(block(float(s) - 0.08, -w, float(s) + 0.08, w, z_m - 0.42, z_m - 0.2))
            site.occupy(frame.area(Point(float(s), 0.0).buffer(1.6)), -100.0, z_m - 0.5)
        toward = 1.0 if s0 == 0.0 else -1.0
        torn = s1 if s0 == 0.0 else s0
        start = s0 if s0 == 0.0 else s1
        lines = (
            (-w - 0.5, 0.22, "paint:#d8b23a"),
            (-w - 1.05, 0.15, "paint:#b9bec4"),
            (w + 0.45, 0.18, "paint:#3f7d4e"),
        )
        for k, (v, radius, colour) in enumerate(lines if pipes else ()):
            drop = float(rng.uniform(0.6, 2.0))
            end = torn + toward * float(rng.uniform(0.2, 1.6))
            path = [
                (start, v, z_m - 0.1 + 0.1 * k),
                (torn - toward * 1.2, v, z_m - 0.1 + 0.1 * k),
                (end, v + float(rng.uniform(-0.5, 0.5)), z_m - drop),
            ]
            runs.setdefault(colour, []).append(sweep(path=path, radius=radius, sides=8))
    parts: Parts = [("sheet_metal", merge(deck)), ("rust", merge(steel))]
    parts += [(colour, merge(bodies)) for colour, bodies in runs.items()]
    for s0, s1 in ((0.0, gap[0] * length), (gap[1] * length, length)):
        parts += railing([(s0, walkway_m / 2), (s1, walkway_m / 2)], z_m, pane="chain_link", frame="steel")
    return site.add(node, category, frame.parts(parts))


def twisted_steel(site: Site, places: Sequence[tuple[float, float, float]], key: str) -> Instance:
    """Strew bent beams that a blast threw: (x, y, length) each, metres."""
    rng = site.rng_for("twisted", key)
    bodies = []
    for x, y, length in places:
        yaw, z = float(rng.uniform(0, 2 * np.pi)), site.ground_z(x, y)
        path = []
        for t in np.linspace(0.0, 1.0, 5):
            turn = yaw + 0.9 * (t - 0.5) * float(rng.uniform(0.5, 1.4))
            u = (t - 0.5) * length
            px, py = x + u * float(np.cos(turn)), y + u * float(np.sin(turn))
            lift = 0.12 + 0.35 * length * float(rng.uniform(0.3, 1.0)) * max(0.0, t - 0.45) * 1.4
            path.append((px, py, max(z, site.ground_z(px, py)) + lift))
        bodies.append(sweep(path=path, section=(0.22, 0.28)))
        site.occupy(Point(x, y).buffer(length * 0.35), z - 1.0, z + 1.5)
    return site.add(None, "twisted_steel", [("rust", merge(bodies))])
