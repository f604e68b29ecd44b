"""Grammar of layouts: fences, hedges, walls and railings."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from shapely.geometry import LineString

from aerialdojo_gen.scenes.grammar_frames import Frame, Parts, block
from aerialdojo_gen.scenes.grammar_scatter import Polyline
from aerialdojo_gen.scenes.mesh import merge, translated
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.shapes import box
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site


def fence(site: Site, path: Polyline, kind: str, colour: str | None = None) -> Instance:
    """Put up a picket, board, hedge, wall or railing fence along a path (world metres)."""
    material, height, thickness = {
        "picket": ("#f2efe6", 1.0, 0.05),
        "board": ("boards:#8d6f4c", 1.8, 0.08),
        "hedge": ("hedge", 1.3, 0.7),
        "wall": ("brick:#96604c", 1.2, 0.24),
        "railing": ("iron", 1.2, 0.04),
    }[kind]
    body = colour or material
    z = min(site.ground_z(x, y) for x, y in path)
    parts: Parts = []
    if kind in ("picket", "railing"):
        step, width = (0.28, 0.14) if kind == "picket" else (0.2, 0.035)
        for level in (0.3, 0.78) if kind == "picket" else (0.15, height - 0.05):
            parts.append((body, sweep(path=[(x, y, z + level) for x, y in path], section=(0.05, 0.08))))
        for a, b in pairwise(path):
            length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
            yaw = math.degrees(math.atan2(b[1] - a[1], b[0] - a[0]))
            count = max(round(length / step), 1)
            bars = [
                translated(box(size=(width, thickness, height), taper=(0.6, 1.0)), ((k + 0.5) * length / count, 0, 0))
                for k in range(count)
            ]
            parts += Frame(a[0], a[1], yaw).parts([(body, merge(bars))], z + 0.03)
    else:
        line = [(x, y, z + height / 2) for x, y in path]
        parts.append((body, sweep(path=line, section=(thickness, height))))
        if kind != "hedge":
            cap = "concrete" if kind == "wall" else body
            lid = [(x, y, z + height + 0.03) for x, y in path]
            parts.append((cap, sweep(path=lid, section=(thickness + 0.1, 0.08))))
        if kind == "board":
            line_m = LineString(path)
            posts = [
                line_m.interpolate(s) for s in np.linspace(0.0, line_m.length, max(int(line_m.length / 2.4), 1) + 1)
            ]
            parts.append(("wood", merge([block(p.x - 0.07, p.y - 0.07, p.x + 0.07, p.y + 0.07, z, z + 1.95)
                                         for p in posts])))  # fmt: skip
    area = LineString(path).buffer(thickness / 2 + 0.02, cap_style="flat", join_style="mitre")
    return site.add(None, f"{kind}_fence" if kind != "hedge" else "garden_hedge", parts, footprint=area)
