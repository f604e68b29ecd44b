"""Blocks of flats for layouts: slabs with stacked balconies, an archway through the ground storey, things on top."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns, letters
from aerialdojo_gen.scenes.mesh import Mesh, merge
from aerialdojo_gen.scenes.site import Site

STOREY_M = 3.2
_DEPTH_M = 1.6
_WIDE_M = 3.2


@dataclass(frozen=True)
class Slab:
    """A block of flats.

    Attributes
    ----------
    frame : Frame
        Middle of its plan; u looks out of its front.
    length_m, depth_m : float
        Along the front, and from front to back.
    storeys : int
        Number of storeys over the open ground storey's head included.
    wall, band : str
        Materials of the walls and of the balconies.
    name : str
        What a person calls it, e.g. ``"block A"``; its last word stands on the front.
    arch_m : float
        Width of the passage through its middle.
    """

    frame: Frame
    length_m: float
    depth_m: float
    storeys: int
    wall: str
    band: str
    name: str
    arch_m: float = 6.0

    @property
    def top_m(self) -> float:
        """Height of the roof, metres."""
        return self.storeys * STOREY_M


def put_up(site: Site, slab: Slab) -> None:
    """Put a block of flats up, its middle open at the ground for one to fly through."""
    half, d, gap = slab.length_m / 2, slab.depth_m / 2, slab.arch_m / 2
    low = rectangle(-d, -half, d, -gap).union(rectangle(-d, gap, d, half))
    base = site.material("estate_base", "blocks:#8d867a")
    site.paint(slab.frame.area(rectangle(-d - 1.2, -gap, d + 4.5, gap)), site.material("plaza", "paving"))
    parts: Parts = [
        (base, block(-d, -half, d, -gap, 0.0, STOREY_M)),
        (base, block(-d, gap, d, half, 0.0, STOREY_M)),
        ("concrete", block(-d - 0.12, -half - 0.12, d + 0.12, half + 0.12, STOREY_M - 0.2, STOREY_M)),
        (slab.band, columns([(s * (d - 0.4), 0.0) for s in (-1, 1)], 0.0, STOREY_M - 0.2, 0.3)),
    ]
    for s in (-1, 1):
        for side in (-1, 1):
            v = side * (gap + (half - gap) / 2)
            parts.append(("window", _leaf(s * (d - 0.05), s * (d + 0.05), v - 0.8, v + 0.8, 0.0, 2.3)))
            parts.append((slab.band, _leaf(s * d, s * (d + 1.5), v - 1.4, v + 1.4, 2.5, 2.65)))
            for k in (-1, 1):
                w = v + k * (half - gap) * 0.3
                parts.append(("glass", _leaf(s * (d - 0.05), s * (d + 0.04), w - 0.7, w + 0.7, 1.0, 2.2)))
    site.add(None, "flats_base", slab.frame.parts(parts), {"place": slab.name}, footprint=slab.frame.area(low))
    plan = slab.frame.area(rectangle(-d, -half, d, half))
    sign: Parts = [
        ("marking", letters(slab.name.split()[-1], 1.8, (d + 0.02, half - 2.4, slab.top_m - 2.6), 0.0, 0.08))
    ]
    building(site, plan, wall=slab.wall, roof="gravel:#a09a90",
        storeys=slab.storeys - 1, storey_m=STOREY_M, z=STOREY_M,
             category="flats", attributes={"place": slab.name}, extra=[*slab.frame.parts(sign),
                 *_balconies(slab)])  # fmt: skip


def balcony_spots(slab: Slab) -> list[tuple[float, float]]:
    """List the middles of the front's balconies along the wall, and the heights of their floors, metres."""
    count = int((slab.length_m - 2.0) // 6.4)
    along = [(k - (count - 1) / 2) * 6.4 for k in range(count)]
    return [(v, STOREY_M * (s + 1)) for s in range(slab.storeys - 1) for v in along]


def furnish_balconies(site: Site, slab: Slab, things: Sequence[str]) -> None:
    """Stand things on some of the front's balconies, spread over the storeys and along the wall."""
    spots = balcony_spots(slab)
    step = max(len(spots) // max(len(things), 1), 1)
    for k, thing in enumerate(things):
        v, z = spots[(k * step + k) % len(spots)]
        x, y, yaw = slab.frame.pose(slab.depth_m / 2 + _DEPTH_M * 0.5, v, 90.0 if thing == "bicycle" else 0.0)
        put(site, thing, x, y, yaw, f"on a balcony of {slab.name}", z=z, solid=False)


def furnish_roof(site: Site, slab: Slab, things: Sequence[str]) -> None:
    """Stand things on the roof, in a line along its middle."""
    for k, thing in enumerate(things):
        v = (k + 0.5 - len(things) / 2) * (slab.length_m - 3.0) / len(things)
        put(site, thing, *slab.frame.pose(0.0, v, 30.0 * k), place=f"on the roof of {slab.name}", z=slab.top_m)


def _balconies(slab: Slab) -> Parts:
    d = slab.depth_m / 2
    floors, panels, doors = [], [], []
    for v, z in balcony_spots(slab):
        a, b = v - _WIDE_M / 2, v + _WIDE_M / 2
        floors.append(block(d, a, d + _DEPTH_M, b, z - 0.2, z))
        # Bars in place of parapets: what stands on a balcony is seen.
        for low, high in ((0.0, 0.16), (0.42, 0.46), (0.69, 0.73), (0.94, 1.02)):
            panels.append(block(d + _DEPTH_M - 0.08, a, d + _DEPTH_M, b, z + low, z + high))
            panels += [block(d, w, d + _DEPTH_M - 0.08, w + 0.06, z + low, z + high) for w in (a, b - 0.06)]
        corners = [block(d + _DEPTH_M - 0.08, w, d + _DEPTH_M, w + 0.08, z, z + 1.0) for w in (a, b - 0.08)]
        panels += corners
        doors.append(block(d - 0.05, v - 1.1, d + 0.05, v + 1.1, z, z + 2.2))
    return slab.frame.parts([("concrete", merge(floors)), (slab.band, merge(panels)), ("glass", merge(doors))])


def _leaf(x0: float, x1: float, y0: float, y1: float, z0: float, z1: float) -> Mesh:
    return block(min(x0, x1), y0, max(x0, x1), y1, z0, z1)
