"""What stands on the northern islet, place by place, in world coordinates: metres and degrees."""

from __future__ import annotations

from collections.abc import Mapping

from aerialdojo_gen.scenes.kit.natural_ground import Thing

_DECK = 1.5

JETTY = (
    Thing("fish_crates", -6.9, -12.4, 0.0, "blue_orange_fish", lift_m=_DECK),
    Thing("fuel_pump", -7.2, -24.6, 0.0, "white_red", lift_m=_DECK),
    Thing("lifebuoy_stand", -7.2, -18.6, 0.0, "yellow", lift_m=_DECK),
)
INLET = (
    Thing("fishing_boat", -2.6, -18.0, 90.0, "blue"),
    Thing("rowing_boat", 3.4, -12.6, 110.0, "wooden"),
    Thing("rowing_boat", 4.4, -24.0, 60.0, "blue_oars_out"),
    Thing("buoy", 0.0, -31.0, 0.0, "green_cone"),
)
SEA = (
    Thing("sailboat", 20.0, -40.0, 25.0, "blue_furled"),
    Thing("tugboat", -36.0, -38.0, 200.0, "black_red"),
    Thing("buoy", 13.0, -47.0, 0.0, "yellow"),
    Thing("navigation_beacon", 33.0, -39.0, 0.0, "red_white"),
    Thing("navigation_beacon", -22.0, -43.0, 0.0, "green_white"),
    Thing("motor_yacht", 50.0, -18.0, 100.0, "white"),
)
SMALL_JETTY = (
    Thing("bench", 39.4, -24.6, 20.0, "backless", lift_m=_DECK),
    Thing("canoe", 33.6, -12.6, 30.0, "red"),
)
WEST_HAMLET = (
    Thing("clothes_line", -13.2, -16.8, 10.0, "white"),
    Thing("woodshed", -24.6, -7.0, -20.0, "full"),
    Thing("axe_block", -22.6, -3.4, 0.0, "red"),
    Thing("garden_gnome", -14.6, -6.6, 0.0, "red_blue"),
    Thing("greenhouse", -29.8, -14.2, 90.0, "wooden"),
    Thing("bicycle", -20.4, -14.8, 90.0, "green_basket"),
    Thing("mailbox", -13.4, -9.4, 20.0, "yellow"),
    Thing("log_pile", -29.4, -24.4, 10.0, "birch"),
    Thing("dog_house", -19.6, -22.8, 0.0, "red"),
)
EAST_HAMLET = (
    Thing("flagpole", 9.6, 6.4, 0.0, "tricolour"),
    Thing("garden_swing", 20.8, 1.8, -120.0, "green"),
    Thing("water_barrel", 22.0, -5.6, 0.0, "blue"),
    Thing("rabbit_hutch", 27.8, -11.0, 180.0, "green"),
    Thing("quad_bike", 12.6, -6.4, 100.0, "red"),
    Thing("barbecue", 27.8, -18.6, 160.0, "bowl"),
    Thing("satellite_dish", 23.4, -9.6, -60.0, "grey"),
)
MIDDLE = (
    Thing("phone_booth", -1.6, 0.8, -90.0, "red"),
    Thing("information_board", 1.8, 1.6, -90.0, "blue_map"),
    Thing("anchor_monument", -5.6, -2.2, -60.0, "white"),
    Thing("picnic_table", -3.4, 11.6, 30.0, "green"),
    Thing("wheelbarrow", -12.4, 4.0, 40.0, "blue"),
    Thing("bird_bath", -9.8, 13.2, 0.0, "grey_two"),
    Thing("outhouse", 9.4, 10.6, -90.0, "brown"),
    Thing("sawhorse", 2.6, 12.2, 60.0, "orange_saw"),
)
KNOLL = (
    Thing("lighthouse", 24.0, 19.0, -120.0, "black_white"),
    Thing("weather_station", 31.0, 21.6, 0.0, "red_vane"),
    Thing("generator", 21.4, 26.0, 90.0, "yellow"),
    Thing("telescope", 28.6, 12.8, -60.0, "white"),
    Thing("water_tank", 16.6, 22.8, 0.0, "wooden"),
    Thing("solar_panels", 29.8, 26.6, -90.0, "black"),
    Thing("garden_shed", 31.8, 15.4, -150.0, "red"),
    Thing("search_light", 17.4, 16.0, -120.0, "orange"),
)
MILL = (
    Thing("dutch_windmill", -29.0, 11.0, -100.0, "wooden_tall"),
    Thing("hay_bales", -34.6, 8.0, 30.0, "round_three"),
    Thing("tractor", -22.4, 14.6, 200.0, "green"),
    Thing("wooden_gate", -33.6, 2.6, 120.0, "white"),
    Thing("beehive", -22.4, 7.0, -90.0, "blue"),
    Thing("stone_well", -37.0, 19.4, 0.0, "green_roof"),
    Thing("crate_stack", -26.6, 17.6, 60.0, "grey"),
)
WEST_SHORE = (
    Thing("seagull_statue", -42.0, -12.6, 200.0, "white"),
    Thing("deck_chair", -44.4, 2.4, 180.0, "blue"),
    Thing("oil_drums", -34.0, -20.4, 0.0, "green"),
    Thing("carved_owl", -44.6, 10.4, 180.0, "grey"),
    Thing("dinghy_on_trailer", -40.2, -17.4, -120.0, "white"),
)
NORTH = (
    Thing("standing_stone", -8.4, 30.4, 60.0, "carved"),
    Thing("stone_cairn", 36.6, 29.4, 0.0, "white_top"),
    Thing("ruined_wall", -24.4, 29.4, 80.0, "grey"),
    Thing("tent", 4.6, 27.4, 80.0, "orange"),
    Thing("campfire", 0.6, 23.0, 0.0, "burning"),
    Thing("dead_tree", 10.4, 33.4, 0.0, "grey"),
    Thing("tree_stump", -15.6, 30.8, 0.0, "old"),
    Thing("deer", -36.4, 26.0, 30.0, "stag"),
    Thing("trail_signpost", -4.4, 19.6, 90.0, "white"),
)
EAST_SHORE = (
    Thing("rock_pile", 41.6, 17.6, 0.0, "grey"),
    Thing("hunting_stand", 40.0, 6.4, 0.0, "weathered"),
    Thing("fallen_log", 33.0, 2.6, 120.0, "birch"),
    Thing("fox", 29.0, 5.2, 200.0, "red"),
    Thing("surfboard_stand", 39.6, -5.0, -30.0, "green_white"),
    Thing("hammock", 31.6, -4.4, 60.0, "teal"),
)

GROUPS: Mapping[str, tuple[Thing, ...]] = {
    "on the main jetty": JETTY,
    "in the inlet": INLET,
    "out at sea": SEA,
    "at the small eastern jetty": SMALL_JETTY,
    "in the western hamlet": WEST_HAMLET,
    "in the eastern hamlet": EAST_HAMLET,
    "at the head of the inlet": MIDDLE,
    "on the lighthouse knoll": KNOLL,
    "on the windmill's hill": MILL,
    "on the western shore": WEST_SHORE,
    "on the northern heath": NORTH,
    "on the eastern shore": EAST_SHORE,
}
