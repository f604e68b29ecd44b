"""Contact sheets of props, scenes, reference pictures and the kit's builders, for human review."""

from __future__ import annotations

import copy
import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.pictures import GALLERY_JPEG, SMALLEST_PNG, decode_rgb, encode_jpeg, encode_png
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.geometry.arrays import Bytes, Floats
from aerialdojo_gen.geometry.cameras import Camera, look_at_pose
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.rendering.backend import scene_renderer
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import kit
from aerialdojo_gen.scenes.mesh import to_part
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.scenes.plans.build import build_tables
from aerialdojo_gen.scenes.shapes import extrude
from aerialdojo_gen.store.atomic import atomic_write

Image = NDArray[np.uint8]


def look_at(
    scene: Scene, eye: ArrayLike, target: ArrayLike, width: int = 640, height: int = 480, fov_deg: float = 60.0
) -> Bytes:
    """Take a picture of a scene from `eye` to `target`, world metres; (height, width, 3) uint8 sRGB."""
    camera = Camera(width, height, fov_deg)
    return scene_renderer(scene, "auto").render(camera, look_at_pose(eye, target)).rgb


def contact_sheet(images: Sequence[Bytes], labels: Sequence[str] = (), columns: int = 4) -> Bytes:
    """Put pictures, (H, W, 3) uint8, side by side under their labels."""
    if not images or (labels and len(labels) != len(images)):
        raise ValueError(f"a sheet of {len(images)} pictures with {len(labels)} labels")
    height, width = max(i.shape[0] for i in images), max(i.shape[1] for i in images)
    head = 20 if labels else 0
    columns = min(columns, len(images))
    rows = -(-len(images) // columns)
    sheet = np.full((rows * (height + head + 4) + 4, columns * (width + 4) + 4, 3), 255, dtype=np.uint8)
    for k, image in enumerate(images):
        top, left = 4 + k // columns * (height + head + 4), 4 + k % columns * (width + 4)
        if labels:
            cell = np.full((head, width, 3), 255, dtype=np.uint8)
            cv2.putText(cell, labels[k], (3, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (30, 30, 30), 1, cv2.LINE_AA)
            sheet[top : top + head, left : left + width] = cell
        sheet[top + head : top + head + image.shape[0], left : left + image.shape[1]] = image
    return sheet


_FLYING_HEIGHT_M = 3.0


def prop_picture(
    catalogue: Catalogue, category: str, size_px: int = 240, variant: str = "", design: str = ""
) -> Image:
    """Picture a prop from before it and above, (size_px, size_px, 3) uint8 sRGB."""
    first = catalogue[category].variants[0].name, catalogue[category].designs[0].name
    prop = catalogue.instantiate(
        category, "prop", generator(0, "gallery", category), variant=variant or first[0], design=design or first[1]
    )
    low, high = prop.bounds
    reach = float(np.linalg.norm(high - low)) / 2
    floor = to_part(extrude(rectangle(-6 * reach, -6 * reach, 6 * reach, 6 * reach), 0.02), "paving", 1.2)
    down = np.array([0, 0, min(float(low[2]), 0.0) - 0.02])
    ground = Instance("ground", "ground", "", {}, (replace(floor, vertices=floor.vertices + down),))
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


def designs_sheet(catalogue: Catalogue, categories: Sequence[str], size_px: int) -> Image:
    """Picture the designs of categories, a row each, those that are held out with a star; (H, W, 3) uint8 sRGB."""
    columns = max(len(catalogue[name].designs) for name in categories)
    images, labels = [], []
    for name in categories:
        variants, designs = catalogue[name].variants, catalogue[name].designs
        for k, one in enumerate(designs):
            images.append(prop_picture(catalogue, name, size_px, variants[k % len(variants)].name, one.name))
            labels.append("*" * one.held_out + (one.name.replace("_", " ") if k else catalogue[name].name))
        gap = columns - len(designs)
        images += [np.full((size_px, size_px, 3), 255, np.uint8)] * gap
        labels += [""] * gap
    return contact_sheet(images, labels, columns)


def scene_sheet(scene: Scene, width: int = 640, height: int = 440) -> Image:
    """Picture a scene from above, from four sides and twice at flying height; (H, W, 3) uint8 sRGB."""
    images, labels = zip(*_scene_pictures(scene, width, height), strict=True)
    return contact_sheet(images, labels, 3)


def scenes_sheet(scenes: Iterable[Scene], width: int = 320, height: int = 220) -> Image:
    """Picture scenes from above, from the south-west and at flying height; (H, W, 3) uint8 sRGB."""
    pictures = (one for scene in scenes for one in _scene_pictures(scene, width, height, (0, 1, 5)))
    images, labels = zip(*pictures, strict=True)
    return contact_sheet(images, labels, 6)


def _scene_pictures(
    scene: Scene, width: int, height: int, chosen: Sequence[int] = range(7)
) -> list[tuple[Image, str]]:
    """Take those of a scene's seven pictures that are chosen, each with its label."""
    low, high = scene.bounds
    centre = np.array([*(low[:2] + high[:2]) / 2, low[2]])
    span = high - low
    reach = float(max(span[0], span[1]))
    fov = 60.0
    half = math.tan(math.radians(fov / 2))
    up = 1.08 * max(span[0] / 2, span[1] / 2 * width / height) / half
    # Slightly to the south, so that north is up in the picture.
    above = centre + np.array([0, -1e-3 * up, up])
    views = [(above, centre, fov, "from above")]
    corners = {"south-west": (-1, -1), "south-east": (1, -1), "north-east": (1, 1), "north-west": (-1, 1)}
    for name, (dx, dy) in corners.items():
        eye = centre + np.array([dx * 0.48 * span[0], dy * 0.48 * span[1], 0.38 * reach])
        views.append((eye, centre - [dx * 0.04 * reach, dy * 0.04 * reach, 0], fov, f"from the {name}"))
    views += [(eye, target, 80.0, f"flying, {k + 1}") for k, (eye, target) in enumerate(_flying_views(scene))]
    return [
        (look_at(scene, eye, target, width, height, angle), f"{scene.name}, {label}")
        for eye, target, angle, label in (views[k] for k in chosen)
    ]


def _flying_views(scene: Scene) -> list[tuple[Floats, Floats]]:
    """Two views among the objects, one from each half of the scene: low places with a long line of sight."""
    low, high = scene.bounds
    caster = RayCaster(scene)
    n = 9
    fractions = (np.arange(n) + 0.5) / n
    x, y = np.meshgrid(*(low[:2, None] + (high - low)[:2, None] * fractions), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
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
    atomic_write(folder, name, data)
    return folder / name


PICTURES_A_SHEET = 30
_COLUMNS, _SIZE_PX, _GAP_PX = 6, 240, 8
_LINE_PX, _CHARACTERS, _LINES = 13, 46, 8
_INK, _WARNING = (30, 30, 30), (190, 30, 20)


def reference_sheets(rows: Sequence[Mapping[str, Any]]) -> Iterator[Image]:
    """Yield contact sheets, (H, W, 3) uint8 sRGB, of objects' reference pictures, ids, names and descriptions."""
    for first in range(0, len(rows), PICTURES_A_SHEET):
        page = rows[first : first + PICTURES_A_SHEET]
        height = _SIZE_PX + _LINES * _LINE_PX + _GAP_PX
        width = _SIZE_PX + _GAP_PX
        sheet = np.full((-(-len(page) // _COLUMNS) * height, _COLUMNS * width, 3), 255, np.uint8)
        for k, row in enumerate(page):
            top, left = k // _COLUMNS * height, k % _COLUMNS * width
            _write_cell(sheet[top : top + height, left : left + width], row)
        yield sheet


def _write_cell(cell: Image, row: Mapping[str, Any]) -> None:
    picture = decode_rgb(row["reference_image"]) if row["reference_image"] else None
    if picture is not None:
        cell[:_SIZE_PX, :_SIZE_PX] = cv2.resize(picture, (_SIZE_PX, _SIZE_PX), interpolation=cv2.INTER_AREA)
    lines = [(f"{row['object_id']} {row['name']}", _INK)]
    if row.get("tells_missing"):
        lines.append((f"not shown: {row['tells_missing']}", _WARNING))
    # OpenCV's letters are ASCII.
    plain = row["description"].translate(str.maketrans("“”’é–", '""\'e-'))
    lines += [(line, (110, 110, 110)) for line in textwrap.wrap(plain, _CHARACTERS)]
    for n, (line, ink) in enumerate(lines[:_LINES]):
        at = (2, _SIZE_PX + (n + 1) * _LINE_PX - 2)
        cv2.putText(cell, line, at, cv2.FONT_HERSHEY_SIMPLEX, 0.34, ink, 1, cv2.LINE_AA)


_KIT_SETTINGS = 3
_KIT_WIDTH, _KIT_HEIGHT = 272, 204
# By these a number of a builder's first use is varied.
_SCALES = (1.5, 0.6)
# Numbers that show best what a builder can do come first.
_FIRST = ("storeys", "bays", "rows", "count", "height_m", "rise_m", "width_m", "radius_m", "depth_m", "spread_m")


@dataclass(frozen=True)
class Use:
    """A table of a plan that calls a builder."""

    plan: str
    tables: Any  # The plan with this one entry, and what it needs
    entry: str  # Its name there, as `build_tables` has it; empty for a step of the ground
    path: tuple[str | int, ...]  # From there to the table

    @property
    def call(self) -> dict[str, Any]:
        """The builder's table."""
        return dict(reduce(getitem, self.path, self.tables))

    def varied(self, key: str, value: Any) -> Use:
        """Change one argument."""
        tables = copy.deepcopy(self.tables)
        reduce(getitem, self.path, tables)[key] = value
        return replace(self, tables=tables)


def kit_sheets(catalogue: Catalogue, plans: Sequence[Path]) -> Iterator[tuple[str, Image]]:
    """Yield a sheet a module of the kit, named as ``kit-houses``, its builders below each other as plans use them."""
    uses = uses_of(plans)
    modules: dict[str, list[str]] = {}
    for name, one in kit().items():
        modules.setdefault(one.function.__module__.rpartition(".")[2], []).append(name)
    for module, names in sorted(modules.items()):
        pictures, labels = [], []
        for name in names:
            shown = list(_pictures(name, uses.get(name, []), catalogue))
            shown += [(np.full((_KIT_HEIGHT, _KIT_WIDTH, 3), 240, np.uint8), "")] * (_KIT_SETTINGS - len(shown))
            pictures += [picture for picture, _ in shown]
            labels += [label for _, label in shown]
        yield f"kit-{module.replace('_', '-')}", contact_sheet(pictures, labels, _KIT_SETTINGS)


def uses_of(plans: Sequence[Path]) -> dict[str, list[Use]]:
    """Find the calls of each builder in plans, one of every plan first."""
    found: dict[str, list[Use]] = {}
    for path in plans:
        whole = read_toml(path, AssetError)
        head = {key: value for key, value in whole.items() if key not in ("site", "inventory", "moves", "level")}
        for number, step in enumerate(whole.get("ground", {}).get("steps", ())):
            found.setdefault(step["make"], []).append(Use(path.stem, head, "", ("ground", "steps", number)))
        named: list[dict[str, Any]] = []
        for entry in [one for some in whole.get("site", ()) for one in some.get("entries", [some])]:
            tables = {**head, "site": [*named, entry]}
            for inner in _calls(entry):
                use = Use(path.stem, tables, f"site[{len(named)}]", ("site", len(named), *inner))
                found.setdefault(use.call["make"], []).append(use)
            named += [entry] if "as" in entry else []
    return {name: sorted(some, key=lambda use: _rank(use, some)) for name, some in found.items()}


def _rank(use: Use, some: Sequence[Use]) -> int:
    """Number a use among those of its plan."""
    return [other for other in some if other.plan == use.plan].index(use)


def _calls(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if isinstance(value, dict):
        if "make" in value:
            yield path
        for key, inner in value.items():
            yield from _calls(inner, (*path, key))
    elif isinstance(value, list):
        for key, inner in enumerate(value):
            yield from _calls(inner, (*path, key))


def _pictures(name: str, uses: Sequence[Use], catalogue: Catalogue) -> Iterator[tuple[Image, str]]:
    shown: list[Image] = []
    for use, label in settings_of(name, uses):
        picture = _picture_of(use, catalogue)
        # What cannot be seen of an argument, such as room that it keeps, is no setting.
        if picture is not None and not any(np.array_equal(picture, other) for other in shown):
            yield picture, label
            shown.append(picture)
        if len(shown) == _KIT_SETTINGS:
            return


def settings_of(name: str, uses: Sequence[Use]) -> Iterator[tuple[Use, str]]:
    """Yield uses with different arguments, then variations of the first."""
    seen: list[dict[str, Any]] = []
    for use in uses:
        call = use.call
        if call not in seen:
            seen.append(call)
            yield use, f"{name}, {use.plan}"
    if not uses:
        return
    call = uses[0].call
    defaults = {key: field.default for key, field in kit()[name].arguments.model_fields.items()}
    for key in sorted(defaults, key=lambda key: (_FIRST.index(key) if key in _FIRST else len(_FIRST), key)):
        for scale in _SCALES:
            value = _scaled(call.get(key, defaults[key]), scale)
            if value is not None:
                yield uses[0].varied(key, value), f"{name}, {key} = {value}"


def _scaled(value: Any, scale: float) -> Any:
    """Scale a number, or the numbers of a short list; None of anything else."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return max(round(value * scale), 1)
    if isinstance(value, float):
        return round(value * scale, 3)
    if isinstance(value, list | tuple) and 0 < len(value) <= 3:
        found = [_scaled(one, scale) for one in value]
        return None if any(isinstance(one, bool) or one is None for one in found) else found
    return None


def _picture_of(use: Use, catalogue: Catalogue) -> Image | None:
    """Build a use by itself; None where it cannot stand alone."""
    entries: dict[str, str] = {}
    try:
        scene = build_tables(use.plan, use.tables, catalogue, entries)
    except AssetError:
        return None
    made = {node for node, entry in entries.items() if entry == use.entry}
    bounds = [instance.bounds for instance in scene.instances if instance.node in made]
    if bounds:
        return _view(scene, np.array(bounds), 0.48)
    # Paint, or the ground itself: all of it, from higher up.
    return _view(scene, scene.instances[0].bounds[None], 0.9)


def _view(scene: Scene, bounds: Any, up: float) -> Image:
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    reach = max(float(np.linalg.norm(high - low)) / 2, 1.5)
    eye = (low + high) / 2 + 1.8 * reach * np.array([-0.62, -0.62, up])
    return look_at(scene, eye, (low + high) / 2, _KIT_WIDTH, _KIT_HEIGHT)
