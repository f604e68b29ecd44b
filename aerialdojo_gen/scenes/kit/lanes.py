"""What hangs on the walls of narrow lanes and across them: balconies, fire escapes, awnings, washing, lights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from aerialdojo_gen.scenes.grammar import Frame
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Point, block, deck, railing, stairs
from aerialdojo_gen.scenes.mesh import Parts, merge, posed, rotated, rotation, translated
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import At, Material, Number
from aerialdojo_gen.scenes.shapes import box, sphere
from aerialdojo_gen.scenes.shapes_extruded import prism, sweep
from aerialdojo_gen.scenes.site import Site

# A point of a wall's foot, and what the wall faces.
_OnWall = tuple[Number, Number, Number]
# Both ends on walls, and their height.
_Across = tuple[Number, Number, Number, Number, Number]
_Materials = Annotated[list[Material], Field(min_length=1)]


@dataclass(frozen=True)
class Balcony:
    """A balcony, and the thing that stands on it."""

    at: At
    yaw_deg: Number
    z_m: Number  # Height of its floor
    thing: str | None = None  # Category of the catalogue
    turn_deg: Number = 0.0  # Of the thing, from what the wall faces
    width_m: Number | None = None  # Where they differ from those of the others
    depth_m: Number | None = None


@site_builder
def balconies(
    site: Site, *, on_walls: list[Balcony], width_m: Number = 3.0, depth_m: Number = 1.3,
    floor: Material = "concrete", rail: Material = "iron", phrase: str = "",
) -> None:  # fmt: skip
    """Hang balconies with a door behind each on walls that face `yaw_deg`; the phrase says where the things are."""
    for one in on_walls:
        w, d = (one.width_m or width_m) / 2, one.depth_m or depth_m
        parts = deck(rectangle(0.0, -w, d, w), 0.0, floor=floor, under=floor, thickness_m=0.18)
        path = [(0.05, -w + 0.05), (d - 0.05, -w + 0.05), (d - 0.05, w - 0.05), (0.05, w - 0.05)]
        parts += railing(path, 0.0, pane=None, frame=rail)
        parts.append(("#e9e4d8", block(-0.02, -0.62, 0.06, 0.62, 0.0, 2.25)))
        parts.append(("window", block(-0.02, -0.5, 0.09, 0.5, 0.05, 2.1)))
        parts += [(rail, block(0.0, v - 0.04, d * 0.7, v + 0.04, -0.42, -0.18)) for v in (-w + 0.4, w - 0.4)]
        hung = site.add(None, "balcony", Frame(*one.at, one.yaw_deg).parts(parts, one.z_m))
        if one.thing:
            x, y = (float(c) for c in hung.centroid[:2])
            yaw_deg = one.yaw_deg + one.turn_deg
            site.place(Placement(one.thing, x, y, yaw_deg, z=one.z_m, place=phrase, solid=False))


@site_builder
def fire_escapes(
    site: Site, *, at: list[_OnWall], storeys: Annotated[int, Field(ge=2, le=30)] = 4, storey_m: Number = 3.0,
    frame: Material = "iron",
) -> None:  # fmt: skip
    """Hang fire escapes on walls (x, y, yaw_deg): platforms, flights between them, a ladder."""
    for x, y, yaw_deg in at:
        parts: Parts = []
        for k in range(1, storeys):
            z = k * storey_m + 0.1
            parts += deck(rectangle(0.0, -2.9, 1.35, 2.9), z, floor="rust:#5a4a42", under=frame, thickness_m=0.12)
            parts += railing(
                [(0.05, -2.85), (1.3, -2.85), (1.3, 2.85), (0.05, 2.85)], z, pane="chain_link", frame=frame
            )
            parts.append(("window", block(-0.02, -0.5, 0.08, 0.5, z, z + 1.9)))
            if k + 1 < storeys:
                side = 1 if k % 2 else -1
                parts += stairs(
                    (0.75, -side * 2.3), side * 90.0, 0.7, storey_m, 4.2, z_m=z, tread="iron", stringer=frame
                )
        ladder = [block(1.12, v - 0.03, 1.18, v + 0.03, 0.9, storey_m + 1.1) for v in (2.0, 2.5)]
        ladder += [block(1.12, 2.0, 1.18, 2.5, z, z + 0.04) for z in np.arange(1.1, storey_m + 0.2, 0.32)]
        parts.append((frame, merge(ladder)))
        site.add(None, "fire_escape", Frame(x, y, yaw_deg).parts(parts))


@site_builder
def awnings(site: Site, *, at: list[_OnWall], cloths: _Materials, width_m: Number = 3.0, z_m: Number = 2.6) -> None:
    """Hang sloping awnings on walls (x, y, yaw_deg), their lower edges at `z_m`; the cloths are dealt in turn."""
    for k, pose in enumerate(at):
        cloth = cloths[k % len(cloths)]
        slope = rotated(prism(size=(width_m, 1.5, 0.6), section="wedge"), rotation(0.0, 0.0, 90.0))
        parts: Parts = [
            (cloth, translated(slope, (0.75, 0.0, z_m))),
            (cloth, block(1.45, -width_m / 2, 1.5, width_m / 2, z_m - 0.25, z_m)),
        ]
        site.add(None, "awning", Frame(*pose).parts(parts))


@site_builder
def washing_lines(
    site: Site, *, across: list[_Across],
    cloths: _Materials = ["#e8e4da", "#b8443a", "#3f6fa8", "#e0b64a", "#6f9a6a", "#d98aa0"],  # noqa: B006
) -> None:  # fmt: skip
    """Hang washing on sagging cords across lanes: (x, y, x, y, z) of each; the cloths are drawn."""
    for x0, y0, x1, y1, z_m in across:
        rng = site.rng_for("washing", x0, y0, z_m)
        line = _sagging((x0, y0), (x1, y1), z_m, 0.35)
        parts: Parts = [("#d8d4c8", sweep(path=line, radius=0.02, sides=4))]
        length = float(np.hypot(x1 - x0, y1 - y0))
        yaw = math.degrees(math.atan2(y1 - y0, x1 - x0))
        at = 0.5
        while at < length - 1.0:
            width, drop = float(rng.uniform(0.45, 0.95)), float(rng.uniform(0.6, 1.1))
            t = (at + width / 2) / length
            middle = (x0 + (x1 - x0) * t, y0 + (y1 - y0) * t, z_m - 1.4 * t * (1 - t) - drop)
            cloth = posed(box(size=(width, 0.03, drop)), rotation(0.0, 0.0, yaw), middle)
            parts.append((cloths[int(rng.integers(len(cloths)))], cloth))
            at += width + float(rng.uniform(0.1, 0.4))
        site.add(None, "washing_line", parts)


@site_builder
def light_strings(site: Site, *, across: list[_Across]) -> None:
    """Hang strings of bulbs across lanes: (x, y, x, y, z) of each."""
    for x0, y0, x1, y1, z_m in across:
        line = _sagging((x0, y0), (x1, y1), z_m, 0.6)
        bulbs = [translated(sphere(radius=0.09, subdivisions=0), (x, y, z - 0.1)) for x, y, z in line[1:-1]]
        cord = sweep(path=line, radius=0.02, sides=4)
        site.add(None, "light_string", [("iron", cord), ("light", merge(bulbs))])


def _sagging(a: Point, b: Point, z_m: float, sag_m: float) -> list[tuple[float, float, float]]:
    t = np.linspace(0.0, 1.0, 9)
    return [(a[0] + (b[0] - a[0]) * s, a[1] + (b[1] - a[1]) * s, z_m - 4 * sag_m * s * (1 - s)) for s in t.tolist()]
