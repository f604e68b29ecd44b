"""The body in a scene: the motion of an action, and whether its sweep is in collision.

As for reference trajectories (`aerialdojo_gen.planning.certify`), FCL checks only the legs that the clearance grid
does not prove free: that allows tens of thousands of steps a second.
"""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld, collision_world
from aerialdojo_gen.planning.grid_kernels import GridArrays, inside, segment_free
from aerialdojo_gen.scenes.context import SEVERAL, SceneContext, open_scene, prefetch_mesh
from aerialdojo_gen.scenes.model import Scene

Point = tuple[float, float, float]

_OUTSIDE, _FREE, _UNDECIDED = 0, 1, 2
# Accuracy of the contact point, metres.
_CONTACT_M = 1e-3


@njit(cache=True)
def _classify(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float, radius: float, grid: GridArrays
) -> int:
    if not inside(qx, qy, qz, grid.lower, grid.upper):
        return _OUTSIDE
    return _FREE if segment_free(px, py, pz, qx, qy, qz, radius, grid, True) else _UNDECIDED


class FlightSpace:
    """A scene to fly in."""

    def __init__(self, scene: Scene, radius_m: float, world: CollisionWorld | None = None) -> None:
        self.scene = scene
        self.radius_m = radius_m
        # An episode ends at a collision, so a body cannot get below open ground.
        self.grid = ClearanceGrid.of(scene, radius_m=radius_m, closed_ground=False)
        self._arrays = self.grid.arrays
        self._world = world

    @cached_property
    def world(self) -> CollisionWorld:
        """FCL's world; built when a leg is first undecided by the grid."""
        return self._world or collision_world(self.scene)

    def in_collision(self, p: Point) -> bool:
        """Whether the body at `p`, metres, world frame, touches a surface."""
        return _classify(*p, *p, self.radius_m, self._arrays) != _FREE and self.world.sphere_in_collision(
            p, self.radius_m
        )

    def fly(self, p: Point, q: Point) -> tuple[Point, bool, bool]:
        """Fly straight from `p` to `q` (world metres): position reached, collided, refused as out of bounds."""
        collision, out_of_bounds = self.motion_outcome(p, q)
        if out_of_bounds:
            return p, False, True
        return (self._contact_point(p, q) if collision else q), collision, False

    def motion_outcome(self, p: Point, q: Point) -> tuple[bool, bool]:
        """Return whether flying from `p` to `q` collides, and whether it leaves the bounds; see `fly`."""
        verdict = _classify(*p, *q, self.radius_m, self._arrays)
        if verdict in (_FREE, _OUTSIDE):
            return False, verdict == _OUTSIDE
        return self.world.segment_in_collision(p, q, self.radius_m), False

    def _contact_point(self, p: Point, q: Point) -> Point:
        length = sum((b - a) ** 2 for a, b in zip(p, q, strict=True)) ** 0.5
        free, touching = 0.0, 1.0
        while (touching - free) * length > _CONTACT_M:
            middle = 0.5 * (free + touching)
            if self.world.segment_in_collision(p, _interpolate(p, q, middle), self.radius_m):
                touching = middle
            else:
                free = middle
        return _interpolate(p, q, free)


def _interpolate(p: Point, q: Point, share: float) -> Point:
    return (p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1]), p[2] + share * (q[2] - p[2]))


def flight_space(mesh: Path, sha256: str, radius_m: float, keep: int = SEVERAL) -> FlightSpace:
    """Return the flight space of a scene's context, shared by all environments of a process."""
    return _flight_space_of(open_scene(mesh, sha256, keep), radius_m)


def prefetch_flight_space(mesh: Path, sha256: str, radius_m: float) -> None:
    """Read a scene and build its flight space, without the renderer: to be called in a background thread."""
    prefetch_mesh(mesh, sha256, lambda context: _flight_space_of(context, radius_m).world)


def _flight_space_of(context: SceneContext, radius_m: float) -> FlightSpace:
    return context.part("flight space", lambda: FlightSpace(context.scene, radius_m), radius_m)
