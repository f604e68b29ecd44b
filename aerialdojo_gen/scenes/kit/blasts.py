"""What a blast leaves of industrial structure: bent halls, burst tanks, broken bridges, bent lamps, torn walls."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field
from shapely.geometry import Point, Polygon
from shapely.ops import unary_union

from aerialdojo_gen.geometry.portable import dot, norm
from aerialdojo_gen.scenes.grammar import Frame, leg
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.rubble import Breadth
from aerialdojo_gen.scenes.kit.ruins import Extent
from aerialdojo_gen.scenes.kit.structures import block, columns, railing
from aerialdojo_gen.scenes.kit.wreckage import Bite, bars, tilted_plate, torn_wall
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, posed, rotation, translated
from aerialdojo_gen.scenes.plans.values import At, Material, Number
from aerialdojo_gen.scenes.shapes import box, cylinder, extrude, sweep
from aerialdojo_gen.scenes.site import Site


@dataclass(frozen=True)
class Hall:
    """A steel hall in its own frame: x along its length, its front looks along -y.

    The ridge runs along x. Cladding nearer to the `blast` (own frame) than `reach_m` is gone; `gallery_m` is the
    height of a gallery along the back wall, 0 for none.
    """

    length_m: Extent
    depth_m: Extent
    eaves_m: Extent
    ridge_m: Extent
    blast: At
    reach_m: Extent
    gallery_m: Number = 0.0
    cladding: Material = "corrugated:#7d8f96"
    steel: Material = "rust"


@site_builder
def blasted_hall(site: Site, *, node: str, at: At, yaw_deg: Number = 0.0, hall: Hall) -> float:
    """Put up what a blast left of a steel hall: bent frames, sheets torn off or hanging; gives its floor's height."""
    base = site.ground_z(*at)
    rng = site.rng_for("hall", node)
    count = max(round(hall.length_m / 5.0), 2)
    stations = np.linspace(-hall.length_m / 2, hall.length_m / 2, count + 1)
    frames = [_portal(hall, float(x), rng) for x in stations]
    steel = [sweep(path=[tuple(p) for p in line], section=(0.26, 0.34)) for line in frames]
    purlins = list(zip(*frames, strict=True))[1:-1]
    steel += [sweep(path=[tuple(point) for point in line], section=(0.14, 0.16)) for line in purlins]
    sheets: list[Mesh] = []
    for left, right in pairwise(frames):
        for k in range(len(left) - 1):
            sheets += _sheet(hall, (left[k], right[k], right[k + 1], left[k + 1]), rng)
    x, y = hall.length_m / 2, hall.depth_m / 2
    parts: Parts = [
        (hall.steel, merge(steel)),
        (hall.cladding, merge(sheets)),
        ("concrete", block(-x, y - 0.15, x, y + 0.15, -0.8, 0.5)),
    ]
    if hall.gallery_m:
        parts += _gallery(hall)
    site.add(node, "wrecked_hall", Frame(*at, yaw_deg).parts(parts, base))
    return base


def _portal(hall: Hall, x: float, rng: np.random.Generator) -> list[np.ndarray]:
    y, e, r = hall.depth_m / 2, hall.eaves_m, hall.ridge_m
    half = [(y, -0.6), (y, e * 0.5), (y, e), (y / 2, (e + r) / 2)]
    out = []
    for py, pz in [*((-v, z) for v, z in half), (0.0, r), *half[::-1]]:
        away = np.array([x - hall.blast[0], py - hall.blast[1]])
        distance = float(norm(away))
        push = 2.4 * math.exp(-((distance / (0.8 * hall.reach_m)) ** 2)) * min(max(pz, 0.0) / e, 1.3)
        shift = away / max(distance, 1e-6) * push + rng.uniform(-0.12, 0.12, size=2) * min(push, 1.0)
        sag = -0.55 * push if pz > e * 0.9 else 0.0
        out.append(np.array([x + shift[0], py + shift[1], pz + sag]))
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
            width = float(norm(b - a)) * 0.8
            top = d if not high else a
            yaw = math.degrees(math.atan2((b - a)[1], (b - a)[0]))
            body = translated(box(size=[width, 0.04, 2.2]), (width / 2, 0, -2.2))
            turn = rotation(float(rng.uniform(-35, 35)), float(rng.uniform(-12, 12)), yaw)
            return [posed(body, turn, top)]
        return []
    normal = np.cross(b - a, d - a)
    normal /= max(float(norm(normal)), 1e-9)
    if dot(normal, middle - np.array([middle[0], 0.0, hall.eaves_m * 0.5])) < 0:
        normal = -normal
    u, v = b - a, d - a
    fray = 0.14 if distance < 1.6 * gone else 0.0
    torn = [(x, 1.0 - most * rng.uniform()) for x, most in ((1.0, fray), (0.5, 2 * fray), (0.0, fray))]
    plate = extrude(Polygon([(0.0, 0.0), (1.0, 0.0), *torn]), 0.05)
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


