"""The body in a scene: the motion of an action, and whether its sweep touches anything.

One motion model in the project: magnitudes and headings are those of `aerialdojo_gen.geometry.motion`. A leg
that the clearance grid proves free needs no more; FCL is asked about the others, a capsule for the exact sweep. That
is what `aerialdojo_gen.planning.certify` does for reference trajectories, and what makes tens of thousands of steps a
second.
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
# How well the place of a contact is known, metres.
_CONTACT_M = 1e-3


@njit(cache=True)
def _judge(
    px: float, py: float, pz: float, qx: float, qy: float, qz: float, radius: float, grid: GridArrays
) -> int:  # fmt: skip
    if not inside(qx, qy, qz, grid.lower, grid.upper):
        return _OUTSIDE
    return _FREE if segment_free(px, py, pz, qx, qy, qz, radius, grid, True) else _UNDECIDED


class FlightSpace:
    """A scene to fly in."""

    def __init__(self, scene: Scene, radius_m: float, world: CollisionWorld | None = None) -> None:
        self.scene = scene
        self.radius_m = radius_m
        # An episode ends by a touch, and below open ground there is none.
        self.grid = ClearanceGrid.of(scene, radius_m=radius_m, closed_ground=False)
        self._arrays = self.grid.arrays
        self._world = world

    @cached_property
    def world(self) -> CollisionWorld:
        """FCL's world; built when the grid is first at a loss."""
        return self._world or collision_world(self.scene)

    def in_collision(self, p: Point) -> bool:
        """Whether the body at `p`, metres, world frame, touches a surface."""
        return _judge(*p, *p, self.radius_m, self._arrays) != _FREE and self.world.sphere_in_collision(
            p, self.radius_m
        )

    def fly(self, p: Point, q: Point) -> tuple[Point, bool, bool]:
        """Fly straight from `p` to `q` (world metres).

        The position reached, whether it collided, whether the volume's bounds refused it.
        """
        collision, refused = self.hindered(p, q)
        if refused:
            return p, False, True
        return (self._contact(p, q) if collision else q), collision, False

    def hindered(self, p: Point, q: Point) -> tuple[bool, bool]:
        """Say what keeps a body from flying from `p` to `q`: `fly` without where it then is."""
        verdict = _judge(*p, *q, self.radius_m, self._arrays)
        if verdict in (_FREE, _OUTSIDE):
            return False, verdict == _OUTSIDE
        return self.world.segment_in_collision(p, q, self.radius_m), False

    def _contact(self, p: Point, q: Point) -> Point:
        length = sum((b - a) ** 2 for a, b in zip(p, q, strict=True)) ** 0.5
        free, touching = 0.0, 1.0
        while (touching - free) * length > _CONTACT_M:
            middle = 0.5 * (free + touching)
            if self.world.segment_in_collision(p, _between(p, q, middle), self.radius_m):
                touching = middle
            else:
                free = middle
        return _between(p, q, free)


def _between(p: Point, q: Point, share: float) -> Point:
    return (p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1]), p[2] + share * (q[2] - p[2]))


def flight_space(mesh: Path, sha256: str, radius_m: float, keep: int = SEVERAL) -> FlightSpace:
    """Return a scene to fly in, a part of the scene's context: for all environments of a process."""
    return _space_of(open_scene(mesh, sha256, keep), radius_m)


def build_ahead(mesh: Path, sha256: str, radius_m: float) -> None:
    """Read a scene and build all that flying wants but what draws, for `flight_space` to find: in another thread."""
    prefetch_mesh(mesh, sha256, lambda context: _space_of(context, radius_m).world)


def _space_of(context: SceneContext, radius_m: float) -> FlightSpace:
    return context.part("flight space", lambda: FlightSpace(context.scene, radius_m), radius_m)
