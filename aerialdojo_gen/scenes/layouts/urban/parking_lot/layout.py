"""A parking lot: a city's, with solar roofs, a parking deck and offices, or a small park-and-ride by a bus stop.

North is +y; the street runs along the south edge.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_props import deal, put
from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.grammar_streets import arrow, crossing, parking_row, streets
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit.parking import deck_cars, park_cars, parking_deck
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy, columns, letters
from aerialdojo_gen.scenes.layouts.urban.parking_lot import park_and_ride
from aerialdojo_gen.scenes.site import Site

_LOT = (-54.0, 20.0)
_ISLAND = (-19.4, -14.6)
_DOUBLE_ROWS = (-24.1, -7.2, 9.7, 26.6)
_SOUTH_ROW = -41.0
_SOLAR_ROW = 9.7
_GROUPS = ((-34.7, 11), (-1.0, 10))


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"city"`` (140 by 112 m) or ``"park_and_ride"`` (72 by 58 m).
    occupancy : float
        Share of the parking bays that is taken.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["city", "park_and_ride"] = "city"
    occupancy: float = Field(default=0.6, ge=0.0, le=1.0)


def build(site: Site) -> None:
    """Build the parking lot."""
    parameters: Parameters = site.parameters
    if parameters.plan == "park_and_ride":
        park_and_ride.build_lot(site, parameters.occupancy)
    else:
        _city(site, parameters.occupancy)


def _city(site: Site, occupancy: float) -> None:
    _ground(site)
    bays, shaded = _bays(site)
    deck_box = (31.0, 2.0, 59.0, 36.0)
    top = parking_deck(site, box=deck_box, phrase="beside the car park", wall=site.material("deck_wall", "concrete"),
                       band=site.material("deck_band", "concrete"),
                       tower=site.material("deck_tower", "concrete"))  # fmt: skip
    _islands(site)
    _solar_roofs(site)
    _offices(site)
    _shop(site)
    _charging_court(site)
    _entrance(site)
    _landmarks(site)
    _furnish(site)
    park_cars(site, shaded, 0.5, "under the solar roof")
    park_cars(site, bays, occupancy, "in the car park")
    stalls = ["market_stall", "ice_cream_cart", "cafe_table", "food_truck", "stage", "cotton_candy_stand", "planter",
              "carousel", "kiosk", "balloon_stand", "vending_machine", "bench", "motorcycle",
              "ev_charger"]  # fmt: skip
    spots = [
        Pose(34.5 + 5.2 * k, y, 90.0 * (1 - 2 * row)) for row, y in enumerate((6.0, 13.4, 24.6)) for k in range(5)
    ]
    deal(site, stalls, spots, "in the market on the roof of the parking deck", z=top)
    deck_cars(site, box=deck_box, occupancy=0.34)


def _ground(site: Site) -> None:
    site.set_ground(material=site.material("lawn", "grass"))
    paving = site.material("paving", "paving")
    site.paint(rectangle(-54, 36.5, 26, 56), paving, 0.12)
    site.paint(rectangle(20, -47, 70, 56), "asphalt:#6a6b6c")
    site.paint(rectangle(23, -24, 68, -4), paving, 0.12)
    streets(site, [((-70, -51.2), (70, -51.2))])
    site.paint(rectangle(_LOT[0], -46.2, _LOT[1], 36.5), site.material("lot", "asphalt"))
    site.paint(rectangle(_LOT[0], -46.2, 9.0, -41.0), site.material("lawn", "grass"), 0.12)
    site.paint(rectangle(9.0, -48.2, 20.0, -41), site.material("lot", "asphalt"))
    path = "gravel:#c2b393"
    site.paint(rectangle(-63.2, -46, -60.8, 54), path)
    for y in (-28, 2, 32):
        site.paint(disc(-62, y, 5.5), path)
        site.paint(rectangle(-62, y - 1, -54, y + 1), path)
    crossing(site, 24, -51.2, 90, 6.5)
    crossing(site, -45, -51.2, 90, 6.5)
    for aisle in (-32.5, -15.6, 1.3, 18.2, 34.2):
        for x, yaw in ((-38, 0), (-28, 0), (-8, 180), (6, 180)):
            arrow(site, x, aisle + (1.4 if yaw == 0 else -1.4), yaw)


def _bays(site: Site) -> tuple[list[Pose], list[Pose]]:
    bays: list[Pose] = []
    shaded: list[Pose] = []
    for x, count in _GROUPS:
        bays += parking_row(site, x, _SOUTH_ROW, -90.0, count)
        for y in _DOUBLE_ROWS:
            for yaw in (90.0, -90.0):
                (shaded if y == _SOLAR_ROW else bays).extend(parking_row(site, x, y, yaw, count))
    return bays, shaded


def _islands(site: Site) -> None:
    """Raise planted islands at the rows' ends and a walk between their halves."""
    lawn = site.material("lawn", "grass")
    for y in _DOUBLE_ROWS:
        site.paint(rectangle(-53.0, y - 4.6, -49.6, y + 4.6), lawn, 0.14)
        site.paint(rectangle(12.4, y - 4.6, 15.2, y + 4.6), lawn, 0.14)
        site.paint(rectangle(_ISLAND[0], y - 4.8, _ISLAND[1], y + 4.8), site.material("paving", "paving"), 0.14)
    for k, y in enumerate(_DOUBLE_ROWS[:-1]):
        crossing(site, -17, (y + _DOUBLE_ROWS[k + 1]) / 2, 90, 6.4)
    trees = [
        Pose(x, y + dy, 60.0 * k) for k, y in enumerate(_DOUBLE_ROWS) for x in (-51.3, 13.8) for dy in (-2.6, 2.6)
    ]
    deal(site, ["urban_tree"], trees, "on a traffic island")
    walk = ["planter", "litter_bin", "bench", "shopping_cart", "recycling_bin", "planter", "parking_meter",
            "vending_machine", "fire_hydrant", "fire_hydrant", "photo_booth", "mailbox", "phone_booth"]  # fmt: skip
    spots = [
        Pose(x, y + dy, 0.0 if x < -17 else 180.0) for y in _DOUBLE_ROWS for x, dy in ((-18.3, 3.0), (-15.6, -3.0))
    ]
    deal(site, walk, spots, "on the walk across the car park")
    for k, y in enumerate(_DOUBLE_ROWS):
        if y != _SOLAR_ROW:
            put(site, "street_lamp", -36.0, y, 90.0 if k % 2 else -90.0, "between two rows of the car park")
            put(site, "street_lamp", 1.6, y, -90.0 if k % 2 else 90.0, "between two rows of the car park")
    for x, y in ((-47.2, -5.0), (11.2, -22.0), (-21.4, 24.4)):
        put(site, "cart_corral", x - 0.3, y, 0.0, "in a bay of the car park")


