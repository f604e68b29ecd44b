"""A snowfield: a ski slope between valley and summit, or a research station out on the ice.

The recipe says what stands where; the layout shapes the snow, grooms pistes, strings the lift, and plants the woods.
"""

from __future__ import annotations

from typing import Annotated

import shapely
from pydantic import BaseModel, ConfigDict, Field
from shapely.affinity import rotate
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_scatter import along, smooth_path
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.layouts.natural.parts.groups import (
    Deck,
    Group,
    Planned,
    gentle,
    level_ground,
    plan_groups,
    set_out,
)
from aerialdojo_gen.scenes.layouts.natural.parts.strata import Rock, put_up, raise_foot
from aerialdojo_gen.scenes.layouts.natural.parts.woods import strew
from aerialdojo_gen.scenes.layouts.natural.snowfield.winter import (
    Hut,
    Rink,
    banked,
    build_boards,
    build_cables,
    build_hut,
    build_ridge,
    moguls,
    slope_ground,
)
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, mound, rolling_terrain
from aerialdojo_gen.scenes.values import Hill, Length, Line, LineOrNone, Metres

_CELL_M = 1.4
_MAST_HEAD_M = 11.6
_TERMINAL_M = 5.6
_GAUGE_M = 6.4


class Piste(BaseModel):
    """A groomed run: its middle line and width, metres; banks pile up beside it; gates or bumps where it has them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: Line
    width_m: Annotated[float, Field(gt=1, le=100)] = 9.0
    bank_m: Annotated[float, Field(ge=0, le=10)] = 0.7
    gates: Annotated[int, Field(ge=0, le=1000)] = 0
    moguls_m: Annotated[float, Field(ge=0, le=10)] = 0.0


class Parameters(BaseModel):
    """What a recipe may say of a snowfield.

    Attributes
    ----------
    profile : tuple of (y, z)
        Heights from south to north, metres.
    lean : float
        Rise towards the east, metres a metre.
    drift_m, drift_length_m : float
        Height and length of drifts and bumps over it all.
    hills : tuple of (x, y, radius, rise)
        Knolls and hollows, metres.
    pistes, huts, rocks, groups
        What runs and stands where.
    lift : points
        Masts of the lift, metres; the first and the last are its terminals.
    rink, lake
        An ice rink; a frozen lake (x, y, radius).
    roads : tuple of points
        Ploughed ways, metres.
    ridges : tuple of points
        Ridges of broken ice, `ridge_m` high.
    spruces, boulders : int
        How many are strewn.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    profile: Annotated[tuple[tuple[Metres, Metres], ...], Field(min_length=1)] = ((0.0, 0.0),)
    lean: Annotated[float, Field(ge=-2, le=2)] = 0.0
    drift_m: Annotated[float, Field(ge=0, le=5)] = 1.0
    drift_length_m: Annotated[float, Field(ge=5, le=90)] = 22.0
    hills: tuple[Hill, ...] = ()
    pistes: tuple[Piste, ...] = ()
    huts: tuple[Hut, ...] = ()
    rocks: tuple[Rock, ...] = ()
    groups: tuple[Group, ...] = ()
    lift: LineOrNone = ()
    lift_variant: str = "red"
    cabins: Annotated[int, Field(ge=0, le=1000)] = 8
    rink: Rink | None = None
    lake: tuple[Metres, Metres, Length] | None = None
    roads: tuple[Line, ...] = ()
    road_m: Annotated[float, Field(ge=1, le=9)] = 4.0
    ridges: tuple[Line, ...] = ()
    ridge_m: Annotated[float, Field(ge=0.3, le=5)] = 1.8
    spruces: Annotated[int, Field(ge=0, le=1000)] = 60
    boulders: Annotated[int, Field(ge=0, le=1000)] = 24


