"""What stands in the yard after the explosion: wrecks about the crater, services below, goods on the torn floors."""

from __future__ import annotations

from collections.abc import Sequence

from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.layouts.disaster.parts.relief import stand, stand_on_floor, strew_things
from aerialdojo_gen.scenes.layouts.disaster.parts.wreckage import XY
from aerialdojo_gen.scenes.layouts.disaster.parts.wrecks import Wreck
from aerialdojo_gen.scenes.site import Site


def furnish_yard(
    site: Site,
    blast: XY,
    factory: Wreck,
    gate: Wreck,
    bases: Sequence[float],
    hall_base: float,
    walkway: float,
) -> None:
    """Set everything out.

    Parameters
    ----------
    site : Site
        Where.
    blast : (x, y)
        Middle of the crater, metres.
    factory, gate : Wreck
        The torn factory and the gatehouse.
    bases : sequence of float
        Heights of their ground floors, metres.
    hall_base, walkway : float
        Heights of the hall's floor and of the pipe bridge's walkway, metres.
    """
    stand(site, "at the bottom of the crater", [("burnt_car", blast[0] + 0.3, blast[1] - 0.2, 35.0)], sink_m=0.15)
    stand(site, "by the gate of the yard", [("chimney_stack", -29.6, 20.5, 0.0)])
    for storey, place, rows in (
        (
            1,
            "on the first floor of the torn factory",
            [("forklift", -5.8, -3.0, 20.0), ("pallet_stack", 12.6, -2.4, 10.0)],
        ),
        (
            2,
            "on the second floor of the torn factory",
            [("crate_stack", 13.4, -1.2, 0.0), ("generator", -7.6, -2.8, 60.0)],
        ),
        (
            3,
            "on the third floor of the torn factory",
            [("oil_drums", -9.0, -2.4, 0.0), ("wheelie_bin", 11.8, 1.0, -90.0)],
        ),
        (
            4,
            "on the roof of the torn factory",
            [
                ("air_conditioner", -9.4, -3.4, 0.0),
                ("satellite_dish", 7.0, 4.2, 210.0),
                ("water_tank", -12.6, 2.6, 0.0),
            ],
        ),
    ):
        stand_on_floor(site, factory, bases[0], storey, place, rows)
    stand_on_floor(site, gate, bases[1], 2, "on the roof of the gatehouse", [("solar_panels", -2.4, 0.6, 90.0)])
    stand(
        site,
        "on the gallery of the wrecked hall",
        [("control_cabinet", 29.3, 7.4, 180.0), ("ibc_tank", 29.3, -5.6, 0.0)],
        z=hall_base + 3.9,
    )
    stand(site, "in the wrecked hall", [("gas_cylinder_cage", 19.4, 5.4, 180.0), ("transformer", 24.0, 9.4, 90.0)])
    stand(
        site,
        "on the broken pipe bridge",
        [("barrier", -18.5, 1.4, 90.0), ("cardboard_boxes", -18.5, -9.4, 0.0)],
        z=walkway,
    )
    stand(
        site,
        "in the upper yard",
        [
            ("overturned_car", 9.6, 7.4, 50.0),
            ("rubble_heap", -9.4, -6.4, 30.0),
            ("stretcher", -12.6, 4.2, 100.0),
            ("search_light", -12.6, 10.0, -50.0),
            ("broken_power_pole", 8.4, -9.8, -6.0),
        ],
    )
    stand(
        site,
        "in the lower yard",
        [
            ("fire_engine", 1.0, -18.4, 176.0),
            ("ambulance", 12.0, -18.6, 186.0),
            ("rescue_tent", 28.4, -23.6, 100.0),
            ("evacuation_sign", 12.2, -26.4, 90.0),
            ("sandbag_wall", -3.6, -24.6, 80.0),
            ("shipping_container", -28.0, -20.0, 78.0),
            ("skip_container", 20.2, -28.2, 0.0),
            ("sedan", 8.0, -28.2, -90.0),
        ],
    )
    strew_things(
        site,
        "in the upper yard",
        rectangle(-16.5, -13.0, 15.5, 12.5),
        [
            "sandbag_wall",
            "evacuation_sign",
            "barrier",
            "skip_container",
            "traffic_cone",
            "concrete_barrier",
            "fuel_drum",
            "cable_drum",
            "wheelbarrow",
        ],
        "upper",
    )
    strew_things(
        site,
        "in the lower yard",
        rectangle(-10.0, -31.0, 34.0, -16.5),
        [
            "generator",
            "barrier",
            "traffic_cone",
            "pallet_stack",
            "water_pump",
            "portable_toilet",
            "wheelie_bin",
        ],
        "lower",
    )
