"""What stands at each place of the forest, in the frame of its spot: x along the spot's yaw, metres, degrees."""

from __future__ import annotations

from aerialdojo_gen.scenes.kit.natural_ground import Thing

_PORCH = {"place": "on the cabin's porch"}
_DECK = {"place": "on the fire tower's deck"}

CABIN = (
    Thing("log_cabin", 0.0, 0.0, variant="green_door", lift_m=0.15, words={"place": "in the north-western clearing"}),
    Thing("rocking_chair", 3.9, 1.5, 0.0, "red_cushion", lift_m=0.6, words=_PORCH),
    Thing("flower_tub", 5.6, -2.6, 0.0, "pink", words={"place": "beside the cabin's steps"}),
    Thing("water_barrel", 0.4, -3.4, -90.0, "blue", words={"place": "against the cabin's side"}),
    Thing("woodshed", -2.6, -7.4, 60.0, "full", words={"place": "beside the log cabin"}),
    Thing("axe_block", 2.4, -6.0, 20.0, "red", words={"place": "in front of the woodshed"}),
    Thing("sawhorse", 5.2, -5.6, 60.0, "orange_saw", words={"place": "in front of the woodshed"}),
    Thing("outhouse", -4.6, 6.2, -30.0, "brown", words={"place": "behind the log cabin"}),
    Thing("stone_well", 5.4, 5.4, -20.0, "red_roof", words={"place": "in front of the log cabin"}),
    Thing("wheelbarrow", 8.6, -3.2, 130.0, "green", words={"place": "in front of the log cabin"}),
    Thing("trail_signpost", 8.6, 1.8, 180.0, "white", words={"place": "on the path to the log cabin"}),
    Thing("mountain_bike", 1.6, 4.3, 8.0, "orange", words={"place": "beside the log cabin"}),
    Thing("log_pile", -7.0, -9.8, 35.0, "spruce", words={"place": "behind the woodshed"}),
)

TOWER = (
    Thing("fire_tower", 0.0, 0.0, 20.0, "red", words={"place": "on the knoll in the north-east"}),
    Thing("cooler_box", -1.64, -0.62, 20.0, "red", lift_m=11.22, words=_DECK),
    Thing("fuel_drum", -0.4, 0.3, 0.0, "rusty", words={"place": "under the fire tower"}),
    Thing("weather_station", -5.0, 3.0, 140.0, "red_vane"),
    Thing("quad_bike", -4.4, -0.4, 100.0, "green", words={"place": "at the foot of the fire tower"}),
    Thing("stone_cairn", -4.4, -4.2, 0.0, "white_top"),
    Thing("information_board", 4.8, 2.4, -20.0, "green_map", words={"place": "at the foot of the fire tower"}),
    Thing("telescope", -0.4, -5.4, -60.0, "white"),
)

CAMP = (
    Thing("campfire", 0.0, 0.0, 0.0, "burning", words={"place": "in the middle of the camp site"}),
    Thing("tent", -4.6, 2.6, -25.0, "orange"),
    Thing("tent", -5.6, -2.4, 30.0, "blue"),
    Thing("dome_tent", -0.6, 5.6, -90.0, "yellow"),
    Thing("camp_chair", 1.5, 1.9, -125.0, "red", words={"place": "by the campfire"}),
    Thing("tree_stump", 2.7, -1.0, 0.0, "mossy", words={"place": "by the campfire"}),
    Thing("cooking_tripod", -0.4, -3.4, 0.0, "black"),
    Thing("log_pile", 3.8, 4.6, -40.0, "birch"),
    Thing("sawhorse", -2.9, -4.6, 60.0, "blue_saw"),
    Thing("hammock", 3.4, -5.2, 150.0, "teal"),
    Thing("tent", -8.6, 1.4, 0.0, "green", words={"place": "behind the tents"}),
    Thing("carved_owl", 6.4, 1.2, 180.0, "grey", words={"place": "at the camp site's entrance"}),
)

PICNIC = (
    Thing("picnic_table", 0.0, 0.0, 30.0, "brown"),
    Thing("picnic_table", -3.6, 2.6, -10.0, "green"),
    Thing("cooler_box", 1.6, -2.2, 60.0, "blue", words={"place": "beside the brown picnic table"}),
    Thing("hammock", 0.8, -5.4, 90.0, "red"),
    Thing("birdhouse", -3.4, -3.0, 0.0, "blue"),
    Thing("carved_owl", 4.8, 2.0, 0.0, "brown"),
    Thing("water_barrel", 4.4, -3.0, 0.0, "brown"),
)

