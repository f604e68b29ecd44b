"""The planner beside OMPL's, in one run: the same FCL world, the same pairs, one core.

    python tests/bench/bench_ompl.py [--targets 2] [--starts 170] [--singles 40] [--rounds 3] [--some 40] [--slow 8]
        [--seconds 3]

`--starts` is of each target (the dataset has 174) and `--singles` the number of goals with a single start; (b) gets
`--some` pairs in a regime and (c) `--slow`, each with a limit of `--seconds`.

The worlds are a made-up one of boxes and trees with random pairs, and scenes of the dataset with their own
candidates (`--data data`; these need the tables up to `pairs`). Two regimes: single queries, with one start a goal,
where every query pays for its own goal; and as many starts a goal as the dataset has, which share what is known of
it. Times are CPU seconds of this process over the candidates searched, for every planner: those that are near
straight count for none. Single queries come in rounds with goals of their own, each with mean, median and 95th
percentile. What is made once a scene has a line of its own: the FCL world, which all planners ask, and
the clearance grid, which ours has besides.

(a) is this planner, its cost-to-go and certificates included; what it does not solve has no path within
`max_length_m`. For single queries it is `Planner.plan_one`, and below it `plan_target`, which finds the whole
cost-to-go. (b) is RRTConnect with path simplification, twice: with FCL's swept capsule for every motion, which is our
certificate's own check, and with OMPL's own motion check, a ball asked for every 0.1 m. (c) is RRT* with a time
limit, swept, and its time is the wall's. OMPL plans positions only, in a space whose distance is the action metric
(horizontal plus vertical), so that lengths compare; our routes are bound to the action set and to headings besides.
(BIT* cannot sample such a space; RRT* can.)
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from bench_planner import RADIUS, free_pose, world
from common import PIPELINE, T, cpu_s, job_of, options_of
from ompl import base, geometric, util

from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.pipeline.stages.work import plan
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.planner import Planner, Route
from aerialdojo_gen.scenes.model import Scene

SCENES = ("U_Mall_0", "N_Forest_0", "U_ConstructionSite_0")
SAMPLED_M = 0.1


@dataclass
class Case:
    """A scene, its planner, starts by goal, and pairs of goals of their own."""

    name: str
    scene: Scene
    planner: Planner
    groups: list[tuple[np.ndarray, np.ndarray]]
    singles: list[list[tuple[np.ndarray, np.ndarray]]]  # By round


def made_up(targets: int, starts: int, singles: int, rounds: int) -> Case:
    scene, rng = world(), np.random.default_rng(1)
    planner, groups = Planner(scene, PlanConfig(), RADIUS), []
    for k in range(targets + rounds * singles):
        goal = free_pose(planner, rng)
        # Not farther than a released task reaches.
        some = range(starts if k < targets else 1)
        groups.append((goal, np.array([free_pose(planner, rng, goal, 70.0) for _ in some])))
    alone = [(goal, start) for goal, (start,) in groups[targets:]]
    by_round = [alone[first : first + singles] for first in range(0, rounds * singles, singles)]
    return Case("made up", scene, planner, groups[:targets], by_round)


def of_dataset(scene_name: str, data: Path, targets: int, starts: int, singles: int, rounds: int) -> Case:
    job = job_of("plan", scene_name, data)
    scene, pairs = job.scene_model(), job.read("pairs").sort_by("pair_id")
    goals, begins = plan._ends(job, pairs)
    which, rng = pairs["target_object_id"].to_numpy(), np.random.default_rng(1)
    every, groups, by_round = np.unique(which), [], []
    for target in every[:: max(1, len(every) // targets)][:targets]:
        rows = np.flatnonzero(which == target)
        groups.append((goals[rows[0]], begins[rows[:: max(1, len(rows) // starts)][:starts]]))
    for _ in range(rounds):
        rows = [rng.choice(np.flatnonzero(which == target)) for target in rng.permutation(every)[:singles]]
        by_round.append([(goals[row], begins[row]) for row in rows])
    return Case(scene_name, scene, Planner(scene, PIPELINE.plan, RADIUS), groups, by_round)


class Swept(base.MotionValidator):
    """A motion is free if FCL's capsule along it is."""

    def __init__(self, information, blocked) -> None:
        super().__init__(information)
        self.blocked = blocked

    def checkMotion(self, a, b, *_) -> bool:
        return not self.blocked(position(a), position(b))


