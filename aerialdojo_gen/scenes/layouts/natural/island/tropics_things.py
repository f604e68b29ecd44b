"""What stands on the tropical island, place by place, in world coordinates: metres and degrees."""

from __future__ import annotations

from collections.abc import Mapping

from aerialdojo_gen.scenes.kit.natural_ground import Thing

_JETTY, _WALK = 1.5, 1.72
_OFF = {"place": "off the north shore"}

SQUARE = (
    Thing("shell_monument", -9.0, -13.0, -90.0, "pink"),
    Thing("market_stall", -3.2, -11.6, 180.0, "red_fruit"),
    Thing("market_stall", -4.0, -17.6, 140.0, "blue_fish"),
    Thing("kiosk", -7.0, -21.6, 100.0, "juice"),
    Thing("stone_well", -15.6, -15.4, 0.0, "red_roof"),
    Thing("clay_pots", -5.2, -7.6, 0.0, "rug"),
    Thing("ice_cream_cart", -13.4, -19.6, 60.0, "mint"),
    Thing("direction_sign", -2.0, -15.0, 0.0, "three_arms"),
    Thing("bicycle", -17.4, -18.8, 10.0, "yellow"),
)
VILLAGE = (
    Thing("scooter", 2.2, -10.6, 160.0, "cream"),
    Thing("clothes_line", -22.0, -8.6, 30.0, "mixed"),
    Thing("water_tank", 4.6, -5.0, 0.0, "blue"),
    Thing("barbecue", 11.6, -15.8, 180.0, "red"),
    Thing("hammock", 12.2, -23.4, 60.0, "red"),
    Thing("rabbit_hutch", -24.6, -4.6, -60.0, "natural"),
    Thing("golf_cart", 20.4, -15.6, 170.0, "green_roof"),
    Thing("wheelbarrow", -16.8, 3.4, 40.0, "red"),
    Thing("satellite_dish", 8.8, -9.8, -60.0, "white"),
    Thing("flagpole", -24.4, -12.4, 0.0, "orange"),
    Thing("solar_panels", -5.4, 0.6, -90.0, "blue"),
    Thing("cafe_table", -0.8, -20.6, 0.0, "green_chairs"),
    Thing("bench", -11.8, -6.2, -70.0, "green_arms"),
    Thing("litter_bin", -4.6, -14.0, 0.0, "wooden"),
    Thing("water_barrel", -23.8, -0.4, 0.0, "brown"),
    Thing("log_pile", -13.6, 0.0, 30.0, "spruce"),
    Thing("crate_stack", 5.8, -8.8, 20.0, "three"),
    Thing("rocking_chair", 11.6, -19.4, 150.0, "red_cushion"),
    Thing("pergola", 0.4, 3.0, 0.0, "wisteria"),
    Thing("birdhouse", -7.0, 4.6, 0.0, "blue"),
    Thing("axe_block", -19.6, 5.6, 0.0, "red"),
    Thing("seesaw", 12.4, -6.0, 30.0, "red"),
    Thing("swing_set", 18.6, -8.4, 90.0, "blue"),
    Thing("garden_swing", -27.6, -8.4, 0.0, "beige"),
    Thing("mountain_bike", 0.0, 9.4, 60.0, "green"),
)
JETTY = (
    Thing("fuel_pump", -13.4, -39.4, -90.0, "blue", lift_m=_JETTY),
    Thing("fish_crates", -12.8, -31.6, 180.0, "white_green_empty", lift_m=_JETTY),
    Thing("lifebuoy_stand", -13.6, -26.0, 180.0, "red_blue", lift_m=_JETTY),
)
LAGOON = (
    Thing("fishing_boat", -9.2, -34.6, 90.0, "green"),
    Thing("rowing_boat", -17.0, -30.0, 60.0, "red_oars_in"),
    Thing("rowing_boat", 16.6, -46.6, 80.0, "green"),
    Thing("sailboat", -25.6, -48.0, 40.0, "red_sails"),
    Thing("motor_yacht", 26.0, -54.0, 20.0, "wooden"),
    Thing("buoy", -6.6, -46.0, 0.0, "green_cone"),
    Thing("canoe", -21.6, -37.0, 20.0, "yellow"),
    Thing("navigation_beacon", -19.4, -60.0, 0.0, "yellow_black"),
)
STILTS = (
    Thing("deck_chair", 6.6, -62.0, -90.0, "green", lift_m=_WALK),
    Thing("telescope", 7.2, -55.2, -90.0, "white", lift_m=_WALK),
    Thing("lifebuoy_stand", 7.8, -44.6, 180.0, "orange", lift_m=_WALK),
)
WEST_BEACH = (
    Thing("beach_umbrella_set", -54.0, -18.0, 180.0, "red"),
    Thing("beach_umbrella_set", -50.4, -36.4, -140.0, "yellow"),
    Thing("deck_chair", -55.0, -25.6, 180.0, "red"),
    Thing("surfboard_stand", -47.6, -24.8, 180.0, "green_white"),
    Thing("volleyball_net", -50.0, -30.6, 20.0, "wooden"),
    Thing("beach_hut", -47.0, -15.0, 180.0, "pink"),
    Thing("lifeguard_tower", -55.6, -9.0, 180.0, "white"),
    Thing("sandcastle", -42.6, -38.6, -90.0, "blue_flag"),
    Thing("kite_stand", -57.0, -1.0, 180.0),
)
EAST_BEACH = (
    Thing("dinghy_on_trailer", 26.6, -37.2, -70.0, "green"),
    Thing("beach_umbrella_set", 36.0, -31.0, -40.0, "blue"),
    Thing("campfire", 30.0, -28.0, 0.0, "burning"),
    Thing("dome_tent", 26.0, -25.0, -60.0, "teal"),
    Thing("dome_tent", 33.6, -23.6, -100.0, "purple"),
    Thing("seagull_statue", 16.0, -38.6, -90.0, "bronze"),
    Thing("surfboard_stand", 40.6, -25.4, -30.0, "pink_blue"),
    Thing("quad_bike", 21.4, -31.0, 30.0, "green"),
)
TEMPLE = (
    Thing("pyramid_ruin", -32.0, 22.0, -35.0, "grey"),
    Thing("totem_pole", -20.8, 19.4, -35.0, "red_wings"),
    Thing("totem_pole", -27.0, 10.4, -35.0, "blue_wings"),
    Thing("standing_stone", -42.4, 14.0, 30.0, "carved"),
    Thing("stone_arch", -22.0, 31.4, 60.0, "mossy"),
    Thing("ruined_wall", -36.0, 36.4, 100.0, "sandstone"),
    Thing("tent", -47.8, 24.6, 10.0, "green"),
    Thing("information_board", -24.4, 7.0, -60.0, "green_map"),
    Thing("generator", -46.2, 31.0, 0.0, "green"),
)
JUNGLE = (
    Thing("treehouse", -10.0, 8.0, -60.0, "red"),
    Thing("fallen_log", -4.0, 24.0, 40.0, "rotten"),
    Thing("wild_boar", -14.0, 21.0, 120.0, "dark"),
    Thing("hunting_stand", -7.6, 34.0, -90.0, "camouflage"),
    Thing("mushroom_cluster", -2.4, 15.2, 0.0, "red"),
    Thing("beehive", -34.6, -4.4, -30.0, "yellow"),
    Thing("tree_stump", -41.0, 2.6, 0.0, "mossy"),
    Thing("trail_signpost", -18.6, 12.4, -120.0, "yellow"),
    Thing("outhouse", -29.4, -13.2, -20.0, "blue"),
    Thing("dead_tree", -48.6, 8.4, 0.0, "grey"),
)
VOLCANO = (
    Thing("weather_station", 12.8, 21.4, 180.0, "blue_vane"),
    Thing("stone_cairn", 24.6, 25.4, 0.0, "grey"),
    Thing("rock_pile", 8.0, 9.6, 0.0, "red"),
    Thing("solar_tracker", 22.8, 12.8, -90.0, "black"),
    Thing("off_road_buggy", 31.4, 6.6, 30.0, "red"),
    Thing("caravan", 38.6, 2.0, 200.0, "silver"),
    Thing("search_light", 27.6, 16.2, 0.0, "yellow"),
)
CAPE = (
    Thing("lighthouse", 59.0, -13.0, 180.0, "red_white"),
    Thing("anchor_monument", 51.0, -15.6, -90.0, "rusty"),
    Thing("oil_drums", 55.0, -18.4, 0.0, "blue_red"),
    Thing("bench", 63.6, -17.4, -60.0, "blue"),
    Thing("garden_shed", 54.6, -6.6, -60.0, "green"),
    Thing("telescope", 63.0, -7.2, 20.0, "red"),
    Thing("picnic_table", 47.0, -9.0, 10.0, "red"),
)
NORTH_SHORE = (
    Thing("sandstone_arch", -50.0, 40.0, -45.0, "pale"),
    Thing("canoe", -8.6, 49.6, 20.0, "green"),
    Thing("picnic_table", 0.6, 47.0, 60.0, "green"),
    Thing("fox", 14.0, 49.6, 150.0, "red"),
    Thing("rowing_boat", 34.0, 55.4, 30.0, "wooden", words=_OFF),
    Thing("rope_swing", -16.0, 45.4, 90.0, "yellow"),
    Thing("buoy", -34.0, 57.0, 0.0, "red_can", words=_OFF),
)

GROUPS: Mapping[str, tuple[Thing, ...]] = {
    "on the village square": SQUARE,
    "in the village": VILLAGE,
    "on the village jetty": JETTY,
    "in the lagoon": LAGOON,
    "between the huts on stilts": STILTS,
    "on the western beach": WEST_BEACH,
    "on the south-eastern beach": EAST_BEACH,
    "by the temple ruin": TEMPLE,
    "in the jungle": JUNGLE,
    "on the volcano": VOLCANO,
    "on the lighthouse cape": CAPE,
    "on the north shore": NORTH_SHORE,
}
