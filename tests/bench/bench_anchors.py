"""Is the shortlist worth it? What the selected anchor shows of its object, a random valid one and the nearest one.

    python tests/bench/bench_anchors.py [--data data] [--scene U_Mall_0 …]

Valid is every candidate that is free and reachable and sees at least the least that anchors must see; the nearest is
the one closest to the object's centroid. *Visible* is the share of what faces the viewpoint that nothing hides;
*told* the share of the whole object, seen from anywhere, that the picture shows; *in the picture* the share of the
pixels; *directions* the smallest azimuth between two of the three anchors. Needs the tables up to `anchors`.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path

import numpy as np

from aerialdojo_gen.common.rng import generator
from aerialdojo_gen.config.pipeline import load_pipeline
from aerialdojo_gen.pipeline.stage import Job, Roots
from aerialdojo_gen.stages.work.anchor_sample import candidates_of
from aerialdojo_gen.stages.work.anchor_world import World
from aerialdojo_gen.store import shards as store

ROOT = Path(__file__).resolve().parents[2]
WHO = ("selected", "random", "nearest")


def measures(found, k, picture_px):
    view = found.picture(int(k), picture_px, 90.0)
    return [found.views.visible_fraction[k], found.views.shown[k], view.visible.mean()]


def scene_figures(name, data, pipeline):
    """(objects, 3 anchors, 3 measures), and the smallest angle between an object's anchors, degrees."""
    config = pipeline.anchor_sample
    roots = Roots(data, ROOT / "scene_assets", ROOT / "scene_assets/scenes", ROOT / "annotations")
    job = Job("anchor-sample", name, 0, 1, pipeline.seed, pipeline.embodiment, roots)
    world = World.of(job.scene_model(), pipeline.embodiment.radius_m, config.margin_m)
    anchors = job.read("anchors").to_pylist()
    figures, angles = [], []
    for item in job.read("objects").to_pylist():
        own = [a for a in anchors if a["object_id"] == item["object_id"]]
        found, _ = candidates_of(item, world, job, config)
        valid = found.seeing(config.min_visible_fraction)
        best = np.array([next([a["x_m"], a["y_m"], a["z_m"]] for a in own if a["selected"])])
        centroid = world.scene.instances[found.instance].centroid
        away = np.linalg.norm(found.positions_m - centroid, axis=1)
        chosen = (
            np.argmin(np.linalg.norm(found.positions_m - best, axis=1)),
            generator(0, "bench-anchors", name, item["object_id"]).choice(valid),
            valid[np.argmin(away[valid])],
        )
        figures.append([measures(found, k, config.picture_px) for k in chosen])
        turn = sorted(math.atan2(a["y_m"] - centroid[1], a["x_m"] - centroid[0]) for a in own)
        if len(turn) > 1:
            gaps = np.diff([*turn, turn[0] + 2 * math.pi])
            angles.append(math.degrees(min(min(g, 2 * math.pi - g) for g in gaps)))
    return np.array(figures), angles


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=ROOT / "data")
    parser.add_argument("--scene", nargs="*", default=[])
    options = parser.parse_args()
    pipeline = load_pipeline(ROOT / "pipelines/aerialdojo-200k.toml")
    scenes = options.scene or sorted(p.name for p in (options.data / "anchors").glob("*_*"))
    if not scenes:
        print(f"no anchors in {options.data}: make dataset first")
        return 0
    begun, figures, angles = time.process_time(), [], []
    for name in scenes:
        assert store.check_scene_name(name)
        part, turns = scene_figures(name, options.data, pipeline)
        figures.append(part)
        angles += turns
    table = np.concatenate(figures)
    print(f"{len(table):,} objects of {len(scenes)} scenes, {time.process_time() - begun:.0f} s of CPU time")
    print(f"{'anchor':10}{'visible':>10}{'all of it':>12}{'told':>8}{'in the picture':>18}")
    for k, who in enumerate(WHO):
        visible, told, share = table[:, k].T
        print(f"{who:10}{visible.mean():10.1%}{(visible > 0.99).mean():12.1%}{told.mean():8.1%}{share.mean():18.1%}")
    wins = (table[:, 0, 1] > table[:, 1, 1]).mean(), (table[:, 0, 1] < table[:, 1, 1]).mean()
    print(f"the selected one tells more than the random one of {wins[0]:.0%} of the objects, less of {wins[1]:.0%}")
    print(f"directions: 45° or more apart for {np.mean(np.array(angles) > 44.9):.1%} of the objects, "
          f"smallest {min(angles):.0f}°")  # fmt: skip
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