def _solar_roofs(site: Site) -> None:
    steel = site.material("steel", "#e8e6df")
    for k, (x0, x1) in enumerate(((-49.0, -20.2), (-14.0, 12.0))):
        y0, y1, z = _SOLAR_ROW - 5.2, _SOLAR_ROW + 5.2, 3.6
        parts: Parts = canopy(x0, y0, x1, y1, z, roof="sheet_metal:#c9ced0", post=steel)
        step = (x1 - x0) / 5
        parts.append((steel, columns([(x0 + step * (i + 0.5), _SOLAR_ROW) for i in range(5)], 0.0, z + 0.1, 0.22)))
        for i in range(5):
            u = x0 + step * (i + 0.5)
            parts.append((steel, block(u - 0.15, y0 + 0.2, u + 0.15, y1 - 0.2, z - 0.25, z)))
        site.add(None, "solar_roof", parts, {"place": "over the middle rows of the car park"})
        for i in range(2):
            put(site, "solar_panels", x0 + 6 + i * 12, _SOLAR_ROW - 1.5 + 3 * ((i + k) % 2),
                -90.0, "on the solar roof",
                z=z + 0.22)  # fmt: skip


def _offices(site: Site) -> None:
    blocks = (
        (-52.0, -30.0, 3, "facade_office:#c9c3b6", "north-west office"),
        (-26.0, -6.0, 4, "facade_brick", "brick office"),
        (-1.0, 20.0, 3, "curtain_wall", "glass office"),
    )
    roofs = (
        ["satellite_dish", "air_conditioner"],
        ["water_tank", "weather_station"],
        ["satellite_dish", "air_conditioner"],
    )
    for (x0, x1, storeys, wall, what), equipment in zip(blocks, roofs, strict=True):
        plan = rectangle(x0, 43.0, x1, 55.0)
        top = storeys * 3.5
        door: Parts = [
            ("concrete", block((x0 + x1) / 2 - 2.6, 40.4, (x0 + x1) / 2 + 2.6, 43.0, 3.0, 3.25)),
            ("iron", columns([((x0 + x1) / 2 + s * 2.3, 40.7) for s in (-1, 1)], 0.12, 3.0, 0.09)),
            ("window", block((x0 + x1) / 2 - 1.4, 42.9, (x0 + x1) / 2 + 1.4, 43.05, 0.12, 2.7)),
        ]
        building(site, plan, wall=wall, roof="gravel", storeys=storeys, storey_m=3.5, z=0.0, category="office_block",
                 attributes={"place": f"{what}"}, extra=door)  # fmt: skip
        middle = (x0 + x1) / 2
        for category, dx in zip(equipment, (-5.0, 4.5), strict=True):
            put(site, category, middle + dx, 49.0, -90.0, "on the roof of an office", z=top)
    for x, variant in ((-47.5, "coffee"), (-34.5, "pharmacy"), (3.5, "bakery"), (15.0, "books")):
        site.place("storefront", x, 43.0, -90.0, z=0.12, variant=variant, attributes={"place": "in an office front"})
    banners = ((-23.5, "red_disc"), (-8.5, "blue_triangle"))
    for x, variant in banners:
        site.place("wall_banner", x, 43.0, -90.0, z=4.6, variant=variant, attributes={"place": "on the brick office"})
    put(site, "wall_clock", -16.0, 43.0, -90.0, "on the brick office", z=9.2)
    front = ["bicycle_rack", "bench", "planter", "a_board", "newspaper_box", "cafe_table", "topiary", "planter",
             "bicycle", "topiary", "atm_kiosk", "scooter", "information_board", "litter_bin"]  # fmt: skip
    xs = [-51.5, -43.5, -39.0, -31.0, -28.0, -24.5, -20.5, -11.5, -7.0, -3.5, 7.5, 11.3, 19.0, 22.5]
    deal(site, front, [Pose(x, 39.6 + 0.9 * (k % 2), -90.0) for k, x in enumerate(xs)], "in front of the offices")
    put(site, "dumpster", -28.0, 46.5, -90.0, "between two offices")
    put(site, "motorcycle", -28.2, 50.5, 80.0, "between two offices")
    put(site, "dumpster", -3.4, 47.5, -90.0, "between two offices")
    put(site, "pallet_stack", -3.3, 51.5, 0.0, "between two offices")


