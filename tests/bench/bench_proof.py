"""Does the clearance grid ever prove a segment free that FCL refuses? Millions of random ones close to surfaces.

    python tests/bench/bench_proof.py [--segments 2000000] [--scene U_Mall_0 …]

Segments begin 0.2 to 2 m from a random point of a scene's surface, are up to 5 m long, most of them short, and point
anywhere; a third are level and a third upright, as the action set's moves are. Exits with 1 if one proof is wrong.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.grid_kernels import segment_free
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue

RADIUS = 0.25
BATCH = 100_000
ASSETS = Path(__file__).resolve().parents[2] / "scene_assets"


@njit
def proven(p, q, radius, grid):
    free = np.empty(len(p), np.bool_)
    for i in range(len(p)):
        free[i] = segment_free(p[i, 0], p[i, 1], p[i, 2], q[i, 0], q[i, 1], q[i, 2], radius, grid, True)
    return free


def near_surfaces(corners, share, bounds, n, rng):
    """Random segments inside the flight volume: (n, 3) and (n, 3), metres."""
    a, b, c = np.moveaxis(corners[np.searchsorted(share, rng.random(n))], 1, 0)
    r, s = np.sqrt(rng.random((n, 1))), rng.random((n, 1))
    on = (1 - r) * a + r * (1 - s) * b + r * s * c
    low, high = bounds[0] + RADIUS, bounds[1] - RADIUS
    p = np.clip(on + unit(rng.normal(size=(n, 3))) * rng.uniform(0.2, 2.0, (n, 1)), low, high)
    way = rng.normal(size=(n, 3))
    way[: n // 3, 2] = 0.0
    way[n // 3 : 2 * n // 3, :2] = 0.0
    return p, np.clip(p + unit(way) * 5.0 * rng.random((n, 1)) ** 2, low, high)


def unit(v):
    return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--segments", type=int, default=2_000_000, help="a scene")
    parser.add_argument("--scene", nargs="+", default=["U_Mall_0", "N_Forest_0"])
    options = parser.parse_args()
    catalogue, bad = load_catalogue(ASSETS), 0
    for name in options.scene:
        scene = build_scene(ASSETS / "scenes" / f"{name}.toml", catalogue)
        grid, world = ClearanceGrid.build(scene), CollisionWorld(scene)
        corners = np.concatenate([i.vertices[i.faces] for i in scene.instances])
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        # Half by area, half by triangle: a scene's ground would have nearly all, its twigs and wires nothing.
        share = np.cumsum(area / area.sum() + 1 / len(area)) / 2
        rng = np.random.default_rng(0)
        n = free = wrong = 0
        clock = time.process_time()
        while n < options.segments:
            p, q = near_surfaces(corners, share / share[-1], scene.bounds, min(BATCH, options.segments - n), rng)
            sure = np.flatnonzero(proven(p, q, RADIUS, grid.arrays))
            refused = [i for i in sure if world.segment_in_collision(p[i], q[i], RADIUS)]
            for i in refused[:3]:
                print(f"WRONG: {p[i].tolist()} to {q[i].tolist()}")
            n, free, wrong = n + len(p), free + len(sure), wrong + len(refused)
        seconds = time.process_time() - clock
        print(f"{name}: {n:,} segments, {free:,} proven free ({free / n:.0%}), {wrong} wrong; {seconds:.0f} s CPU")
        bad += wrong
    return bool(bad)


if __name__ == "__main__":
    raise SystemExit(main())
