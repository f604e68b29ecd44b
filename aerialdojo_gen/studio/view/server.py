"""`view`: the scenes of a release in the browser, with landmarks, objects, anchors and routes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from fastapi import FastAPI, Query, Response

from aerialdojo_gen.dataset.contents import scenes_in_release
from aerialdojo_gen.dataset.release import open_release
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.studio.view.scenes import SceneCache, route_detail
from aerialdojo_gen.studio.view.tasks import TaskList
from aerialdojo_gen.studio.web.serving import STATIC, local_app

_MAX_TASKS = 200


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
