"""Checks of anchors: their ranks, where they look, how far the surfaces are, and whether the body can be there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Ints, Rows, SceneData, at
from aerialdojo_gen.geometry.frames import wrap_angle_rad, yaw_towards
from aerialdojo_gen.geometry.part_visibility import FRONT_RAD
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.pipeline.scoring.ensemble import SCORERS
from aerialdojo_gen.pipeline.scoring.geometric import FACTORS, FRONT_WEIGHT, PARTS_WEIGHT, WEIGHTS, clarity_score
from aerialdojo_gen.pipeline.stages.work.anchor_choice import SLACK_M

_SAME_M = 1e-4
_SAME_RAD = 1e-6
_SAME_SCORE = 1e-9
# Anchors are marched to the wanted distance to a tenth of a millimetre; this is what a definition of 1 m bears.
_STANDOFF_M = 1e-3


@check("anchors", after=("duplicate_key",))
def anchor_rank(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Ranks of an object's anchors count from 0, the better score first, but for a person's choice."""
    ids, ranks, score = rows.ints("object_id"), rows.ints("anchor_id"), rows.floats("score")
    annotated = rows.texts("selected_by") == "annotation"
    for object_id in np.unique(ids):
        own = np.flatnonzero(ids == object_id)
        own = own[np.argsort(ranks[own], kind="stable")]
        for expected, row in enumerate(own.tolist()):
            before = own[expected - 1] if expected else row
            if ranks[row] != expected:
                yield Finding(row, f"rank {ranks[row]}", f"rank {expected}")
                break
            if score[row] > score[before] and not annotated[before]:
                yield Finding(row, f"score {score[row]:.6g}", f"{score[before]:.6g} at most, the rank before")


