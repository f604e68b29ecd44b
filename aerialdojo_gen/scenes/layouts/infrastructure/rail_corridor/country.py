"""A country station with a passing loop and a siding, between a level crossing and a stone viaduct over a brook.

The line runs along x with its ground at z = 0; the brook lies `VALLEY_M` below.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle, house
from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import place_along, s_curve
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.kit.rail import BED_M, arcade, ballast, butterfly_roof, rail_platform, tracks, upright
from aerialdojo_gen.scenes.kit.structures import Parts, Point, block, canopy, letters
from aerialdojo_gen.scenes.layouts.infrastructure.rail_corridor.country_things import furnish_country
from aerialdojo_gen.scenes.mesh import Floats, merge
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, mound, rolling_terrain

VALLEY_M = 10.0
PLATFORM_M = 1.05
ROAD_X = -34.0
ARCHES = ((20.5, 5.2, -6.4), (33.0, 5.2, -6.4), (45.5, 5.2, -6.4))
_ENDS = (14.0, 52.0)


def build_country(site: Site) -> None:
    """Build the station, its village and its valley."""
    site.set_ground(_terrain(site), site.material("meadow", "meadow"))
    _paint(site)
    _line(site)
    _viaduct(site)
    _station(site)
    _village(site)
    furnish_country(site, brook_x)


def brook_x(y: float) -> float:
    """Where the brook runs, metres east, at a northing in metres."""
    return 33.0 + 4.0 * float(np.sin(y / 13.0))


def _terrain(site: Site) -> Terrain:
    t = rolling_terrain(site.recipe.size_m, 1.6, site.recipe.seed, 1.3, 46.0)
    t = mound(t, (-50.0, 40.0), 30.0, 6.5)
    t = mound(t, (-58.0, -20.0), 34.0, 5.5)
    t = mound(t, (2.0, -48.0), 22.0, 3.0)
    t = mound(t, (58.0, -40.0), 26.0, 4.0)
    t = t.flattened(rectangle(-44, -23, 10, 31), 0.0, 8.0)
    t = t.flattened(rectangle(-62, -3.5, 12, 8), 0.0, 6.0)
    t = t.flattened(rectangle(50, -4, 62, 4), 0.0, 6.0)
    t = t.flattened(rectangle(ROAD_X - 4, -50, ROAD_X + 4, 50), 0.0, 7.0)
    corners = t.corners().reshape(*t.heights_m.shape, 3)
    away = np.abs(corners[..., 0] - (33.0 + 4.0 * np.sin(corners[..., 1] / 13.0)))
    deep = _smooth((19.0 - away) / 13.0)
    bed = _smooth((4.4 - away) / 2.0) * 0.6
    return replace(t, heights_m=t.heights_m * (1.0 - deep) - VALLEY_M * deep - bed)


def _smooth(t: Floats) -> Floats:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _paint(site: Site) -> None:
    half = site.recipe.size_m[1] / 2
    brook = [(brook_x(float(y)), float(y)) for y in np.arange(-half, half + 1.0, 3.0)]
    site.paint(ribbon(brook, 6.6), "gravel:#a59c8a")
    site.paint(ribbon(brook, 4.6), site.material("brook", "water:#55899a"))
    site.paint(ribbon([(x - 7.0, y) for x, y in brook], 1.6), site.material("path", "gravel:#c4b08a"))
    field: BaseGeometry = Polygon([(-29, -47), (-29, -27), (4, -28), (10, -38), (6, -47)])
    site.paint(field, site.material("field", "dirt:#9a7f58"))
    for y in np.arange(-46.0, -28.0, 1.8):
        site.paint(rectangle(-29, y, 10, y + 0.7).intersection(field.buffer(-0.6)), "grass:#7f9a45")
    site.paint(rectangle(-29, -22, 2, -10.8), site.material("yard", "gravel:#9a8f7c"))
    road = [(ROAD_X, -half), (ROAD_X, half)]
    lane = [(ROAD_X, 24.0), (8.0, 24.0)]
    site.paint(ribbon(road, 7.6).union(ribbon(lane, 7.0)), "gravel:#a49c8c")
    site.paint(ribbon(road, 5.6).union(ribbon(lane, 5.2)), "asphalt:#5f5f60")
    for y in np.arange(-half, half, 4.5):
        if not -4 < y < 9 and not 19 < y < 28:
            site.paint(rectangle(ROAD_X - 0.07, y, ROAD_X + 0.07, y + 2.0), "marking")
    site.paint(rectangle(-25, 18.6, 6, 21.4), site.material("forecourt", "cobbles:#a0907c"))
    site.paint(rectangle(ROAD_X - 2.8, -4.2, ROAD_X + 2.8, -3.8).union(
        rectangle(ROAD_X - 2.8, 8.4, ROAD_X + 2.8, 8.8)), "marking")  # fmt: skip


def _line(site: Site) -> None:
    far = site.recipe.size_m[0] / 2
    west, east = (-far, 0.0), (far, 0.0)
    loop: list[Point] = [*s_curve((-57.0, 0.0), (-44.0, 4.6)), *s_curve((3.0, 4.6), (13.5, 0.0))]
    siding: list[Point] = [(-28.0, -8.6), *s_curve((-5.0, -8.6), (13.0, 0.0))]
    gap = rectangle(ROAD_X - 2.9, -9, ROAD_X + 2.9, 9)
    ballast(site, lines=[[west, (_ENDS[0] + 0.5, 0.0)], [(_ENDS[1] - 0.5, 0.0), east], loop, siding])
    tracks(site, lines=[[west, east]], clear=gap)
    tracks(site, lines=[loop], clear=rectangle(-far, -1.4, far, 1.4).union(gap))
    tracks(site, lines=[siding], clear=rectangle(-far, -1.4, far, 1.4))
    # Planks between and beside the rails let the road cross.
    planks = []
    for y in (0.0, 4.6):
        for a, b in ((-0.6, 0.6), (-2.2, -0.84), (0.84, 2.2)):
            planks.append(block(ROAD_X - 2.8, y + a, ROAD_X + 2.8, y + b, BED_M - 0.1, BED_M + 0.19))
    site.add("crossing_planks", "crossing_planks", [("planks:#7d6a55", merge(planks))])


def _viaduct(site: Site) -> None:
    """Build the stone viaduct: arches with rings, a string course, parapets with refuges, ballast."""
    x0, x1 = _ENDS
    stone, pale = site.material("viaduct", "blocks:#a08a72"), site.material("viaduct_trim", "concrete:#bfae96")
    parts: Parts = [(stone, arcade(x0, x1, -VALLEY_M - 1.6, 0.0, ARCHES, 5.0))]
    rings = []
    for middle, radius, spring in ARCHES:
        upper = rectangle(middle - 9, spring, middle + 9, spring + 9)
        ring = _circle(middle, spring, radius + 0.6).difference(_circle(middle, spring, radius))
        rings.append(upright(ring.intersection(upper), 5.3))
        for x in (middle - radius - 0.35, middle + radius + 0.35):
            rings.append(block(x - 0.5, -2.7, x + 0.5, 2.7, spring - 0.45, spring))
    sides = [block(x0 - 1.5, s - 0.2, x1 + 1.5, s + 0.2, 0.0, 1.25) for s in (-2.4, 2.4)]
    caps = [block(x0 - 1.6, s - 0.3, x1 + 1.6, s + 0.3, 1.25, 1.4) for s in (-2.4, 2.4)]
    course = [block(x0 - 1.5, s - 0.35, x1 + 1.5, s + 0.35, -0.35, 0.0) for s in (-2.4, 2.4)]
    piers = [
        block(x - 0.7, s - 0.6, x + 0.7, s + 0.6, -VALLEY_M - 1.0, 0.0) for x in (26.75, 39.25) for s in (-2.5, 2.5)
    ]
    parts += [(pale, merge([*rings, *caps, *course])), (stone, merge([*sides, *piers]))]
    parts.append(("gravel:#867e74", block(x0 - 0.2, -2.2, x1 + 0.2, 2.2, -0.05, BED_M)))
    site.add("viaduct", "viaduct", parts, {"material": "stone"})
    for x in (x0, 26.75, 39.25, x1):
        site.occupy(rectangle(x - 2.2, -3.4, x + 2.2, 3.4))


def _circle(x: float, z: float, radius: float) -> BaseGeometry:
    return Polygon(
        [(x + radius * float(np.cos(a)), z + radius * float(np.sin(a))) for a in np.linspace(0, 2 * np.pi, 33)[:-1]]
    )


def _station(site: Site) -> None:
    floor = site.material("platform", "paving:#b0a694")
    rail_platform(site, box=(-30.0, 6.35, 2.0, 10.9), top_m=PLATFORM_M, floor=floor)
    rail_platform(site, box=(-27.0, -6.85, -6.0, -1.75), top_m=PLATFORM_M, floor=floor)
    frame = site.material("canopy_frame", "#7a3f38")
    plan: Polygon = rectangle(-22, 11.0, -9, 18.2)
    wall, roof = site.material("station", "plaster:#dcc9a0"), site.material("station_roof", "roof_tiles:#a5523f")
    extra: Parts = []
    for x in (-20.0, -17.5, -13.5, -11.0):
        for y, s in ((11.0, -1), (18.2, 1)):
            a, b = sorted((y - s * 0.05, y + s * 0.08))
            for z in (1.5, 4.7):
                extra.append(("window", block(x - 0.55, a, x + 0.55, b, z, z + 1.6)))
                extra.append(("#f0ead8", merge([block(x - 0.7, a, x + 0.7, b + 0.04, z - 0.15, z),
                                                block(x - 0.04, a, x + 0.04, b + 0.03, z, z + 1.6)])))  # fmt: skip
    extra.append(
        (frame, merge([block(-16.2, 10.9, -14.8, 11.1, PLATFORM_M, 3.4), block(-16.2, 18.1, -14.8, 18.3, 0.0, 2.6)]))
    )
    extra += canopy(-21.5, 7.6, -9.5, 11.0, 4.05, roof="corrugated:#8a5a4c", post=frame,
                    posts=[(x, 8.0) for x in (-21, -17.3, -13.7, -10)], foot_m=PLATFORM_M)  # fmt: skip
    extra.append(("#26382f", block(-18.2, 18.2, -12.8, 18.28, 3.4, 4.2)))
    extra.append(("marking", letters("MILLBROOK", 0.55, (-15.5, 18.29, 3.5), 90.0, 0.04)))
    building(site, plan, wall=wall, roof=roof, storeys=2, storey_m=3.3, roof_kind="gable", roof_m=3.0, z=0.0,
             category="station_house", attributes={"colour": "yellow"}, extra=extra)  # fmt: skip
    roofs = butterfly_roof(
        box=(-25.0, -6.4, -15.0, -2.3), z_m=4.2, foot_m=PLATFORM_M, spacing_m=4.0, roof="corrugated:#8a5a4c",
        frame=frame,
    )  # fmt: skip
    site.add(None, "platform_canopy", roofs)
    shed: Parts = [("planks:#8a5a42", merge([block(-27, -22, -26.8, -17, 0, 4), block(-20.2, -22, -20, -17, 0, 4),
                                             block(-27, -22, -20, -21.8, 0, 4), block(-27, -17.2, -25, -17, 0, 4),
                                             block(-22, -17.2, -20, -17, 0, 4), block(-25, -17.2, -22, -17, 3, 4)])),
                   ("corrugated:#6f6a62", block(-27.5, -22.5, -19.5, -16.4, 4.0, 4.25)),
                   ("marking", letters("GOODS", 0.5, (-23.5, -16.98, 3.25), 90.0, 0.04))]  # fmt: skip
    site.add("goods_shed", "goods_shed", shed)
    site.occupy(rectangle(-27.5, -22.5, -19.5, -16.4), 0, 4)
    keeper: Parts = [("brick:#9a6048", block(-42.5, 9.5, -38.5, 13.5, 0.0, 2.8)),
                     ("shingles:#5f564c", merge([block(-42.9, 9.1, -38.1, 13.9, 2.8, 3.0)])),
                     ("window", block(-38.52, 10.6, -38.44, 12.4, 1.0, 2.2)),
                     ("#f0ead8", block(-38.54, 10.4, -38.4, 12.6, 0.85, 1.0))]  # fmt: skip
    site.add("crossing_keeper", "crossing_keeper_hut", keeper, footprint=rectangle(-42.5, 9.5, -38.5, 13.5))


def _village(site: Site) -> None:
    styles = (
        ((-24.0, 34.0, -90.0), HouseStyle(wall="plaster:#e3d6b8", roof="roof_tiles:#a5523f", door="#3f6f4e")),
        ((-8.0, 35.0, -90.0), HouseStyle(wall="brick:#a0614c", roof="shingles:#5f5a55", garage=1, door="#2f5f9e")),
        ((-46.5, 22.0, 0.0), HouseStyle(wall="planks:#d8d2c2", roof="roof_tiles:#8a4a3c", porch_m=1.8)),
        ((-46.0, -32.0, 0.0), HouseStyle(width_m=11.0, wall="brick:#8f5a46",
                                            roof="roof_tiles:#7a4a3c", roof_kind="hip")),
    )  # fmt: skip
    for (x, y, yaw), style in styles:
        site.paint(Frame(x, y, yaw).area(rectangle(-7, -8, 8, 8)), "grass:#6d9a48")
        house(site, Frame(x, y, yaw), style)
    fence(site, [(-31.5, 28.4), (-16.5, 28.4)], "picket")
    fence(site, [(-14.0, 28.4), (1.0, 28.4)], "hedge")
    place_along(site, "wooden_fence", [(-28.8, -23.2), (1.5, -23.2)], 2.6, turn_deg=90.0)
    place_along(site, "wooden_fence", [(8.4, 19.8), (11.2, 12.5)], 2.6, turn_deg=90.0)
    put(site, "dutch_windmill", -50.0, 40.0, -40.0)
