"""`view`: the scenes of a release in the browser, with landmarks, objects, anchors and routes."""

from __future__ import annotations

import re
import threading
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from fastapi import FastAPI, Query, Response

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.dataset.contents import scenes_in_release
from aerialdojo_gen.dataset.release import Release, open_release
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.studio.view.scenes import SceneCache, route_detail
from aerialdojo_gen.studio.web.serving import STATIC, local_app

_MAX_TASKS = 200
_ROUTES = ["nav_id", "scene", "setting", "target_object_id", "length_m", "detour_ratio", "min_clearance_m",
           "n_actions", "split"]  # fmt: skip
_OBJECTS = ["object_id", "name", "category", "description", "direction", "landmark_id"]
_SHOWN = ("name", "category", "description", "direction", "landmark")
_BEGINS = r"(?:^|[^\pL\pN])"
ORDERS = ("nav_id", "length_m", "detour_ratio", "min_clearance_m", "n_actions")


def view_app(data: Where, scenes: Sequence[str] = ()) -> FastAPI:
    """Make the app of a release's scenes, by names and globs: a start page at ``/``, each at ``/scenes/NAME/``."""
    root = open_root(data)
    names = scenes_in_release(root, scenes)
    app = local_app("start.html", f"aerialdojo-gen view {root}", also=("view.html",))
    cache, release = SceneCache(root, names), open_release(root)
    tasks = TaskList(release, names)
    if len(names) == 1:
        cache.run(names[0], lambda scene: (scene.payload, scene.index, scene.points))

    @app.get("/api/release")
    def get_release() -> dict[str, Any]:
        rows = {row["scene"]: row for row in release.table("scenes", scene=names).to_pylist()}
        keys = ("scene", "family", "scene_type", "partition", "n_triangles")
        return {
            "data": str(root),
            "settings": list(schemas.SETTINGS),
            "scenes": [{key: rows[name][key] for key in keys} | _counts(root, name) for name in names],
        }

    @app.get("/api/tasks")
    def get_tasks(
        scene: Annotated[list[str] | None, Query()] = None, setting: str = "", split: str = "", words: str = "",
        order: str = "nav_id", descending: bool = False, offset: Annotated[int, Query(ge=0, le=10**7)] = 0,
        most: Annotated[int, Query(ge=0, le=_MAX_TASKS)] = 48,
    ) -> dict[str, Any]:  # fmt: skip
        for name in scene or ():
            cache.require(name)
        selected = [name for name in names if not scene or name in scene]
        return tasks.find(
            selected, setting=setting, split=split, words=words[:200], order=order, descending=descending,
            offset=offset, most=most,
        )  # fmt: skip

    @app.get("/scenes/{name}/", response_model=None)
    def page(name: str) -> Response:
        cache.require(name)
        return Response((STATIC / "view.html").read_bytes(), media_type="text/html")

    @app.get("/scenes/{name}/picture", response_model=None)
    def get_picture(name: str) -> Response:
        return Response(cache.picture(name), media_type="image/jpeg")

    @app.get("/scenes/{name}/api/scene", response_model=None)
    def get_scene(name: str) -> Response:
        return Response(cache.run(name, lambda scene: scene.payload), media_type="application/octet-stream")

    @app.get("/scenes/{name}/api/index")
    def get_index(name: str) -> dict[str, Any]:
        return cache.run(name, lambda scene: scene.index)

    @app.get("/scenes/{name}/api/routes/points", response_model=None)
    def get_points(name: str) -> Response:
        return Response(cache.run(name, lambda scene: scene.points), media_type="application/octet-stream")

    @app.get("/scenes/{name}/api/routes/{nav_id}")
    def get_route(name: str, nav_id: str) -> dict[str, Any]:
        return cache.run(name, lambda scene: route_detail(scene, nav_id))

    @app.get("/scenes/{name}/api/objects/{object_id}/image", response_model=None)
    def get_image(name: str, object_id: int) -> Response:
        return Response(cache.run(name, lambda scene: scene.image(object_id)), media_type="image/png")

    @app.get("/scenes/{name}/api/objects/{object_id}/thumb", response_model=None)
    def get_thumb(name: str, object_id: int) -> Response:
        return Response(cache.thumb(name, object_id), media_type="image/jpeg")

    return app


