"""Things strewn where there is room, and lines of leaning poles."""

from __future__ import annotations

import numpy as np
from shapely.geometry import Point, Polygon

from aerialdojo_gen.geometry.portable import norm
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.wreckage import Parts
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.values import Area, Number
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site


@site_builder
def strew_things(
    site: Site, place: str, area: Area, categories: list[str], stream: str, clear_m: Number = 1.4
) -> list[Instance]:
    """Set things out where an area has room for them and for a drone around them, a spot each.

    Categories are set out in their order; what finds no room, with `clear_m` about it, is left out.
    """
    rng = site.rng_for("strew", stream)
    spots = poisson_disc(area, 1.1, rng, limit=2000)
    out: list[Instance] = []
    for category in categories:
        for pose in spots:
            if not site.is_free(pose.x, pose.y, 0.6 + clear_m):
                continue
            z = site.foot_z(pose.x, pose.y)
            thing = site.place(Placement(category, *pose, z=z, place=place), "skip")
            if thing is not None:
                (x0, y0, _), (x1, y1, _) = thing.bounds
                room = Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]).buffer(clear_m - 0.4, quad_segs=2)
                site.occupy(room, z - 0.5, z + 2.0)
                out.append(thing)
                break
    return out


@site_builder
def leaning_poles(site: Site, poles: list[tuple[Number, Number, Number, Number]], height_m: Number = 8.0) -> None:
    """Put up a line of poles that lean by degrees towards a direction (x, y, lean, yaw), with slack wires between.

    They are structure: nobody can distinguish poles that stand askew.
    """
    wood: Parts = []
    heads: list[tuple[np.ndarray, np.ndarray]] = []
    for x, y, lean, yaw in poles:
        foot = np.array([x, y, site.ground_z(x, y) - 0.4])
        tilt, turn = np.radians(lean), np.radians(yaw)
        axis = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
        head = foot + axis * height_m
        wood.append(("wood", sweep(path=[tuple(foot), tuple(head)], radius=0.14, sides=6)))
        heads.append((head, axis))
        site.occupy(Point(x, y).buffer(0.4))
    for k, (head, axis) in enumerate(heads):
        other = heads[min(k + 1, len(heads) - 1)][0] - heads[max(k - 1, 0)][0]
        arm = np.cross(other / max(float(norm(other)), 1e-6), axis)
        arm /= max(float(norm(arm)), 1e-6)
        ends = [tuple(head - 0.35 * axis + s * 0.9 * arm) for s in (-1, 1)]
        wood.append(("wood", sweep(path=ends, section=(0.1, 0.12))))
        if k + 1 < len(heads):
            for s in (-0.8, 0.0, 0.8):
                a, b = head - 0.3 * axis + s * arm, heads[k + 1][0] - 0.3 * heads[k + 1][1] + s * arm
                middle = (a + b) / 2 - (0.0, 0.0, 1.1 + 0.3 * s)
                wood.append(("iron", sweep(path=[tuple(a), tuple(middle), tuple(b)], radius=0.02, sides=3)))
    site.add(None, "power_line", wood)
