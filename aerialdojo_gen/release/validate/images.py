"""Checks of the reference images: there, whole, showing something, and named once."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.release.validate.registry import Finding, check
from aerialdojo_gen.release.validate.rows import Rows, SceneData

_BOX = ("box_u0_px", "box_v0_px", "box_u1_px", "box_v1_px")
# Standard deviation of the grey values, of 255, below which a picture is a single surface or none at all.
_BLANK = 2.0
# Chunks of a PNG that carry words, and could carry where the picture was taken.
_TELLING = frozenset({"tEXt", "zTXt", "iTXt", "eXIf"})


@check("objects", needs=("routes",))
def image_missing(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An object that tasks ask for has a picture."""
    asked = set(data["routes"].ints("target_object_id").tolist())
    held = rows.column("reference_image").is_valid().to_numpy(zero_copy_only=False)
    for row, object_id in enumerate(rows.ints("object_id").tolist()):
        if object_id in asked and not held[row]:
            yield Finding(row, "no reference_image", "a PNG: tasks ask for the object")


@check("objects", after=("image_missing",))
def image_damaged(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture is a whole PNG."""
    for row, raw in enumerate(rows.column("reference_image")):
        png = raw.as_py()
        if png is None:
            continue
        # OpenCV fills in what a cut file lacks: the end chunk says whether it is whole.
        whole = png.startswith(b"\x89PNG\r\n\x1a\n") and b"IEND" in png[-12:]
        if not whole or _decoded(png) is None:
            yield Finding(row, f"{len(png):,} bytes that are no whole PNG", "a PNG")
        elif told := _TELLING & set(_chunks(png)):
            yield Finding(row, f"a PNG with words in it ({', '.join(sorted(told))})", "pixels alone")


@check("objects", after=("image_missing", "image_damaged"))
def image_blank(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture shows something."""
    damaged = data.flagged("objects", ("image_damaged",))
    for row, raw in enumerate(rows.column("reference_image")):
        if raw.as_py() is None or damaged[row]:
            continue
        picture = _decoded(raw.as_py())
        if picture is not None and float(picture.std()) < _BLANK:
            yield Finding(row, f"grey values with a deviation of {float(picture.std()):.2f}", f"{_BLANK:g} at least")


@check("objects", after=("image_missing", "image_damaged"))
def image_box(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """The object's box lies in its picture and is not empty, and its share of the pixels fits into it."""
    damaged = data.flagged("objects", ("image_damaged",))
    boxes, fraction = rows.floats(*_BOX).reshape(-1, 4), rows.floats("image_fraction")
    for row, raw in enumerate(rows.column("reference_image")):
        if raw.as_py() is None or damaged[row] or np.isnan(boxes[row]).all():
            continue
        picture = _decoded(raw.as_py())
        if picture is None:
            continue
        height, width = picture.shape
        u0, v0, u1, v1 = boxes[row].tolist()
        if not (0 <= u0 < u1 <= width and 0 <= v0 < v1 <= height):
            yield Finding(row, f"box ({u0:g}, {v0:g}) to ({u1:g}, {v1:g})", f"within {width} x {height} pixels")
        elif not 0 < fraction[row] <= (u1 - u0) * (v1 - v0) / (width * height) + 1e-9:
            yield Finding(row, f"image_fraction = {fraction[row]:.4g}", "more than 0, no more than the box's share")


@check("objects")
def image_id_twice(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture's id names one object."""
    first: dict[str | None, int] = {}
    for row, image_id in enumerate(rows.texts("reference_image_id")):
        if first.setdefault(image_id, row) != row:
            yield Finding(row, f"reference_image_id = {image_id!r}, as {rows.key(first[image_id])}", "its own")


def _chunks(png: bytes) -> Iterator[str]:
    """Kinds of a PNG's chunks, in their order."""
    at = 8
    while at + 8 <= len(png):
        yield png[at + 4 : at + 8].decode("latin-1")
        at += 12 + int.from_bytes(png[at : at + 4], "big")


def _decoded(png: bytes) -> NDArray[np.uint8] | None:
    """Grey values of a PNG, (H, W); None where it cannot be decoded."""
    return cv2.imdecode(np.frombuffer(png, dtype=np.uint8), cv2.IMREAD_GRAYSCALE)