def _counts(root: Where, name: str) -> dict[str, int]:
    routes = sum(store.count_rows(root, f"routes/{side}", name) for side in ("train", "test"))
    return {"n_objects": store.count_rows(root, "release/objects", name), "n_routes": routes}


class TaskList:
    """Navigation tasks with their targets, read per scene on demand."""

    def __init__(self, release: Release, names: Sequence[str]) -> None:
        self._release, self._names = release, tuple(names)
        self._read: dict[str, pa.Table] = {}
        self._lock = threading.Lock()

    def _table(self, scene: str) -> pa.Table:
        with self._lock:
            if scene not in self._read:
                routes = self._release.table("routes", scene=scene, columns=_ROUTES)
                objects = self._release.table("objects", scene=scene, columns=_OBJECTS)
                landmarks = self._release.table("landmarks", scene=scene, columns=["landmark_id", "name"])
                at = _rows_of(objects["landmark_id"], landmarks["landmark_id"])
                objects = objects.append_column("landmark", landmarks["name"].take(at))
                at = _rows_of(routes["target_object_id"], objects["object_id"])
                for key in _SHOWN:
                    words = pc.fill_null(objects[key].cast(pa.string()).take(at), "")
                    routes = routes.append_column(key, words.dictionary_encode())
                self._read[scene] = routes
            return self._read[scene]

    def find(
        self, scenes: Sequence[str], *, setting: str = "", split: str = "", words: str = "", order: str = "nav_id",
        descending: bool = False, offset: int = 0, most: int = 48,
    ) -> dict[str, Any]:  # fmt: skip
        """Return the matching tasks: ``total`` and the rows of one page."""
        if order not in ORDERS:
            raise UsageError(f"tasks are ordered by {', '.join(ORDERS)}")
        parts = [
            _filter(self._table(scene), setting, split, words.lower().split()) for scene in scenes or self._names
        ]
        matches = pa.concat_tables(parts, promote_options="default").unify_dictionaries()
        key = pc.utf8_slice_codeunits(matches[order], -12) if order == "nav_id" else matches[order]
        sort = pa.table({"key": key, "id": matches["nav_id"]})
        rank = pc.sort_indices(sort, [("key", "descending" if descending else "ascending"), ("id", "ascending")])
        rows = matches.take(rank.slice(offset, most)).to_pylist()
        return {"total": matches.num_rows, "tasks": [_to_json(row) for row in rows]}


def _rows_of(values: pa.ChunkedArray, keys: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return the row of each value among keys; null where it is none of them."""
    return pc.index_in(values, value_set=keys.combine_chunks())


def _filter(table: pa.Table, setting: str, split: str, words: Sequence[str]) -> pa.Table:
    keep = np.ones(table.num_rows, dtype=np.bool_)
    for column, value in (("setting", setting), ("split", split)):
        if value:
            keep &= pc.equal(table[column], value).to_numpy(zero_copy_only=False)
    for word in words:
        # A task id is its route's id plus a suffix.
        holds = pc.match_substring(table["nav_id"], re.sub("-[si]$", "", word), ignore_case=True)
        for column in ("name", "category", "description", "landmark"):
            begins = pc.match_substring_regex(
                table[column].cast(pa.string()), _BEGINS + re.escape(word), ignore_case=True
            )
            holds = pc.or_(holds, begins)
        keep &= holds.to_numpy(zero_copy_only=False)
    return table.filter(pa.array(keep))


def _to_json(row: dict[str, Any]) -> dict[str, Any]:
    rounded = {key: round(value, 3) if isinstance(value, float) else value for key, value in row.items()}
    return {"object_id" if key == "target_object_id" else key: value for key, value in rounded.items()}
