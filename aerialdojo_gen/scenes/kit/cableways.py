"""Cableways: ropes between masts, with cabins."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field

from aerialdojo_gen.geometry.portable import norm, unit
from aerialdojo_gen.scenes.grammar_frames import Frame, Parts
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.mesh import translated
from aerialdojo_gen.scenes.plans.values import Line, Material, Number
from aerialdojo_gen.scenes.shapes import box, cylinder
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

# The sag of a rope, as a share of its length.
_SAG = 0.045


@site_builder
def cableway(
    site: Site, *, masts: Line, cabins: Annotated[int, Field(ge=0, le=1000)] = 8, mast_m: Number = 11.6,
    terminal_m: Number = 5.6, gauge_m: Annotated[Number, Field(gt=0)] = 6.4,
    paints: Annotated[list[Material], Field(min_length=1)] = ["#d8342c", "#2f5f9e", "#e9b52a", "#3f7d4e"],  # noqa: B006
) -> None:  # fmt: skip
    """Hang two ropes with cabins between the heads of masts; the first and the last are terminals with a wheel."""
    last = len(masts) - 1
    heads = [
        (x, y, site.ground_z(x, y) + (terminal_m if k in (0, last) else mast_m)) for k, (x, y) in enumerate(masts)
    ]
    parts: Parts = []
    hung = 0
    for a, b in pairwise(np.array(heads)):
        along = unit((b - a)[:2])
        side = np.array([-along[1], along[0], 0.0]) * gauge_m / 2
        length = float(norm((b - a)[:2]))
        t = np.linspace(0.0, 1.0, 9)
        sag = -_SAG * length * 4 * t * (1 - t)
        for way in (-1.0, 1.0):
            line = a + (b - a) * t[:, None] + side * way + np.column_stack([0 * t, 0 * t, sag])
            parts.append(("iron", sweep(path=[tuple(map(float, p)) for p in line], radius=0.045, sides=4)))
            count = max(int(length // 16), 1) if hung < cabins else 0
            for k in range(count):
                s = (k + 0.5 + 0.22 * way) / count
                p = a + (b - a) * s + side * way
                z = float(p[2] - _SAG * length * 4 * s * (1 - s))
                yaw_deg = math.degrees(math.atan2(along[1], along[0]))
                parts += _cabin(Frame(float(p[0]), float(p[1]), yaw_deg), z, paints[hung % len(paints)])
                hung += 1
    for x, y, z in (heads[0], heads[-1]):
        foot = site.ground_z(x, y)
        wheel = cylinder(radius=gauge_m / 2, height=0.3, segments=20)
        parts.append(("#3f7d4e", translated(wheel, (x, y, z - 0.15))))
        shaft = cylinder(radius=0.4, height=z - foot + 0.6, segments=10)
        parts.append(("steel", translated(shaft, (x, y, foot - 0.5))))
        parts.append(("concrete", translated(box(size=(2.2, 2.2, 0.5)), (x, y, foot - 0.3))))
    site.add(None, "lift_ropes", parts)


def _cabin(frame: Frame, z: float, paint: str) -> Parts:
    body: Parts = [
        (paint, translated(box(size=(1.5, 1.3, 0.75), taper=(1.1, 1.1)), (0, 0, -3.1))),
        ("glass", translated(box(size=(1.6, 1.4, 0.75), taper=(0.94, 0.92)), (0, 0, -2.35))),
        (paint, translated(box(size=(1.55, 1.35, 0.18), taper=(0.8, 0.8)), (0, 0, -1.6))),
        ("steel", translated(cylinder(radius=0.05, height=1.45, segments=6), (0, 0, -1.42))),
    ]
    return frame.parts(body, z)
