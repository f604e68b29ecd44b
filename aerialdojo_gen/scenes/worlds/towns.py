"""Layouts of towns that disasters befall: lots, the streets between them, and open ground."""

from __future__ import annotations

from aerialdojo_gen.scenes.worlds.blocks import split
from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.streets import Box

Layout = tuple[list[Box], list[Box], list[Box]]  # Lots, streets and open ground


def left_open(draft: Draft, blocks: list[Box], number: int) -> tuple[list[Box], list[Box]]:
    """Leave so many blocks open, those nearest to the middle of the site."""
    near = sorted(blocks, key=lambda b: abs(b.middle[0]) + abs(b.middle[1]) + draft.number(0, 12, "open", *b))
    return near[number:], near[:number]


def town(draft: Draft, w: float, d: float) -> Layout:
    """Blocks of uneven sizes between streets, some open."""
    blocks, lanes = split(draft, Box(-w, -d, w, d), (8.8, 8.8), (16.0, 30.0))
    lots, open_ = left_open(draft, blocks, 2)
    return lots, lanes, open_


def square(draft: Draft, w: float, d: float) -> Layout:
    """A square in the middle, streets into it, blocks about it."""
    half_x, half_y, lane = draft.number(15, 19, "x"), draft.number(12, 15, "y"), 8.8
    x0, y0, x1, y1 = -half_x, -half_y, half_x, half_y
    lanes = [Box(-w, y1, x1 + lane, y1 + lane), Box(x1, -d, x1 + lane, y1), Box(x0 - lane, y0 - lane, x1, y0),
             Box(x0 - lane, y0, x0, d)]  # fmt: skip
    areas = [Box(-w, y1 + lane, x0 - lane, d), Box(x0, y1 + lane, w, d), Box(x1 + lane, -d, w, y1 + lane),
             Box(-w, -d, x1, y0 - lane), Box(-w, y0 - lane, x0 - lane, y1)]  # fmt: skip
    lots: list[Box] = []
    for k, area in enumerate(areas):
        if min(area.width, area.depth) > 9.0:
            more, _ = split(draft, area, (3.0, 4.5), (13.0, 30.0), k)
            lots += more
    return lots, lanes, [Box(x0, y0, x1, y1)]


def avenue(draft: Draft, w: float, d: float) -> Layout:
    """A street from end to end, blocks in rows at both sides, a park at one end."""
    y, lane = draft.number(-0.25, 0.25, "y") * d, 8.8
    at = draft.number(0.4, 0.55, "park") * w
    lanes = [Box(-w, y - lane / 2, w, y + lane / 2)]
    lots: list[Box] = []
    for k, (y0, y1) in enumerate(((-d, y - lane / 2), (y + lane / 2, d))):
        row, ways = split(draft, Box(-w, y0, at if k == 0 else w, y1), (8.8, 8.8), (18.0, 34.0), k)
        lots += row
        lanes += ways
    park = Box(at, -d, w, y - lane / 2)
    lots, more = left_open(draft, lots, 1)
    return lots, lanes, [park, *more]


def estate(draft: Draft, w: float, d: float) -> Layout:
    """Long blocks of flats in parallel, greens between them, off one street."""
    lane, street = 8.8, draft.number(-0.9, -0.75, "street") * d + 4.4
    lanes = [Box(-w, street - lane / 2, w, street + lane / 2)]
    y, lots, open_, k = street + lane / 2, [], [], 0
    while y + 13.0 < d:
        lots.append(Box(-w + draft.number(2, 8, "in", k), y + 0.5, draft.number(-2, 6, "end", k), y + 13.0))
        lots.append(
            Box(lots[-1].x1 + draft.number(5, 9, "gap", k), y + 0.5, w - draft.number(2, 8, "out", k), y + 13.0)
        )
        gap = draft.number(10, 14, "green", k)
        if y + 13.0 + gap < d:
            open_.append(Box(-w + 2.0, y + 13.5, w - 2.0, y + 13.0 + gap))
        y, k = y + 13.0 + gap, k + 1
    return lots, lanes, open_
