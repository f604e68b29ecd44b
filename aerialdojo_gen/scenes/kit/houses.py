"""Houses of a style, one by one or in rows; lots along a street: drive, path, porch, gardens, fences, things in them.

A house is built in a frame of its own: the origin is the middle of its plan, +u looks out of its front door, v runs
to the left of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar import Frame, Pose, between_gates, box_between
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.buildings import pitched_roof
from aerialdojo_gen.scenes.kit.fences import fence
from aerialdojo_gen.scenes.kit.structures import block
from aerialdojo_gen.scenes.mesh import Parts, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import At, Material, Materials, Number
from aerialdojo_gen.scenes.shapes import box, prism
from aerialdojo_gen.scenes.site import Site


@site_builder
def house_row(
    site: Site, *, at: list[At], yaw_deg: Number = 0.0, style: HouseStyle, on: Number | None = None,
    yaws_deg: tuple[Number, ...] = (), walls: tuple[Material, ...] = (), roofs: tuple[Material, ...] = (),
    doors: tuple[Material, ...] = (), storeys: tuple[int, ...] = (), chimneys: tuple[bool, ...] = (),
    roof_kinds: tuple[Literal["gable", "hip"], ...] = (),
) -> None:  # fmt: skip
    """Put up houses of a style; each takes the next of the directions, walls, roofs, doors and so on, in turn."""
    varied = {"wall": walls, "roof": roofs, "door": doors, "storeys": storeys, "chimney": chimneys,
              "roof_kind": roof_kinds}  # fmt: skip
    for k, point in enumerate(at):
        yaw_deg = yaws_deg[k % len(yaws_deg)] if yaws_deg else yaw_deg
        own: dict[str, Any] = {key: values[k % len(values)] for key, values in varied.items() if values}
        house(site, Frame(*point, yaw_deg), replace(style, **own), z=on)


@dataclass(frozen=True)
class TerraceHouse:
    """One house of a terrace, and the things before and behind it."""

    colour: str  # What a person calls it
    wall: Material
    roof: Material
    door: Material
    storeys: int = 2
    chimney: bool = False
    front: str | None = None  # Categories of the catalogue
    back: str | None = None


@site_builder
def terrace(
    site: Site, *, at: At, yaw_deg: Number, houses: list[TerraceHouse], name: str, pitch_m: Number = 6.6,
    depth_m: Number = 8.6, storey_m: Number = 2.8, roof_m: Number = 3.4,
) -> None:  # fmt: skip
    """Put up houses wall to wall, with fences between the gardens behind them and a hedge about those.

    `at` is the middle; the fronts look along `yaw_deg`.
    """
    frame, half, behind = Frame(*at, yaw_deg), len(houses) * pitch_m / 2, -depth_m / 2 - 0.1
    for k, one in enumerate(houses):
        style = HouseStyle(
            width_m=pitch_m, depth_m=depth_m, storeys=one.storeys, storey_m=storey_m, wall=one.wall, roof=one.roof,
            roof_m=roof_m, door=one.door, overhang_m=0.0, chimney=one.chimney,
        )  # fmt: skip
        own = Frame(*frame.at(0.0, (k - (len(houses) - 1) / 2) * pitch_m), yaw_deg)
        house(site, own, style, {"colour": one.colour, "place": name})
        whose = f"the {one.colour} house of the {name}"
        if one.front:
            pose = own.pose(depth_m / 2 + 2.3, 2.0, 90.0)
            site.place(Placement(one.front, *pose, place=f"in front of {whose}"), "skip")
        if one.back:
            pose = own.pose(-depth_m / 2 - 3.1, 0.2, 180.0)
            site.place(Placement(one.back, *pose, place=f"behind {whose}"), "skip")
        if k:
            fence(site, own.path([(behind, -pitch_m / 2), (behind - 5.2, -pitch_m / 2)]), "board")
    hedge = [(behind, -half), (behind - 5.4, -half), (behind - 5.4, half), (behind, half)]
    fence(site, frame.path(hedge), "hedge")


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
    plan: BaseGeometry = rectangle(-d, -w, d, w)
    parts: Parts = [
        ("stone", box_between(-d - 0.06, -w - 0.06, d + 0.06, w + 0.06, -0.1, FLOOR_M)),
        (style.wall, box_between(-d, -w, d, w, FLOOR_M, top)),
        *pitched_roof(rectangle(-d, -w, d, w), top, style.roof_m, style.wall, style.roof,
                      hip=style.roof_kind == "hip", overhang_m=style.overhang_m),
    ]  # fmt: skip
    parts += _fenestration(style)
    parts += _porch(style) if style.porch_m else _hood(style)
    if style.porch_m:
        plan = plan.union(rectangle(d, -w, d + style.porch_m, w))
    if style.garage:
        parts += _garage(style)
        low, high = sorted((style.garage * w, style.garage * (w + _GARAGE_M[0])))
        plan = plan.union(rectangle(d - _GARAGE_M[1], low, d, high))
    if style.chimney:
        u, v, peak = -0.25 * d, 0.55 * w, top + style.roof_m + 0.7
        parts += [
            ("brick:#7f4a3c", box_between(u - 0.4, v - 0.45, u + 0.4, v + 0.45, top - 0.2, peak)),
            ("concrete", box_between(u - 0.5, v - 0.55, u + 0.5, v + 0.55, peak, peak + 0.15)),
        ]
    base = site.ground_z(frame.x, frame.y) if z is None else z
    return site.add(None, "house", frame.parts(parts, base), attributes, footprint=frame.area(plan))


def window_parts(width_m: float, height_m: float, trim: str) -> Parts:
    """Make a window in the u = 0 plane that looks along +u, its sill's middle at the origin: frame, pane, bars."""
    w, h = width_m, height_m
    frame = translated(box(size=(0.08, w + 0.24, h + 0.24)), (0.03, 0, -0.12))
    sill = translated(box(size=(0.22, w + 0.36, 0.09)), (0.08, 0, -0.18))
    bars = [
        translated(box(size=(0.04, 0.07, h)), (0.1, 0, 0)),
        translated(box(size=(0.04, w, 0.07)), (0.1, 0, h * 0.55)),
    ]
    return [(trim, merge([frame, sill, *bars])), ("window", translated(box(size=(0.06, w, h)), (0.06, 0, 0)))]


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
    parts.append((style.trim, box_between(d - 0.02, -0.68, d + 0.08, 0.68, FLOOR_M, FLOOR_M + 2.25)))
    parts.append((style.door, box_between(d, -0.5, d + 0.12, 0.5, FLOOR_M, FLOOR_M + 2.1)))
    parts.append(("brass", box_between(d + 0.1, 0.32, d + 0.18, 0.4, FLOOR_M + 1.0, FLOOR_M + 1.08)))
    return parts


