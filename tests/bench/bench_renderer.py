"""What a recording costs: a view, and a pose of four views with encoding and checks, on U_Mall_0.

    python tests/bench/bench_renderer.py [--poses 6]

Times are CPU seconds of this process, so that a busy machine distorts them less.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from aerialdojo_gen.config import RenderConfig
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.checks import Solid
from aerialdojo_gen.rendering.recording import frame_poses, record_view
from aerialdojo_gen.rendering.world import RenderWorld
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.schemas import VIEWS

ASSETS = Path(__file__).resolve().parents[2] / "scene_assets"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=6)
    n = parser.parse_args().poses
    scene = build_scene(ASSETS / "scenes" / "U_Mall_0.toml", load_catalogue(ASSETS))
    print(f"{scene.name}: {scene.n_triangles:,} triangles")

    begun = time.process_time()
    world = RenderWorld(scene)
    print(f"world built: {time.process_time() - begun:.1f} s CPU")

    # Along the plaza's edge, four metres up.
    x = np.linspace(-60.0, 20.0, n)
    route = {
        "x_m": list(x),
        "y_m": [-38.0] * n,
        "z_m": [4.0] * n,
        "yaw_rad": [0.6] * n,
        "action": [3] * (n - 1) + [0],
    }
    camera = Camera(640, 640, 90.0)
    for view in VIEWS:
        times = []
        for k in range(n):
            begun = time.process_time()
            world.render(camera, view_pose((x[k], -38.0, 4.0), 0.6, view))
            times.append(time.process_time() - begun)
        print(f"{view:>6}: {1e3 * statistics.median(times):.0f} ms CPU a 640 x 640 RGB-D view (median of {n})")

    solid, config = Solid(scene), RenderConfig()
    poses = frame_poses(route, config)
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        for view in VIEWS:
            paths = Path(folder) / f"{view}.mp4", Path(folder) / f"{view}.mkv"
            record_view(world, solid, view, poses, config, *paths)
        size = sum(p.stat().st_size for p in Path(folder).iterdir())
    seconds = (time.process_time() - begun) / n
    print(f"a pose, four views, encoded and checked: {seconds:.2f} s CPU, {size / n / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
