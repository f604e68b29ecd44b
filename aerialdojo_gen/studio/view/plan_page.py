"""`build-scenes --watch`: a plan in the browser, built again whenever its file is saved."""

from __future__ import annotations

import contextlib
import threading
import time
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Response

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.plans.build import build_plan
from aerialdojo_gen.studio.web.payload import scene_payload
from aerialdojo_gen.studio.web.serving import local_app, one_line


class WatchedPlan:
    """A plan's file, and the scene of its present text, or the last one that was built and an error."""

    def __init__(self, path: Path, assets: Path) -> None:
        self.path, self._assets = path, assets
        self._lock = threading.Lock()
        self._last_version: object = None
        self._payload, self._state = b"", dict[str, Any]()
        self._version = 0

    def current(self) -> tuple[bytes, dict[str, Any]]:
        """Build if a file changed since the last call; return the scene and what the page says of it."""
        with self._lock:
            stamps = []
            for file in (self.path, *sorted(self._assets.rglob("*.toml"))):
                # An editor that saves replaces the file.
                with contextlib.suppress(OSError):
                    stat = file.stat()
                    stamps.append((file, stat.st_mtime_ns, stat.st_size))
            if stamps != self._last_version:
                self._last_version = stamps
                self._version += 1
                self._build()
            return self._payload, self._state

    def _build(self) -> None:
        head: dict[str, Any] = {"version": self._version, "file": str(self.path), "name": self.path.stem}
        before, entries = time.perf_counter(), dict[str, str]()
        try:
            scene = build_plan(self.path, load_catalogue(self._assets), entries)
            lines = _entry_lines(self.path.read_text(encoding="utf-8"))
        except (AerialDojoError, OSError) as error:
            self._state = {**self._state, **head, "error": one_line(str(error))}
            return
        counts = {"n_triangles": scene.n_triangles, "n_instances": len(scene.instances)}
        where = {node: {"entry": name, "line": lines.get(name)} for node, name in entries.items()}
        seconds = round(time.perf_counter() - before, 2)
        self._payload = scene_payload(scene)
        self._state = {**head, **counts, "seconds": seconds, "error": "", "entries": where}


def _entry_lines(text: str) -> dict[str, int]:
    """Number the lines where entries begin, by their names."""
    lines: dict[str, int] = {}
    table = inner = -1
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() == "[[site]]":
            table, inner = table + 1, -1
            lines[f"site[{table}]"] = number
        elif table >= 0 and line.startswith("  {"):
            inner += 1
            lines[f"site[{table}].entries[{inner}]"] = number
    return lines


def plan_app(path: Path, assets: Path) -> FastAPI:
    """Make the app of a plan: one page that follows the file."""
    watched = WatchedPlan(path, assets)
    app = local_app("plan.html", f"aerialdojo-gen build-scenes --watch {path}")

    @app.get("/api/state")
    def get_state() -> dict[str, Any]:
        return watched.current()[1]

    @app.get("/api/scene", response_model=None)
    def get_scene() -> Response:
        return Response(watched.current()[0], media_type="application/octet-stream")

    return app
