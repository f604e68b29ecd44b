"""Grammar of layouts: detached and terraced houses.

A house is built in a frame of its own: the origin is the middle of its plan, +u looks out of its front door, v runs
to the left of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerialdojo_gen.scenes.grammar_buildings import pitched_roof
from aerialdojo_gen.scenes.grammar_frames import Frame, Parts, block
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.mesh import merge, rotated, rotation, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.plans.values import Material
from aerialdojo_gen.scenes.shapes import box
from aerialdojo_gen.scenes.shapes_extruded import prism
from aerialdojo_gen.scenes.site import Site


@dataclass(frozen=True)
class HouseStyle:
    """What a house looks like."""

    width_m: float = 9.0  # Of its plan, across the front and from front to back
    depth_m: float = 8.0
    storeys: int = 2  # Number and height of its storeys
    storey_m: float = 2.8
    wall: Material = "planks:#d8d2c2"
    roof: Material = "shingles"  # Materials
    trim: Material = "#f2efe6"
    door: Material = "#8a2f2a"
    roof_kind: str = "gable"  # ``"gable"`` or ``"hip"``, and the ridge's height over the eaves
    roof_m: float = 2.6
    porch_m: float = 0.0  # Depth of a roofed porch on posts along the front; 0 for a hood over the door
    garage: int = 0  # -1 or 1: a garage on the right or the left of the front; 0 for none
    chimney: bool = True  # Whether there is one
    overhang_m: float = 0.45  # How far the eaves reach out; 0 where houses stand wall to wall


FLOOR_M = 0.4
_GARAGE_M = (3.6, 6.0, 2.9)


def house(
    site: Site, frame: Frame, style: HouseStyle, attributes: dict[str, str] | None = None, *, z: float | None = None
) -> Instance:
    """Put up a house with windows, door, steps and pitched roof in a style; u of the frame looks out of the front."""
    d, w, top = style.depth_m / 2, style.width_m / 2, FLOOR_M + style.storeys * style.storey_m
    parts: Parts = [
        ("stone", block(-d - 0.06, -w - 0.06, d + 0.06, w + 0.06, -0.1, FLOOR_M)),
        (style.wall, block(-d, -w, d, w, FLOOR_M, top)),
        *pitched_roof(rectangle(-d, -w, d, w), top, style.roof_m, style.wall, style.roof,
                      hip=style.roof_kind == "hip", overhang_m=style.overhang_m),
    ]  # fmt: skip
    parts += _fenestration(style)
    plan = rectangle(-d, -w, d, w)
    parts += _porch(style) if style.porch_m else _hood(style)
    if style.porch_m:
        plan = plan.union(rectangle(d, -w, d + style.porch_m, w))
    if style.garage:
        parts += _garage(style)
        side = style.garage
        low, high = sorted((side * w, side * (w + _GARAGE_M[0])))
        plan = plan.union(rectangle(d - _GARAGE_M[1], low, d, high))
    if style.chimney:
        at = (-0.25 * d, 0.55 * w)
        peak = top + style.roof_m + 0.7
        parts.append(("brick:#7f4a3c", block(at[0] - 0.4, at[1] - 0.45, at[0] + 0.4, at[1] + 0.45, top - 0.2, peak)))
        parts.append(("concrete", block(at[0] - 0.5, at[1] - 0.55, at[0] + 0.5, at[1] + 0.55, peak, peak + 0.15)))
    base = site.ground_z(frame.x, frame.y) if z is None else z
    world = frame.parts(parts, base)
    return site.add(None, "house", world, attributes, footprint=frame.area(plan))


def window_parts(width_m: float, height_m: float, trim: str, pane: str = "window") -> Parts:
    """Make a window in the u = 0 plane that looks along +u, its sill's middle at the origin: frame, pane, bars."""
    w, h = width_m, height_m
    frame = translated(box(size=(0.08, w + 0.24, h + 0.24)), (0.03, 0, -0.12))
    sill = translated(box(size=(0.22, w + 0.36, 0.09)), (0.08, 0, -0.18))
    bars = [
        translated(box(size=(0.04, 0.07, h)), (0.1, 0, 0)),
        translated(box(size=(0.04, w, 0.07)), (0.1, 0, h * 0.55)),
    ]
    return [(trim, merge([frame, sill, *bars])), (pane, translated(box(size=(0.06, w, h)), (0.06, 0, 0)))]


