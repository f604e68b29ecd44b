"""A small park-and-ride: slanted bays, lock-up garages, a timber carport, and a footbridge over all of it."""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon

from aerialdojo_gen.scenes.grammar_buildings import building, wall_with_openings
from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_props import deal, put
from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.grammar_streets import arrow, crossing, streets
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.parking import park_cars
from aerialdojo_gen.scenes.kit.structures import (
    Parts,
    block,
    canopy,
    columns,
    deck,
    letters,
    railing,
    stairs,
)
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site

_SLANT_DEG = 60.0
_BRIDGE_M = 4.8
_SMALL_CARS = {"sedan": 0.3, "hatchback": 0.4, "suv": 0.15, "pickup_truck": 0.15}


def build_lot(site: Site, occupancy: float) -> None:
    """Build the park-and-ride; `occupancy` is the share of the bays that is taken, 0 to 1."""
    _ground(site)
    bays = [*slanted_row(site, -13.0, -12.0, 10, 1), *slanted_row(site, -13.0, 4.6, 10, -1)]
    _garages(site)
    _carport(site)
    _station(site)
    _footbridge(site)
    _furnish(site)
    park_cars(site, bays, occupancy, "in the slanted bays", kinds=_SMALL_CARS)


def slanted_row(
    site: Site, x0: float, y: float, count: int, up: int, *, pitch_m: float = 3.1, depth_m: float = 5.0
) -> list[Pose]:
    """Mark slanted bays along y from `x0` eastwards; cars face away from the aisle, north where `up` is 1.

    Returns
    -------
    list of Pose
        Middle of every bay and the way in.
    """
    c = np.cos(np.radians(_SLANT_DEG)) * depth_m
    poses = []
    for k in range(count + 1):
        x = x0 + k * pitch_m
        site.paint(
            Polygon([(x, y), (x + 0.16, y), (x + 0.16 + c, y + up * depth_m), (x + c, y + up * depth_m)]), "marking"
        )
        if k < count:
            poses.append(Pose(x + (pitch_m + c) / 2, y + up * depth_m / 2, up * _SLANT_DEG))
    return poses


def _ground(site: Site) -> None:
    site.set_ground(material=site.material("lawn", "grass"))
    streets(site, [((-36, -24.0), (36, -24.0))], pavement_m=2.4)
    site.paint(rectangle(-34, -18.0, 34, 24), site.material("lot", "gravel:#a8a092"))
    site.paint(rectangle(-14, -12.6, 24, 5.2), site.material("bays", "concrete:#98948a"))
    site.paint(rectangle(25, -18, 34, 24), site.material("paving", "cobbles"), 0.12)
    site.paint(rectangle(-30, -21.4, -22, -17.5), "asphalt")
    site.paint(rectangle(-11, -15.6, 21, -12.6), site.material("lawn", "grass"), 0.14)
    crossing(site, 20, -24, 90, 6.5)
    for x in (-8, 6, 18):
        arrow(site, x, -4.0, 0.0)


