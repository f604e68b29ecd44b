"""`view`: one scene of the release in the browser, with its landmarks, objects, anchors and routes."""

from __future__ import annotations

import struct
import threading
from typing import TYPE_CHECKING, Any

import numpy as np

from aerialdojo_gen.browse.lookup import ReleasedScene
from aerialdojo_gen.errors import UsageError
from aerialdojo_gen.release.way import sampled
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store.root import Where
from aerialdojo_gen.web.payload import scene_payload
from aerialdojo_gen.web.serving import local_app

if TYPE_CHECKING:
    from fastapi import FastAPI

_OBJECT = ("object_id", "name", "category", "description", "mesh_node", "direction", "landmark_id")
_NUMBERS = ("euclidean_m", "length_m", "detour_ratio", "min_clearance_m")


def view_app(data: Where, scene: str) -> FastAPI:
    """Make the app that shows a scene.

    Parameters
    ----------
    data : DataRoot, Path or str
        The data root; its release and its meshes are all that is read.
    scene : str
        Name of the scene.

    Returns
    -------
    fastapi.FastAPI

    Raises
    ------
    UsageError, StoreError, AssetError
        The scene, its tables or its mesh are missing or damaged.
    """
    app = local_app("view.html", f"aerialdojo-gen view {scene}")
    from fastapi import Response

    shown = ReleasedScene(data, scene)
    payload, index, points = scene_payload(shown.model), scene_index(shown), route_points(shown)
    # FCL's manager is no thing for two threads at once, and FastAPI answers in several.
    one_at_a_time = threading.Lock()

    @app.get("/api/scene", response_model=None)
    def get_scene() -> Response:
        return Response(payload, media_type="application/octet-stream")

    @app.get("/api/index")
    def get_index() -> dict[str, Any]:
        return index

    @app.get("/api/routes/points", response_model=None)
    def get_points() -> Response:
        return Response(points, media_type="application/octet-stream")

    @app.get("/api/routes/{nav_id}")
    def get_route(nav_id: str) -> dict[str, Any]:
        with one_at_a_time:
            return route_detail(shown, nav_id)

    @app.get("/api/objects/{object_id}/image", response_model=None)
    def get_image(object_id: int) -> Response:
        image = shown.object(object_id)["reference_image"]
        if image is None:
            raise UsageError(f"object {object_id} has no reference image")
        return Response(image, media_type="image/png")

    return app


def scene_index(scene: ReleasedScene) -> dict[str, Any]:
    """Collect what the page lists and filters: places row by row, routes column by column (there may be 20,000).

    Parameters
    ----------
    scene : ReleasedScene

    Returns
    -------
    dict
        JSON values; positions in metres, world frame, rounded to a millimetre.
    """
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
    """Pack the ways of all routes, in the index's order, for the page.

    Parameters
    ----------
    scene : ReleasedScene

    Returns
    -------
    bytes
        Little-endian: ``uint32`` number of routes n, n + 1 ``uint32`` offsets in points, then ``float32`` x y z,
        metres. A pose that only turns adds no point.
    """
    routes = scene.routes
    lists = [routes[f"{axis}_m"].combine_chunks() for axis in "xyz"]
    offsets = lists[0].offsets.to_numpy().astype(np.int64)
    flat = np.column_stack([column.values.to_numpy() for column in lists])
    flat, offsets = flat[offsets[0] : offsets[-1]], offsets - offsets[0]
    first = np.zeros(len(flat), dtype=np.bool_)
    first[offsets[:-1]] = True
    moved = first | np.any(flat != np.roll(flat, 1, axis=0), axis=1)
    kept = np.concatenate([[0], np.cumsum(moved)])[offsets]
    return struct.pack("<I", len(routes)) + kept.astype("<u4").tobytes() + flat[moved].astype("<f4").tobytes()


def route_detail(scene: ReleasedScene, nav_id: str) -> dict[str, Any]:
    """Tell all of one route: poses, actions, clearance along the way, and what the agent reads.

    Parameters
    ----------
    scene : ReleasedScene
    nav_id : str

    Returns
    -------
    dict
        JSON values; ``way`` are points every half metre at most, ``clearance_m`` FCL's distance at each.

    Raises
    ------
    UsageError
        There is no such route.
    """
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
