"""What a recording costs with each renderer, side by side on the same poses of the same scenes.

    python tests/bench/bench_renderer.py [--scene U_Mall_0 ...] [--poses 6]

Times are CPU seconds of the processes, so that a busy machine distorts them less; what counts are the ratios.
"""

from __future__ import annotations

import multiprocessing
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from common import built, cpu_s, options_of

from aerialdojo_gen.base.config.sections import RENDERERS, RenderConfig
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.rendering.backend import choose_renderer, open_renderer
from aerialdojo_gen.rendering.checks import Solid
from aerialdojo_gen.rendering.recording import frame_poses, record_views
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.schemas import VIEWS

CAMERA = Camera(640, 640, 90.0)


def route_of(scene: Scene, n: int) -> dict[str, Any]:
    """A line across the middle of the scene, 3 m over whatever stands there, turning a little at every pose."""
    low, high = scene.bounds
    x = np.linspace(0.7 * low[0] + 0.3 * high[0], 0.3 * low[0] + 0.7 * high[0], n)
    y = np.linspace(0.6 * low[1] + 0.4 * high[1], 0.4 * low[1] + 0.6 * high[1], n)
    top = np.column_stack([x, y, np.full(n, high[2] + 50.0)])
    z = top[:, 2] - RayCaster(scene).first_hit(top, np.tile([0.0, 0.0, -1.0], (n, 1)))[0] + 3.0
    return {
        "x_m": x.tolist(), "y_m": y.tolist(), "z_m": z.tolist(), "yaw_rad": np.linspace(0.3, 1.5, n).tolist(),
        "action": [3] * (n - 1) + [0],
    }  # fmt: skip


def record(scene: Scene, name: str, n: int) -> tuple[float, float]:
    """CPU seconds a pose of four views, rendered, encoded and checked, and kilobytes a pose."""
    config, solid = RenderConfig(), Solid(scene)
    poses = frame_poses(route_of(scene, n), config)
    with open_renderer(scene, name) as renderer, tempfile.TemporaryDirectory() as folder:
        renderer.render(CAMERA, view_pose(poses.position[0], 0.0, "front"))
        seconds, _ = cpu_s(record_views, renderer, solid, VIEWS, poses, config, Path(folder))
        return seconds / n, sum(p.stat().st_size for p in Path(folder).iterdir()) / n / 1e3


def views_a_second(scene_name: str, renderer_name: str, n: int, barrier: Any, results: Any) -> None:
    scene = built(scene_name)
    route = route_of(scene, n)
    with open_renderer(scene, renderer_name) as renderer:
        poses = [view_pose(p, yaw, v) for *p, yaw in zip(*(route[k] for k in ("x_m", "y_m", "z_m", "yaw_rad")), strict=True) for v in VIEWS]  # fmt: skip  # noqa: E501
        renderer.render(CAMERA, poses[0])
        barrier.wait()
        begun = time.monotonic()
        for pose in poses:
            renderer.render(CAMERA, pose)
        results.put(len(poses) / (time.monotonic() - begun))


def parallel(scene_name: str, renderer_name: str, n: int, processes: int) -> float:
    """Views a second of so many processes together, by the clock: only an idle machine gives a true figure."""
    context = multiprocessing.get_context("spawn")
    barrier, results = context.Barrier(processes), context.Queue()
    args = (scene_name, renderer_name, n, barrier, results)
    workers = [context.Process(target=views_a_second, args=args) for _ in range(processes)]
    for worker in workers:
        worker.start()
    total = sum(results.get() for _ in workers)
    for worker in workers:
        worker.join()
    return float(total)


def compare(scene: Scene, n: int) -> None:
    route, caster = route_of(scene, n), RayCaster(scene)
    rays = CAMERA.rays().reshape(-1, 3)
    renderers = {name: open_renderer(scene, name) for name in RENDERERS}
    milliseconds: dict[str, list[float]] = {name: [] for name in renderers}
    wrong: dict[str, list[float]] = {name: [] for name in renderers}
    colour = []
    for k in range(n):
        for view in VIEWS:
            pose = view_pose((route["x_m"][k], route["y_m"][k], route["z_m"][k]), route["yaw_rad"][k], view)
            along, _ = caster.first_hit(pose[:3, 3], rays @ pose[:3, :3].T)
            cast = (along / np.linalg.norm(rays, axis=1)).reshape(640, 640)
            pictures = {}
            for name, renderer in renderers.items():
                if not milliseconds[name]:
                    renderer.render(CAMERA, pose)
                seconds, pictures[name] = cpu_s(renderer.render, CAMERA, pose)
                milliseconds[name].append(1e3 * seconds)
                depth = pictures[name].depth_m
                with np.errstate(invalid="ignore"):
                    right = (np.abs(depth - cast) < 0.01) | (np.isinf(depth) & np.isinf(cast))
                wrong[name].append(float((~right).mean()))
            first, second = (p.rgb for p in pictures.values())
            flat = np.ones((640, 640), dtype=bool)
            for rgb in (first, second):
                kernel = np.ones((3, 3), dtype=np.uint8)
                flat &= (cv2.dilate(rgb, kernel).astype(int) - cv2.erode(rgb, kernel)).max(axis=2) < 24
            colour.append(float(np.abs(first.astype(int) - second)[flat].mean()))
    for renderer in renderers.values():
        renderer.close()
    for name in RENDERERS:
        medians = [statistics.median(milliseconds[name][k::4]) for k in range(4)]
        each = ", ".join(f"{view} {median:.0f}" for view, median in zip(VIEWS, medians, strict=True))
        share = 100 * (1 - statistics.mean(wrong[name]))
        print(f"  {name:>8}: {statistics.mean(milliseconds[name]):.1f} ms CPU a view ({each})")
        print(f"            depth within 1 cm of ray casts at {share:.3f} % of the pixels")
    ratio = statistics.mean(milliseconds["pybullet"]) / statistics.mean(milliseconds["gl"])
    print(f"  gl is {ratio:.1f} times as fast; colours away from edges differ by {statistics.mean(colour):.2f} / 255")


def main() -> None:
    args = options_of(__doc__, scene=["U_Mall_0", "N_Forest_0"], poses=6)
    for name in RENDERERS:
        print(choose_renderer(name).why)
    for name in args.scene:
        scene = built(name)
        print(f"{name}: {scene.n_triangles:,} triangles, {args.poses} poses of 4 views, 640 x 640")
        compare(scene, args.poses)
        end = {}
        for renderer in RENDERERS:
            end[renderer], size = record(scene, renderer, args.poses)
            print(f"  {renderer:>8}: {1e3 * end[renderer]:.0f} ms CPU a pose, encoded and checked; {size:.0f} kB")
        print(f"  end to end, gl is {end['pybullet'] / end['gl']:.1f} times as fast")
    for renderer in RENDERERS:
        one, two = (parallel(args.scene[0], renderer, args.poses, processes) for processes in (1, 2))
        print(
            f"{args.scene[0]}, {renderer}: {one:.1f} views/s by one process, {two:.1f} by two ({two / one:.2f} times)"
        )


if __name__ == "__main__":
    main()