def _garages(site: Site) -> None:
    wall, door = site.material("garage", "brick:#a5664e"), ("#3f6f5a", "#7a3b36", "#44618a", "#c9a23f")
    count, width, depth, high = 9, 3.4, 6.0, 2.9
    x0, y0 = -24.0, 17.0
    x1 = x0 + count * width
    doors = [(k * width + 0.35, k * width + 3.05, 0.0, 2.4) for k in range(count)]
    parts: Parts = [
        (wall, wall_with_openings((x0, y0 + 0.12), (x1, y0 + 0.12), 0.0, high, doors, 0.24)),
        (wall, block(x0, y0 + depth - 0.24, x1, y0 + depth, 0.0, high)),
        ("concrete", block(x0 - 0.25, y0 - 0.5, x1 + 0.25, y0 + depth + 0.2, high, high + 0.25)),
        ("sheet_metal:#70787a", block(x0, y0 - 0.2, x1, y0 + depth, high + 0.25, high + 0.32)),
    ]
    parts += [
        (wall, block(x0 + k * width - 0.12, y0 + 0.24, x0 + k * width + 0.12, y0 + depth - 0.24, 0.0, high))
        for k in range(count + 1)
    ]
    for k in range(count):
        if k % 3 == 1:
            parts.append(
                (door[k % 4], block(x0 + k * width + 0.4, y0 + 0.3, x0 + (k + 1) * width - 0.4, y0 + 2.6, 2.46, 2.54))
            )
        else:
            slats = [block(x0 + k * width + 0.36, y0 + 0.06, x0 + (k + 1) * width - 0.36, y0 + 0.16 + 0.04 * (i % 2),
                           0.02 + 0.4 * i, 0.4 + 0.4 * i) for i in range(6)]  # fmt: skip
            parts.append((door[k % 4], merge(slats)))
    site.add("lockup_garages", "garages", parts, {"place": "along the north side"})
    site.occupy(rectangle(x0 - 0.3, y0 + 0.3, x1 + 0.3, y0 + depth), high - 0.4, high + 0.3)
    inside = ["motorcycle", "bicycle", "quad_bike"]
    for n, k in enumerate((1, 4, 7)):
        put(site, inside[n], x0 + (k + 0.5) * width, y0 + 1.6, -90.0, "in an open garage")
    for category, x in (
        ("solar_panels", -20.0),
        ("water_tank", -10.0),
        ("satellite_dish", -2.0),
        ("mountain_bike", 3.4),
    ):
        put(site, category, x, y0 + 3.0, -90.0, "on the roof of the garages", z=high + 0.32)
    front = ["oil_drums", "wheelbarrow", "pallet_stack", "shopping_cart", "crate_stack"]
    deal(site, front, [Pose(x0 + width * k, y0 - 1.3, -90.0) for k in (1, 3, 6, 8)], "in front of the garages")


def _carport(site: Site) -> None:
    posts = [(x, y) for x in (-32.6, -27.4) for y in np.linspace(-12.4, 10.4, 6)]
    parts: Parts = [
        ("wood", columns(posts, 0.0, 2.9, 0.14, 6)),
        (site.material("carport_roof", "corrugated:#5f7466"), block(-33.2, -13.2, -26.6, 11.2, 3.02, 3.16)),
        ("wood", merge([block(x - 0.1, -13.0, x + 0.1, 11.0, 2.8, 3.02) for x in (-32.6, -27.4)])),
        ("boards:#8d6f4c", block(-33.2, -13.0, -33.0, 11.0, 0.0, 2.2)),
    ]
    site.add("carport", "carport", parts, {"place": "along the west side"})
    bays = [Pose(-29.9, -10.1 + 4.56 * k, 180.0) for k in range(5)]
    deal(
        site,
        ["pickup_truck", "hatchback", "golf_cart", "suv"],
        [b for k, b in enumerate(bays) if k != 2],
        "under the carport",
    )
    put(site, "bicycle_rack", -30.2, -1.0, 0.0, "under the carport")


def _station(site: Site) -> None:
    plan = rectangle(26.0, 6.0, 33.5, 20.0)
    extra: Parts = [
        ("#2d5f8a", block(25.0, 8.6, 25.9, 17.4, 3.2, 3.4)),
        ("iron", columns([(25.15, 9.0), (25.15, 17.0)], 0.12, 3.2, 0.08)),
        ("window", block(25.92, 12.0, 26.05, 14.0, 0.12, 2.5)),
        ("#2d5f8a", block(29.0 - 2.6, 5.85, 29.0 + 3.6, 6.0, 3.0, 4.1)),
        ("marking", letters("PARK+RIDE", 0.7, (29.5, 5.84, 3.2), -90.0, 0.05)),
    ]
    building(site, plan, wall=site.material("station", "facade_brick:#a8785a"), roof="roof_tiles:#7d4a38", storeys=2,
             storey_m=3.0, roof_kind="hip", roof_m=2.4, z=0.0, category="ticket_office",
             attributes={"material": "brick"}, extra=extra)  # fmt: skip
    front = ["vending_machine", "bench", "newspaper_box", "a_board", "planter", "phone_booth", "information_board"]
    deal(
        site, front, [Pose(27.2 + 2.2 * k, 4.4 - 1.5 * (k % 2), -90.0) for k in range(3)], "before the ticket office"
    )
    deal(site, front[3:], [Pose(24.2, y, 180.0) for y in (7.2, 10.6, 15.4, 18.8)], "beside the ticket office")
    put(site, "wall_clock", 26.0, 18.4, 180.0, "on the ticket office", z=3.6)
    put(site, "clock_tower", 29.8, -7.0, 180.0)


