"""Contact sheets: what every prop and every scene looks like, for a person to judge."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.pictures import GALLERY_JPEG, SMALLEST_PNG, encode_jpeg, encode_png
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.rendering.preview import contact_sheet, look_at
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.mesh import to_part
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.scenes.shapes_extruded import extrude
from aerialdojo_gen.store.atomic import atomic_file

Image = NDArray[np.uint8]
_FLYING_HEIGHT_M = 3.0


def prop_picture(catalogue: Catalogue, category: str, size_px: int = 240, variant: str | None = None) -> Image:
    """Picture a prop from before it and above, (size_px, size_px, 3) uint8 sRGB."""
    names = [v.name for v in catalogue[category].variants]
    chosen = variant if variant is not None else (names[0] if names else None)
    prop = catalogue.instantiate(category, "prop", generator(0, "gallery", category), variant=chosen)
    low, high = prop.bounds
    reach = float(np.linalg.norm(high - low)) / 2
    floor = to_part(extrude(rectangle(-6 * reach, -6 * reach, 6 * reach, 6 * reach), 0.02), "paving", 1.2)
    down = np.array([0, 0, min(float(low[2]), 0.0) - 0.02])
    ground = Instance(
        "ground", "ground", "", {}, (type(floor)(floor.vertices + down, floor.faces, floor.uv, "paving"),)
    )
    materials = {name: catalogue.materials[name] for name in {p.material for p in (*prop.parts, *ground.parts)}}
    bounds = np.array([[-8 * reach] * 3, [8 * reach] * 3])
    scene = Scene(category, (ground, prop), materials, bounds)
    centre = (low + high) / 2
    eye = centre + 2.35 * reach * np.array([0.72, -0.55, 0.42]) / math.sqrt(0.72**2 + 0.55**2 + 0.42**2)
    return look_at(scene, eye, centre, size_px, size_px, 55)


def props_sheet(
    catalogue: Catalogue, names: Sequence[str] | None = None, size_px: int = 200, columns: int = 16
) -> Image:
    """Picture categories under their names, alphabetically; (H, W, 3) uint8 sRGB."""
    names = sorted(catalogue.targets if names is None else names)
    return contact_sheet(
        [prop_picture(catalogue, name, size_px) for name in names], [catalogue[n].name for n in names], columns
    )


def scene_sheet(scene: Scene, width: int = 640, height: int = 440) -> Image:
    """Picture a scene from above, from four sides and twice at flying height; (H, W, 3) uint8 sRGB."""
    low, high = scene.bounds
    centre = np.array([*(low[:2] + high[:2]) / 2, low[2]])
    span = high - low
    reach = float(max(span[0], span[1]))
    fov = 60.0
    half = math.tan(math.radians(fov / 2))
    up = 1.08 * max(span[0] / 2, span[1] / 2 * width / height) / half
    # A breath to the south, so that north is up in the picture.
    above = centre + np.array([0, -1e-3 * up, up])
    views = [(above, centre, fov, "from above")]
    for name, (dx, dy) in {
        "south-west": (-1, -1),
        "south-east": (1, -1),
        "north-east": (1, 1),
        "north-west": (-1, 1),
    }.items():
        eye = centre + np.array([dx * 0.48 * span[0], dy * 0.48 * span[1], 0.38 * reach])
        views.append((eye, centre - [dx * 0.04 * reach, dy * 0.04 * reach, 0], fov, f"from the {name}"))
    for k, (eye, target) in enumerate(_flying_views(scene)):
        views.append((eye, target, 80.0, f"flying, {k + 1}"))
    images = [look_at(scene, eye, target, width, height, angle) for eye, target, angle, _ in views]
    return contact_sheet(images, [f"{scene.name}, {label}" for *_, label in views], 3)


def _flying_views(scene: Scene) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Two views among the objects, one from each half of the scene: low places from which one sees far."""
    low, high = scene.bounds
    caster = RayCaster(scene)
    n = 9
    fractions = (np.arange(n) + 0.5) / n
    places = np.stack(np.meshgrid(*(low[:2, None] + (high - low)[:2, None] * fractions), indexing="ij"), -1).reshape(
        -1, 2
    )
    down = np.tile([0.0, 0.0, -1.0], (len(places), 1))
    drop, _ = caster.first_hit(np.column_stack([places, np.full(len(places), high[2])]), down)
    eyes = np.column_stack([places, high[2] - drop + _FLYING_HEIGHT_M])
    centre = (low[:2] + high[:2]) / 2
    flat = centre - places
    angle = np.arctan2(flat[:, 1], flat[:, 0])[:, None] + np.radians([-25, -12, 0, 12, 25])
    rays = np.stack([np.cos(angle), np.sin(angle), np.full(angle.shape, -0.05)], -1)
    seen, _ = caster.first_hit(np.repeat(eyes, 5, axis=0), rays.reshape(-1, 3) / np.linalg.norm(rays[0, 0]))
    reach = float(np.linalg.norm((high - low)[:2]))
    # Something at a middle distance in every direction is a better picture than an open field or a wall.
    seen = np.minimum(np.where(np.isfinite(seen), seen, 0.3 * reach), 0.5 * reach).reshape(-1, 5)
    score = np.minimum(seen, 0.25 * reach).mean(axis=1) + 2.0 * np.minimum(seen.min(axis=1), 4.0) - 2.0 * eyes[:, 2]
    score[~np.isfinite(score)] = -np.inf
    views = []
    for half in (places[:, 1] < centre[1], places[:, 1] >= centre[1]):
        k = int(np.argmax(np.where(half, score, -np.inf)))
        views.append((eyes[k], np.array([*centre, eyes[k, 2] - 2.0])))
    return views


def write_picture(image: Image, folder: Path, name: str, max_width: int | None = None) -> Path:
    """Write (H, W, 3) uint8 sRGB as PNG or JPEG, whole or not at all; returns its path."""
    if max_width is not None and image.shape[1] > max_width:
        height = round(image.shape[0] * max_width / image.shape[1])
        image = np.asarray(cv2.resize(image, (max_width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    as_png = Path(name).suffix == ".png"
    data = encode_png(image, SMALLEST_PNG) if as_png else encode_jpeg(image, GALLERY_JPEG)
    with atomic_file(folder, name) as path:
        path.write_bytes(data)
    return folder / name