def _shop(site: Site) -> None:
    plan = rectangle(26.0, -20.0, 46.0, -8.0)
    wall, band = site.material("shop_wall", "tiles:#d8d2c4"), site.material("shop_band", "#2f7f5b")
    parts: Parts = [
        (wall, block(26, -20, 46, -8, 0.12, 4.6)),
        (band, block(25.8, -20.2, 46.2, -7.8, 3.9, 4.7)),
        ("gravel", block(26.2, -19.8, 45.8, -8.2, 4.7, 4.72)),
        ("marking", letters("MARKET", 1.0, (36.0, -20.2, 4.75), -90.0, 0.2)),
    ]
    for x in (27.0, 31.6, 38.6, 42.0):
        parts.append(("glass", block(x, -20.08, x + 3.0, -19.9, 0.7, 3.4)))
    parts.append(("window", block(35.2, -20.1, 37.8, -19.9, 0.12, 2.9)))
    parts += canopy(25.0, -24.0, 47.0, -20.1, 3.3, roof=band, posts=[(25.5, -23.6), (32.5, -23.6), (39.5, -23.6),
                                                                    (46.5, -23.6)])  # fmt: skip
    site.add("market", "market", parts, {"colour": "green"}, footprint=plan)
    front = ["vending_machine", "shopping_cart", "cardboard_boxes", "cardboard_boxes", "newspaper_box", "bench"]
    deal(site, front, [Pose(26.6 + 3.6 * k, -21.0, -90.0) for k in range(6) if k != 3], "under the market's canopy")
    for category, x in (("air_conditioner", 30.0), ("weather_station", 36.0), ("solar_panels", 42.0)):
        put(site, category, x, -14.0, -90.0, "on the roof of the market", z=4.72)
    back = ["dumpster", "pallet_stack", "forklift", "cardboard_boxes", "oil_drums"]
    deal(site, back, [Pose(27.0 + 4.4 * k, -6.3, 90.0) for k in range(5)], "behind the market")


def _charging_court(site: Site) -> None:
    parts = canopy(27, -42, 51, -32, 4.6, roof="sheet_metal:#e8e6df", post="#2f7f5b",
                   posts=[(x, y) for x in (30, 39, 48) for y in (-40.5, -33.5)])  # fmt: skip
    parts.append(("marking", letters("CHARGE", 0.32, (39, -42.1, 4.63), -90.0, 0.05)))
    site.add("charging_roof", "canopy", parts, {"place": "over the charging court"})
    for k, x in enumerate((31.5, 36.5, 41.5, 46.5)):
        put(site, "ev_charger", x, -37.0, 90.0 if k % 2 else -90.0, "under the charging roof")
    cars = [Pose(x, y, yaw) for x in (33.9, 44.1) for y, yaw in ((-34.8, -90.0), (-39.4, 90.0))]
    deal(site, ["hatchback", "suv", "sedan", "delivery_van"], cars, "under the charging roof")
    for x, y, category, yaw in ((57.5, -36.0, "food_truck", 100.0), (65.0, -40.0, "box_truck", 90.0),
                                (56.0, -43.5, "billboard", 150.0), (65.5, -28.5, "site_light_tower",
                                200.0)):  # fmt: skip
        put(site, category, x, y, yaw, "beside the charging court")
    deal(site, ["barrier", "traffic_cone", "generator", "barrier"],
         [Pose(61.5, -44 + 4.2 * k, 0.0) for k in range(4)], "beside the charging court")  # fmt: skip


