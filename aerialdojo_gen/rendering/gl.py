"""A scene in OpenGL, over EGL and without a window: on Mesa's llvmpipe (a processor) or on a graphics card."""

from __future__ import annotations

import ctypes.util
import importlib
import os
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.geometry.arrays import Bytes, Floats, Int32s, Singles
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.rendering import gl_programs
from aerialdojo_gen.rendering import gl_shaders as glsl
from aerialdojo_gen.rendering.gl_geometry import Kind, backdrop_kinds, foreign_kinds, own_kinds
from aerialdojo_gen.rendering.gl_programs import clear_depth, read_pixels
from aerialdojo_gen.rendering.lighting import cloud_map, height_map, light_of, sun_view
from aerialdojo_gen.rendering.picture import FAR_M, NEAR_M, Picture, Renderer
from aerialdojo_gen.rendering.shading import SIDE
from aerialdojo_gen.scenes.light import Light
from aerialdojo_gen.scenes.model import Scene

_HINT = "install moderngl (pip install 'aerialdojo-gen[gl]') and Mesa (Debian: libegl1 libgl1 libgl1-mesa-dri)"


# Uniforms that change with every picture.
_PER_PICTURE = ("clip_from_world", "eye", "focal_px", "world_from_camera", "reach")

# Pictures that are culled together at most, and that are drawn before the first of them is read.
_GROUP, _AHEAD = 16, 4

# A context is valid only in the thread that made it.
_thread = threading.local()


def context() -> Any:
    """Return this thread's OpenGL context, a `moderngl.Context`."""
    if (current := getattr(_thread, "context", None)) is not None:
        return current
    # No threads of llvmpipe's own: several processes share the cores.
    os.environ.setdefault("LP_NUM_THREADS", "0")
    try:
        moderngl: Any = importlib.import_module("moderngl")

        # Find the versioned names: the development packages may be missing.
        libraries = {"libegl": ctypes.util.find_library("EGL"), "libgl": ctypes.util.find_library("GL")}
        named = {option: library for option, library in libraries.items() if library}
        _thread.context = moderngl.create_standalone_context(backend="egl", require=430, **named)
    except ImportError:
        raise RenderError(f"the renderer gl lacks the package moderngl: {_HINT}") from None
    except Exception as error:  # glcontext raises plain Exceptions
        raise RenderError(f"the renderer gl does not start ({error}): {_HINT}") from None
    # Pictures are drawn upside down, so that their first row comes first in memory: that flips the winding.
    _thread.context.front_face = "cw"
    _thread.context.depth_func = "<="
    return _thread.context


def release_context() -> None:
    """Free this thread's OpenGL context, if it has one; the thread draws no more."""
    if (current := _thread.__dict__.pop("context", None)) is not None:
        current.release()