def _porch(style: HouseStyle) -> Parts:
    d, w, p = style.depth_m / 2, style.width_m / 2, style.porch_m
    head = FLOOR_M + 2.5
    slope = translated(
        rotated(prism(size=(style.width_m, p + 0.4, 0.55), section="wedge"), rotation(0, 0, 90)),
        (d + p / 2 + 0.2, 0, head),
    )
    posts = [
        box_between(d + p - 0.2, v - 0.08, d + p - 0.04, v + 0.08, FLOOR_M, head)
        for v in np.linspace(-w + 0.12, w - 0.12, 4)
    ]
    rails = [
        box_between(d + p - 0.16, a, d + p - 0.08, b, FLOOR_M + 0.75, FLOOR_M + 0.85)
        for a, b in ((-w + 0.2, -w / 3 - 0.05), (w / 3 + 0.05, w - 0.2))
    ]
    return [
        ("boards:#a08a6a", box_between(d, -w, d + p, w, 0.0, FLOOR_M)),
        ("concrete", box_between(d + p, -0.9, d + p + 0.4, 0.9, 0.0, FLOOR_M / 2)),
        (style.roof, slope),
        (style.trim, merge([*posts, *rails])),
    ]


def _hood(style: HouseStyle) -> Parts:
    d = style.depth_m / 2
    hood = rotated(prism(size=(2.0, 1.2, 0.45), section="wedge"), rotation(0, 0, 90))
    return [
        ("concrete", box_between(d, -0.9, d + 1.1, 0.9, 0.0, FLOOR_M)),
        ("concrete", box_between(d + 1.1, -0.9, d + 1.45, 0.9, 0.0, FLOOR_M / 2)),
        (style.roof, translated(hood, (d + 0.6, 0, FLOOR_M + 2.4))),
    ]


def _garage(style: HouseStyle) -> Parts:
    d, w, side = style.depth_m / 2, style.width_m / 2, style.garage
    wide, deep, high = _GARAGE_M
    a, b = sorted((side * w, side * (w + wide)))
    middle = (a + b) / 2
    ribs = [box_between(d, middle - 1.35, d + 0.1, middle + 1.35, 0.1 + k * 0.55, 0.55 + k * 0.55) for k in range(4)]
    return [
        (style.wall, box_between(d - deep, a, d, b, 0.0, high)),
        (style.roof, box_between(d - deep - 0.25, a - 0.1, d + 0.35, b + 0.1, high, high + 0.22)),
        (style.trim, merge([box_between(d - 0.02, middle - 1.5, d + 0.05, middle + 1.5, 0.0, 2.45), *ribs])),
    ]


