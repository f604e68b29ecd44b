"""What gardens are laid out with: beds of vegetables, glasshouses."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.structures import Parts, block
from aerialdojo_gen.scenes.mesh import merge, rotated, rotation, translated
from aerialdojo_gen.scenes.plans.values import At, Material, Number
from aerialdojo_gen.scenes.shapes_extruded import prism
from aerialdojo_gen.scenes.site import Site


@site_builder
def vegetable_beds(
    site: Site, *, at: list[At], greens: Annotated[list[Material], Field(min_length=1)], soil: Material = "soil",
    edge: Material = "wood",
) -> None:  # fmt: skip
    """Lay out raised beds of three rows about points; the greens, each higher than the last, are dealt in turn."""
    for k, (x, y) in enumerate(at):
        plan = rectangle(x - 1.5, y - 1.0, x + 1.5, y + 1.0)
        site.paint(plan, soil, 0.25, edge)
        n = k % len(greens)
        rows = [block(x - 1.3, y - 0.75 + 0.55 * r, x + 1.3, y - 0.5 + 0.55 * r, 0.2, 0.45 + 0.12 * n)
                for r in range(3)]  # fmt: skip
        site.add(None, "vegetable_bed", [(greens[n], merge(rows))], footprint=plan)


@site_builder
def glasshouse(
    site: Site, *, at: At, size_m: tuple[Number, Number] = (4.4, 6.0), pane: Material = "glass:#a9c6c0",
    frame: Material = "#e9ece6", base: Material = "stone",
) -> None:  # fmt: skip
    """Put up a glasshouse with a gable roof along y, closed towards -y; one may stand things in it."""
    (x, y), (w, half) = at, (size_m[0] / 2, size_m[1] / 2)
    sides = (x - w, x + w)
    gable = rotated(prism(size=(size_m[1], size_m[0], 1.5)), rotation(0.0, 0.0, 90.0))
    posts = [(u, y + v) for u in sides for v in (-half, -half / 3, half / 3, half)]
    parts: Parts = [
        (pane, translated(gable, (x, y, 2.0))),
        (frame, merge([block(x - w - 0.1, y - half - 0.1, x + w + 0.1, y - half + 0.02, 1.9, 2.06),
                       block(x - w - 0.1, y + half - 0.02, x + w + 0.1, y + half + 0.1, 1.9, 2.06)])),
        (frame, merge([block(u - 0.06, v - 0.06, u + 0.06, v + 0.06, 0.0, 2.0) for u, v in posts])),
        (pane, merge([block(u - 0.03, y - half, u + 0.03, y + half, 0.25, 1.95) for u in sides])),
        (pane, block(x - w, y - half - 0.03, x + w, y - half + 0.03, 0.25, 1.95)),
        (base, merge([block(u - 0.1, y - half, u + 0.1, y + half, 0.0, 0.25) for u in sides])),
    ]  # fmt: skip
    site.add(None, "glasshouse", parts, {"material": "glass"})
    for u in sides:
        site.occupy(rectangle(u - 0.2, y - half - 0.1, u + 0.2, y + half + 0.1))
