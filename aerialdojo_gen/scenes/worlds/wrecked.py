"""Stages of disasters: what is left of buildings, rubble about them, and what was torn open."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.worlds.blocks import Layout, lane_streets
from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Box, Point, Pose, ahead, beside, point
from aerialdojo_gen.scenes.worlds.wilds import rolling

STOREY_M = 3.1


def built_up(
    draft: Draft, layout: Callable[[Draft, float, float], Layout], relief_m: float, waves_m: Point
) -> Layout:
    """Lay streets, yards and open ground out on ground that rolls a little."""
    rolling(draft, relief_m, waves_m, 1.6)
    draft.level_things = False
    lots, lanes, open_ = layout(draft, *draft.half)
    draft.section("Streets and open ground")
    for box in open_:
        draft.paint(box.rounded(), draft.material("square", *box))
    for box in lots:
        draft.paint(box.grown(-0.5).rounded(), draft.material("yard", *box))
    lane_streets(draft, lanes)
    return lots, lanes, open_


def camp(draft: Draft, open_: Sequence[Box]) -> None:
    """Offer slots to those who help (``camp``, ``small``), and paint the rubble."""
    for box in open_:
        things(draft, "camp", box.grown(-2.5), 6.2, (7.4, 7.0))
        things(draft, "small", box.grown(-1.5), 4.8, (2.4, 2.6))
    draft.section("Rubble")
    if heaps := _heaps(draft):
        draft.paint(heaps, draft.material("rubble"))


def shallow(draft: Draft, lot: Box, k: int, most_m: float, low: bool) -> Box:
    """Ground of a building on a lot: one side of it where it is deep, with slots on the rest (``yard``)."""
    box, deep = lot.grown(-1.5), min(lot.width, lot.depth) - 3.0
    if deep <= most_m:
        return box
    (x0, y0, x1, y1), cut = box, deep - draft.number(most_m - 2.5, most_m, "deep", k)
    x, y = (0.0, cut) if box.width >= box.depth else (cut, 0.0)
    front = Box(x0, y0, x1 - x, y1 - y) if low else Box(x0 + x, y0 + y, x1, y1)
    rest = box.shape().difference(front.grown(1.5).shape())
    if rest.area > 20.0:
        things(draft, "yard", Box(*rest.bounds), 5.2, (3.8, 3.8))
    return front


def flattened(draft: Draft, box: Box, k: int, name: str, share: float, is_heap: bool) -> None:
    """Leave a yard on a lot, with a heap of rubble if asked, its radius a share of the lot's shorter side."""
    if is_heap:
        radius = min(box.width, box.depth) * share
        heap(draft, f"heap_{name}", point(*box.middle), radius, draft.number(1.2, 2.2, "heap", k))
    things(draft, "yard", box, 5.2, (3.8, 3.8))


def wreck(
    draft: Draft, box: Box, name: str, storeys: int, torn: int, *, toward: Point | None = None, lean_deg: float = 0.0,
    soot: float = 0.0,
) -> None:  # fmt: skip
    """Put up a damaged building with so many holes, the first towards a point; slots in its rooms (``torn``)."""
    long, deep = max(box.width, box.depth), min(box.width, box.depth)
    yaw = (90.0 if box.upright else 0.0) + (180.0 if draft.chance(0.5, name, "turned") else 0.0)
    pose = (round(box.middle[0], 2), round(box.middle[1], 2), yaw)
    draft.step("level_area", area=box.grown(0.4).rounded(), blend_m=2.5)
    bites = [_bite(draft, pose, (long, deep), name, k, storeys, toward) for k in range(torn)]
    pitched = draft.chance(0.3, name, "pitched") and deep < 12.0
    draft.make(
        "damaged_building", node=name, at=pose[:2], yaw_deg=yaw % 360.0, storeys=storeys,
        size_m=[round(long, 2), round(deep, 2)], bites=bites, balconies=draft.chance(0.5, name, "balconies"),
        sunk_m=0.7 if lean_deg else 0.3,
        style={"wall": draft.material("wall", name), "band": draft.material("band", name), "soot": soot,
               "panes": round(0.75 - 0.2 * torn, 2), "storey_m": STOREY_M, "roof": draft.material("roof", name)},
        **({"ridge_m": draft.number(2.2, 3.2, name, "ridge")} if pitched else {}),
        **({"lean_deg": lean_deg} if lean_deg else {}), **{"as": name},
    )  # fmt: skip
    draft.take(box.shape())
    if lean_deg:
        return
    for k, bite in enumerate(bites):
        # What fell out of the hole.
        at = beside(pose, bite["x"], bite["y"] + (1.8 if bite["y"] > 0 else -1.8))
        radius = 2.4 + 0.5 * bite["foot_m"] + 0.25 * bite["head_m"]
        heap(draft, f"heap_{name}_{k}", at, radius, draft.number(1.0, 2.4, f"{name}_{k}"))
    if bites:
        _rooms(draft, pose, (long, deep), name, storeys, bites)
    if not pitched:
        for side in (-1, 1):
            u = side * long * 0.32
            if all(math.hypot(u - b["x"], b["y"]) > b["head_m"] + 2.4 for b in bites):
                high = f"{name} + {storeys} * {STOREY_M} + 0.03"
                draft.slot("roof", *beside(pose, u, 0.0), yaw + 90.0 * side, (3.2, 3.2), on=high)