_GARAGE_ROOF_M = 3.12
_Fence = Literal["picket", "board", "hedge", "wall", "railing"]


@dataclass(frozen=True)
class Lot:
    """A house, the ground about it, and the categories of the things there."""

    at: At  # Middle of the house
    yaw_deg: Number  # What its front looks along
    style: HouseStyle
    colour: str  # What a person calls the house by
    front_m: Number = 6.0  # Depth of the front garden, and of the back garden
    back_m: Number = 8.0
    side_m: Number = 8.0  # Width of the lot to either side of the house's middle
    front_fence: _Fence = "picket"
    back_fence: _Fence = "board"
    trees: Annotated[tuple[str, ...], Field(max_length=2)] = ()  # In the corners of the back garden
    back: tuple[str, ...] = ()  # In two rows of the back garden
    front: Annotated[tuple[str, ...], Field(max_length=4)] = ()  # On both sides of the path to the door
    porch: Annotated[tuple[str, ...], Field(max_length=3)] = ()
    vehicle: str | None = None  # In the drive
    garage_roof: str | None = None

    @property
    def frame(self) -> Frame:
        """Frame about the house's middle; u looks to the street."""
        return Frame(*self.at, self.yaw_deg)

    @property
    def wall_m(self) -> float:
        """From the middle of the house to its front wall."""
        return self.style.depth_m / 2

    @property
    def garage_m(self) -> float:
        """From the path to the middle of the drive, to the left."""
        return self.style.garage * (self.style.width_m / 2 + 1.8)


@site_builder
def house_lots(
    site: Site, *, lots: list[Lot], path: Material = "paving", drive: Material = "concrete:#a7a49c"
) -> None:
    """Put up the houses of lots and pave their drives and paths, then fence each lot and set its things out.

    What has no room in a garden is left out.
    """
    for lot in lots:
        edge = lot.wall_m + lot.front_m
        site.paint(lot.frame.area(rectangle(lot.wall_m, -0.7, edge, 0.7)), path, 0.04)
        if lot.style.garage:
            v = lot.garage_m
            site.paint(lot.frame.area(rectangle(lot.wall_m, v - 1.6, edge + 2.5, v + 1.6)), drive, 0.02)
        house(site, lot.frame, lot.style, {"colour": lot.colour})
    for lot in lots:
        _fences(site, lot)
        _back_garden(site, lot)
        _front_garden(site, lot)
        _porch_and_garage(site, lot)


def _fences(site: Site, lot: Lot) -> None:
    """Fence a lot along the street, with gaps for path and drive, and around the back garden."""
    d, side = lot.wall_m, lot.side_m
    edge = d + lot.front_m - 0.3
    gaps = [(-1.0, 1.0)]
    if lot.style.garage:
        gaps.append((lot.garage_m - 1.9, lot.garage_m + 1.9))
    for low, high in between_gates(-side, side, gaps, 0.8):
        fence(site, lot.frame.path([(edge, low), (edge, high)]), lot.front_fence)
    rear = -d - lot.back_m
    around = [(-d + 1.0, -side), (rear, -side), (rear, side), (-d + 1.0, side)]
    fence(site, lot.frame.path(around), lot.back_fence)


def _back_garden(site: Site, lot: Lot) -> None:
    d, side, back = lot.wall_m, lot.side_m, lot.back_m
    place = f"in the back garden of the {lot.colour} house"
    if lot.trees:
        corners = [lot.frame.pose(-d - back + 1.3, s * (side - 1.3)) for s in (1, -1)]
        _in_turn(site, lot.trees, corners[: len(lot.trees)], place)
    rng = site.rng_for("garden", f"{lot.colour} house")
    columns = (len(lot.back) + 1) // 2
    for k, thing in enumerate(lot.back):
        row, column = divmod(k, columns)
        u = -d - back * (0.3 if row == 0 else 0.72)
        v = (column + 0.5 - columns / 2) * (2 * side - 3.0) / columns + (0.5 if row else -0.3)
        x, y, yaw = lot.frame.pose(u, v, float(rng.uniform(-50, 50)))
        for dx, dy in ((0.0, 0.0), (0.8, 0.8), (-0.8, 0.8), (-0.8, -0.8)):
            if site.place(Placement(thing, x + dx, y + dy, yaw, place=place), "skip"):
                break


def _in_turn(site: Site, categories: Sequence[str], poses: Sequence[Pose], place: str) -> None:
    """Place things at poses where there is room, of categories in turn."""
    count = 0
    for pose in poses:
        thing = Placement(categories[count % len(categories)], *pose, place=place)
        count += site.place(thing, "skip") is not None


