"""Checks of the reference images: there, whole, showing something, and named once."""

from __future__ import annotations

import zlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.pictures import decode_grey
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Rows, SceneData, repeated
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.casters import triangle_caster

POSE = ("reference_x_m", "reference_y_m", "reference_z_m", "reference_yaw_rad")
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


@check("objects", needs=("routes",))
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


@check("objects", after=("image_missing", "image_damaged"))
def image_blank(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture shows something."""
    for row, picture in _decoded(data, rows, "image_damaged"):
        if float(picture.std()) < _BLANK:
            yield Finding(row, f"grey values with a deviation of {float(picture.std()):.2f}", f"{_BLANK:g} at least")


@check("objects", after=("image_missing", "image_damaged"))
def image_box(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The object's box lies in its picture and is not empty, and its share of the pixels fits into it."""
    boxes, fraction = rows.floats(*_BOX).reshape(-1, 4), rows.floats("image_fraction")
    for row, picture in _decoded(data, rows, "image_damaged"):
        if np.isnan(boxes[row]).all():
            continue
        height, width = picture.shape
        u0, v0, u1, v1 = boxes[row].tolist()
        if not (0 <= u0 < u1 <= width and 0 <= v0 < v1 <= height):
            yield Finding(row, f"box ({u0:g}, {v0:g}) to ({u1:g}, {v1:g})", f"within {width} x {height} pixels")
        elif not 0 < fraction[row] <= (u1 - u0) * (v1 - v0) / (width * height) + 1e-9:
            yield Finding(row, f"image_fraction = {fraction[row]:.4g}", "more than 0, no more than the box's share")


@check("objects", needs=("anchors", "mesh"), after=("image_missing",))
def image_pose(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture is taken from its object's selected anchor, or from behind it with nothing between the two."""
    places = data["anchors"].floats("x_m", "y_m", "z_m", "yaw_rad").reshape(-1, 4)
    rays, most = data.rays, data.pipeline.reference_images.step_back_m
    backs, ids, held = rows.floats("step_back_m"), rows.ints("object_id").tolist(), rows.valid("reference_image")
    for row, pose in enumerate(rows.floats(*POSE)):
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


@check("objects", needs=("mesh",), after=("image_missing", "image_damaged", "image_box", "object_node", "image_pose"))
def image_target(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Box and share of pixels are those of the object as rays from the picture's camera find it."""
    rays = data.rays
    index = {node: k for k, node in enumerate(rays.nodes)}
    nodes, boxes, fraction = rows.texts("mesh_node"), rows.floats(*_BOX).reshape(-1, 4), rows.floats("image_fraction")
    for row, place, directions in _cameras(data, rows, "image_damaged", "image_box", "object_node", "image_pose"):
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


@check("objects", needs=("mesh",), after=("image_missing", "image_damaged", "image_box", "image_target",
                                         "object_node", "image_pose"))  # fmt: skip
def image_tells(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture says which of the parts that make its object's name true it does not show."""
    scene = data.mesh
    first = dict(zip(data.rays.nodes, np.cumsum([0, *(len(i.faces) for i in scene.instances)]), strict=False))
    nodes, shown, missing = rows.texts("mesh_node"), rows.floats("tells_shown"), rows.texts("tells_missing")
    triangles, boxes = triangle_caster(scene), rows.floats(*_BOX).reshape(-1, 4)
    for row, place, directions in _cameras(data, rows, "image_box"):
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


def _decoded(data: SceneData, rows: Rows, *faults: str) -> Iterator[tuple[int, NDArray[np.uint8]]]:
    """Rows with a picture that can be read, and it in grey; without those that have one of these faults."""
    skip = data.flagged("objects", faults)
    for row, raw in enumerate(rows.column("reference_image")):
        if raw.is_valid and not skip[row] and (picture := decode_grey(raw.as_py())) is not None:
            yield row, picture


def _cameras(data: SceneData, rows: Rows, *faults: str) -> Iterator[tuple[int, Floats, Floats]]:
    """Rows of `_decoded` that say where theirs was taken: that place, and the direction of each pixel, (H, W, 3)."""
    poses = rows.floats(*POSE)
    for row, picture in _decoded(data, rows, *faults):
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
