"""A construction site: an office tower's frame beside a deep pit, or a viaduct growing across a shallow valley.

North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict
from shapely.geometry import LineString

from aerialdojo_gen.scenes.grammar_frames import Frame as Turned
from aerialdojo_gen.scenes.grammar_streets import streets
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.layouts.urban.construction_site.concrete import (
    Frame,
    bulkheads,
    core,
    flight,
    infill,
    put_up_frame,
    scaffold,
    shores,
)
from aerialdojo_gen.scenes.layouts.urban.construction_site.earthworks import grid_terrain, ramped, roughened, shaped
from aerialdojo_gen.scenes.layouts.urban.construction_site.industry import Place, guard_rails, set_out
from aerialdojo_gen.scenes.layouts.urban.construction_site.site_yard import (
    aggregate_bays,
    foundation,
    hoarding,
    offices,
    precast_stack,
)
from aerialdojo_gen.scenes.layouts.urban.construction_site.viaduct import build_viaduct, plant
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"tower"`` (124 by 108 m) or ``"viaduct"`` (116 by 84 m).
    sign : str
        What is written on the hoarding.
    places : tuple of Place
        Everything that stands about.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["tower", "viaduct"] = "tower"
    sign: str = "CITY BUILD"
    places: tuple[Place, ...] = ()


STOREY_M = 3.6
PIT = rectangle(15, -41, 58, 6)
_XS = tuple(-34.0 + 7.3 * k for k in range(7))
_YS = (8.4, 15.7, 23.0, 30.3, 37.6)


def build(site: Site) -> None:
    """Build the site."""
    parameters: Parameters = site.parameters
    if parameters.plan == "viaduct":
        build_viaduct(site)
    else:
        _ground(site)
        _tower(site)
        _annex(site)
        _pit(site)
        _yards(site, parameters.sign)
    set_out(site, parameters.places)
    if parameters.plan == "viaduct":
        plant(site)


def _ground(site: Site) -> None:
    site_area = rectangle(-60, -45, 60, 52)
    terrain = grid_terrain(site.recipe.size_m, 1.5)
    terrain = roughened(terrain, site_area.buffer(-3), 0.07, site.rng_for("ruts"))
    terrain = shaped(terrain, PIT, [(0, 0), (3.5, -3.2), (6.5, -3.2), (10, -6.4)])
    terrain = ramped(terrain, (14, -36.5, 0.0), (44, -36.5, -6.4), 5.0, 1.8)
    terrain = terrain.flattened(rectangle(40, -37.5, 46, -30), -6.4, 1.0)
    terrain = shaped(
        terrain,
        disc(48, 43, 10.5, 16).union(disc(40, 45, 7.5, 16)).intersection(rectangle(30, 33, 58.6, 51)),
        [(0, 0), (5.5, 4.4), (20, 5.0)],
    )
    for plan in (rectangle(-35.5, 7, 11.5, 39), rectangle(22, 12, 50, 31), rectangle(-59, 6, -44, 38)):
        terrain = terrain.flattened(plan, 0.0, 1.0)
    terrain = terrain.flattened(rectangle(-70, -60, 70, -45.5), 0.0, 1.0)
    site.set_ground(terrain, site.material("earth", "dirt:#93775a"))
    haul = site.material("haul", "gravel:#a3937c")
    site.paint(ribbon([(-9, -47), (-9, -2), (-2, 3)], 8.0), haul)
    for line in ([(-9, -36.5), (40, -36.5)], [(-9, 1.5), (18, 10.5), (18, 46), (-40, 46), (-40, 2), (-9, 2)]):
        site.paint(ribbon(line, 5.5, round_ends=True), haul)
    site.paint(rectangle(-58, -43, -15, -6), site.material("yard", "gravel:#b0aa9c"))
    site.paint(rectangle(-36.2, 6.2, 12.2, 39.8), "concrete:#a19d94")
    site.paint(rectangle(22.5, 12.5, 49.5, 30.5), "concrete:#a8a499")
    site.paint(rectangle(-59, 5.5, -45.5, 38), "gravel:#c0b8a6")
    site.paint(rectangle(25.5, -30.5, 47.5, -4.5), "mud")
    for off in (-1.1, 1.1):
        for rut in ([(-9.0 + off, -45.0), (-9.0 + off, -3.0)], [(-7.0, -36.5 + off), (42.0, -36.5 + off)]):
            site.paint(ribbon(rut, 0.55), "mud:#7d6a52")
    streets(site, [[(-62, -50.2), (62, -50.2)]], lanes=2, lane_m=3.1, pavement_m=1.7)
    site.paint(rectangle(-13, -47.2, -5, -44.5), haul)


def _tower(site: Site) -> None:
    x0, y0, x1, y1 = -35.0, 7.4, 10.8, 38.6
    whole = rectangle(x0, y0, x1, y1)
    plans = [
        whole,
        whole.difference(rectangle(_XS[4] + 1, y0 - 1, x1 + 1, _YS[1] + 0.6)),
        rectangle(x0, y0, _XS[4] + 1.0, y1),
        rectangle(x0, y0, _XS[3] + 1.0, y1),
        rectangle(x0, y0, _XS[2] + 1.0, _YS[3] + 1.0),
    ]
    floors = tuple((plan, STOREY_M * (k + 1)) for k, plan in enumerate(plans))
    tops = [z for _, z in floors]
    shaft = rectangle(-18.2, 24.2, -13.4, 29.2)
    stair = rectangle(-26.6, 16.8, -21.4, 18.4)
    other = rectangle(-10.6, 31.6, -5.4, 33.2)
    voids = {k: shaft.union(stair if k % 2 == 0 else other) for k in range(4)}
    voids[3] = voids[3].intersection(plans[3]).difference(other)
    put_up_frame(site, Frame(_XS, _YS, floors, 0.0, voids))
    core(site, shaft.bounds, 0.0, tops[:4], tops[3] + 2.6)
    flight(site, -26.3, 17.6, 0.0, 0.0, tops[0])
    flight(site, -10.3, 32.4, 0.0, tops[0], tops[1])
    flight(site, -26.3, 17.6, 0.0, tops[1], tops[2])
    shores(site, rectangle(_XS[0] + 0.8, _YS[0] + 0.8, _XS[1] - 0.8, _YS[1] - 0.8), tops[3], tops[4] - 0.6)
    shores(site, rectangle(_XS[0] + 0.8, _YS[2] + 0.8, _XS[1] - 0.8, _YS[3] - 0.8), tops[3], tops[4] - 0.6)
    brick = site.material("infill", "brick:#a5583f")
    for k in range(6):
        infill(site, (_XS[k] + 0.3, 38.2), (_XS[k + 1] - 0.3, 38.2), 0.0, STOREY_M - 0.6, brick, 2)
        if k < 4:
            infill(site, (_XS[k] + 0.3, 38.2), (_XS[k + 1] - 0.3, 38.2), tops[0], tops[1] - 0.6, "blocks", 2)
    for k in (0, 2, 3):
        infill(site, (-34.7, _YS[k] + 0.3), (-34.7, _YS[k + 1] - 0.3), tops[0], tops[1] - 0.3, "blocks", 2)
        infill(site, (-34.7, _YS[k] + 0.3), (-34.7, _YS[k + 1] - 0.3), 0.0, STOREY_M - 0.3, brick, 1)
    for (ax, ay), (bx, by), z, what in (
        ((_XS[1], _YS[2] + 0.3), (_XS[1], _YS[3] - 0.3), 0.0, "blocks"),
        ((_XS[3] + 0.3, _YS[1]), (_XS[4] - 0.3, _YS[1]), 0.0, "blocks"),
        ((_XS[4], _YS[2] + 0.3), (_XS[4], _YS[3] - 0.3), tops[0], "blocks"),
        ((_XS[5], _YS[1] + 0.3), (_XS[5], _YS[2] - 0.3), 0.0, "blocks"),
        ((_XS[1] + 0.3, _YS[3]), (_XS[2] - 0.3, _YS[3]), tops[1], "blocks"),
    ):
        infill(site, (ax, ay), (bx, by), z, z + STOREY_M - 0.6, what, 2)
    net = site.material("net", "fabric:#3c7a54")
    scaffold(site, (x0, 38.9), (_XS[4] + 1.0, 38.9), tops[2], net=net)
    scaffold(site, (-35.4, y0), (-35.4, _YS[3]), tops[3], net="fabric:#4a78a8")
    scaffold(site, (_XS[6] + 1.3, 37.6), (_XS[6] + 1.3, 17.0), tops[1], net=net)


def _annex(site: Site) -> None:
    xs, ys = (23.5, 30.5, 37.5, 44.5), (13.5, 20.5, 27.5)
    low, high = rectangle(22.8, 12.8, 45.2, 28.2), rectangle(29.8, 12.8, 45.2, 21.2)
    stair = rectangle(32.0, 23.4, 37.0, 25.0)
    put_up_frame(site, Frame(xs, ys, ((low, 3.6), (high, 7.2)), 0.0, {0: stair}, 0.45, "concrete:#b3aea3"))
    flight(site, 32.2, 24.2, 0.0, 0.0, 3.6)
    shores(site, rectangle(38.2, 14.2, 44.0, 20.0), 3.6, 7.2 - 0.6)
    for k in range(2):
        infill(site, (45.0, ys[k] + 0.3), (45.0, ys[k + 1] - 0.3), 0.0, 3.0, "blocks", 2)
    scaffold(site, (45.7, 21.2), (45.7, 13.0), 7.2)


def _pit(site: Site) -> None:
    floor = -6.4
    raft = rectangle(28, -28, 46, -10)
    dots = [(30.0 + 4.7 * i, -26.0 + 4.7 * j) for i in range(4) for j in range(4)]
    walls = [((28.4, -20.0), (28.4, -10.4)), ((28.7, -10.4), (38.0, -10.4)), ((40.5, -17.5), (45.0, -17.5))]
    foundation(site, raft, floor, floor + 0.7, dots, walls)
    bulkheads(site, [(58.6, -41.5), (58.6, 6.6), (30, 6.6)], -1.0, 0.9)


def _yards(site: Site, sign: str) -> None:
    board = (site.material("hoarding", "#2f6f9a"), "#e8e6df")
    for path in ([(-60.0, -45.0), (-13.0, -45.0)], [(-5.0, -45.0), (60.0, -45.0)]):
        hoarding(site, path, board, sign)
    for path in ([(60.0, -45.0), (60.0, 52.4)], [(60.0, 52.4), (-60.0, 52.4)], [(-60.0, 52.4), (-60.0, -45.0)]):
        hoarding(site, path, board)
    offices(site, Turned(-57.5, 22.0, 0.0), 6, 3, ["#d9d6cc", "#3f78a8", "#d9d6cc", "#c8842c"])
    aggregate_bays(site, Turned(-57.5, -16.0, 0.0), ["gravel", "sand", "gravel:#7f7a72"])
    for k, x in enumerate((-42.0, -34.0, -26.0)):
        precast_stack(site, Turned(x, -33.0 + 0.8 * k, 0.0), 6, 7.0)
    for x, y, yaw in ((-44.5, -9.5, 90.0), (-22.0, -18.0, 0.0)):
        precast_stack(site, Turned(x, y, yaw), 5, 6.0, "concrete:#a9a498")
    for x, y in ((55.0, -47.4), (-40.0, -47.4), (20.0, -47.4)):
        site.place("street_lamp", x, y, -90.0)
    fence = LineString([(14.2, -33.0), (14.2, 6.8), (29.0, 6.8)])
    site.add(None, "pit_rail", guard_rails(fence, 0.0, material="paint:#d9532c", toe=None))
