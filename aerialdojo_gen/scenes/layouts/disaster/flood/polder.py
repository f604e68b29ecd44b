"""A drowned polder: a farm with barn and byre, a windmill on its mound, orchard rows, and the gap in the sea dyke."""

from __future__ import annotations

import shapely

from aerialdojo_gen.scenes.grammar_buildings import pitched_roof
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle
from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import Pose, smooth_path
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.layouts.disaster.flood.water import (
    DEPTH_M,
    drift,
    dry,
    flat_house,
    flooded_house,
    on_roof,
    paint_bank,
    raised,
    standing_trees,
    streaks,
    wade,
    water_level,
    wires,
)
from aerialdojo_gen.scenes.layouts.parts.structures import Parts, block, columns
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

_DYKE_M = 3.6
_WEST = smooth_path([(-44.0, 20.0), (-26.0, 27.0), (-11.0, 27.5)])
_EAST = smooth_path([(7.0, 27.5), (24.0, 26.0), (44.0, 17.0)])
_MILL = (-24.0, -12.0)
_LOFT_M = 2.5


def build_polder(site: Site) -> None:
    """Build it."""
    _ground(site)
    _farm(site)
    _hay_barn(site)
    _mill(site)
    _dyke(site)
    _waters(site)


def _ground(site: Site) -> None:
    crests = [ribbon(_WEST, 4.0).union(disc(-22.0, 26.0, 6.0)), ribbon(_EAST, 4.0)]
    yard, mill = rectangle(14.0, -9.0, 22.0, 1.0), disc(*_MILL, 5.5)
    terrain = water_level(site)
    for crest in crests:
        terrain = raised(terrain, crest, _DYKE_M)
    terrain = raised(raised(terrain, yard, 0.9, 3.5), mill, 1.8, 5.0)
    site.set_ground(terrain, site.material("water", "water:#6f7256"))
    sea = shapely.Polygon([*_WEST, *_EAST, (46, 40), (-46, 40)])
    site.paint(sea, site.material("river", "water:#5f7276"))
    streaks(site, [[(-2, 36), (-2, 24), (2, 12), (12, 6)], [(-3, 24), (-8, 10), (-10, -4)]], 8.0)
    streaks(site, [[(-40, 36), (40, 35)]], 5.0)
    for area, slope, way in ((yard, 3.5, "yard"), (mill, 5.0, "mill_ground")):
        site.paint(dry(area, slope).buffer(0.6), site.material("mud", "mud"))
        site.paint(dry(area, slope).buffer(-0.4), site.material("bank", "grass"))
        site.paint(area, site.material(way, "cobbles"))
    paint_bank(site, crests, "track")


def _farm(site: Site) -> None:
    brick = site.material("farm_wall", "brick:#8a4638")
    flooded_house(site, Frame(4.0, -10.5, 90.0), HouseStyle(width_m=12.0, depth_m=8.5, wall=brick, trim="#f2efe6",
        roof="thatch", roof_m=4.0, door="#2f5a46"))  # fmt: skip
    byre = flat_house(site, 24.5, -16.0, 33.5, 2.5, storeys=1, wall=site.material("byre", "brick:#a2705a"),
                      facing_deg=180.0, trim="#2f5a46", roof="sheet_metal:#7f868a", parapet_m=0.2)  # fmt: skip
    on_roof(site, [("rocking_chair", 27.0, -12.6, 120.0), ("rabbit_hutch", 31.2, -8.4, 180.0),
                   ("water_barrel", 26.6, -5.8, 0.0), ("satellite_dish", 31.0, -1.6, -120.0)],
            byre, "on the metal roof of the cowshed")  # fmt: skip
    annex = flat_house(site, -8.0, -26.0, 1.0, -18.5, storeys=2, wall=site.material("annex", "plaster:#cfc6ae"),
                       facing_deg=90.0, trim="#5a3f2c")  # fmt: skip
    on_roof(site, [("clothes_line", -6.0, -20.6, 0.0), ("dome_tent", -1.4, -23.4, 90.0),
                   ("bicycle", -6.2, -24.6, 0.0)], annex,
            "on the roof of the farm hands' house")  # fmt: skip
    parts: Parts = []
    plan = rectangle(8.0, 8.0, 22.0, 17.5)
    planks = site.material("barn", "planks:#5a3a30")
    parts.append((planks, block(8.0, 8.0, 22.0, 17.5, -DEPTH_M, 3.4)))
    parts += pitched_roof(plan, 3.4, 4.6, planks, site.material("barn_roof", "roof_tiles:#a0523c"), overhang_m=0.6)
    doors = [block(x, 7.9, x + 2.6, 8.0, -DEPTH_M, 2.6) for x in (11.6, 15.8)]
    doors += [block(x - 0.7, 7.88, x + 0.7, 7.98, 3.4 - 0.2, 3.4 + 0.9) for x in (15.0,)]
    braces = [sweep(path=[(x, 7.86, -0.1), (x + 2.5, 7.86, 2.5)], section=(0.08, 0.16)) for x in (11.65, 15.85)]
    parts += [("planks:#7c2f28", merge(doors)), ("#f2efe6", merge(braces))]
    site.add("barn", "barn", parts, footprint=plan)


