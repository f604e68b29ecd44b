"""What stands on the cliff coast, place by place, in world coordinates: metres and degrees."""

from __future__ import annotations

from collections.abc import Mapping

from aerialdojo_gen.scenes.kit.natural_ground import Thing

_JETTY, _MOLE = 1.8, 2.2

COVE = (
    Thing("fishing_boat", -2.6, 1.4, 170.0, "blue"),
    Thing("fishing_boat", -4.6, -6.4, 200.0, "white"),
    Thing("rowing_boat", -5.0, 10.8, 30.0, "green"),
    Thing("rowing_boat", -16.6, -6.0, 70.0, "red_oars_in"),
    Thing("buoy", -17.6, 5.0, 0.0, "red_can"),
)
SEA = (
    Thing("sandstone_arch", -51.0, -19.0, 30.0, "pale"),
    Thing("sailboat", -46.0, 14.0, 60.0, "wooden_furled"),
    Thing("tugboat", -32.0, 3.0, 20.0, "green_orange"),
    Thing("buoy", -40.0, -6.0, 0.0, "yellow"),
    Thing("navigation_beacon", -26.0, -10.0, 0.0, "yellow_black"),
)
MOLE = (
    Thing("mooring_bollard", -10.0, 10.6, 0.0, "yellow_cap", lift_m=_MOLE),
    Thing("harbour_crane", -8.6, 2.8, 180.0, "red", lift_m=_MOLE),
    Thing("lifebuoy_stand", -8.4, 15.4, 180.0, "red_blue", lift_m=_MOLE),
)
SOUTH_MOLE = (
    Thing("telescope", -12.0, -11.0, 120.0, "white", lift_m=_MOLE),
    Thing("bench", -12.4, -15.0, 180.0, "green_arms", lift_m=_MOLE),
)
JETTIES = (
    Thing("fish_crates", -1.0, 6.0, 180.0, "red_yellow_fish", lift_m=_JETTY),
    Thing("fuel_pump", -4.6, 6.6, -90.0, "green", lift_m=_JETTY),
    Thing("mooring_bollard", -4.4, -10.4, 0.0, "red", lift_m=_JETTY),
)
BEACH = (
    Thing("anchor_monument", 6.4, 3.6, 180.0, "black"),
    Thing("canoe", 4.6, -4.4, 100.0, "yellow"),
    Thing("dinghy_on_trailer", 7.0, -8.0, 190.0, "yellow"),
    Thing("crate_stack", 7.6, 7.4, -60.0, "three"),
)
SQUARE = (
    Thing("cafe_table", 13.6, 2.0, 0.0, "green_chairs"),
    Thing("phone_booth", 9.6, 2.6, -90.0, "red"),
    Thing("market_stall", 10.6, -4.2, 90.0, "blue_fish"),
    Thing("street_lamp", 17.0, -4.0, 90.0, "single"),
    Thing("mailbox", 16.8, 2.2, -90.0, "red"),
)
STREET = (
    Thing("pickup_truck", 27.4, -4.4, 4.0, "blue_crates"),
    Thing("scooter", 21.6, 2.6, 10.0, "mint"),
    Thing("delivery_van", 45.0, -5.8, 185.0, "red"),
    Thing("planter", 30.8, 2.8, 0.0, "long_pink"),
    Thing("litter_bin", 20.4, -4.4, 90.0, "wooden"),
    Thing("direction_sign", 43.4, 1.8, 180.0, "three_arms"),
)
GARDENS = (
    Thing("clothes_line", 20.6, 5.6, 10.0, "pastel"),
    Thing("garden_swing", 30.6, 10.8, -90.0, "beige"),
    Thing("barbecue", 19.8, -15.2, 90.0, "black"),
    Thing("dog_house", 29.4, -14.6, 90.0, "blue"),
    Thing("greenhouse", 14.4, 21.6, 0.0, "white"),
    Thing("wheelie_bin", 26.0, 22.6, -90.0, "mixed"),
    Thing("bird_bath", 36.6, 17.4, 0.0, "sandstone"),
    Thing("garden_shed", 36.4, 22.4, 180.0, "brown"),
    Thing("lawn_mower", 39.4, -16.6, 40.0, "red_bag"),
    Thing("satellite_dish", 39.2, -12.2, -60.0, "white"),
)
NORTH_HEAD = (
    Thing("lighthouse", -33.0, 33.0, -60.0, "stone"),
    Thing("generator", -26.6, 36.6, 0.0, "blue"),
    Thing("weather_station", -27.0, 29.6, 0.0, "blue_vane"),
    Thing("bench", -26.0, 24.2, -110.0, "wooden"),
    Thing("information_board", -23.4, 30.6, -60.0, "green_map"),
    Thing("solar_panels", -28.4, 41.0, -90.0, "blue"),
    Thing("stone_cairn", -14.6, 29.6, 0.0, "grey"),
    Thing("deck_chair", -16.0, 23.6, -100.0, "green"),
)
SOUTH_HEAD = (
    Thing("ruined_wall", -27.4, -36.6, 30.0, "grey"),
    Thing("telescope", -39.0, -31.6, 200.0, "red"),
    Thing("picnic_table", -31.0, -27.6, 20.0, "brown"),
    Thing("standing_stone", -22.0, -24.6, 0.0, "carved"),
    Thing("tent", -18.4, -33.6, 60.0, "red"),
    Thing("campfire", -14.4, -30.0, 0.0, "out"),
    Thing("seagull_statue", -36.0, -26.4, 160.0, "blue"),
)
FIELDS = (
    Thing("tractor", 47.0, 24.0, 200.0, "red_loader"),
    Thing("hay_bales", 16.4, 40.0, 20.0, "round_stacked"),
    Thing("hay_bales", 53.0, 16.0, 70.0, "square"),
    Thing("wooden_gate", 33.6, 33.0, 175.0, "brown"),
    Thing("beehive", 10.0, 27.4, -90.0, "green"),
    Thing("woodshed", 50.0, 6.6, -120.0, "red_roof"),
    Thing("caravan", 12.0, -37.0, 40.0, "awning"),
    Thing("quad_bike", 21.0, -34.4, 100.0, "blue"),
    Thing("kite_stand", -4.0, -30.6, 200.0),
    Thing("trail_signpost", 3.0, -26.4, 180.0, "yellow"),
    Thing("hunting_stand", 38.6, -27.6, 0.0, "brown"),
)

GROUPS: Mapping[str, tuple[Thing, ...]] = {
    "in the cove": COVE,
    "out at sea": SEA,
    "on the northern breakwater": MOLE,
    "on the southern breakwater": SOUTH_MOLE,
    "on a jetty": JETTIES,
    "on the shingle beach": BEACH,
    "on the village square": SQUARE,
    "beside the village street": STREET,
    "in a village garden": GARDENS,
    "on the northern headland": NORTH_HEAD,
    "on the southern headland": SOUTH_HEAD,
    "in the fields on the cliffs": FIELDS,
}
