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
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import TracebackType
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.config.sections import RENDERERS, RendererName
from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.rendering.casters import ray_caster
from aerialdojo_gen.rendering.picture import Picture
from aerialdojo_gen.rendering.probe import probe_scene
from aerialdojo_gen.scenes.context import context_of, open_contexts
from aerialdojo_gen.scenes.model import Scene

Floats = NDArray[np.float64]

_TOLERANCE_M, _SHARE, _EDGE_SHARE = 0.01, 0.999, 0.1
_here = threading.local()


class Renderer(Protocol):
    """A scene ready to be rendered; a context manager that frees its memory at its end."""

    @property
    def name(self) -> str:
        """One of `RENDERERS`."""
        ...

    @property
    def device(self) -> str:
        """What draws, in the driver's words."""
        ...

    def render(self, camera: Camera, world_from_camera: Floats, instances: bool = False) -> Picture:
        """Take a picture from a pose (4, 4); its arrays are not changed by later calls."""
        ...

    def render_views(self, camera: Camera, poses: Sequence[Floats], instances: bool = False) -> list[Picture]:
        """Take several pictures at once, which costs less where they share their eye."""
        ...

    def close(self) -> None:
        """Free the memory; a second call does nothing."""
        ...

    def __enter__(self) -> Self:
        """Return itself."""
        ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Free the memory."""
        ...


class PyBulletRenderer:
    """A scene in PyBullet's TinyRenderer; see `Renderer`."""

    name = "pybullet"
    device = "TinyRenderer"

    def __init__(self, scene: Scene) -> None:
        # Here alone, so that who draws with something else loads no PyBullet.
        from aerialdojo_gen.rendering.world import RenderWorld

        self._scene = scene
        self._world = RenderWorld(scene)

    def render(self, camera: Camera, world_from_camera: Floats, instances: bool = False) -> Picture:
        """Take a picture; the instance id map is made by casting a ray a pixel."""
        picture = self._world.render(camera, world_from_camera)
        if not instances:
            return picture
        rays = camera.rays().reshape(-1, 3) @ world_from_camera[:3, :3].T
        owner = ray_caster(self._scene).first_hit(world_from_camera[:3, 3], rays)[1]
        return Picture(picture.rgb, picture.depth_m, owner.reshape(camera.height, camera.width))

    def render_views(self, camera: Camera, poses: Sequence[Floats], instances: bool = False) -> list[Picture]:
        """Take the pictures one by one."""
        return [self.render(camera, pose, instances) for pose in poses]

    def close(self) -> None:
        """Free the memory."""
        self._world.close()

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Free the memory."""
        self.close()


@dataclass(frozen=True)
class Choice:
    """Which renderer is taken, and why."""

    name: RendererName  # One of `RENDERERS`
    why: str  # One line for people


def open_renderer(scene: Scene, name: str = "auto") -> Renderer:
    """Make a scene ready to be rendered."""
    if name == "auto":
        name = choose_renderer().name
    if name == "pybullet":
        return PyBulletRenderer(scene)
    if name == "gl":
        from aerialdojo_gen.rendering.gl import GlRenderer

        return GlRenderer(scene)
    raise RenderError(f"there is no renderer {name!r}: it is one of {', '.join(RENDERERS)}, or auto")


def kept_renderer(scene: Scene, name: str, anew: bool = False) -> Renderer:
    """Return the scene's renderer: its context's, kept until one of another name is asked for; not to be closed."""
    context = context_of(scene)
    if anew:
        context.drop("renderer")
    # What draws by OpenGL draws in the thread that made it alone.
    if not hasattr(_here, "thread"):
        _here.thread = object()
    return context.part("renderer", lambda: open_renderer(scene, name), name, _here.thread)


def forget_renderers() -> None:
    """Close what draws, as far as it lets itself be closed; the next picture opens it anew."""
    for context in open_contexts():
        with contextlib.suppress(Exception):
            context.drop("renderer")


@lru_cache
def choose_renderer(name: str = "auto") -> Choice:
    """Choose the fastest renderer whose pictures of a known scene are right, or check the one that is named."""
    failures = []
    for candidate in RENDERERS if name == "auto" else (name,):
        try:
            with open_renderer(probe_scene(), candidate) as renderer:
                said = check(renderer)
        except RenderError as error:
            if name != "auto":
                raise
            failures.append(str(error))
            continue
        known = next(n for n in RENDERERS if n == candidate)
        return Choice(known, "; ".join([f"renderer {candidate} ({renderer.device}): {said}", *failures]))
    raise RenderError("; ".join(failures))


def check(renderer: Renderer) -> str:
    """Check a renderer of `probe_scene` against ray casts.

    Depth within 1 cm at 99.9 % of the pixels, red only where it is.
    """
    scene = probe_scene()
    caster, camera = RayCaster(scene), Camera(192, 192, 90.0)
    rays = camera.rays().reshape(-1, 3)
    right = pixels = 0
    seconds = 0.0
    for k, view in enumerate(("front", "left", "right", "down")):
        pose = view_pose((-1.3, 0.4, 2.6), 0.35, view)
        if k == 0:
            renderer.render(camera, pose)  # the first picture is slower than all others
        begun = time.process_time()
        picture = renderer.render(camera, pose)
        seconds += time.process_time() - begun
        along, owner = caster.first_hit(pose[:3, 3], rays @ pose[:3, :3].T)
        cast = (along / np.linalg.norm(rays, axis=1)).reshape(picture.depth_m.shape)
        with np.errstate(invalid="ignore"):
            agrees = np.abs(picture.depth_m - cast) <= _TOLERANCE_M
        right += int((agrees | (np.isinf(cast) & np.isinf(picture.depth_m))).sum())
        pixels += agrees.size
        on_cube = (owner == next(n for n, i in enumerate(scene.instances) if i.node == "cube")).reshape(cast.shape)
        colour = picture.rgb.astype(float)
        red = colour[..., 0] >= 2.0 * colour[..., 1:].max(axis=-1)
        # Pixels at the cube's edges may be of either colour.
        if int((red != on_cube).sum()) > _EDGE_SHARE * on_cube.sum():
            raise RenderError(
                f"the renderer {renderer.name} ({renderer.device}) is refused: it draws {int(red.sum()):,} pixels of "
                f"the {view} view red, {int((red & on_cube).sum()):,} of the red cube's {int(on_cube.sum()):,}"
            )
    share = right / pixels
    figures = f"depth within 1 cm of ray casts at {100 * share:.2f} % of {pixels:,} pixels"
    if share < _SHARE:
        raise RenderError(f"the renderer {renderer.name} ({renderer.device}) is refused: {figures}")
    return f"{figures}, {1e3 * seconds / 4:.1f} ms CPU a view of {camera.width} x {camera.height}"
