"""Huts by the water: thatched ones on stilts, boathouses with a slip, racks for drying fish."""

from __future__ import annotations

from shapely.geometry import Polygon

from aerialdojo_gen.scenes.grammar_buildings import pitched_roof
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns, stairs
from aerialdojo_gen.scenes.layouts.natural.parts.quays import bars
from aerialdojo_gen.scenes.mesh import Mesh, merge, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.shapes import box
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site


def stilt_hut(
    site: Site,
    frame: Frame,
    floor_m: float,
    *,
    width_m: float = 5.0,
    depth_m: float = 4.4,
    porch_m: float = 1.8,
    wall: str = "planks:#a5804f",
    roof: str = "thatch",
    trim: str = "#e9dcc0",
    steps: bool = True,
) -> Instance:
    """Put up a thatched hut on stilts with a porch in front (towards u) and steps down from it.

    Parameters
    ----------
    site : Site
        Where.
    frame : Frame
        Middle of its room; u looks out of its door.
    floor_m : float
        z of its floor.
    width_m, depth_m, porch_m : float
        Of the room, and of the porch's deck before it.
    wall, roof, trim : str
        Materials.
    steps : bool
        Whether steps lead down; a hut at a boardwalk has none.
    """
    d, w, front = depth_m / 2, width_m / 2, depth_m / 2 + porch_m
    ground = min(site.ground_z(*frame.at(u, v)) for u in (-d, front) for v in (-w, w))
    head = floor_m + 2.3
    feet = [(u, v) for u in (-d + 0.2, 0.0, d, front - 0.15) for v in (-w + 0.2, w - 0.2)]
    parts: Parts = [
        ("boards:#b0956a", block(-d - 0.1, -w - 0.1, front, w + 0.1, floor_m - 0.16, floor_m)),
        ("logs:#7a6248", columns(feet, ground - 0.8, floor_m - 0.16, 0.13, 7)),
        (wall, block(-d, -w, d, w, floor_m, head)),
        ("planks:#6f5238", block(d, -0.5, d + 0.06, 0.5, floor_m, floor_m + 1.95)),
        (trim, block(d - 0.02, -0.62, d + 0.04, 0.62, floor_m, floor_m + 2.08)),
        ("logs:#7a6248", columns([(front - 0.15, -w + 0.2), (front - 0.15, w - 0.2)], floor_m, head + 0.1, 0.07, 6)),
    ]
    shutters = [block(u - 0.55, s * w - 0.05, u + 0.55, s * w + 0.05, floor_m + 0.85, floor_m + 1.75)
                for u in (-0.4 * d,) for s in (-1, 1)]  # fmt: skip
    shutters += [block(d - 0.02, s * 0.62 * w - 0.45, d + 0.05, s * 0.62 * w + 0.45, floor_m + 0.85, floor_m + 1.75)
                 for s in (-1, 1)]  # fmt: skip
    parts.append(("window", merge(shutters)))
    cover = rectangle(-d, -w, front, w)
    parts += pitched_roof(cover, head, 1.9, wall, roof, hip=True, overhang_m=0.6)
    rail = bars([(front - 0.06, -w), (front - 0.06, -0.8)], floor_m, "wood", 0.85)
    rail += bars([(front - 0.06, 0.8), (front - 0.06, w)], floor_m, "wood", 0.85)
    for s in (-1, 1):
        rail += bars([(d + 0.1, s * w), (front - 0.06, s * w)], floor_m, "wood", 0.85)
    parts += rail
    plan: Polygon = rectangle(-d - 0.2, -w - 0.2, front + 0.1, w + 0.2)
    if steps:
        foot = front + 0.9 * (floor_m - ground) + 0.3
        base = site.ground_z(*frame.at(foot, 0.0))
        flight = stairs(
            (foot, 0.0), 180.0, 1.3, floor_m - base, foot - front, z_m=base, tread="planks", stringer="wood"
        )
        parts += flight
        plan = plan.union(rectangle(front, -0.8, foot, 0.8))
    return site.add(None, "thatched_hut", frame.parts(parts), footprint=frame.area(plan))


def boathouse(
    site: Site,
    frame: Frame,
    floor_m: float,
    *,
    width_m: float = 4.6,
    depth_m: float = 7.0,
    wall: str = "planks:#9c3a2e",
    roof: str = "shingles:#55504c",
    trim: str = "#efe9dc",
) -> Instance:
    """Put up a boathouse whose open front looks along u over the water: three walls, a gable roof, posts below."""
    d, w, head = depth_m / 2, width_m / 2, floor_m + 2.6
    ground = min(site.ground_z(*frame.at(u, v)) for u in (-d, d) for v in (-w, w))
    parts: Parts = [
        ("boards:#8c7a60", block(-d, -w, d + 0.8, w, floor_m - 0.18, floor_m)),
        ("logs:#5f4f3e", columns([(u, v) for u in (-d + 0.2, 0.0, d + 0.5) for v in (-w + 0.2, w - 0.2)],
                                 min(ground, 0.0) - 0.8, floor_m - 0.18, 0.15, 7)),
        (wall, merge([block(-d, -w, d, -w + 0.14, floor_m, head), block(-d, w - 0.14, d, w, floor_m, head),
                      block(-d, -w + 0.14, -d + 0.14, w - 0.14, floor_m, head)])),
        (trim, merge([block(d - 0.1, s * w - 0.1, d + 0.06, s * w + 0.1, floor_m, head) for s in (-1, 1)])),
        (trim, merge([block(-0.6, s * w - 0.04, 0.6, s * w + 0.04, floor_m + 0.9, floor_m + 1.9) for s in (-1, 1)])),
        ("window", merge([block(-0.5, s * w - 0.06, 0.5, s * w + 0.06, floor_m + 1.0, floor_m + 1.8)
                          for s in (-1, 1)])),
    ]  # fmt: skip
    parts += pitched_roof(rectangle(-d, -w, d, w), head, 1.8, wall, roof, overhang_m=0.4)
    plan = rectangle(-d, -w, d + 0.8, w)
    return site.add(None, "boathouse", frame.parts(parts), footprint=frame.area(plan))


def drying_rack(site: Site, frame: Frame, length_m: float, fish: str = "#b8a58a") -> Instance:
    """Put up a rack of trestles and poles, 3 m high, with fish hung up to dry; one can fly through below."""
    z = site.ground_z(frame.x, frame.y)
    half, high = length_m / 2, 2.9
    wood: list[Mesh] = []
    for u in (-half, 0.0, half):
        for s in (-1, 1):
            wood.append(sweep(path=[(u, s * 1.2, -0.3), (u, -s * 0.15, high + 0.2)], radius=0.06, sides=5))
    for v, h in ((0.0, high), (-0.45, 2.1), (0.45, 2.1)):
        wood.append(sweep(path=[(-half - 0.4, v, h), (half + 0.4, v, h)], radius=0.045, sides=5))
    count = int(length_m / 0.4)
    hung = [
        translated(box(size=(0.05, 0.14, 0.42), taper=(1.0, 0.4)), (-half + (k + 0.5) * 0.4, v, 2.1 - 0.44))
        for k in range(count)
        for v in (-0.45, 0.45)
    ]
    parts: Parts = [("wood:#8d8171", merge(wood)), (fish, merge(hung))]
    plan = rectangle(-half - 0.4, -1.3, half + 0.4, 1.3)
    return site.add(None, "drying_rack", frame.parts(parts, z), footprint=frame.area(plan))