def _footbridge(site: Site) -> None:
    floor, rail = "boards:#8f8676", site.material("bridge", "#b0542f")
    plan = rectangle(-18.6, -15.0, -16.2, 14.0)
    parts = deck(plan, _BRIDGE_M, floor=floor, under=rail, thickness_m=0.45, post=rail, post_radius_m=0.16,
                 posts=[(x, y) for x in (-18.3, -16.5) for y in (-13.0, 0.0, 13.0)])  # fmt: skip
    for x in (-18.55, -16.25):
        parts += railing([(x, -15.0), (x, 14.0)], _BRIDGE_M, pane="chain_link", frame=rail)
    parts += stairs((-8.2, 12.9), 180.0, 1.9, _BRIDGE_M, 8.0, tread="boards:#8f8676", stringer=rail)
    parts += stairs((-26.6, -13.9), 0.0, 1.9, _BRIDGE_M, 8.0, tread="boards:#8f8676", stringer=rail)
    parts += canopy(-19.0, -4.0, -15.8, 6.0, _BRIDGE_M + 2.6, roof="corrugated:#5f7466", post=rail, foot_m=_BRIDGE_M,
                    posts=[(x, y) for x in (-18.5, -16.3) for y in (-3.6, 5.6)])  # fmt: skip
    site.add("footbridge", "footbridge_structure", parts, {"place": "across the car park"})
    site.occupy(rectangle(-18.8, -15.2, -16.0, 14.2), 4.2, 6.0)
    put(site, "planter", -17.4, -12.0, 0.0, "on the footbridge", z=_BRIDGE_M)
    put(site, "telescope", -17.4, 1.0, 180.0, "on the footbridge", z=_BRIDGE_M)
    put(site, "litter_bin", -17.4, 9.6, 0.0, "on the footbridge", z=_BRIDGE_M)


def _furnish(site: Site) -> None:
    autumn = ("yellow", "red")
    for k, (x, y) in enumerate([*((x, -14.1) for x in range(-8, 22, 6)), (-33.0, 20.0), (-28.5, 25.5), (-12.0, 26.0),
                                (4.0, 26.0), (18.0, 26.0), (33.4, 26.0), (33.4, -14.0)]):  # fmt: skip
        site.try_place("urban_tree", x, y, 47.0 * k, variant=autumn[k % 2])
    stop = ["bus_shelter", "mailbox", "traffic_light", "fire_hydrant", "litter_bin", "crossing_sign", "litter_bin"]
    deal(site, stop, [Pose(x, -19.4, -90.0) for x in (4.0, 8.4, 16.6, 12.0, -2.5, 23.0, -7.0)], "at the bus stop")
    put(site, "city_bus", 3.0, -25.6, 0.0, "at the bus stop")
    put(site, "scooter", 27.0, -25.4, 8.0, "in the street")
    put(site, "ticket_booth", -19.4, -17.8, 180.0, "at the entrance")
    put(site, "boom_gate", -22.4, -17.6, 90.0, "at the entrance")
    put(site, "stop_sign", -31.6, -19.0, -90.0, "at the entrance")
    yard = ["kiosk", "planter", "bicycle", "cafe_table", "parking_meter", "ev_charger", "balloon_stand"]
    spots = [(28.0, -15.5), (32.0, -12.0), (27.0, -1.0), (32.0, 0.8), (25.6, -4.0), (25.6, -10.0), (32.2, -3.0)]
    deal(site, yard, [Pose(x, y, 180.0) for x, y in spots], "in the station yard")
    middle = [
        "food_truck",
        "traffic_cone",
        "dumpster",
        "recycling_bin",
        "generator",
        "delivery_van",
        "basketball_hoop",
    ]
    spots2 = [(14.0, 9.6, -90.0), (-6.4, -4.0, 0.0), (10.0, 18.9, -90.0), (12.6, 21.5, 180.0), (17.0, 19.5, 90.0),
              (21.5, 13.0, 100.0), (-22.8, 8.0, 0.0)]  # fmt: skip
    deal(site, middle, [Pose(*s) for s in spots2], "in the gravel lot")
    for x in (-2.0, 12.0):
        put(site, "street_lamp", x, 6.2, -90.0, "over the bays")
    fence(site, [(-34.0, -17.0), (-34.0, 24.0), (34.0, 24.0)], "hedge", "hedge:#6f7434")
    fence(site, [(12.0, 15.0), (12.0, 22.9)], "board")