def _hay_barn(site: Site) -> None:
    """Build an open barn: a loft of hay over the water, a pitched roof on posts above it."""
    x0, y0, x1, y1 = -18.0, 3.0, -6.0, 11.0
    posts = [(x, y) for x in (x0 + 0.3, (x0 + x1) / 2, x1 - 0.3) for y in (y0 + 0.3, y1 - 0.3)]
    parts: Parts = [
        ("wood", columns(posts, -DEPTH_M, 6.2, 0.16, 6)),
        ("boards:#8d6f4c", block(x0, y0, x1, y1, _LOFT_M - 0.25, _LOFT_M)),
        ("wood", merge([block(x0, y, x1, y + 0.2, 6.0, 6.25) for y in (y0 + 0.2, y1 - 0.4)])),
        *pitched_roof(rectangle(x0, y0, x1, y1), 6.2, 2.0, "planks:#6a4a38", "corrugated:#7f8a86", overhang_m=0.5),
    ]
    site.add("hay_barn", "hay_barn", parts, {"material": "wooden"})
    for x, y in posts:
        site.occupy(disc(x, y, 0.3, 8))
    hay = [block(x, y, x + 1.9, y + 0.95, _LOFT_M + h, _LOFT_M + h + 0.62)
           for x, y, h in ((-17.4, 8.6, 0), (-17.4, 9.6, 0), (-15.4, 9.6, 0), (-17.3, 9.1, 0.63), (-17.4, 4.0, 0),
                           (-17.4, 5.0, 0), (-17.2, 4.5, 0.63))]  # fmt: skip
    site.add(None, "hay", [("thatch:#c9aa52", merge(hay))], footprint=rectangle(x0 + 0.5, y0 + 0.8, x0 + 4.6, y1))
    place = "in the loft of the hay barn"
    put(site, "birdhouse", -14.6, 6.2, 0.0, place, z=_LOFT_M)
    put(site, "camp_chair", -12.4, 8.4, -90.0, place, z=_LOFT_M)
    put(site, "backpack", -12.6, 5.4, 0.0, place, z=_LOFT_M)
    put(site, "dog_house", -9.4, 7.6, -45.0, place, z=_LOFT_M)


def _mill(site: Site) -> None:
    x, y = _MILL
    put(site, "dutch_windmill", x, y, 35.0, variant="white")
    put(site, "sandbag_wall", x + 6.2, y + 1.0, 10.0, "at the foot of the windmill", variant="white")
    put(site, "beehive", x - 1.0, y + 7.0, 90.0, "at the foot of the windmill")
    put(site, "wheelbarrow", x + 4.4, y - 4.6, 70.0, "at the foot of the windmill")


