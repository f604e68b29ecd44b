"""The planner beside OMPL's, in one run: the same FCL world, the same pairs, one core.

    python tests/bench/bench_ompl.py [--targets 2] [--starts 170] [--slow 12] [--seconds 3]

(a) is this planner, its cost-to-go and certificates included. (b) is RRTConnect with path simplification, (c) RRT*
with a time limit, over the very same check: FCL's swept capsule for every motion. OMPL plans positions only, in a
space whose distance is the action metric (horizontal plus vertical), so that lengths compare; our routes are bound to
the action set and to headings besides. (BIT* cannot sample such a space; RRT* can.) Times of (a) and (b) are CPU
seconds of this process.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from ompl import base, geometric, util

sys.path.insert(0, str(Path(__file__).resolve().parent))
from bench_planner import RADIUS, SIZE, free_pose, world

from aerialdojo_gen.config import PlanConfig
from aerialdojo_gen.planning.planner import Planner


class Swept(base.MotionValidator):
    """A motion is free if FCL's capsule along it is."""

    def __init__(self, information, blocked) -> None:
        super().__init__(information)
        self.blocked = blocked

    def checkMotion(self, a, b, *_) -> bool:
        return not self.blocked(position(a), position(b))


def position(state) -> tuple[float, float, float]:
    return state[0][0], state[0][1], state[1][0]


def setup(planner: Planner) -> geometric.SimpleSetup:
    flat, upright = base.RealVectorStateSpace(2), base.RealVectorStateSpace(1)
    for space, axes in ((flat, (0, 1)), (upright, (2,))):
        bounds = base.RealVectorBounds(len(axes))
        for k, axis in enumerate(axes):
            bounds.setLow(k, RADIUS)
            bounds.setHigh(k, SIZE[axis] - RADIUS)
        space.setBounds(bounds)
    space = base.CompoundStateSpace()
    space.addSubspace(flat, 1.0)
    space.addSubspace(upright, 1.0)
    simple = geometric.SimpleSetup(space)
    fcl = planner.world
    simple.setStateValidityChecker(lambda s: not fcl.sphere_in_collision(position(s), RADIUS))
    information = simple.getSpaceInformation()
    information.setMotionValidator(Swept(information, lambda p, q: fcl.segment_in_collision(p, q, RADIUS)))
    return simple


def solve(planner: Planner, make, start, goal, seconds: float, simplify: bool) -> float:
    """Length of OMPL's path in the action metric, metres; infinite where it finds none."""
    simple = setup(planner)
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=2)
    parser.add_argument("--starts", type=int, default=170, help="starts a target; the dataset has 174")
    parser.add_argument("--slow", type=int, default=12, help="pairs that (c) gets")
    parser.add_argument("--seconds", type=float, default=3.0, help="time limit of (c), wall time")
    options = parser.parse_args()
    util.setLogLevel(util.LOG_ERROR)
    util.RNG.setSeed(1)
    planner = Planner(world(), PlanConfig(), RADIUS)
    planner.plan_target((60, 60, 22, 0), [(50, 50, 22, 0)])
    rng = np.random.default_rng(1)

    pairs, ours = [], []
    took = 0.0
    for _ in range(options.targets):
        goal = free_pose(planner, rng)
        # Not farther than a released task reaches.
        starts = [free_pose(planner, rng, goal, 70.0) for _ in range(options.starts)]
        t = time.process_time()
        routes = planner.plan_target(goal, np.array(starts))
        took += time.process_time() - t
        pairs += [(s, goal) for s in starts]
        ours += [r.length_m if r.outcome == "SOLVED" else np.inf for r in routes]
    a = np.array(ours)
    t = time.process_time()
    b = np.array([solve(planner, geometric.RRTConnect, s, g, 3.0, True) for s, g in pairs])
    took_b = time.process_time() - t
    some = np.linspace(0, len(pairs) - 1, options.slow).astype(int)
    t = time.monotonic()
    c = np.array([solve(planner, geometric.RRTstar, *pairs[k], options.seconds, False) for k in some])
    took_c = time.monotonic() - t

    def line(name: str, n: int, seconds: float, lengths: np.ndarray, reference: np.ndarray) -> None:
        both = np.isfinite(lengths) & np.isfinite(reference)
        ratio = f"{(reference[both] / lengths[both]).mean():.3f}"
        print(f"{name:<28}{n / seconds:>14.1f}{np.isfinite(lengths).mean():>10.1%}{ratio:>16}")

    print(f"{len(pairs)} pairs, {options.targets} targets; (c) on {len(some)} of them, {options.seconds:g} s each")
    print(f"{'':<28}{'candidates/s':>14}{'solved':>10}{'our L / its L':>16}")
    line("(a) aerialdojo-gen", len(a), took, a, a)
    line("(b) RRTConnect, simplified", len(b), took_b, b, a)
    line("(c) RRT*", len(c), took_c, c, a[some])
    print(f"rate of (a) over (b): {took_b / took:.0f} times")


if __name__ == "__main__":
    main()
