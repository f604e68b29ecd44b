"""An industrial yard after an explosion: crater, torn factory, bent hall, burst tank, broken pipe bridge.

The blast was in the middle; south of the yard lies a lower one, a retaining wall between them.
"""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_streets import parking_row
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.layouts.disaster.explosion.industry import (
    Hall,
    burst_tank,
    pipe_bridge,
    steel_hall,
    twisted_steel,
)
from aerialdojo_gen.scenes.layouts.disaster.explosion.yard_things import furnish_yard
from aerialdojo_gen.scenes.layouts.disaster.parts.buildings import put_up
from aerialdojo_gen.scenes.layouts.disaster.parts.ground import crater, faulted, heaped, strew_chunks
from aerialdojo_gen.scenes.layouts.disaster.parts.wreckage import Bite, Parts, bars, tilted_plate, torn_wall
from aerialdojo_gen.scenes.layouts.disaster.parts.wrecks import Style, Wreck
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, rolling_terrain

BLAST = (1.0, -2.0)
_STEP_Y = -14.5
_BRIDGE_M = 5.4


def build_yard(site: Site, crater_m: float, litter: float) -> None:
    """Build the yard and what the blast left of it."""
    factory, gate = _wrecks(site)
    heaps = [
        (blob(-1.5, 10.5, 6.0, 5, 0.3), 2.3),
        (blob(-22.0, 7.0, 3.6, 6, 0.3), 1.3),
        (blob(-12.0, -12.0, 3.5, 7, 0.35), 1.1),
    ]
    ground = rolling_terrain(site.recipe.size_m, 1.4, site.recipe.seed, 0.3, 26.0, octaves=2)
    ground = faulted(ground, [(-60.0, _STEP_Y), (60.0, _STEP_Y)], 1.9, 0.6)
    for wreck in (factory, gate):
        ground = ground.flattened(wreck.frame.area(wreck.plan), blend_m=2.5)
    ground = ground.flattened(rectangle(16.5, -13.0, 32.5, 16.0), blend_m=2.0)
    ground = crater(ground, *BLAST, crater_m, 3.4, 1.1, site.recipe.seed)
    for k, (area, height) in enumerate(heaps):
        ground = heaped(ground, area, height, k)
    _paint(site, ground, crater_m, heaps)
    bases = [site.ground_z(w.frame.x, w.frame.y) for w in (factory, gate)]
    put_up(site, factory, bases[0], node="torn_factory")
    put_up(site, gate, bases[1], node="gatehouse")
    hall = Hall(
        Frame(24.5, 1.0, -90.0),
        28.0,
        14.0,
        7.2,
        9.4,
        (1.0, -17.0),
        15.0,
        gallery_m=3.9,
        cladding=site.material("cladding", "corrugated:#7d8f96"),
    )
    hall_base = site.ground_z(24.5, 1.0)
    steel_hall(site, hall, hall_base, "wrecked_hall")
    burst_tank(site, -15.5, -22.0, 4.4, 7.0, BLAST, "burst_tank", site.material("tank", "sheet_metal:#c9cdc8"))
    walkway = site.ground_z(-18.5, 0.0) + _BRIDGE_M
    pipe_bridge(site, (-18.5, 13.4), (-18.5, -17.0), walkway, (0.47, 0.63), "pipe_bridge")
    _walls(site)
    _rim(site, crater_m)
    furnish_yard(site, BLAST, factory, gate, bases, hall_base, walkway)
    twisted_steel(
        site,
        [
            (12.0, 2.5, 4.5),
            (11.0, -7.0, 5.0),
            (-9.0, 3.0, 3.6),
            (6.0, 9.0, 4.0),
            (15.0, -4.0, 3.4),
            (-6.5, -9.5, 4.2),
        ],
        "yard",
    )
    for k, (area, _) in enumerate(heaps):
        strew_chunks(
            site, area.buffer(2.0), 0.95 / litter, f"heap{k}", brick=site.material("factory", "brick:#8a4f3f")
        )
    brick, asphalt = site.material("factory", "brick:#8a4f3f"), "asphalt:#46474a"
    strew_chunks(site, disc(*BLAST, 13.0), 1.25 / litter, "ejecta", plate=asphalt, lump="dirt:#5d4a38", brick=brick)
    strew_chunks(site, site.extent.buffer(-2.0), 3.6 / litter, "far", plate=asphalt, brick=brick, size_m=(0.3, 0.8))


def _wrecks(site: Site) -> tuple[Wreck, Wreck]:
    style = Style(
        wall=site.material("factory", "brick:#8a4f3f"),
        band="stone",
        storey_m=3.9,
        bay_m=3.7,
        window_m=(2.3, 0.9, 3.1),
        wall_m=0.4,
        panes=0.12,
        soot=0.55,
        inner=("plaster:#c3cdbd", "plaster:#cfc6b0", "plaster:#b7c1c8", "tiles:#d5d9d2"),
    )
    small = Style(
        wall=site.material("gatehouse", "plaster:#c8b58c"), storey_m=3.2, panes=0.1, soot=0.3, roof="gravel"
    )
    factory = Wreck(
        Frame(-3.0, 20.0),
        34.0,
        12.0,
        4,
        style,
        (Bite(3.5, -7.5, 5.5, 9.5, seed=31), Bite(17.0, -4.0, 0.8, 5.0, 8.5, seed=32)),
    )
    gate = Wreck(Frame(-29.5, 2.0, 90.0), 13.0, 8.0, 2, small, (Bite(5.5, -4.5, 2.5, 4.0, seed=36),))
    return factory, gate


