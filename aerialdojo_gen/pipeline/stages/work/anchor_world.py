"""Collision, reachability and visibility of candidate anchors in a scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.config.sections import AnchorSampleConfig
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.geometry.part_visibility import FRONT_RAD, Patch, off_front_rad, visible_shares
from aerialdojo_gen.geometry.portable import atan2
from aerialdojo_gen.geometry.rays import RayCaster, TriangleRayCaster, instance_caster
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.geometry.viewpoints import PointVisibility, Views, informativeness
from aerialdojo_gen.pipeline.scoring.base import AnchorView, CandidateMeasures
from aerialdojo_gen.pipeline.scoring.geometric import front_score, part_score, recognisability
from aerialdojo_gen.pipeline.scoring.views import take_view
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.rendering.casters import ray_caster
from aerialdojo_gen.rendering.raycast import ray_renderer
from aerialdojo_gen.scenes.model import Instance, Scene

Floats = NDArray[np.float64]
_LEAST_POINTS = 32
_POSE = ("x_m", "y_m", "z_m", "yaw_rad")


@dataclass(frozen=True)
class World:
    """A scene with its clearance grid and ray caster."""

    scene: Scene  # The scene
    free: ClearanceGrid  # For distances to surfaces, and for what is connected with the open sky
    rays: RayCaster  # For what is seen
    index: dict[str, int]  # Index of an instance by its node name

    @classmethod
    def of(cls, scene: Scene, radius_m: float, margin_m: float) -> World:
        """Build them for a body radius and a margin to surfaces."""
        return cls(
            scene,
            ClearanceGrid.of(scene, radius_m=radius_m, margin_m=margin_m),
            ray_caster(scene),
            {i.node: k for k, i in enumerate(scene.instances)},
        )


@dataclass(frozen=True, eq=False)
class Candidates:
    """Viewpoints of one object with their ray-cast measurements, some of them taken when they are first needed."""

    world: World
    instance: int  # The object's index in the scene
    points: Floats  # (m, 3) float64; on the object's surface, metres, world frame
    positions_m: Floats  # (n, 3) float64; the body's centres, world frame
    yaw_rad: Floats  # (n,) float64
    radius_m: float  # Of the body
    config: AnchorSampleConfig

    @cached_property
    def alone(self) -> TriangleRayCaster:
        """The object by itself."""
        return instance_caster(self.world.scene.instances[self.instance])

    @cached_property
    def sight(self) -> PointVisibility:
        """Which points of the object's surface they see."""
        return PointVisibility.of(
            self.positions_m, self.yaw_rad, self.points, self.alone, self.world.rays, self.instance,
            self.config.fov_deg,
        )  # fmt: skip

    @cached_property
    def clearance_m(self) -> Floats:
        """Their distance to the nearest surface, (n,) float64."""
        return self.world.free.distance_m(self.positions_m)

    @cached_property
    def patches(self) -> tuple[Patch, ...]:
        """Points of each of the object's identifying parts."""
        return patches_of(self.world, self.instance, self.points)

    @cached_property
    def part_shares(self) -> Floats:
        """Share that they see of each of those parts, (n, t) float64 (`part_visibility.visible_shares`)."""
        return visible_shares(self.positions_m, self.yaw_rad, self.patches, self.world.rays, self.config.fov_deg)

    @cached_property
    def views(self) -> Views:
        """What they see of the object."""
        return self.sight.views()

    @cached_property
    def elevation_deg(self) -> Floats:
        """Their elevation seen from the object's centroid, (n,) float64."""
        away = self.positions_m - self.world.scene.instances[self.instance].centroid
        return np.degrees(atan2(away[:, 2], np.hypot(away[:, 0], away[:, 1])))

    @cached_property
    def part_visibility(self) -> Floats:
        """How much of each identifying part they see beside the best of them, (n, t) float64."""
        return np.asarray(self.part_shares / np.maximum(self.part_shares.max(axis=0, initial=0.0), 1e-9))

    @cached_property
    def off_front_rad(self) -> Floats | None:
        """How far they are off the object's nearest front, (n,) float64; None where it has no front."""
        thing = self.world.scene.instances[self.instance]
        if thing.anatomy is None or not thing.anatomy.fronts_rad:
            return None
        return off_front_rad(self.positions_m, thing.centroid, thing.anatomy.fronts_rad)

    @cached_property
    def rank(self) -> Floats:
        """Score of the ray casts alone, (n,) float64, which decides what is pictured at all."""
        rank = informativeness(
            self.views, self.elevation_deg, self.clearance_m, self.radius_m, self.config.standoff_m
        )
        parts = part_score(self.part_visibility) if self.part_visibility.shape[1] else None
        return recognisability(rank, parts, front_score(self.off_front_rad))

    def moved(self, which: NDArray[np.int64], positions_m: Floats) -> Candidates:
        """Look from other places (k, 3), facing the same way; places that stay are not looked from again."""
        new = np.flatnonzero((positions_m != self.positions_m[which]).any(axis=1))
        moved = replace(self, positions_m=positions_m, yaw_rad=self.yaw_rad[which])
        away = replace(self, positions_m=positions_m[new], yaw_rad=moved.yaw_rad[new])
        for one in moved, away:
            vars(one).update(alone=self.alone, patches=self.patches)
        clearance, shares = self.clearance_m[which], self.part_shares[which]
        clearance[new], shares[new] = away.clearance_m, away.part_shares
        # What is measured already need not be when it is first needed.
        sight = self.sight.with_rows(which, new, away.sight)
        vars(moved).update(clearance_m=clearance, part_shares=shares, sight=sight)
        return moved

    def seeing(self, least: float) -> NDArray[np.int64]:
        """Numbers of the viewpoints that see at least so large a fraction of what faces them, and anything at all."""
        fraction = self.views.visible_fraction
        return np.flatnonzero((fraction > 0) & (fraction >= least))

    @property
    def before_front(self) -> NDArray[np.bool_]:
        """Which of the viewpoints are before a front of the object, (n,) bool; none where it has no front."""
        if self.off_front_rad is None:
            return np.zeros(len(self.positions_m), dtype=np.bool_)
        return np.asarray(self.off_front_rad <= FRONT_RAD)

    def viewpoints(self, which: NDArray[np.int64], object_id: int) -> list[dict[str, Any]]:
        """Rows of ``viewpoints``: where one may stop to have found the object."""
        ids = {"scene": self.world.scene.name, "object_id": object_id}
        return [ids | {"viewpoint_id": n} | self.pose(k) for n, k in enumerate(which)]

    def pose(self, k: int) -> dict[str, float]:
        """Columns of the k-th viewpoint's place and yaw."""
        return dict(zip(_POSE, (*self.positions_m[k].tolist(), float(self.yaw_rad[k])), strict=True))

    def measures(self, k: int) -> CandidateMeasures:
        """What is known of the view from the k-th viewpoint before it is pictured."""
        return CandidateMeasures(
            float(self.views.shown[k]), float(self.elevation_deg[k]), float(self.clearance_m[k]),
            tuple(self.part_visibility[k].tolist()),
            None if self.off_front_rad is None else float(self.off_front_rad[k]), float(self.views.framed[k]),
        )  # fmt: skip

    def picture(self, k: int, size_px: int) -> AnchorView:
        """Take the front view from the k-th viewpoint."""
        thing, camera = self.world.scene.instances[self.instance], Camera(size_px, size_px, self.config.fov_deg)
        return take_view(
            ray_renderer(self.world.scene), self.alone, thing, self.instance, camera, self.positions_m[k],
            float(self.yaw_rad[k]), self.measures(k), part_faces(thing),
        )  # fmt: skip

    def row(self, k: int, surface_distance_m: float) -> dict[str, Any]:
        """What a row of ``anchors`` says of where the k-th viewpoint is and what it sees."""
        return {
            **self.pose(k),
            "clearance_m": float(self.clearance_m[k]),
            "surface_distance_m": surface_distance_m,
            "visible_fraction": float(self.views.visible_fraction[k]),
            "off_front_rad": None if self.off_front_rad is None else float(self.off_front_rad[k]),
        }


def part_faces(instance: Instance) -> list[NDArray[np.int64]]:
    """The faces of each of an instance's identifying parts that it has."""
    names = () if instance.anatomy is None else instance.anatomy.identifying_parts
    return [faces for faces in map(instance.faces_of, names) if len(faces)]


def patches_of(world: World, instance: int, points: Floats) -> tuple[Patch, ...]:
    """Points of each of an instance's identifying parts, drawn by the number of its surface's points."""
    thing = world.scene.instances[instance]
    # The draw depends on scene and node only.
    rng = generator(0, "anchor-sample", world.scene.name, thing.node)
    n = max(_LEAST_POINTS, len(points) // 4)
    return tuple(
        Patch.of(Surface(thing.vertices, thing.faces[faces]), n, rng, world.rays, world.scene.sun)
        for faces in part_faces(thing)
    )
