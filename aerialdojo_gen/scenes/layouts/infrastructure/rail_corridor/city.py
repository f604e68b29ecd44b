"""A city station in a cutting between retaining walls: four electrified tracks, a goods yard, streets on both rims.

The line runs along x with its ground at z = 0; the streets lie `STREET_M` higher.
"""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy, columns, letters, railing, stairs
from aerialdojo_gen.scenes.layouts.infrastructure.rail_corridor.city_things import furnish_city
from aerialdojo_gen.scenes.layouts.infrastructure.rail_corridor.rail import (
    ballast,
    footbridge_roof,
    platform,
    portal,
    s_curve,
    shed_roof,
    track,
    wires,
)
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site

STREET_M = 7.4
PLATFORM_M = 1.2
NORTH, SOUTH = 22.0, -30.0
MAIN_LINES = (12.6, 8.0, -3.0, -7.6)
_EAST = 75.0
_WIRE_M = 6.15
_BRIDGE_X = (12.0, 15.6)
_ROAD_X = (38.0, 50.0)


def build_city(site: Site) -> None:
    """Build the station."""
    _streets(site)
    _tracks(site)
    _walls(site)
    _platforms(site)
    _footbridge(site)
    _road_bridge(site)
    _goods_shed(site)
    _buildings(site)
    furnish_city(site)


def _streets(site: Site) -> None:
    site.set_ground(material=site.material("yard", "gravel:#7d766b"))
    half = site.recipe.size_m[1] / 2
    wall = site.material("retaining_wall", "blocks:#8f8478")
    for y0, y1, road in ((NORTH, half, (35.0, 42.0)), (-half, SOUTH, (-41.0, -34.5))):
        site.paint(rectangle(-_EAST, y0, _EAST, y1), site.material("pavement", "paving:#b3a899"), STREET_M, wall)
        lane = rectangle(-_EAST, road[0], _EAST, road[1])
        crossing = rectangle(_ROAD_X[0] + 1.8, min(y0, road[0]), _ROAD_X[1] - 1.8, max(y1, road[1]))
        inner = crossing.intersection(rectangle(-_EAST, min(road[0], y0 if y0 == NORTH else road[0]), _EAST,
                                                max(road[1], y1 if y1 == SOUTH else road[1])))  # fmt: skip
        site.paint(lane.union(inner), "asphalt", STREET_M - 0.12, wall)
        middle = (road[0] + road[1]) / 2
        if y0 == NORTH:
            for y in (36.48, 37.92):
                site.paint(rectangle(-_EAST, y - 0.06, _EAST, y + 0.06), "steel", STREET_M - 0.12, wall)
        else:
            for x in np.arange(-_EAST + 2.0, _EAST - 4.0, 5.0):
                if not _ROAD_X[0] - 4 < x < _ROAD_X[1]:
                    site.paint(rectangle(x, middle - 0.08, x + 2, middle + 0.08), "marking", STREET_M - 0.12, wall)
    for k in range(7):
        x = 6.0 + k
        site.paint(rectangle(x, 35.2, x + 0.5, 41.8), "marking", STREET_M - 0.12, wall)
    site.paint(rectangle(-_EAST, -half, _EAST, -47.0), site.material("works", "gravel:#8d867a"), STREET_M, wall)
    site.paint(rectangle(-44, 31.4, 24, 34.4), site.material("square", "cobbles:#9a8f82"), STREET_M, wall)


def _tracks(site: Site) -> None:
    far = _EAST
    lines = [[(-far, y), (far, y)] for y in MAIN_LINES]
    yard = [(-62.0, -13.4), (44.0, -13.4), *s_curve((44.0, -13.4), (64.0, -7.6))[1:]]
    ramp = [(-64.0, -18.0), (16.0, -18.0), *s_curve((16.0, -18.0), (32.0, -13.4))[1:]]
    ballast(site, [*lines, yard, ramp], site.material("ballast", "gravel:#867e74"))
    for line in lines:
        track(site, line)
    track(site, yard, clear=rectangle(-far, -8.9, far, -2))
    track(site, ramp, clear=rectangle(-far, -14.7, far, -2))


