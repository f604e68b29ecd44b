"""A village street under water: two rows of houses, a church, a school that people fled to, a dyke with a breach."""

from __future__ import annotations

import shapely

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle
from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.layouts.disaster.flood.water import (
    DEPTH_M,
    drift,
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
from aerialdojo_gen.scenes.layouts.parts.structures import block
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site

_DYKE_M = 3.0
_WEST = [(-46.0, -27.5), (-24.0, -29.0), (1.0, -28.0)]
_EAST = [(20.0, -28.0), (34.0, -28.5), (46.0, -27.5)]


def build_village(site: Site) -> None:
    """Build it."""
    _ground(site)
    _north_row(site)
    _south_row(site)
    _street(site)
    _dyke(site)
    _waters(site)


def _ground(site: Site) -> None:
    crests = [ribbon(_WEST, 5.0).union(disc(-20.0, -29.5, 6.5)), ribbon(_EAST, 5.0)]
    terrain = water_level(site)
    for crest in crests:
        terrain = raised(terrain, crest, _DYKE_M)
    site.set_ground(terrain, site.material("water", "water:#85704f"))
    river = rectangle(-46, -42, 46, -27.0)
    site.paint(river, site.material("river", "water:#7a6a50"))
    streaks(site, [[(10, -40), (10, -26), (9, -16), (2, -8), (-6, -2)], [(11, -26), (16, -10), (24, -1)]], 7.0)
    streaks(site, [[(-44, 0), (44, 1)], [(-44, -38), (44, -37)]], 5.0)
    paint_bank(site, crests, "track")
    for crest in crests:
        site.paint(crest.buffer(-1.2), site.material("ruts", "dirt"))


def _north_row(site: Site) -> None:
    wall, second = site.material("house_wall", "plaster:#d9c9a4"), site.material("house_wall_two", "plaster:#b9c4bd")
    flooded_house(site, Frame(-33.0, 14.0, -90.0), HouseStyle(wall=wall, roof="roof_tiles:#9a4f3a", door="#3f5f7a"))
    bakery = flat_house(site, -24.0, 8.5, -13.5, 17.5, storeys=1, wall="brick:#9a5a44", name="BAKERY", trim="#f2efe6")
    on_roof(site, [("bicycle", -22.0, 11.0, 20.0), ("rocking_chair", -18.5, 14.8, -60.0),
                   ("air_conditioner", -15.6, 11.2, 0.0)], bakery, "on the flat roof of the bakery")  # fmt: skip
    flooded_house(site, Frame(-5.5, 13.5, -90.0), HouseStyle(width_m=8.5, wall=second, roof="shingles:#5c5a58",
                                                             door="#7a3f34", roof_kind="hip"))  # fmt: skip
    school = flat_house(site, 3.0, 8.5, 21.0, 24.5, storeys=2, wall=site.material("school", "brick:#b58a63"),
                        name="VILLAGE SCHOOL", trim="#3f6f8a")  # fmt: skip
    put(site, "helicopter", 13.4, 17.8, 200.0, "on the roof of the school", z=school)
    on_roof(site, [("stretcher", 5.2, 12.6, 80.0), ("dome_tent", 5.8, 21.2, 10.0), ("generator", 11.0, 10.6, 0.0),
                   ("cardboard_boxes", 17.6, 10.6, 30.0), ("water_barrel", 19.2, 22.6, 0.0)],
            school, "on the roof of the school")  # fmt: skip
    put(site, "village_church", 31.0, 17.0, -90.0, z=-DEPTH_M, variant="cream")
    put(site, "water_tower", -30.0, 32.0, z=-DEPTH_M)


def _south_row(site: Site) -> None:
    wall, second = site.material("house_wall", "plaster:#d9c9a4"), site.material("house_wall_two", "plaster:#b9c4bd")
    flooded_house(site, Frame(-31.5, -11.0, 90.0), HouseStyle(width_m=8.0, depth_m=7.4, wall=second,
                                                             roof="roof_tiles:#a5583c", door="#4a6a4a"))  # fmt: skip
    inn = flat_house(site, -24.0, -15.0, -12.5, -7.0, storeys=2, wall=site.material("inn", "plaster:#c98f6a"),
                     name="THE SWAN INN", facing_deg=90.0, trim="#5a3f2c")  # fmt: skip
    on_roof(site, [("clothes_line", -21.6, -12.6, 0.0), ("satellite_dish", -14.4, -8.9, -90.0),
                   ("dog_house", -17.4, -9.2, 30.0), ("camp_chair", -19.0, -13.4, 45.0),
                   ("cooler_box", -16.4, -13.2, 0.0)], inn, "on the roof of the inn")  # fmt: skip
    flooded_house(site, Frame(-3.0, -11.5, 90.0), HouseStyle(wall=wall, roof="roof_tiles:#8f4a38", door="#35506a",
                                                            garage=1))  # fmt: skip
    shop = flat_house(site, 9.0, -15.5, 20.0, -7.5, storeys=1, wall=site.material("shop", "planks:#8fa08a"),
                      name="GARAGE", facing_deg=90.0, trim="#f2efe6")  # fmt: skip
    on_roof(site, [("barbecue", 11.0, -13.4, 0.0), ("wheelbarrow", 14.6, -10.0, 60.0),
                   ("solar_panels", 17.6, -13.0, -90.0)], shop, "on the flat roof of the workshop")  # fmt: skip
    flooded_house(site, Frame(30.0, -11.5, 90.0), HouseStyle(width_m=9.5, wall=second, roof="shingles:#6a5a50",
                                                            door="#7a3f34", porch_m=2.0))  # fmt: skip


def _street(site: Site) -> None:
    street = "half under water in the village street"
    for category, x, y, yaw in (
        ("sedan", -26.0, 2.6, 5.0), ("hatchback", -12.0, -2.4, 170.0), ("delivery_van", 5.0, 3.4, 200.0),
        ("suv", 21.5, -1.8, 20.0), ("city_bus", -36.0, -2.0, 12.0), ("pickup_truck", 34.0, 3.0, 155.0),
    ):  # fmt: skip
        wade(site, category, x, y, yaw, street)
    wade(site, "overturned_car", 0.5, -3.6, 70.0, "in the village street", 0.45)
    for x, y, yaw in ((-19.0, 4.4, -90.0), (2.0, 6.4, -90.0), (25.5, 4.6, -90.0)):
        put(site, "street_lamp", x, y, yaw, "in the drowned street", z=-DEPTH_M)
    put(site, "bus_shelter", -7.6, 6.0, -90.0, "in the drowned street", z=-1.2)
    put(site, "phone_booth", 22.6, 5.4, -90.0, "in the drowned street", z=-1.0)
    put(site, "stop_sign", -28.0, -4.6, 0.0, "in the drowned street", z=-0.9)
    put(site, "rescue_boat", -4.0, 1.2, 10.0, "in the village street", z=-0.15, variant="orange")
    put(site, "rescue_boat", 13.5, 0.6, 185.0, "in front of the school", z=-0.15, variant="grey")
    put(site, "rescue_boat", 6.0, -20.0, 100.0, "in the current of the breach", z=-0.15, variant="red")
    put(site, "rowing_boat", -18.0, -0.6, 20.0, "in the village street", z=-0.1)
    put(site, "canoe", 22.8, -11.5, 80.0, "in the lane beside the workshop", z=-0.1)
    put(site, "wheelie_bin", 17.2, 4.6, 30.0, "in the village street", z=-0.3)
    put(site, "broken_power_pole", -9.4, -9.0, 75.0, "between the houses", z=-0.15)
    wires(site, [(-42.0, 5.6, 6.0), (-22.5, 5.6, 6.0), (-1.6, 5.6, 6.0), (24.0, 5.9, 6.0), (42.0, 5.6, 6.0)])
    hedge = site.material("hedge", "hedge:#5a6a3a")
    for x0, y0, x1, y1 in ((-28.0, -17.0, -27.4, -6.0), (3.4, -18.0, 4.0, -6.5), (-10.2, 8.0, -9.6, 20.0)):
        area = rectangle(x0, y0, x1, y1)
        site.add(None, "garden_hedge", [(hedge, merge([block(x0, y0, x1, y1, -DEPTH_M, 0.5)]))], footprint=area)


def _dyke(site: Site) -> None:
    crest = "on the dyke"
    put(site, "rescue_tent", -23.0, -29.6, 60.0, crest)
    put(site, "field_kitchen", -16.6, -31.6, 100.0, crest)
    put(site, "ambulance", -9.6, -28.6, 178.0, crest)
    put(site, "search_light", -4.4, -29.2, 30.0, crest)
    put(site, "sandbag_wall", -0.2, -27.9, 0.0, "at the edge of the breach", variant="tan")
    put(site, "fire_engine", 27.4, -28.2, 2.0, crest)
    put(site, "evacuation_sign", 33.4, -27.4, 90.0, crest)
    put(site, "sandbag_wall", 21.2, -27.9, 180.0, "at the edge of the breach", variant="grey")
    put(site, "excavator", 39.0, -28.4, 180.0, crest)
    put(site, "sandbag_wall", -15.6, -18.4, 90.0, "behind the inn", z=-0.35, variant="white")
    put(site, "sandbag_wall", -18.8, 7.2, 90.0, "before the bakery", z=-0.35, variant="grey")
    put(site, "rubble_heap", 5.6, -27.4, 40.0, "in the breach of the dyke", z=site.ground_z(5.6, -27.4) - 0.4)
    put(site, "rubble_heap", 15.8, -28.8, 190.0, "in the breach of the dyke", z=site.ground_z(15.8, -28.8) - 0.4)
    put(site, "barrier", -30.0, -28.2, 90.0, crest)
    put(site, "portable_toilet", -29.0, -30.6, 30.0, crest)


def _waters(site: Site) -> None:
    garden = rectangle(-42, 22, 42, 38)
    trees = [Pose(x, y, 40.0 * x) for x, y in ((-40, 22), (-20, 27), (-12, 33), (-3, 24), (0, 33), (9, 31), (19, 33),
             (28, 34), (38, 30), (41, 8), (-41, 6), (-26, -19), (24.5, -19), (37, -18), (-38, -19),
             (-7, 28))]  # fmt: skip
    standing_trees(site, trees, ["urban_tree", "birch_tree", "urban_tree", "oak_tree"])
    put(site, "greenhouse", -14.0, 25.6, 0.0, "in the drowned gardens", z=-1.1)
    put(site, "garden_shed", -24.0, 24.0, 12.0, "in the drowned gardens", z=-1.0)
    put(site, "trampoline", 1.0, 27.6, 0.0, "in the drowned gardens", z=-0.4)
    put(site, "picnic_table", -7.2, -20.4, 25.0, "behind the houses", z=-0.25)
    put(site, "swing_set", 22.5, 29.6, 0.0, "in the drowned gardens", z=-1.0)
    drift(site, shapely.union_all([rectangle(-40, -22, 40, -17), rectangle(-40, -5, 40, 5), garden]),
          ["floating_debris"], 7.0, 9, "adrift on the flood")  # fmt: skip