def position(state) -> tuple[float, float, float]:
    return state[0][0], state[0][1], state[1][0]


def setup(case: Case, swept: bool) -> geometric.SimpleSetup:
    low, high = np.asarray(case.scene.bounds)
    flat, upright = base.RealVectorStateSpace(2), base.RealVectorStateSpace(1)
    for space, axes in ((flat, (0, 1)), (upright, (2,))):
        bounds = base.RealVectorBounds(len(axes))
        for k, axis in enumerate(axes):
            bounds.setLow(k, low[axis] + RADIUS)
            bounds.setHigh(k, high[axis] - RADIUS)
        space.setBounds(bounds)
    space = base.CompoundStateSpace()
    space.addSubspace(flat, 1.0)
    space.addSubspace(upright, 1.0)
    simple = geometric.SimpleSetup(space)
    fcl = case.planner.world
    simple.setStateValidityChecker(lambda s: not fcl.sphere_in_collision(position(s), RADIUS))
    information = simple.getSpaceInformation()
    if swept:
        information.setMotionValidator(Swept(information, lambda p, q: fcl.segment_in_collision(p, q, RADIUS)))
    else:
        information.setStateValidityCheckingResolution(SAMPLED_M / space.getMaximumExtent())
    return simple


def solve(case: Case, make, start, goal, seconds: float, simplify: bool, swept: bool = True) -> float:
    """Length of OMPL's path in the action metric, metres; infinite where it finds none."""
    simple = setup(case, swept)
    simple.setPlanner(make(simple.getSpaceInformation()))
    if make is geometric.RRTstar:
        simple.setOptimizationObjective(base.PathLengthOptimizationObjective(simple.getSpaceInformation()))
    ends = []
    for pose in (start, goal):
        state = simple.getStateSpace().allocState()
        state[0][0], state[0][1], state[1][0] = pose[:3]
        ends.append(state)
    simple.setStartAndGoalStates(*ends)
    simple.solve(seconds)
    if not simple.haveExactSolutionPath():
        return float("inf")
    if simplify:
        simple.simplifySolution()
    points = np.array([position(s) for s in simple.getSolutionPath().getStates()])
    steps = np.diff(points, axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum() + np.abs(steps[:, 2]).sum())


def line(name: str, seconds: np.ndarray, lengths: np.ndarray, ours: np.ndarray, ours_s: float) -> None:
    """Print a planner's row; `seconds` are of each query, or one mean of queries that share what they need."""
    both = np.isfinite(lengths) & np.isfinite(ours)
    ratio, mean = (ours[both] / lengths[both]).mean(), seconds.mean()
    spread = [f"{1e3 * q:.1f}" for q in np.quantile(seconds, (0.5, 0.95))] if len(seconds) > 1 else ["", ""]
    print(
        f"  {name:<44}{1 / mean:>10.1f}{1e3 * mean:>9.1f}{spread[0]:>8}{spread[1]:>8}"
        f"{np.isfinite(lengths).mean():>9.1%}{ratio:>12.3f}{mean / ours_s:>9.1f}"
    )


def head(regime: str) -> None:
    print(regime)
    words = f"{'searched/s':>10}{'ms each':>9}{'median':>8}{'p95':>8}{'solved':>9}{'our L / its':>12}{'x ours':>9}"
    print(f"  {'':<44}{words}")


def lengths_of(routes: list[Route]) -> np.ndarray:
    return np.array([route.length_m if route.outcome == "SOLVED" else np.inf for route in routes])


def timed(call: Callable[..., T], queries: Iterable[tuple[Any, ...]]) -> tuple[np.ndarray, list[T]]:
    """CPU seconds of each query, and the results."""
    took, found = zip(*(cpu_s(call, *query) for query in queries), strict=True)
    return np.array(took), list(found)