@check("anchors")
def anchor_visibility(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor sees enough of its object, by its own account."""
    least, seen = data.pipeline.anchor_sample.min_visible_fraction, rows.floats("visible_fraction")
    for row in np.flatnonzero(~((seen >= least) & (seen > 0) & (seen <= 1))):
        yield Finding(int(row), f"visible_fraction = {seen[row]:.6g}", f"{least:g} to 1")


@check("anchors")
def anchor_score(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor's score is what its parts make of it: each from 0 to 1, weighed as the pipeline says."""
    weights = data.pipeline.anchor_sample.weights
    asked = {name: getattr(weights, name) for name in SCORERS}
    scores = {name: rows.floats(f"score_{name}") for name in SCORERS}
    names, optional = (*WEIGHTS, *FACTORS), ("tells", "front")
    parts, known = (rows.floats(*(f"part_{name}" for name in some)) for some in (names, optional))
    for some, values, wrong, allowed in (
        (names, parts, ~((parts >= 0) & (parts <= 1)), "0 to 1"),
        (optional, known, (known < 0) | (known > 1), "0 to 1, or null"),
    ):
        for row, k in np.argwhere(wrong).tolist():
            yield Finding(row, f"part_{some[k]} = {values[row, k]:.6g}", allowed)
    geometric = parts[:, : len(WEIGHTS)] @ np.array([*WEIGHTS.values()])
    share = np.where(np.isnan(known), 0.0, [PARTS_WEIGHT, FRONT_WEIGHT])
    geometric = geometric * (1.0 - share.sum(axis=1)) + (share * np.nan_to_num(known)).sum(axis=1)
    framed, unhindered = parts[:, len(WEIGHTS) :].T
    unoccluded, level = (parts[:, names.index(name)] for name in ("unoccluded", "level"))
    geometric = geometric * clarity_score(unoccluded, framed, 1.0 - unhindered, level)
    annotated = rows.texts("selected_by") == "annotation"
    for row, score in enumerate(rows.floats("score")):
        own = {name: values[row] for name, values in scores.items() if np.isfinite(values[row])}
        uncalled = sorted(name for name in own if not asked[name] and not annotated[row])
        total = sum(asked[name] for name in own)
        expected = sum(asked[name] * value for name, value in own.items()) / total if total else 0.0
        if uncalled:
            yield Finding(row, f"score_{uncalled[0]} = {own[uncalled[0]]:.6g}", "null: the scorer was not asked")
        elif "geometric" in own and abs(own["geometric"] - geometric[row]) > _SAME_SCORE:
            yield Finding(row, f"score_geometric = {own['geometric']:.6g}", f"{geometric[row]:.6g} by its parts")
        elif not annotated[row] and asked["geometric"] and "geometric" not in own:
            yield Finding(row, "score_geometric is null", f"{geometric[row]:.6g} by its parts")
        # What a person placed was compared with nothing: it has the geometric score alone.
        elif min(abs(score - s) for s in (expected, *([geometric[row]] if annotated[row] else []))) > _SAME_SCORE:
            yield Finding(row, f"score = {score:.6g}", f"{expected:.6g} by its parts")


@check("anchors", after=("unknown_object",))
def anchor_front(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor says how far off its object's front it is; a goal more than 60 degrees off says why."""
    scene, nodes, off = data.mesh, data["objects"].texts("mesh_node"), rows.floats("off_front_rad")
    reasons, selected = rows.texts("no_front_reason"), rows.floats("selected") == 1.0
    places = rows.floats("x_m", "y_m", "z_m")
    for row, k in enumerate(data.objects_of(rows).tolist()):
        if k < 0 or nodes[k] not in scene or not np.isfinite(places[row]).all():
            continue
        anatomy = scene[str(nodes[k])].anatomy
        fronts = () if anatomy is None else anatomy.fronts_rad
        away = places[row] - scene[str(nodes[k])].centroid
        azimuth = np.arctan2(away[1], away[0])
        found = min((abs(float(wrap_angle_rad(azimuth - front))) for front in fronts), default=np.nan)
        if np.isnan(found) != np.isnan(off[row]) or abs(found - off[row]) > _SAME_RAD:
            yield Finding(row, f"off_front_rad = {off[row]:.6g}", f"{found:.6g}")
        elif bool(reasons[row]) != bool(selected[row] and found > FRONT_RAD):
            expected = "a reason: it is not seen from its front" if not reasons[row] else "null"
            yield Finding(row, f"no_front_reason = {reasons[row]!r}", expected)


@check("anchors", after=("unknown_object",))
def anchor_step(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A selected anchor steps back as far as its object's picture was taken, in centimetres."""
    back, most = rows.floats("step_back_m"), data.pipeline.anchor_sample.step_back_m
    selected, stored = rows.floats("selected") == 1.0, data["objects"].floats("step_back_m")
    for row, k in enumerate(data.objects_of(rows).tolist()):
        expected = min(back[row], data.pipeline.reference_images.step_back_m)
        if not 0.0 <= back[row] <= most or abs(back[row] * 100.0 - round(back[row] * 100.0)) > _SAME_M:
            yield Finding(row, f"step_back_m = {back[row]:.6g}", f"0 to {most:g}, in centimetres")
        elif k >= 0 and selected[row] and np.isfinite(stored[k]) and abs(stored[k] - expected) > _SAME_SCORE:
            yield Finding(row, f"step_back_m = {back[row]:.6g}", f"{stored[k]:g}, as far as its picture was taken")


@check("viewpoints", after=("viewpoint_object",))
def viewpoint_place(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A viewpoint is at the standoff from its object's surface and faces its centre; numbers count from 0."""
    expected = data.pipeline.anchor_sample.standoff_m
    place, yaw, number = rows.floats("x_m", "y_m", "z_m"), rows.floats("yaw_rad"), rows.ints("viewpoint_id")
    centre = data["objects"].floats("x_m", "y_m", "z_m")
    for k, own, distance in _distances(data, rows):
        off = np.abs(wrap_angle_rad(yaw[own] - yaw_towards(place[own], centre[k])))
        for n, row in enumerate(own.tolist()):
            if abs(distance[n] - expected) > _STANDOFF_M:
                yield Finding(row, f"{distance[n]:.4f} m from the object's surface", f"{expected:g} m")
            elif off[n] > _SAME_RAD:
                yield Finding(row, f"yaw_rad = {yaw[row]:.6g}", "the yaw that faces the object's centre")
            elif number[row] != n:
                yield Finding(row, f"viewpoint_id = {number[row]}", f"{n}")


def _distances(data: SceneData, rows: Rows) -> Iterator[tuple[int, Ints, Floats]]:
    """Objects in the mesh, by their row, with the rows that are at a place by each, and how far from its surface."""
    scene, nodes = data.mesh, data["objects"].texts("mesh_node")
    item, place = data.objects_of(rows), rows.floats("x_m", "y_m", "z_m")
    for k in np.unique(item[item >= 0]).tolist():
        own = np.flatnonzero((item == k) & np.isfinite(place).all(axis=1))
        if nodes[k] in scene and len(own):
            yield k, own, Surface.of(scene[str(nodes[k])]).distance_m(place[own])


@check("viewpoints", after=("viewpoint_place",))
def viewpoint_clearance(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A body can be at a viewpoint, inside the flight volume."""
    world, radius = data.world, data.pipeline.embodiment.radius_m
    low, high = data.mesh.bounds
    for row, place in enumerate(rows.floats("x_m", "y_m", "z_m")):
        if not (np.isfinite(place).all() and ((place >= low) & (place <= high)).all()):
            yield Finding(row, "a place outside the flight volume", "one inside")
        elif world.sphere_in_collision(place, radius):
            yield Finding(row, "a place in collision", "a free one")


@check("anchors", after=("unknown_object",))
def anchor_yaw(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor faces its object's centre, unless a person placed it."""
    item, own = data.objects_of(rows), rows.floats("yaw_rad")
    centre = at(data["objects"].floats("x_m", "y_m", "z_m").reshape(-1, 3), item)
    yaw = yaw_towards(rows.floats("x_m", "y_m", "z_m"), centre)
    fit = data.comparable("objects", item) & (rows.texts("selected_by") != "annotation")
    for row in np.flatnonzero(fit & (np.abs(wrap_angle_rad(own - yaw)) > _SAME_RAD)):
        yield Finding(int(row), f"{own[row]:.6f} rad", f"{yaw[row]:.6f} rad")


@check("anchors", after=("unknown_object",))
def anchor_surface(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor is 1 m from its object's surface (about that, where a person placed it), and says how far."""
    annotated = rows.texts("selected_by") == "annotation"
    slack = np.where(annotated, SLACK_M + _SAME_M, _STANDOFF_M)
    expected, stored = data.pipeline.anchor_sample.standoff_m, rows.floats("surface_distance_m")
    for _, own, distances in _distances(data, rows):
        for row, distance in zip(own.tolist(), distances.tolist(), strict=True):
            if abs(distance - expected) > slack[row]:
                yield Finding(row, f"{distance:.4f} m from the object's surface", f"{expected:g} m")
            elif abs(distance - stored[row]) > _SAME_M:
                yield Finding(row, f"surface_distance_m = {stored[row]:.6g}", f"{distance:.6g}")


@check("anchors", after=("anchor_surface",))
def anchor_clearance(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor is free of collision, and says how far the nearest surface is."""
    world, radius = data.world, data.pipeline.embodiment.radius_m
    stored = rows.floats("clearance_m")
    for row, place in enumerate(rows.floats("x_m", "y_m", "z_m")):
        distance = world.distance_m(place) if np.isfinite(place).all() else np.nan
        if distance <= radius:
            yield Finding(row, f"a surface at {distance:.4f} m", f"more than the body's radius, {radius:g} m")
        elif abs(distance - stored[row]) > _STANDOFF_M:
            yield Finding(row, f"clearance_m = {stored[row]:.6g}", f"{distance:.6g}")