def _dyke(site: Site) -> None:
    crest = "on the dyke"
    put(site, "field_hospital_tent", -23.4, 26.4, 25.0, crest)
    put(site, "search_light", -14.2, 27.4, -20.0, crest)
    put(site, "sandbag_wall", -10.4, 27.5, 0.0, "at the gap in the dyke", variant="tan")
    put(site, "sandbag_wall", 6.6, 27.4, 180.0, "at the gap in the dyke", variant="grey")
    put(site, "wheel_loader", 13.2, 27.0, 175.0, crest)
    put(site, "evacuation_sign", 20.0, 26.0, -110.0, crest)
    put(site, "fire_engine", 26.4, 24.6, -25.0, crest)
    put(site, "barrier", 34.0, 21.4, 60.0, crest)
    put(site, "rubble_heap", -6.0, 26.4, 30.0, "in the gap of the dyke", z=site.ground_z(-6.0, 26.4) - 0.4)
    put(site, "rubble_heap", 2.4, 28.6, 200.0, "in the gap of the dyke", z=site.ground_z(2.4, 28.6) - 0.4)


def _waters(site: Site) -> None:
    put(site, "tractor", 17.6, -4.6, 110.0, "on the farmyard")
    put(site, "generator", 20.4, 0.0, 90.0, "on the farmyard")
    put(site, "rescue_boat", 9.0, 1.0, 200.0, "in the flooded farmyard", z=-0.15, variant="orange")
    put(site, "rescue_boat", -2.6, 17.0, 80.0, "in the current below the gap", z=-0.15, variant="grey")
    put(site, "rowing_boat", -4.4, -3.0, 150.0, "in front of the farmhouse", z=-0.1)
    put(site, "canoe", -14.8, -19.0, 30.0, "behind the windmill", z=-0.1)
    wade(site, "caravan", -14.6, -5.6, 70.0, "half under water in the meadow")
    wade(site, "pickup_truck", 12.8, -20.6, 15.0, "half under water on the farm track")
    wade(site, "hatchback", 22.6, -22.0, 170.0, "half under water on the farm track")
    wade(site, "overturned_car", 4.6, 4.6, 60.0, "in the flooded farmyard", 0.45)
    put(site, "garden_shed", 13.0, -28.6, 20.0, "in the drowned garden", z=-0.9)
    put(site, "greenhouse", 5.6, -28.2, 0.0, "in the drowned garden", z=-1.1)
    put(site, "trampoline", 19.4, -29.4, 0.0, "in the drowned garden", z=-0.45)
    put(site, "broken_power_pole", 38.0, -8.0, 120.0, "in the drowned field", z=-0.2)
    rows = [Pose(x, y, 37.0 * x + y) for x in (-38, -32.5, -27, -21.5) for y in (-31, -25.5)]
    rows += [Pose(x, y, 50.0 * y) for x in (-38.5, -32.5) for y in (-3.0, 4.0, 11.0)]
    rows += [Pose(x, y, 20.0 * x) for x, y in ((38, 6), (39, -1), (38.5, -16), (31, -24), (36, -31), (26, -33),
                                               (-3, -33), (24.5, 7.5))]  # fmt: skip
    standing_trees(site, rows, ["oak_tree", "urban_tree", "dead_tree", "birch_tree"])
    posts = [block(x - 0.08, y - 0.08, x + 0.08, y + 0.08, -DEPTH_M, 0.35) for y in (-16.0, 14.5)
             for x in range(-40, -27, 3)]  # fmt: skip
    site.add(None, "fence_posts", [("wood", merge(posts))])
    wires(site, [(-41.0, -20.4, 5.6), (-20.0, -20.6, 5.6), (-10.5, -14.6, 5.6), (11.0, -16.6, 5.6),
                 (36.0, -19.4, 5.6)])  # fmt: skip
    drift(site, shapely.union_all([rectangle(-40, -30, 40, -17), rectangle(-30, -4, 10, 18)]), ["floating_debris"],
          7.0, 8, "adrift on the flood")  # fmt: skip