def others(
    case: Case, pairs: list[tuple[np.ndarray, np.ndarray]], ours: np.ndarray, each_s: float, some: int
) -> None:
    """RRTConnect for some of the searched pairs, (goal, start), against our lengths and time."""
    few = np.linspace(0, len(pairs) - 1, min(some, len(pairs))).astype(int)
    ends = [pairs[k][::-1] for k in few]
    for name, swept in (("swept", True), (f"a ball every {SAMPLED_M:g} m", False)):
        took, found = timed(partial(solve, case, geometric.RRTConnect, seconds=3.0, simplify=True, swept=swept), ends)
        line(f"(b) RRTConnect, {name}", took, np.array(found), ours[few], each_s)


def scene_line(case: Case) -> None:
    config, shape = case.planner.config, " x ".join(map(str, case.planner.grid.moves.shape))
    how = {"cell_m": config.cell_m, "radius_m": RADIUS, "margin_m": config.margin_m, "cap_m": config.clearance_cap_m}
    t_world, _ = cpu_s(CollisionWorld, case.scene)
    t_grid, _ = cpu_s(lambda: ClearanceGrid.build(case.scene, **how))
    print(f"{case.name}: {case.scene.n_triangles} triangles")
    print(
        f"once a scene: FCL world {t_world:.2f} s, for all; clearance grid {t_grid:.2f} s, for ours ({shape} cells)"
    )


def compare(case: Case, some: int, slow: int, seconds: float) -> None:
    planner = case.planner
    scene_line(case)
    goal, start = case.singles[0][0]
    for _ in range(2):  # kernels compiled, memory there
        planner.plan_one(goal, start)
        planner.plan_target(goal, start)

    for k, singles in enumerate(case.singles):
        # What is not searched because it is near straight says nothing of paths.
        pairs = [p for p in singles if planner.plan_one(*p).outcome != "NEAR_STRAIGHT"]
        took, routes = timed(planner.plan_one, pairs)
        whole, again = timed(lambda goal, start: planner.plan_target(goal, start)[0], pairs)
        lengths = lengths_of(routes)
        head(f"single queries, one start a goal, round {k + 1}: {len(pairs)} searched")
        line("(a) aerialdojo-gen, plan_one", took, lengths, lengths, took.mean())
        line("(a) aerialdojo-gen, the whole cost-to-go", whole, lengths_of(again), lengths, took.mean())
        others(case, pairs, lengths, took.mean(), some)

    took, by_goal = timed(planner.plan_target, case.groups)
    routes = [route for found in by_goal for route in found]
    ends = [(goal, start) for goal, starts in case.groups for start in starts]
    asked = [k for k, route in enumerate(routes) if route.outcome != "NEAR_STRAIGHT"]
    pairs, lengths, each_s = [ends[k] for k in asked], lengths_of(routes)[asked], took.sum() / len(asked)
    head(f"many starts a goal: {len(case.groups)} goals, {len(ends)} candidates, {len(asked)} searched")
    line("(a) aerialdojo-gen", np.array([each_s]), lengths, lengths, each_s)
    others(case, pairs, lengths, each_s, some)
    few = np.linspace(0, len(pairs) - 1, min(slow, len(pairs))).astype(int)
    t = time.monotonic()
    found = np.array([solve(case, geometric.RRTstar, *pairs[k][::-1], seconds, False) for k in few])
    line(f"(c) RRT*, {seconds:g} s", np.array([(time.monotonic() - t) / len(few)]), found, lengths[few], each_s)


def main() -> None:
    options = options_of(
        __doc__, targets=2, starts=170, singles=40, rounds=3, some=40, slow=8, seconds=3.0, data=Path("data")
    )
    util.setLogLevel(util.LOG_ERROR)
    util.RNG.setSeed(1)
    size = (options.targets, options.starts, options.singles, options.rounds)
    compare(made_up(*size), options.some, options.slow, options.seconds)
    for name in SCENES:
        if (options.data / "pairs" / name).is_dir():
            case = of_dataset(name, options.data, *size)
            compare(case, options.some, options.slow, options.seconds)
        else:
            print(f"{name}: {options.data} has no pairs of it")


if __name__ == "__main__":
    main()