def _walls(site: Site) -> None:
    """Give the retaining walls buttresses, a coping, blind arches and railings along the rims."""
    parts: Parts = []
    stone = site.material("retaining_wall", "blocks:#8f8478")
    for y, out, (a, b) in ((NORTH, -1, (-_EAST, _EAST)), (SOUTH, 1, (-_EAST, _EAST))):
        low, high = sorted((y, y + out * 0.5))
        piers, arches = [], []
        for x in np.arange(a + 3.0, b, 8.0):
            if out > 0 and -30 < x < 14:
                continue
            piers.append(block(x - 0.6, low, x + 0.6, high, 0.0, STREET_M - 0.5))
            arches.append(block(x + 1.6, min(y, y + out * 0.06), x + 6.4, max(y, y + out * 0.06), 1.6, 5.2))
        parts.append((stone, merge(piers)))
        parts.append(("brick:#75584a", merge(arches)))
        parts.append(("concrete:#c4c0b6", block(a, min(y, y + out * 0.62), b, max(y, y + out * 0.62),
                                                STREET_M - 0.5, STREET_M - 0.2)))  # fmt: skip
    site.add("retaining_walls", "retaining_wall", parts)
    fences: Parts = []
    for y, gaps in (
        (NORTH + 0.3, ((_BRIDGE_X[0], _BRIDGE_X[1]), (_ROAD_X[0], _ROAD_X[1]))),
        (SOUTH - 0.3, ((_BRIDGE_X[0], _BRIDGE_X[1]), (_ROAD_X[0], _ROAD_X[1]))),
    ):
        x = -_EAST
        for a, b in (*gaps, (_EAST, _EAST)):
            fences += railing([(x, y), (a, y)], STREET_M, pane="chain_link", frame="#3f5f4a")
            x = b
    site.add("rim_railings", "railing", fences)


def _platforms(site: Site) -> None:
    floor = site.material("platform", "paving:#a8a096")
    platform(site, -46.0, 14.35, 36.0, NORTH - 0.02, PLATFORM_M, floor)
    platform(site, -46.0, -1.25, 34.0, 6.25, PLATFORM_M, floor)
    frame, roof = site.material("canopy_frame", "#3f5f4a"), site.material("canopy", "corrugated:#8a9096")
    site.add(None, "platform_canopy", shed_roof(-42.0, 14.9, -4.0, 21.0, 5.6, PLATFORM_M, roof=roof, frame=frame,
                                                rows=(17.95,)))  # fmt: skip
    site.add(None, "platform_canopy", shed_roof(-42.0, -0.7, 7.5, 5.7, 5.6, PLATFORM_M, roof=roof, frame=frame))
    for x in (-62.0, -44.5, 9.6, 28.0, 60.0):
        lift = PLATFORM_M if -46 < x < 34 else 0.0
        portal(site, x, 21.3, -10.4, MAIN_LINES, foot=(lift, 0.0), z_m=8.2, wire_m=_WIRE_M)
    wires(site, -_EAST, _EAST, MAIN_LINES, _WIRE_M)


