"""The renderers behind one interface, and the choice between them.

- ``gl``: OpenGL over EGL (Mesa's llvmpipe, or a graphics card); needs the package moderngl and libEGL.
- ``pybullet``: PyBullet's TinyRenderer; runs anywhere, ten times slower.

PyBullet's own EGL plugin is not among them: its 16-bit depth buffer does not pass the check below
(`docs/recordings.md` has the figures).
"""

from __future__ import annotations

import contextlib
import threading
import time
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from aerialdojo_gen.base.config.sections import RENDERERS, RendererName
from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.geometry.arrays import Floats
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.rendering.picture import Renderer
from aerialdojo_gen.scenes.context import context_of, open_contexts
from aerialdojo_gen.scenes.light import Light
from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene

_TOLERANCE_M, _MIN_SHARE, _EDGE_SHARE = 0.01, 0.999, 0.1
_thread = threading.local()


@dataclass(frozen=True)
class RendererChoice:
    """The renderer to use, and why."""

    name: RendererName  # One of `RENDERERS`
    why: str  # One line for people


def open_renderer(scene: Scene, name: str = "auto") -> Renderer:
    """Open a renderer of a scene."""
    if name == "auto":
        name = choose_renderer().name
    if name == "pybullet":
        # Imported here, so that other renderers do not load PyBullet.
        from aerialdojo_gen.rendering.world import PyBulletRenderer

        return PyBulletRenderer(scene)
    if name == "gl":
        from aerialdojo_gen.rendering.gl import GlRenderer

        return GlRenderer(scene)
    raise RenderError(f"unknown renderer {name!r}: one of {', '.join(RENDERERS)}, or auto")


def scene_renderer(scene: Scene, name: str, light: Light | None = None, reopen: bool = False) -> Renderer:
    """Return the renderer of the scene's context, by the scene's own light without another; do not close it."""
    context = context_of(scene)
    if reopen:
        context.drop("renderer")
    # An OpenGL renderer draws only in the thread that made it.
    if not hasattr(_thread, "thread"):
        _thread.thread = object()
    renderer = context.part("renderer", lambda: open_renderer(scene, name), name, _thread.thread)
    if renderer.light != (light or scene.light):
        renderer.relight(light or scene.light)
    return renderer


def close_renderers() -> None:
    """Close all renderers, ignoring errors; the next picture opens a new one."""
    for context in open_contexts():
        with contextlib.suppress(Exception):
            context.drop("renderer")


@lru_cache
def choose_renderer(name: str = "auto") -> RendererChoice:
    """Choose the fastest renderer that passes `check_renderer`, or check the named one."""
    failures = []
    for candidate in RENDERERS if name == "auto" else (name,):
        try:
            with open_renderer(probe_scene(), candidate) as renderer:
                summary = check_renderer(renderer)
        except RenderError as error:
            if name != "auto":
                raise
            failures.append(str(error))
            continue
        chosen = next(n for n in RENDERERS if n == candidate)
        return RendererChoice(chosen, "; ".join([f"renderer {candidate} ({renderer.device}): {summary}", *failures]))
    raise RenderError("; ".join(failures))


