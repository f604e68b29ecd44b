"""What closes and covers stands: outer walls with gateways, walls at their ends, platforms, roofs on trusses.

Every function returns meshes in world coordinates with their materials, to be given to `Site.add`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.kit.structures import Parts, block
from aerialdojo_gen.scenes.layouts.urban.stadium.stands import Tier
from aerialdojo_gen.scenes.mesh import Mesh, merge
from aerialdojo_gen.scenes.shapes_extruded import sweep


def end_walls(tier: Tier, strip: BaseGeometry) -> Mesh:
    """Close a tier's end: a stepped wall in a strip across its rows, up to a handrail's height over each."""
    bodies = []
    for row in range(tier.rows):
        area = tier.band(row).intersection(strip)
        bodies += [slab(p, tier.foot_m, tier.level_m(row) + 0.8) for p in polygons_of(area)]
    return merge(bodies)


def back_wall(
    tier: Tier,
    z_m: float,
    openings: Sequence[Polygon],
    head_m: float,
    *,
    wall: str,
    band: str,
    thickness_m: float = 0.3,
) -> Parts:
    """Make the outer wall behind a tier's last row, with gateways that one can fly through, and a cornice."""
    ring = tier.edge(tier.rows).buffer(thickness_m, join_style="mitre").difference(tier.edge(tier.rows))
    cornice = tier.edge(tier.rows).buffer(thickness_m + 0.2, join_style="mitre").difference(tier.edge(tier.rows))
    gates = unary_union(openings)
    if tier.region is not None:
        ring, cornice = ring.intersection(tier.region), cornice.intersection(tier.region)
    walls = [slab(p, tier.foot_m, z_m) for p in polygons_of(ring.difference(gates))]
    walls += [slab(p, tier.foot_m + head_m, z_m) for p in polygons_of(ring.intersection(gates))]
    frames = unary_union([g.buffer(0.25, join_style="mitre").difference(g) for g in openings]).intersection(cornice)
    trims = [slab(p, z_m - 0.45, z_m + 0.12) for p in polygons_of(cornice)]
    trims += [slab(p, tier.foot_m, tier.foot_m + head_m) for p in polygons_of(frames.difference(gates))]
    return [(wall, merge(walls)), (band, merge(trims))]


def platform(area: BaseGeometry, foot_m: float, z_m: float, *, floor: str, rim: str) -> Parts:
    """Make a level platform among the rows, with a low rim on which nothing is hung."""
    inner = area.buffer(-0.12, join_style="mitre")
    rims = [slab(p, z_m, z_m + 0.12) for p in polygons_of(area.difference(inner))]
    return [(floor, merge([slab(p, foot_m, z_m) for p in polygons_of(area)])), (rim, merge(rims))]


def roof_parts(
    frame: Frame,
    length_m: float,
    depth_m: float,
    z_m: float,
    *,
    foot_m: float,
    roof: str,
    truss: str,
    fascia: str,
    bay_m: float = 6.0,
    rise_m: float = 2.4,
) -> Parts:
    """Make a level roof that hangs from cantilevered trusses above it.

    Parameters
    ----------
    frame : Frame
        Middle of the back edge; u looks towards the pitch.
    length_m, depth_m : float
        Along the back edge, and from back to front.
    z_m : float
        Underside of the roof.
    foot_m : float
        Where the columns along the back edge stand.
    roof, truss, fascia : str
        Materials.
    bay_m : float
        Distance between trusses.
    rise_m : float
        How far the trusses' heads stand over the roof.
    """
    half = length_m / 2
    top = z_m + 0.22
    deck = block(0.0, -half, depth_m, half, z_m, top)
    band = [block(depth_m - 0.1, -half, depth_m + 0.12, half, z_m - 0.25, top + 0.55)]
    band += [block(0.0, v - 0.1, depth_m, v + 0.1, z_m - 0.1, top + 0.2) for v in (-half, half)]
    bars = []
    count = max(round(length_m / bay_m), 1)
    for k in range(count + 1):
        v = -half + 0.5 + (length_m - 1.0) * k / count
        bars.append(block(0.2, v - 0.2, 0.7, v + 0.2, foot_m, top + rise_m))
        head, nose = (0.45, v, top + rise_m - 0.1), (depth_m - 0.3, v, top + 0.35)
        bars.append(sweep(path=[head, nose], section=(0.16, 0.22)))
        bars.append(sweep(path=[(0.45, v, top + 0.1), (depth_m - 0.2, v, top + 0.1)], section=(0.14, 0.2)))
        for j in range(1, 5):
            u = 0.45 + (depth_m - 0.75) * j / 5
            z = top + rise_m - 0.1 + (0.45 - rise_m) * j / 5
            before = 0.45 + (depth_m - 0.75) * (j - 1) / 5
            bars.append(sweep(path=[(before, v, top + 0.1), (u, v, z)], section=(0.09, 0.09)))
            bars.append(block(u - 0.05, v - 0.05, u + 0.05, v + 0.05, top, z))
    beams = [block(u - 0.08, -half, u + 0.08, half, z_m - 0.22, z_m) for u in np.linspace(0.6, depth_m - 0.5, 4)]
    return frame.parts([(roof, deck), (fascia, merge(band)), (truss, merge([*bars, *beams]))])
