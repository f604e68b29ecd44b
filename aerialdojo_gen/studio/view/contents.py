"""JSON and binary data for the page of a scene: places, routes, and one route in detail."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.dataset.lookup import ReleasedScene
from aerialdojo_gen.geometry.motion import sampled
from aerialdojo_gen.store import schemas

_OBJECT = ("object_id", "name", "category", "description", "mesh_node", "direction", "landmark_id")
# Sine of the angle below which a route is straight.
_STRAIGHT = 1e-5
_NUMBERS = ("euclidean_m", "length_m", "detour_ratio", "min_clearance_m")


def scene_index(scene: ReleasedScene) -> dict[str, Any]:
    """Return what the page lists and filters: JSON values, world metres to a millimetre."""
    names = {row["landmark_id"]: row["name"] for row in scene.landmarks}
    routes = scene.routes.drop_columns(["x_m", "y_m", "z_m", "yaw_rad", "action"])
    modalities: dict[str, list[str]] = {}
    tasks = scene.both_sides("tasks", ["nav_id", "modality"])
    for nav_id, modality in zip(tasks["nav_id"].to_pylist(), tasks["modality"].to_pylist(), strict=True):
        modalities.setdefault(nav_id, []).append(modality)
    ids = routes["nav_id"].to_pylist()
    return {
        "scene": {key: scene.row[key] for key in ("scene", "family", "scene_type", "partition", "n_triangles")},
        "settings": list(schemas.SETTINGS),
        "splits": sorted(set(routes["split"].to_pylist())),
        "landmarks": [
            {"id": row["landmark_id"], "name": row["name"], "node": row["mesh_node"], "position": _xyz(row)}
            for row in scene.landmarks
        ],
        "objects": [
            {key: row[key] for key in _OBJECT}
            | {
                "position": _xyz(row),
                "size": [round(row[f"size_{a}_m"], 3) for a in "xyz"],
                "landmark": names.get(row["landmark_id"], ""),
                "image": row["reference_image"] is not None,
            }
            for row in scene.objects
        ],
        "anchors": [
            {key: row[key] for key in ("object_id", "anchor_id", "selected")}
            | {
                "position": _xyz(row),
                "yaw_rad": round(row["yaw_rad"], 4),
                "clearance_m": round(row["clearance_m"], 3),
            }
            for row in scene.anchors
        ],
        "routes": {
            "nav_id": ids,
            "modality": [modalities.get(nav_id, []) for nav_id in ids],
            **{
                key: routes[key].to_pylist()
                for key in ("setting", "split", "start_object_id", "start_anchor_id", "target_object_id", "n_actions")
            },
            **{key: np.round(routes[key].to_numpy(), 3).tolist() for key in _NUMBERS},
        },
    }


def _xyz(row: dict[str, Any]) -> list[float]:
    return [round(row[f"{axis}_m"], 3) for axis in "xyz"]


def route_points(scene: ReleasedScene) -> bytes:
    """Pack all routes for the page, little-endian: n, n + 1 offsets, then float32 x y z in metres."""
    routes = scene.routes
    lists = [routes[f"{axis}_m"].combine_chunks() for axis in "xyz"]
    offsets = lists[0].offsets.to_numpy().astype(np.int64)
    flat = np.column_stack([column.values.to_numpy() for column in lists])
    flat, offsets = flat[offsets[0] : offsets[-1]], offsets - offsets[0]
    ends = np.zeros(len(flat), dtype=np.bool_)
    ends[offsets[:-1]] = True
    flat, offsets = _without(~ends & np.all(flat == np.roll(flat, 1, axis=0), axis=1), flat, offsets)
    ends = np.zeros(len(flat), dtype=np.bool_)
    ends[offsets[:-1]] = ends[offsets[1:] - 1] = True
    before, after = flat - np.roll(flat, 1, axis=0), np.roll(flat, -1, axis=0) - flat
    steps = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    straight = np.linalg.norm(np.cross(before, after), axis=1) <= _STRAIGHT * steps
    straight &= np.einsum("ij,ij->i", before, after) > 0
    flat, offsets = _without(~ends & straight, flat, offsets)
    return struct.pack("<I", len(routes)) + offsets.astype("<u4").tobytes() + flat.astype("<f4").tobytes()


def _without(
    dropped: NDArray[np.bool_], flat: NDArray[Any], offsets: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    kept: NDArray[np.int64] = np.concatenate([[0], np.cumsum(~dropped)])
    return flat[~dropped], kept[offsets]


def route_detail(scene: ReleasedScene, nav_id: str) -> dict[str, Any]:
    """Return one route in detail: poses, actions, clearance at least every half metre, and its tasks."""
    route = scene.route(nav_id)
    poses = np.column_stack([route["x_m"], route["y_m"], route["z_m"]])
    moved = np.concatenate([[True], np.any(np.diff(poses, axis=0) != 0.0, axis=1)])
    way, _ = sampled(poses[moved])
    return {
        "nav_id": nav_id,
        "poses": np.round(np.column_stack([poses, route["yaw_rad"]]), 4).tolist(),
        "actions": [schemas.ACTION_NAMES[a] for a in route["action"]],
        "way": np.round(way, 3).tolist(),
        "clearance_m": np.round(scene.clearance(way), 3).tolist(),
        "tasks": [
            {key: row[key] for key in ("task_id", "modality", "target_name", "landmark", "direction", "description",
                                       "action_budget")}
            for row in scene.instances(nav_id)
        ],
    }  # fmt: skip
