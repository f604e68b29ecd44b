"""The certificate again: FCL checks every straight leg of every route, and about nothing less than its sweep.

No clearance grid takes part. FCL's answers take less time than the grid takes to be built, and so a fault of the
grid, which the planner searched by, cannot hide here.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Mask, Rows, SceneData
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.planning.certify import corners
from aerialdojo_gen.planning.collision import CollisionWorld

_FITS = ("list_lengths_differ", "out_of_bounds")
# FCL's tolerance for a capsule against a triangle is well below this.
_CLEARANCE_M = 1e-4
_HALVINGS = 14


@check("routes", needs=("mesh",), after=_FITS, samples=True)
def route_collision(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The body's sweep along the stored positions touches no surface (FCL, a capsule a leg)."""
    world, radius, cap = data.world, data.pipeline.embodiment.radius_m, data.pipeline.plan.clearance_cap_m
    bodies = rows.floats("min_clearance_m") - _CLEARANCE_M
    wide = _free_as_stored(data)
    for row in data.sampled_routes():
        legs = corners(data.paths.xyz[data.paths.of(row)])
        # Where a body as thick as the stored clearance passes, so does the drone's: one sweep for two checks.
        wide[row] = radius <= bodies[row] <= cap and not world.route_in_collision(legs, float(bodies[row]))
        if not wide[row] and (hit := _hit(world, legs, radius)):
            yield Finding(row, f"the body touches a surface {hit}", "a free sweep")


@check("routes", needs=("mesh",), after=(*_FITS, "action_order", "replay_differs", "route_collision"), samples=True)
def replay_collision(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """The body's sweep along the replayed actions touches no surface."""
    world, radius = data.world, data.pipeline.embodiment.radius_m
    paths = data.paths
    for row in data.sampled_routes("list_lengths_differ", "action_order", "replay_differs"):
        flown = replay(paths.starts[row], paths.action[paths.of(row)][:-1])[:, :3]
        # Where the two agree to the last bit but for the Approach, the certificate above is this one too.
        if np.array_equal(flown[:-1], paths.xyz[paths.of(row)][:-1]):
            continue
        if hit := _hit(world, corners(flown), radius):
            yield Finding(row, f"the body touches a surface {hit}", "a free sweep")


@check("routes", needs=("mesh",), after=(*_FITS, "route_collision"), samples=True)
def min_clearance(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The stored clearance is right: a body a little thinner passes everywhere, one a little thicker does not."""
    world, cap = data.world, data.pipeline.plan.clearance_cap_m
    stored, paths, wide = rows.floats("min_clearance_m"), data.paths, _free_as_stored(data)
    for row in data.sampled_routes(*_FITS, "route_collision", "null_value", "not_finite"):
        legs, stored_m = corners(paths.xyz[paths.of(row)]), float(stored[row])
        if stored_m > cap + _CLEARANCE_M:
            yield Finding(row, f"{stored_m:.6g} m", f"{cap:g} m at most")
            continue
        passes = wide[row] or stored_m <= _CLEARANCE_M or not world.route_in_collision(legs, stored_m - _CLEARANCE_M)
        if not passes or (stored_m < cap and not world.route_in_collision(legs, max(stored_m, 0.0) + _CLEARANCE_M)):
            yield Finding(row, f"{stored_m:.6g} m", f"{_clearance_m(world, legs, cap):.4f} m")


def _free_as_stored(data: SceneData) -> Mask:
    """Routes that a body passes which is nearly as thick as their stored clearance, as far as that is known."""
    return data.cached("free as stored", lambda: np.zeros(len(data["routes"]), np.bool_))


def _hit(world: CollisionWorld, legs: Floats, radius: float) -> str:
    """Where a body on its way first touches a surface, in words; empty where nowhere."""
    if len(legs) == 1 and world.sphere_in_collision(legs[0], radius):
        return _between(legs[0], legs[0])
    return next((_between(p, q) for p, q in pairwise(legs) if world.segment_in_collision(p, q, radius)), "")


def _between(p: Floats, q: Floats) -> str:
    a, b = (", ".join(f"{v:.2f}" for v in end) for end in (p, q))
    return f"between ({a}) and ({b}) m"


def _clearance_m(world: CollisionWorld, legs: Floats, cap: float) -> float:
    """Smallest distance from the legs to a surface, up to the cap, by halving; metres."""
    low, high = 0.0, cap
    if not world.route_in_collision(legs, cap):
        return cap
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if world.route_in_collision(legs, middle) else (middle, high)
    return (low + high) / 2
