"""Who and what comes to a disaster: things set out in places that have a name, on the ground and on broken floors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from shapely.geometry import Point, Polygon

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.grammar_props import next_variant
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.natural_ground import settled_z
from aerialdojo_gen.scenes.kit.wreckage import Parts
from aerialdojo_gen.scenes.kit.wrecks import Wreck
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.plans.values import Area, Number
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

Row = tuple[str, float, float, float]
_FINISH_M = 0.03


def stand(site: Site, place: str, rows: Sequence[Row], *, z: float | None = None, sink_m: float = 0.0) -> None:
    """Set things out on the ground or at a height, always the variant that is rarest so far.

    Parameters
    ----------
    site : Site
        Where.
    place : str
        What descriptions say of where they are, e.g. ``"on the square"``.
    rows : sequence of (category, x, y, yaw)
        Metres and degrees, world frame.
    z : float, optional
        Height of what they stand on; the ground by default.
    sink_m : float
        How deep they sit in it.

    Raises
    ------
    AssetError
        Names a thing whose room is taken.
    """
    for category, x, y, yaw in rows:
        base = settled_z(site, x, y) if z is None else z
        thing = site.try_place(
            category, x, y, yaw, z=base - sink_m, variant=next_variant(site, category), attributes={"place": place}
        )
        if thing is None:
            raise AssetError(f"{site.name}: no room for {category} at ({x:g}, {y:g})")


def stand_on_floor(
    site: Site, wreck: Wreck, base_m: float, storey: int, place: str, rows: Sequence[Row]
) -> list[Instance]:
    """Set things out on a floor of a damaged building; rows are in the building's own frame.

    Raises
    ------
    AssetError
        Names a thing that has no floor beneath it.
    """
    out = []
    for category, u, v, yaw in rows:
        if not wreck.bears(u, v, storey, 0.35):
            raise AssetError(f"{site.name}: no floor for {category} at ({u:g}, {v:g}) in storey {storey}")
        x, y, turned = wreck.frame.pose(u, v, yaw)
        finish = _FINISH_M if storey else 0.0
        out.append(
            site.place(
                category, x, y, turned, z=base_m + storey * wreck.style.storey_m + finish,
                variant=next_variant(site, category), attributes={"place": place},
            )
        )  # fmt: skip
    return out


@site_builder
def strew_things(
    site: Site, place: str, area: Area, categories: list[str], stream: str, clear_m: Number = 1.4
) -> list[Instance]:
    """Set things out where an area has room for them and for a drone around them, a spot each.

    Parameters
    ----------
    site : Site
        Where.
    place : str
        As in `stand`.
    area : shapely geometry
        World frame, metres.
    categories : list of str
        In the order of placing; what finds no room is left out.
    stream : str
        Of the draws.
    clear_m : float
        Room kept around each, metres.
    """
    rng = site.rng_for("strew", stream)
    spots = poisson_disc(area, 1.1, rng, limit=2000)
    out: list[Instance] = []
    for category in categories:
        for pose in spots:
            if not site.is_free(pose.x, pose.y, 0.6 + clear_m):
                continue
            z = settled_z(site, pose.x, pose.y)
            words = {"place": place}
            thing = site.try_place(category, *pose, z=z, variant=next_variant(site, category), attributes=words)
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

    They are structure: poles that stand askew are told apart by nobody.
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
        arm = np.cross(other / max(float(np.linalg.norm(other)), 1e-6), axis)
        arm /= max(float(np.linalg.norm(arm)), 1e-6)
        ends = [tuple(head - 0.35 * axis + s * 0.9 * arm) for s in (-1, 1)]
        wood.append(("wood", sweep(path=ends, section=(0.1, 0.12))))
        if k + 1 < len(heads):
            for s in (-0.8, 0.0, 0.8):
                a, b = head - 0.3 * axis + s * arm, heads[k + 1][0] - 0.3 * heads[k + 1][1] + s * arm
                middle = (a + b) / 2 - (0.0, 0.0, 1.1 + 0.3 * s)
                wood.append(("iron", sweep(path=[tuple(a), tuple(middle), tuple(b)], radius=0.02, sides=3)))
    site.add(None, "power_line", wood)
