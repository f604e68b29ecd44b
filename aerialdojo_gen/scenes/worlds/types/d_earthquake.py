"""Towns after an earthquake: torn, leaning and fallen buildings, rubble, faults, and those who help."""

from __future__ import annotations

from collections.abc import Callable

import shapely

from aerialdojo_gen.scenes.worlds.blocks import Layout, about_square, avenue, estate, lane_streets, town
from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.streets import Box
from aerialdojo_gen.scenes.worlds.wilds import point, rolling, smoothed, step
from aerialdojo_gen.scenes.worlds.wrecked import (
    heap,
    littered,
    open_landmarks,
    paint_heaps,
    pancaked,
    poles,
    things,
    wreck,
)


def write(draft: Draft) -> None:
    """Lay the town out, let the fault run through it, then wreck its buildings, and set up camp where it is open."""
    w, d = draft.width_m / 2, draft.depth_m / 2
    rolling(draft, 0.3, (26, 36), 1.6)
    draft.level_things = False
    lots, lanes, open_ = _TOPOLOGIES[draft.topology](draft, w, d)
    draft.section("Streets and open ground")
    for box in open_:
        draft.paint(box.rounded(), draft.material("square", *box))
    for box in lots:
        draft.paint(box.grown(-0.5).rounded(), draft.material("yard", *box))
    lane_streets(draft, lanes)
    fault = _fault(draft, w, d)
    for lane in lanes:
        draft.take(lane.shape())
    open_landmarks(draft, open_, fault.buffer(5.0))
    draft.section("What is left of the buildings")
    for k, lot in enumerate(draft.shuffled(lots, "lots")):
        _ruin(draft, lot, k, fault)
    for box in open_:
        things(draft, "camp", box.grown(-2.5), 6.2, (7.4, 7.0))
        things(draft, "small", box.grown(-1.5), 4.8, (2.4, 2.6))
    draft.section("Rubble")
    paint_heaps(draft)
    draft.fill_slots()
    draft.section("Poles and loose pieces")
    poles(draft, lanes)
    littered(draft)


def _fault(draft: Draft, w: float, d: float) -> shapely.LineString:
    """Let the ground on one side of a line through the site sink, with cracks about it."""
    far = draft.number(0.3, 0.6, "tilt") * d
    bends = [(-1.4, -1.0), (-0.5, -0.3), (0.1, 0.2), (0.6, 0.35), (1.4, 1.0)]
    points = [point(f * w, s * far + draft.number(-4, 4, "fault", k)) for k, (f, s) in enumerate(bends)]
    line = smoothed(points, 0)
    drop = draft.number(0.7, 1.8, "drop") * (1.6 if draft.topology == "scarp" else 1.0)
    step(draft, "fault", path=[list(p) for p in points], drop_m=round(drop, 2), width_m=1.4)
    slips = [{"blob": [round(line.interpolate(9.0 * k).x, 1), round(line.interpolate(9.0 * k).y, 1), 1.5, k, 0.4]}
             for k in range(2, int(line.length // 9))]  # fmt: skip
    draft.make("scarp", path=[list(p) for p in points], width_m=2.0, material=draft.material("earth"), slips=slips)
    starts = []
    for k in range(8):
        p = line.interpolate(draft.number(0.2, 0.8, "crack", k), normalized=True)
        starts.append([round(p.x, 1), round(p.y, 1), draft.number(0, 360, "crack", k, "yaw")])
    draft.make("cracks", starts=starts, length_m=9, seed=draft.whole(0, 99, "cracks"))
    return line


def _ruin(draft: Draft, lot: Box, k: int, fault: shapely.LineString) -> None:
    """Put what is left of a building on a lot, or rubble alone where the fault runs."""
    name, storeys = f"block_{k}", max(2, round(draft.knob("storeys")) - draft.whole(0, 2, "storeys", k))
    deep = min(lot.width, lot.depth) - 3.0
    box = lot.grown(-1.5)
    if deep > 12.5:
        cut = deep - draft.number(10.0, 12.5, "deep", k)
        low = draft.chance(0.5, "front", k)
        x0, y0, x1, y1 = box
        box = (Box(x0, y0 + (0 if low else cut), x1, y1 - (cut if low else 0)) if box.width >= box.depth
               else Box(x0 + (0 if low else cut), y0, x1 - (cut if low else 0), y1))  # fmt: skip
        rest = lot.grown(-1.5).shape().difference(box.grown(1.5).shape())
        if rest.area > 20.0:
            things(draft, "yard", Box(*rest.bounds), 5.2, (3.8, 3.8))
    if fault.distance(box.shape()) < 1.5:
        x, y = box.middle
        if k % 2:
            heap(
                draft,
                f"heap_{name}",
                point(x, y),
                min(box.width, box.depth) * 0.45,
                draft.number(1.2, 2.2, "heap", k),
            )
        things(draft, "yard", box, 5.2, (3.8, 3.8))
        return
    if draft.chance(0.22, "fallen", k):
        pancaked(draft, box, name, storeys + 1)
    elif draft.chance(0.25, "leans", k):
        wreck(draft, box, name, storeys, 1, lean_deg=draft.number(3, 8, "lean", k))
    else:
        wreck(draft, box, name, storeys, draft.whole(1, 2, "torn", k))


_TOPOLOGIES: dict[str, Callable[[Draft, float, float], Layout]] = {
    "town": town, "square": about_square, "avenue": avenue, "scarp": town, "estate": estate,
}  # fmt: skip
