"""How planning time grows: with the number of candidates, and with the volume of the scene.

    python tests/bench/bench_growth.py

Times are CPU seconds of this process, medians of three.
"""

from __future__ import annotations

import numpy as np
from bench_planner import RADIUS, free_pose, world
from common import median_s

from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.planning.planner import Planner

DENSITY = 250 / 120**2  # things a square metre


def planner_of(edge: float) -> Planner:
    planner = Planner(world(round(DENSITY * edge**2), edge), PlanConfig(), RADIUS)
    middle = edge / 2
    planner.plan_target((middle, middle, 22, 0), [(middle - 5, middle, 22, 0)])
    return planner


def main() -> None:
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


if __name__ == "__main__":
    main()
