"""Estimate of a recording's time, disk and memory, measured on a few of its trajectories."""

from __future__ import annotations

import resource
import sys
import time
from dataclasses import dataclass
from typing import Any

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.rendering.backend import choose_renderer, open_renderer
from aerialdojo_gen.rendering.checks import scene_solid
from aerialdojo_gen.rendering.placement import places
from aerialdojo_gen.rendering.recording import frame_poses, record_views
from aerialdojo_gen.rendering.sample import choose_trajectories, routes
from aerialdojo_gen.scenes.stored import read_scene_mesh
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.files import size_of
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.staging import scratch_folder

_MEASURED_SCENES, _MEASURED_POSES = 6, 12


@dataclass(frozen=True)
class Estimate:
    """Estimated time, disk and memory of a recording."""

    trajectories: int  # Of the selection; a pose is a frame in every view
    poses: int
    videos: int
    cpu_s: float  # Seconds of one core; seconds on `workers` idle ones, where every machine of `machines` has as many
    wall_s: float
    size_bytes: float  # Of the videos
    memory_bytes: float  # Of all workers of a machine
    workers: int
    machines: int
    measured: int  # Poses that were rendered, encoded and checked for the estimate
    why: str  # Which renderer, and why

    def __str__(self) -> str:
        """Three lines for people."""
        processes = "worker" if self.workers == 1 else "workers"
        shares = f" on each of {self.machines} machines" if self.machines > 1 else ""
        return (
            f"{self.why}\n"
            f"{self.trajectories:,} trajectories, {self.poses:,} poses, {self.videos:,} videos "
            f"(measured on {self.measured} poses: {1e3 * self.cpu_s / max(self.poses, 1):.0f} ms CPU, "
            f"{self.size_bytes / max(self.poses, 1) / 1e3:.0f} kB a pose)\n"
            f"about {_hours(self.wall_s)} with {self.workers} {processes}{shares} on idle cores, "
            f"{_size(self.size_bytes)} on disk, {_size(self.memory_bytes)} of memory"
        )


def estimate(
    data: Where, scenes: list[str], config: RenderConfig, seed: int, workers: int, machines: int = 1
) -> Estimate:
    """Measure a few trajectories and extrapolate to the selection."""
    choice = choose_renderer(config.renderer)
    poses = trajectories = 0
    selected: dict[str, str] = {}
    # Scenes differ threefold: weight each measured scene by its poses in the selection.
    weight: dict[str, int] = {}
    for scene in scenes:
        chosen = choose_trajectories(routes(data, scene, config, ["nav_id", "setting"]), config.limit, seed)
        if chosen:
            frames = _frames(data, scene, config)
            trajectories += len(chosen)
            weight[scene] = sum(frames[nav_id] for nav_id in chosen)
            poses += weight[scene]
            selected[scene] = min(chosen, key=lambda i: rng.rank(seed, "estimate", i))
    if not selected:
        raise UsageError("nothing to record: no trajectory of these scenes is in the split")
    drawn = sorted(selected, key=lambda scene: rng.rank(seed, "estimate", scene))[:_MEASURED_SCENES]
    measured = 0
    seconds = opening = bytes_ = 0.0
    share = {scene: weight[scene] / sum(weight[name] for name in drawn) for scene in drawn}
    for scene in drawn:
        route = next(row for row in routes(data, scene, config) if row["nav_id"] == selected[scene])
        n, cpu, opening_s, size = _measure(data, scene, route, config, choice.name)
        measured, opening = measured + n, opening + opening_s
        seconds, bytes_ = seconds + share[scene] * cpu / n, bytes_ + share[scene] * size / n
    cpu_s = poses * seconds + len(selected) * workers * opening / len(drawn)
    # Kilobytes on Linux, bytes on macOS.
    resident = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    videos = trajectories * len({place.file for place in places(config)})
    return Estimate(
        trajectories, poses, videos, cpu_s, cpu_s / workers / machines, poses * bytes_ / machines,
        float(resident * workers), workers, machines, measured, choice.why,
    )  # fmt: skip


def _frames(data: Where, scene: str, config: RenderConfig) -> dict[str, int]:
    """Count the frames of every trajectory of a scene."""
    if config.sampling == "steps":
        return {row["nav_id"]: row["n_actions"] for row in routes(data, scene, config, ["nav_id", "n_actions"])}
    return {row["nav_id"]: len(frame_poses(row, config).time_s) for row in routes(data, scene, config)}


def _measure(
    data: Where, scene: str, route: dict[str, Any], config: RenderConfig, renderer_name: str
) -> tuple[int, float, float, int]:
    """Record the first poses of a route; returns poses, CPU seconds for them and for opening the scene, bytes."""
    started = time.process_time()
    row = store.read_scene(data, "scenes", scene).to_pylist()[0]
    mesh = read_scene_mesh(open_root(data), row["mesh_path"], row["mesh_sha256"])
    solid = scene_solid(mesh)
    short = route | {name: route[name][:_MEASURED_POSES] for name in ("x_m", "y_m", "z_m", "yaw_rad", "action")}
    poses = frame_poses(short, config)
    with open_renderer(mesh, renderer_name) as renderer, scratch_folder() as folder:
        opening_s = time.process_time() - started
        started = time.process_time()
        record_views(renderer, solid, config.views, poses, config, folder)
        seconds = time.process_time() - started
        size = sum(size_of(folder / file) for file in {place.file for place in places(config)})
        return len(poses.time_s), seconds, opening_s, size


def _hours(seconds: float) -> str:
    if seconds < 5400.0:
        return f"{seconds / 60.0:.0f} minutes" if seconds >= 90.0 else f"{seconds:.0f} seconds"
    return f"{seconds / 3600.0:.1f} hours"


def _size(count: float) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.0f} MB"
