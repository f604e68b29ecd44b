"""What stands in the city station: trains, platform furniture, street life on both rims."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.layouts.infrastructure.rail_corridor.rail import RAIL_M, things, train
from aerialdojo_gen.scenes.site import Site

_STREET_M, _PLATFORM_M, _GOODS_M = 7.4, 1.2, 1.35


def furnish_city(site: Site) -> None:
    """Put landmarks, trains and things in their places."""
    put(site, "station_tower", 4.6, 27.2, 90.0, variant="red_brick")
    put(site, "water_tower", -46.0, -25.0, 0.0, variant="teal_band")
    put(site, "floodlight_mast", 40.0, -24.0, 120.0, variant="green")
    put(site, "chimney_stack", 38.0, -50.0, 0.0, variant="brick")
    _trains(site)
    _platforms(site)
    _yard(site)
    _north(site)
    _south(site)


def _trains(site: Site) -> None:
    train(site, 12.6, [("locomotive", "red_white", 22.0, 0.0), ("passenger_carriage", "blue_cream", 3.2, 0.0),
                       ("passenger_carriage", "green", -15.4, 0.0), ("passenger_carriage", "red", -34.0, 0.0)],
          place="at the north platform")  # fmt: skip
    train(site, -3.0, [("passenger_carriage", "silver_orange", 20.0, 0.0), ("locomotive", "orange", 1.2, 180.0)],
          place="at the island platform")  # fmt: skip
    train(
        site, 8.0, [("handcar", None, -30.0, 0.0), ("locomotive", "blue", 60.0, 180.0)], place="on the second track"
    )
    freight = [("locomotive", "green", 26.0, 0.0)]
    freight += [(c, v, 10.6 - 13.5 * k, 0.0) for k, (c, v) in enumerate(
        (("tank_wagon", "silver_orange"), ("tank_wagon", "black"), ("freight_wagon", "green_coal"),
         ("freight_wagon", "brown_closed"), ("tank_wagon", "rusty")))]  # fmt: skip
    train(site, -7.6, freight, place="on the freight line")
    yard = [("freight_wagon", "flat_logs", -36.0, 0.0), ("freight_wagon", "grey_empty", -22.5, 0.0),
            ("steam_locomotive", "black_red", 30.0, 180.0), ("tank_wagon", "green", 6.0, 0.0)]  # fmt: skip
    train(site, -13.4, yard, place="in the goods yard")
    shed = [("freight_wagon", "brown_closed", -20.0, 0.0), ("freight_wagon", "grey_empty", -6.5, 0.0),
            ("freight_wagon", "green_coal", 7.0, 180.0), ("steam_locomotive", "green", -48.0, 0.0)]  # fmt: skip
    train(site, -18.0, shed, place="before the goods shed")
    for y, x in ((-13.4, -60.0), (-18.0, -61.5)):
        put(site, "buffer_stop", x, y, 0.0, "at the end of the goods yard", z=RAIL_M - 0.15)


def _platforms(site: Site) -> None:
    z = _PLATFORM_M
    things(site, "on the north platform", [
        ("platform_shelter", -9.0, 20.2, -90.0), ("bench", -16.0, 20.9, -90.0),
        ("departure_board", -24.0, 20.6, -90.0),
        ("ticket_machine", -31.0, 21.2, -90.0), ("litter_bin", -13.0, 20.9, -90.0),
        ("vending_machine", -36.0, 21.1, -90.0),
        ("station_clock", 26.0, 18.0, 0.0), ("luggage_trolley", 18.5, 20.2, 0.0), ("bench", 31.0, 20.6, -90.0),
        ("signal_mast", 34.6, 16.4, 0.0), ("phone_booth", 22.5, 20.8, -90.0), ("photo_booth", -40.0, 20.8, -90.0),
    ], z)  # fmt: skip
    things(site, "on the island platform", [
        ("station_clock", 20.0, 5.0, 90.0), ("departure_board", -5.4, 2.5, 90.0), ("bench", -14.0, 2.5, 90.0),
        ("kiosk", -29.4, 2.5, 0.0), ("luggage_trolley", 2.6, 3.4, 20.0), ("litter_bin", 4.9, 2.0, 0.0),
        ("ticket_machine", -37.0, 2.5, 180.0), ("vending_machine", -20.8, 2.5, 0.0), ("planter", -39.6, 2.5, 0.0),
        ("signal_mast", 33.0, 4.6, 0.0), ("platform_shelter", 31.0, 1.5, 90.0), ("signal_mast", -45.0, 0.4, 180.0),
    ], z)  # fmt: skip


def _yard(site: Site) -> None:
    things(site, "in the goods yard", [
        ("switch_lever", 44.0, -18.2, 0.0), ("switch_lever", 24.0, -19.4, 0.0), ("signal_mast", 53.5, -10.5, 180.0),
        ("switch_lever", 58.0, -12.5, 90.0), ("crate_stack", 18.0, -25.5, 30.0), ("pipe_stack", 24.0, -26.0, 90.0),
        ("forklift", 31.0, -23.0, 140.0), ("oil_drums", 35.5, -27.0, 0.0), ("steel_coils", 30.0, -27.6, 90.0),
        ("gantry_crane", 59.0, -21.0, 0.0), ("shipping_container", 62.5, -26.6, 0.0),
        ("control_cabinet", -34.5, -28.6, 90.0),
        ("rebar_bundle", 44.0, -27.0, 0.0), ("pallet_stack", 37.5, -22.0, 10.0),
        ("portable_toilet", -37.4, -28.4, 90.0),
        ("wheelbarrow", -40.0, -22.5, 60.0), ("generator", 18.0, -28.0, 0.0),
    ])  # fmt: skip
    things(
        site, "along the freight line", [("water_crane", 22.2, -10.4, -90.0), ("control_cabinet", -52.0, -10.4, 0.0)]
    )
    things(site, "on the goods platform", [
        ("pallet_stack", -23.0, -25.5, 0.0), ("cardboard_boxes", -17.5, -27.5, 40.0),
        ("luggage_trolley", -12.0, -25.0, 70.0),
        ("crate_stack", -6.0, -26.8, 90.0), ("forklift", -2.4, -24.6, 200.0), ("ibc_tank", 6.0, -27.4, 0.0),
        ("oil_drums", 5.4, -23.2, 0.0), ("cardboard_boxes", -28.2, -23.0, 0.0),
    ], _GOODS_M)  # fmt: skip
    things(site, "on the roof of the goods shed", [
        ("air_conditioner", -20.0, -25.0, 0.0), ("solar_panels", -12.0, -25.0, -90.0),
        ("satellite_dish", -3.6, -25.5, 60.0),
    ], 5.82)  # fmt: skip


def _north(site: Site) -> None:
    things(site, "on the station square", [
        ("advertising_column", 10.6, 31.6, 0.0), ("bicycle_rack", 21.0, 32.6, -90.0), ("flagpole", 17.4, 29.6, 60.0),
        ("mailbox", -35.4, 32.4, 90.0), ("direction_sign", 9.4, 25.0, 90.0), ("newspaper_box", 1.6, 33.0, 90.0),
        ("market_stall", 27.0, 31.6, 90.0), ("fire_hydrant", -38.6, 33.8, 0.0), ("cafe_table", 22.5, 27.4, 0.0),
        ("cafe_table", 27.0, 25.6, 40.0), ("kiosk", 31.6, 27.0, 180.0), ("planter", -42.0, 32.0, 0.0),
        ("phone_booth", 20.4, 24.0, 180.0), ("bench", 25.0, 23.3, -90.0), ("recycling_bin", -40.0, 25.0, 0.0),
        ("a_board", 27.6, 29.0, 60.0), ("bench", -25.0, 32.6, 90.0), ("luggage_trolley", -8.0, 32.2, 0.0),
    ])  # fmt: skip
    things(site, "in the tram street", [
        ("tram", -6.0, 37.2, 0.0), ("hatchback", 25.0, 40.3, 180.0), ("sedan", -27.0, 40.3, 180.0),
    ])  # fmt: skip
    things(site, "along the tram street", [
        ("traffic_light", 4.6, 34.2, 180.0), ("bus_shelter", -14.0, 43.4, -90.0), ("crossing_sign", 14.4, 42.6, 0.0),
        ("street_lamp", -22.0, 43.0, -90.0), ("street_lamp", 22.0, 43.0, -90.0), ("litter_bin", -10.0, 43.4, -90.0),
    ])  # fmt: skip
    things(site, "on the road bridge", [("city_bus", 42.0, -4.0, 90.0)], _STREET_M - 0.12)
    things(
        site,
        "on the road bridge",
        [("delivery_van", 46.0, 10.0, -90.0), ("suv", 46.0, -18.0, -90.0)],
        _STREET_M - 0.12,
    )
    things(site, "on the road bridge", [("street_lamp", 49.4, 3.0, 180.0), ("bicycle", 38.9, 14.0, 90.0),
                                        ("litter_bin", 38.8, -12.0, 0.0)], _STREET_M)  # fmt: skip
    things(site, "on the footbridge", [("bench", 12.7, -8.0, 0.0), ("departure_board", 13.8, 14.0, 90.0),
                                       ("ticket_machine", 15.0, -2.5, 180.0), ("bicycle", 12.6, 6.0, 90.0),
                                       ("luggage_trolley", 14.8, -16.0, 90.0),
                                       ("litter_bin", 12.6, -22.0, 0.0)], _STREET_M)  # fmt: skip
    for x, y in ((-46.0, 31.0), (-41.0, 28.0), (31.0, 32.0), (35.0, 31.5), (35.4, 24.6)):
        put(site, "urban_tree", x, y, 20.0 * x)


def _south(site: Site) -> None:
    things(site, "in the south street", [
        ("delivery_van", -22.0, -35.9, 0.0), ("box_truck", 4.0, -35.9, 0.0), ("hatchback", -6.0, -39.6, 180.0),
        ("motorcycle", 20.0, -35.2, 0.0), ("pickup_truck", 24.0, -39.6, 180.0), ("sedan", -36.0, -39.6, 180.0),
    ])  # fmt: skip
    things(site, "along the south street", [
        ("street_lamp", -10.0, -33.4, -90.0), ("street_lamp", 26.0, -33.4, -90.0), ("billboard", -33.0, -32.4, 90.0),
        ("parking_meter", -16.0, -33.6, -90.0), ("ev_charger", 8.5, -33.4, -90.0), ("bench", 20.0, -31.6, 90.0),
        ("dumpster", -2.0, -43.4, 90.0), ("fire_hydrant", 31.0, -33.4, -90.0), ("mailbox", -20.0, -42.4, 90.0),
        ("guard_booth", 27.0, -44.0, 90.0), ("boom_gate", 31.0, -42.6, 0.0), ("food_truck", -30.0, -44.6, 90.0),
    ])  # fmt: skip
    things(site, "in the works yard", [
        ("storage_tank", -40.0, -50.6, 0.0), ("transformer", 28.0, -51.0, 0.0),
        ("shipping_container", -22.0, -51.0, 0.0),
        ("skip_container", -30.0, -51.6, 90.0), ("silo_cluster", 47.0, -50.6, 90.0),
    ])  # fmt: skip
    for x in (-60.0, -45.0, 14.0, 36.0, 64.0):
        put(site, "urban_tree", x, -32.2, 11.0 * x)