def build(site: Site) -> None:
    """Build the snowfield."""
    p: Parameters = site.parameters
    seed = site.recipe.seed
    roads = [smooth_path(path) for path in p.roads]
    runs = [smooth_path(piste.path) for piste in p.pistes]
    rocks = {r.name: r.area(seed) for r in p.rocks}
    rink = p.rink.area() if p.rink else None
    lake = blob(*p.lake, seed + 9, 0.25) if p.lake else None
    ground = _ground(site, p, runs, roads, rocks, lake)
    taken: list[BaseGeometry] = [*rocks.values(), *(h.plan(4.2).buffer(0.6) for h in p.huts),
             *(ribbon(r, p.road_m) for r in roads), *(LineString(r).buffer(1.4) for r in p.ridges),
             *(Point(m).buffer(1.6) for m in p.lift)]  # fmt: skip
    if rink is not None:
        taken.append(rink.buffer(0.6))
    tops = {r.name: r.top(seed) for r in p.rocks}
    for hut in p.huts:
        tops |= hut.decks()
    planned = plan_groups(site, p.groups, taken, tops, lambda x, y: float(ground.z(x, y)))
    ground = level_ground(ground, planned)
    for hut in p.huts:
        ground = ground.flattened(hut.plan(2.0), blend_m=3.0)
    if rink is not None:
        ground = ground.flattened(rink.buffer(1.0), blend_m=4.0)
    for mast in p.lift:
        ground = ground.flattened(disc(*mast, 1.2), blend_m=2.0)
    site.set_ground(ground, site.material("snow", "snow"))
    _paint(site, p, runs, roads, rink, lake)
    decks: dict[str, Deck] = {}
    bands = tuple(site.material(f"band_{k}", "rock:#7f8288") for k in range(3))
    for rock in p.rocks:
        decks[rock.name] = put_up(site, rock, bands, site.material("cap", "snow"))
    for hut in p.huts:
        decks |= build_hut(site, hut)
    if rink is not None and p.rink is not None:
        build_boards(site, rink, site.ground_z(*p.rink.at))
    _lift(site, p)
    for k, path in enumerate(p.ridges):
        build_ridge(site, path, p.ridge_m, site.material("ice_blocks", "ice"), k)
    set_out(site, planned, decks)
    _gates(site, p, runs)
    _grow(site, p, runs, roads, planned, lake)


def _ground(
    site: Site,
    p: Parameters,
    runs: list[list[tuple[float, float]]],
    roads: list[list[tuple[float, float]]],
    rocks: dict[str, shapely.Polygon],
    lake: BaseGeometry | None,
) -> Terrain:
    ground = rolling_terrain(site.recipe.size_m, _CELL_M, site.recipe.seed, p.drift_m, p.drift_length_m, octaves=3)
    ground = slope_ground(ground, p.profile, p.lean)
    for x, y, radius, rise in p.hills:
        ground = mound(ground, (x, y), radius, rise)
    for area in rocks.values():
        ground = raise_foot(ground, area, 0.9, 4.0)
    for piste, run in zip(p.pistes, runs, strict=True):
        ground = ground.graded(run, piste.width_m * 0.75, blend_m=3.0, smooth_m=14.0)
        if piste.moguls_m:
            ground = moguls(ground, ribbon(run, piste.width_m), piste.moguls_m, 4.4)
        ground = banked(ground, run, piste.width_m, piste.bank_m)
    for road in roads:
        ground = banked(ground.graded(road, p.road_m * 0.8, blend_m=2.5, smooth_m=12.0), road, p.road_m, 0.8)
    if lake is not None:
        ground = ground.flattened(lake, blend_m=4.0)
    return ground


def _paint(
    site: Site,
    p: Parameters,
    runs: list[list[tuple[float, float]]],
    roads: list[list[tuple[float, float]]],
    rink: BaseGeometry | None,
    lake: BaseGeometry | None,
) -> None:
    seed, rng = site.recipe.seed, site.rng_for("patches")
    half = [s / 2 for s in site.recipe.size_m]
    for k in range(22):
        x, y = float(rng.uniform(-half[0], half[0])), float(rng.uniform(-half[1], half[1]))
        drift = site.material("drift_a" if k % 2 else "drift_b", "snow:#e2eaf2")
        site.paint(blob(x, y, float(rng.uniform(3.0, 8.0)), seed + 400 + k, 0.5), drift)
    if lake is not None:
        site.paint(lake.buffer(0.9), site.material("shore", "snow:#d8e4ee"))
        site.paint(lake, site.material("lake", "ice:#b9d6e4"))
        x0, y0, x1, y1 = lake.bounds
        for k in range(5):
            crack = LineString(rng.uniform((x0, y0), (x1, y1), size=(4, 2))).buffer(0.05 + 0.02 * k)
            site.paint(crack.intersection(lake), site.material("crack", "ice:#e6f2f8"))
    for piste, run in zip(p.pistes, runs, strict=True):
        site.paint(ribbon(run, piste.width_m), site.material("piste", "snow:#f8fbff"))
        # Corduroy: what the groomer's tiller leaves.
        step = 1.5
        for k in range(int(piste.width_m / step / 2) if not piste.moguls_m else 0):
            line = LineString(run).offset_curve((k - piste.width_m / step / 4 + 0.5) * 2 * step)
            if not line.is_empty:
                site.paint(
                    line.buffer(step / 2, cap_style="flat", quad_segs=2), site.material("groomed", "snow:#e4edf6")
                )
    for road in roads:
        site.paint(ribbon(road, p.road_m + 0.8, round_ends=True), site.material("verge", "snow:#d3dbe2"))
        site.paint(ribbon(road, p.road_m, round_ends=True), site.material("road", "snow:#b9bfc6"))
        for side in (-0.9, 0.9):
            rut = LineString(road).offset_curve(side).buffer(0.28, cap_style="flat", quad_segs=2)
            site.paint(rut, site.material("rut", "asphalt:#7d8288"))
    for group in p.groups:
        if group.level and not group.on:
            trodden = blob(*group.at, group.radius_m * 0.75, seed + len(group.name), 0.3)
            site.paint(trodden, site.material("trodden", "snow:#d9e0e8"))
    if rink is not None and p.rink is not None:
        site.paint(rink, site.material("rink", "ice:#cfe6f2"))
        for at, wide, colour in ((-0.28, 0.2, "#3a6fc0"), (0.0, 0.2, "#c8342c"), (0.28, 0.2, "#3a6fc0")):
            u, half_v = at * p.rink.size_m[0], p.rink.size_m[1] / 2
            x, y = p.rink.at
            stripe = rotate(
                rectangle(x + u - wide / 2, y - half_v, x + u + wide / 2, y + half_v), p.rink.yaw_deg, origin=(x, y)
            )
            site.paint(stripe.intersection(rink.buffer(-0.2)), colour)