def _fenestration(style: HouseStyle) -> Parts:
    d, w = style.depth_m / 2, style.width_m / 2
    parts: Parts = []
    for yaw, half, out in ((0.0, w, d), (180.0, w, d), (90.0, d, w), (-90.0, d, w)):
        # Windows stand symmetrically, whatever the length; the door takes the middle of the front.
        count = max(int((2 * half - 1.2) // 2.3), 1)
        if yaw == 0.0 and count % 2 == 0:
            count -= 1
        hidden = style.garage and yaw == 90.0 * style.garage
        for storey in range(style.storeys):
            for k in range(count):
                v = (k - (count - 1) / 2) * (2 * half - 1.2) / count
                if storey == 0 and ((yaw == 0.0 and abs(v) < 0.9) or hidden):
                    continue
                z = FLOOR_M + storey * style.storey_m + 0.85
                opening = window_parts(1.15, 1.35, style.trim)
                parts += [(m, rotated(translated(b, (out, v, z)), rotation(0.0, 0.0, yaw))) for m, b in opening]
    parts.append((style.trim, block(d - 0.02, -0.68, d + 0.08, 0.68, FLOOR_M, FLOOR_M + 2.25)))
    parts.append((style.door, block(d, -0.5, d + 0.12, 0.5, FLOOR_M, FLOOR_M + 2.1)))
    parts.append(("brass", block(d + 0.1, 0.32, d + 0.18, 0.4, FLOOR_M + 1.0, FLOOR_M + 1.08)))
    return parts


def _porch(style: HouseStyle) -> Parts:
    d, w, p = style.depth_m / 2, style.width_m / 2, style.porch_m
    head = FLOOR_M + 2.5
    slope = translated(
        rotated(prism(size=(style.width_m, p + 0.4, 0.55), section="wedge"), rotation(0, 0, 90)),
        (d + p / 2 + 0.2, 0, head),
    )
    posts = [
        block(d + p - 0.2, v - 0.08, d + p - 0.04, v + 0.08, FLOOR_M, head)
        for v in np.linspace(-w + 0.12, w - 0.12, 4)
    ]
    rails = [
        block(d + p - 0.16, a, d + p - 0.08, b, FLOOR_M + 0.75, FLOOR_M + 0.85)
        for a, b in ((-w + 0.2, -w / 3 - 0.05), (w / 3 + 0.05, w - 0.2))
    ]
    return [
        ("boards:#a08a6a", block(d, -w, d + p, w, 0.0, FLOOR_M)),
        ("concrete", block(d + p, -0.9, d + p + 0.4, 0.9, 0.0, FLOOR_M / 2)),
        (style.roof, slope),
        (style.trim, merge([*posts, *rails])),
    ]


def _hood(style: HouseStyle) -> Parts:
    d = style.depth_m / 2
    hood = rotated(prism(size=(2.0, 1.2, 0.45), section="wedge"), rotation(0, 0, 90))
    return [
        ("concrete", block(d, -0.9, d + 1.1, 0.9, 0.0, FLOOR_M)),
        ("concrete", block(d + 1.1, -0.9, d + 1.45, 0.9, 0.0, FLOOR_M / 2)),
        (style.roof, translated(hood, (d + 0.6, 0, FLOOR_M + 2.4))),
    ]


def _garage(style: HouseStyle) -> Parts:
    d, w, side = style.depth_m / 2, style.width_m / 2, style.garage
    wide, deep, high = _GARAGE_M
    a, b = sorted((side * w, side * (w + wide)))
    middle = (a + b) / 2
    ribs = [block(d, middle - 1.35, d + 0.1, middle + 1.35, 0.1 + k * 0.55, 0.55 + k * 0.55) for k in range(4)]
    return [
        (style.wall, block(d - deep, a, d, b, 0.0, high)),
        (style.roof, block(d - deep - 0.25, a - 0.1, d + 0.35, b + 0.1, high, high + 0.22)),
        (style.trim, merge([block(d - 0.02, middle - 1.5, d + 0.05, middle + 1.5, 0.0, 2.45), *ribs])),
    ]
