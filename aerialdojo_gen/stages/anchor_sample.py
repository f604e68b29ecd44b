"""`anchor-sample`: viewpoints at 1 m from each object that see it (paper: anchors)."""

from __future__ import annotations

import logging
import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.config import AnchorSampleConfig
from aerialdojo_gen.errors import StoreError
from aerialdojo_gen.geometry.frames import yaw_towards
from aerialdojo_gen.geometry.rays import RayCaster, instance_caster
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.geometry.viewpoints import around, informativeness, look, shortlist
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.rng import generator
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.schemas import ANCHORS
from aerialdojo_gen.stage import Job, Output
from aerialdojo_gen.stages.anchor_choice import with_choice
from aerialdojo_gen.tables import from_rows

Floats = NDArray[np.float64]
log = logging.getLogger(__name__)

REASONS = ("no_surface", "out_of_bounds", "in_collision", "unreachable", "not_visible", "not_shortlisted")


@dataclass(frozen=True)
class World:
    """A scene, and what is asked of it for every object.

    Attributes
    ----------
    scene : Scene
        The scene.
    collisions : CollisionWorld
        For collision and clearance.
    free : ClearanceGrid
        For what is connected with the open sky.
    rays : RayCaster
        For what is seen.
    index : dict of str to int
        Index of an instance by its node name.
    """

    scene: Scene
    collisions: CollisionWorld
    free: ClearanceGrid
    rays: RayCaster
    index: dict[str, int]

    @classmethod
    def of(cls, scene: Scene, radius_m: float, margin_m: float) -> World:
        """Build it all for a body of a radius that keeps a margin to surfaces."""
        return cls(
            scene,
            CollisionWorld(scene),
            ClearanceGrid.build(scene, radius_m=radius_m, margin_m=margin_m),
            RayCaster(scene),
            {i.node: k for k, i in enumerate(scene.instances)},
        )


def run(job: Job, config: AnchorSampleConfig) -> Output:
    """Find, judge and rank the anchors of every object of a scene.

    A candidate lies `standoff_m` from the object's surface (its mesh, not its box) and faces its centroid in yaw. It
    goes through these tests, and is counted under the first that it fails: ``no_surface`` (its line comes nowhere
    near the surface), ``out_of_bounds`` (the body leaves the flight volume), ``in_collision`` (a surface within
    the body's radius plus `margin_m`), ``unreachable`` (no way from the open sky: inside a closed room),
    ``not_visible`` (visible fraction below `min_visible_fraction`), ``not_shortlisted`` (`shortlist` others show the
    object better, or from a side of their own). The rest are the object's anchors, the best of them is selected, or
    the one that a person chose, which then comes first.

    Parameters
    ----------
    job : Job
        The scene; reads `objects`, `chosen_anchors` and the scene's mesh.
    config : AnchorSampleConfig
        The stage's section.

    Returns
    -------
    Output
        `anchors`. Rows in are the candidates, and rows in is rows out plus the counts above; ``no_anchor`` besides
        counts the objects that have none, each of which is named in a warning.

    Raises
    ------
    StoreError
        An object's mesh node is not in the scene: the two tables do not belong together.
    AnnotationError
        A viewpoint that a person chose will not do.
    """
    objects = job.read("objects").to_pylist()
    chosen = {row["object_id"]: row for row in job.read("chosen_anchors").to_pylist()}
    world = World.of(job.scene_model(), job.embodiment.radius_m, config.margin_m)
    rows: list[dict[str, Any]] = []
    counts: Counter[str] = Counter(dict.fromkeys(REASONS, 0))
    bare = 0
    for item in objects:
        if item["mesh_node"] not in world.index:
            raise StoreError(
                f"{job.scene}: object {item['object_id']} ({item['name']}) has the mesh node {item['mesh_node']!r}, "
                "which is not in the scene: run annotate-import again"
            )
        found, rejected = anchors_of(item, world, job, config)
        if item["object_id"] in chosen:
            sampled = found
            found = with_choice(sampled, chosen[item["object_id"]], item, world, job, config)
            rejected["not_shortlisted"] += sum(all(row["x_m"] != f["x_m"] for f in found) for row in sampled)
        rows += found
        counts += rejected
        if not found:
            bare += 1
            why = ", ".join(f"{reason} {n}" for reason, n in rejected.items() if n)
            log.warning("%s: object %d (%s) has no anchor: %s", job.scene, item["object_id"], item["name"], why)
    tally = {reason: counts[reason] for reason in REASONS}
    return Output(
        {"anchors": from_rows(ANCHORS, rows)},
        rows_in=len(rows) + sum(tally.values()),
        rows_out=len(rows),
        counts=tally | {"no_anchor": bare},
    )


