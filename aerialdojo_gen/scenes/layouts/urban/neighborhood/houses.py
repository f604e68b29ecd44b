"""Lots of urban layouts: a house with its drive, path, porch, back garden and fences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import FLOOR_M, HouseStyle, house
from aerialdojo_gen.scenes.grammar_props import deal, put
from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.site import Site

GARAGE_ROOF_M = 3.12


@dataclass(frozen=True)
class Lot:
    """A house and the ground about it.

    Attributes
    ----------
    frame : Frame
        Middle of the house; u looks to the street.
    style : HouseStyle
        The house.
    name : str
        What a person calls the house, e.g. ``"yellow house"``.
    front_m, back_m, side_m : float
        Depth of the front garden and of the back garden, and width of the lot to either side of the house's middle.
    """

    frame: Frame
    style: HouseStyle
    name: str
    front_m: float = 6.0
    back_m: float = 8.0
    side_m: float = 8.0

    @property
    def half_depth_m(self) -> float:
        """From the middle of the house to its front wall, metres."""
        return self.style.depth_m / 2


def settle(site: Site, lot: Lot, *, drive: str = "concrete:#a7a49c", path: str = "paving") -> None:
    """Put the house up, and pave its drive and the path to its door."""
    d, style = lot.half_depth_m, lot.style
    edge = d + lot.front_m
    site.paint(lot.frame.area(rectangle(d, -0.7, edge, 0.7)), path, 0.04)
    if style.garage:
        v = style.garage * (style.width_m / 2 + 1.8)
        site.paint(lot.frame.area(rectangle(d, v - 1.6, edge + 2.5, v + 1.6)), drive, 0.02)
    house(site, lot.frame, style, {"colour": lot.name.removesuffix(" house")})


def enclose(site: Site, lot: Lot, front: str, back: str, *, front_colour: str | None = None) -> None:
    """Fence a lot: along the street with gaps for path and drive, and around the back garden."""
    d, side, style = lot.half_depth_m, lot.side_m, lot.style
    edge = d + lot.front_m - 0.3
    gaps = [(-1.0, 1.0)]
    if style.garage:
        v = style.garage * (style.width_m / 2 + 1.8)
        gaps.append((v - 1.9, v + 1.9))
    at = -side
    for low, high in [*sorted(gaps), (side, side)]:
        if low - at > 0.8:
            fence(site, lot.frame.path([(edge, at), (edge, low)]), front, front_colour)
        at = high
    rear = -d - lot.back_m
    fence(site, lot.frame.path([(-d + 1.0, -side), (rear, -side), (rear, side), (-d + 1.0, side)]), back)


def back_garden(site: Site, lot: Lot, things: Sequence[str], trees: Sequence[str] = ()) -> None:
    """Set things out in the back garden: trees in its corners, the rest in two rows."""
    d, side, back = lot.half_depth_m, lot.side_m, lot.back_m
    corners = [lot.frame.pose(-d - back + 1.3, s * (side - 1.3)) for s in (1, -1)]
    place = f"in the back garden of the {lot.name}"
    if trees:
        deal(site, trees, corners[: len(trees)], place)
    rng = site.rng_for("garden", lot.name)
    poses: list[Pose] = []
    columns = (len(things) + 1) // 2
    for k in range(len(things)):
        row, column = divmod(k, columns)
        u = -d - back * (0.3 if row == 0 else 0.72)
        v = (column + 0.5 - columns / 2) * (2 * side - 3.0) / columns + (0.5 if row else -0.3)
        poses.append(lot.frame.pose(u, v, float(rng.uniform(-50, 50))))
    for thing, pose in zip(things, poses, strict=True):
        tries = [
            pose,
            *(Pose(pose.x + dx, pose.y + dy, pose.yaw_deg) for dx, dy in ((0.8, 0.8), (-0.8, 0.8), (-0.8, -0.8))),
        ]
        for attempt in tries:
            if deal(site, [thing], [attempt], place):
                break


def front_garden(site: Site, lot: Lot, things: Sequence[str]) -> None:
    """Set things out before the house, on both sides of its path."""
    d, w = lot.half_depth_m, lot.style.width_m / 2
    free = -lot.style.garage if lot.style.garage else 1
    spots = [
        (d + lot.style.porch_m + 1.5, free * (w - 1.6)),
        (d + lot.front_m - 1.5, -free * 2.2),
        (d + lot.front_m - 1.6, free * (w - 0.6)),
        (d + lot.style.porch_m + 1.4, -free * (w - 2.4)),
    ]
    deal(site, things, [lot.frame.pose(u, v, 90.0 * k) for k, (u, v) in enumerate(spots)][: len(things)],
         f"in front of the {lot.name}")  # fmt: skip


def on_porch(site: Site, lot: Lot, things: Sequence[str]) -> None:
    """Set things out on the porch, under its roof."""
    u, w = lot.half_depth_m + lot.style.porch_m * 0.45, lot.style.width_m / 2
    spots = [lot.frame.pose(u, s * w * f) for s, f in ((1, 0.55), (-1, 0.55), (1, 0.82))]
    z = site.ground_z(lot.frame.x, lot.frame.y) + FLOOR_M
    for thing, pose in zip(things, spots, strict=False):
        # The porch itself has taken the ground: its floor is what the thing stands on.
        put(site, thing, *pose, place=f"on the porch of the {lot.name}", z=z, solid=False)


def in_drive(site: Site, lot: Lot, vehicle: str) -> None:
    """Park a vehicle before the garage."""
    v = lot.style.garage * (lot.style.width_m / 2 + 1.8)
    deal(site, [vehicle], [lot.frame.pose(lot.half_depth_m + 3.4, v, 180.0)], f"in the drive of the {lot.name}")


def on_garage(site: Site, lot: Lot, thing: str) -> None:
    """Stand a thing on the garage's flat roof."""
    v = lot.style.garage * (lot.style.width_m / 2 + 1.8)
    pose = lot.frame.pose(lot.half_depth_m - 3.0, v, 0.0)
    z = site.ground_z(lot.frame.x, lot.frame.y) + GARAGE_ROOF_M
    # The house has taken its ground over its whole height, the garage's roof with it.
    put(site, thing, *pose, place=f"on the garage of the {lot.name}", z=z)


def tree_line(site: Site, path: Sequence[tuple[float, float]], categories: Sequence[str]) -> None:
    """Set trees at the points of a path, where there is room."""
    deal(site, categories, [Pose(x, y, 47.0 * k) for k, (x, y) in enumerate(path)])


def winding_path(site: Site, path: Sequence[tuple[float, float]], width_m: float, material: str) -> None:
    """Pave a path on the ground."""
    site.paint(ribbon(path, width_m, round_ends=True), material, 0.02)
