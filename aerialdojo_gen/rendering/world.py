"""A scene in PyBullet's software renderer (TinyRenderer): pictures and depth on any machine.

Its triangles are merged by material, so that the segmentation mask holds every pixel's material. A software
rasteriser visits every pixel of a triangle's bounding box, visible or not. So triangles that no camera can see from
the front are dropped, and long ones are cut: a long sliver would cost as much as a whole picture.
"""

from __future__ import annotations

import ctypes
import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np

from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.base.pictures import encode_png
from aerialdojo_gen.geometry.arrays import Bytes, Flags, Floats, Int32s, Ints, Singles
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.geometry.portable import product
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.rendering.casters import ray_caster
from aerialdojo_gen.rendering.lighting import Lighting, ShadowMap, cloud_map, height_map, light_of, sun_view
from aerialdojo_gen.rendering.picture import FAR_M, NEAR_M, Picture, Renderer
from aerialdojo_gen.rendering.shading import shade
from aerialdojo_gen.rendering.texels import Backdrop, downscale
from aerialdojo_gen.scenes.colours import texel
from aerialdojo_gen.scenes.light import Light
from aerialdojo_gen.scenes.model import Material, Part, Scene
from aerialdojo_gen.store.staging import scratch_folder


def _import_silently() -> ModuleType:
    """Import PyBullet; RenderError where it is not installed: it has no wheel for Python 3.12 and later."""
    sys.stderr.flush()
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        import pybullet as module

        # C's stdio may hold the line back until after the descriptor is restored.
        ctypes.CDLL(None).fflush(None)
    except ImportError:
        raise RenderError(
            "the renderer pybullet lacks the package pybullet, which has wheels up to Python 3.11: take gl, or build "
            "it with a C++ compiler and Python's headers (pip install 'aerialdojo-gen[pybullet]')"
        ) from None
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)
    result: ModuleType = module
    return result


pybullet = _import_silently()


# Steps by which a camera moves off a vertex in its own plane, and the gap that float32 needs, metres.
_NUDGE_M, _GAP_M = 1.3e-4, 3e-5
_LARGEST_ATLAS_PX = 2048