def _front_garden(site: Site, lot: Lot) -> None:
    d, w, porch_m = lot.wall_m, lot.style.width_m / 2, lot.style.porch_m
    free = -lot.style.garage if lot.style.garage else 1
    spots = [
        (d + porch_m + 1.5, free * (w - 1.6)), (d + lot.front_m - 1.5, -free * 2.2),
        (d + lot.front_m - 1.6, free * (w - 0.6)), (d + porch_m + 1.4, -free * (w - 2.4)),
    ]  # fmt: skip
    poses = [lot.frame.pose(u, v, 90.0 * k) for k, (u, v) in enumerate(spots)]
    _in_turn(site, lot.front, poses[: len(lot.front)], f"in front of the {lot.colour} house")


def _porch_and_garage(site: Site, lot: Lot) -> None:
    d, w, whose = lot.wall_m, lot.style.width_m / 2, f"of the {lot.colour} house"
    ground = site.ground_z(*lot.at)
    spots = [lot.frame.pose(d + lot.style.porch_m * 0.45, s * w * f) for s, f in ((1, 0.55), (-1, 0.55), (1, 0.82))]
    for thing, pose in zip(lot.porch, spots, strict=False):
        # The porch itself has taken the ground: its floor is what the thing stands on.
        z = ground + FLOOR_M
        site.place(Placement(thing, *pose, z=z, place=f"on the porch {whose}", solid=False))
    if lot.vehicle:
        pose = lot.frame.pose(d + 3.4, lot.garage_m, 180.0)
        site.place(Placement(lot.vehicle, *pose, place=f"in the drive {whose}"), "skip")
    if lot.garage_roof:
        # The house has taken its ground over its whole height, the garage's roof with it.
        pose = lot.frame.pose(d - 3.0, lot.garage_m)
        z = ground + _GARAGE_ROOF_M
        site.place(Placement(lot.garage_roof, *pose, z=z, place=f"on the garage {whose}"))


@site_builder
def vegetable_beds(
    site: Site, *, at: list[At], greens: Materials, soil: Material = "soil", edge: Material = "wood"
) -> None:
    """Lay out raised beds of three rows about points; the greens, each higher than the last, are dealt in turn."""
    for k, (x, y) in enumerate(at):
        plan = rectangle(x - 1.5, y - 1.0, x + 1.5, y + 1.0)
        site.paint(plan, soil, 0.25, edge)
        n = k % len(greens)
        rows = [block(x - 1.3, y - 0.75 + 0.55 * r, x + 1.3, y - 0.5 + 0.55 * r, 0.2, 0.45 + 0.12 * n)
                for r in range(3)]  # fmt: skip
        site.add(None, "vegetable_bed", [(greens[n], merge(rows))], footprint=plan)


@site_builder
def glasshouse(
    site: Site, *, at: At, size_m: tuple[Number, Number] = (4.4, 6.0), pane: Material = "glass:#a9c6c0",
    frame: Material = "#e9ece6", base: Material = "stone",
) -> None:  # fmt: skip
    """Put up a glasshouse with a gable roof along y, closed towards -y; one may stand things in it."""
    (x, y), (w, half) = at, (size_m[0] / 2, size_m[1] / 2)
    sides = (x - w, x + w)
    gable = rotated(prism(size=(size_m[1], size_m[0], 1.5)), rotation(0.0, 0.0, 90.0))
    posts = [(u, y + v) for u in sides for v in (-half, -half / 3, half / 3, half)]
    parts: Parts = [
        (pane, translated(gable, (x, y, 2.0))),
        (frame, merge([block(x - w - 0.1, y - half - 0.1, x + w + 0.1, y - half + 0.02, 1.9, 2.06),
                       block(x - w - 0.1, y + half - 0.02, x + w + 0.1, y + half + 0.1, 1.9, 2.06)])),
        (frame, merge([block(u - 0.06, v - 0.06, u + 0.06, v + 0.06, 0.0, 2.0) for u, v in posts])),
        (pane, merge([block(u - 0.03, y - half, u + 0.03, y + half, 0.25, 1.95) for u in sides])),
        (pane, block(x - w, y - half - 0.03, x + w, y - half + 0.03, 0.25, 1.95)),
        (base, merge([block(u - 0.1, y - half, u + 0.1, y + half, 0.0, 0.25) for u in sides])),
    ]  # fmt: skip
    site.add(None, "glasshouse", parts, {"material": "glass"})
    for u in sides:
        site.occupy(rectangle(u - 0.2, y - half - 0.1, u + 0.2, y + half + 0.1))