def _bite(
    draft: Draft, pose: Pose, size_m: Point, name: str, k: int, storeys: int, toward: Point | None
) -> dict[str, float]:  # fmt: skip
    long, deep = size_m
    side, u = draft.pick([-1, 1], name, "side", k), draft.number(-0.46, 0.46, name, "along", k) * long
    if toward is not None:
        turn = math.radians(pose[2])
        dx, dy = toward[0] - pose[0], toward[1] - pose[1]
        v = -math.sin(turn) * dx + math.cos(turn) * dy
        side = 1 if v > 0 else -1
        if k == 0:
            ahead = math.cos(turn) * dx + math.sin(turn) * dy
            u = max(-0.46, min(0.46, ahead / long + 0.01 * draft.whole(-8, 8, name, "off"))) * long
    low = draft.chance(0.6, name, "low", k)
    foot = draft.number(2.0, 4.2, name, "foot", k) if low else 0.5
    head = min(draft.number(5.0, 8.5, name, "head", k), 0.42 * long)
    z0 = 0.4 if low else round(STOREY_M * max(storeys - 2, 1) + 0.3, 1)
    return {
        "x": round(u, 2), "y": round(side * deep * 0.5, 2), "foot_m": min(foot, head), "head_m": round(head, 1),
        "z0_m": z0, "z1_m": round(max(STOREY_M * storeys, z0 + 2.0), 1), "seed": draft.whole(0, 99, name, "bite", k),
    }  # fmt: skip


def heap(draft: Draft, name: str, at: Point, radius_m: float, height_m: float) -> None:
    """Pile rubble up, and offer slots on and beside it (``rubble``)."""
    draft.areas[name] = {"blob": [*at, round(radius_m, 1), draft.whole(0, 999, name), 0.3]}
    draft.step("heap", area=name, height_m=height_m, seed=draft.whole(0, 999, name, "lumps"))
    draft.slot("rubble", *at, draft.number(0, 360, name), (3.4, 3.4), settle_m=0.5)
    for k in range(3):
        spot = ahead(at, 120.0 * k + draft.number(0, 90, name, "beside"), radius_m + 1.5)
        draft.slot("rubble", *spot, draft.number(0, 360, name, k), (4.6, 3.6), settle_m=0.5)


