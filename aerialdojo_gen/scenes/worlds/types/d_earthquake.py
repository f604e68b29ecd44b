"""Towns after an earthquake: torn, leaning and fallen buildings, rubble, faults, and those who help."""

from __future__ import annotations

import shapely

from aerialdojo_gen.scenes.worlds import wrecked
from aerialdojo_gen.scenes.worlds.blocks import about_square, avenue, estate, town
from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import Box, heading, point, smoothed


def write(draft: Draft) -> None:
    """Lay the town out, let the fault run through it, then wreck its buildings, and set up camp where it is open."""
    lots, lanes, open_ = wrecked.built_up(draft, _TOPOLOGIES[draft.topology], 0.3, (26, 36))
    fault = _fault(draft, *draft.half)
    for lane in lanes:
        draft.take(lane.shape())
    wrecked.open_landmarks(draft, open_, fault.buffer(5.0))
    draft.section("What is left of the buildings")
    for k, lot in enumerate(draft.shuffled(lots, "lots")):
        _ruin(draft, lot, k, fault)
    wrecked.camp(draft, open_)
    draft.fill_slots()
    draft.section("Poles and loose pieces")
    wrecked.poles(draft, lanes)
    wrecked.littered(draft)


def _fault(draft: Draft, w: float, d: float) -> shapely.LineString:
    """Let the ground on one side of a line through the site sink, with cracks about it."""
    far = draft.number(0.3, 0.6, "tilt") * d
    bends = [(-1.4, -1.0), (-0.5, -0.3), (0.1, 0.2), (0.6, 0.35), (1.4, 1.0)]
    points = [point(f * w, s * far + draft.number(-4, 4, "fault", k)) for k, (f, s) in enumerate(bends)]
    line = smoothed(points, 0)
    drop = draft.number(0.7, 1.8, "drop") * (1.6 if draft.topology == "scarp" else 1.0)
    draft.step("fault", path=points, drop_m=round(drop, 2), width_m=1.4)
    slips = [{"blob": [*point(*heading(line, 9.0 * k)[:2]), 1.5, k, 0.4]} for k in range(2, int(line.length // 9))]
    draft.make("scarp", path=points, width_m=2.0, material=draft.material("earth"), slips=slips)
    starts = []
    for k in range(8):
        p = line.interpolate(draft.number(0.2, 0.8, "crack", k), normalized=True)
        starts.append([*point(p.x, p.y), draft.number(0, 360, "crack", k, "yaw")])
    draft.make("cracks", starts=starts, length_m=9, seed=draft.whole(0, 99, "cracks"))
    return line


def _ruin(draft: Draft, lot: Box, k: int, fault: shapely.LineString) -> None:
    """Put what is left of a building on a lot, or rubble alone where the fault runs."""
    name, storeys = f"block_{k}", max(2, round(draft.knob("storeys")) - draft.whole(0, 2, "storeys", k))
    box = wrecked.shallow(draft, lot, k, 12.5, draft.chance(0.5, "front", k))
    if fault.distance(box.shape()) < 1.5:
        wrecked.flattened(draft, box, k, name, 0.45, bool(k % 2))
    elif draft.chance(0.22, "fallen", k):
        wrecked.pancaked(draft, box, name, storeys + 1)
    elif draft.chance(0.25, "leans", k):
        wrecked.wreck(draft, box, name, storeys, 1, lean_deg=draft.number(3, 8, "lean", k))
    else:
        wrecked.wreck(draft, box, name, storeys, draft.whole(1, 2, "torn", k))


_TOPOLOGIES = {
    "town": town, "square": about_square, "avenue": avenue, "scarp": town, "estate": estate,
}  # fmt: skip
