"""The clearance grid of a scene: distance to the nearest surface, and which cells are connected with the open sky.

Where the ground is an open sheet, a curtain closes it at its rim, so that no route leads below it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.constants import RADIUS_M
from aerialdojo_gen.geometry.arrays import Flags, Floats
from aerialdojo_gen.geometry.ground import Ground
from aerialdojo_gen.geometry.triangles import split_triangles
from aerialdojo_gen.planning.bvh import build_bvh, crossings_above, point_distances
from aerialdojo_gen.planning.bvh_groups import group_boxes
from aerialdojo_gen.planning.connectivity import connected_with_ceiling, passable_moves, reaches_marked_cell
from aerialdojo_gen.planning.distance_field import build_distance_field
from aerialdojo_gen.planning.grid_kernels import GridArrays, inside
from aerialdojo_gen.scenes.context import context_of
from aerialdojo_gen.scenes.model import Scene

# Longer triangles are split: their bounding boxes would be mostly empty.
_LONGEST_EDGE_M = 4.0
# Distances are exact up to this.
_BAND_M = 1.0


def _distances(
    scene: Scene, cell_m: float, radius_m: float, cap_m: float, closed_ground: bool
) -> tuple[GridArrays, Ground | None, bool]:
    """The part of a `ClearanceGrid` that does not depend on the margin: its arrays, ground and `has_curtain`."""
    low, high = np.asarray(scene.bounds, np.float64)
    reach = cap_m + 1.0
    parts = [i.vertices[i.faces].reshape(-1, 9) for i in scene.instances]
    triangles = np.concatenate(parts) if parts else np.empty((0, 9))
    triangles, _ = split_triangles(triangles, _LONGEST_EDGE_M, low - reach, high + reach)
    real, real_boxes, _ = build_bvh(triangles)
    ground = Ground.of(scene, radius_m) if closed_ground else None
    curtain = np.empty((0, 9)) if ground is None else ground.curtain(low, high, radius_m)
    solid, boxes = real, real_boxes
    if len(curtain):
        curtain, _ = split_triangles(curtain, _LONGEST_EDGE_M, low - reach, high + reach)
        solid, boxes, _ = build_bvh(np.concatenate([triangles, curtain]))
    nx, ny, nz = (max(1, int(n)) for n in np.ceil((high - low) / cell_m - 1e-9))
    # The bound beyond the band needs at least half a cell's diagonal.
    field = build_distance_field(solid, low, (nx, ny, nz), cell_m, max(_BAND_M, 0.87 * cell_m), cap_m)
    arrays = GridArrays(
        field, low.copy(), cell_m, solid, group_boxes(boxes), real, real_boxes, low + radius_m, high - radius_m
    )
    return arrays, ground, len(curtain) > 0


@dataclass(frozen=True, eq=False)
class ClearanceGrid:
    """Distances on a grid, with the triangles for what the grid cannot decide."""

    arrays: GridArrays  # Distance field, triangles and bounds, for numba kernels
    moves: NDArray[np.uint32]  # Passable moves of every cell (`aerialdojo_gen.planning.connectivity.passable_moves`)
    sky: Flags  # (nx, ny, nz) bool; cells from which the body can fly to the ceiling
    radius_m: float  # The body's radius, with the planner's margin
    cap_m: float  # Distances are capped at this
    ground: Ground | None = None  # The scene's ground where it is an open sheet
    has_curtain: bool = False  # Whether only the curtain keeps the body from below it

    @classmethod
    def build(
        cls, scene: Scene, cell_m: float = 0.5, radius_m: float = RADIUS_M, cap_m: float = 5.0, margin_m: float = 0.0,
        closed_ground: bool = True,
    ) -> ClearanceGrid:  # fmt: skip
        """Build the grid over a scene's flight volume (metres); it depends on the scene and the parameters alone."""
        return cls._with_radius(_distances(scene, cell_m, radius_m, cap_m, closed_ground), radius_m + margin_m, cap_m)

    @classmethod
    def of(
        cls, scene: Scene, cell_m: float = 0.5, radius_m: float = RADIUS_M, cap_m: float = 5.0, margin_m: float = 0.0,
        closed_ground: bool = True,
    ) -> ClearanceGrid:  # fmt: skip
        """Return the scene context's grid, by the parameters of `build`; other parameters replace it.

        The distance field is a part of its own: grids of another margin share it.
        """
        context, key = context_of(scene), (cell_m, radius_m, cap_m, closed_ground)

        def make() -> ClearanceGrid:
            made = context.part("clearance space", lambda: _distances(scene, *key), key)
            return cls._with_radius(made, radius_m + margin_m, cap_m)

        return context.part("clearance grid", make, (key, margin_m))

    @classmethod
    def _with_radius(
        cls, made: tuple[GridArrays, Ground | None, bool], radius_m: float, cap_m: float
    ) -> ClearanceGrid:
        arrays, ground, has_curtain = made
        moves = passable_moves(arrays, radius_m)
        return cls(arrays, moves, connected_with_ceiling(moves), radius_m, cap_m, ground, has_curtain)

    def distance_m(self, points: ArrayLike) -> Floats:
        """Exact distances (n,), metres, from points (n, 3) or (3,) to the nearest surface, up to `cap_m`."""
        p = np.ascontiguousarray(np.asarray(points, np.float64).reshape(-1, 3))
        return np.asarray(point_distances(p, self.cap_m, self.arrays.real_tri, self.arrays.real_boxes))

    def in_collision(self, p: ArrayLike) -> bool:
        """Whether the body at a point (3,) touches a surface, leaves the bounds, or is in a solid or below ground."""
        x, y, z = np.asarray(p, np.float64)
        a = self.arrays
        if not inside(x, y, z, a.lower, a.upper) or self.distance_m(p)[0] <= self.radius_m:
            return True
        return not self.reachable(p) and (
            self.below_ground(p) or crossings_above(x, y, z, a.real_tri, a.real_boxes) > 0
        )

    def reachable(self, p: ArrayLike) -> bool:
        """Whether the body can be at a point (3,) above ground and fly from there to the ceiling."""
        x, y, z = np.asarray(p, np.float64)
        if not inside(x, y, z, self.arrays.lower, self.arrays.upper) or self.below_ground(p):
            return False
        return bool(reaches_marked_cell(x, y, z, self.radius_m, self.sky, self.arrays))

    def below_ground(self, points: ArrayLike) -> bool:
        """Whether any of some points, (n, 3) float metres, lies below open ground; (3,) is one."""
        return self.ground is not None and bool(self.ground.below(points).any())
