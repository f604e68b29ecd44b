"""Houses of a style, one by one or in rows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle, house
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import At, Material, Number
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
