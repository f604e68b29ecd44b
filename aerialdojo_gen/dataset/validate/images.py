"""Checks of the reference images: there, whole, named once, and what is seen from where they say they were taken.

Two machines do not draw the same bytes, and two renderers less so. Pictures are therefore rendered again and compared
as averages of blocks, and not with a limit alone: a picture that is like another object's, or like its own with
channels changed or sides turned, is named as that, however alike the two may be. Between OpenGL and TinyRenderer a
picture's mean difference was 1.0 of 255 at most over five scenes, between two look-alike objects 4.7 at least.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from itertools import permutations
from operator import itemgetter

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.base.pictures import decode_grey, decode_rgb
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Rows, SceneData, UncheckedError, repeated
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.backend import open_renderer
from aerialdojo_gen.rendering.casters import triangle_caster

Picture = NDArray[np.uint8]
Blocks = NDArray[np.float32]

_WHOLE = ("image_missing", "image_damaged")
_POSE = ("reference_x_m", "reference_y_m", "reference_z_m", "reference_yaw_rad")
_BOX = ("box_u0_px", "box_v0_px", "box_u1_px", "box_v1_px")
# Standard deviation of the grey values, of 255, below which a picture is a single surface or none at all.
_BLANK = 2.0
# Rays are cast through every so many pixels: all of them take a tenth of a second a picture.
_EVERY = 4
_SHARE, _EDGE = 0.002, 0.03
# Pixels around an object's box in which parts of it are looked for: the box is right to the step of the rays.
_AROUND = 2 * _EVERY
# Least number of pixels of a recognisable part: 7 x 7 of 320 x 320.
_MIN_PART_SHARE = 0.0005
_SAME_PLACE = 1e-6
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
# Chunks of a PNG that carry words, and could carry where the picture was taken.
_TEXT_CHUNKS = frozenset({"tEXt", "zTXt", "iTXt", "eXIf"})
# Of a PNG up to its colour type.
_HEADER_BYTES = 26
_RGB, _BITS = 2, 8
# Blocks along an edge, of 255 levels: the limits are three times what two renderers differ by.
_BLOCKS = 40
_MEAN, _BLOCK, _BLOCK_SHARE = 3.0, 24.0, 0.04
# What another explanation must be nearer by, as a factor and in levels, to be the better one.
_BETTER, _NEARER = 0.5, 0.05
# On a machine that draws most pictures to the last bit, one in which so many pixels differ so much was touched up.
_PIXEL, _PIXEL_SHARE = 16, 0.0005
_CHANNELS = "RGB"


@check("objects")
def image_missing(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object that tasks ask for has a picture."""
    targets = set(data["routes"].ints("target_object_id").tolist())
    wanted = np.isin(rows.ints("object_id"), [*targets])
    for row in np.flatnonzero(wanted & ~rows.valid("reference_image")):
        yield Finding(int(row), "no reference_image", "a PNG: tasks ask for the object")