def _entrance(site: Site) -> None:
    site.paint(rectangle(13.6, -46, 15.4, -40.5), "concrete", 0.14)
    put(site, "guard_booth", 22.4, -44.6, 180.0, "at the entrance")
    for x, y, yaw in ((11.2, -45.2, 90.0), (17.8, -45.2, -90.0)):
        put(site, "boom_gate", x, y, yaw, "at the entrance")
    put(site, "parking_meter", 14.5, -41.6, 0.0, "at the entrance")
    put(site, "stop_sign", 9.0, -47.5, -90.0, "at the entrance")
    roof = canopy(8.8, -46.8, 20.2, -43.2, 4.4, roof="#2d5f8a", posts=[(9.1, -45), (14.5, -44.2), (19.9, -45)])
    roof += [("#2d5f8a", block(12.9, -47.0, 16.1, -46.7, 4.7, 6.9)),
             ("marking", letters("P", 1.8, (14.5, -47.0, 4.9), -90.0))]  # fmt: skip
    site.add("entrance_roof", "canopy", roof, {"place": "over the entrance"})
    stop = ["bus_shelter", "litter_bin", "bench", "mailbox", "advertising_column", "traffic_light", "fire_hydrant",
            "direction_sign", "kiosk", "flagpole"]  # fmt: skip
    xs = [-38.0, -34.0, -30.5, -26.0, -20.5, -47.5, -15.0, -10.0, -3.5, 3.5]
    deal(site, stop, [Pose(x, -44.4, -90.0) for x in xs], "along the street")
    put(site, "city_bus", -34.0, -52.8, 0.0, "at the bus stop")
    put(site, "delivery_van", 2.0, -49.6, 180.0, "in the street")
    put(site, "box_truck", 44.0, -49.6, 180.0, "in the street")
    put(site, "crossing_sign", 26.4, -47.0, -90.0, "at the crossing")


def _landmarks(site: Site) -> None:
    for category, x, y, yaw in (
        ("clock_tower", 25.5, 44.0, -90.0), ("water_tower", -62.0, 32.0, 0.0), ("statue", -62.0, 2.0, 0.0),
        ("obelisk", -62.0, -28.0, 0.0), ("pylon_sign", 25.5, -28.5, -90.0), ("fountain", 58.0, -14.0, 0.0),
        ("floodlight_mast", -17.0, -7.2, -90.0),
    ):  # fmt: skip
        put(site, category, x, y, yaw)


def _furnish(site: Site) -> None:
    trees = [Pose(x, y, 35.0 * y) for y in range(-42, 52, 11) for x in (-67.0, -56.5)]
    deal(site, ["urban_tree", "oak_tree", "urban_tree", "birch_tree"], trees, "in the strip of park")
    park = ["bench", "litter_bin", "swing_set", "picnic_table", "planter", "playground_slide", "bicycle",
            "spring_rider", "trampoline", "gazebo", "market_stall", "ice_cream_cart"]  # fmt: skip
    poses = [Pose(-65.5 if k % 2 else -58.8, -42.0 + 7.7 * k, 0.0 if k % 2 else 180.0) for k in range(12)]
    deal(site, park, poses, "in the strip of park")
    around = ["bench", "planter", "cafe_table", "topiary", "topiary", "balloon_stand"]
    deal(site, around, [Pose(58 + dx, -14 + dy, yaw) for dx, dy, yaw in (
        (-7.5, 0, 0), (7.8, 3.5, 180), (-7.0, 6.2, 0), (4.5, 6.9, -90), (7.6, -5.5, 150), (-3.5, -7.4, 90))],
        "around the fountain")  # fmt: skip
    edge = ["shopping_cart", "traffic_cone", "golf_cart", "motorcycle", "hedge_block", "bicycle_rack"]
    deal(site, edge, [Pose(22.4, y, 90.0) for y in (-2.0, 5.0, 19.0, 25.5, 31.0)], "beside the parking deck")
    deal(site, ["scooter", "shopping_cart", "bicycle", "pallet_stack"],
         [Pose(34.0 + 6 * k, 19.0, 20.0 * k) for k in range(4)], "inside the parking deck", z=3.7)  # fmt: skip
    hedges = [Pose(x, -46.0, 90.0) for x in range(-52, 4, 8)]
    deal(site, ["hedge_block"], hedges, "along the street")
