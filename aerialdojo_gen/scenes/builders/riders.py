"""People on bicycles and motorcycles; the wheels stand on z = 0, and they ride towards +x."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aerialdojo_gen.scenes.builders import builder
from aerialdojo_gen.scenes.builders.people import RIDE, person
from aerialdojo_gen.scenes.mesh import Mesh, Parts, merge, posed, rotation, translated
from aerialdojo_gen.scenes.shapes import box, cylinder, sphere, torus
from aerialdojo_gen.scenes.shapes_extruded import profile, sweep

_UPRIGHT = rotation(90.0, 0.0, 0.0)
# Where a rider's hips are on the saddle, and from there the grips and the feet, metres.
_SADDLE_X_M = {0: -0.22, 1: -0.3}
_RIDES: dict[int, dict[str, float]] = {
    0: {"seat": 0.955, "lean": 24.0, "grip_x": 0.44, "grip_y": 0.26, "grip_z": 0.99,
        "foot_x": 0.15, "foot_y": 0.13, "foot_z": 0.32, "foot_dz": 0.13},
    1: {"seat": 0.82, "lean": 16.0, "grip_x": 0.56, "grip_y": 0.35, "grip_z": 1.06,
        "foot_x": 0.22, "foot_y": 0.22, "foot_z": 0.3, "foot_dz": 0.0},
}  # fmt: skip


@builder
def rider(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Person on a bicycle, or with ``motor = 1`` on a motorcycle."""
    motor = round(params["motor"])
    own = person(rng, {**params, **_RIDES[motor], "posture": RIDE, "height": 1.75})
    x = _SADDLE_X_M[motor]
    return [*(_motorcycle() if motor else _bicycle()), *((role, translated(m, (x, 0.0, 0.0))) for role, m in own)]


def _wheels(reach_m: float, radius_m: float, tube_m: float, segments: int) -> Mesh:
    ring = posed(torus(radius=radius_m, tube=tube_m, segments=segments, sides=4), _UPRIGHT, (0.0, 0.0, 0.0))
    return merge([translated(ring, (x, 0.0, radius_m + tube_m)) for x in (-reach_m, reach_m)])


def _bicycle() -> Parts:
    frame = [
        [(-0.52, 0, 0.335), (-0.05, 0, 0.3), (0.38, 0, 0.74), (-0.16, 0, 0.74), (-0.05, 0, 0.3)],
        [(-0.52, 0, 0.335), (-0.16, 0, 0.74), (-0.2, 0, 0.9)],
        [(0.52, 0, 0.335), (0.36, 0, 0.95)],
    ]
    bars = [(0.2, -0.28, 0.98), (0.38, -0.1, 0.97), (0.38, 0.1, 0.97), (0.2, 0.28, 0.98)]
    pedals = [translated(box(size=(0.16, 0.1, 0.03)), (-0.05, s * 0.13, 0.29 + s * 0.13)) for s in (-1, 1)]
    return [
        ("tyre", _wheels(0.52, 0.31, 0.025, 14)),
        ("frame", merge([sweep(path=path, radius=0.022, sides=4) for path in frame])),
        ("metal", sweep(path=bars, radius=0.018, sides=4)),
        ("tyre", merge([translated(box(size=(0.28, 0.15, 0.07), taper=(0.8, 0.6)), (-0.22, 0.0, 0.89)), *pedals])),
    ]


def _motorcycle() -> Parts:
    tank = profile(points=[(-0.15, 0.7), (0.35, 0.66), (0.42, 0.9), (0.1, 0.98), (-0.15, 0.86)], width=0.3)
    saddle = profile(points=[(-0.85, 0.74), (-0.1, 0.66), (-0.1, 0.82), (-0.5, 0.84), (-0.9, 0.92)], width=0.28)
    guard = profile(points=[(0.5, 0.62), (0.95, 0.62), (0.85, 0.69), (0.6, 0.69)], width=0.16)
    forks = [sweep(path=[(0.72, s * 0.09, 0.33), (0.4, s * 0.09, 1.0)], radius=0.03, sides=4) for s in (-1, 1)]
    bars = [(0.25, -0.38, 1.06), (0.4, -0.15, 1.02), (0.4, 0.15, 1.02), (0.25, 0.38, 1.06)]
    pipe = sweep(path=[(0.1, -0.2, 0.3), (-0.4, -0.2, 0.28), (-0.95, -0.2, 0.4)], radius=0.05, sides=5)
    hub = posed(cylinder(radius=0.12, height=0.12, segments=8), _UPRIGHT, (0.0, 0.06, 0.33))
    hubs = [translated(hub, (x, 0.0, 0.0)) for x in (-0.72, 0.72)]
    engine = translated(box(size=(0.5, 0.3, 0.4)), (0.0, 0.0, 0.3))
    pegs = translated(box(size=(0.1, 0.6, 0.04)), (-0.08, 0.0, 0.26))
    return [
        ("tyre", _wheels(0.72, 0.26, 0.07, 12)),
        ("metal", merge([engine, pipe, *forks, *hubs, pegs])),
        ("frame", merge([tank, guard])),
        ("tyre", merge([saddle, sweep(path=bars, radius=0.025, sides=4)])),
        ("lamp", translated(sphere(radius=0.11, subdivisions=0), (0.55, 0.0, 0.92))),
    ]
