"""The edge of a scene's ground: what it is made of and how high it is, all the way round."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.scenes.model import Instance, Part

Floats = NDArray[np.float64]
_Piece = tuple[float, Floats, str]  # Where it begins along its side, its ends (2, 3), its material

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
        return is_water(self.material)


def border_of(ground: Instance, bounds: Floats, above: Iterable[Instance]) -> list[Stretch]:
    """List the stretches of the edge of ground and water, counter-clockwise from the south-western corner."""
    water = [part for thing in above for part in thing.parts if is_water(part.material)]
    out: list[Stretch] = []
    for side in range(4):
        land, sheets = (
            sorted((piece for part in parts for piece in _pieces(part, bounds, side)), key=lambda piece: piece[0])
            for parts in (ground.parts, water)
        )
        out += _joined(side, _topmost(side, land, sheets) if sheets else land)
    return out


def is_water(material: str) -> bool:
    """Whether a material is open water."""
    return material.split(":")[0] == "water"


def _pieces(part: Part, bounds: Floats, side: int) -> list[_Piece]:
    """Edges of the upward faces of a part that lie on a side."""
    axis, way, upper = _SIDES[side]
    across = 1 - axis
    corners = part.vertices[part.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corners = corners[normal[:, 2] > 0.05 * norm(normal)]
    on = np.abs(corners[:, :, across] - bounds[int(upper), across]) < _ON_M
    pieces = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        rows = np.flatnonzero(on[:, a] & on[:, b])
        ends = np.stack([corners[rows, a], corners[rows, b]], axis=1)
        # Upward faces are counter-clockwise from above, and so is the way round: others are seams.
        along = (ends[:, 1, axis] - ends[:, 0, axis]) * way
        pieces += [(float(one[0, axis] * way), one, part.material) for one in ends[along > _SHORT_M]]
    return pieces


def _topmost(side: int, land: Sequence[_Piece], sheets: Sequence[_Piece]) -> list[_Piece]:
    """Cut land where sheets of water lie over it; they stand in its place there."""
    axis, way, _ = _SIDES[side]

    def at(ends: Floats, t: float) -> Floats:
        first, last = (ends[:, axis] * way).tolist()
        return np.asarray(ends[0] + (ends[1] - ends[0]) * ((t - first) / (last - first)))

    out = []
    for piece in land:
        first, last = (piece[1][:, axis] * way).tolist()
        cuts, over = {first, last}, []
        for sheet in sheets:
            low, high = np.clip(sheet[1][:, axis] * way, first, last).tolist()
            if high - low <= _SHORT_M:
                continue
            over.append(sheet)
            above = [float(at(piece[1], t)[2] - at(sheet[1], t)[2]) for t in (low, high)]
            cuts |= {low, high}
            if above[0] * above[1] < 0.0:
                cuts.add(low + (high - low) * above[0] / (above[0] - above[1]))
        if not over:
            out.append(piece)
            continue
        for low, high in pairwise(sorted(cuts)):
            middle = (low + high) / 2.0
            here = [one for one in over if one[0] <= middle <= float(one[1][1, axis] * way)]
            _, ends, material = max([piece, *here], key=lambda one: float(at(one[1], middle)[2]))
            out.append((low, np.stack([at(ends, low), at(ends, high)]), material))
    return out


def _joined(side: int, pieces: Sequence[_Piece]) -> list[Stretch]:
    axis, way, _ = _SIDES[side]
    joined: list[tuple[list[Floats], str]] = []
    points: list[Floats] = []
    material, reached = "", -np.inf
    for start, ends, spec in pieces:
        end = float(ends[1, axis] * way)
        if end <= reached + _SHORT_M:
            continue
        reached = end
        gap = points and np.abs(points[-1] - ends[0]).max() > _ON_M
        long = points and abs(points[-1][axis] - points[0][axis]) + (end - start) > _LONGEST_M
        if spec != material or gap or long:
            points, material = [ends[0]], spec
            joined.append((points, material))
        points.append(ends[1])
    return [Stretch(side, np.array(points), material) for points, material in joined]
