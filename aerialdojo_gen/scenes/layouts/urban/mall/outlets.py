"""An outlet village: two rows of shops along a pedestrian street with a round plaza, galleries and roof gardens.

The street runs along x through the middle of the site; a gallery follows it on either side and rings the plaza. North
is +y; the car park lies in the south, yards and a playground in the north.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from shapely.geometry import Polygon
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_props import deal, put
from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.grammar_streets import arrow, crossing, parking_row, streets
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit.parking import park_cars
from aerialdojo_gen.scenes.kit.structures import (
    Parts,
    block,
    canopy,
    deck,
    letters,
    railing,
    spaced,
    stairs,
)
from aerialdojo_gen.scenes.layouts.urban.mall.shops import STOREY_M, anchor_store, shop_names, shop_row, shopping_hall
from aerialdojo_gen.scenes.site import Site

_HALF_STREET_M = 8.0
_GALLERY_M = 3.0
_PLAZA_M = 14.0
_ENDS = (-56.0, 56.0)
_DEPTH_M = 18.0
_NORTH_PASSAGES = ((-36.0, -30.0), (24.0, 30.0))
_SOUTH_PASSAGES = ((-26.0, -20.0), (34.0, 40.0))
_BRIDGES = (-44.0, 46.0)
_ROOF_M = 2 * STOREY_M
_ROOF_XS = (-52.0, -45.0, -38.0, -31.0, -24.0, -17.0, -9.5, 10.0, 17.0, 24.0, 31.0, 38.0, 45.0, 52.0)


def build_outlets(site: Site, occupancy: float) -> None:
    """Build the outlet village on 160 by 128 m."""
    _ground(site)
    names = shop_names(3)
    for side, passages in ((1, _NORTH_PASSAGES), (-1, _SOUTH_PASSAGES)):
        _row(site, side, passages, names)
    anchor_store(site, 58.5, -22.0, 76.0, -6.0, 12.0, sign="HOME", wall=site.material("store", "tiles:#c8963f"),
                 node="home_store")  # fmt: skip
    _galleries(site)
    _arches(site)
    _landmarks(site)
    _street_life(site)
    _galleries_life(site)
    _roofs(site)
    _yards(site)
    _playground(site)
    _car_park(site, occupancy)


def _ground(site: Site) -> None:
    site.set_ground(material=site.material("lawn", "grass"))
    site.paint(rectangle(-60, -30, 78, 30), site.material("plaza", "paving"), 0.12)
    site.paint(
        rectangle(*_ENDS[:1], -_HALF_STREET_M, _ENDS[1], _HALF_STREET_M), site.material("court", "tiles"), 0.12
    )
    site.paint(disc(0, 0, _PLAZA_M), site.material("round", "cobbles:#b0a390"), 0.12)
    site.paint(disc(0, 0, 4.6), "paving:#8d7a66", 0.12)
    site.paint(rectangle(-60, 30, 78, 38), "concrete:#8f8d88")
    streets(site, [[(-80, -60), (80, -60)], [(-70, -60), (-70, 64)]])
    site.paint(rectangle(-64, -54, 66, -32), "asphalt")
    site.paint(rectangle(-67, -47, -63, -40), "asphalt")
    for x, y, yaw in ((-70.0, 0.0, 0.0), (0.0, -60.0, 90.0), (-70.0, -30.0, 0.0)):
        crossing(site, x, y, yaw, 6.5)
    arrow(site, -71.7, -42.0, 90.0)
    arrow(site, -68.3, 20.0, -90.0)
    site.paint(disc(-20, 50, 9.5), "gravel:#c2b393")
    site.paint(rectangle(-60, 49, 40, 51), "gravel:#c2b393")


def _hall(side: int) -> Polygon:
    low, high = sorted((side * _HALF_STREET_M, side * (_HALF_STREET_M + _DEPTH_M)))
    return rectangle(_ENDS[0], low, _ENDS[1], high).difference(disc(0, 0, _PLAZA_M))


def _passage(side: int, ends: tuple[float, float]) -> Polygon:
    low, high = sorted((side * _HALF_STREET_M, side * (_HALF_STREET_M + _DEPTH_M)))
    return rectangle(ends[0], low, ends[1], high)


def _row(site: Site, side: int, passages: Sequence[tuple[float, float]], names: Iterator[str]) -> None:
    """Put up one row of shops, open to its yard by passages under the upper storey."""
    name = "north" if side > 0 else "south"
    shopping_hall(site, _hall(side), unary_union([_passage(side, ends) for ends in passages]),
                  node=f"{name}_row", category="shop_row_building")  # fmt: skip
    wall, yaw = side * _HALF_STREET_M, -90.0 * side
    lower = [x for x in (-52.0, -45.5, -39.5, -26.5, -18.5, 18.5, 33.5, 42.5, 50.5) if _clear(x, passages)]
    upper = [-52.0, -38.0, -31.0, -22.0, 20.0, 29.0, 37.0, 52.0]
    shop_row(site, [(x, wall) for x in lower], yaw, f"on the {name} side of the high street", names)
    shop_row(site, [(x, wall) for x in upper], yaw, f"on the {name} gallery", names, z=STOREY_M)
    back = side * (_HALF_STREET_M + _DEPTH_M)
    shop_row(site, [(x, back) for x in (-48.0, -12.0, 12.0, 50.0)], -yaw, f"at the back of the {name} row", names)


def _clear(x: float, passages: Sequence[tuple[float, float]]) -> bool:
    return all(x + 3.2 < a or x - 3.2 > b for a, b in passages)


def _galleries(site: Site) -> None:
    inner = _HALF_STREET_M - _GALLERY_M
    ring = disc(0, 0, _PLAZA_M).difference(disc(0, 0, _PLAZA_M - _GALLERY_M))
    sides = [rectangle(_ENDS[0], min(a, b), _ENDS[1], max(a, b)) for a, b in
             ((inner, _HALF_STREET_M), (-_HALF_STREET_M, -inner))]  # fmt: skip
    plan = unary_union([ring.buffer(0.02), *[s.difference(disc(0, 0, _PLAZA_M)) for s in sides]])
    floor, under = site.material("gallery_floor", "boards:#8f7a5f"), site.material("steel", "#2f4f4a")
    posts = [
        (x, s * (inner + 0.4)) for s in (-1, 1) for x in (*spaced_x(-54.0, -16.0, 6.4), *spaced_x(16.0, 54.0, 6.4))
    ]
    posts += [(12.6 * math.cos(a), 12.6 * math.sin(a)) for a in (math.radians(22.5 + 45 * k) for k in range(8))]
    parts = deck(plan, STOREY_M, floor=floor, under=under, posts=posts, post=under, post_radius_m=0.2)
    meet = math.sqrt(_PLAZA_M**2 - inner**2)
    gaps = {1: (_BRIDGES[0] - 1.5, _BRIDGES[0] + 1.5), 2: (_BRIDGES[1] - 1.5, _BRIDGES[1] + 1.5)}
    for s in (-1, 1):
        for x0, x1 in ((_ENDS[0], gaps[1][0]), (gaps[1][1], -meet), (meet, gaps[2][0]), (gaps[2][1], _ENDS[1])):
            parts += railing([(x0, s * inner), (x1, s * inner)], STOREY_M)
    circle = [((_PLAZA_M - _GALLERY_M) * math.cos(a), (_PLAZA_M - _GALLERY_M) * math.sin(a))
              for a in (2 * math.pi * k / 24 for k in range(25))]  # fmt: skip
    parts += railing(circle, STOREY_M)
    for x, s in ((-16.4, 1), (16.4, -1)):
        foot = x - 9.4 if x < 0 else x + 9.4
        parts += stairs((foot, s * 3.9), 0.0 if x < 0 else 180.0, 2.0, STOREY_M - 0.12, 8.6, z_m=0.12, tread=floor)
    site.add("gallery", "gallery", parts, {"place": "along the high street"})
    for name, x in zip(("west", "east"), _BRIDGES, strict=True):
        bridge = deck(rectangle(x - 1.5, -inner, x + 1.5, inner), STOREY_M, floor=floor, under=under)
        for dx in (-1.45, 1.45):
            bridge += railing([(x + dx, -inner), (x + dx, inner)], STOREY_M)
        bridge += canopy(x - 1.7, -3.5, x + 1.7, 3.5, STOREY_M + 2.8, roof="sheet_metal:#c8963f", foot_m=STOREY_M,
                         posts=[(x + dx, dy) for dx in (-1.3, 1.3) for dy in (-3.2, 3.2)])  # fmt: skip
        site.add(f"{name}_bridge", "footbridge_mall", bridge, {"place": f"at the {name} end of the high street"})


def spaced_x(x0: float, x1: float, spacing_m: float) -> list[float]:
    """List coordinates from `x0` to `x1`, about `spacing_m` apart, metres."""
    return [x for x, _ in spaced((x0, 0.0), (x1, 0.0), spacing_m)]


def _arches(site: Site) -> None:
    """Mark both ends of the street with a gate that bears its name, and hang sails over the street."""
    for name, x, yaw in (("west", _ENDS[0] - 1.2, 180.0), ("east", _ENDS[1] + 1.2, 0.0)):
        colour = site.material("gate", "tiles:#2f6f66")
        parts: Parts = [(colour, block(x - 0.6, s * 7.4 - 0.6, x + 0.6, s * 7.4 + 0.6, 0.12, 11.4)) for s in (-1, 1)]
        parts.append((colour, block(x - 0.6, -8.0, x + 0.6, 8.0, 9.4, 11.8)))
        parts.append(("marking", letters("OUTLETS", 1.5, (x + math.copysign(0.6, x), 0.0, 9.8), yaw, 0.15)))
        site.add(f"{name}_gate", "portal", parts, {"colour": "green"},
                 footprint=rectangle(x - 0.6, 6.8, x + 0.6, 8.0))  # fmt: skip
    for k, (x, width) in enumerate(((-33.0, 7.0), (-21.0, 6.0), (24.0, 6.0), (34.0, 7.0))):
        sail = site.material(f"sail_{k}", ("#f2efe6", "#d9772b", "#f2efe6", "#2f6f66")[k])
        parts = canopy(x - width / 2, -4.0, x + width / 2, 4.0, 8.4, roof=sail, post="iron")
        parts += [("iron", block(x - 0.05, s * 4.0, x + 0.05, s * 8.0, 8.5, 8.6)) for s in (-1, 1)]
        site.add(None, "canopy", parts, {"place": "over the high street"})


def _landmarks(site: Site) -> None:
    put(site, "clock_tower", 0.0, 0.0, -90.0)
    put(site, "fountain", -50.5, 0.0, 0.0)
    put(site, "statue", 50.5, 0.0, 180.0)
    put(site, "pylon_sign", 62.0, -29.0, -90.0)
    put(site, "water_tower", -50.0, 45.0)


def _street_life(site: Site) -> None:
    street = ["bench", "planter", "litter_bin", "a_board", "cafe_table", "kiosk", "newspaper_box", "mailbox",
              "bicycle",
              "ice_cream_cart", "clothes_rack", "vending_machine", "recycling_bin", "atm_kiosk", "direction_sign",
              "scooter", "phone_booth", "balloon_stand", "topiary", "market_stall", "photo_booth",
              "shopping_cart"]  # fmt: skip
    xs = [-41.0, -37.5, -33.5, -29.0, -25.0, -20.5, -17.0, 18.0, 22.0, 26.5, 30.5, 34.5, 38.5, 42.5]
    spots = [Pose(x, 1.9 if k % 2 else -1.9, 90.0 if k % 2 else -90.0) for k, x in enumerate(xs)]
    deal(site, street, spots, "in the high street")
    plaza = ["cafe_table", "bench", "advertising_column", "ice_cream_cart", "planter", "market_stall",
             "information_board", "kiosk", "litter_bin", "carousel"]  # fmt: skip
    ring = [Pose(8.2 * math.cos(a), 8.2 * math.sin(a), math.degrees(a)) for a in
            (math.radians(18 + 36 * k) for k in range(10))]  # fmt: skip
    deal(site, plaza, ring, "on the round plaza")
    under = ["vending_machine", "clothes_rack", "a_board", "photo_booth", "mailbox", "topiary", "bicycle_rack",
             "cardboard_boxes", "newspaper_box", "planter"]  # fmt: skip
    for side, name in ((1, "north"), (-1, "south")):
        spots = [Pose(x, side * 6.4, -90.0 * side) for x in (-48.8, -42.4, -22.4, -16.6, 22.2, 37.8, 46.4)]
        deal(site, under[::side], spots, f"under the {name} gallery")
    for side, passages, name in ((1, _NORTH_PASSAGES, "north"), (-1, _SOUTH_PASSAGES, "south")):
        for k, (a, _) in enumerate(passages):
            spots = [Pose(a + 1.0, side * 13.0, 0.0), Pose(a + 1.0, side * 21.0, 0.0)]
            things = (["bicycle_rack", "shopping_cart"], ["scooter", "cardboard_boxes"])[k]
            deal(site, things, spots, f"in a passage through the {name} row")


def _galleries_life(site: Site) -> None:
    things = ["planter", "bench", "cafe_table", "telescope", "a_board", "vending_machine", "clothes_rack",
              "rocking_chair",
              "litter_bin", "topiary", "photo_booth", "kiosk", "atm_kiosk"]  # fmt: skip
    for side, name in ((1, "north"), (-1, "south")):
        spots = [
            Pose(x, side * 6.2, -90.0 * side) for x in (-47.5, -34.5, -26.5, -17.0, 16.6, 24.5, 33.0, 41.5, 48.0)
        ]
        deal(site, things[::side], spots, f"on the {name} gallery", z=STOREY_M)
    deal(site, ["planter", "bench"], [Pose(_BRIDGES[0], 0.0, 0.0)], "on the west footbridge", z=STOREY_M)
    deal(site, ["telescope"], [Pose(_BRIDGES[1], 0.0, 0.0)], "on the east footbridge", z=STOREY_M)
    ring = [Pose(12.5 * math.cos(a), 12.5 * math.sin(a), math.degrees(a)) for a in
            (math.radians(45 + 90 * k) for k in range(4))]  # fmt: skip
    deal(
        site,
        ["bench", "planter", "advertising_column", "cafe_table"],
        ring,
        "on the ring above the plaza",
        z=STOREY_M,
    )


def _roofs(site: Site) -> None:
    """Furnish the flat roofs: gardens, tables, and what makes a building run."""
    north = ["solar_panels", "pergola", "cafe_table", "beehive", "air_conditioner", "bench", "greenhouse",
             "water_tank",
             "trampoline", "telescope", "satellite_dish", "picnic_table", "planter", "weather_station"]  # fmt: skip
    south = ["air_conditioner", "swing_set", "billboard", "hammock", "solar_panels", "barbecue", "water_tank",
             "stage",
             "bench", "satellite_dish", "bird_bath", "dumpster", "flagpole", "rocking_chair"]  # fmt: skip
    for side, name, things in ((1, "north", north), (-1, "south", south)):
        boards: Parts = []
        for k, (x, thing) in enumerate(zip(_ROOF_XS, things, strict=True)):
            y = side * (14.0 + 7.0 * (k % 2))
            put(site, thing, x, y, -90.0 * side, f"on the roof of the {name} row", z=_ROOF_M + 0.06)
            boards.append(
                ("boards:#a58a63", block(x - 2.8, y - 2.6, x + 2.8, y + 2.6, _ROOF_M - 0.02, _ROOF_M + 0.06))
            )
        site.add(None, "roof_terrace", boards, {"place": f"on the roof of the {name} row"})


def _yards(site: Site) -> None:
    yard = ["dumpster", "pallet_stack", "forklift", "box_truck", "cardboard_boxes", "oil_drums", "crate_stack",
            "delivery_van", "wheelie_bin", "gas_cylinder_cage", "generator", "skip_container"]  # fmt: skip
    spots = [Pose(x, 32.6 + 2.2 * (k % 2), 180.0) for k, x in
             enumerate((-55, -46, -38, -30, -20, -10, 0, 10, 19, 30, 42, 54))]  # fmt: skip
    deal(site, yard, spots, "in the yard behind the north row")
    wall = [("brick:#8d5a48", block(x0, 37.8, x1, 38.2, 0.0, 3.0)) for x0, x1 in ((-60, -28), (-20, 22), (30, 78))]
    site.add("yard_wall", "wall", wall, {"material": "brick"})
    front = ["bicycle_rack", "bench", "litter_bin", "parking_meter", "bus_shelter", "ev_charger", "fire_hydrant",
             "street_lamp", "phone_booth", "mailbox", "food_truck"]  # fmt: skip
    spots = [Pose(x, -29.0, -90.0) for x in (-54, -44, -38, -31, -14, -5, 4, 16, 24, 33, 44)]
    deal(site, front, spots, "before the back of the south row")


def _playground(site: Site) -> None:
    games = ["playground_slide", "swing_set", "seesaw", "sandbox", "spring_rider", "trampoline", "bench", "gazebo",
             "inflatable_castle", "picnic_table", "bird_bath", "basketball_hoop"]  # fmt: skip
    spots = [Pose(x, y, 40.0 * k) for k, (x, y) in enumerate(
        ((-30, 45), (-22, 43), (-12, 45), (-27, 55), (-16, 56), (-7, 53), (-36, 53), (6, 46), (14, 55), (24, 45),
         (30, 54), (38, 46)))]  # fmt: skip
    deal(site, games, spots, "in the playground")
    trees = [Pose(x, y, 50.0 * x) for x, y in
             ((-58, 57), (-40, 60), (-20, 61), (0, 60), (20, 61), (42, 58), (56, 52), (62, 42),
              (-40, 42))]  # fmt: skip
    deal(site, ["urban_tree", "oak_tree", "birch_tree"], trees, "round the playground")
    deal(site, ["palm_tree"], [Pose(-39.4, 0, 0), Pose(38.5, -0.2, 0)], "in the high street")


def _car_park(site: Site, occupancy: float) -> None:
    bays = [bay for x in (-30.0, 32.0) for y, yaw in ((-33.0, 90.0), (-53.4, -90.0))
            for bay in parking_row(site, x, y, yaw, 20)]  # fmt: skip
    park_cars(site, bays, occupancy, "in the car park")
    islands = [Pose(x, -43.0, 0.0) for x in (-56.0, -40.0, -24.0, -8.0, 8.0, 24.0, 40.0, 56.0)]
    for pose in islands:
        site.paint(rectangle(pose.x - 2.2, -44.2, pose.x + 2.2, -41.8), site.material("lawn", "grass"), 0.14)
    deal(site, ["street_lamp", "urban_tree", "cart_corral", "ev_charger", "street_lamp", "urban_tree",
                "parking_meter",
                "billboard"], islands, "on an island of the car park")  # fmt: skip
    put(site, "city_bus", -30.0, -61.6, 0.0, "in the street")
    put(site, "delivery_van", 20.0, -58.4, 180.0, "in the street")
