"""How planning time grows: with the number of candidates, with the volume of the scene, and over whole scenes.

    python tests/bench/bench_growth.py [--data data] [--scenes U_Mall_0 N_Forest_0 ...]

Times are CPU seconds of this process, medians of three. Over whole scenes `plan` is run once each, its clearance grid
included (these need the tables up to `pairs`), and seconds are compared with a model that has two factors: one for a
goal and a million cells, for the cost-to-go, and one for an expansion of the search.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from bench_planner import RADIUS, free_pose, world
from common import PIPELINE, cpu_s, job_of, median_s, options_of

from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.pipeline.stages.work import plan
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.planner import Planner

SCENES = ["U_Mall_0", "I_Harbor_0", "N_Forest_0", "N_Mountain_0", "U_Park_1", "D_Flood_0"]
DENSITY = 250 / 120**2  # things a square metre


def planner_of(edge: float) -> Planner:
    planner = Planner(world(round(DENSITY * edge**2), edge), PlanConfig(), RADIUS)
    middle = edge / 2
    planner.plan_target((middle, middle, 22, 0), [(middle - 5, middle, 22, 0)])
    return planner


def whole_scenes(data: Path, scenes: list[str]) -> None:
    """Plan scenes, and fit the model."""
    rows = []
    for name in scenes:
        job = job_of("plan", name, data)
        scene = job.scene_model()
        took, made = cpu_s(plan.run, job, PIPELINE.plan)
        cells = ClearanceGrid.of(scene, PIPELINE.plan.cell_m, RADIUS).arrays.field.size
        goals = len(np.unique(job.read("pairs")["target_object_id"].to_numpy()))
        expansions = np.nan_to_num(made.tables["plans"]["expansions"].to_numpy().astype(float)).sum()
        rows.append((took, goals * cells / 1e6, expansions / 1e6))
    took, *causes = np.array(rows).T
    # Relative errors count, so that small scenes do.
    factors = np.linalg.lstsq(np.column_stack(causes) / took[:, None], np.ones(len(took)), rcond=None)[0]
    print(f"whole scenes: {1e3 * factors[0]:.1f} ms a goal and million cells, {factors[1]:.1f} µs an expansion")
    print(f"{'scene':>22}{'seconds':>10}{'goals x Mcells':>16}{'M expansions':>14}{'model / s':>11}")
    for name, row in zip(scenes, rows, strict=True):
        model = factors[0] * row[1] + factors[1] * row[2]
        print(f"{name:>22}{row[0]:>10.2f}{row[1]:>16.1f}{row[2]:>14.2f}{model / row[0]:>11.2f}")


def main() -> None:
    options = options_of(__doc__, data=Path("data"), scenes=SCENES)
    print("candidates: 120 x 120 x 25 m, one target, starts within 70 m")
    print(f"{'starts':>10}{'seconds':>10}{'ms a candidate':>18}{'ms more a candidate':>22}")
    planner, rng = planner_of(120.0), np.random.default_rng(1)
    goal = free_pose(planner, rng)
    starts = np.array([free_pose(planner, rng, goal, 70.0) for _ in range(640)])
    before = None
    for n in (40, 160, 640):
        took = median_s(lambda n=n: planner.plan_target(goal, starts[:n]))
        more = "" if before is None else f"{1e3 * (took - before[1]) / (n - before[0]):.2f}"
        print(f"{n:>10}{took:>10.3f}{1e3 * took / n:>18.2f}{more:>22}")
        before = (n, took)
    print("volume: 25 m high, as many things a square metre, 40 starts within 70 m")
    print(f"{'edge':>10}{'1000 m3':>10}{'build s':>10}{'cost-to-go s':>14}{'s / Mm3':>10}{'ms a search':>13}")
    for edge in (60.0, 120.0, 240.0):
        built = median_s(lambda edge=edge: planner_of(edge))
        planner, rng = planner_of(edge), np.random.default_rng(2)
        goal = np.array([edge / 2, edge / 2, 22.0, 0.0])
        starts = np.array([free_pose(planner, rng, goal, 70.0) for _ in range(40)])
        field = median_s(lambda planner=planner, goal=goal: planner._expand(goal))
        whole = median_s(lambda planner=planner, goal=goal, starts=starts: planner.plan_target(goal, starts))
        volume = edge**2 * 25
        print(
            f"{edge:>10.0f}{volume / 1e3:>10.0f}{built:>10.2f}{field:>14.3f}{1e6 * (built + field) / volume:>10.2f}"
            f"{1e3 * (whole - field) / len(starts):>13.2f}"
        )
    if all((options.data / "pairs" / name).is_dir() for name in options.scenes):
        whole_scenes(options.data, options.scenes)
    else:
        print(f"whole scenes: {options.data} has no pairs of them")


if __name__ == "__main__":
    main()
