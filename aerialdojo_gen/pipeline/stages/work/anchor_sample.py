"""`anchor-sample`: viewpoints at 1 m from each object that see it (paper: anchors)."""

from __future__ import annotations

import logging
import math
from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.config.sections import AnchorSampleConfig
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.frames import yaw_towards
from aerialdojo_gen.geometry.part_visibility import FRONT_RAD, off_front_rad
from aerialdojo_gen.geometry.portable import atan2
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.geometry.viewpoints import ring, shortlist
from aerialdojo_gen.pipeline.scoring.geometric import judge
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.pipeline.stages.work.anchor_choice import with_choice
from aerialdojo_gen.pipeline.stages.work.anchor_pictures import CandidateViews, best_pictured
from aerialdojo_gen.pipeline.stages.work.anchor_world import Candidates, World, part_faces
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.store.schemas import ANCHORS, VIEWPOINTS
from aerialdojo_gen.store.tables import from_rows

Floats = NDArray[np.float64]
log = logging.getLogger(__name__)

# So many times what is pictured is ray cast from where its reference picture would be taken.
_RAY_CAST_FACTOR = 4
# More parts than that get no candidates of their own.
_MAX_PARTS = 4
# The tests that a candidate goes through, in their order; it is counted under the first that it fails.
REASONS = (
    "no_surface",  # its line comes nowhere near the object's surface
    "out_of_bounds",  # the body leaves the flight volume
    "in_collision",  # a surface is within the body's radius plus `margin_m`
    "unreachable",  # no way from the open sky: inside a closed room, or below ground that is an open sheet
    "not_visible",  # visible fraction below `min_visible_fraction`
    "not_shortlisted",  # `shortlist` others show the object better, or from a side of their own
)


def run(job: Job, config: AnchorSampleConfig) -> Output:
    """Find, judge and rank the anchors of every object of a scene."""
    objects = job.read("objects").to_pylist()
    chosen = {row["object_id"]: row for row in job.read("chosen_anchors").to_pylist()}
    world = World.of(job.scene_model(), job.embodiment.radius_m, config.margin_m)
    rows: list[dict[str, Any]] = []
    viewpoints: list[dict[str, Any]] = []
    counts: Counter[str] = Counter(dict.fromkeys(REASONS, 0))
    bare = 0
    for item in objects:
        if item["mesh_node"] not in world.index:
            raise StoreError(
                f"{job.scene}: object {item['object_id']} ({item['name']}) has the mesh node {item['mesh_node']!r}, "
                f"which is not in the scene: run {command('annotate-import', scene=job.scene)}"
            )
        anchors, rejected, seen = anchors_of(item, world, job, config)
        viewpoints += seen
        if item["object_id"] in chosen:
            before = anchors
            anchors = with_choice(before, chosen[item["object_id"]], item, world, job, config)
            rejected["not_shortlisted"] += sum(all(row["x_m"] != f["x_m"] for f in anchors) for row in before)
        rows += anchors
        counts += rejected
        if not anchors:
            bare += 1
            why = ", ".join(f"{reason} {n}" for reason, n in rejected.items() if n)
            log.warning("%s: object %d (%s) has no anchor: %s", job.scene, item["object_id"], item["name"], why)
    by_reason = {reason: counts[reason] for reason in REASONS}
    return Output(
        {"anchors": from_rows(ANCHORS, rows), "viewpoints": from_rows(VIEWPOINTS, viewpoints)},
        rows_in=len(rows) + sum(by_reason.values()),
        rows_out=len(rows),
        counts=by_reason | {"no_anchor": bare},
    )


def anchors_of(
    item: dict[str, Any], world: World, job: Job, config: AnchorSampleConfig
) -> tuple[list[dict[str, Any]], Counter[str], list[dict[str, Any]]]:
    """Find one object's anchors, how many candidates each test rejects, and its viewpoints."""
    candidates, rejected, nearly = candidates_of(item, world, job, config)
    if candidates is None:
        return [], rejected, []
    rows = shortlisted(item, candidates, nearly)
    seen = candidates.seeing(config.min_visible_fraction)
    rejected["not_visible"] += len(candidates.positions_m) - len(seen)
    rejected["not_shortlisted"] += len(seen) - len(rows)
    return rows, rejected, candidates.viewpoints(seen, item["object_id"])


