"""Houses of a style, one by one or in rows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle, house
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.plans.values import At, Material, Number
from aerialdojo_gen.scenes.site import Site


@site_builder
def house_row(
    site: Site, *, at: list[At], yaw_deg: Number, style: HouseStyle, on: Number | None = None,
    walls: tuple[Material, ...] = (), roofs: tuple[Material, ...] = (), doors: tuple[Material, ...] = (),
    storeys: tuple[int, ...] = (), chimneys: tuple[bool, ...] = (),
) -> None:  # fmt: skip
    """Put up houses of a style; each takes the next of the walls, roofs, doors, storeys and chimneys, in turn."""
    varied = {"wall": walls, "roof": roofs, "door": doors, "storeys": storeys, "chimney": chimneys}
    for k, point in enumerate(at):
        own: dict[str, Any] = {key: values[k % len(values)] for key, values in varied.items() if values}
        house(site, Frame(*point, yaw_deg), replace(style, **own), z=on)
