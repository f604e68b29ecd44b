"""Is the shortlist worth it? What the selected anchor shows of its object, a random valid one and the nearest one.

    python tests/bench/bench_anchors.py [--data data] [--scene U_Mall_0 …]

Valid is every candidate that is free and reachable and sees at least the least that anchors must see; the nearest is
the one closest to the object's centroid. From each the reference picture is taken as for a goal. *Seen* is the share
of the object's outline in it that nothing hides, *framed* the share of the object within its edges, *open* 1 less the
share that what stands nearer takes; *told* the share of the whole object, seen from anywhere, that the picture tells;
*parts* how well the parts are seen that make the name true, *front* the share of the objects with a front that are
seen from within 60° of it; *directions* the smallest azimuth between two of the three anchors. Needs the tables up to
`anchors`.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from common import PIPELINE, cpu_s, job_of, options_of

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.part_visibility import FRONT_RAD
from aerialdojo_gen.pipeline.scoring.geometric import judge
from aerialdojo_gen.pipeline.stages.work.anchor_pictures import CandidateViews
from aerialdojo_gen.pipeline.stages.work.anchor_sample import candidates_of
from aerialdojo_gen.pipeline.stages.work.anchor_world import World

WHO = ("selected", "random", "nearest")
MEASURES = ("seen", "framed", "open", "told", "parts", "front")


def measures(found, chosen, radius_m, config):
    looked = CandidateViews.of(found, np.array(chosen))
    for n in range(len(chosen)):
        view = looked.picture(n, config.picture_px)
        terms = judge(view, radius_m, config.standoff_m)
        off_front_rad = view.measures.off_front_rad
        front = None if off_front_rad is None else off_front_rad <= FRONT_RAD
        yield [terms.unoccluded, terms.framed, terms.open, terms.shown, terms.tells, front]


def scene_figures(name, data):
    """(objects, 3 anchors, measures), and the smallest angle between an object's anchors, degrees."""
    config, radius_m, job = PIPELINE.anchor_sample, PIPELINE.embodiment.radius_m, job_of("anchor-sample", name, data)
    world = World.of(job.scene_model(), radius_m, config.margin_m)
    anchors = job.read("anchors").to_pylist()
    figures, angles = [], []
    for item in job.read("objects").to_pylist():
        own = [a for a in anchors if a["object_id"] == item["object_id"]]
        found, *_ = candidates_of(item, world, job, config)
        valid = found.seeing(config.min_visible_fraction)
        best = np.array([next([a["x_m"], a["y_m"], a["z_m"]] for a in own if a["selected"])])
        centroid = world.scene.instances[found.instance].centroid
        away = np.linalg.norm(found.positions_m - centroid, axis=1)
        chosen = (
            np.argmin(np.linalg.norm(found.positions_m - best, axis=1)),
            generator(0, "bench-anchors", name, item["object_id"]).choice(valid),
            valid[np.argmin(away[valid])],
        )
        figures.append([*measures(found, chosen, radius_m, config)])
        turn = sorted(math.atan2(a["y_m"] - centroid[1], a["x_m"] - centroid[0]) for a in own)
        if len(turn) > 1:
            gaps = np.diff([*turn, turn[0] + 2 * math.pi])
            angles.append(math.degrees(min(min(g, 2 * math.pi - g) for g in gaps)))
    return np.array(figures, dtype=np.float64), angles


def main() -> int:
    options = options_of(__doc__, data=Path("data"), scene=[])
    scenes = options.scene or sorted(p.name for p in (options.data / "anchors").glob("*_*"))
    if not scenes:
        print(f"no anchors in {options.data}: make dataset first")
        return 0
    seconds, found = cpu_s(lambda: [scene_figures(name, options.data) for name in scenes])
    figures, angles = zip(*found, strict=True)
    table, turns = np.concatenate(figures), np.concatenate(angles)
    print(f"{len(table):,} objects of {len(scenes)} scenes, {seconds:.0f} s of CPU time")
    print(f"{'anchor':10}" + "".join(f"{measure:>9}" for measure in MEASURES))
    for k, who in enumerate(WHO):
        print(f"{who:10}" + "".join(f"{mean:9.1%}" for mean in np.nanmean(table[:, k], axis=0)))
    told = table[..., MEASURES.index("told")]
    wins = (told[:, 0] > told[:, 1]).mean(), (told[:, 0] < told[:, 1]).mean()
    print(f"the selected one tells more than the random one of {wins[0]:.0%} of the objects, less of {wins[1]:.0%}")
    print(f"directions: 45° or more apart for {np.mean(turns > 44.9):.1%} of the objects, "
          f"smallest {turns.min():.0f}°")  # fmt: skip
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
