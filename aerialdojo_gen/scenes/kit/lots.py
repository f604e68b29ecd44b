"""Lots along a street: a house with its drive, path, porch, gardens and fences, and what stands in gardens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from aerialdojo_gen.scenes.grammar import Frame, Pose
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.fences import fence
from aerialdojo_gen.scenes.kit.houses import FLOOR_M, HouseStyle, house
from aerialdojo_gen.scenes.kit.structures import block
from aerialdojo_gen.scenes.mesh import Parts, merge, rotated, rotation, translated
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import At, Material, Number
from aerialdojo_gen.scenes.shapes import prism
from aerialdojo_gen.scenes.site import Site

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
    at = -side
    for low, high in [*sorted(gaps), (side, side)]:
        if low - at > 0.8:
            fence(site, lot.frame.path([(edge, at), (edge, low)]), lot.front_fence)
        at = high
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
    site: Site, *, at: list[At], greens: Annotated[list[Material], Field(min_length=1)], soil: Material = "soil",
    edge: Material = "wood",
) -> None:  # fmt: skip
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