def anchors_of(
    item: dict[str, Any], world: World, job: Job, config: AnchorSampleConfig
) -> tuple[list[dict[str, Any]], Counter[str]]:
    """Find one object's anchors.

    Parameters
    ----------
    item : dict
        The object's row of `objects`.
    world : World
        The scene.
    job : Job
        For its scene's name, seed and embodiment.
    config : AnchorSampleConfig
        The stage's section.

    Returns
    -------
    rows : list of dict
        Rows of `anchors`, the best first, at most `shortlist`.
    rejected : Counter of str
        How many candidates failed which test; with the rows, all of them.
    """
    k = world.index[item["mesh_node"]]
    instance: Instance = world.scene.instances[k]
    surface = Surface.of(instance)
    centroid = np.array([item["x_m"], item["y_m"], item["z_m"]])
    radius = job.embodiment.radius_m
    rejected: Counter[str] = Counter()

    places = around(
        surface, instance.bounds, config.standoff_m, config.azimuths, config.elevations_deg, config.level_heights
    )

    def keep(places: Floats, passed: NDArray[np.bool_], reason: str) -> Floats:
        rejected[reason] += int((~passed).sum())
        return places[passed]

    places = keep(places, ~np.isnan(places[:, 0]), "no_surface")
    low, high = world.scene.bounds
    places = keep(places, ((places >= low + radius) & (places <= high - radius)).all(axis=1), "out_of_bounds")
    body = radius + config.margin_m
    touching = np.array([world.collisions.sphere_in_collision(p, body) for p in places], dtype=np.bool_)
    places = keep(places, ~touching, "in_collision")
    places = keep(places, np.array([world.free.reachable(p) for p in places], dtype=np.bool_), "unreachable")
    if not len(places):
        return [], rejected

    clearance = np.array([world.collisions.distance_m(p) for p in places])
    yaw = yaw_towards(places, centroid)
    points = surface.sample(config.surface_points, generator(job.seed, "anchor-sample", job.scene, item["object_id"]))
    views = look(places, yaw, points, instance_caster(instance), world.rays, k, config.fov_deg)
    away = places - centroid
    elevation = np.degrees(np.arctan2(away[:, 2], np.hypot(away[:, 0], away[:, 1])))
    score = informativeness(views, elevation, clearance, radius, config.standoff_m)

    seen = np.flatnonzero((views.visible_fraction > 0) & (views.visible_fraction >= config.min_visible_fraction))
    azimuth = np.arctan2(away[seen, 1], away[seen, 0])
    best = seen[shortlist(score[seen], azimuth, config.shortlist, math.radians(config.separation_deg))]
    rejected["not_visible"] += len(places) - len(seen)
    rejected["not_shortlisted"] += len(seen) - len(best)
    own_distance = surface.distance_m(places[best])
    rows = [
        {
            "scene": job.scene,
            "object_id": item["object_id"],
            "anchor_id": rank,
            **dict(zip(("x_m", "y_m", "z_m"), places[i].tolist(), strict=True)),
            "yaw_rad": float(yaw[i]),
            "clearance_m": float(clearance[i]),
            "surface_distance_m": float(own_distance[rank]),
            "visible_fraction": float(views.visible_fraction[i]),
            "score": float(score[i]),
            "selected": rank == 0,
            "selected_by": "auto",
        }
        for rank, i in enumerate(best)
    ]
    return rows, rejected
