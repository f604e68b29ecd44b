"""What stands in and on the mall of `mall.py`, place by place: the drawing of its furniture.

A row is (category, variant, x, y, yaw in degrees) and, where it does not stand on the ground, the height of its floor.
The place goes into the attributes, because descriptions speak of it.
"""

from __future__ import annotations

from aerialdojo_gen.scenes.site import Site

Row = tuple[str, str | None, float, float, float] | tuple[str, str | None, float, float, float, float]

GALLERY_M, ROOF_M, STORE_ROOF_M, CINEMA_ROOF_M, DOCK_M, GRILL_ROOF_M = 5.0, 10.0, 12.8, 13.8, 1.15, 5.22
DECK_1_M, DECK_2_M = 3.7, 7.4

FURNITURE: dict[str, tuple[Row, ...]] = {
    "in the middle of the courtyard": (("fountain", "marble", -11, 9.2, 0),),
    "in the courtyard": (
        ("bench", "wooden", -19.4, 9.2, 180), ("bench", "blue", -11, 2.9, -90), ("bench", "green_arms", -3.6, 11.8, 20),
        ("kiosk", "flowers", 3.6, 11.4, 180), ("ice_cream_cart", "pink", -2.6, 5.4, -60),
        ("cafe_table", "red_chairs", -25.4, 12.6, 20), ("cafe_table", "green_chairs", -21.6, 14.0, 70),
        ("parasol", "red", -27.0, 14.6, 0), ("parasol", "cream", -23.0, 11.0, 0), ("direction_sign", "three_arms", -17.6, 3.6, 0),
        ("advertising_column", "green_cap", 7.6, 5.2, 0), ("lantern", "flower_baskets", -20.4, 4.8, 0),
        ("lantern", "plain", 0.4, 14.4, 0), ("litter_bin", "green", -4.6, 3.4, 0), ("litter_bin", "wooden", -17.4, 14.8, 0),
        ("planter", "round_red", -16.6, 11.8, 0), ("planter", "round_white", -5.2, 14.6, 0),
        ("urban_tree", "green", -24.6, 6.4, 0), ("urban_tree", "blossom", 5.6, 8.0, 0),
    ),
    "under the arcade": (
        ("vending_machine", "red", -35.4, 14.0, 0), ("mailbox", "red", -35.6, 12.5, 0), ("atm_kiosk", "blue", 13.3, 14.2, 180),
        ("photo_booth", "yellow", 11.6, 19.3, -90), ("a_board", "sale", -29.2, 17.6, -90), ("a_board", "menu", 1.4, 17.6, -90),
        ("clothes_rack", "mixed", -22.6, 17.8, 0), ("topiary", "three_balls", -17.2, 17.7, 0), ("topiary", "cone", -4.0, 17.9, 0),
        ("recycling_bin", "three_colours", 13.4, 5.8, 180), ("shop_sign", "red_cafe", -29.0, 19.5, -90, 2.95),
        ("shop_sign", "blue_books", 1.5, 19.5, -90, 2.95), ("shop_sign", "green_toys", -35.5, 5.75, 0, 2.95),
        ("shop_sign", "yellow_bike", 13.5, 5.75, 180, 2.95),
    ),
    "under the footbridge": (
        ("bicycle_rack", "blue", -27.0, 0.5, 90), ("newspaper_box", "blue", -18.6, 0.6, 90), ("newspaper_box", "orange", -17.4, 0.6, 90),
        ("scooter", "red_delivery", 5.6, 0.4, 10), ("shopping_cart", "full", -5.2, 0.2, 30), ("parking_meter", "yellow", 9.0, 0.5, -90),
        ("bicycle", "red_basket", -15.0, 0.2, 0), ("bicycle", "blue", -27.0, 2.4, 8),
    ),
    "on the footbridge": (
        ("bench", "backless", -27.0, 1.3, -90, GALLERY_M), ("planter", "long_pink", -19.6, 1.0, 90, GALLERY_M),
        ("a_board", "open", -11.0, 0.6, -90, GALLERY_M), ("cafe_table", "yellow_chairs", -1.6, 0.5, 90, GALLERY_M),
        ("topiary", "spiral", 5.0, 0.9, 0, GALLERY_M),
    ),
    "on the gallery": (
        ("litter_bin", "red", -26.0, 19.2, 0, GALLERY_M), ("bench", "wooden", -16.9, 18.9, -90, GALLERY_M),
        ("clothes_rack", "white", -34.4, 11.6, 0, GALLERY_M), ("vending_machine", "blue", -35.4, 14.6, 0, GALLERY_M),
        ("planter", "round_red", 2.0, 19.0, 0, GALLERY_M), ("parasol", "green_closed", 11.8, 17.9, 0, GALLERY_M),
        ("recycling_bin", "roofed", 13.2, 12.2, 180, GALLERY_M), ("cafe_table", "red_chairs", 12.2, 15.0, 0, GALLERY_M),
        ("mailbox", "blue", 13.5, 1.4, 180, GALLERY_M), ("phone_booth", "black", -35.3, 1.4, 0, GALLERY_M),
    ),
    "high on the wall above the courtyard": (
        ("wall_clock", "white_face", -36.0, 12.6, 0, 7.2), ("wall_banner", "red_disc", -36.0, 16.6, 0, 5.8),
        ("wall_banner", "blue_triangle", 14.0, 12.6, 180, 5.8),
    ),
    "in the passage through the mall": (
        ("vending_machine", "black", -13.4, 22.6, 0), ("atm_kiosk", "green", -6.75, 22.8, 180), ("photo_booth", "purple", -13.4, 33.0, 0),
        ("bench", "blue", -10.0, 24.6, 90), ("clothes_rack", "mixed", -7.4, 33.0, 0), ("a_board", "sale", -10.2, 40.8, -90),
        ("recycling_bin", "roofed", -13.5, 43.4, 0), ("planter", "long_yellow", -7.0, 43.2, 0),
    ),
    "in front of the courtyard": (
        ("inflatable_arch", "orange", -11, -9.6, -90), ("market_stall", "red_fruit", -29.6, -6.4, 0),
        ("market_stall", "green_vegetables", -21.4, -6.0, 180), ("market_stall", "blue_fish", 0.6, -6.0, 0),
        ("market_stall", "yellow_bread", 8.0, -6.6, 180), ("cardboard_boxes", "white", -25.6, -4.2, 40),
    ),
    "on the front plaza": (
        ("clock_tower", "red_brick", 7.6, -14.8, -90), ("flagpole", "tricolour", -31.6, -15.4, 30), ("flagpole", "green_yellow", -28.4, -15.4, 30),
        ("flagpole", "orange", -25.2, -15.4, 30), ("bicycle_rack", "covered", -18.4, -15.4, 0), ("phone_booth", "red", -33.4, -14.4, -90),
        ("direction_sign", "brown_arms", -3.0, -15.8, 40), ("planter", "long_yellow", -13.8, -15.6, 90), ("planter", "round_white", 0.8, -13.6, 0),
        ("motorcycle", "red", 12.0, -16.6, 100), ("lantern", "black", -22.6, -12.6, 0), ("lantern", "flower_baskets", 0.6, -11.0, 0),
        ("litter_bin", "grey_hood", -7.0, -16.8, 0), ("ev_charger", "green", -54.0, -18.9, -90), ("ev_charger", "blue", -38.4, -18.9, -90),
        ("ev_charger", "black", 33.6, -18.9, -90), ("parking_meter", "blue", 15.6, -18.6, -90), ("urban_tree", "yellow", -40.0, -16.0, 0),
    ),
    "by the entrance of the market": (
        ("shopping_cart", "red_handle", -52.2, -15.6, -80), ("vending_machine", "blue", -42.4, -13.5, -90), ("newspaper_box", "green", -51.4, -13.4, -90),
        ("wall_banner", "green_disc", -56.4, -12.8, -90, 6.6), ("wall_banner", "orange_disc", -37.6, -12.8, -90, 6.6),
    ),
    "by the entrance of the cinema": (
        ("atm_kiosk", "red", 28.9, -13.6, -90), ("billboard", "blue_cinema", 24.0, -6.4, -90, CINEMA_ROOF_M), ("topiary", "cone", 18.8, -15.4, 0),
        ("wall_banner", "purple_triangle", 15.6, -12.8, -90, 6.6), ("litter_bin", "red", 31.4, -14.6, 0), ("scooter", "mint", 33.2, -16.0, 95),
    ),
    "on the west front of the mall": (
        ("bench", "green_arms", -60.6, 7.6, 180), ("a_board", "menu", -60.4, 14.6, 180), ("bicycle_rack", "open", -60.4, 25.4, 0),
        ("litter_bin", "green", -59.2, 22.4, 0), ("shop_sign", "blue_books", -58.5, 7.5, 180, 3.0), ("shop_sign", "red_cafe", -58.5, 14.5, 180, 3.0),
        ("wall_banner", "orange_disc", -58.0, 11.0, 180, 6.0), ("wall_clock", "black_face", -58.0, 25.0, 180, 7.0),
    ),
    "on the east front of the mall": (
        ("bench", "backless", 36.6, 14.6, 0), ("scooter", "cream", 36.2, 30.4, 80), ("newspaper_box", "orange", 35.2, 26.4, 0),
        ("shop_sign", "green_toys", 34.5, 7.5, 0, 3.0), ("shop_sign", "yellow_bike", 34.5, 14.5, 0, 3.0),
        ("wall_banner", "blue_triangle", 34.0, 11.0, 0, 6.0), ("wall_clock", "white_face", 34.0, 28.0, 0, 6.6), ("planter", "long_pink", 36.4, 40.6, 0),
    ),
    "on the roof of the mall": (
        ("air_conditioner", "plain", -52, 34, 0, ROOF_M), ("air_conditioner", "duct", -24, 27, 90, ROOF_M), ("air_conditioner", "green", 20, 39, 0, ROOF_M),
        ("air_conditioner", "plain", 24, 4, 90, ROOF_M), ("air_conditioner", "duct", -47, 5, 0, ROOF_M),
        ("skylight", "white", -38, 30, 90, ROOF_M), ("skylight", "dark", -26, 39, 0, ROOF_M), ("skylight", "white", 6, 31, 0, ROOF_M),
        ("skylight", "dark", 24, 13, 90, ROOF_M), ("satellite_dish", "white", 28, 31, -60, ROOF_M), ("satellite_dish", "grey", -53, 14, 200, ROOF_M),
        ("solar_panels", "blue", -42, 40, -90, ROOF_M), ("solar_panels", "blue", 14, 27, -90, ROOF_M), ("solar_panels", "black", -43, 14, -90, ROOF_M),
        ("water_tank", "wooden", -14, 41, 0, ROOF_M), ("water_tank", "blue", 30, 42, 0, ROOF_M), ("vent_stack", "silver", -4, 40, 0, ROOF_M),
        ("vent_stack", "green", -32, 24, 0, ROOF_M), ("vent_stack", "silver", 30, 18, 0, ROOF_M), ("billboard", "yellow_sale", 2, 22.6, -90, ROOF_M),
    ),
    "on the roof of the market": (
        ("satellite_dish", "grey", -55, -6, 60, STORE_ROOF_M), ("solar_panels", "black", -45, -6.6, -90, STORE_ROOF_M), ("vent_stack", "green", -38, -7, 0, STORE_ROOF_M),
    ),
    "on the loading dock": (
        ("roll_cage", "full", -46.2, 47.6, 20, DOCK_M), ("pallet_stack", "wrapped", -38.0, 47.7, 0, DOCK_M), ("cardboard_boxes", "brown", -30.2, 47.6, 60, DOCK_M),
    ),
    "in the loading yard": (
        ("box_truck", "orange", -42.0, 53.5, 90), ("delivery_van", "white_blue", -50.0, 53.0, 92), ("box_truck", "blue_open", -24.6, 57.4, 180),
        ("pallet_stack", "high", -16.6, 48.6, 10), ("pallet_stack", "low", -14.4, 50.8, -15), ("roll_cage", "empty", 4.0, 48.0, 40),
        ("forklift", "yellow", -3.0, 54.6, -150), ("forklift", "orange_loaded", 12.6, 49.6, 0), ("cardboard_boxes", "white", 17.6, 48.2, 0),
        ("dumpster", "green_closed", 22.4, 59.2, -90), ("dumpster", "blue_open", 26.5, 59.2, -90), ("dumpster", "brown", 30.6, 59.2, -90),
        ("boom_gate", "closed", 7.0, 60.2, -90), ("boom_gate", "open", 15.0, 60.2, 90), ("barrier", "yellow_black", 8.0, 53.0, 30),
        ("traffic_cone", "orange", -35.0, 52.0, 0), ("fire_hydrant", "red", 18.2, 53.6, -90), ("golf_cart", "blue_roof", 32.4, 50.2, 160),
        ("wall_banner", "green_disc", 10.0, 46.0, 90, 5.6),
    ),
    "by the car park": (
        ("mailbox", "yellow", 35.2, -26.4, 0), ("fire_hydrant", "yellow", 36.0, -50.0, 0), ("barrier", "red_white", 33.6, -46.4, 0),
        ("traffic_cone", "yellow", 33.0, -33.0, 0), ("traffic_cone", "orange", 34.2, -31.8, 0), ("stop_sign", "red", 36.0, -39.6, 0),
    ),
    "on the green island of the car park": (
        ("street_lamp", "double", -46, -37.8, 90), ("street_lamp", "double", -22, -37.8, 90), ("street_lamp", "double", 2, -37.8, 90), ("street_lamp", "double", 26, -37.8, 90),
        ("advertising_column", "red", -10.0, -37.8, 0), ("hedge_block", "balls", -34.0, -37.8, 90), ("hedge_block", "plain", 14.0, -37.8, 90),
        ("urban_tree", "green", -52, -37.8, 0), ("urban_tree", "red", -40, -37.8, 40), ("urban_tree", "green", -28, -37.8, 80),
        ("urban_tree", "yellow", -16, -37.8, 10), ("urban_tree", "green", 8, -37.8, 60), ("urban_tree", "column", 20, -37.8, 0),
    ),
    "by the bus stop": (
        ("bus_shelter", "orange_poster", -22.0, -61.7, -90), ("city_bus", "red", -22.0, -64.3, 180), ("recycling_bin", "three_colours", -15.6, -61.4, -90),
        ("newspaper_box", "green", -26.6, -61.4, -90), ("crossing_sign", "blue", -33.4, -61.4, 0),
    ),
    "on the road south of the mall": (
        ("sedan", "taxi", 20.0, -67.7, 0), ("delivery_van", "yellow", -50.0, -67.7, 0), ("motorcycle", "green", 66.0, -64.4, 180),
        ("traffic_light", "red", 37.4, -61.5, 180), ("traffic_light", "green", 46.6, -70.5, 0), ("street_lamp", "teal_banner", 0.0, -61.2, -90),
        ("street_lamp", "orange_banner", -44.0, -61.2, -90), ("pylon_sign", "teal", 53.0, -57.0, 0), ("billboard", "green_eco", 76.0, -57.6, -90),
    ),
    "by the drive between the mall and the parking deck": (
        ("street_lamp", "single", 46.4, -22.0, 180), ("street_lamp", "teal_banner", 46.4, 20.0, 180), ("crossing_sign", "yellow", 46.2, -9.0, -90),
        ("traffic_light", "amber", 38.0, 26.8, -90), ("stop_sign", "red", 38.0, 60.2, 90), ("boom_gate", "closed", 49.0, 28.6, 0),
        ("boom_gate", "open", 49.0, 36.6, 180), ("bollard", "yellow", 48.4, 20.6, 0), ("suv", "bronze", 40.3, 46.0, -90),
    ),
    "on the terrace of the restaurant": (
        ("cafe_table", "green_chairs", 57.2, -24.0, 40), ("cafe_table", "red_chairs", 57.2, -17.4, 0), ("cafe_table", "yellow_chairs", 63.0, -29.6, 0),
        ("parasol", "blue", 66.4, -30.4, 0), ("parasol", "red", 76.4, -30.0, 0), ("planter", "long_pink", 73.4, -30.6, 90), ("a_board", "menu", 66.2, -28.0, -90),
    ),
    "beside the restaurant": (
        ("menu_board", "orange", 87.6, -27.0, 180), ("hatchback", "green", 83.0, -26.6, 90), ("dumpster", "green_closed", 78.0, -9.0, 90),
        ("food_truck", "teal_tacos", 60.6, -40.6, 0), ("picnic_set", "green", 66.4, -43.0, 20), ("bollard", "red", 82.0, -33.0, 0),
        ("bicycle_rack", "open", 57.6, -10.2, 90), ("flagpole", "orange", 87.4, -12.0, 30), ("urban_tree", "blossom", 88.0, -40.0, 0), ("urban_tree", "green", 52.4, -36.0, 0),
    ),
    "on the roof of the restaurant": (
        ("air_conditioner", "green", 65.0, -19.0, 0, GRILL_ROOF_M), ("vent_stack", "silver", 75.0, -22.0, 0, GRILL_ROOF_M),
    ),
    "on the middle floor of the parking deck": (
        ("ev_charger", "green", 51.0, 25.0, 0, DECK_1_M), ("shopping_cart", "blue_handle", 53.2, 19.4, 40, DECK_1_M), ("traffic_cone", "yellow", 79.0, 19.6, 0, DECK_1_M),
        ("barrier", "red_white", 80.6, 36.4, 90, DECK_1_M), ("vending_machine", "red", 51.2, 33.0, 0, DECK_1_M),
    ),
    "on the roof of the parking deck": (
        ("food_truck", "orange_burger", 63.0, 37.0, 0, DECK_2_M), ("solar_panels", "black", 79.6, 28.0, 180, DECK_2_M), ("street_lamp", "double", 66.0, 28.0, 90, DECK_2_M),
        ("golf_cart", "green_roof", 78.4, 19.4, 90, DECK_2_M), ("cart_corral", "roofed", 60.0, 19.4, 0, DECK_2_M),
    ),
    "on the ground floor of the parking deck": (
        ("ev_charger", "blue", 51.4, 22.4, 0), ("shopping_cart", "full", 78.8, 37.0, 20), ("motorcycle", "black_top_case", 79.4, 19.0, 200),
    ),
    "in the park west of the mall": (
        ("statue", "bronze", -79, 26, 0), ("ferris_wheel", "white", -79, -40, 0), ("carousel", "pink", -79, -20, 0), ("gazebo", "red_roof", -79, 48, 0),
        ("stage", "blue", -89.6, 22, 0), ("picnic_set", "wooden", -71, 40, 10), ("kiosk", "juice", -70.4, -20, 180), ("ice_cream_cart", "mint", -71.4, -31, 120),
        ("bench", "wooden", -72.2, 26, 180), ("bench", "green_arms", -79, 33.2, -90), ("topiary", "spiral", -74.4, 21.4, 0), ("topiary", "three_balls", -83.6, 30.6, 0),
        ("lantern", "plain", -76.6, 14, 0), ("lantern", "flower_baskets", -81.4, -13, 0), ("litter_bin", "wooden", -76.6, 38, 0), ("recycling_bin", "three_colours", -70.6, -10.4, 180),
        ("palm_tree", "tall", -88, -32, 0), ("palm_tree", "short", -70.2, -46, 0), ("bicycle", "green_basket", -68.6, -16.0, 60), ("phone_booth", "blue", -67.6, 4, 0),
    ),
    "on the playground": (
        ("playground_slide", "yellow", -88, 8.6, -90), ("playground_slide", "green", -84.6, 9.4, -90), ("swing_set", "red", -88, 0.2, 90),
        ("spring_rider", "yellow_duck", -83, 3.8, 120), ("spring_rider", "blue_dolphin", -83.2, -1.2, 60),
    ),
    "north of the mall": (
        ("water_tower", "teal_band", 88.2, 54.4, 0), ("city_bus", "blue", 2.0, 64.3, 180), ("bus_shelter", "green_poster", 22.0, 71.0, 90),
        ("street_lamp", "single", -30.0, 70.8, -90), ("street_lamp", "orange_banner", 60.0, 70.8, -90), ("pickup_truck", "blue_crates", 60.0, 67.7, 0),
        ("mailbox", "red", 30.0, 71.0, -90),
    ),
}  # fmt: skip