class PyBulletRenderer(Renderer):
    """A scene in PyBullet's TinyRenderer."""

    name, device = "pybullet", "TinyRenderer"

    def __init__(self, scene: Scene) -> None:
        found = surfaces(scene)
        self._scene = scene
        self._vertices = np.concatenate([s.vertices for s in found])
        self._materials = [s.material for s in found]
        self._clouds, self._heights = cloud_map(scene.name), height_map(scene)
        self._client = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise RenderError("PyBullet's DIRECT client did not start: too many renderers are open in this process")
        # Otherwise PyBullet would return the cached mesh of a reused file name.
        pybullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=self._client)
        # Meshes go through OBJ files: inline vertices leak about 50 MB a scene in PyBullet.
        with scratch_folder() as folder:
            textures: dict[str, int] = {}
            for k, surface in enumerate(found):
                self._add(surface, k, scene.materials[surface.material], textures, folder)
        self.relight(scene.light)

    def relight(self, light: Light) -> None:
        """Draw by another light from now on."""
        self.light = light
        self._light: Lighting = light_of(self._scene, self._materials, light)
        self._backdrop = Backdrop(self._scene, self._light)
        self._shadow: ShadowMap | None = None

    def _shadow_map(self) -> ShadowMap:
        """Rasterise shadows for the first picture by a light: a renderer may be lit anew before it."""
        if self._shadow is None:
            camera, pose, near_m, far_m = sun_view(self._scene, light=self.light)
            self._shadow = ShadowMap.of(camera, pose, self.rasterise(camera, pose, near_m, far_m)[1])
        return self._shadow

    def _add(self, surface: Surface, k: int, material: Material, textures: dict[str, int], folder: Path) -> None:
        client = self._client
        path = folder / f"{k}.obj"
        write_obj(path, surface)
        texture = material.texture if surface.palette is None else surface.palette
        rgba = (1.0, 1.0, 1.0, 1.0) if texture is not None else (*(c / 255 for c in material.colour), 1.0)
        shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH, fileName=str(path), rgbaColor=rgba, specularColor=(0, 0, 0),
            physicsClientId=client,
        )  # fmt: skip
        body = pybullet.createMultiBody(0, -1, shape, physicsClientId=client) if shape >= 0 else -1
        path.unlink()
        # Bodies are numbered in order, and the segmentation mask is read as the surface's number.
        if body != k:
            raise RenderError(f"PyBullet did not load the surface of material {material.name!r}")
        if texture is not None:
            if material.name not in textures:
                picture = folder / f"texture{len(textures)}.png"
                # TinyRenderer samples the nearest texel: details finer than a pixel would flicker.
                downscaled = (
                    downscale(texture, _LARGEST_ATLAS_PX) if material.atlas and surface.palette is None else texture
                )
                picture.write_bytes(encode_png(downscaled))
                textures[material.name] = pybullet.loadTexture(str(picture), physicsClientId=client)
            pybullet.changeVisualShape(body, -1, textureUniqueId=textures[material.name], physicsClientId=client)

    def render(self, camera: Camera, world_from_camera: Floats, instances: bool = False) -> Picture:
        """Take a picture; the instance id map is ray-cast."""
        albedo, depth, surface = self.rasterise(camera, world_from_camera)
        lit_by = self._light, self._shadow_map(), self._clouds, self._heights
        rgb = shade(camera, world_from_camera, albedo, depth, surface, *lit_by)
        self._backdrop.paint(rgb, surface < 0, camera, world_from_camera)
        if not instances:
            return Picture(rgb, depth)
        rays = product(camera.rays().reshape(-1, 3), world_from_camera[:3, :3].T)
        owner = ray_caster(self._scene).first_hit(world_from_camera[:3, 3], rays)[1]
        return Picture(rgb, depth, owner.reshape(depth.shape))

    def rasterise(
        self, camera: Camera, world_from_camera: Floats, near_m: float = NEAR_M, far_m: float = FAR_M
    ) -> tuple[Bytes, Singles, Int32s]:
        """Rasterise without light: albedo (H, W, 3) uint8, planar depth (inf: no hit), surface number (-1: none)."""
        w, h = camera.width, camera.height
        projection = _projection(camera, near_m, far_m)
        view = np.linalg.inv(world_from_camera)
        nudge = _nudge(_close_to_plane(self._vertices, view[2], 0.02))
        view[2, 3] += nudge
        view[1:3] *= -1.0  # OpenGL's camera: y up, looking along -z
        _, _, rgba, buffer, mask = pybullet.getCameraImage(
            w, h, view.T.ravel().tolist(), projection.T.ravel().tolist(),
            shadow=0, lightDirection=(0, 0, 1), lightColor=(1, 1, 1), lightAmbientCoeff=1.0, lightDiffuseCoeff=0.0,
            lightSpecularCoeff=0.0, renderer=pybullet.ER_TINY_RENDERER, physicsClientId=self._client,
        )  # fmt: skip
        nearness = np.asarray(buffer, dtype=np.float64).reshape(h, w)
        surface = np.asarray(mask, dtype=np.int32).reshape(h, w)
        linear = far_m * near_m / (far_m - (far_m - near_m) * nearness) - nudge
        depth = np.where(surface >= 0, linear, np.inf).astype(np.float32)
        return np.asarray(rgba, dtype=np.uint8).reshape(h, w, 4)[..., :3], depth, surface

    def close(self) -> None:
        """Free the renderer's memory; a second call does nothing."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1


@njit(cache=True)
def _close_to_plane(points: Floats, plane: Floats, reach_m: float) -> Floats:
    """Signed distances (k,) of those points (n, 3) that lie within reach of a plane (4,)."""
    close = []
    for i in range(len(points)):
        distance = plane[0] * points[i, 0] + plane[1] * points[i, 1] + plane[2] * points[i, 2] + plane[3]
        if abs(distance) < reach_m:
            close.append(distance)
    return np.array(close, dtype=np.float64)


def _nudge(close: Floats) -> float:
    """How far, metres, the camera steps back so that no vertex lies in its plane: TinyRenderer divides by depth."""
    if not len(close):
        return 0.0
    steps = _NUDGE_M * np.array([k * sign for k in range(40) for sign in (1, -1)])
    gap = np.abs(close[None] + steps[:, None]).min(axis=1)
    free = gap > _GAP_M
    return float(steps[free.argmax() if free.any() else gap.argmax()])


def _projection(camera: Camera, near_m: float, far_m: float) -> Floats:
    """OpenGL's projection, row-major (4, 4), shifted for TinyRenderer.

    It samples at (column, row + 1) in place of the pixel's centre: the picture is shifted by half a pixel each way.
    """
    x, y = 2.0 * camera.focal_px / camera.width, 2.0 * camera.focal_px / camera.height
    span = far_m - near_m
    return np.array(
        [
            [x, 0.0, 1.0 / camera.width, 0.0],
            [0.0, y, 1.0 / camera.height, 0.0],
            [0.0, 0.0, -(far_m + near_m) / span, -2.0 * far_m * near_m / span],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )


def write_obj(path: Path, surface: Surface) -> None:
    """Write a surface as Wavefront OBJ with texture coordinates."""
    with path.open("w", encoding="ascii") as file:
        file.write(("v %.5f %.5f %.5f\n" * len(surface.vertices)) % tuple(surface.vertices.ravel().tolist()))
        file.write(("vt %.5f %.5f\n" * len(surface.uv)) % tuple(surface.uv.ravel().tolist()))
        corners = np.repeat(surface.faces.ravel() + 1, 2)
        file.write(("f %d/%d %d/%d %d/%d\n" * len(surface.faces)) % tuple(corners.tolist()))


# Edges longer than this are halved, metres.
_LONGEST_EDGE_M = 10.0
# Margins of the cameras' box around the flight volume and above its floor, metres.
_AROUND_M, _FLOOR_M = 300.0, 0.1
# Subdivisions of masked triangles into four, and the maximum number of triangles.
_HALVINGS, _MAX_CUT = 4, 200_000


@dataclass(frozen=True, eq=False)
class Surface:
    """All triangles of one material."""

    material: str  # Name of the material
    vertices: Floats  # (n, 3) float64; metres, world frame
    uv: Floats  # (n, 2) float64; texture coordinates in tiles
    faces: Ints  # (m, 3) int64; indices into `vertices`
    palette: Bytes | None = None  # (h, w, 3) uint8 or None


def surfaces(scene: Scene) -> list[Surface]:
    """Merge a scene's triangles by material."""
    by_material: dict[str, list[Part]] = {}
    for instance in scene.instances:
        for part in instance.parts:
            by_material.setdefault(part.material, []).append(part)
    low, high = scene.bounds[0], scene.bounds[1]
    camera_box = np.stack([low + np.array([-_AROUND_M, -_AROUND_M, _FLOOR_M]), high + _AROUND_M])
    merged = (_apply_material(_merge(name, by_material[name]), scene.materials[name]) for name in sorted(by_material))
    cut = (_cut(_drop_back_faces(surface, camera_box)) for surface in merged)
    return [surface for surface in cut if len(surface.faces)]