def _footbridge(site: Site) -> None:
    x0, x1 = _BRIDGE_X
    frame = site.material("canopy_frame", "#3f5f4a")
    parts: Parts = [("boards:#9a8a72", block(x0, SOUTH, x1, NORTH, STREET_M - 0.1, STREET_M)),
                    (frame, block(x0 + 0.1, SOUTH, x1 - 0.1, NORTH, STREET_M - 0.45, STREET_M - 0.1))]  # fmt: skip
    legs = [(x, y) for x in (x0 + 0.4, x1 - 0.4) for y in (2.5, 19.0)]
    parts.append((frame, columns(legs, PLATFORM_M, STREET_M - 0.4, 0.22)))
    parts.append(
        (frame, columns([(x, y) for x in (x0 + 0.4, x1 - 0.4) for y in (-10.4, -21.5)], 0.0, STREET_M - 0.4, 0.22))
    )
    for x, gaps in ((x0 + 0.08, ((17.2, 19.8),)), (x1 - 0.08, ((1.2, 3.8),))):
        y = SOUTH
        for a, b in (*gaps, (NORTH, NORTH)):
            parts += railing([(x, y), (x, a)], STREET_M, height_m=1.2, frame=frame)
            y = b
    # The departure board at its north end is higher than the roof.
    parts += footbridge_roof(x0, SOUTH + 0.5, x1, 13.2, STREET_M, roof="sheet_metal:#7d8a86", frame=frame)
    site.add("station_footbridge", "station_footbridge", parts)
    rise = STREET_M - PLATFORM_M
    flights = stairs((x0 - 12.0, 18.5), 0.0, 2.2, rise, 12.0, z_m=PLATFORM_M, stringer=frame)
    flights += stairs((x1 + 12.0, 2.5), 180.0, 2.2, rise, 12.0, z_m=PLATFORM_M, stringer=frame)
    site.add("footbridge_stairs", "stairs", flights)
    site.occupy(rectangle(x0 - 12, 17.2, x1, 19.8), 0, STREET_M)
    site.occupy(rectangle(x0, 1.2, x1 + 12, 3.8), 0, STREET_M)


def _road_bridge(site: Site) -> None:
    """Carry the cross street over the cutting on girders and rows of columns."""
    x0, x1 = _ROAD_X
    top = STREET_M - 0.12
    parts: Parts = [
        ("asphalt", block(x0 + 1.8, SOUTH, x1 - 1.8, NORTH, top - 0.4, top)),
        ("paving:#b3a899", merge([block(a, SOUTH, b, NORTH, top - 0.4, STREET_M)
                                  for a, b in ((x0, x0 + 1.8), (x1 - 1.8, x1))])),
    ]  # fmt: skip
    dashes = [
        block(43.92, y, 44.08, y + 2.0, top - 0.05, top + 0.01) for y in np.arange(SOUTH + 1.5, NORTH - 2.0, 5.0)
    ]
    parts.append(("marking", merge(dashes)))
    iron = site.material("girder", "#54707c")
    girders = [block(x, SOUTH, x + 0.35, NORTH, top - 0.75, STREET_M + 1.15) for x in (x0 - 0.35, x1)]
    ribs = [block(x, y - 0.08, x + 0.6, y + 0.08, top - 0.75, STREET_M + 1.1) for x in (x0 - 0.5, x1 - 0.1) for y in
            np.arange(SOUTH + 2.0, NORTH, 3.0)]  # fmt: skip
    parts.append((iron, merge([*girders, *ribs])))
    feet = [(x, y) for x in (39.5, 44.0, 48.5) for y in (-10.4, 2.6, 17.6)]
    parts.append(("concrete", columns(feet, 0.0, top - 0.7, 0.32)))
    parts.append(
        (
            "concrete",
            merge([block(x0 + 0.2, y - 0.4, x1 - 0.2, y + 0.4, top - 0.8, top - 0.4) for y in (-10.4, 2.6, 17.6)]),
        )
    )
    parts.append(("marking", letters("CENTRAL", 0.7, (x0 - 0.36, 2.5, STREET_M - 0.05), 180.0, 0.05)))
    site.add("road_bridge", "road_bridge", parts)


