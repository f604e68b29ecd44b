"""`render`: record four RGB-D views along trajectories of the release (paper: sensors, recordings)."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerialdojo_gen.config.sections import RenderConfig
from aerialdojo_gen.errors import BudgetSpent
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.rendering import finished
from aerialdojo_gen.rendering.backend import kept_renderer
from aerialdojo_gen.rendering.checks import CONCERNS, FLAGS, kept_solid
from aerialdojo_gen.rendering.codecs import CODEC, SUFFIX
from aerialdojo_gen.rendering.recording import frame_poses, record_view
from aerialdojo_gen.rendering.sample import choose, tables
from aerialdojo_gen.rendering.trajectory import FramePoses
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.files import sha256_of, size_of
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import FRAMES, RECORDINGS
from aerialdojo_gen.store.staging import remove
from aerialdojo_gen.store.tables import from_rows


def run(job: Job, config: RenderConfig) -> Output:
    """Record this shard's share of the scene's sample.

    Parameters
    ----------
    job : Job
        Reads ``routes/train`` or ``routes/test``; writes ``media/<scene>/<nav_id>/<view>_<modality>``. A trajectory
        that lies there finished is not recorded again.
    config : RenderConfig

    Returns
    -------
    Output
        ``recordings``, a row a video, and ``frames``, a row a frame; the counts are quality flags, and frames.

    Raises
    ------
    BudgetSpent
        The job's deadline came; finished trajectories are kept.
    """
    routes = {row["nav_id"]: row for table in tables(config, job.scene) for row in job.read(table).to_pylist()}
    mine = choose(routes.values(), config.limit, job.seed)[job.part :: job.parts]
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
        job.files.extend([f"{folder}/{finished.NOTE}", *(row["path"] for row in rows)])
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
            rows = [row for view in self.config.views for row in self._view(view, here, folder)]
            finished.note(here, fingerprint, rows)
        return rows

    def _view(self, view: str, here: Path, folder: str) -> list[dict[str, Any]]:
        config = self.config
        renderer, solid = kept_renderer(self.scene, config.renderer), kept_solid(self.scene)
        modalities = ("rgb", "depth", "instance") if config.instances else ("rgb", "depth")
        png = config.frames == "png"
        names = {m: f"{view}_{m}" if png else f"{view}_{m}.{SUFFIX[m]}" for m in modalities}
        files = {m: here / name for m, name in names.items()}
        flags = record_view(renderer, solid, view, self.poses, config, files)
        if flags:
            # A renderer that has gone wrong may be right when it is built anew; what stays is the view's own fault.
            for file in files.values():
                remove(file)
            renderer = kept_renderer(self.scene, config.renderer, anew=True)
            flags = record_view(renderer, solid, view, self.poses, config, files)
        return [
            {
                "scene": self.scene.name,
                "nav_id": self.nav_id,
                "view": view,
                "modality": m,
                "path": f"{folder}/{names[m]}",
                "sampling": config.sampling,
                "n_frames": len(self.poses.time_s),
                "fps": config.fps,
                "width": config.width,
                "height": config.height,
                "fov_deg": config.fov_deg,
                "codec": "png" if png else CODEC[m],
                "renderer": renderer.name,
                "device": renderer.device,
                "bytes": size_of(file),
                "sha256": sha256_of(file),
                "ok": not flags & CONCERNS[m],
                "flags": [flag for flag in FLAGS if flag in flags & CONCERNS[m]],
            }
            for m, file in files.items()
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