def _rooms(
    draft: Draft, pose: Pose, size_m: Point, name: str, storeys: int, bites: list[dict[str, float]]
) -> None:  # fmt: skip
    """Offer slots in rooms beside the first hole: each floor's nearest whole one."""
    long, deep = size_m
    count = max(round(long / 6.8), 1)
    middles = [(k + 0.5) * long / count - long / 2 for k in range(count)]
    for floor in range(1, storeys):
        z = floor * STOREY_M

        def whole(u: float, z: float = z) -> bool:
            holes = ((b, np.interp(z, [b["z0_m"], b["z1_m"]], [b["foot_m"], b["head_m"]])) for b in bites)
            return all(math.hypot(u - b["x"], b["y"]) > radius + 2.2 for b, radius in holes)

        rooms = sorted((u for u in middles if whole(u)), key=lambda u: abs(u - bites[0]["x"]))
        if rooms and draft.chance(0.7, name, "floor", floor):
            side = 1.0 if bites[0]["y"] > 0 else -1.0
            spot = beside(pose, rooms[0], side * deep * 0.12)
            draft.slot("torn", *spot, draft.number(0, 360, name, floor), (2.2, 2.2), on=f"{name} + {z:.1f} + 0.03")


def pancaked(draft: Draft, box: Box, name: str, floors: int) -> None:
    """Pile up the floors of a building that fell, with slots on the highest (``fallen``), rubble about it."""
    x, y = (round(v, 2) for v in box.middle)
    long, deep, yaw = max(box.width, box.depth), min(box.width, box.depth), 90.0 if box.upright else 0.0
    heap(draft, f"heap_{name}", (x, y), min(long, deep * 1.5) * 0.58, 1.1)
    draft.make("slab_pile", at=[x, y], yaw_deg=yaw, size_m=[round(long - 1.5, 1), round(deep - 1.5, 1)], count=floors,
               stream=name, wall=draft.material("wall", name), **{"as": name})  # fmt: skip
    for k in range(3):
        draft.slot("fallen", *beside((x, y, yaw), (k - 1) * long * 0.28, 0.0), yaw + 90.0 * k, (5.4, 3.4), on=name)
    draft.take(box.shape())


def littered(draft: Draft) -> None:
    """Paint the heaps, and strew loose pieces about them and over the site."""
    if heaps := _heaps(draft):
        brick = draft.material("wall", "bricks")
        draft.make("strew_about_heaps", heaps=heaps, spacing_m=1.5, margin_m=2.0, brick=brick)
    area = list(draft.site.grown(-2.0))
    draft.make("strew_chunks", area=area, spacing_m=4.2, stream="everywhere", size_m=[0.35, 0.8])


def _heaps(draft: Draft) -> list[str]:
    return [name for name in draft.areas if name.startswith("heap_")]


def poles(draft: Draft, lanes: Sequence[Box]) -> None:
    """Put up poles that lean along the longest street, with slack wires between."""
    lane = max(lanes, key=lambda one: max(one.width, one.depth))
    line = [(lane.x0 + 0.8, lane.y0 + f * lane.depth) if lane.upright else (lane.x0 + f * lane.width, lane.y0 + 0.8)
            for f in (0.1, 0.35, 0.6, 0.85)]  # fmt: skip
    leaning = [
        [round(x, 1), round(y, 1), draft.number(4, 15, "pole", k), draft.number(0, 359, "pole", k, "yaw")]
        for k, (x, y) in enumerate(line)
    ]
    draft.make("leaning_poles", poles=leaning)


def open_landmarks(draft: Draft, open_: Sequence[Box], shut: BaseGeometry) -> None:
    """Place landmarks on open ground, off what is shut."""
    draft.section("Landmarks")
    free = [p for box in open_ for p in box.grown(-2.6).grid(4.0) if not shut.intersects(shapely.Point(p))]
    draft.landmark([(*p, draft.pick(SIDES, "landmark", *p)) for p in draft.shuffled(free, "landmarks")])


def things(draft: Draft, kind: str, box: Box, step_m: float, room_m: Point) -> None:
    """Offer slots over a box, unevenly."""
    n_x, n_y = max(int(box.width // step_m), 1), max(int(box.depth // step_m), 1)
    for i, j in np.ndindex(n_x, n_y):
        rng = draft.rng("things", kind, i, j, *box)
        u, v = rng.uniform(-0.6, 0.6, 2)
        x, y = box.x0 + (i + 0.5) * box.width / n_x + u, box.y0 + (j + 0.5) * box.depth / n_y + v
        draft.slot(kind, float(x), float(y), float(rng.uniform(0, 360)), room_m, settle_m=0.5)
