"""The planner beside OMPL's, in one run: the same FCL world, the same pairs, one core.

    python tests/bench/bench_ompl.py [--targets 2] [--starts 170] [--some 40] [--slow 12] [--seconds 3] [--data data]

The worlds are a made-up one of boxes and trees with random pairs, and scenes of the dataset with their own
candidates (these need the tables up to `pairs`). (a) is this planner, its cost-to-go and certificates included; what
it does not solve there has no path within `max_length_m`. (b) is RRTConnect with path simplification, twice: with
FCL's swept capsule for every motion, which is our certificate's own check, and with OMPL's own motion check, a ball
asked for every 0.1 m. (c) is RRT* with a time limit, swept. OMPL plans positions only, in a space whose distance is
the action metric (horizontal plus vertical), so that lengths compare; our routes are bound to the action set and to
headings besides. (BIT* cannot sample such a space; RRT* can.) Times of (a) and (b) are CPU seconds of this process.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from ompl import base, geometric, util

sys.path.insert(0, str(Path(__file__).resolve().parent))
from bench_planner import RADIUS, SIZE, free_pose, world

from aerialdojo_gen.config.pipeline import load_pipeline
from aerialdojo_gen.config.sections import PlanConfig
from aerialdojo_gen.pipeline.stage import Job, Roots
from aerialdojo_gen.planning.planner import Planner
from aerialdojo_gen.stages.work import plan

ROOT = Path(__file__).resolve().parents[2]
SCENES = ("U_Mall_0", "N_Forest_0", "U_ConstructionSite_0")
SAMPLED_M = 0.1


@dataclass
class Case:
    """A planner, the corners of where it may fly, and starts by goal."""

    name: str
    planner: Planner
    low: np.ndarray
    high: np.ndarray
    starts: list[tuple[np.ndarray, np.ndarray]]


def made_up(targets: int, starts: int) -> Case:
    planner, rng, groups = Planner(world(), PlanConfig(), RADIUS), np.random.default_rng(1), []
    for _ in range(targets):
        goal = free_pose(planner, rng)
        # Not farther than a released task reaches.
        groups.append((goal, np.array([free_pose(planner, rng, goal, 70.0) for _ in range(starts)])))
    return Case("made up", planner, np.zeros(3), np.array(SIZE), groups)


def of_dataset(scene_name: str, data: Path, targets: int, starts: int) -> Case:
    pipeline = load_pipeline(ROOT / "pipelines/aerialdojo-200k.toml")
    job = Job("plan", scene_name, 0, 1, pipeline.seed, pipeline.embodiment, Roots(data, data, data, data))
    scene = job.scene_model()
    poses, selected = plan._anchor_poses(job)
    by_target = list(plan._by_target(job.read("pairs")))
    groups = []
    for target, pairs in by_target[:: max(1, len(by_target) // targets)][:targets]:
        every = np.array([plan._turned(poses[p["start_object_id"], p["start_anchor_id"]]) for p in pairs])
        groups.append((poses[selected[target]], every[:: max(1, len(every) // starts)][:starts]))
    low, high = np.asarray(scene.bounds)
    return Case(scene_name, Planner(scene, pipeline.plan, RADIUS), low, high, groups)


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
    flat, upright = base.RealVectorStateSpace(2), base.RealVectorStateSpace(1)
    for space, axes in ((flat, (0, 1)), (upright, (2,))):
        bounds = base.RealVectorBounds(len(axes))
        for k, axis in enumerate(axes):
            bounds.setLow(k, case.low[axis] + RADIUS)
            bounds.setHigh(k, case.high[axis] - RADIUS)
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


def line(name: str, seconds_each: float, lengths: np.ndarray, ours: np.ndarray, ours_each: float) -> None:
    both = np.isfinite(lengths) & np.isfinite(ours)
    ratio = (ours[both] / lengths[both]).mean()
    print(
        f"  {name:<34}{1 / seconds_each:>13.1f}{np.isfinite(lengths).mean():>9.1%}{ratio:>12.3f}"
        f"{seconds_each / ours_each:>13.1f}"
    )


def compare(case: Case, some: int, slow: int, seconds: float) -> None:
    for goal, starts in case.starts:
        case.planner.plan_target(goal, starts[:1])
    pairs, ours = [], []
    t = time.process_time()
    for goal, starts in case.starts:
        for start, route in zip(starts, case.planner.plan_target(goal, starts), strict=True):
            # What is not searched because it is near straight says nothing of paths.
            searched = route.outcome != "NEAR_STRAIGHT"
            pairs.append((start, goal, searched))
            ours.append(route.length_m if route.outcome == "SOLVED" else np.inf)
    each = (time.process_time() - t) / len(pairs)
    a, asked = np.array(ours), np.flatnonzero([searched for *_, searched in pairs])
    print(f"{case.name}: {len(case.starts)} targets, {len(pairs)} candidates, {len(asked)} of them searched")
    print(f"  {'':<34}{'candidates/s':>13}{'solved':>9}{'our L / its':>12}{'time / ours':>13}")
    line("(a) aerialdojo-gen", each, a[asked], a[asked], each)
    for name, swept in (("swept", True), (f"a ball every {SAMPLED_M:g} m", False)):
        few = asked[np.linspace(0, len(asked) - 1, min(some, len(asked))).astype(int)]
        t = time.process_time()
        b = np.array([solve(case, geometric.RRTConnect, *pairs[k][:2], 3.0, True, swept) for k in few])
        line(f"(b) RRTConnect, {name}", (time.process_time() - t) / len(few), b, a[few], each)
    few = asked[np.linspace(0, len(asked) - 1, min(slow, len(asked))).astype(int)]
    t = time.monotonic()
    c = np.array([solve(case, geometric.RRTstar, *pairs[k][:2], seconds, False) for k in few])
    line(f"(c) RRT*, {seconds:g} s", (time.monotonic() - t) / len(few), c, a[few], each)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=2)
    parser.add_argument("--starts", type=int, default=170, help="starts a target; the dataset has 174")
    parser.add_argument("--some", type=int, default=40, help="pairs that each (b) gets")
    parser.add_argument("--slow", type=int, default=8, help="pairs that (c) gets")
    parser.add_argument("--seconds", type=float, default=3.0, help="time limit of (c), wall time")
    parser.add_argument("--data", type=Path, default=Path("data"))
    options = parser.parse_args()
    util.setLogLevel(util.LOG_ERROR)
    util.RNG.setSeed(1)
    compare(made_up(options.targets, options.starts), options.some, options.slow, options.seconds)
    for name in SCENES:
        if (options.data / "pairs" / name).is_dir():
            case = of_dataset(name, options.data, options.targets, options.starts)
            compare(case, options.some, options.slow, options.seconds)
        else:
            print(f"{name}: {options.data} has no pairs of it")


if __name__ == "__main__":
    main()
