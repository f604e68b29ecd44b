"""What stands at the river bridge: traffic, boats, a promenade, a maintenance depot, a café terrace."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.natural_ground import place_wild, settled_z
from aerialdojo_gen.scenes.layouts.infrastructure.parts.rail import things
from aerialdojo_gen.scenes.site import Site

_WATER_M, _FOOTWAY_M = -12.0, 0.12


def furnish_river(site: Site) -> None:
    """Put everything in its place, then the trees between."""
    _deck(site)
    _plaza(site)
    _quay(site)
    _river(site)
    _east(site)
    _trees(site)


def _deck(site: Site) -> None:
    things(site, "on the bridge", [
        ("city_bus", -8.0, -1.9, 0.0), ("sedan", 14.0, -1.9, 0.0), ("box_truck", 31.0, 1.9, 180.0),
        ("hatchback", -28.0, 1.9, 180.0), ("motorcycle", 2.0, 1.9, 180.0), ("delivery_van", 41.0, -1.9, 0.0),
    ], 0.0)  # fmt: skip
    things(site, "on the footway of the bridge", [
        ("emergency_phone", -14.0, 6.3, -90.0), ("emergency_phone", 30.0, -6.3, 90.0), ("bench", 0.0, 6.5, -90.0),
        ("street_lamp", -33.0, 6.5, -90.0), ("street_lamp", 0.0, -6.5, 90.0), ("street_lamp", 34.0, 6.5, -90.0),
        ("bicycle", -4.0, -5.6, 0.0), ("telescope", 14.0, 6.2, 90.0), ("litter_bin", -40.0, -6.4, 90.0),
        ("traffic_cone", 12.6, 5.6, 0.0), ("traffic_cone", 4.4, 5.6, 0.0), ("barrier", -12.4, -5.6, 0.0),
    ], _FOOTWAY_M)  # fmt: skip
    things(site, "at the edge of the bridge", [("inspection_gondola", 8.5, 8.25, 90.0),
        ("inspection_gondola", -8.5, -8.25, -90.0)],
           _FOOTWAY_M)  # fmt: skip
    things(site, "at the head of the bridge", [
        ("lion_statue", -53.0, 8.8, 180.0), ("lion_statue", -53.0, -8.8, 180.0),
        ("lion_statue", 54.6, 8.2, 0.0),
    ])  # fmt: skip
    put(site, "sign_gantry", -54.6, 0.0, 180.0, "at the head of the bridge", params={"w": 10.0})
    put(site, "sign_gantry", 58.0, 0.0, 0.0, "at the head of the bridge", params={"w": 10.0})


def _plaza(site: Site) -> None:
    for y in (-8.6, 0.0, 8.6):
        put(site, "toll_booth", -66.2, y, 0.0, "in the toll plaza")
    things(site, "in the toll plaza", [
        ("suv", -57.8, 4.3, 180.0), ("pickup_truck", -75.0, -4.3, 0.0), ("traffic_light", -59.6, -9.8, 0.0),
        ("motorcycle", -76.0, 4.3, 180.0), ("traffic_cone", -58.6, 10.6, 0.0), ("barrier", -58.6, -12.6, 90.0),
    ])  # fmt: skip
    things(site, "beside the toll office", [("flagpole", -60.0, 20.0, 30.0), ("bench", -68.0, 16.6, -90.0),
                                            ("vending_machine", -64.0, 17.0, -90.0),
                                            ("mailbox", -72.0, 16.8, -90.0)])  # fmt: skip
    things(site, "above the quay", [
        ("information_board", -52.0, 21.0, 0.0), ("telescope", -51.0, 11.6, 0.0), ("bench", -52.4, 28.0, 0.0),
        ("litter_bin", -52.6, -12.0, 0.0), ("bicycle_rack", -52.2, -24.0, 0.0), ("lantern", -51.8, -15.0, 0.0),
    ])  # fmt: skip


def _quay(site: Site) -> None:
    things(site, "on the quay", [
        ("mooring_bollard", -34.6, 22.0, 0.0), ("mooring_bollard", -34.6, -14.0, 0.0),
        ("lifebuoy_stand", -35.0, 11.0, 0.0),
        ("kiosk", -39.6, 8.2, 0.0), ("cafe_table", -36.4, 6.0, 0.0), ("anchor_monument", -38.0, 27.0, 0.0),
        ("fish_crates", -35.4, -20.4, 30.0), ("bench", -40.2, -10.0, 0.0), ("fuel_pump", -35.4, 33.0, 0.0),
        ("street_lamp", -40.4, 12.6, 0.0), ("street_lamp", -40.4, -14.0, 0.0), ("ice_cream_cart", -37.0, -4.6, 20.0),
        ("bicycle", -39.8, -26.0, 80.0), ("crate_stack", -37.2, -31.0, 0.0), ("planter", -40.0, 22.0, 0.0),
        ("advertising_column", -39.4, 0.6, 0.0), ("direction_sign", -39.0, -20.0, 0.0),
    ])  # fmt: skip


def _river(site: Site) -> None:
    boats = [
        ("work_barge", 11.0, -18.0, 70.0), ("tugboat", -12.0, -26.0, 100.0), ("sailboat", 3.0, 27.0, 120.0),
        ("fishing_boat", -24.0, -35.0, 60.0), ("motor_yacht", -27.0, 30.0, 90.0), ("rowing_boat", -30.8, -8.0, 90.0),
        ("rowing_boat", 10.0, 14.0, 40.0), ("sailboat", 14.0, -40.0, 20.0),
        ("work_barge", -10.0, 3.0, 88.0),
    ]  # fmt: skip
    things(site, "on the river", boats, _WATER_M)
    things(
        site, "on the pontoon", [("lifebuoy_stand", -31.0, 37.0, 0.0), ("mooring_bollard", -31.0, 24.0, 0.0)], -11.4
    )
    things(site, "at the foot of the eastern pylon", [("lifebuoy_stand", 22.0, 10.6, 90.0)], -11.3)
    things(site, "at the foot of the western pylon", [("water_gauge", -22.0, -10.6, -90.0)], -11.3)


def _east(site: Site) -> None:
    place_wild(site, "on the river beach", [
        ("canoe", 32.8, 16.0, 40.0), ("picnic_table", 36.0, 22.0, 0.0), ("campfire", 34.6, -14.0, 0.0),
        ("canoe", 32.6, -21.0, 70.0), ("deck_chair", 35.6, 11.0, 180.0), ("beach_umbrella_set", 34.8, 30.0, 180.0),
        ("dome_tent", 37.4, -20.0, 180.0), ("stone_cairn", 36.8, 4.0, 0.0), ("reed_clump", 30.6, 25.0, 0.0),
        ("reed_clump", 30.8, -27.0, 0.0), ("boulder", 31.6, -9.8, 0.0), ("driftwood", 33.0, -31.0, 0.0),
    ])  # fmt: skip
    things(site, "in the depot", [
        ("site_container_office", 58.0, -16.0, 0.0), ("scaffold_tower", 57.0, -24.0, 0.0),
        ("cable_drum", 64.6, -14.0, 0.0),
        ("generator", 60.6, -32.0, 90.0), ("mobile_crane", 70.0, -18.6, 180.0), ("excavator", 64.0, -22.6, 150.0),
        ("pipe_stack", 77.0, -14.0, 0.0), ("rebar_bundle", 77.4, -23.6, 0.0), ("portable_toilet", 56.0, -31.0, 0.0),
        ("concrete_barrier", 60.6, -10.8, 90.0), ("skip_container", 71.0, -12.4, 0.0),
        ("site_light_tower", 55.8, -11.4, 0.0),
    ])  # fmt: skip
    things(site, "on the café terrace", [
        ("cafe_table", 60.4, 14.6, 0.0), ("cafe_table", 67.6, 14.6, 40.0), ("parasol", 56.0, 14.0, 0.0),
        ("planter", 54.0, 18.0, 90.0), ("a_board", 63.0, 11.0, -90.0), ("bench", 53.6, 22.4, 180.0),
        ("telescope", 53.4, 13.0, 180.0), ("phone_booth", 72.6, 11.0, 90.0), ("bicycle_rack", 74.6, 22.6, 90.0),
    ])  # fmt: skip
    things(
        site,
        "on the roof of the café",
        [("air_conditioner", 61.0, 20.5, 0.0), ("solar_panels", 67.0, 20.5, -90.0)],
        4.4,
    )
    things(site, "on the east road", [("hatchback", 70.0, -1.9, 0.0), ("city_bus", 77.0, 1.9, 180.0)])


def _trees(site: Site) -> None:
    for area in (
        rectangle(-86, -15, -49, 15.5),
        rectangle(50, -8, 86, 8),
        rectangle(54, -36, 82, -9),
        rectangle(52, 9, 80, 26),
    ):
        site.occupy(area, -3.0, 8.0)
    rng = site.rng_for("trees")
    kinds = ("urban_tree", "birch_tree", "oak_tree", "bush", "urban_tree", "bush")
    count = 0
    banks = rectangle(-84, -50, -50, 50).union(rectangle(40, -50, 84, 50)).union(rectangle(-48, -50, -43, 50))
    for pose in poisson_disc(banks, 5.6, rng):
        z = settled_z(site, pose.x, pose.y)
        kind = kinds[count % len(kinds)] if pose.x < -50 or pose.x > 44 else "bush"
        if count < 52 and site.is_free(pose.x, pose.y, 2.2, z=z):
            count += site.try_place(kind, *pose, z=z) is not None
