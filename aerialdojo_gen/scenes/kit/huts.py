"""Huts by the water: thatched ones on stilts, boathouses, racks for drying fish."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from aerialdojo_gen.scenes.grammar_buildings import pitched_roof
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.quays import bars
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns, stairs
from aerialdojo_gen.scenes.mesh import Mesh, merge, translated
from aerialdojo_gen.scenes.plans.values import Material, Number
from aerialdojo_gen.scenes.shapes import box
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

_Pose = tuple[Number, Number, Number]
_Walls = Annotated[list[Material], Field(min_length=1)]


@site_builder
def stilt_huts(
    site: Site, *, at: list[_Pose], walls: _Walls, on: Number | None = None, width_m: Number = 5.0,
    depth_m: Number = 4.4, porch_m: Number = 1.8, roof: Material = "thatch", trim: Material = "#e9dcc0",
    steps: bool = True,
) -> None:  # fmt: skip
    """Put up thatched huts on stilts, each with a porch in front and steps down from it, of the walls in turn.

    `at` gives the middle of the room and where the door looks; the floor is at `on`, or 0.9 m above the ground.
    """
    d, w, front = depth_m / 2, width_m / 2, depth_m / 2 + porch_m
    for number, (x, y, yaw_deg) in enumerate(at):
        frame, wall = Frame(x, y, yaw_deg), walls[number % len(walls)]
        floor = site.ground_z(x, y) + 0.9 if on is None else on
        ground = min(site.ground_z(*frame.at(u, v)) for u in (-d, front) for v in (-w, w))
        parts = _stilts(d, w, front, ground, floor) + _room(d, w, front, floor, wall, roof, trim)
        plan = rectangle(-d - 0.2, -w - 0.2, front + 0.1, w + 0.2)
        if steps:
            foot = front + 0.9 * (floor - ground) + 0.3
            base = site.ground_z(*frame.at(foot, 0.0))
            parts += stairs((foot, 0.0), 180.0, 1.3, floor - base, foot - front, z_m=base, tread="planks",
                            stringer="wood")  # fmt: skip
            plan = plan.union(rectangle(front, -0.8, foot, 0.8))
        site.add(None, "thatched_hut", frame.parts(parts), footprint=frame.area(plan))


def _stilts(d: float, w: float, front: float, ground: float, floor: float) -> Parts:
    feet = [(u, v) for u in (-d + 0.2, 0.0, d, front - 0.15) for v in (-w + 0.2, w - 0.2)]
    return [
        ("boards:#b0956a", block(-d - 0.1, -w - 0.1, front, w + 0.1, floor - 0.16, floor)),
        ("logs:#7a6248", columns(feet, ground - 0.8, floor - 0.16, 0.13, 7)),
    ]


def _room(d: float, w: float, front: float, z: float, wall: str, roof: str, trim: str) -> Parts:
    head = z + 2.3
    parts: Parts = [
        (wall, block(-d, -w, d, w, z, head)),
        ("planks:#6f5238", block(d, -0.5, d + 0.06, 0.5, z, z + 1.95)),
        (trim, block(d - 0.02, -0.62, d + 0.04, 0.62, z, z + 2.08)),
        ("logs:#7a6248", columns([(front - 0.15, -w + 0.2), (front - 0.15, w - 0.2)], z, head + 0.1, 0.07, 6)),
    ]
    u = -0.4 * d
    shutters = [block(u - 0.55, s * w - 0.05, u + 0.55, s * w + 0.05, z + 0.85, z + 1.75) for s in (-1, 1)]
    shutters += [
        block(d - 0.02, s * 0.62 * w - 0.45, d + 0.05, s * 0.62 * w + 0.45, z + 0.85, z + 1.75) for s in (-1, 1)
    ]
    parts.append(("window", merge(shutters)))
    parts += pitched_roof(rectangle(-d, -w, front, w), head, 1.9, wall, roof, hip=True, overhang_m=0.6)
    parts += bars([(front - 0.06, -w), (front - 0.06, -0.8)], z, "wood", 0.85)
    parts += bars([(front - 0.06, 0.8), (front - 0.06, w)], z, "wood", 0.85)
    for s in (-1, 1):
        parts += bars([(d + 0.1, s * w), (front - 0.06, s * w)], z, "wood", 0.85)
    return parts


@site_builder
def boathouses(
    site: Site, *, at: list[_Pose], walls: _Walls, on: Number, width_m: Number = 4.6, depth_m: Number = 7.0,
    roof: Material = "shingles:#55504c", trim: Material = "#efe9dc",
) -> None:  # fmt: skip
    """Put up boathouses whose open fronts look over the water: three walls, a gable roof, posts below the floor."""
    d, w, head = depth_m / 2, width_m / 2, on + 2.6
    for number, pose in enumerate(at):
        frame, wall = Frame(*pose), walls[number % len(walls)]
        ground = min(site.ground_z(*frame.at(u, v)) for u in (-d, d) for v in (-w, w))
        feet = [(u, v) for u in (-d + 0.2, 0.0, d + 0.5) for v in (-w + 0.2, w - 0.2)]
        sides = (-1, 1)
        parts: Parts = [
            ("boards:#8c7a60", block(-d, -w, d + 0.8, w, on - 0.18, on)),
            ("logs:#5f4f3e", columns(feet, min(ground, 0.0) - 0.8, on - 0.18, 0.15, 7)),
            (wall, merge([block(-d, -w, d, -w + 0.14, on, head), block(-d, w - 0.14, d, w, on, head),
                          block(-d, -w + 0.14, -d + 0.14, w - 0.14, on, head)])),
            (trim, merge([block(d - 0.1, s * w - 0.1, d + 0.06, s * w + 0.1, on, head) for s in sides])),
            (trim, merge([block(-0.6, s * w - 0.04, 0.6, s * w + 0.04, on + 0.9, on + 1.9) for s in sides])),
            ("window", merge([block(-0.5, s * w - 0.06, 0.5, s * w + 0.06, on + 1.0, on + 1.8) for s in sides])),
        ]  # fmt: skip
        parts += pitched_roof(rectangle(-d, -w, d, w), head, 1.8, wall, roof, overhang_m=0.4)
        plan = rectangle(-d, -w, d + 0.8, w)
        site.add(None, "boathouse", frame.parts(parts), footprint=frame.area(plan))


@site_builder
def drying_racks(
    site: Site, *, at: list[_Pose], length_m: Annotated[Number, Field(ge=0.8, le=100)], fish: Material = "#b8a58a"
) -> None:
    """Put up racks of trestles and poles, 3 m high, with fish hung up to dry; one can fly through below."""
    half, high = length_m / 2, 2.9
    wood: list[Mesh] = []
    for u in (-half, 0.0, half):
        for s in (-1, 1):
            wood.append(sweep(path=[(u, s * 1.2, -0.3), (u, -s * 0.15, high + 0.2)], radius=0.06, sides=5))
    for v, h in ((0.0, high), (-0.45, 2.1), (0.45, 2.1)):
        wood.append(sweep(path=[(-half - 0.4, v, h), (half + 0.4, v, h)], radius=0.045, sides=5))
    hung = [
        translated(box(size=(0.05, 0.14, 0.42), taper=(1.0, 0.4)), (-half + (k + 0.5) * 0.4, v, 2.1 - 0.44))
        for k in range(int(length_m / 0.4))
        for v in (-0.45, 0.45)
    ]
    parts: Parts = [("wood:#8d8171", merge(wood)), (fish, merge(hung))]
    plan = rectangle(-half - 0.4, -1.3, half + 0.4, 1.3)
    for pose in at:
        frame = Frame(*pose)
        z = site.ground_z(frame.x, frame.y)
        site.add(None, "drying_rack", frame.parts(parts, z), footprint=frame.area(plan))
