"""The reference images rendered again: each is what is seen from where it says it was taken, and no other's.

Two machines do not draw the same bytes, and two renderers less so. Pictures are therefore compared as averages of
blocks, and not with a limit alone: a picture that is like another object's, or like its own with channels
changed or sides turned, is named as that, however alike the two may be. Between OpenGL and TinyRenderer a picture's
mean difference was 1.0 of 255 at most over five scenes, between two look-alike objects 4.7 at least.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations
from operator import itemgetter

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.base.pictures import decode_rgb
from aerialdojo_gen.dataset.validate.images import POSE
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Rows, SceneData, UncheckedError
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.backend import open_renderer

Picture = NDArray[np.uint8]
Blocks = NDArray[np.float32]

_RGB, _BITS = 2, 8
# Blocks along an edge, of 255 levels: the limits are three times what two renderers differ by.
_BLOCKS = 40
_MEAN, _BLOCK, _BLOCK_SHARE = 3.0, 24.0, 0.04
# What another explanation must be nearer by, as a factor and in levels, to be the better one.
_BETTER, _NEARER = 0.5, 0.05
# On a machine that draws most pictures to the last bit, one in which so many pixels differ so much was touched up.
_PIXEL, _PIXEL_SHARE = 16, 0.0005
_CHANNELS = "RGB"
# Of a PNG up to its colour type.
_HEADER_BYTES = 26


@check("objects", after=("image_missing", "image_damaged"))
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


@check(
    "objects", needs=("mesh",),
    after=("image_missing", "image_damaged", "image_blank", "image_format", "image_pose"), samples=True,
)  # fmt: skip
def image_redrawn(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A picture is what its camera sees, as rendered again: no other's, no channel swapped."""
    skip = data.flagged("objects", ("image_missing", "image_damaged", "image_blank", "image_format", "image_pose"))
    sampled = [row for row in data.sampled_objects.tolist() if not skip[row]]
    decoded = {row: decode_rgb(rows.column("reference_image")[row].as_py()) for row in sampled}
    stored = {row: picture for row, picture in decoded.items() if picture is not None}
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
    places, config = rows.floats(*POSE), data.pipeline.reference_images
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