POND_SIDE = (
    Thing("canoe", 5.2, 6.0, 35.0, "red"),
    Thing("canoe", -3.5, 5.2, 20.0, "green"),
    Thing("log_bench", 5.8, 1.8, 180.0, "with_back"),
    Thing("deer", -1.2, -6.4, 100.0, "stag", words={"place": "drinking at the pond"}),
    Thing("rock_pile", -6.4, -2.6, 20.0, "grey"),
)

RUIN = (
    Thing("stone_arch", 0.0, 0.0, 10.0, "mossy"),
    Thing("ruined_wall", -5.4, 2.6, 30.0, "grey"),
    Thing("standing_stone", 2.0, -5.4, 60.0, "carved"),
    Thing("totem_pole", 4.6, 4.2, -20.0, "red_wings", words={"place": "beside the ruin"}),
    Thing("fox", -2.0, -3.4, 40.0, "red"),
)

APIARY = (
    Thing("beehive", 0.0, -1.9, 0.0, "yellow"),
    Thing("beehive", 0.0, 0.0, 0.0, "blue"),
    Thing("beehive", 0.0, 1.9, 0.0, "green"),
    Thing("birdhouse", 2.2, -3.0, 0.0, "yellow", words={"place": "beside the bee yard"}),
)

CROSSROADS = (
    Thing("trail_signpost", 1.6, 1.4, 30.0, "yellow"),
    Thing("tree_stump", -2.2, 2.6, 0.0, "fresh", words={"place": "near the crossing of the paths"}),
    Thing("mushroom_cluster", 2.8, -1.6, 200.0, "brown", words={"place": "beside the path to the picnic place"}),
)

STRAYS = {
    "in the south-eastern wood": (
        Thing("hunting_stand", 7.0, -19.0, 120.0, "brown"),
        Thing("wild_boar", 13.8, -20.6, 200.0, "dark"),
        Thing("brown_bear", 19.5, -17.0, 130.0, "black"),
    ),
    "in the northern wood": (
        Thing("hunting_stand", -16.5, 20.5, -60.0, "camouflage"),
        Thing("brown_bear", -6.4, 21.0, -40.0, "brown"),
    ),
    "beside the path to the bridge": (
        Thing("information_board", 2.6, -13.4, 150.0, "blue_map"),
        Thing("mushroom_cluster", 3.6, -9.6, 0.0, "red"),
    ),
    "between the cabin and the ruin": (
        Thing("wooden_gate", -13.2, -1.4, 188.0, "white", words={"place": "across the path to the ruin"}),
        Thing("birdhouse", -16.6, 3.2, -10.0, "red"),
    ),
    "between the tower and the picnic place": (
        Thing("boulder", 9.6, 7.4, 40.0, "sandstone"),
        Thing("deer", 20.4, 10.2, 210.0, "doe"),
        Thing("oak_tree", 5.6, 4.9, 0.0, "russet"),
    ),
    "between the cabin and the fire tower": (Thing("fallen_log", 1.4, 10.2, 70.0, "mossy"),),
    "east of the pond": (
        Thing("rock_pile", 20.6, -4.0, 0.0, "red"),
        Thing("birch_tree", 21.0, -11.5, 0.0, "golden"),
    ),
    "south of the stream": (
        Thing("dead_tree", -19.5, -14.5, 0.0, "grey"),
        Thing("bush", 5.4, -14.6, 0.0, "red_berries"),
    ),
    "at the camp site": (
        Thing("dome_tent", -2.6, -19.0, 120.0, "purple"),
        Thing("axe_block", -3.8, -10.6, 0.0, "blue"),
    ),
    "at the picnic place": (Thing("picnic_table", 8.6, -2.4, 70.0, "red"),),
    "beside the path to the picnic place": (Thing("mountain_bike", 6.0, -0.1, 30.0, "blue"),),
    "beside the path to the ruin": (Thing("stone_cairn", -8.5, -3.2, 0.0, "grey"),),
    "near the footbridge": (Thing("trail_signpost", -3.2, -9.2, 80.0, "red_top"),),
    "between the bee yard and the fire tower": (
        Thing("fox", 4.2, 13.2, -60.0, "grey"),
        Thing("wheelbarrow", 2.6, 15.6, 150.0, "red"),
    ),
    "in the wood behind the woodshed": (Thing("mushroom_cluster", -19.5, 13.2, 0.0, "orange"),),
    "near the crossing of the paths": (Thing("standing_stone", -3.8, -1.2, 40.0, "plain"),),
    "between the log cabin and the bee yard": (Thing("weather_station", -4.4, 13.4, 60.0, "blue_vane"),),
    "south of the bee yard": (Thing("tree_stump", 0.8, 13.6, 0.0, "old"),),
}