def _lift(site: Site, p: Parameters) -> None:
    for k, (x, y) in enumerate(p.lift[1:-1]):
        before, after = p.lift[k], p.lift[k + 2]
        line = along([before, after], 1000.0)[0]
        site.place("ski_lift_pylon", x, y, line.yaw_deg, variant=p.lift_variant)
    if p.lift:
        last = len(p.lift) - 1
        heads = [
            (x, y, site.ground_z(x, y) + (_TERMINAL_M if k in (0, last) else _MAST_HEAD_M))
            for k, (x, y) in enumerate(p.lift)
        ]
        build_cables(site, heads, _GAUGE_M, p.cabins)


def _gates(site: Site, p: Parameters, runs: list[list[tuple[float, float]]]) -> None:
    for piste, run in zip(p.pistes, runs, strict=True):
        if not piste.gates:
            continue
        length = LineString(run).length
        for k, pose in enumerate(along(run, length / (piste.gates + 1))[1:-1]):
            side = 1.0 if k % 2 else -1.0
            yaw = pose.yaw_deg
            line = LineString(run).offset_curve(side * 1.6)
            if line.is_empty:
                continue
            at = line.interpolate(line.project(Point(pose.x, pose.y)))
            variant = "start" if k == piste.gates - 1 else "red" if k % 2 else "blue"
            site.try_place("ski_gate", float(at.x), float(at.y), yaw + 180.0, variant=variant)


def _grow(
    site: Site,
    p: Parameters,
    runs: list[list[tuple[float, float]]],
    roads: list[list[tuple[float, float]]],
    planned: list[Planned],
    lake: BaseGeometry | None,
) -> None:
    """Plant spruces between the runs, denser away from where people are, and strew snowed-up boulders."""
    for road in roads:
        site.occupy(ribbon(road, p.road_m + 1.0))
    for piste, run in zip(p.pistes, runs, strict=True):
        site.occupy(ribbon(run, piste.width_m + 1.5))
    if lake is not None:
        site.occupy(lake)
    if len(p.lift) > 1:
        site.occupy(LineString(p.lift).buffer(_GAUGE_M / 2 + 2.0))
    busy = shapely.union_all([Point(q.x, q.y) for q in planned if not q.group.on]) if planned else Point(1e6, 0)
    wood = site.extent.buffer(-1.5)

    def quiet(x: float, y: float) -> float:
        return min(1.0, 0.05 + float(busy.distance(Point(x, y))) / 14.0)

    words = {"place": "in the woods"}
    strew(site, "snowy_spruce", wood, 2.9, quiet, p.spruces, attributes=words)
    strew(site, "young_spruce", wood, 4.0, quiet, p.spruces // 4, roles={"needles": "needles:#5a7466"})
    snowed = {"rock": site.material("boulder", "rock:#7c8288"), "top": "snow"}
    strew(
        site,
        "boulder",
        wood,
        3.5,
        lambda x, y: 0.4 * gentle(site, x, y, 0.4),
        p.boulders,
        roles=snowed,
        variant="grey",
    )