# Straight rows: (category, variant, first x, first y, step x, step y, count, yaw).
ROWS: dict[str, tuple[tuple[str, str | None, float, float, float, float, int, float], ...]] = {
    "along the edge of the front plaza": (("bollard", "steel", -33.0, -18.4, 5.0, 0.0, 9, 0.0),),
    "between the car park and the road": (
        ("hedge_block", "plain", -56.0, -59.2, 4.0, 0.0, 23, 90.0), ("urban_tree", None, -50.0, -59.2, 14.0, 0.0, 6, 0.0),
    ),
    "around the playground": (("hedge_block", "plain", -93.2, -2.0, 0.0, 4.0, 4, 0.0), ("hedge_block", "balls", -90.4, 13.0, 4.0, 0.0, 3, 90.0)),
    "in the park west of the mall": (
        ("urban_tree", None, -91.0, 34.0, 0.0, 8.0, 4, 0.0), ("urban_tree", None, -69.6, 10.0, 0.0, 7.5, 3, 0.0), ("urban_tree", None, -70.0, 46.0, 0.0, 7.0, 2, 0.0),
        ("urban_tree", None, -92.0, -52.0, 0.0, 9.0, 5, 0.0),
    ),
    "along the north road": (("urban_tree", "column", -90.0, 73.0, 12.0, 0.0, 9, 0.0),),
    "behind the parking deck": (("urban_tree", "column", 91.6, -2.0, 0.0, 9.0, 5, 0.0),),
    "by the drive between the mall and the parking deck": (("urban_tree", "green", 48.2, 2.0, 8.0, 0.0, 5, 0.0), ("hedge_block", "plain", 54.0, 4.6, 4.2, 0.0, 7, 90.0)),
}  # fmt: skip


def furnish(site: Site) -> None:
    """Place all of it."""
    for place, rows in FURNITURE.items():
        for category, variant, x, y, yaw, *floor in rows:
            z = floor[0] if floor else None
            site.place(category, x, y, yaw, z=z, variant=variant, attributes={"place": place})
    for place, lines in ROWS.items():
        for category, variant, x, y, dx, dy, count, yaw in lines:
            for k in range(count):
                site.place(category, x + k * dx, y + k * dy, yaw, variant=variant, attributes={"place": place})