def shortlisted(item: dict[str, Any], candidates: Candidates, nearly: Counter[str]) -> list[dict[str, Any]]:
    """Picture and score the best candidates of an object, and keep the best of those."""
    scene, config = candidates.world.scene, candidates.config
    seen = candidates.seeing(config.min_visible_fraction)
    away = candidates.positions_m - scene.instances[candidates.instance].centroid
    azimuth = atan2(away[:, 1], away[:, 0])
    front = candidates.before_front
    separation_rad = math.radians(config.separation_deg)
    pictured = max(config.pictured, config.shortlist)
    # Several a side: what stands before the object from one place does not from the next.
    ray_cast = seen[np.argsort(-candidates.rank[seen], kind="stable")[: _RAY_CAST_FACTOR * pictured]]
    of_sides = seen[shortlist(candidates.rank[seen], azimuth[seen], pictured, separation_rad, front[seen])]
    candidate_views = CandidateViews.of(candidates, np.union1d(ray_cast, of_sides))
    of_ray_cast = shortlist(
        candidate_views.rank, azimuth[candidate_views.which], pictured, separation_rad, front[candidate_views.which]
    )
    few, backs = candidate_views.which[of_ray_cast], candidate_views.step_back_m[of_ray_cast].tolist()
    best, shown = best_pictured(item["name"], candidate_views, of_ray_cast, azimuth[few], front[few])
    own_distance = Surface.of(scene.instances[candidates.instance]).distance_m(candidates.positions_m[few[best]])
    why = None
    if len(best) and front[seen].any() and not front[few[best[0]]]:
        why = "better_elsewhere"
    elif len(best) and candidates.off_front_rad is not None and not front[few[best[0]]]:
        nearly["not_visible"] += int((candidates.off_front_rad <= FRONT_RAD).sum())
        why = max(sorted(nearly), key=lambda reason: nearly[reason]) if nearly.total() else "no_surface"
    return [
        {
            "scene": scene.name,
            "object_id": item["object_id"],
            "anchor_id": rank,
            **candidates.row(int(few[n]), float(own_distance[rank])),
            "step_back_m": backs[n],
            "no_front_reason": why if rank == 0 else None,
            "score": verdict.score,
            **verdict.parts,
            **judge(picture, candidates.radius_m, config.standoff_m).columns,
            "thumbnail": picture.jpeg(),
            "selected": rank == 0,
            "selected_by": "auto",
        }
        for rank, (n, (picture, verdict)) in enumerate(zip(best.tolist(), shown, strict=True))
    ]


def candidates_of(
    item: dict[str, Any], world: World, job: Job, config: AnchorSampleConfig
) -> tuple[Candidates | None, Counter[str], Counter[str]]:
    """Find where an object can be looked at from: everywhere around it that a drone can be."""
    k = world.index[item["mesh_node"]]
    instance: Instance = world.scene.instances[k]
    surface = Surface.of(instance)
    radius = job.embodiment.radius_m
    rejected: Counter[str] = Counter()
    nearly: Counter[str] = Counter()
    anatomy = instance.anatomy
    fronts = anatomy.fronts_rad if anatomy is not None else ()
    places = ring(
        surface, instance.bounds, config.standoff_m, config.azimuths, config.elevations_deg, config.level_heights
    )
    triangles = instance.vertices[instance.faces]
    for faces in part_faces(instance)[:_MAX_PARTS]:
        box = np.stack([triangles[faces].min(axis=(0, 1)), triangles[faces].max(axis=(0, 1))])
        places = np.concatenate(
            [places, ring(surface, box, config.standoff_m, config.azimuths, config.tell_elevations_deg, ())]
        )

    def keep(places: Floats, passed: NDArray[np.bool_], reason: str) -> Floats:
        rejected[reason] += int((~passed).sum())
        if fronts and reason != "no_surface":
            off = off_front_rad(places[~passed], instance.centroid, fronts)
            nearly[reason] += int((off <= FRONT_RAD).sum())
        return places[passed]

    places = keep(places, ~np.isnan(places[:, 0]), "no_surface")
    low, high = world.scene.bounds
    places = keep(places, ((places >= low + radius) & (places <= high - radius)).all(axis=1), "out_of_bounds")
    places = keep(places, world.free.distance_m(places) > radius + config.margin_m, "in_collision")
    places = keep(places, np.array([world.free.reachable(p) for p in places], dtype=np.bool_), "unreachable")
    if not len(places):
        return None, rejected, nearly
    centroid = np.array([item["x_m"], item["y_m"], item["z_m"]])
    points = surface.sample(config.surface_points, generator(job.seed, "anchor-sample", job.scene, item["object_id"]))
    candidates = Candidates(world, k, points, places, yaw_towards(places, centroid), radius, config)
    return candidates, rejected, nearly
