"""What stands on and about the square after the earthquake: relief, wrecks, remains of lives in the open flats."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.relief import stand, stand_on_floor, strew_things
from aerialdojo_gen.scenes.kit.wrecks import Wreck
from aerialdojo_gen.scenes.site import Site


def furnish_square(site: Site, flats: Wreck, base: float, pile: float) -> None:
    """Set everything out; `base` and `pile`: heights of the flats' ground floor and the fallen flats' top, metres."""
    stand(
        site,
        "on the square",
        [
            ("helicopter", 11.0, -9.0, 155.0),
            ("field_hospital_tent", -10.5, 9.6, 0.0),
            ("field_hospital_tent", -11.5, 1.4, 6.0),
            ("rescue_tent", 0.6, 5.6, -90.0),
            ("rescue_tent", 9.6, 4.4, -80.0),
            ("rescue_tent", -14.0, -11.6, 12.0),
            ("field_kitchen", -4.6, -1.0, -60.0),
            ("search_light", 14.6, 10.0, 160.0),
            ("stretcher", -3.6, -4.8, 80.0),
            ("stretcher", -4.4, 12.6, 10.0),
            ("relief_crates", 4.4, -0.6, 30.0),
            ("generator", 14.6, 3.4, 90.0),
            ("water_pump", -6.4, -12.6, 10.0),
            ("drone_pad", 2.4, -8.6, 0.0),
            ("evacuation_sign", -17.0, 5.4, 180.0),
            ("bench", -17.2, -2.4, 0.0),
            ("portable_toilet", 4.2, 9.6, -90.0),
            ("litter_bin", 17.4, 12.2, 180.0),
            ("sandbag_wall", -1.4, -12.0, 90.0),
            ("cardboard_boxes", -16.6, 12.8, 0.0),
            ("wheelbarrow", 0.6, 10.4, 40.0),
            ("water_barrel", -17.2, 9.4, 0.0),
            ("backpack", 5.4, -5.4, 60.0),
            ("cooler_box", 12.6, -1.8, 40.0),
            ("tool_cart", -8.4, -3.4, 100.0),
            ("oil_drums", 16.6, -13.0, 0.0),
            ("broken_power_pole", -6.0, -7.6, 190.0),
        ],
    )
    stand(
        site,
        "in the road south of the square",
        [
            ("fire_engine", 8.5, -20.6, 8.0),
            ("ambulance", -4.6, -18.2, 190.0),
            ("overturned_car", 0.6, -19.6, 60.0),
            ("sedan", -15.0, -20.8, 20.0),
            ("burnt_car", 18.2, -18.0, -25.0),
            ("traffic_cone", 3.6, -16.8, 0.0),
            ("barrier", -10.0, -19.6, 0.0),
            ("evacuation_sign", 13.4, -15.0, 90.0),
            ("street_lamp", -8.0, -15.0, -90.0),
            ("dumpster", -14.6, -24.2, 90.0),
            ("motorcycle", 4.6, -23.2, 30.0),
            ("fire_hydrant", -3.4, -23.4, 90.0),
            ("damaged_facade_section", 15.4, -29.0, 90.0),
        ],
    )
    stand(
        site,
        "in the road west of the square",
        [
            ("ambulance", -24.4, 14.0, 88.0),
            ("delivery_van", -22.6, 3.2, -80.0),
            ("hatchback", -23.4, -13.6, 110.0),
            ("street_lamp", -20.0, 20.0, 180.0),
            ("barrier", -23.4, 21.0, 90.0),
            ("traffic_cone", -22.0, -6.8, 0.0),
        ],
    )
    stand(
        site,
        "on the rubble below the torn flats",
        [
            ("rubble_heap", 3.0, 13.6, 20.0),
            ("search_light", 8.4, 12.2, -140.0),
            ("camp_chair", 6.0, 16.6, 35.0),
        ],
        sink_m=0.1,
    )
    stand(
        site,
        "on the fallen flats",
        [
            ("rubble_heap", 26.0, 10.0, 70.0),
            ("rescue_boat", 24.4, 3.6, 80.0),
            ("search_light", 27.6, -3.4, 160.0),
            ("satellite_dish", 29.4, 4.4, 200.0),
            ("bicycle", 23.6, -1.6, 40.0),
            ("water_tank", 29.0, 0.6, 0.0),
        ],
        z=pile,
    )
    floors = (
        (
            1,
            "in a torn flat on the first floor",
            [("bicycle", -4.6, 0.4, -80.0), ("stretcher", 14.0, 1.0, 0.0), ("cardboard_boxes", -12.0, -2.4, 30.0)],
        ),
        (
            2,
            "in a torn flat on the second floor",
            [
                ("clothes_rack", -6.4, 1.0, 20.0),
                ("camp_chair", 14.6, -1.6, 200.0),
                ("mountain_bike", -10.4, 3.2, 160.0),
            ],
        ),
        (
            3,
            "in a torn flat on the third floor",
            [("clothes_line", -8.0, 0.4, 90.0), ("planter", 15.6, 0.8, 0.0), ("telescope", -5.4, -2.6, -60.0)],
        ),
        (
            5,
            "on the roof of the torn flats",
            [
                ("satellite_dish", -6.4, 1.4, -60.0),
                ("water_tank", -11.0, 1.8, 0.0),
                ("solar_panels", 15.0, 2.6, -90.0),
                ("air_conditioner", -8.6, -3.2, 0.0),
            ],
        ),
    )
    bits = [("flower_tub", -16.2, -6.15, 0.0), ("rocking_chair", -9.0, -6.15, -90.0)]
    for k, (category, u, v, yaw) in enumerate(bits):
        put(
            site,
            category,
            *flats.frame.at(u, v),
            yaw,
            "on a balcony of the torn flats",
            solid=False,
            z=base + (2 - k) * flats.style.storey_m,
        )
    for storey, place, rows in floors:
        stand_on_floor(site, flats, base, storey, place, rows)
    _strays(site)


def _strays(site: Site) -> None:
    strew_things(
        site,
        "on the square",
        rectangle(-17.5, -13.0, 17.5, 13.0),
        [
            "rescue_tent",
            "sandbag_wall",
            "stretcher",
            "evacuation_sign",
            "traffic_cone",
            "barrier",
            "planter",
            "picnic_table",
            "crate_stack",
            "information_board",
        ],
        "square",
    )
    strew_things(
        site,
        "in the road south of the square",
        rectangle(-20.0, -24.0, 19.0, -15.0),
        [
            "burnt_car",
            "overturned_car",
            "scooter",
            "newspaper_box",
            "litter_bin",
            "rubble_heap",
        ],
        "south",
    )
    strew_things(
        site,
        "in the road west of the square",
        rectangle(-26.0, -12.0, -19.5, 18.0),
        [
            "overturned_car",
            "bicycle",
            "recycling_bin",
            "parking_meter",
            "traffic_light",
        ],
        "west",
    )
