"""How much of what lies below the horizon is sky, in front views from random free poses of the scenes.

    python tests/bench/bench_horizon.py [--views 16] [--meshes data/meshes] [--scene U_Mall_0 ...]

By rays, with the backdrop and without it. A pose is 1.5 to 20 m over what stands there, inside the flight volume.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from common import ASSETS, built, options_of

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.model import Scene

CAMERA = Camera(80, 80, 90.0)


def shares(scene: Scene, views: int) -> np.ndarray:
    """Share of sky among the pixels below the horizon, (views, 2): without the backdrop, and with it."""
    caster = TriangleRayCaster(*soup(scene.instances))
    both = TriangleRayCaster(*soup([*scene.instances, *scene.backdrop]))
    draws, (low, high) = generator(0, "horizon-views", scene.name), scene.bounds
    rays, found = CAMERA.rays().reshape(-1, 3), []
    while len(found) < views:
        x, y = draws.uniform(low[:2] + 3.0, high[:2] - 3.0)
        yaw, above = draws.uniform(-np.pi, np.pi), draws.uniform(1.5, 20.0)
        drop = caster.first_hit(np.array([[x, y, high[2] + 50.0]]), np.array([[0.0, 0.0, -1.0]]))[0][0]
        z = high[2] + 50.0 - drop + above
        if not z < high[2] - 0.5:
            continue
        pose = view_pose((x, y, z), float(yaw), "front")
        down = rays @ pose[:3, :3].T
        down = down[down[:, 2] < 0.0]
        found.append([float((one.first_hit(pose[:3, 3], down)[1] < 0).mean()) for one in (caster, both)])
    return np.array(found)


def main() -> None:
    options = options_of(__doc__, views=16, meshes=None, scene=[])
    every = []
    for name in options.scene or sorted(path.stem for path in (ASSETS / "scenes").glob("*.toml")):
        scene = read_glb(Path(options.meshes) / f"{name}.glb") if options.meshes else built(name)
        found = shares(scene, options.views)
        every.append(found)
        triangles = sum(len(part.faces) for i in scene.backdrop for part in i.parts)
        mean, most = 100 * found.mean(axis=0), 100 * found.max(axis=0)
        print(f"{name}: mean {mean[0]:.2f} % to {mean[1]:.4f} %, most {most[0]:.1f} % to {most[1]:.4f} %, "
              f"{triangles:,} triangles", flush=True)  # fmt: skip
    whole = np.concatenate(every)
    some, many, mean = (100 * values.mean(axis=0) for values in (whole > 0.0, whole > 0.01, whole))
    print(f"{len(whole)} views: any sky in {some[0]:.1f} % to {some[1]:.2f} %")
    print(f"more than 1 % in {many[0]:.1f} % to {many[1]:.2f} %; mean {mean[0]:.2f} % to {mean[1]:.5f} %")


if __name__ == "__main__":
    main()
