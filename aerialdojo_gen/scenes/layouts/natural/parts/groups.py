"""Groups of things that recipes ask for, planned before the ground is made, so that it can be made for them.

A group is a camp, a yard, a roof terrace: a place with a name and a list of things. Where a thing's place does not
matter, it is found; things keep a drone's room between them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import BaseModel, ConfigDict, Field
from shapely.affinity import rotate, translate
from shapely.geometry import MultiPoint, Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.ground import disc
from aerialdojo_gen.scenes.kit.natural_ground import settled_z
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain
from aerialdojo_gen.scenes.values import At, Degrees, Length

_TRIES, _AT_ONCE = 500, 20
_ATTEMPTS = 6
_NUMBER = r"-?\d{1,4}(?:\.\d{0,6})?"
_THING = re.compile(
    rf"(?P<category>\w+)(?: (?P<variant>\w+))?(?: @ (?P<at>{_NUMBER}(?: +{_NUMBER}){{1,2}} *))?"
    rf"(?: \^ (?P<lift>\d{{1,3}}(?:\.\d{{0,6}})?))?(?: \| (?P<place>.+))?",
    re.ASCII,
)


class Group(BaseModel):
    """Things that stand together, as a recipe gives them.

    Attributes
    ----------
    name : str
        Its own among the scene's groups.
    at : (float, float)
        Middle, world frame, metres.
    radius_m : float
        Things stand within this, metres.
    place : str
        Where they stand, as a person would say it; empty says nothing.
    things : tuple of str
        ``"category"``, ``"category variant"``, then, where wanted, ``"@ x y"`` or ``"@ x y yaw"`` in the group's
        frame, ``"^ height"`` above the group's ground, and ``"| place of its own"``.
    yaw_deg : float
        Of the group's frame.
    gap_m : float
        Least room between things, metres.
    facing : str
        Where fronts look: to the middle, away from it, or anywhere.
    level : bool
        Whether the whole group's ground is levelled, or only the ground under each thing.
    where : str
        Which places are taken: any, or the highest or the lowest on offer.
    on : str
        Name of the deck (a mesa, a roof) that carries the group; empty for the ground.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    at: At
    radius_m: Length = 8.0
    place: str = ""
    things: tuple[str, ...]
    yaw_deg: Degrees = 0.0
    gap_m: Annotated[float, Field(ge=0, le=100)] = 1.9
    facing: Literal["middle", "out", "any"] = "any"
    level: bool = False
    where: Literal["any", "high", "low"] = "any"
    on: str = ""


@dataclass(frozen=True)
class Deck:
    """A level top that things stand on: its plan, and its height once it is built, metres."""

    area: BaseGeometry
    z_m: float


@dataclass(frozen=True)
class Planned:
    """A thing and where it goes: world frame, metres, degrees; `lift_m` is above the group's ground if given."""

    group: Group
    category: str
    variant: str | None
    x: float
    y: float
    yaw_deg: float
    lift_m: float | None
    place: str
    outline: BaseGeometry = field(repr=False)


def plan_groups(
    site: Site,
    groups: Sequence[Group],
    taken: Sequence[BaseGeometry],
    decks: Mapping[str, BaseGeometry],
    height: Callable[[float, float], float],
) -> list[Planned]:
    """Find places for all things.

    Parameters
    ----------
    site : Site
        Its extent and catalogue are used; nothing is placed.
    groups : sequence of Group
        Earlier ones choose first.
    taken : sequence of shapely geometry
        Areas that must stay free, world frame.
    decks : mapping of str to shapely geometry
        Plans of the decks that groups may stand on, by name.
    height : callable
        ``(x, y) -> z`` of the ground as it is so far, metres.

    Raises
    ------
    AssetError
        A deck is unknown, or there is no room for a thing.
    """
    out: list[Planned] = []
    areas = {g.name: disc(*g.at, g.radius_m) for g in groups if not g.on and g.level}
    for group in groups:
        if group.on and group.on not in decks:
            raise AssetError(f"{site.name}: group {group.name!r} stands on {group.on!r}, which is no deck")
        room = decks[group.on].buffer(-0.3) if group.on else site.extent.buffer(-1.5)
        # Strays keep out of the groups that have a ground of their own.
        others = [a for name, a in areas.items() if name != group.name] if not group.level else []
        blocked = [] if group.on else [*taken, *others]
        mine = [p.outline for p in out if p.group.on == group.on]
        out += _plan(site, group, room, [*blocked, *mine], height)
    return out


def level_ground(terrain: Terrain, planned: Sequence[Planned], blend_m: float = 3.0) -> Terrain:
    """Level the ground of groups, and that under every thing."""
    groups = {p.group.name: p.group for p in planned if not p.group.on}
    for group in groups.values():
        if group.level:
            terrain = terrain.flattened(disc(*group.at, group.radius_m * 0.8), blend_m=group.radius_m * 0.6)
    for p in planned:
        if not p.group.on and not p.group.level:
            terrain = terrain.flattened(p.outline, blend_m=blend_m)
    return terrain


def set_out(
    site: Site, planned: Sequence[Planned], decks: Mapping[str, Deck], margin_m: float = 1.2
) -> list[Instance]:
    """Place what was planned, and keep the room around it."""
    out = []
    for p in planned:
        base = decks[p.group.on].z_m if p.group.on else settled_z(site, p.x, p.y)
        words = {"place": p.place} if p.place else {}
        instance = site.place(
            p.category, p.x, p.y, p.yaw_deg, z=base + (p.lift_m or 0.0), variant=p.variant, attributes=words
        )
        low, high = instance.bounds[:, 2]
        site.occupy(p.outline.buffer(margin_m, quad_segs=2), float(low) - 1.0, float(high) + 6.0)
        out.append(instance)
    return out


