"""How many samples a second a core the loader gives, where the time goes, and the environment beside it.

    python tests/bench/bench_loader.py data U_Mall_0 N_Forest_0

CPU time of this process, the best of three: one core, and other processes on the machine count less.
"""

from __future__ import annotations

import sys
import time
from tempfile import TemporaryDirectory

import numpy as np
from common import best_ms

from aerialdojo_gen import GlRenderer, make_env
from aerialdojo_gen.benchmark.observations import renderer_for
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.learning import Trajectories
from aerialdojo_gen.rendering.gl import clip_from_world
from aerialdojo_gen.rendering.gl_programs import read_pixels
from aerialdojo_gen.rendering.picture import FAR_M, NEAR_M
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.schemas import VIEWS

SAMPLES = 48


def scene_rows(data: str, scene: str) -> None:
    root = open_root(data)
    context = open_scene(*mesh_of(root, scene), SEVERAL)
    renderer = renderer_for(context.scene, "gl")
    print(f"\n{scene}, CPU ms a sample")
    print(
        f"{'px':>4} {'views':>5} {'one by one':>10} {'loader':>7} {'culling':>8} {'triangles':>9} {'pixels':>7} "
        f"{'cached':>7} {'samples/s/core':>14}"
    )
    for size in (64, 128, 224):
        for views in (VIEWS[:1], VIEWS):
            options = {"split": "all", "scene": scene, "limit": 8, "views": views, "size": size, "renderer": "gl"}
            loaded = Trajectories(data, **options)
            numbers = np.random.default_rng(0).choice(len(loaded), SAMPLES, replace=False).tolist()
            poses = [loaded.index.poses_of(k)[step] for k, step in map(loaded.place, numbers)]
            camera = Camera(size, size, 90.0)

            def alone(poses=poses, views=views, camera=camera):
                for pose in poses:
                    for view in views:
                        renderer.render(camera, view_pose(pose[:3], pose[3], view))

            def cull(poses=poses, views=views, camera=camera):
                for pose in poses:
                    visible_in(renderer, camera, [view_pose(pose[:3], pose[3], view) for view in views])

            def load(loaded=loaded, numbers=numbers):
                loaded.batch(numbers)

            alone(), cull(), load()
            with TemporaryDirectory() as folder:
                kept = Trajectories(data, **options, cache_gb=4, cache_dir=folder)
                kept.batch(numbers)
                cached = best_ms(lambda kept=kept, numbers=numbers: kept.batch(numbers)) / SAMPLES
            one, loader, culling = (best_ms(work) / SAMPLES for work in (alone, load, cull))
            triangles, pixels = drawing_ms(renderer, camera, poses, views)
            print(
                f"{size:>4} {len(views):>5} {one:>10.2f} {loader:>7.2f} {culling:>8.2f} {triangles:>9.2f} "
                f"{pixels:>7.2f} {cached:>7.2f} {1e3 / loader:>14.0f}",
                flush=True,
            )


def visible_in(renderer: GlRenderer, camera: Camera, poses: list[np.ndarray]) -> tuple[np.ndarray, list]:
    """The clip matrices of a body's views, and what they show by kind."""
    clips = np.stack([clip_from_world(camera, pose, NEAR_M, FAR_M) for pose in poses])
    nearness, eye = np.zeros((len(poses), camera.height, camera.width), np.float32), poses[0][:3, 3].copy()
    return clips, [d.kind.chunks.visible_indices(clips, eye, nearness, d.kind.hides) for d in renderer._sets]


def drawing_ms(
    renderer: GlRenderer, camera: Camera, poses: list[np.ndarray], views: tuple[str, ...]
) -> tuple[float, float]:
    """CPU milliseconds a sample of OpenGL: until triangles are handed over, and until pixels are read."""
    size = camera.width
    rgb, depth = np.empty((size, size, 3), np.uint8), np.empty((size, size), np.float32)
    best = (np.inf, np.inf)
    for _ in range(3):
        handed = read = 0.0
        for pose in poses:
            world = [view_pose(pose[:3], pose[3], view) for view in views]
            clips, visible = visible_in(renderer, camera, world)
            for v, matrix in enumerate(world):
                begun = time.process_time()
                target = renderer.draw_triangles(camera, matrix, clips[v], [of_kind[v] for of_kind in visible])
                between = time.process_time()
                read_pixels(target, rgb, depth)
                handed, read = handed + between - begun, read + time.process_time() - between
        best = min(best[0], handed), min(best[1], read)
    return 1e3 * best[0] / len(poses), 1e3 * best[1] / len(poses)


def environment(data: str, scene: str) -> None:
    for views in (VIEWS[:1], VIEWS):
        env = make_env(data, scene=scene, views=views, width=128, height=128, renderer="gl")
        env.reset(seed=0)

        def fly(env=env):
            for _ in range(60):
                ended = env.step(14)[2:4]
                if any(ended):
                    env.reset()

        fly()
        print(f"environment, {scene}, 128 px, {len(views)} views: {60e3 / best_ms(fly):.0f} steps/s/core", flush=True)


if __name__ == "__main__":
    for name in sys.argv[2:]:
        environment(sys.argv[1], name)
        scene_rows(sys.argv[1], name)
