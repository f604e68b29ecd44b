"""What stands at the country station: two trains, platform furniture, a goods yard, a village street, a valley."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from shapely.geometry import LineString

from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.natural_ground import keep_clear, place_wild, settled_z
from aerialdojo_gen.scenes.kit.rail import RAIL_M
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.site import Site

_PLATFORM_M = 1.05


def furnish_country(site: Site, brook_x: Callable[[float], float]) -> None:
    """Put landmarks, trains and things in their places, then the trees between them."""
    put(site, "station_tower", -4.0, 15.4, 90.0, variant="white", scale=0.62)
    put(site, "water_tower", 6.6, -15.5, 0.0, variant="red_band", scale=0.8)
    put(site, "obelisk", 2.2, 20.6, 0.0, variant="red_granite", scale=0.6)
    put(site, "windmill_pump", 57.0, 24.0, 200.0, z=settled_z(site, 57.0, 24.0, 1.2), variant="red")
    _trains(site)
    _platforms(site)
    _yard(site)
    _street(site)
    _valley(site, brook_x)
    _trees(site, brook_x)


def _trains(site: Site) -> None:
    train(site, 4.6, [("steam_locomotive", "green", -3.4, 0.0), ("passenger_carriage", "red", -21.2, 0.0)],
          place="at the station platform")  # fmt: skip
    train(
        site,
        0.0,
        [("locomotive", "blue", 36.0, 0.0), ("freight_wagon", "flat_logs", 20.6, 0.0)],
        place="on the viaduct",
    )
    train(site, 0.0, [("freight_wagon", "green_coal", 6.9, 0.0), ("tank_wagon", "silver_orange", -6.6, 0.0)],
          place="on the main line")  # fmt: skip
    train(
        site,
        -8.6,
        [("freight_wagon", "brown_closed", -16.8, 0.0), ("handcar", None, -7.4, 0.0)],
        place="in the siding",
    )
    put(site, "buffer_stop", -26.6, -8.6, 0.0, "at the end of the siding", z=RAIL_M - 0.15, variant="red_white")


def _platforms(site: Site) -> None:
    things(site, "on the station platform", [
        ("bench", -19.2, 10.2, -90.0), ("ticket_machine", -12.4, 10.3, -90.0), ("station_clock", -6.6, 9.6, 90.0),
        ("luggage_trolley", -1.0, 9.4, 10.0), ("departure_board", -26.4, 10.0, -90.0),
        ("flower_tub", -23.4, 10.1, 0.0),
        ("signal_mast", 1.0, 7.6, 0.0), ("litter_bin", -9.0, 9.9, 0.0),
    ], _PLATFORM_M)  # fmt: skip
    things(site, "on the narrow platform", [
        ("platform_shelter", -11.4, -4.6, 90.0), ("bench", -20.0, -4.9, 90.0), ("station_clock", -25.9, -4.3, 0.0),
        ("planter", -7.4, -5.2, 0.0), ("luggage_trolley", -17.2, -3.6, 0.0), ("signal_mast", -6.6, -2.9, 180.0),
    ], _PLATFORM_M)  # fmt: skip


def _yard(site: Site) -> None:
    things(site, "in the goods yard", [
        ("tractor", -15.0, -14.2, 20.0), ("hay_bales", -8.6, -19.4, 0.0), ("log_pile", -2.2, -20.0, 0.0),
        ("water_barrel", -18.6, -18.4, 0.0), ("wheelbarrow", -17.2, -20.8, 120.0),
        ("pickup_truck", -3.0, -14.4, 160.0),
        ("pallet_stack", -24.0, -14.0, 0.0), ("cardboard_boxes", -23.4, -19.4, 30.0), ("bicycle", -13.4, -21.2, 0.0),
        ("sawhorse", 0.4, -17.0, 45.0), ("switch_lever", -2.2, -11.2, 0.0), ("portable_toilet", -28.0, -12.4, 0.0),
    ])  # fmt: skip
    things(site, "along the line", [
        ("water_crane", 5.4, 7.4, -90.0), ("switch_lever", 11.6, 4.0, 0.0), ("signal_mast", 12.0, -4.4, 180.0),
        ("switch_lever", -41.0, 7.6, 0.0), ("beehive", 8.6, -7.6, 180.0),
    ])  # fmt: skip
    things(site, "at the level crossing", [
        ("level_crossing_barrier", -37.4, -4.9, -90.0), ("level_crossing_barrier", -30.6, 9.6, 90.0),
        ("motorcycle", -33.2, 14.4, -90.0), ("sedan", -32.4, -9.6, 90.0), ("stop_sign", -38.0, -8.6, -90.0),
    ])  # fmt: skip


def _street(site: Site) -> None:
    things(site, "on the station forecourt", [
        ("phone_booth", -23.6, 19.8, 90.0), ("mailbox", -18.6, 19.6, 90.0), ("bicycle_rack", -11.0, 19.8, 90.0),
        ("kiosk", 5.0, 16.4, 90.0), ("bench", -20.9, 19.3, 90.0), ("direction_sign", -1.4, 20.2, 90.0),
        ("cafe_table", 1.0, 14.6, 0.0), ("lantern", -25.6, 20.4, 90.0), ("advertising_column", 8.6, 20.6, 0.0),
    ])  # fmt: skip
    things(site, "in the station road", [
        ("city_bus", -14.0, 22.9, 0.0), ("hatchback", 2.0, 25.2, 180.0), ("delivery_van", -24.0, 25.2, 180.0),
    ])  # fmt: skip
    things(site, "along the station road", [("bus_shelter", -18.0, 27.6, -90.0), ("street_lamp", -5.0, 27.4, -90.0),
                                            ("fire_hydrant", -10.0, 27.4, 0.0)])  # fmt: skip
    things(site, "in a village garden", [
        ("garden_shed", -18.4, 35.0, -90.0), ("clothes_line", -30.0, 33.0, 0.0), ("birdhouse", -1.0, 31.0, -90.0),
        ("dog_house", -19.0, 30.6, -90.0), ("bird_bath", -14.6, 30.8, 0.0), ("garden_swing", -0.6, 35.6, 180.0),
    ])  # fmt: skip


def _valley(site: Site, brook_x: Callable[[float], float]) -> None:
    path = [(brook_x(y) - 7.0, y) for y in (-30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0)]
    x = {round(y): px for px, y in path}
    place_wild(site, "on the bank of the brook", [
        ("picnic_table", x[10] - 2.4, 9.0, 20.0), ("information_board", x[-10] - 1.8, -8.0, 0.0),
        ("campfire", x[-20] + 3.0, -17.5, 0.0), ("tent", x[-20] - 0.6, -21.5, 60.0),
        ("dome_tent", x[20] + 2.6, 17.0, 200.0),
        ("stone_cairn", x[10] + 3.0, 13.0, 0.0), ("tree_stump", x[-10] + 2.4, -12.6, 0.0),
        ("wooden_gate", x[20], 22.0, 90.0),
        ("trail_signpost", x[0] + 2.2, 5.4, 0.0), ("bench", x[-10] + 1.8, -6.0, 0.0),
        ("deer", x[20] - 3.0, 17.0, 30.0),
    ])  # fmt: skip
    place_wild(site, "under the viaduct", [("canoe", 21.8, 1.4, 80.0), ("log_pile", 20.0, -1.6, 0.0)])
    place_wild(site, "on the slope of the valley", [
        ("fallen_log", 17.6, 12.0, 30.0), ("rock_pile", 19.4, -9.0, 0.0), ("hunting_stand", 17.0, -18.0, 0.0),
        ("boulder", 21.0, 7.6, 0.0), ("boulder", 47.0, 12.0, 50.0), ("fox", 15.6, 8.6, 200.0),
        ("dead_tree", 14.5, 26.0, 0.0),
        ("mushroom_cluster", 18.4, 21.0, 0.0), ("standing_stone", 20.4, -27.0, 0.0),
    ])  # fmt: skip
    put(site, "footbridge", brook_x(-14.0), -14.0, 0.0, "across the brook", z=-10.15)
    keep_clear(site, site.instances[-1], 1.0)


def _trees(site: Site, brook_x: Callable[[float], float]) -> None:
    rng = site.rng_for("trees")
    brook = LineString([(brook_x(float(y)), float(y)) for y in range(-48, 49, 3)]).buffer(3.4)
    for area in (rectangle(-60, -3.6, 60, 9), rectangle(-31, -24, 12, 30), rectangle(-38, -48, -30, 48), brook,
                 rectangle(-32, -48, 12, -26)):  # fmt: skip
        site.occupy(area, -12.0, 12.0)
    kinds = ("oak_tree", "birch_tree", "oak_tree", "bush", "pine_tree", "birch_tree", "bush")
    count = 0
    for pose in poisson_disc(site.extent.buffer(-2.5), 5.0, rng):
        kind = kinds[count % len(kinds)]
        if count < 74 and site.is_free(pose.x, pose.y, 2.4, z=settled_z(site, pose.x, pose.y)):
            count += site.try_place(kind, *pose, z=settled_z(site, pose.x, pose.y)) is not None


def train(
    site: Site, y: float, cars: Sequence[tuple[str, str | None, float, float]], *, place: str, z: float = RAIL_M
) -> list[Instance]:
    """Put vehicles on a track along x: (category, variant or None for the rarest, x, yaw in degrees) each."""
    out = []
    for category, variant, x, yaw in cars:
        options = {} if variant is None else {"variant": variant}
        out.append(put(site, category, x, y, yaw, place, z=z, **options))
    return out


def things(
    site: Site, place: str, spots: Sequence[tuple[str, float, float, float]], z: float | None = None,
) -> None:  # fmt: skip
    """Set out props, (category, x, y, yaw) each, on the ground or on a floor at `z`."""
    for category, x, y, yaw in spots:
        put(site, category, x, y, yaw, place, z=z)
