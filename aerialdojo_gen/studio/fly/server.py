"""The page of `fly`: HTTP routes that call a `Session`, and the command's loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import cv2
import numpy as np
from fastapi import FastAPI, Query, Request
from fastapi.responses import JSONResponse, Response
from numpy.typing import NDArray
from pydantic import Field, StrictInt

from aerialdojo_gen.annotations.format import Strict
from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.pictures import PAGE_JPEG, encode_jpeg
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.benchmark.evaluation import Evaluation
from aerialdojo_gen.store.root import Where
from aerialdojo_gen.studio.fly.session import Session, StaleError
from aerialdojo_gen.studio.web.serving import local_app, one_line, open_socket, serve, url_of

_Share = Annotated[float, Query(ge=0, lt=1)]


class _Body(Strict):
    """What every request that changes something says: the state that it is an answer to."""

    version: Annotated[StrictInt, Field(ge=0, le=2**31)]


class ActionRequest(_Body):
    """An action of the flight under way."""

    action: Annotated[StrictInt, Field(ge=0, lt=N_ACTIONS)]


def serve_session(
    data: Where, evaluation: Evaluation, *, out: Where | None, restart: bool, port: int, browser: bool,
    say: Callable[[str], None],
) -> None:  # fmt: skip
    """Serve the page until Ctrl-C, and say what is in the tables then."""
    session = Session(data, evaluation, out)
    listener = open_socket(port)
    with session.running(restart):
        say(f"flying as {evaluation.agent}: {url_of(listener)}  (Ctrl-C ends it; finished flights are kept)")
        serve(fly_app(session), listener, browser)
    finished, successes = session.counts()
    if finished:
        rate = f"success rate {successes / finished:.1%}"
        say(f"{finished:,} flown, {rate}; for all scores: {command('report', evaluation.run, log=out)}")
    if session.error is not None:
        raise session.error


def fly_app(session: Session) -> FastAPI:
    """Make the app of a session: one page."""
    app = local_app("fly.html", "aerialdojo-gen fly", 1 << 12)

    @app.exception_handler(StaleError)
    def stale(_: Request, error: Exception) -> JSONResponse:
        return JSONResponse({"error": one_line(str(error)), "state": session.state()}, status_code=409)

    @app.get("/api/state")
    def get_state() -> dict[str, Any]:
        return session.state()

    @app.post("/api/agree")
    def agree(body: _Body) -> dict[str, Any]:
        return session.submit(body.version, "agree")

    @app.post("/api/next")
    def next_task(body: _Body) -> dict[str, Any]:
        return session.submit(body.version, "next")

    @app.post("/api/act")
    def act(body: ActionRequest) -> dict[str, Any]:
        return session.submit(body.version, body.action)

    @app.get("/api/pictures/{view}", response_model=None)
    def get_picture(view: str) -> Response:
        return _jpeg(session.picture(view))

    @app.get("/api/depth/{view}", response_model=None)
    def get_depth(view: str) -> Response:
        return _jpeg(_depth_colours(session.depth_m(view), session.sensors.max_depth_m))

    @app.get("/api/depth/{view}/at")
    def get_depth_at(view: str, x: _Share, y: _Share) -> dict[str, Any]:
        depth = session.depth_m(view)
        metres = float(depth[int(y * depth.shape[0]), int(x * depth.shape[1])])
        return {"depth_m": round(metres, 2) or None}

    return app


def _jpeg(image: NDArray[np.uint8]) -> Response:
    return Response(encode_jpeg(image, PAGE_JPEG), media_type="image/jpeg")


def _depth_colours(depth_m: NDArray[np.float32], most_m: float) -> NDArray[np.uint8]:
    """Colour depth for the eye, near things finer; black where nothing is in range."""
    far = np.log1p(np.clip(depth_m, 0.0, most_m)) / np.log1p(most_m)
    level = np.rint(255.0 * (1.0 - far)).astype(np.uint8)
    colours = np.asarray(cv2.applyColorMap(level, cv2.COLORMAP_VIRIDIS)[..., ::-1], np.uint8)
    colours[depth_m <= 0.0] = 0
    return colours