class GlRenderer(Renderer):
    """A scene ready to be rendered by OpenGL; a context manager that frees its memory at its end.

    Parameters
    ----------
    scene : Scene
        Copied into buffers. Front faces are drawn (those wound counter-clockwise as the camera sees them), and both
        sides of double-sided materials.

    Raises
    ------
    RenderError
        There is no OpenGL here; the message says what to install.
    """

    name = "gl"

    def __init__(self, scene: Scene) -> None:
        self._gl = context()
        self.device = str(self._gl.info["GL_RENDERER"])
        self._owned: list[Any] = []
        self._arrays: dict[tuple[tuple[str, ...], int], tuple[Any, dict[str, Any]]] = {}
        self._targets: dict[tuple[int, int, bool, int], Any] = {}
        kinds = [*own_kinds(scene), *foreign_kinds(scene)]
        shared: dict[int, Any] = {}
        self._sets = [_DrawSet(kind, self, shared) for kind in kinds]
        self._backdrop = [_DrawSet(kind, self, shared) for kind in backdrop_kinds(scene)]
        self._indices = self._own(self._gl.buffer(reserve=4, dynamic=True))
        self._scene = scene
        self._clouds = self._own(gl_programs.table_texture(self._gl, cloud_map(scene.name)[..., None], "f1"))
        self._height_map = height_map(scene)
        # As floats: llvmpipe reads bytes between cells more slowly.
        above = (self._height_map.above[..., None] / 255.0).astype(np.float16)
        self._heights = self._own(gl_programs.table_texture(self._gl, above, "f2"))
        self._heights.repeat_x = self._heights.repeat_y = False
        self._shadow: Any = None
        self.relight(scene.light)

    def relight(self, light: Light) -> None:
        """Draw by another light from now on."""
        self.light = light
        self._light = light_of(self._scene, light=light)
        camera, pose, near_m, far_m = sun_view(self._scene, glsl.SHADOW_PX, light)
        self._sun_from_world = clip_from_world(camera, pose, near_m, far_m)
        self._bias_m = 0.03 + 1.5 * (near_m + far_m) / 2.0 / camera.focal_px
        if self._shadow is not None:
            self._owned.remove(self._shadow)
            self._shadow.release()
        self._shadow = self._shadow_map()
        for array, _ in self._arrays.values():
            self._set_light(array.program)

    def _own(self, resource: Any) -> Any:
        self._owned.append(resource)
        return resource

    def texture_array(self, kind: Kind) -> Any:
        """Upload a kind's textures; None where it has none."""
        if kind.layers is None:
            return None
        layers = kind.layers
        n, height, width, channels = layers.shape
        if channels == 3:
            # Four bytes a texel: with three, llvmpipe takes a tenth longer.
            whole = np.full((n, height, width, 4), 255, dtype=np.uint8)
            whole[..., :3] = layers
            layers = whole
        texture = self._own(self._gl.texture_array((width, height, n), 4, layers))
        texture.build_mipmaps()
        if kind.smooth:
            texture.filter = (self._gl.LINEAR_MIPMAP_LINEAR, self._gl.LINEAR)
        else:
            # One mipmap level is enough: a texture fades into its mean before two levels differ.
            texture.filter = (self._gl.NEAREST_MIPMAP_NEAREST, self._gl.NEAREST)
        return texture

    def _shadow_map(self) -> Any:
        """Draw the shadow map, of which the shader averages the comparisons with the four nearest depths."""
        gl = self._gl
        depth = gl.depth_texture((glsl.SHADOW_PX, glsl.SHADOW_PX))
        target = gl.framebuffer(depth_attachment=depth)
        self._begin(target)
        for drawn in self._sets:
            if "HORIZON" in drawn.kind.tags:
                continue
            program = gl.program(*(glsl.specialise(source, *drawn.kind.tags) for source in glsl.SUN))
            gl_programs.set_all(program, clip_from_world=gl_programs.columns(self._sun_from_world), textures=0)
            array = gl.vertex_array(program, [gl_programs.content(program, drawn.buffer)])
            drawn.begin(gl)
            array.render()
            array.release()
            program.release()
        target.release()
        # As a float texture: llvmpipe's comparison with a depth texture takes twice as long.
        shadow = self._own(gl.texture((glsl.SHADOW_PX, glsl.SHADOW_PX), 1, depth.read(), dtype="f4"))
        depth.release()
        shadow.filter = (gl.NEAREST, gl.NEAREST)
        return shadow

    def _begin(self, target: Any, colours: int = 0) -> None:
        """Begin to draw into a target; its colours are not cleared, because the sky covers them."""
        gl = self._gl
        gl.enable_only(gl.DEPTH_TEST | gl.CULL_FACE)
        clear_depth(target, colours)
        target.use()

    def render(self, camera: Camera, world_from_camera: Floats, instances: bool = False) -> Picture:
        """Take a picture; see `Renderer`."""
        return self.render_views(camera, [world_from_camera], instances)[0]

    def render_into(
        self, camera: Camera, poses: Sequence[Floats], rgb: Bytes, depth_m: Singles, instance: Int32s | None
    ) -> None:
        """Take pictures into arrays: neighbours that share their eye are culled together; see `Renderer`."""
        waiting: deque[tuple[Any, int]] = deque()

        def read(left: int) -> None:
            """Read the oldest pictures, later ones being drawn already: so OpenGL is not waited for."""
            while len(waiting) > left:
                target, k = waiting.popleft()
                read_pixels(target, rgb[k], depth_m[k], None if instance is None else instance[k])

        # In groups that bound the memory of a body that hovers.
        for _, group in groupby(range(len(poses)), lambda k: (k // _GROUP, poses[k][:3, 3].tobytes())):
            numbers = list(group)
            own = [poses[k] for k in numbers]
            clips = np.stack([clip_from_world(camera, pose, NEAR_M, FAR_M) for pose in own])
            eye, nearness = own[0][:3, 3].copy(), np.zeros((len(own), *depth_m.shape[1:]), np.float32)
            visible = [d.kind.chunks.visible_indices(clips, eye, nearness, d.kind.hides) for d in self._sets]
            for k, pose, clip, *chosen in zip(numbers, own, clips, *visible, strict=True):
                slot = k % (_AHEAD + 1)
                waiting.append((self.draw_triangles(camera, pose, clip, chosen, instance is not None, slot), k))
                read(_AHEAD)
        read(0)

    def draw_triangles(
        self, camera: Camera, world_from_camera: Floats, clip: Floats, visible: Sequence[NDArray[np.uint32]],
        instances: bool = False, slot: int = 0,
    ) -> Any:  # fmt: skip
        """Draw what is visible, indices of each kind's vertices, and the sky into a target of this size and slot."""
        target = self._target(camera.width, camera.height, instances, slot)
        eye = world_from_camera[:3, 3].astype(np.float32).tobytes()
        self._begin(target, 1 + instances)
        self._shadow.use(1)
        self._clouds.use(2)
        self._heights.use(3)
        tags = ("INSTANCES",) if instances else ()

        place = {
            "clip_from_world": gl_programs.columns(clip),
            "eye": eye,
            "focal_px": np.float32(camera.focal_px).tobytes(),
        }

        def draw(drawn: _DrawSet, first: int, count: int) -> None:
            drawn.begin(self._gl)
            array, uniforms = self._array((*drawn.kind.tags, *tags), drawn.buffer)
            gl_programs.write(uniforms, place)
            array.render(vertices=count, first=first)

        far = [np.arange(len(drawn.kind.chunks.vertices), dtype=np.uint32) for drawn in self._backdrop]
        # All indices at once, in a buffer as small as possible: Mesa clears all of it.
        chosen = np.concatenate([*visible, *far])
        if len(chosen):
            self._indices.orphan(chosen.nbytes)
            self._indices.write(chosen)
        first = 0
        for drawn, of_kind in zip(self._sets, visible, strict=True):
            if len(of_kind):
                draw(drawn, first, len(of_kind))
            first += len(of_kind)
        self._gl.disable(self._gl.CULL_FACE)
        sky, uniforms = self._array(("SKY", *tags), None)
        gl_programs.write(
            uniforms,
            {"world_from_camera": gl_programs.columns(world_from_camera[:3, :3]), "reach": _half_extent(camera)},
        )
        sky.render(vertices=3)
        # After the sky: depths near the far plane round to it, and the last one drawn wins.
        for drawn, of_kind in zip(self._backdrop, far, strict=True):
            draw(drawn, first, len(of_kind))
            first += len(of_kind)
        return target

    def _array(self, tags: tuple[str, ...], buffer: Any) -> tuple[Any, dict[str, Any]]:
        """Return the vertex array of a program and buffer, made on first use, and its uniforms."""
        # Two kinds may have one program, and never one buffer.
        if self._light.wet:
            tags = (*tags, "WET")
        key = (tags, id(buffer))
        if key not in self._arrays:
            sky = "SKY" in tags
            sources = glsl.SKY if sky else glsl.SURFACES
            program = self._own(self._gl.program(*(glsl.specialise(source, *tags) for source in sources)))
            self._set_light(program)
            content, indices = ([], None) if sky else ([gl_programs.content(program, buffer)], self._indices)
            uniforms = {name: program[name] for name in _PER_PICTURE if name in program}
            self._arrays[key] = self._own(self._gl.vertex_array(program, content, index_buffer=indices)), uniforms
        return self._arrays[key]

    def _set_light(self, program: Any) -> None:
        """Set what stays the same from picture to picture."""
        light, at = self._light, self._height_map
        rows, columns = at.above.shape
        side = light.sun[:2] / (np.linalg.norm(light.sun[:2]) + 1e-9) * SIDE
        gl_programs.set_all(
            program, sun_from_world=gl_programs.columns(self._sun_from_world), sun=light.sun, bias_m=self._bias_m,
            side=side,
            horizon=light.horizon / 255.0, zenith=light.zenith / 255.0, lowest_m=at.lowest_m,
            sun_rgb=light.sun_rgb, sky_rgb=light.sky_rgb,
            ground_rgb=light.ground_rgb, air=light.rows[6], place=np.array([at.west_m, at.south_m]),
            extent=1.0 / (at.cell_m * np.array([columns, rows])), textures=0, shadow=1, clouds=2, heights=3,
        )  # fmt: skip

    def _target(self, width: int, height: int, instances: bool, slot: int) -> Any:
        key = (width, height, instances, slot)
        if key not in self._targets:
            gl, size = self._gl, (width, height)
            colours = [gl.renderbuffer(size, 2, dtype="u4")]
            if instances:
                # As floats, exact to 16 million: not every driver clears an attachment of integers.
                colours.append(gl.renderbuffer(size, 1, dtype="f4"))
            depth = gl.depth_renderbuffer(size)
            self._targets[key] = self._own(gl.framebuffer(colours, depth))
            self._owned += [*colours, depth]
        return self._targets[key]

    def close(self) -> None:
        """Free the renderer's memory; does nothing when called again, or in another thread than its own."""
        while self._owned:
            resource = self._owned.pop()
            if getattr(_thread, "context", None) is self._gl:
                resource.release()
        self._arrays, self._targets = {}, {}


class _DrawSet:
    """A kind of surface in the renderer's memory."""

    def __init__(self, kind: Kind, renderer: GlRenderer, shared: dict[int, Any]) -> None:
        self.kind = replace(kind, layers=None)
        self.buffer = renderer._own(renderer._gl.buffer(kind.chunks.vertices.tobytes()))
        if id(kind.layers) not in shared:
            shared[id(kind.layers)] = renderer.texture_array(kind)
        self.textures = shared[id(kind.layers)]

    def begin(self, gl: Any) -> None:
        """Set the OpenGL state of this kind."""
        if self.textures is not None:
            self.textures.use(0)
        if self.kind.double_sided:
            gl.disable(gl.CULL_FACE)
        else:
            gl.enable(gl.CULL_FACE)


def clip_from_world(camera: Camera, world_from_camera: Floats, near_m: float, far_m: float) -> Floats:
    """OpenGL's matrix for a camera, row-major (4, 4) float64, the picture's first row at the bottom."""
    return np.asarray(_projection(camera, near_m, far_m) @ np.linalg.inv(world_from_camera))


@lru_cache(maxsize=64)
def _projection(camera: Camera, near_m: float, far_m: float) -> Floats:
    x, y = 2.0 * camera.focal_px / camera.width, 2.0 * camera.focal_px / camera.height
    span = far_m - near_m
    projection = np.diag([x, y, (far_m + near_m) / span, 0.0])
    projection[2, 3], projection[3, 2] = -2.0 * far_m * near_m / span, 1.0
    return projection


@lru_cache(maxsize=64)
def _half_extent(camera: Camera) -> bytes:
    """Half the picture's width and height at a depth of 1, for the sky's shader."""
    return (np.array([camera.width, camera.height]) / 2.0 / camera.focal_px).astype(np.float32).tobytes()
