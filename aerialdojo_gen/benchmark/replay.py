"""Replays of episodes: what every run did on one task, on a map.

The evaluator's eyes only: a replay shows the target and the reference route.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import zip_longest
from typing import Any

import numpy as np
import pyarrow.compute as pc
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.pictures import MAP_JPEG, REPLAY_JPEG, Picture, encode_jpeg
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.observations import render_views
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.dataset.lookup import ReleasedScene
from aerialdojo_gen.rendering.orthographic import orthographic_pictures
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.schemas import ACTION_NAMES

_MAP_PX = 640
_MARGIN_M = 6.0
_FRAME = Sensors(("front",), rgb=True, depth=False, width=240, height=240)
# An episode may have 300 steps: a picture of each would make the page heavy, and hardly say more.
_MAX_FRAMES = 40


@dataclass(frozen=True)
class Flight:
    """What one run did on a task."""

    label: str  # The run's label
    outcome: str  # How it ended, in words
    x_m: list[float]  # The start, then the pose after every action; world frame, and the distance to the goal
    y_m: list[float]
    z_m: list[float]
    yaw_rad: list[float]
    distance_m: list[float]
    said: list[str]  # What was done to get there: "start", then names of actions
    answers: list[str]  # The agent's words, empty where it says nothing
    frames: dict[int, str]  # Front pictures as data URLs, by index of the pose


@dataclass(frozen=True)
class Replay:
    """A task with its map, its reference, and all flights."""

    task: dict[str, Any]  # The row of `tasks`
    goal: dict[str, float]  # Position of the goal (x_m, y_m, z_m) and of the target's centre and size
    reference: dict[str, Any]  # Lists x_m, y_m, z_m of the reference route, and its length_m
    low_m: tuple[float, float]  # Corners of the map, metres
    high_m: tuple[float, float]
    map_url: str  # The map as a data URL
    flights: list[Flight]  # One a run

    def data(self) -> str:
        """Return the flights as JSON, for the page's script."""
        flights = [
            {
                "label": f.label, "z": f.z_m, "x": f.x_m, "y": f.y_m, "yaw": f.yaw_rad, "d": f.distance_m,
                "said": f.said, "answers": f.answers, "frames": f.frames,
            }
            for f in self.flights
        ]  # fmt: skip
        return json.dumps({"flights": flights}, ensure_ascii=True, separators=(",", ":"), allow_nan=False)


def choose_tasks(runs: Sequence[Run], count: int) -> list[str]:
    """Choose tasks worth looking at: of every family in turn, those whose flights ended most differently."""
    ends: dict[str, list[str]] = {}
    families: dict[str, str] = {}
    for run in runs:
        columns = [run.table[name].to_pylist() for name in ("task_id", "family", "termination", "success")]
        for task, family, termination, success in zip(*columns, strict=True):
            ends.setdefault(task, []).append("success" if success else termination)
            families[task] = family
    ranked = sorted(ends, key=lambda task: (-len(ends[task]), -len(set(ends[task])), task))
    queues = ([t for t in ranked if families[t] == family] for family in sorted(set(families.values())))
    return [task for turn in zip_longest(*queues) for task in turn if task is not None][:count]


def replays(
    data: Where, log: Where, runs: Sequence[Run], tasks: Sequence[str], frames: bool = False
) -> Iterator[Replay]:
    """Make replays."""
    root = open_root(data)
    steps = {run.name: read_run(log, run.name, "steps") for run in runs if tasks}
    for task_id in tasks:
        chosen = ((run, run.table.filter(pc.equal(run.table["task_id"], task_id)).to_pylist()) for run in runs)
        flown = [(run, row) for run, rows in chosen for row in rows]
        episode = flown[0][1]
        scene = _scene(root, episode["scene"])
        instances = [t for t in scene.instances(episode["nav_id"]) if t["task_id"] == task_id]
        if not instances:
            raise StoreError(f"the release in {root} has no task {task_id}: it is not the one that the runs flew")
        route = scene.route(episode["nav_id"])
        target = scene.object(route["target_object_id"])
        flights = [_flight(scene, run, row, steps[run.name], frames) for run, row in flown]
        low, high = _extent(flights, route, target)
        extent = (low[0], high[0], low[1], high[1])
        seen = orthographic_pictures(scene.model).from_above(extent, float(high[0] - low[0]) / _MAP_PX)
        places = (("goal", route, "goal_"), ("target", target, ""), ("size", target, "size_"))
        known = {f"{what}_{a}_m": of[f"{name}{a}_m"] for what, of, name in places for a in "xyz"}
        reference = {name: route[name] for name in ("x_m", "y_m", "z_m", "length_m")}
        corners = (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))
        map_url = Picture(encode_jpeg(seen, MAP_JPEG)).data_url
        yield Replay(instances[0], known, reference, *corners, map_url, flights)


_scene = lru_cache(maxsize=4)(ReleasedScene)


def _flight(scene: ReleasedScene, run: Run, episode: dict[str, Any], steps: Any, frames: bool) -> Flight:
    flown, route = steps.filter(pc.equal(steps["task_id"], episode["task_id"])), scene.route(episode["nav_id"])
    first = {name: episode[f"start_{name}"] for name in ("x_m", "y_m", "z_m", "yaw_rad")}
    first["distance_m"] = math.dist([first[f"{a}_m"] for a in "xyz"], [route[f"goal_{a}_m"] for a in "xyz"])
    lists = {name: [value, *flown[name].to_pylist()] for name, value in first.items()}
    said, answers = ["start"], ["", *(answer or "" for answer in flown["answer"].to_pylist())]
    for action, refused in zip(flown["action"].to_pylist(), flown["refused"].to_pylist(), strict=True):
        done = "unreadable answer" if action is None else ACTION_NAMES[action]
        said.append(f"{done} (refused)" if refused else done)
    pictures = {}
    if frames:
        # The last pose may lie in what was hit: a camera there sees the inside of it.
        last = len(said) - (2 if episode["collision"] else 1)
        for k in sorted({round(k) for k in np.linspace(0, max(last, 0), min(_MAX_FRAMES, last + 1))}):
            position = tuple(lists[name][k] for name in ("x_m", "y_m", "z_m"))
            views, *_ = render_views(scene.model, _FRAME, position, lists["yaw_rad"][k])
            pictures[k] = Picture(encode_jpeg(views["front"], REPLAY_JPEG)).data_url
    rounded = {name: [round(v, 3) for v in values] for name, values in lists.items()}
    return Flight(run.label, _outcome(episode), **rounded, said=said, answers=answers, frames=pictures)


def _outcome(episode: dict[str, Any]) -> str:
    how = {"stop": "stopped", "collision": "hit something", "budget": "ran out of actions"}[episode["termination"]]
    verdict = "success" if episode["success"] else "failure"
    return (
        f"{verdict}: {how} {episode['final_distance_m']:.1f} m from the goal after {episode['n_actions']} actions, "
        f"{episode['path_length_m']:.1f} m flown"
    )


def _extent(
    flights: Sequence[Flight], route: dict[str, Any], target: dict[str, Any]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of a square map that holds all paths and the target."""
    x = np.array([v for f in flights for v in f.x_m] + route["x_m"] + [target["x_m"]])
    y = np.array([v for f in flights for v in f.y_m] + route["y_m"] + [target["y_m"]])
    middle = np.array([x.min() + x.max(), y.min() + y.max()]) / 2.0
    half = max(float(np.ptp(x)), float(np.ptp(y)), 20.0) / 2.0 + _MARGIN_M
    return middle - half, middle + half
