"""What stands in the old town after its earthquake: relief on the piazza, remains of lives in the open houses."""

from __future__ import annotations

from collections.abc import Mapping

from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.relief import stand, stand_on_floor, strew_things
from aerialdojo_gen.scenes.kit.wrecks import Wreck
from aerialdojo_gen.scenes.site import Site


def furnish_town(
    site: Site, wrecks: Mapping[str, Wreck], bases: Mapping[str, float], tops: tuple[float, float, float]
) -> None:
    """Set everything out; `tops` are the heights of the two fallen houses and of the arcade's roof, metres."""
    pile, low, arcade = tops
    stand(site, "in the middle of the piazza", [("fountain", -2.0, -8.0, 0.0)])
    stand(site, "on the piazza", [
        ("field_hospital_tent", 14.6, -8.6, 90.0), ("rescue_tent", -10.6, 1.6, -90.0),
        ("rescue_tent", -2.0, 2.2, -90.0),
        ("rescue_tent", 14.6, 1.4, 180.0), ("field_kitchen", -11.2, -8.0, 10.0), ("stretcher", -6.4, -3.4, 60.0),
        ("stretcher", 9.6, -15.0, 10.0), ("search_light", 4.4, 3.6, -110.0), ("ambulance", 12.6, -19.4, 186.0),
        ("rescue_boat", -9.6, -14.6, 30.0), ("lion_statue", -9.6, -18.8, 60.0), ("market_stall", 0.4, -18.8, 95.0),
        ("cafe_table", 4.6, -21.4, 20.0), ("bench", -4.0, -13.8, -80.0), ("generator", 18.4, -15.6, 90.0),
        ("evacuation_sign", -6.6, 4.2, -90.0), ("relief_crates", -12.6, -3.6, 30.0),
        ("portable_toilet", 19.4, -3.6, 180.0),
        ("overturned_car", 3.6, -13.8, 40.0),
    ])  # fmt: skip
    stand(site, "on the terrace of the church", [
        ("clock_tower", 9.4, 37.0, -90.0), ("statue", 20.0, 33.0, 200.0), ("stone_well", 14.8, 30.4, 0.0),
        ("rescue_tent", 18.6, 39.0, 180.0), ("bench", -14.0, 28.8, -90.0), ("drone_pad", -9.6, 29.0, 0.0),
        ("sandbag_wall", 8.6, 30.4, 90.0), ("flagpole", -5.0, 28.8, 20.0),
    ])  # fmt: skip
    stand(site, "on the roof of the arcade", [
        ("planter", -18.2, -18.4, 0.0), ("cafe_table", -18.0, -12.6, 30.0), ("bicycle", -18.6, -8.4, 80.0),
    ], z=arcade)  # fmt: skip
    stand(site, "under the arcade", [("cardboard_boxes", -18.2, -15.0, 20.0), ("scooter", -18.0, -10.6, 80.0)])
    stand(site, "on top of a fallen house", [
        ("rubble_heap", 5.2, 20.2, 20.0), ("search_light", -0.4, 20.6, -70.0),
    ], z=pile)  # fmt: skip
    stand(site, "on the ruins of a house east of the piazza", [
        ("stretcher", 31.0, -16.2, 80.0), ("satellite_dish", 32.4, -10.8, 160.0),
    ], z=low)  # fmt: skip
    rooms = {
        ("town_hall", 1): ("on the first floor of the town hall", [("bench", 2.4, 1.6, 90.0),
                                                                ("planter", 6.4, 1.0, 0.0)]),
        ("corner_house", 1): ("on the first floor of the corner house", [("rocking_chair", 3.0, 1.0, -100.0)]),
        ("corner_house", 2): ("on the second floor of the corner house", [("cardboard_boxes", 4.2, 1.6, 0.0)]),
        ("split_house", 1): ("on the first floor of the split house", [("bicycle", -5.0, 0.4, 10.0)]),
        ("split_house", 2): ("on the second floor of the split house", [("clothes_line", -5.4, 0.6, 0.0)]),
        ("hill_house", 1): ("on the first floor of the hill house", [("telescope", -2.4, 0.4, -90.0)]),
        ("hill_house", 2): ("on the second floor of the hill house", [("rocking_chair", -4.6, 0.8, -60.0)]),
        ("east_house", 1): ("on the first floor of the east house", [("clothes_rack", 4.0, 0.6, 0.0)]),
        ("church", 0): ("inside the church", [("bench", -3.0, 0.0, 0.0), ("stretcher", 3.4, -0.8, 20.0)]),
    }  # fmt: skip
    for (name, storey), (place, rows) in rooms.items():
        stand_on_floor(site, wrecks[name], bases[name], storey, place, rows)
    _lanes(site)


def _lanes(site: Site) -> None:
    stand(site, "in the street north of the piazza", [
        ("fire_engine", -12.6, 9.4, 2.0), ("ambulance", 18.4, 9.4, 184.0), ("broken_power_pole", 2.6, 8.4, 178.0),
    ])  # fmt: skip
    stand(site, "in the lane west of the piazza", [
        ("burnt_car", -23.4, -29.0, 84.0), ("hatchback", -24.0, -8.6, 100.0), ("barrier", -23.6, -33.4, 90.0),
    ])  # fmt: skip
    stand(site, "in the lane east of the piazza", [
        ("overturned_car", 24.2, -4.4, 70.0), ("delivery_van", 22.7, 2.8, 90.0), ("barrier", 24.2, -28.4, 90.0),
    ])  # fmt: skip
    strew_things(site, "on the piazza", rectangle(-15.0, -22.0, 20.0, 5.0), [
        "sandbag_wall", "evacuation_sign", "traffic_cone", "parasol", "litter_bin", "crate_stack", "wheelbarrow",
        "a_board",
        "barrier", "lantern",
        "picnic_table", "information_board",
    ], "piazza")  # fmt: skip
    strew_things(site, "on the terrace of the church", rectangle(-22.0, 28.5, 24.0, 42.0), [
        "field_kitchen", "water_barrel", "urban_tree", "litter_bin", "urban_tree", "evacuation_sign",
    ], "terrace")  # fmt: skip
    strew_things(site, "on the slope below the church", rectangle(-24.0, 22.0, 28.0, 27.0), [
        "rubble_heap", "bush", "clay_pots", "wheelie_bin", "bird_bath",
    ], "slope")  # fmt: skip
    strew_things(site, "in the street north of the piazza", rectangle(-22.0, 6.6, 22.0, 12.0), [
        "motorcycle", "fire_hydrant", "stop_sign", "flower_tub", "bicycle_rack", "phone_booth",
    ], "street")  # fmt: skip
    strew_things(site, "in the gardens at the edge of the town", site.extent.buffer(-3.0), [
        "urban_tree", "oak_tree", "urban_tree", "urban_tree", "urban_tree", "bush", "urban_tree", "bush",
        "urban_tree",
    ], "gardens", 2.4)  # fmt: skip
