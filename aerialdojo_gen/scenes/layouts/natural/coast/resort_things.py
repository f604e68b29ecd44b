"""What stands in the seaside resort, place by place, in world coordinates: metres and degrees."""

from __future__ import annotations

from collections.abc import Mapping

from aerialdojo_gen.scenes.kit.natural_ground import Thing

_DECK = 4.52
_ROOF_FLATS = 9.0 + 4 * 3.2

BEACH_WEST = (
    Thing("beach_hut", -31.5, 3.6, -90.0, "blue"),
    Thing("beach_hut", -21.0, 3.4, -90.0, "pink"),
    Thing("beach_umbrella_set", -30.5, -5.5, -80.0, "red"),
    Thing("deck_chair", -24.5, -3.8, -90.0, "blue"),
    Thing("sandcastle", -26.5, -10.2, -90.0, "red_flag"),
    Thing("lifeguard_tower", -19.8, -5.2, -90.0, "orange"),
)
BEACH_MIDDLE = (
    Thing("beach_hut", -12.5, 3.4, -90.0, "yellow"),
    Thing("beach_hut", -8.4, 3.4, -90.0, "green"),
    Thing("volleyball_net", -6.2, -4.0, 90.0, "blue"),
    Thing("surfboard_stand", -1.2, 2.6, -90.0, "mixed"),
    Thing("beach_umbrella_set", -12.0, -10.0, -90.0, "yellow"),
    Thing("driftwood", -1.4, -11.4, 20.0),
)
UNDER_PIER = (
    Thing("canoe", 11.0, -6.0, 80.0, "red"),
    Thing("fish_crates", 13.4, 2.8, 0.0, "blue_orange_fish"),
    Thing("rowing_boat", 12.2, -21.0, 70.0, "wooden"),
)
BEACH_EAST = (
    Thing("dinghy_on_trailer", 26.0, -6.5, -60.0, "white"),
    Thing("dinghy_on_trailer", 32.0, -2.2, -75.0, "yellow"),
    Thing("beach_umbrella_set", 33.6, -9.0, -90.0, "blue"),
    Thing("deck_chair", 18.2, -3.0, -90.0, "red"),
    Thing("kite_stand", 19.0, -9.6, -60.0),
    Thing("lifeguard_tower", 43.6, -3.0, -100.0, "blue"),
    Thing("sandcastle", 29.6, -11.4, -90.0, "dark"),
    Thing("lifebuoy_stand", 35.6, 4.4, -90.0, "orange"),
)
PROMENADE = (
    Thing("ferris_wheel", -14.0, 15.2, 0.0),
    Thing("seagull_statue", 12.0, 13.2, -90.0, "white"),
    Thing("ice_cream_cart", -3.6, 12.4, -90.0, "pink"),
    Thing("telescope", -21.0, 10.6, -90.0, "white"),
    Thing("bench", 0.6, 18.2, -90.0, "blue"),
    Thing("bench", 29.6, 12.2, -90.0, "wooden"),
    Thing("cafe_table", -26.4, 14.4, 0.0, "red_chairs"),
    Thing("cafe_table", 15.6, 16.4, 0.0, "yellow_chairs"),
    Thing("bicycle_rack", 27.8, 17.2, 90.0, "blue"),
    Thing("litter_bin", 6.6, 11.2, 0.0, "green"),
    Thing("street_lamp", -7.6, 11.6, -90.0, "teal_banner"),
    Thing("street_lamp", 18.6, 11.6, -90.0, "orange_banner"),
    Thing("street_lamp", -33.6, 11.6, -90.0, "double"),
    Thing("photo_booth", 32.4, 18.6, -90.0, "yellow"),
    Thing("carousel", 37.8, 15.0, 180.0, "pink"),
    Thing("food_truck", -4.6, 17.0, -90.0, "teal_tacos"),
    Thing("anchor_monument", -30.0, 12.6, -90.0, "black"),
    Thing("planter", 9.0, 15.6, 0.0, "round_red"),
    Thing("flagpole", 24.6, 11.4, 0.0, "tricolour"),
)
PIER = (
    Thing("pier_kiosk", 5.6, -30.4, 0.0, "blue", lift_m=_DECK - 0.66),
    Thing("pier_kiosk", 18.2, -48.4, 180.0, "red", lift_m=_DECK - 0.66),
    Thing("telescope", 12.0, -50.0, -90.0, "red", lift_m=_DECK),
    Thing("bench", 3.6, -40.0, 180.0, "green_arms", lift_m=_DECK),
    Thing("lifebuoy_stand", 14.0, -14.0, 180.0, "yellow", lift_m=_DECK),
    Thing("ticket_booth", 18.0, -30.0, 180.0, "red", lift_m=_DECK),
    Thing("balloon_stand", 12.6, -29.8, 90.0, "mixed", lift_m=_DECK),
    Thing("litter_bin", 10.2, -8.0, 0.0, "red", lift_m=_DECK),
)
SEA = (
    Thing("sailboat", -22.0, -38.0, 30.0, "white_sails"),
    Thing("motor_yacht", 36.0, -34.0, 160.0, "navy"),
    Thing("buoy", -6.0, -30.0, 0.0, "red_can"),
    Thing("buoy", 27.0, -24.6, 0.0, "yellow"),
    Thing("rowing_boat", -36.0, -27.0, 20.0, "blue_oars_out"),
    Thing("fishing_boat", -44.0, -46.0, -20.0, "red"),
    Thing("navigation_beacon", 48.0, -44.0, 0.0, "green_white"),
)
TERRACE = (
    Thing("phone_booth", -37.0 + 2.2, 29.2, -90.0, "red"),
    Thing("mailbox", 1.0, 29.6, -90.0, "red"),
    Thing("scooter", 17.0, 33.6, 90.0, "mint"),
    Thing("bicycle", -20.3, 34.6, 90.0, "red_basket"),
    Thing("fountain", 38.6, 36.0, 0.0, "granite"),
    Thing("bus_shelter", 38.4, 29.8, -90.0, "orange_poster"),
)
STREET = (
    Thing("sedan", -28.0, 25.2, 180.0, "blue"),
    Thing("delivery_van", 10.0, 25.2, 180.0, "white_blue"),
    Thing("city_bus", 27.0, 28.0, 0.0, "red"),
)
ROOFS = (
    Thing("water_tank", -31.0, 36.4, 0.0, "wooden", lift_m=_ROOF_FLATS),
    Thing("solar_panels", -25.6, 36.0, -90.0, "blue", lift_m=_ROOF_FLATS),
    Thing("satellite_dish", 22.4, 36.4, -90.0, "white", lift_m=_ROOF_FLATS),
    Thing("air_conditioner", 29.0, 36.0, 0.0, "plain", lift_m=_ROOF_FLATS),
    Thing("water_tank", -5.2, 36.6, 0.0, "blue", lift_m=_ROOF_FLATS),
)
DUNES = (
    Thing("direction_sign", -48.0, 2.6, -60.0, "brown_arms"),
    Thing("wooden_gate", -57.6, 27.0, 90.0, "white"),
    Thing("hunting_stand", -66.0, 20.0, -80.0, "weathered"),
    Thing("picnic_table", -50.4, 14.6, 20.0, "brown"),
    Thing("mountain_bike", -53.6, 25.0, 70.0, "orange"),
)
HEADLAND = (
    Thing("telescope", 63.0, -10.6, -90.0, "red"),
    Thing("bench", 58.0, -4.4, -90.0, "wooden"),
    Thing("stone_cairn", 66.0, 2.0, 0.0, "white_top"),
    Thing("trail_signpost", 54.0, 15.2, 180.0, "red_top"),
    Thing("gazebo", 64.0, 12.0, 0.0, "red_roof"),
    Thing("weather_station", 70.0, -8.0, 0.0, "red_vane"),
)

GROUPS: Mapping[str, tuple[Thing, ...]] = {
    "on the western beach": BEACH_WEST,
    "on the beach west of the pier": BEACH_MIDDLE,
    "under the pier": UNDER_PIER,
    "on the beach east of the pier": BEACH_EAST,
    "on the promenade": PROMENADE,
    "on the pier": PIER,
    "out at sea": SEA,
    "on the hotel terrace": TERRACE,
    "on the upper street": STREET,
    "on a hotel's roof": ROOFS,
    "in the dunes": DUNES,
    "on the headland": HEADLAND,
}
