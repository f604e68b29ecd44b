"""`render`: record four RGB-D views along trajectories of the release (paper: sensors, recordings)."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.base.errors import BudgetSpent
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.rendering import finished
from aerialdojo_gen.rendering.backend import scene_renderer
from aerialdojo_gen.rendering.checks import FLAGS, FLAGS_OF_MODALITY, scene_solid
from aerialdojo_gen.rendering.codecs import CODEC
from aerialdojo_gen.rendering.placement import places
from aerialdojo_gen.rendering.recording import FramePoses, frame_poses, record_views
from aerialdojo_gen.rendering.sample import choose_trajectories, tables
from aerialdojo_gen.scenes.light import chosen_light
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.files import sha256_of, size_of
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import FRAMES, RECORDINGS
from aerialdojo_gen.store.staging import remove
from aerialdojo_gen.store.tables import from_rows


def run(job: Job, config: RenderConfig) -> Output:
    """Record this shard's share of the scene's sample, but for trajectories that lie there finished."""
    routes = {row["nav_id"]: row for table in tables(config, job.scene) for row in job.read(table).to_pylist()}
    mine = choose_trajectories(routes.values(), config.limit, job.seed)[job.part :: job.parts]
    mesh = job.read("scenes")["mesh_sha256"][0].as_py()
    recordings: list[dict[str, Any]] = []
    frames: list[dict[str, Any]] = []
    for nav_id in mine:
        poses = frame_poses(routes[nav_id], config)
        folder = f"media/{job.scene}/{nav_id}"
        fingerprint = finished.trajectory_fingerprint(job.code, mesh, routes[nav_id], config)
        rows = None if job.force else finished.find(job.roots.data, folder, fingerprint, verify=job.verify)
        if rows is None:
            if job.deadline is not None and time.time() >= job.deadline:
                raise BudgetSpent(f"the budget was spent in {job.scene}")
            rows = _Trajectory(job.scene_model(), nav_id, poses, config).record(job.roots.data, folder, fingerprint)
        job.files.extend([f"{folder}/{finished.MANIFEST}", *dict.fromkeys(row["path"] for row in rows)])
        recordings += rows
        frames += _frame_rows(job.scene, nav_id, poses)
    counts = Counter(flag for row in recordings for flag in row["flags"])
    counts["frames"] = len(frames)
    written = {
        "recordings": from_rows(RECORDINGS, recordings),
        "frames": from_rows(FRAMES, frames),
    }
    return Output(written, len(mine), len(recordings), dict(counts))


@dataclass(frozen=True)
class _Trajectory:
    scene: Scene
    nav_id: str
    poses: FramePoses
    config: RenderConfig

    def record(self, data: DataRoot, folder: str, fingerprint: str) -> list[dict[str, Any]]:
        """Record all views into a folder that appears when it is whole; returns the rows of `recordings`."""
        with data.commit_folder(folder) as here:
            rows = self._rows(here, folder, self._views(here))
            finished.note(here, fingerprint, rows)
        return rows

    def _views(self, here: Path) -> dict[str, set[str]]:
        """Record the views into a folder; returns their quality flags."""
        config = self.config
        light = chosen_light(self.scene.light, config.light, 0, self.nav_id)
        renderer, solid = scene_renderer(self.scene, config.renderer, light), scene_solid(self.scene)
        flags = record_views(renderer, solid, config.views, self.poses, config, here)
        wrong = [view for view in config.views if flags[view]]
        if not wrong:
            return flags
        # A renderer that has gone wrong may be right when it is built anew; what stays is the view's own fault.
        if config.layout == "tiled":
            wrong = list(config.views)
        for file in {place.file for place in places(config) if place.view in wrong}:
            remove(here / file)
        renderer = scene_renderer(self.scene, config.renderer, light, reopen=True)
        return flags | record_views(renderer, solid, wrong, self.poses, config, here)

    def _rows(self, here: Path, folder: str, flags: dict[str, set[str]]) -> list[dict[str, Any]]:
        config = self.config
        renderer = scene_renderer(self.scene, config.renderer)
        own = places(config)
        facts = {file: (size_of(here / file), sha256_of(here / file)) for file in {place.file for place in own}}
        return [
            {
                "scene": self.scene.name,
                "nav_id": self.nav_id,
                "view": place.view,
                "modality": place.modality,
                "path": f"{folder}/{place.file}",
                **{name: getattr(place, name) for name in ("stream", "left_px", "top_px")},
                "sampling": config.sampling,
                "n_frames": len(self.poses.time_s),
                **{name: getattr(config, name) for name in ("fps", "width", "height", "fov_deg")},
                "depth_step": config.depth_step if place.modality == "depth" else None,
                "codec": "png" if config.frames == "png" else CODEC[place.modality],
                "renderer": renderer.name,
                "device": renderer.device,
                "bytes": facts[place.file][0],
                "sha256": facts[place.file][1],
                "ok": not flags[place.view] & FLAGS_OF_MODALITY[place.modality],
                "flags": [flag for flag in FLAGS if flag in flags[place.view] & FLAGS_OF_MODALITY[place.modality]],
            }
            for place in own
        ]


def _frame_rows(scene: str, nav_id: str, poses: FramePoses) -> list[dict[str, Any]]:
    return [
        {
            "scene": scene,
            "nav_id": nav_id,
            "frame": k,
            "time_s": float(poses.time_s[k]),
            "step": int(poses.step[k]),
            "action": int(poses.action[k]),
            **dict(zip(("x_m", "y_m", "z_m"), poses.position[k].tolist(), strict=True)),
            "yaw_rad": float(poses.yaw_rad[k]),
        }
        for k in range(len(poses.time_s))
    ]