def _goods_shed(site: Site) -> None:
    """Build the goods platform against the south wall with a shed that is open to the tracks."""
    z = 1.35
    parts: Parts = [("blocks:#8f8a82", block(-30, SOUTH + 0.02, 10, -19.9, 0.0, z - 0.1)),
                    ("concrete", block(-30, SOUTH + 0.02, 10, -19.9, z - 0.1, z))]  # fmt: skip
    site.add("goods_platform", "platform", parts)
    brick, roof = site.material("shed", "brick:#8a5443"), site.material("shed_roof", "corrugated:#6f4a3e")
    x0, x1, top = -26.0, 2.0, 5.6
    walls = [block(x0, SOUTH + 0.1, x1, SOUTH + 0.4, z, top), block(x0, SOUTH + 0.4, x0 + 0.3, -22.4, z, top),
             block(x1 - 0.3, SOUTH + 0.4, x1, -22.4, z, top)]  # fmt: skip
    for x in np.linspace(x0, x1 - 0.8, 6):
        walls.append(block(x, -22.8, x + 0.8, -22.4, z, top))
    walls.append(block(x0, -22.8, x1, -22.4, top - 0.9, top))
    shed: Parts = [(brick, merge(walls))]
    shed += canopy(x0 - 0.4, SOUTH + 0.1, x1 + 0.4, -19.4, top, roof=roof, post="#4a4f4c")
    shed.append(("marking", letters("GOODS", 0.7, ((x0 + x1) / 2, -22.38, top - 0.8), 90.0, 0.06)))
    site.add("goods_shed", "goods_shed", shed)


def _buildings(site: Site) -> None:
    plan: Polygon = rectangle(-34, 23.4, 0, 30.8)
    wall, roof = site.material("station", "facade_brick:#a8624a"), site.material("station_roof", "shingles:#55645e")
    front: Parts = canopy(-30, 30.8, -4, 33.8, STREET_M + 3.6, roof="sheet_metal:#55645e", post="#3f5f4a",
                          posts=[(x, 33.5) for x in (-29.5, -22, -12, -4.5)], foot_m=STREET_M)  # fmt: skip
    front.append(("marking", letters("CENTRAL STATION", 1.0, (-17, 30.82, STREET_M + 4.6), 90.0, 0.08)))
    front.append(
        ("#3f5f4a", merge([block(x - 0.9, 30.7, x + 0.9, 30.9, STREET_M, STREET_M + 2.6) for x in (-25, -17, -9)]))
    )
    building(site, plan, wall=wall, roof=roof, storeys=2, storey_m=3.6, roof_kind="hip", roof_m=3.0, z=STREET_M,
             category="station_building", attributes={"material": "brick"}, extra=front)  # fmt: skip
    rows = [((-75, 45, -48, 56), "facade_flats:#c9b295", 3), ((-46, 45, -16, 56), "facade_brick:#8f4a3c", 3),
            ((-14, 45.5, 14, 56), "facade_office:#b8b4ac", 2), ((16, 45, 38, 56), "facade_flats:#b3bdb6", 3),
            ((52, 24, 75, 33), "facade_brick:#77604f", 2), ((51, 45, 75, 56), "facade_flats:#c3a58f", 3),
            ((-75, 24, -50, 33), "facade_flats:#c9b295", 2),
            ((-75, -56, -50, -46), "facade_industrial:#8fa0a8", 2),
            ((-12, -56, 20, -48), "facade_industrial:#a0876f", 1),
            ((54, -56, 75, -44), "facade_brick:#8a5a4a", 2)]  # fmt: skip
    for (x0, y0, x1, y1), face, storeys in rows:
        building(site, rectangle(x0, y0, x1, y1), wall=face, roof="gravel:#a09a90", storeys=storeys, z=STREET_M,
                 category="town_block")  # fmt: skip
    signal_box: Parts = [
        ("brick:#8a5443", block(-58, -26, -52, -22, 0.0, 3.0)),
        ("curtain_wall", block(-57.8, -25.8, -52.2, -22.2, 3.0, 5.4)),
        ("planks:#e0d8c4", merge([block(x, y, x + 0.2, y + 0.2, 3.0, 5.4)
                                   for x in (-58, -55.1, -52.2) for y in (-26, -22.2)])),
        ("shingles:#5a5048", slab(rectangle(-58.6, -26.6, -51.4, -21.4), 5.4, 5.65)),
        ("marking", letters("CENTRAL WEST", 0.4, (-55, -21.98, 2.2), 90.0, 0.04)),
    ]  # fmt: skip
    site.add("signal_box", "signal_box", signal_box, footprint=rectangle(-58, -26, -52, -22))