def _paint(site: Site, ground: Terrain, crater_m: float, heaps: list[tuple[Polygon, float]]) -> None:
    site.set_ground(ground, site.material("verge", "meadow:#7d7f58"))
    seed = site.recipe.seed
    site.paint(rectangle(-34.0, -31.0, 34.5, 27.0), site.material("yard", "concrete:#a39d92"))
    site.paint(rectangle(-13.0, -31.0, 34.5, 12.5), "asphalt:#5c5d60")
    site.paint(rectangle(16.8, -12.6, 32.2, 15.4), "concrete:#8f8b84")
    for k in range(6):
        site.paint(
            rectangle(-13.0, -15.6, 34.5, -15.3).intersection(rectangle(-13 + 8 * k, -16, -8 + 8 * k, -15)),
            "marking_yellow",
        )
    parking_row(site, 8.0, -30.6, -90.0, 8)
    site.paint(blob(*BLAST, crater_m * 2.5, seed, 0.4), "asphalt:#3f3f40")
    rng = site.rng_for("rays")
    rays = []
    for _ in range(26):
        a, r = float(rng.uniform(0, 2 * np.pi)), crater_m * float(rng.uniform(2.0, 3.6))
        w = float(rng.uniform(0.05, 0.14))
        points = [
            (BLAST[0] + q * float(np.cos(b)), BLAST[1] + q * float(np.sin(b)))
            for q, b in ((crater_m, a - w), (r, a), (crater_m, a + w))
        ]
        rays.append(Polygon(points))
    site.paint(unary_union(rays), "asphalt:#333335")
    site.paint(blob(*BLAST, crater_m * 1.75, seed + 1, 0.35), "dirt:#5d4a38")
    site.paint(blob(*BLAST, crater_m * 1.02, seed + 2, 0.15), "dirt:#483a2e")
    site.paint(blob(*BLAST, crater_m * 0.45, seed + 3, 0.2), "#2c2622")
    for area, _ in heaps:
        site.paint(area, site.material("heap", "rubble:#a08a7c"))


def _walls(site: Site) -> None:
    brick = site.material("wall", "brick:#94604e")
    parts: Parts = []
    runs = [
        ((-35.0, -31.8), (-6.0, -31.8)),
        ((6.0, -31.8), (35.0, -31.8)),
        ((35.0, -31.8), (35.0, 29.0)),
        ((35.0, 29.0), (16.0, 29.0)),
        ((-22.0, 29.0), (-35.0, 29.0)),
        ((-35.0, 29.0), (-35.0, 10.0)),
        ((-35.0, -6.0), (-35.0, -31.8)),
    ]
    hole = Bite(22.0, -32.0, 2.6, 3.6, 0.0, 3.0, seed=41)
    for k, (a, b) in enumerate(runs):
        low = min(site.ground_z(*a), site.ground_z(*b))
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        top = max(site.ground_z(*a), site.ground_z(*b)) + 2.8
        face = Polygon([(0, low - 0.6), (length, low - 0.6), (length, top), (0, top)])
        tear = Bite(hole.x, hole.y, hole.foot_m, hole.head_m, low + 0.2, low + 3.0, hole.seed)
        body = torn_wall(a, b, face, (tear,), site.rng_for("wall", k), (), 0.32)
        if body is not None:
            parts.append((brick, body))
    site.add("yard_wall", "yard_wall", parts)
    for a, b in runs:
        site.occupy(
            Polygon(
                [
                    (a[0] - 0.4, a[1] - 0.4),
                    (b[0] + 0.4, a[1] - 0.4),
                    (b[0] + 0.4, b[1] + 0.4),
                    (a[0] - 0.4, b[1] + 0.4),
                ]
            ).buffer(0.01)
        )
    kerb: Parts = []
    for x0, x1 in ((-34.6, -20.5), (-16.5, 2.0), (8.0, 34.6)):
        low, high = site.ground_z((x0 + x1) / 2, _STEP_Y - 1.5), site.ground_z((x0 + x1) / 2, _STEP_Y + 1.5)
        face = Polygon([(0, low - 0.5), (x1 - x0, low - 0.5), (x1 - x0, high + 0.5), (0, high + 0.5)])
        body = torn_wall((x0, _STEP_Y - 0.35), (x1, _STEP_Y - 0.35), face, (), site.rng_for("kerb"), (), 0.35)
        if body is not None:
            kerb.append(("concrete", body))
        site.occupy(rectangle(x0, _STEP_Y - 1.0, x1, _STEP_Y + 0.4))
    site.add("retaining_wall", "retaining_wall", kerb)


def _rim(site: Site, crater_m: float) -> None:
    """Stand the slabs of the broken pavement up around the crater."""
    rng = site.rng_for("rim")
    plates, steel = [], []
    for k in range(15):
        a = 2 * np.pi * k / 15 + float(rng.uniform(-0.12, 0.12))
        r = crater_m * float(rng.uniform(0.98, 1.22))
        x, y = BLAST[0] + r * float(np.cos(a)), BLAST[1] + r * float(np.sin(a))
        size = (float(rng.uniform(1.2, 2.3)), float(rng.uniform(1.0, 1.9)))
        at = (x, y, site.ground_z(x, y) + 0.4)
        plates.append(
            tilted_plate(
                size, 0.2, at, (float(rng.uniform(-9, 9)), -float(rng.uniform(20, 42))), float(np.degrees(a)), rng
            )
        )
        steel.append(bars((x, y), at[2] - 0.1, float(np.degrees(a)) + float(rng.uniform(-40, 40)), rng, 1.3))
        site.occupy(disc(x, y, 0.9, 8))
    site.add("crater_rim", "crater_rim", [("concrete", merge(plates)), ("rust", merge(steel))])
