"""What stands in the street after its blast: wrecks about the crater, services at the cordon, things in the rooms."""

from __future__ import annotations

from collections.abc import Mapping

from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.layouts.disaster.parts.relief import stand, stand_on_floor, strew_things
from aerialdojo_gen.scenes.layouts.disaster.parts.wrecks import Wreck
from aerialdojo_gen.scenes.site import Site


def furnish_street(
    site: Site, wrecks: Mapping[str, Wreck], bases: Mapping[str, float], pile: float, deck: float
) -> None:
    """Set everything out; `pile` and `deck`: heights of the fallen bank's top and of the footbridge, metres."""
    stand(site, "in the park", [
        ("statue", 34.0, -22.0, 140.0), ("rescue_tent", 27.0, -15.0, 90.0), ("rescue_tent", 27.4, -28.6, 60.0),
        ("field_hospital_tent", 43.0, -15.0, 180.0), ("field_kitchen", 38.6, -29.6, 30.0),
        ("stretcher", 30.6, -18.6, 30.0),
        ("bench", 39.2, -24.4, 160.0), ("fountain", 45.6, -31.6, 0.0),
    ])  # fmt: skip
    stand(site, "at the edge of the crater", [
        ("burnt_car", 3.4, 3.2, 40.0), ("overturned_car", -10.6, 0.2, 100.0),
    ], sink_m=0.08)  # fmt: skip
    stand(site, "in the blasted part of the street", [
        ("city_bus", 12.4, -2.4, 14.0), ("burnt_car", -13.4, -3.4, 160.0), ("burnt_car", 11.6, 5.2, -30.0),
        ("overturned_car", 4.4, -2.8, 80.0), ("sedan", -16.6, 4.2, 200.0),
    ])  # fmt: skip
    stand(site, "at the western cordon", [
        ("fire_engine", -24.6, -1.6, 4.0), ("ambulance", -25.6, 3.6, 176.0), ("search_light", -19.4, 0.6, 10.0),
        ("barrier", -30.4, -3.4, 0.0), ("barrier", -30.4, 3.4, 0.0), ("evacuation_sign", -29.6, 7.4, 180.0),
        ("sandbag_wall", -17.6, -6.8, 80.0),
    ])  # fmt: skip
    stand(site, "at the eastern cordon", [
        ("fire_engine", 27.4, 3.6, 184.0), ("ambulance", 24.4, -2.2, 170.0), ("box_truck", 36.8, -1.6, 180.0),
        ("barrier", 32.6, -3.2, 0.0), ("barrier", 32.6, 4.2, 0.0),
        ("generator", 30.6, 8.0, 90.0), ("evacuation_sign", 31.0, -7.4, 0.0),
    ])  # fmt: skip
    stand(site, "on the ruins of the bank", [
        ("rubble_heap", 11.8, -17.6, 20.0), ("satellite_dish", 5.6, -20.0, 60.0), ("stretcher", 6.0, -15.6, 100.0),
        ("wheelbarrow", 14.0, -21.2, 40.0), ("generator", 4.2, -16.2, 90.0),
    ], z=pile)  # fmt: skip
    stand(site, "on the broken footbridge", [
        ("bicycle", 19.0, 5.6, 85.0), ("litter_bin", 19.0, -9.6, 90.0),
    ], z=deck)  # fmt: skip
    for name, storey, place, rows in (
        ("office", 1, "on the first floor of the torn office", [("cardboard_boxes", 3.0, 0.0, 30.0),
        ("planter", 6.0, 4.2, 0.0)]),
        ("office", 2, "on the second floor of the torn office", [("vending_machine", 2.6, 4.4, -90.0),
        ("bench", 0.0, -2.6, 40.0)]),
        ("office", 3, "on the third floor of the torn office", [("planter", 1.6, -1.0, 0.0),
        ("cardboard_boxes", 5.0, 3.8, 70.0)]),
        ("office", 4, "on the fourth floor of the torn office", [("telescope", 0.6, 1.0, -60.0)]),
        ("office", 5, "on the roof of the torn office", [("air_conditioner", -3.0, 2.0, 0.0),
                                                        ("satellite_dish", -9.0, 1.0, 120.0)]),
        ("store", 1, "on the first floor of the store", [("clothes_rack", 2.6, -2.0, 20.0),
                                                   ("shopping_cart", -8.4, 4.6, 0.0),
                                                   ("vending_machine", 8.0, 4.4, -90.0)]),
        ("store", 2, "on the second floor of the store", [("clothes_rack", 3.6, 0.6, 100.0),
        ("shopping_cart", -2.0, 4.4, 60.0)]),
        ("store", 3, "on the third floor of the store", [("crate_stack", 3.4, 2.6, 0.0),
        ("bicycle", -0.4, 4.2, 15.0)]),
        ("store", 4, "on the roof of the store", [("solar_panels", 5.0, 3.6, -90.0), ("water_tank", 10.6, 2.8, 0.0)]),
        ("hotel", 1, "on the first floor of the hotel", [("rocking_chair", -1.6, -1.0, 180.0),
        ("planter", -4.0, 3.6, 0.0)]),
        ("hotel", 2, "on the second floor of the hotel", [("luggage_trolley", -0.4, 1.6, 40.0),
        ("rocking_chair", 3.4, -2.0, 120.0)]),
        ("hotel", 3, "on the third floor of the hotel", [("bench", 0.6, -0.4, 200.0),
        ("clothes_line", 0.0, 3.4, 0.0)]),
        ("hotel", 4, "on the roof of the hotel", [("air_conditioner", 3.0, 2.6, 90.0),
        ("water_tank", 7.6, 2.0, 0.0)]),
    ):  # fmt: skip
        stand_on_floor(site, wrecks[name], bases[name], storey, place, rows)
    _strays(site)