@site_builder
def burst_tank(
    site: Site, *, node: str, at: At, radius_m: Breadth, height_m: Breadth, blast: At, shell: Material = "sheet_metal"
) -> None:
    """Put up a tank that burst: its shell torn down and folded out on the blast's side, its lid fallen in."""
    rng = site.rng_for("tank", node)
    x, y = at
    base = site.ground_z(x, y)
    n = 26
    toward = math.atan2(blast[1] - y, blast[0] - x)
    parts: Parts = [("concrete", translated(cylinder(radius=radius_m + 0.5, height=0.7, segments=n), (0, 0, -0.4)))]
    for k in range(n):
        a0, a1 = (2 * np.pi * (k + j) / n for j in (0, 1))
        mid = (a0 + a1) / 2
        near = float(np.cos(mid - toward))
        top = height_m * (1.0 - max(0.0, near - 0.1) * 0.85)
        p0, p1 = ((radius_m * float(np.cos(a)), radius_m * float(np.sin(a))) for a in (a0, a1))
        length, _ = leg(p0, p1)
        fray = rng.uniform(-0.5, 0.5, size=3) * (0.12 if near < 0.1 else 1.0)
        face = Polygon(
            [(0, 0.3), (length, 0.3), (length, top + fray[0]), (length / 2, top + fray[1]), (0, top + fray[2])]
        )
        material = shell if near < 0.6 else "rust"
        parts.append((material, torn_wall(p0, p1, face, (), rng, (), 0.08)))
        if near > 0.45 and k % 2 == 0:
            plate = translated(
                box(size=[height_m * 0.45, length * 1.3, 0.07], taper=(0.6, 1.0)), (height_m * 0.2, 0, 0)
            )
            turn = rotation(0.0, float(rng.uniform(-25, 30)), float(np.degrees(mid)))
            edge = (radius_m * float(np.cos(mid)), radius_m * float(np.sin(mid)), max(top, 0.9) * 0.95)
            parts.append(("rust", posed(plate, turn, edge)))
    for band in (0.35, 0.65, 0.95):
        arc = [toward + np.radians(d) for d in np.linspace(70, 290, 12)]
        ring = [
            ((radius_m + 0.06) * float(np.cos(a)), (radius_m + 0.06) * float(np.sin(a)), height_m * band) for a in arc
        ]
        parts.append(("steel", sweep(path=ring, section=(0.08, 0.18))))
    side, middle, yaw_deg = radius_m * 1.5, (0.0, 0.0, height_m * 0.42), float(np.degrees(toward))
    parts.append(("rust", tilted_plate((side, side), 0.08, middle, (10.0, 28.0), yaw_deg, rng)))
    area = Point(x, y).buffer(radius_m + 0.6, quad_segs=6)
    site.add(node, "burst_tank", Frame(x, y).parts(parts, base), footprint=area)


