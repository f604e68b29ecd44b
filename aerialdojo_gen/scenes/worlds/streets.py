"""Stages that types share: streets at a site's edges, lots beside them, and their slots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft

Point = tuple[float, float]
LANE_M, PAVEMENT_M = 3.25, 2.0


class Box(NamedTuple):
    """A rectangle of ground, metres."""

    x0: float
    y0: float
    x1: float
    y1: float

    @property
    def width(self) -> float:
        """Extent along x."""
        return self.x1 - self.x0

    @property
    def depth(self) -> float:
        """Extent along y."""
        return self.y1 - self.y0

    @property
    def middle(self) -> Point:
        """Its middle."""
        return (self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2

    def grown(self, by_m: float) -> Box:
        """Return it grown to all sides, or with a negative number shrunk."""
        return Box(self.x0 - by_m, self.y0 - by_m, self.x1 + by_m, self.y1 + by_m)

    def shape(self) -> shapely.Polygon:
        """Return it as a polygon."""
        return shapely.box(*self)

    def rounded(self) -> list[float]:
        """Return it as plans write it."""
        return [round(v, 2) for v in self]


def street_along(draft: Draft, path: Sequence[Point]) -> float:
    """Pave a street along a path, offer slots on it and at its kerbs; gives half its width with pavements, metres."""
    draft.make("streets", paths=[[list(p) for p in path]], lanes=2, pavement_m=PAVEMENT_M)
    half = LANE_M + PAVEMENT_M
    line = shapely.LineString(path)
    draft.take(line.buffer(half, cap_style="flat"))
    along_street(draft, line, half)
    return half


def along_street(draft: Draft, line: shapely.LineString, half_m: float) -> None:
    """Offer slots on a street's lanes (``road``) and on its pavements (``kerb``)."""
    step, at = 7.5, 4.0
    while at < line.length - 4.0:
        here, there = line.interpolate(at), line.interpolate(at + 0.5)
        dx, dy = (there.x - here.x) * 2, (there.y - here.y) * 2
        yaw = math.degrees(math.atan2(dy, dx))
        lane = LANE_M / 2
        draft.slot("road", here.x + dy * lane, here.y - dx * lane, yaw, (12.0, 2.9))
        draft.slot("road", here.x - dy * lane, here.y + dx * lane, yaw + 180.0, (12.0, 2.9))
        side = half_m - 0.95
        draft.slot("kerb", here.x + dy * side, here.y - dx * side, yaw + 90.0, (1.7, 5.0))
        draft.slot("kerb", here.x - dy * side, here.y + dx * side, yaw - 90.0, (1.7, 5.0))
        at += step


def block_building(draft: Draft, box: Box, name: str, *, storeys: int, street_deg: float, category: str) -> None:
    """Put up a building on a rectangle, with slots before its front and, where its roof is flat, on it."""
    flat = box.width * box.depth > 120 or draft.chance(0.5, name, "flat")
    arguments = {
        "outline": box.rounded(), "wall": draft.material("wall", name), "roof": draft.material("roof", name),
        "storeys": storeys, "storey_m": draft.number(2.9, 3.6, name, "storey"), "category": category,
        "as": f"{name}_top",
    }  # fmt: skip
    if not flat:
        arguments |= {
            "roof_kind": draft.pick(["gable", "hip"], name, "roof_kind"),
            "roof_m": draft.number(1.8, 3.0, name, "roof_m"),
        }
    draft.make("building", **arguments)
    draft.take(box.shape())
    front_slots(draft, box, street_deg)
    if flat:
        for x, y in grid(box.grown(-2.2), 4.6):
            draft.slot("roof", x, y, street_deg, (3.2, 3.2), on=f"{name}_top")


def side_of(box: Box, yaw: float, out_m: float = 0.0) -> tuple[Point, Point, float]:
    """Middle of a rectangle's side that looks along a direction of the four, the unit vector along it, its length."""
    x, y = box.middle
    out = {0: (box.x1 + out_m, y), 90: (x, box.y1 + out_m), 180: (box.x0 - out_m, y), 270: (x, box.y0 - out_m)}
    upright = round(yaw) % 180 == 0
    return out[round(yaw) % 360], ((0.0, 1.0) if upright else (1.0, 0.0)), box.depth if upright else box.width


def front_slots(draft: Draft, box: Box, street_deg: float, step_m: float = 3.4) -> None:
    """Offer slots (``front``) along the side of a box that looks along a direction of the four."""
    (cx, cy), (ux, uy), length = side_of(box, street_deg, 1.3)
    n = int((length - 1.0) // step_m)
    for k in range(n):
        v = (k - (n - 1) / 2) * step_m
        draft.slot("front", cx + ux * v, cy + uy * v, street_deg, (2.2, 3.0))


def grid(box: Box, step_m: float) -> list[Point]:
    """Points over a box, evenly, at least that far apart."""
    nx, ny = max(int(box.width // step_m), 0), max(int(box.depth // step_m), 0)
    return [
        (box.x0 + (i + 0.5) * box.width / nx, box.y0 + (j + 0.5) * box.depth / ny)
        for i in range(nx)
        for j in range(ny)
    ]


def edge_slots(draft: Draft, kind: str, box: Box, step_m: float, room_m: tuple[float, float]) -> None:
    """Offer slots around the inside of a box, fronts to its middle, where the ground is free."""
    for (a, b), yaw in (
        (((box.x0, box.y0), (box.x1, box.y0)), 90.0), (((box.x1, box.y0), (box.x1, box.y1)), 180.0),
        (((box.x1, box.y1), (box.x0, box.y1)), 270.0), (((box.x0, box.y1), (box.x0, box.y0)), 0.0),
    ):  # fmt: skip
        line = shapely.LineString([a, b])
        for k in range(int(line.length // step_m)):
            p = line.interpolate((k + 0.5) * step_m)
            if draft.is_free(p.buffer(max(room_m) / 2)):
                draft.slot(kind, p.x, p.y, yaw, room_m)