def gentle(site: Site, x: float, y: float, fall: float = 0.64) -> float:
    """Say 1 where a stone stays lying, 0 where the ground falls by more than `fall` metres a metre."""
    east = site.ground_z(x + 0.7, y) - site.ground_z(x - 0.7, y)
    north = site.ground_z(x, y + 0.7) - site.ground_z(x, y - 0.7)
    return float(np.hypot(east, north) < 1.4 * fall)


def _plan(
    site: Site,
    group: Group,
    room: BaseGeometry,
    blocked: Sequence[BaseGeometry],
    height: Callable[[float, float], float],
) -> list[Planned]:
    things = [(k, _parsed(site, group, text)) for k, text in enumerate(group.things)]
    shapes = {k: _outline(site, t["category"], t["variant"]) for k, t in things}
    # Fixed things first, then the large ones: the small find room between them.
    things.sort(key=lambda item: (item[1]["at"] is None, -shapes[item[0]].area))
    missing = ""
    for attempt in range(_ATTEMPTS):
        taken = list(blocked)
        out: list[Planned] = []
        for k, thing in things:
            pose = _fixed(group, thing["at"]) if thing["at"] else None
            if pose is None:
                pose = _found(site, group, (k, attempt), shapes[k], room, taken, height)
            if pose is None:
                missing = group.things[k]
                break
            x, y, yaw = pose
            outline = translate(rotate(shapes[k], yaw, origin=(0, 0)), x, y)
            lift = float(thing["lift"]) if thing["lift"] else None
            place = group.place if thing["place"] is None else thing["place"]
            if lift is None:
                taken.append(outline)
            out.append(Planned(group, str(thing["category"]), thing["variant"], x, y, yaw, lift, place, outline))
        else:
            return out
    raise AssetError(f"{site.name}: group {group.name!r} has no room for {missing!r}")


def _parsed(site: Site, group: Group, text: str) -> dict[str, str | None]:
    match = _THING.fullmatch(text)
    if match is None:
        raise AssetError(f"{site.name}: group {group.name!r}: {text!r} is no thing")
    return match.groupdict()


def _outline(site: Site, category: str | None, variant: str | None) -> BaseGeometry:
    rng = site.rng_for("outline", category, variant)
    instance = site.catalogue.instantiate(str(category), "outline", rng, (0.0, 0.0, 0.0), 0.0, variant)
    return MultiPoint(instance.vertices[:, :2]).convex_hull.buffer(0.1, quad_segs=2)


def _fixed(group: Group, text: str) -> tuple[float, float, float]:
    numbers = [float(n) for n in text.split()]
    x, y, yaw = (*numbers, 0.0) if len(numbers) == 2 else numbers
    p = rotate(Point(x, y), group.yaw_deg, origin=(0, 0))
    return group.at[0] + p.x, group.at[1] + p.y, group.yaw_deg + yaw


def _found(
    site: Site,
    group: Group,
    key: tuple[int, int],
    shape: BaseGeometry,
    room: BaseGeometry,
    blocked: Sequence[BaseGeometry],
    height: Callable[[float, float], float],
) -> tuple[float, float, float] | None:
    rng = site.rng_for("group", group.name, *key)
    tree = shapely.STRtree(blocked)
    wanted = 1 if group.where == "any" else 12
    found: list[tuple[float, float, float]] = []
    shapely.prepare(room)
    for first in range(0, _TRIES, _AT_ONCE):
        tries = [_drawn(group, rng, k) for k in range(first, min(first + _AT_ONCE, _TRIES))]
        # The middle of an outline is well inside of it: where that is not free, the outline is not.
        turns = np.radians([yaw for _, _, yaw in tries])
        middle = shape.centroid
        xs = np.array([x for x, _, _ in tries]) + np.cos(turns) * middle.x - np.sin(turns) * middle.y
        ys = np.array([y for _, y, _ in tries]) + np.sin(turns) * middle.x + np.cos(turns) * middle.y
        free = shapely.contains_xy(room, xs, ys)
        free[tree.query(shapely.points(xs, ys), predicate="intersects")[0]] = False
        for x, y, yaw in (tries[k] for k in np.flatnonzero(free)):
            outline = translate(rotate(shape, yaw, origin=(0, 0)), x, y)
            if room.contains(outline) and not len(tree.query(outline.buffer(group.gap_m), predicate="intersects")):
                found.append((x, y, yaw))
                if len(found) >= wanted:
                    break
        if len(found) >= wanted:
            break
    sign = -1.0 if group.where == "low" else 1.0
    return max(found, key=lambda p: sign * height(p[0], p[1])) if found else None


def _drawn(group: Group, rng: np.random.Generator, k: int) -> tuple[float, float, float]:
    """Draw the k-th place that is tried for a thing of a group, and its yaw."""
    # A crowded place spreads a little.
    reach = group.radius_m * (1.0 + max(k / _TRIES - 0.5, 0.0))
    r, angle = reach * float(np.sqrt(rng.random())), float(rng.uniform(0, 2 * np.pi))
    x, y = group.at[0] + r * float(np.cos(angle)), group.at[1] + r * float(np.sin(angle))
    outward = float(np.degrees(angle)) + float(rng.uniform(-25, 25))
    # On roofs things are set square.
    free = group.yaw_deg + 90.0 * float(rng.integers(4)) if group.on else float(rng.uniform(0, 360))
    return x, y, {"out": outward, "middle": outward + 180.0, "any": free}[group.facing]
