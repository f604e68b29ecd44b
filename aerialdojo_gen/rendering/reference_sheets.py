"""Contact sheets of reference pictures with what is said of their objects, for a person to judge."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.pictures import decode_rgb

Image = NDArray[np.uint8]

PICTURES_A_SHEET = 30
_COLUMNS, _SIZE_PX, _GAP_PX = 6, 240, 8
_LINE_PX, _CHARACTERS, _LINES = 13, 46, 8
_INK, _WARNING = (30, 30, 30), (190, 30, 20)


def reference_sheets(rows: Sequence[Mapping[str, Any]]) -> Iterator[Image]:
    """Lay objects out on sheets, (H, W, 3) uint8 sRGB: picture, number, name and description of each."""
    for first in range(0, len(rows), PICTURES_A_SHEET):
        page = rows[first : first + PICTURES_A_SHEET]
        height = _SIZE_PX + _LINES * _LINE_PX + _GAP_PX
        width = _SIZE_PX + _GAP_PX
        sheet = np.full((-(-len(page) // _COLUMNS) * height, _COLUMNS * width, 3), 255, np.uint8)
        for k, row in enumerate(page):
            top, left = k // _COLUMNS * height, k % _COLUMNS * width
            _put(sheet[top : top + height, left : left + width], row)
        yield sheet


def _put(cell: Image, row: Mapping[str, Any]) -> None:
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