@site_builder
def broken_bridge(
    site: Site, *, node: str, ends: tuple[At, At], over: Annotated[list[At], Field(min_length=1)], clear_m: Number,
    gap: tuple[Number, Number], walkway_m: Number = 2.2, pipes: bool = True, category: str = "pipe_bridge",
) -> float:  # fmt: skip
    """Put up a bridge with a walkway, broken between two shares of its length; gives the walkway's height, metres.

    It stands between two ends; its walkway, `walkway_m` wide, lies `clear_m` over the highest ground of points
    `over`. Without `pipes` it is a footbridge.
    """
    rng = site.rng_for("bridge", node)
    (a, b), z_m = ends, max(site.ground_z(*point) for point in over) + clear_m
    length, yaw_deg = leg(a, b)
    frame = Frame(*a, yaw_deg)
    steel, deck = [], []
    runs: dict[str, list[Mesh]] = {}
    for s0, s1 in ((0.0, gap[0] * length), (gap[1] * length, length)):
        w = walkway_m / 2
        deck.append(block(s0, -w, s1, w, z_m - 0.1, z_m))
        steel += [sweep(path=[(s0, v, z_m - 0.22), (s1, v, z_m - 0.22)], section=(0.14, 0.24)) for v in (-w, w)]
        for s in np.linspace(s0 + 0.6, s1 - 0.6, max(round((s1 - s0) / 5.5), 1) + 1):
            foot = site.ground_z(*frame.at(float(s), 0.0)) - 0.4
            legs = [[(float(s), v * 1.25, foot), (float(s), v, z_m - 0.2)] for v in (-w, w)]
            steel += [sweep(path=line, section=(0.2, 0.2)) for line in legs]
            steel.append(block(float(s) - 0.08, -w, float(s) + 0.08, w, z_m - 0.42, z_m - 0.2))
            site.occupy(frame.area(Point(float(s), 0.0).buffer(1.6)), -100.0, z_m - 0.5)
        start, torn, toward = (s0, s1, 1.0) if s0 == 0.0 else (s1, s0, -1.0)
        lines = ((-w - 0.5, 0.22, "paint:#d8b23a"), (-w - 1.05, 0.15, "paint:#b9bec4"),
                 (w + 0.45, 0.18, "paint:#3f7d4e"))  # fmt: skip
        for k, (v, radius, colour) in enumerate(lines if pipes else ()):
            drop = float(rng.uniform(0.6, 2.0))
            end = torn + toward * float(rng.uniform(0.2, 1.6))
            path = [(s, v, z_m - 0.1 + 0.1 * k) for s in (start, torn - toward * 1.2)]
            path.append((end, v + float(rng.uniform(-0.5, 0.5)), z_m - drop))
            runs.setdefault(colour, []).append(sweep(path=path, radius=radius, sides=8))
    parts: Parts = [("sheet_metal", merge(deck)), ("rust", merge(steel))]
    parts += [(colour, merge(bodies)) for colour, bodies in runs.items()]
    for s0, s1 in ((0.0, gap[0] * length), (gap[1] * length, length)):
        parts += railing([(s0, walkway_m / 2), (s1, walkway_m / 2)], z_m, pane="chain_link", frame="steel")
    site.add(node, category, frame.parts(parts))
    return z_m


@site_builder
def twisted_steel(
    site: Site, *, beams: Annotated[list[tuple[Number, Number, Number]], Field(min_length=1)], stream: str
) -> None:
    """Strew bent beams that a blast threw: (x, y, length) each, metres."""
    rng = site.rng_for("twisted", stream)
    bodies = []
    for x, y, length in beams:
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
    site.add(None, "twisted_steel", [("rust", merge(bodies))])


@site_builder
def scorch_rays(
    site: Site, *, at: At, radius_m: Number, count: Annotated[int, Field(ge=1, le=500)], reach: tuple[Number, Number],
    spread: tuple[Number, Number], material: Material,
) -> None:  # fmt: skip
    """Paint rays of soot about a crater: `reach` in radii of its crest, half their width in radians."""
    rng = site.rng_for("rays")
    rays = []
    for _ in range(count):
        a, r = float(rng.uniform(0, 2 * np.pi)), radius_m * float(rng.uniform(*reach))
        w = float(rng.uniform(*spread))
        points = [
            (at[0] + q * float(np.cos(b)), at[1] + q * float(np.sin(b)))
            for q, b in ((radius_m, a - w), (r, a), (radius_m, a + w))
        ]
        rays.append(Polygon(points))
    site.paint(unary_union(rays), material)


@site_builder
def crater_rim(site: Site, *, at: At, radius_m: Number) -> None:
    """Stand the slabs of a broken pavement up around a crater."""
    rng = site.rng_for("rim")
    plates, steel = [], []
    for k in range(15):
        a = 2 * np.pi * k / 15 + float(rng.uniform(-0.12, 0.12))
        r = radius_m * float(rng.uniform(0.98, 1.22))
        x, y = at[0] + r * float(np.cos(a)), at[1] + r * float(np.sin(a))
        size = (float(rng.uniform(1.2, 2.3)), float(rng.uniform(1.0, 1.9)))
        top = (x, y, site.ground_z(x, y) + 0.4)
        tilt = (float(rng.uniform(-9, 9)), -float(rng.uniform(20, 42)))
        plates.append(tilted_plate(size, 0.2, top, tilt, float(np.degrees(a)), rng))
        steel.append(bars((x, y), top[2] - 0.1, float(np.degrees(a)) + float(rng.uniform(-40, 40)), rng, 1.3))
        site.occupy(disc(x, y, 0.9, 8))
    site.add("crater_rim", "crater_rim", [("concrete", merge(plates)), ("rust", merge(steel))])


