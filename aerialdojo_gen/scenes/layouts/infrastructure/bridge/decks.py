"""Bridge decks that run along x with their road at z = 0: roadway, footways, edge beams, marks, parapets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, railing
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site

FOOTWAY_M = 0.12


@dataclass(frozen=True)
class Deck:
    """A deck.

    Attributes
    ----------
    x0_m, x1_m : float
        Its ends.
    road_m, half_m : float
        Half widths of the roadway and of the whole.
    depth_m : float
        Height of its edge beams.
    girder : str
        Material of beams and girders.
    girders : tuple of float
        Where girders run below it, y in metres.
    girder_m : float
        How far they reach below the road.
    """

    x0_m: float
    x1_m: float
    road_m: float
    half_m: float
    depth_m: float = 1.0
    girder: str = "concrete"
    girders: tuple[float, ...] = ()
    girder_m: float = 1.4

    def parts(self, holes: Sequence[BaseGeometry] = (), pavement: str = "paving:#b3a899") -> Parts:
        """Make the deck without its parapets; `holes` (plans) are left open."""
        x0, x1, h, r = self.x0_m, self.x1_m, self.half_m, self.road_m
        sheet: BaseGeometry = rectangle(x0, -h, x1, h)
        for hole in holes:
            sheet = sheet.difference(hole)
        road = rectangle(x0, -r, x1, r)
        ways = sheet.difference(road)
        beams = rectangle(x0, -h, x1, h).difference(rectangle(x0, -h + 0.5, x1, h - 0.5))
        for hole in holes:
            beams = beams.difference(hole)
        below = [slab(p, -self.depth_m, -0.35) for p in _pieces(beams)]
        below += [block(x0, y - 0.3, x1, y + 0.3, -self.girder_m, -0.35) for y in self.girders]
        cross = [block(x - 0.15, -h + 0.4, x + 0.15, h - 0.4, -self.depth_m + 0.1, -0.35)
                 for x in np.arange(x0 + 2.0, x1 - 1.0, 4.0)]  # fmt: skip
        under = sheet.difference(rectangle(x0 - 1, -r - 0.02, x1 + 1, r + 0.02)).buffer(-0.01, join_style="mitre")
        marks = [block(x, -0.08, x + 2.0, 0.08, -0.03, 0.008) for x in np.arange(x0 + 1.5, x1 - 2.0, 5.0)]
        marks += [block(x0, s * (r - 0.25) - 0.07, x1, s * (r - 0.25) + 0.07, -0.03, 0.008) for s in (-1, 1)]
        return [
            (self.girder, merge([*below, *cross])),
            ("asphalt", slab(road, -0.35, 0.0)),
            ("concrete", merge([slab(p, -0.35, -0.05) for p in _pieces(under)])),
            (pavement, merge([slab(p, -0.05, FOOTWAY_M) for p in _pieces(ways)])),
            ("marking", merge(marks)),
        ]

    def parapets(
        self,
        frame: str,
        gaps: Sequence[tuple[float, float, int]] = (),
        inset_m: float = 0.25,
        pane: str = "chain_link",
    ) -> Parts:
        """Make railings along both edges, open at `gaps`: (from x, to x, side -1 or 1)."""
        parts: Parts = []
        for side in (-1, 1):
            y, x = side * (self.half_m - inset_m), self.x0_m
            for a, b, _ in sorted(g for g in (*gaps, (self.x1_m, self.x1_m, side)) if g[2] == side):
                if a > x:
                    parts += railing([(x, y), (a, y)], FOOTWAY_M, height_m=1.15, pane=pane, frame=frame)
                x = b
        return parts


def approach(site: Site, x0: float, x1: float, road_m: float, half_m: float) -> None:
    """Paint the road before a bridge on level ground at z = 0, as wide as the deck."""
    site.paint(rectangle(x0, -half_m, x1, half_m), site.material("footway", "paving:#b3a899"), FOOTWAY_M)
    site.paint(rectangle(x0, -road_m, x1, road_m), "asphalt")
    for side in (-1, 1):
        y = side * (road_m - 0.25)
        site.paint(rectangle(x0, y - 0.07, x1, y + 0.07), "marking")
    for x in np.arange(x0 + 1.5, x1 - 2.0, 5.0):
        site.paint(rectangle(x, -0.08, x + 2.0, 0.08), "marking")


def _pieces(area: BaseGeometry) -> list[BaseGeometry]:
    return [p for p in getattr(area, "geoms", [area]) if p.area > 1e-4]
