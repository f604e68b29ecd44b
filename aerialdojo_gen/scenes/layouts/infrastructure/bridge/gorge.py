"""A steel arch bridge over a rocky gorge: twin ribs under a narrow road, a stream and a camp far below.

The road lies at z = 0, the stream `GORGE_M` below; the gorge runs along y.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from shapely.geometry import Polygon

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.kit.structures import Parts, block, letters, railing
from aerialdojo_gen.scenes.layouts.infrastructure.bridge.decks import Deck, approach
from aerialdojo_gen.scenes.layouts.infrastructure.bridge.gorge_things import furnish_gorge
from aerialdojo_gen.scenes.mesh import Floats, Mesh, merge
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, mound, rolling_terrain

GORGE_M = 20.0
_HALF_M = 24.0
_RIBS = (-2.7, 2.7)
_SPRING = (19.5, -11.5)
_CROWN_M = -1.5


def build_gorge(site: Site) -> None:
    """Build the bridge, the gorge and what stands about them."""
    site.set_ground(_terrain(site), site.material("moor", "grass:#8a8f4e"))
    _paint(site)
    _bridge(site)
    _arch(site)
    _viewpoint(site)
    furnish_gorge(site, stream_x)


def stream_x(y: float) -> float:
    """Where the stream runs, metres east, at a northing in metres."""
    return 3.2 * float(np.sin(y / 11.0))


def _terrain(site: Site) -> Terrain:
    t = rolling_terrain(site.recipe.size_m, 1.25, site.recipe.seed, 1.5, 34.0)
    t = mound(t, (-48.0, 20.0), 24.0, 4.0)
    t = mound(t, (48.0, -20.0), 22.0, 4.5)
    t = mound(t, (38.0, 38.0), 20.0, 3.0)
    t = t.flattened(rectangle(-58, -6.0, 58, 6.0), 0.0, 6.0)
    t = t.flattened(rectangle(-44, -18.0, -27, 16.0), 0.0, 5.0)
    t = t.flattened(rectangle(27, -14.0, 44, 18.0), 0.0, 5.0)
    for x0, y0 in ((48.0, -19.0), (-48.0, 19.0)):
        t = t.flattened(rectangle(x0 - 3.0, y0 - 3.0, x0 + 3.0, y0 + 3.0), blend_m=4.0)
    xy = t.corners().reshape(*t.heights_m.shape, 3)
    x, y = xy[..., 0], xy[..., 1]
    rough = OpenSimplex(seed=site.recipe.seed + 5).noise2array(x[0] / 7.0, y[:, 0] / 7.0)
    ledge = OpenSimplex(seed=site.recipe.seed + 6).noise2array(x[0] / 15.0, y[:, 0] / 12.0)
    # Near the bridge the rock is sound: the arch's feet stand in it.
    wild = np.clip((np.abs(y) - 5.0) / 6.0, 0.0, 1.0)
    away = np.abs(x - 3.2 * np.sin(y / 11.0) * wild) + wild * (1.6 * rough + 2.2 * ledge)
    # Two steep faces with a ledge between them, then the floor.
    drop = 0.56 * _smooth((_HALF_M - away) / 4.6) + 0.44 * _smooth((16.5 - away) / 5.5)
    bed = 0.7 * _smooth((4.0 - np.abs(x - 3.2 * np.sin(y / 11.0))) / 1.6)
    scree = wild * np.clip(drop, 0.0, 1.0) * (1.0 - drop) * 3.0 * rough
    floor = 0.5 * rough * wild * _smooth((np.abs(x - 3.2 * np.sin(y / 11.0)) - 5.0) / 3.0)
    return replace(t, heights_m=t.heights_m * (1.0 - drop) - (GORGE_M - floor) * drop - bed + scree)


def _smooth(t: Floats) -> Floats:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _paint(site: Site) -> None:
    half = site.recipe.size_m[1] / 2
    ys = [float(y) for y in np.arange(-half, half + 1.0, 2.5)]
    edge = [_HALF_M + 1.2 + 1.3 * float(np.sin(y * 0.9) + np.sin(y * 0.37 + 1.0)) for y in ys]
    rims = [
        [(s * (e if s > 0 else edge[-1 - k]), y) for k, (e, y) in enumerate(zip(edge, ys, strict=True))]
        for s in (-1, 1)
    ]
    walls = Polygon([*rims[0], *rims[1][::-1]])
    site.paint(walls, site.material("rock", "rock:#9a8d7c"))
    stream = [(stream_x(y), y) for y in ys]
    site.paint(ribbon(stream, 15.0), "gravel:#a89c88")
    site.paint(ribbon(stream, 5.4), site.material("stream", "water:#5b94a0"))
    approach(site, -56.0, -28.4, 3.2, 4.6)
    approach(site, 28.4, 56.0, 3.2, 4.6)
    site.paint(rectangle(-44, -16, -29, -5.2), "gravel:#a39a86")
    site.paint(rectangle(29.5, 5.2, 43, 17), "gravel:#b0a284")
    path = [(36.0, 16.0), (40.0, 26.0), (34.0, 36.0), (30.0, 44.0)]
    site.paint(ribbon(path, 1.8, round_ends=True), "dirt:#9a7f5c")


def _bridge(site: Site) -> None:
    steel = site.material("steel", "#8f4034")
    deck = Deck(-28.6, 28.6, 3.2, 4.6, depth_m=0.8, girder=steel, girders=_RIBS, girder_m=1.1)
    gaps = [(9.6, 15.4, 1), (-13.4, -7.6, -1)]
    site.add("bridge_deck", "bridge_deck", [*deck.parts(), *deck.parapets(steel, gaps, pane="iron")])
    stone = site.material("abutment", "blocks:#8d8272")
    parts: Parts = []
    for s in (-1, 1):
        x0, x1 = sorted((s * 23.2, s * 28.8))
        parts.append((stone, block(x0, -4.3, x1, 4.3, -16.0, -1.12)))
        for y in (-4.9, 4.9):
            parts.append((stone, block(x0 + 0.6, y - 0.65, x1 - 0.6, y + 0.65, -14.0, 2.4)))
            parts.append(("concrete:#bcb2a2", block(x0 + 0.4, y - 0.85, x1 - 0.4, y + 0.85, 2.4, 2.75)))
        a, b = sorted((s * (_SPRING[0] - 0.8), s * (_SPRING[0] + 5.0)))
        parts.append((stone, block(a, -4.0, b, 4.0, -17.0, _SPRING[1] - 0.4)))
    site.add("abutments", "abutment", parts, {"material": "stone"})


def _rib(x: float, lift_m: float = 0.0) -> float:
    rise = _CROWN_M - _SPRING[1]
    return _CROWN_M - rise * (x / _SPRING[0]) ** 2 + lift_m


def _arch(site: Site) -> None:
    """Build the twin ribs as trusses, the columns on them, and the bracing between them."""
    steel = site.material("steel", "#8f4034")
    xs = np.linspace(-_SPRING[0], _SPRING[0], 15)
    bodies: list[Mesh] = []
    depth = [0.9 + 1.5 * (abs(float(x)) / _SPRING[0]) ** 2 for x in xs]
    for y in _RIBS:
        upper = [(float(x), y, _rib(float(x))) for x in xs]
        lower = [(float(x), y, _rib(float(x)) - d) for x, d in zip(xs, depth, strict=True)]
        bodies += [sweep(path=upper, section=(0.45, 0.35)), sweep(path=lower, section=(0.45, 0.35))]
        for k in range(len(xs)):
            bodies.append(_bar(upper[k], lower[k], 0.16))
            if k + 1 < len(xs):
                a, b = (upper[k], lower[k + 1]) if xs[k] < -0.1 else (lower[k], upper[k + 1])
                bodies.append(_bar(a, b, 0.14))
        for x, _, z in upper:
            if z < -2.2:
                bodies.append(block(x - 0.17, y - 0.17, x + 0.17, y + 0.17, z, -1.05))
    for k, x in enumerate(float(v) for v in xs):
        low, high = _RIBS
        bodies.append(_bar((x, low, _rib(x)), (x, high, _rib(x)), 0.2))
        if k + 1 < len(xs):
            nxt = float(xs[k + 1])
            here, there = (low, high) if k % 2 else (high, low)
            bodies.append(_bar((x, here, _rib(x)), (nxt, there, _rib(nxt)), 0.14))
        if _rib(x) < -4.5:
            bodies.append(_bar((x, low, _rib(x)), (x, high, -1.2), 0.12))
            bodies.append(_bar((x, high, _rib(x)), (x, low, -1.2), 0.12))
    site.add("bridge_arch", "bridge_arch", [(steel, merge(bodies))], {"material": "steel"})


def _bar(a: tuple[float, float, float], b: tuple[float, float, float], thick_m: float) -> Mesh:
    return sweep(path=[a, b], section=(thick_m, thick_m))


def _viewpoint(site: Site) -> None:
    """Build a railed platform out over the east rim, a toll house at the west end, and rails along the rims."""
    z = 0.1
    frame = "#4a4f4c"
    deck: Parts = [
        ("boards:#8f7a5c", block(20.0, 8.6, 30.0, 14.4, z - 0.15, z)),
        (frame, merge([block(20.0, y - 0.12, 30.5, y + 0.12, z - 0.5, z - 0.15) for y in (8.9, 14.1)])),
        (
            frame,
            merge([sweep(path=[(20.4, y, z - 0.4), (26.6, y, -5.0)], section=(0.22, 0.22)) for y in (8.9, 14.1)]),
        ),
    ]
    deck += railing([(30.0, 14.3), (20.1, 14.3), (20.1, 8.7), (30.0, 8.7)], z, pane="glass", frame=frame)
    site.add("viewing_platform", "viewing_platform", deck)
    wall, roof = "blocks:#a59880", "shingles:#5a5a5e"
    house: Parts = [("marking", letters("OLD TOLL HOUSE", 0.42, (-37.0, -7.98, 2.9), 90.0, 0.05)),
                    ("#6a3f34", block(-37.7, -8.1, -36.3, -7.9, 0.0, 2.3))]  # fmt: skip
    for x in (-39.6, -34.4):
        house.append(("window", block(x - 0.6, -8.06, x + 0.6, -7.9, 0.9, 2.3)))
        house.append(("#efe8d8", block(x - 0.8, -8.1, x + 0.8, -7.85, 0.75, 0.9)))
    building(site, rectangle(-41.5, -14.5, -32.5, -8.0), wall=wall, roof=roof, storeys=1, storey_m=3.5,
             roof_kind="gable", roof_m=2.8, z=0.0, category="toll_house", extra=house)  # fmt: skip
    for y0, y1 in ((-40.0, -22.0), (18.0, 40.0)):
        path = [(-28.5, float(y)) for y in np.linspace(y0, y1, 6)]
        posts = [
            block(x - 0.06, y - 0.06, x + 0.06, y + 0.06, site.ground_z(x, y) - 0.4, site.ground_z(x, y) + 1.1)
            for x, y in path
        ]
        rails = [
            sweep(path=[(x, y, site.ground_z(x, y) + h) for x, y in path], section=(0.06, 0.1)) for h in (0.5, 1.0)
        ]
        site.add(None, "rim_fence", [("wood", merge([*posts, *rails]))])
