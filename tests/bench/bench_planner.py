"""How fast and how good the planner is, on a world of 120 × 120 × 25 m with 250 things.

    python tests/bench/bench_planner.py [--targets 6] [--starts 60] [--exact 0]

`--starts` is of each target, and `--exact` the number of its routes that an exhaustive search repeats. Times are CPU
seconds of this process, so that a busy machine distorts them less.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
import trimesh
from common import cpu_s, options_of

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from support.flying import turned
from support.handmade import box, instance

from aerialdojo_gen.base.config.sections import PlanConfig, SearchAttempt
from aerialdojo_gen.planning.certify import ClearanceProfile, certify, clearance_profile
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.planning.planner import Planner, Route
from aerialdojo_gen.scenes.model import Material, Scene

SIZE = (120.0, 120.0, 25.0)
RADIUS = 0.25


def world(n: int = 250, edge: float = SIZE[0]) -> Scene:
    """Houses at any angle, trees, and roofs on posts."""
    rng = np.random.default_rng(0)
    size_m = (edge, edge, SIZE[2])
    things = [instance("ground", box((0, 0, -0.5), (edge, edge, 0.0)))]
    for k in range(n):
        x, y = rng.uniform(3, edge - 3), rng.uniform(3, edge - 3)
        if k % 5 < 3:
            size = rng.uniform([2, 2, 2], [9, 9, 16])
            mesh, z = trimesh.creation.box(extents=size), size[2] / 2
        elif k % 5 == 3:
            h, z = rng.uniform(3, 10), 0.0
            trunk = trimesh.creation.cylinder(0.2, h, sections=10).apply_translation([0, 0, h / 2])
            crown = trimesh.creation.icosphere(2, rng.uniform(1, 2.5)).apply_translation([0, 0, h])
            mesh = trimesh.util.concatenate([trunk, crown])
        else:
            w, h, z = rng.uniform(6, 14), rng.uniform(3, 5), 0.0
            corners = [(a * w / 2, b * 3.8) for a in (-1, 1) for b in (-1, 1)]
            posts = [box((a - 0.2, b - 0.2, 0), (a + 0.2, b + 0.2, h)) for a, b in corners]
            mesh = trimesh.util.concatenate([*posts, box((-w / 2, -4, h), (w / 2, 4, h + 0.3))])
        things.append(instance(f"thing_{k:03d}", turned(mesh, rng.uniform(0, 6.28), (x, y, z))))
    return Scene("Bench", tuple(things), {"grey": Material("grey", (128, 128, 128))}, np.array([(0, 0, 0), size_m]))


def free_pose(planner: Planner, rng: np.random.Generator, near=None, within: float = np.inf) -> np.ndarray:
    """A pose from which the body can fly to the sky, (4,), at most `within` metres from `near`."""
    low, high = planner.grid.arrays.lower + 1.75, planner.grid.arrays.upper - 1.75
    while True:
        p = rng.uniform([*low[:2], 1.0], [*high[:2], 8.0])
        if near is not None and np.linalg.norm(p - near[:3]) > within:
            continue
        if planner.grid.distance_m(p) >= 0.6 and planner.grid.reachable(p):
            return np.array([*p, rng.uniform(-3.1, 3.1)])


def certified(route: Route, grid: ClearanceGrid, world: CollisionWorld) -> ClearanceProfile:
    profile = clearance_profile(np.ascontiguousarray(route.poses[:, :3]), RADIUS, grid.cap_m, grid.arrays)
    assert certify(profile, RADIUS, world)
    return profile


def main() -> None:
    options = options_of(__doc__, targets=6, starts=60, exact=0)
    scene = world()
    planner = Planner(scene, PlanConfig(), RADIUS)
    planner.plan_target((60, 60, 22, 0), [(50, 50, 22, 0)])
    t_fcl, collisions = cpu_s(CollisionWorld, scene)
    t_grid, _ = cpu_s(lambda: ClearanceGrid.build(scene, margin_m=planner.config.margin_m))
    print(
        f"scene          {scene.n_triangles} triangles, {len(scene.instances)} instances, "
        f"grid {planner.grid.moves.shape}"
    )
    print(f"build          FCL {t_fcl:.2f} s, clearance grid {t_grid:.2f} s")

    rng = np.random.default_rng(1)

    t_field, plans, routes, certificates, whole = [], [], [], [], 0.0
    exact = Planner(
        scene,
        PlanConfig(
            ladder=(SearchAttempt(weight=0.97, budget=400_000, duplicate_cell_m=0.25, tolerance_growth_m=0.0),)
        ),
        RADIUS,
    )
    ratios = []
    for _ in range(options.targets):
        goal = free_pose(planner, rng)
        starts = np.array([free_pose(planner, rng) for _ in range(options.starts)])
        seconds, found = cpu_s(planner.plan_target, goal, starts)
        whole += seconds
        routes += found
        t_field.append(cpu_s(planner._expand, goal)[0])
        for start, r in zip(starts, found, strict=True):
            if r.outcome == "SOLVED":
                ways = (start, goal, r.cost_to_go_m, planner._cost, planner.config.ladder)
                plans.append(cpu_s(planner._search, *ways)[0])
                seconds, profile = cpu_s(certified, r, planner.grid, collisions)
                certificates.append((seconds, len(profile.undecided), profile.undecided.sum()))
        if options.exact:
            some = [i for i, r in enumerate(found) if r.outcome == "SOLVED"][: options.exact]
            for i, b in zip(some, exact.plan_target(goal, starts[some]), strict=True):
                if b.outcome == "SOLVED":
                    ratios.append(found[i].length_m / b.length_m)
    solved = [r for r in routes if r.outcome == "SOLVED"]
    ms = 1e3 * np.array(plans)
    over = np.array([r.length_m / r.cost_to_go_m for r in solved])
    took, legs, checks = np.array(certificates).T
    expansions = [r.expansions for r in solved]
    outcomes, attempts = dict(Counter(r.outcome for r in routes)), dict(Counter(r.attempts for r in solved))
    print(f"outcomes       {outcomes}; solved in attempt {attempts}")
    print(f"cost-to-go     {np.median(t_field):.3f} s a goal (median)")
    print(
        f"plan           {np.median(ms):.2f} ms median, {ms.mean():.2f} mean, {ms.max():.1f} most, with certificate"
    )
    print(
        f"certificate    {1e3 * took.mean():.2f} ms a route, FCL asked about {checks.sum() / legs.sum():.0%} of legs"
    )
    print(f"whole          {1e3 * whole / len(routes):.2f} ms a candidate, {options.starts} to a cost-to-go")
    print(f"expansions     {np.median(expansions):.0f} median, {np.mean(expansions):.0f} mean")
    print(f"L / cost-to-go {over.mean():.4f} mean, {np.quantile(over, 0.99):.3f} at 99 %, {over.max():.3f} most")
    metres = np.mean([r.length_m for r in solved])
    print(f"actions        {np.mean([r.n_actions for r in solved]):.1f} mean for {metres:.1f} m")
    if ratios:
        print(f"L / exhaustive {np.mean(ratios):.4f} mean, {np.max(ratios):.4f} most, of {len(ratios)} routes")


if __name__ == "__main__":
    main()