def _merge(material: str, parts: list[Part]) -> Surface:
    if any(p.colours is not None for p in parts):
        return _merge_coloured(material, parts)
    vertices, faces = soup(parts)
    uv = np.concatenate([p.uv for p in parts]).astype(np.float64)
    return Surface(material, vertices, uv, faces.astype(np.int64))


def _merge_coloured(material: str, parts: list[Part]) -> Surface:
    """Merge parts with vertex colours: TinyRenderer interpolates none, so every face gets its mean colour."""
    vertices, faces = soup(parts)
    corner_colours = np.concatenate([p.colours[p.faces] for p in parts if p.colours is not None])
    side = max(1, int(np.ceil(np.sqrt(len(corner_colours)))))
    palette = np.zeros((side * side, 3), dtype=np.uint8)
    palette[: len(corner_colours)] = np.rint(corner_colours.mean(axis=1))
    k = np.arange(len(corner_colours))
    uv = np.stack([(k % side + 0.5) / side, 1.0 - (k // side + 0.5) / side], axis=1)
    corners = vertices[faces].reshape(-1, 3)
    index = np.arange(len(corners)).reshape(-1, 3)
    return Surface(material, corners, np.repeat(uv, 3, axis=0), index, palette.reshape(side, side, 3))


def _apply_material(surface: Surface, material: Material) -> Surface:
    """Apply alpha mask and back faces as geometry: TinyRenderer supports neither."""
    if material.mask is not None:
        surface = _cut_holes(surface, material.mask)
    if material.double_sided:
        surface = replace(surface, faces=np.concatenate([surface.faces, surface.faces[:, ::-1]]))
    return surface


def _cut_holes(surface: Surface, mask: Flags) -> Surface:
    """Drop the masked-out pieces of subdivided triangles."""
    vertices, uv, faces = surface.vertices, surface.uv, surface.faces
    for _ in range(_HALVINGS):
        if 4 * len(faces) > _MAX_CUT:
            break
        n, middles = len(vertices), [(faces[:, k], faces[:, (k + 1) % 3]) for k in range(3)]
        vertices = np.concatenate([vertices, *((vertices[a] + vertices[b]) / 2.0 for a, b in middles)])
        uv = np.concatenate([uv, *((uv[a] + uv[b]) / 2.0 for a, b in middles)])
        ab, bc, ca = (n + k * len(faces) + np.arange(len(faces)) for k in range(3))
        a, b, c = faces.T
        faces = np.concatenate([np.stack(f, axis=1) for f in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    opaque = mask[texel(uv[faces].mean(axis=1), mask.shape[0], mask.shape[1])]
    return Surface(surface.material, vertices, uv, faces[opaque])


def _drop_back_faces(surface: Surface, camera_box: Floats) -> Surface:
    """Drop the triangles that face away from every point of a box, and those without an area."""
    corners = surface.vertices[surface.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # The box's corner farthest along the normal is the one that would see the front.
    farthest = np.where(normal > 0.0, camera_box[1], camera_box[0])
    front = np.einsum("ij,ij->i", normal, farthest - corners[:, 0]) > 0.0
    return replace(surface, faces=surface.faces[front])


def _cut(surface: Surface) -> Surface:
    """Halve the longest edge of every triangle until none is too long, at the same point in both of its triangles."""
    vertices, uv, faces = surface.vertices, surface.uv, surface.faces
    done = []
    while len(faces):
        edges = vertices[np.roll(faces, -1, axis=1)] - vertices[faces]
        length = np.linalg.norm(edges, axis=2)
        long = length.max(axis=1) > _LONGEST_EDGE_M
        done.append(faces[~long])
        faces, longest = faces[long], length[long].argmax(axis=1)
        rows = np.arange(len(faces))
        a, b, c = (faces[rows, (longest + k) % 3] for k in range(3))
        # Both triangles of an edge must round its middle alike: sum the ends in the same order.
        first, second = np.minimum(a, b), np.maximum(a, b)
        middle = len(vertices) + rows
        vertices = np.concatenate([vertices, (vertices[first] + vertices[second]) / 2.0])
        uv = np.concatenate([uv, (uv[first] + uv[second]) / 2.0])
        faces = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return replace(surface, vertices=vertices, uv=uv, faces=np.concatenate([*done, faces]))
