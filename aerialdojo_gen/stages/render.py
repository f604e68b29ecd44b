"""`render`: record four RGB-D views along trajectories of the release (paper: sensors, recordings)."""

from __future__ import annotations

import hashlib
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from aerialdojo_gen import store
from aerialdojo_gen.config import RenderConfig
from aerialdojo_gen.rendering.checks import FLAGS, OF_DEPTH, OF_RGB, Solid
from aerialdojo_gen.rendering.codecs import DEPTH_CODEC, RGB_CODEC, SUFFIX
from aerialdojo_gen.rendering.recording import frame_poses, record_view
from aerialdojo_gen.rendering.sample import choose, subsets
from aerialdojo_gen.rendering.trajectory import FramePoses
from aerialdojo_gen.rendering.world import RenderWorld, render_world
from aerialdojo_gen.schemas import FRAMES, RECORDINGS
from aerialdojo_gen.stage import Job, Output

_MODALITIES = {"rgb": (RGB_CODEC, OF_RGB), "depth": (DEPTH_CODEC, OF_DEPTH)}


def run(job: Job, config: RenderConfig) -> Output:
    """Record this shard's share of the scene's sample.

    Parameters
    ----------
    job : Job
        Reads ``routes/train`` or ``routes/test``; writes ``media/<scene>/<nav_id>/<view>_<modality>``.
    config : RenderConfig

    Returns
    -------
    Output
        ``recordings``, a row a video, and ``frames``, a row a frame; the counts are quality flags.
    """
    routes = {row["nav_id"]: row for table in subsets(config) for row in job.read(table).to_pylist()}
    mine = choose(routes.values(), config.limit, job.seed)[job.part :: job.parts]
    recordings: list[dict[str, Any]] = []
    frames: list[dict[str, Any]] = []
    if mine:
        scene = job.scene_model()
        world, solid = render_world(scene), Solid(scene)
        for nav_id in mine:
            poses = frame_poses(routes[nav_id], config)
            for view in config.views:
                recordings += _record(job, config, world, solid, nav_id, view, poses)
            frames += _frame_rows(job.scene, nav_id, poses)
    counts = Counter(flag for row in recordings for flag in row["flags"])
    counts["frames"] = len(frames)
    tables = {
        "recordings": store.from_rows(RECORDINGS, recordings),
        "frames": store.from_rows(FRAMES, frames),
    }
    return Output(tables, len(mine), len(recordings), dict(counts))


def _record(
    job: Job,
    config: RenderConfig,
    world: RenderWorld,
    solid: Solid,
    nav_id: str,
    view: str,
    poses: FramePoses,
) -> list[dict[str, Any]]:
    paths = {m: f"media/{job.scene}/{nav_id}/{view}_{m}.{SUFFIX[m]}" for m in _MODALITIES}
    with ExitStack() as stack:
        files = {m: stack.enter_context(job.output_file(path)) for m, path in paths.items()}
        flags = record_view(world, solid, view, poses, config, files["rgb"], files["depth"])
        if flags:
            # A renderer that has gone wrong may be right when it is built anew; what stays is the view's own fault.
            with RenderWorld(job.scene_model()) as again:
                flags = record_view(again, solid, view, poses, config, files["rgb"], files["depth"])
        facts = {m: (path.stat().st_size, _sha256(path)) for m, path in files.items()}
    return [
        {
            "scene": job.scene,
            "nav_id": nav_id,
            "view": view,
            "modality": modality,
            "path": paths[modality],
            "sampling": config.sampling,
            "n_frames": len(poses.time_s),
            "fps": config.fps,
            "width": config.width,
            "height": config.height,
            "fov_deg": config.fov_deg,
            "codec": codec,
            "bytes": facts[modality][0],
            "sha256": facts[modality][1],
            "ok": not flags & concerned,
            "flags": [flag for flag in FLAGS if flag in flags & concerned],
        }
        for modality, (codec, concerned) in _MODALITIES.items()
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


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