@site_builder
def torn_yard_wall(
    site: Site, *, runs: list[tuple[At, At]], hole: Bite, brick: Material, height_m: Number = 2.8
) -> None:
    """Put up a wall of straight runs about a yard, with a hole whose heights count from the ground."""
    parts: Parts = []
    for k, (a, b) in enumerate(runs):
        low = min(site.ground_z(*a), site.ground_z(*b))
        face = rectangle(0, low - 0.6, leg(a, b)[0], max(site.ground_z(*a), site.ground_z(*b)) + height_m)
        tear = replace(hole, z0_m=low + hole.z0_m, z1_m=low + hole.z1_m)
        parts.append((brick, torn_wall(a, b, face, (tear,), site.rng_for("wall", k), (), 0.32)))
    site.add("yard_wall", "yard_wall", parts)
    for a, b in runs:
        site.occupy(rectangle(a[0] - 0.4, a[1] - 0.4, b[0] + 0.4, b[1] + 0.4).buffer(0.01))


@site_builder
def step_walls(site: Site, *, y: Number, spans: list[tuple[Number, Number]]) -> None:
    """Put up retaining walls along x at a step of the ground that falls to the south; between them it is open."""
    parts: Parts = []
    for x0, x1 in spans:
        low, high = site.ground_z((x0 + x1) / 2, y - 1.5), site.ground_z((x0 + x1) / 2, y + 1.5)
        face = rectangle(0, low - 0.5, x1 - x0, high + 0.5)
        wall = torn_wall((x0, y - 0.35), (x1, y - 0.35), face, (), site.rng_for("kerb"), (), 0.35)
        parts.append(("concrete", wall))
        site.occupy(rectangle(x0, y - 1.0, x1, y + 0.4))
    site.add("retaining_wall", "retaining_wall", parts)


@site_builder
def bent_lamps(site: Site, *, feet: Annotated[list[At], Field(min_length=1)], blast: At) -> None:
    """Put up street lamps that a blast bent away from it, the more the nearer they stand."""
    bodies, heads = [], []
    for x, y in feet:
        away = np.array([x - blast[0], y - blast[1]])
        d = float(np.hypot(*away))
        lean = 5.5 * math.exp(-((d / 12.0) ** 2))
        u = away / max(d, 0.1)
        z = site.ground_z(x, y) - 0.2
        path = [(x, y, z), (x + 0.1 * lean * u[0], y + 0.1 * lean * u[1], z + 3.0),
                (x + 0.55 * lean * u[0], y + 0.55 * lean * u[1], z + 6.2 - 0.3 * lean),
                (x + (lean + 0.4) * u[0], y + (lean + 0.4) * u[1], z + 7.4 - 0.75 * lean)]  # fmt: skip
        bodies.append(sweep(path=path, radius=0.09, sides=6))
        end = path[-1]
        arm = [end, (end[0] + 0.7 * u[0], end[1] + 0.7 * u[1], end[2] - 0.1)]
        heads.append(sweep(path=arm, section=(0.3, 0.14)))
        site.occupy(disc(x, y, 0.4, 8))
    site.add("bent_lamps", "bent_lamps", [("#4a5055", merge(bodies)), ("#c9cdc8", merge(heads))])


@site_builder
def burst_main(site: Site, *, at: At) -> None:
    """Lay the two ends of a burst water main bare in a crater."""
    z = site.ground_z(*at) + 0.9
    main = []
    for side in (-1, 1):
        path = [(at[0] + side * 5.6, at[1] + 0.6, z), (at[0] + side * 2.2, at[1] + 0.4, z - 0.1),
                (at[0] + side * 1.5, at[1] + 0.2, z + 0.35 * side)]  # fmt: skip
        main.append(sweep(path=path, radius=0.32, sides=10))
    site.add("water_main", "water_main", [("rust", merge(main))])