def _strays(site: Site) -> None:
    strew_things(site, "in the blasted part of the street", rectangle(-18.0, -9.6, 17.5, 10.4), [
        "barrier", "motorcycle", "sandbag_wall", "phone_booth", "bench", "vending_machine", "traffic_cone", "planter",
        "litter_bin", "evacuation_sign", "barrier", "bicycle_rack", "stop_sign", "parking_meter",
        "street_lamp", "generator",
        "rubble_heap", "traffic_light", "mailbox", "bicycle", "newspaper_box", "a_board", "scooter",
        "wheelbarrow", "stretcher", "fire_hydrant",
    ], "blasted", 1.15)  # fmt: skip
    strew_things(site, "at the western cordon", rectangle(-32.0, -9.4, -18.5, 10.4), [
        "portable_toilet", "traffic_cone", "stretcher", "relief_crates", "wheelie_bin", "parking_meter",
        "broken_power_pole",
    ], "west")  # fmt: skip
    strew_things(site, "at the eastern cordon", rectangle(20.0, -9.0, 38.0, 10.0), [
        "search_light", "traffic_cone", "delivery_van", "water_pump", "bus_shelter", "sandbag_wall", "stop_sign",
    ], "east")  # fmt: skip
    strew_things(site, "in the park", rectangle(22.0, -39.0, 53.0, -10.5), [
        "drone_pad", "stretcher", "picnic_table", "urban_tree", "planter", "urban_tree", "sandbag_wall", "urban_tree",
        "oak_tree", "urban_tree", "information_board", "urban_tree", "playground_slide", "urban_tree", "rescue_boat",
    ], "park")  # fmt: skip
    strew_things(site, "behind the torn fronts", rectangle(-33.0, 24.6, 24.0, 31.0), [
        "dumpster", "sedan", "urban_tree", "skip_container", "hatchback", "urban_tree", "wheelie_bin", "clothes_line",
    ], "north_yard")  # fmt: skip
    strew_things(site, "in the yard behind the hotel", rectangle(-30.0, -31.0, 20.0, -24.5), [
        "delivery_van", "recycling_bin", "pallet_stack", "urban_tree", "bicycle_rack", "dumpster",
    ], "south_yard")  # fmt: skip
