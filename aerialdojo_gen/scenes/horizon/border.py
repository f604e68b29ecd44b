"""The edge of a scene's ground: what it is made of and how high it is, all the way round."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.scenes.model import Instance, Part

Floats = NDArray[np.float64]

_ON_M, _SHORT_M = 1e-3, 1e-6
# Stretches of one material are joined up to this length, metres.
_LONGEST_M = 9.0
# Counter-clockwise from the south: the axis along the side, the way along it, and whether it is the upper bound.
_SIDES = ((0, 1.0, False), (1, 1.0, True), (0, -1.0, True), (1, -1.0, False))
OUTWARDS: Floats = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of a side, of one material."""

    side: int  # 0 south, 1 east, 2 north, 3 west
    points: Floats  # (k, 3) float64, k >= 2; counter-clockwise about the scene, metres
    material: str

    @property
    def water(self) -> bool:
        """Whether it is open water."""
        return self.material.split(":")[0] == "water"


def border_of(ground: Instance, bounds: Floats) -> list[Stretch]:
    """List the stretches of the ground's edge, counter-clockwise from the south-western corner."""
    out: list[Stretch] = []
    for side in range(4):
        pieces = sorted(
            (piece for part in ground.parts for piece in _pieces(part, bounds, side)), key=lambda piece: piece[0]
        )
        out += _joined(side, pieces)
    return out


def _pieces(part: Part, bounds: Floats, side: int) -> list[tuple[float, Floats, str]]:
    """Edges of the upward faces of a part that lie on a side: where each begins, its ends (2, 3), its material."""
    axis, way, upper = _SIDES[side]
    across = 1 - axis
    corners = part.vertices[part.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corners = corners[normal[:, 2] > 0.05 * norm(normal)]
    on = np.abs(corners[:, :, across] - bounds[int(upper), across]) < _ON_M
    found = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        rows = np.flatnonzero(on[:, a] & on[:, b])
        ends = np.stack([corners[rows, a], corners[rows, b]], axis=1)
        # Upward faces are counter-clockwise from above, and so is the way round: others are seams.
        along = (ends[:, 1, axis] - ends[:, 0, axis]) * way
        found += [(float(one[0, axis] * way), one, part.material) for one in ends[along > _SHORT_M]]
    return found


def _joined(side: int, pieces: Sequence[tuple[float, Floats, str]]) -> list[Stretch]:
    axis, way, _ = _SIDES[side]
    out: list[Stretch] = []
    points: list[Floats] = []
    material, reached = "", -np.inf
    for start, ends, spec in pieces:
        end = float(ends[1, axis] * way)
        if end <= reached + _SHORT_M:
            continue
        reached = end
        gap = points and np.abs(points[-1] - ends[0]).max() > _ON_M
        long = points and abs(points[-1][axis] - points[0][axis]) + (end - start) > _LONGEST_M
        if points and (spec != material or gap or long):
            out.append(Stretch(side, np.array(points), material))
            points = []
        material = spec
        points += [ends[1]] if points else [ends[0], ends[1]]
    if points:
        out.append(Stretch(side, np.array(points), material))
    return out