@check("objects", after=("image_missing",))
def image_damaged(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture is a whole PNG."""
    for row, raw in enumerate(rows.column("reference_image")):
        png = raw.as_py()
        if png is None:
            continue
        # OpenCV fills in what a cut file lacks: the chunks' own checksums say whether it is whole.
        kinds = _chunks(png)
        if kinds[-1:] != ["IEND"] or decode_grey(png) is None:
            yield Finding(row, f"{len(png):,} bytes that are no whole PNG", "a PNG")
        elif texts := _TEXT_CHUNKS & set(kinds):
            yield Finding(row, f"a PNG with words in it ({', '.join(sorted(texts))})", "pixels alone")


@check("objects", after=_WHOLE)
def image_blank(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture shows something."""
    for row, picture in _decoded(rows):
        if float(picture.std()) < _BLANK:
            yield Finding(row, f"grey values with a deviation of {float(picture.std()):.2f}", f"{_BLANK:g} at least")


@check("objects", after=_WHOLE)
def image_box(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The object's box lies in its picture and is not empty, and its share of the pixels fits into it."""
    boxes, fraction = rows.floats(*_BOX).reshape(-1, 4), rows.floats("image_fraction")
    for row, picture in _decoded(rows):
        if np.isnan(boxes[row]).all():
            continue
        height, width = picture.shape
        u0, v0, u1, v1 = boxes[row].tolist()
        if not (0 <= u0 < u1 <= width and 0 <= v0 < v1 <= height):
            yield Finding(row, f"box ({u0:g}, {v0:g}) to ({u1:g}, {v1:g})", f"within {width} x {height} pixels")
        elif not 0 < fraction[row] <= (u1 - u0) * (v1 - v0) / (width * height) + 1e-9:
            yield Finding(row, f"image_fraction = {fraction[row]:.4g}", "more than 0, no more than the box's share")


@check("objects", after=("image_missing",))
def image_pose(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture is taken from its object's selected anchor, or from behind it with nothing between the two."""
    places = data["anchors"].floats("x_m", "y_m", "z_m", "yaw_rad").reshape(-1, 4)
    rays, most = data.rays, data.pipeline.reference_images.step_back_m
    backs, ids, held = rows.floats("step_back_m"), rows.ints("object_id").tolist(), rows.valid("reference_image")
    for row, pose in enumerate(rows.floats(*_POSE)):
        anchor = data.selected_of_object.get(ids[row])
        if anchor is None or not np.isfinite(places[anchor]).all() or not held[row]:
            continue
        x, y, z, yaw = places[anchor]
        behind = np.array([x - backs[row] * np.cos(yaw), y - backs[row] * np.sin(yaw), z, yaw])
        if not 0.0 <= backs[row] <= most:
            yield Finding(row, f"step_back_m = {backs[row]:.6g}", f"0 to {most:g}")
        elif not np.abs(pose - behind).max() <= _SAME_PLACE:
            found = ", ".join(f"{value:.4f}" for value in pose)
            expected = f"{backs[row]:g} m behind the selected anchor, with its yaw"
            yield Finding(row, f"a camera at ({found})", expected)
        elif backs[row] > 0.0 and not rays.visible(behind[:3], places[anchor, :3])[0]:
            found = f"something between the anchor and the camera {backs[row]:g} m behind it"
            yield Finding(row, found, "free sight")


@check("objects", after=(*_WHOLE, "image_box", "object_node", "image_pose"))
def image_target(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Box and share of pixels are those of the object as rays from the picture's camera find it."""
    rays = data.rays
    index = {node: k for k, node in enumerate(rays.nodes)}
    nodes, boxes, fraction = rows.texts("mesh_node"), rows.floats(*_BOX).reshape(-1, 4), rows.floats("image_fraction")
    for row, place, directions in _cameras(data, rows):
        some = directions[::_EVERY, ::_EVERY]
        seen = rays.first_hit(place, some.reshape(-1, 3))[1] == index[str(nodes[row])]
        v, u = (k * _EVERY for k in np.unravel_index(np.flatnonzero(seen), some.shape[:2]))
        u0, v0, u1, v1 = boxes[row].tolist()
        share = float(seen.mean())
        stored = 0.0 if np.isnan(fraction[row]) else float(fraction[row])
        # A pixel stands for the rays around it: along the object's edge that is a pixel more or less.
        if abs(share - stored) > _SHARE + _EDGE * stored**0.5:
            yield Finding(row, f"image_fraction = {stored:.4f}", f"about {share:.4f}")
        elif len(u) and not (u0 <= u.min() and v0 <= v.min() and u1 > u.max() and v1 > v.max()):
            box = f"({u.min()}, {v.min()}) to ({u.max() + 1}, {v.max() + 1})"
            yield Finding(row, f"box ({u0:g}, {v0:g}) to ({u1:g}, {v1:g})", f"one that holds {box}")


@check("objects", after=(*_WHOLE, "image_box", "image_target", "object_node", "image_pose"))
def image_tells(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture says which of the parts that make its object's name true it does not show."""
    scene = data.mesh
    first = dict(zip(data.rays.nodes, np.cumsum([0, *(len(i.faces) for i in scene.instances)]), strict=False))
    nodes, shown, missing = rows.texts("mesh_node"), rows.floats("tells_shown"), rows.texts("tells_missing")
    triangles, boxes = triangle_caster(scene), rows.floats(*_BOX).reshape(-1, 4)
    for row, place, directions in _cameras(data, rows):
        anatomy = scene[str(nodes[row])].anatomy if nodes[row] in scene else None
        tells = () if anatomy is None else anatomy.identifying_parts
        if bool(tells) == bool(np.isnan(shown[row])):
            yield Finding(row, f"tells_shown = {shown[row]:g}", f"{'a share' if tells else 'null'}")
            continue
        least, near = _MIN_PART_SHARE * directions[..., 0].size, directions
        if np.isfinite(boxes[row]).all():
            u0, v0, u1, v1 = boxes[row].astype(int).tolist()
            near = directions[max(v0 - _AROUND, 0) : v1 + _AROUND, max(u0 - _AROUND, 0) : u1 + _AROUND]
        hit = triangles.first_hit(place, near.reshape(-1, 3))[1] - first[str(nodes[row])]
        counts = {tell: int(np.isin(hit, scene[str(nodes[row])].faces_of(tell)).sum()) for tell in tells}
        stored = [word for word in (missing[row] or "").split(", ") if word]
        wrong = [t for t, n in counts.items() if (t in stored) != (n < least) and abs(n - least) > _EDGE * least + 2]
        if wrong:
            yield Finding(row, f"tells_missing = {missing[row]!r}", f"{wrong[0]} has {counts[wrong[0]]} pixels")
        elif abs(shown[row] - (1.0 - len(stored) / max(len(tells), 1))) > _SHARE and tells:
            yield Finding(row, f"tells_shown = {shown[row]:g}", f"{1.0 - len(stored) / len(tells):g}")
        elif stored:
            found = f"a picture that does not show {missing[row]}"
            yield Finding(row, found, "all that tells what it is", warning=True)


@check("objects")
def image_id_twice(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture's id names one object."""
    ids = rows.texts("reference_image_id")
    for row, first in repeated(ids):
        yield Finding(row, f"reference_image_id = {ids[row]!r}, as {rows.key(first)}", "its own")


def _decoded(rows: Rows) -> Iterator[tuple[int, Picture]]:
    """Judged rows with a picture that can be read, and it in grey."""
    for row, raw in enumerate(rows.column("reference_image")):
        if raw.is_valid and rows.judged[row] and (picture := decode_grey(raw.as_py())) is not None:
            yield row, picture


def _cameras(data: SceneData, rows: Rows) -> Iterator[tuple[int, Floats, Floats]]:
    """Rows of `_decoded` that say where theirs was taken: that place, and the direction of each pixel, (H, W, 3)."""
    poses = rows.floats(*_POSE)
    for row, picture in _decoded(rows):
        if np.isfinite(poses[row]).all():
            camera = Camera(picture.shape[1], picture.shape[0], data.pipeline.reference_images.fov_deg)
            pose = view_pose(poses[row, :3], float(poses[row, 3]), "front")
            yield row, pose[:3, 3], camera.rays() @ pose[:3, :3].T


def _chunks(png: bytes) -> list[str]:
    """Kinds of a PNG's chunks, in their order; none at all where one is cut or has a wrong checksum."""
    kinds: list[str] = []
    at = len(_SIGNATURE)
    while png.startswith(_SIGNATURE) and at < len(png):
        end = at + 12 + int.from_bytes(png[at : at + 4], "big")
        if end > len(png) or zlib.crc32(png[at + 4 : end - 4]) != int.from_bytes(png[end - 4 : end], "big"):
            return []
        kinds.append(png[at + 4 : at + 8].decode("latin-1"))
        at = end
    return kinds


@check("objects", after=_WHOLE)
def image_format(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture is 8-bit RGB of the pipeline's size: no channel beside, in which something might stand."""
    config = data.pipeline.reference_images
    for row, png in enumerate(rows.column("reference_image").to_pylist()):
        if png is None or len(png) < _HEADER_BYTES:  # other checks name it
            continue
        size = int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")
        if (png[24], png[25]) != (_BITS, _RGB):
            yield Finding(row, f"{png[24]} bits, colour type {png[25]}", "8-bit RGB")
        elif size != (config.width, config.height):
            yield Finding(row, f"{size[0]} x {size[1]} pixels", f"{config.width} x {config.height}")


@check("objects", after=(*_WHOLE, "image_blank", "image_format", "image_pose"), samples=True)
def image_redrawn(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture is what its camera sees, as rendered again: no other's, no channel swapped."""
    pictures = rows.column("reference_image")
    decoded = ((row, decode_rgb(pictures[row].as_py())) for row in data.sampled(rows).tolist())
    stored = {row: picture for row, picture in decoded if picture is not None}
    drawn = _drawn(data, rows, stored)
    own = {row: _blocks(stored[row]) for row in drawn}
    anew = {row: _blocks(picture) for row, picture in drawn.items()}
    changed = {row: int((np.abs(stored[row].astype(int) - drawn[row]).max(axis=2) > _PIXEL).sum()) for row in drawn}
    exact = 2 * sum(np.array_equal(stored[row], drawn[row]) for row in drawn) > len(drawn)
    for row in drawn:
        off = _off(own[row], anew[row])
        if explained := _other(row, own[row], off, anew, rows):
            yield Finding(row, explained, "what its camera sees")
            continue
        share = float((np.abs(own[row] - anew[row]).max(axis=2) > _BLOCK).mean())
        if off > _MEAN or share > _BLOCK_SHARE:
            found = f"a picture {off:.1f} of 255 off on average, {share:.1%} of it by more than {_BLOCK:g}"
            yield Finding(row, found, f"less than {_MEAN:g} and {_BLOCK_SHARE:.0%}")
        elif exact and changed[row] > _PIXEL_SHARE * stored[row].shape[0] * stored[row].shape[1]:
            where = "here, where most pictures are the same to the bit"
            yield Finding(row, f"{changed[row]:,} pixels that are drawn otherwise {where}", "the same pixels")


def _drawn(data: SceneData, rows: Rows, stored: dict[int, Picture]) -> dict[int, Picture]:
    """Pictures of these objects from where theirs were taken, by row; without those that do not say where."""
    places, config = rows.floats(*_POSE), data.pipeline.reference_images
    poses = {row: places[row] for row in stored if np.isfinite(places[row]).all()}
    scene = data.mesh
    if not poses:
        return {}
    try:
        with open_renderer(scene, config.renderer) as renderer:
            return {
                row: renderer.render(
                    Camera(stored[row].shape[1], stored[row].shape[0], config.fov_deg),
                    view_pose(pose[:3], float(pose[3]), "front"),
                ).rgb
                for row, pose in poses.items()
            }
    except RenderError as error:
        raise UncheckedError(f"nothing draws here: {error}") from None


def _other(row: int, own: Blocks, off: float, anew: dict[int, Blocks], rows: Rows) -> str:
    """A better explanation of a picture than its own anchor's view; empty if there is none."""
    if off <= _NEARER:
        return ""
    swapped = [[*order] for order in permutations(range(3))][1:]
    others = [(anew[row][..., k], f"a picture with channels {''.join(_CHANNELS[c] for c in k)}") for k in swapped]
    turns = ((np.s_[:, ::-1], "mirrored"), (np.s_[::-1], "upside down"), (np.s_[::-1, ::-1], "turned"))
    others += [(anew[row][turn], f"a picture that is {words}") for turn, words in turns]
    others += [(picture, f"the picture of {rows.key(other)}") for other, picture in anew.items() if other != row]
    best, description = min(((_off(own, other), words) for other, words in others), key=itemgetter(0))
    return description if best < min(_BETTER * off, off - _NEARER) else ""


def _off(a: Blocks, b: Blocks) -> float:
    return float(np.abs(a - b).mean())


def _blocks(picture: Picture) -> Blocks:
    return np.asarray(cv2.resize(picture.astype(np.float32), (_BLOCKS, _BLOCKS), interpolation=cv2.INTER_AREA))