def check_renderer(renderer: Renderer) -> str:
    """Check a renderer of `probe_scene` against ray casts: depth within 1 cm at 99.9 % of the pixels, and colour."""
    scene = probe_scene()
    caster, camera = RayCaster(scene), Camera(192, 192, 90.0)
    rays = camera.rays().reshape(-1, 3)
    right = pixels = 0
    seconds = 0.0
    for k, view in enumerate(("front", "left", "right", "down")):
        pose = view_pose((-1.3, 0.4, 2.6), 0.35, view)
        if k == 0:
            renderer.render(camera, pose)  # warm up
        started = time.process_time()
        picture = renderer.render(camera, pose)
        seconds += time.process_time() - started
        along, owner = caster.first_hit(pose[:3, 3], rays @ pose[:3, :3].T)
        cast = (along / np.linalg.norm(rays, axis=1)).reshape(picture.depth_m.shape)
        with np.errstate(invalid="ignore"):
            agrees = np.abs(picture.depth_m - cast) <= _TOLERANCE_M
        right += int((agrees | (np.isinf(cast) & np.isinf(picture.depth_m))).sum())
        pixels += agrees.size
        on_cube = (owner == next(n for n, i in enumerate(scene.instances) if i.node == "cube")).reshape(cast.shape)
        colour = picture.rgb.astype(float)
        red = colour[..., 0] >= 2.0 * colour[..., 1:].max(axis=-1)
        # Pixels at the cube's edges may have either colour.
        if int((red != on_cube).sum()) > _EDGE_SHARE * on_cube.sum():
            raise RenderError(
                f"renderer {renderer.name} ({renderer.device}) rejected: it draws {int(red.sum()):,} pixels of "
                f"the {view} view red, {int((red & on_cube).sum()):,} of the red cube's {int(on_cube.sum()):,}"
            )
    share = right / pixels
    figures = f"depth within 1 cm of ray casts at {100 * share:.2f} % of {pixels:,} pixels"
    if share < _MIN_SHARE:
        raise RenderError(f"renderer {renderer.name} ({renderer.device}) rejected: {figures}")
    return f"{figures}, {1e3 * seconds / 4:.1f} ms CPU a view of {camera.width} x {camera.height}"


# The corners of a box's six faces, counter-clockwise seen from outside; bit 0 of a corner is x, bit 1 y, bit 2 z.
_FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


@lru_cache(maxsize=1)
def probe_scene() -> Scene:
    """Build a yard of 16 m: a checkered ground, two walls, a red cube and slanted bars before the sky."""
    checks = np.kron([[60, 150], [150, 60]], np.ones((8, 8)))[..., None].repeat(3, axis=2).astype(np.uint8)
    materials = {
        "checks": Material("checks", (105, 105, 105), checks, 2.0),
        "grey": Material("grey", (140, 140, 140)),
        "red": Material("red", (210, 30, 30)),
    }
    bars = [_box(f"bar_{k}", (3.0 + k, 3.2, 2.0), (3.2 + k, 3.4, 6.0), "grey", lean=0.3 * k) for k in range(3)]
    instances = (
        _box("ground", (-12.0, -12.0, -1.0), (12.0, 12.0, 0.0), "checks"),
        _box("north", (-8.0, 8.0, 0.0), (8.0, 9.0, 4.0), "grey"),
        _box("south", (-8.0, -9.0, 0.0), (8.0, -8.0, 4.0), "checks"),
        _box("cube", (2.0, 1.0, 1.0), (3.0, 2.0, 2.0), "red"),
        *bars,
    )
    return Scene("Probe", instances, materials, np.array([[-12.0, -12.0, 0.0], [12.0, 12.0, 12.0]]))


def _box(
    node: str, low: tuple[float, float, float], high: tuple[float, float, float], material: str, lean: float = 0.0
) -> Instance:
    """Make a box, sheared along x by `lean` metres over its height."""
    ends = np.array([low, high])
    vertices, faces = [], []
    for k, face in enumerate(_FACES):
        for corner in face:
            bits = [corner & 1, corner >> 1 & 1, corner >> 2 & 1]
            x, y, z = (ends[bit, axis] for axis, bit in enumerate(bits))
            vertices.append((x + lean * bits[2], y, z))
        faces += [(4 * k, 4 * k + 1, 4 * k + 2), (4 * k, 4 * k + 2, 4 * k + 3)]
    at: Floats = np.array(vertices)
    uv = (at[:, :2] + at[:, 2:]).astype(np.float32) / np.float32(2.0)
    return Instance(node, "probe", "", {}, (Part(at, np.array(faces, dtype=np.int32), uv, material),))
