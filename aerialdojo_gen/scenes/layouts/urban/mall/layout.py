"""A shopping mall: a hall about a courtyard, car park in front, loading yard behind, parking deck beside it.

The hall is a U that opens to the south. Its courtyard is lined by an arcade under a gallery, crossed by a
footbridge, and joined with the loading yard by a passage through the hall. North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field
from shapely.geometry import Point as Disc
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_streets import arrow, crossing, parking_row, streets
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.parking import deck_cars, park_cars, parking_deck
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
from aerialdojo_gen.scenes.layouts.urban.mall.furniture import Furniture, furnish
from aerialdojo_gen.scenes.layouts.urban.mall.outlets import build_outlets
from aerialdojo_gen.scenes.layouts.urban.mall.shops import STOREY_M, anchor_store, shop_names, shop_row, shopping_hall
from aerialdojo_gen.scenes.site import Site

HALL = unary_union([rectangle(-58, 20, 34, 46), rectangle(-58, -12, -36, 20), rectangle(14, -12, 34, 20)])
PASSAGE = rectangle(-14, 20, -6, 46)
GALLERY = unary_union([rectangle(-36, 16.5, 14, 20), rectangle(-36, -1, -32.5, 16.5), rectangle(10.5, -1, 14, 16.5)])
BRIDGE = rectangle(-32.5, -1, 10.5, 2)


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"courtyard"`` (190 by 150 m) or ``"outlets"`` (160 by 128 m).
    occupancy : float
        Share of the parking bays in front of the mall that is taken.
    furniture : tuple of Furniture
        What stands where.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["courtyard", "outlets"] = "courtyard"
    occupancy: float = Field(default=0.4, ge=0.0, le=1.0)
    furniture: tuple[Furniture, ...] = ()


def build(site: Site) -> None:
    """Build the mall."""
    parameters: Parameters = site.parameters
    if parameters.plan == "outlets":
        build_outlets(site, parameters.occupancy)
        furnish(site, parameters.furniture)
        return
    _ground(site)
    _hall(site)
    _courtyard(site)
    _yard(site)
    deck_box = (50.0, 10.0, 82.0, 46.0)
    deck_wall = site.material("deck_wall", "concrete:#c9c2b4")
    parking_deck(site, box=deck_box, phrase="east of the mall", wall=deck_wall)
    _restaurant(site)
    _park(site)
    furnish(site, parameters.furniture)
    deck_cars(site, box=deck_box, occupancy=0.3)
    _car_park(site, parameters.occupancy)


def _ground(site: Site) -> None:
    site.set_ground(material=site.material("lawn", "grass"))
    plaza = site.material("plaza", "paving")
    site.paint(rectangle(-66, -18, 37, 62), "asphalt:#6a6b6c")
    site.paint(rectangle(-62, -18, 37, 47), plaza, 0.12)
    site.paint(rectangle(-36, -12, 14, 20), site.material("court", "tiles:#d8cdb8"), 0.12)
    site.paint(PASSAGE, site.material("passage", "tiles:#c9a98a"), 0.12)
    site.paint(Disc(-11, 9.2).buffer(6.6), "cobbles:#a3988a", 0.12)
    site.paint(rectangle(-62, 46.5, 37, 62), "concrete:#8f8d88")
    streets(site, [[(-95, -66), (95, -66)], [(42, -66), (42, 62)], [(-64, 66), (95, 66)], [(-64, -60), (-64, 66)]])
    site.paint(rectangle(-60, -58, 38, -19), "asphalt")
    site.paint(rectangle(37, -47, 40, -41), "asphalt")
    site.paint(rectangle(37, -34.5, 40, -28.5), "asphalt")
    site.paint(rectangle(44, 27, 52, 37), "asphalt")
    site.paint(rectangle(44, -16, 54, -9), "asphalt")
    site.paint(rectangle(36, 50, 40, 60), "concrete:#8f8d88")
    for x, y, yaw in ((42.0, -12.0, 0.0), (42.0, 24.0, 0.0), (-30.0, -66.0, 90.0), (42.0, -56.0, 0.0)):
        crossing(site, x, y, yaw, 6.5)
    for y in (-35.0, 8.0):
        arrow(site, 40.3, y, -90.0)
        arrow(site, 43.7, y, 90.0)
    arrow(site, -20.0, -67.6, 0.0)
    arrow(site, 20.0, -64.4, 180.0)


def _hall(site: Site) -> None:
    shopping_hall(site, HALL, PASSAGE, node="mall_building", category="mall_building")
    anchor_store(site, -59, -12.8, -35, -2.0, 12.5, sign="MARKET", wall="tiles:#3f8f8b", node="market_store")
    anchor_store(site, 13, -12.8, 35, -2.0, 13.5, sign="CINEMA", wall="tiles:#9a3f48", node="cinema")
    names = shop_names()
    north = [(-32.0, 20.0), (-26.0, 20.0), (-19.5, 20.0), (-1.5, 20.0), (4.5, 20.0)]
    shop_row(site, north, -90.0, "under the arcade on the north side of the courtyard", names)
    shop_row(site, [(-36.0, y) for y in (2.5, 9.0)], 0.0, "under the arcade on the west side of the courtyard", names)
    shop_row(
        site, [(14.0, y) for y in (2.5, 9.0)], 180.0, "under the arcade on the east side of the courtyard", names
    )
    upper = "on the gallery above the courtyard"
    shop_row(site, [(-30.0, 20.0), (-22.0, 20.0), (-2.0, 20.0), (6.0, 20.0)], -90.0, upper, names, z=STOREY_M)
    shop_row(site, [(-36.0, 6.0)], 0.0, upper, names, z=STOREY_M)
    shop_row(site, [(14.0, 6.0)], 180.0, upper, names, z=STOREY_M)
    shop_row(site, [(-58.0, y) for y in (4.0, 11.0, 18.0, 32.0, 39.0)], 180.0, "on the west front of the mall", names)
    shop_row(site, [(34.0, y) for y in (4.0, 11.0, 18.0, 35.0)], 0.0, "on the east front of the mall", names)
    shop_row(site, [(-14.0, 28.0), (-14.0, 38.0)], 0.0, "in the passage through the mall", names)
    shop_row(site, [(-6.0, 28.0), (-6.0, 38.0)], 180.0, "in the passage through the mall", names)


def _courtyard(site: Site) -> None:
    floor = site.material("gallery_floor", "boards:#a5855c")
    posts = [
        *((x, 16.9) for x in (-30.0, -23.5, -17.0, -4.0, 2.0, 8.0)),
        *spaced((-32.9, 0.5), (-32.9, 12), 5.5),
        *spaced((10.9, 0.5), (10.9, 12), 5.5),
    ]
    parts = deck(GALLERY, STOREY_M, floor=floor, under="#f0ebdf", posts=posts, post="#f0ebdf")
    for path in (
        [(-32.55, 2.0), (-32.55, 16.55), (-31.2, 16.55)],
        [(-28.8, 16.55), (10.55, 16.55), (10.55, 2.0)],
        [(-36, -0.95), (-32.5, -0.95)],
        [(10.5, -0.95), (14, -0.95)],
    ):
        parts += railing(path, STOREY_M)
    parts += stairs((-30.0, 7.6), 90.0, 2.2, STOREY_M - 0.12, 8.9, z_m=0.12, tread="boards:#a5855c")
    site.add("gallery", "gallery", parts, {"place": "around the courtyard"})

    bridge = deck(
        BRIDGE, STOREY_M, floor=floor, under="#3a6f78", posts=[(-22, 0.5), (-11, 0.5), (0, 0.5)], post="#3a6f78"
    )
    bridge += railing([(-32.5, 1.95), (10.5, 1.95)], STOREY_M)
    bridge += railing([(-32.5, -0.95), (10.5, -0.95)], STOREY_M)
    bridge += canopy(-16.0, -1.2, -6.0, 2.2, STOREY_M + 2.9, roof="sheet_metal:#3a6f78", foot_m=STOREY_M,
                     posts=[(-15.6, -0.8), (-6.4, -0.8), (-15.6, 1.8), (-6.4, 1.8)])  # fmt: skip
    site.add("courtyard_bridge", "footbridge_mall", bridge, {"place": "across the courtyard"})

    portal: Parts = []
    for x in (-15.4, -5.6):
        portal.append(("tiles:#d9772b", block(x - 0.7, 18.6, x + 0.7, 20.3, 0.12, 14.0)))
    portal.append(("tiles:#d9772b", block(-16.1, 18.6, -3.9 - 1.0, 20.3, 11.2, 14.0)))
    portal.append(("marking", letters("GALLERIA", 1.3, (-10.5, 18.6, 11.9), -90.0, 0.2)))
    portal.append(("curtain_wall", block(-14.7, 19.7, -6.3, 19.95, 5.3, 11.2)))
    site.add("mall_portal", "portal", portal, {"colour": "orange"}, footprint=rectangle(-16.1, 18.6, -14.7, 20.3))

    for x0, x1, node in ((-60.7, -58.6, "west_canopy"), (34.6, 38.2, "east_canopy")):
        posts = spaced((x0 + 0.3 if x0 < 0 else x1 - 0.3, 0), (x0 + 0.3 if x0 < 0 else x1 - 0.3, 42), 7)
        site.add(
            node, "canopy", canopy(x0, -1.5, x1, 44, 4.9, roof="#f0ebdf", posts=posts), {"place": "along the mall"}
        )
    walk = canopy(38.4, 22.0, 49.0, 26.0, 4.4, roof="sheet_metal:#3a6f78", posts=[(48.4, 22.4), (48.4, 25.6)])
    site.add("deck_walkway", "canopy", walk, {"place": "between the mall and the parking deck"})


def _yard(site: Site) -> None:
    dock: Parts = [
        ("concrete", block(-54, 46, -22, 49.2, 0.0, 1.15)),
        ("hazard", block(-54, 49.2, -22, 49.28, 0.85, 1.1)),
        ("corrugated:#8fa0a8", block(-55, 46, -21, 51.6, 5.7, 6.0)),
        ("iron", block(-55.1, 45.95, -20.9, 51.7, 5.55, 5.7)),
    ]
    dock += stairs((-20.2, 47.6), 180.0, 1.6, 1.15, 1.7)
    site.add(
        "loading_dock", "loading_dock", dock, {"place": "behind the mall"}, footprint=rectangle(-54, 46, -22, 49.3)
    )
    wall: Parts = [
        ("brick:#9a5f4a", block(-60, 61.6, 6, 62.0, 0.0, 3.2)),
        ("brick:#9a5f4a", block(16, 61.6, 36, 62.0, 0.0, 3.2)),
        ("brick:#9a5f4a", block(-60.4, 50.0, -60.0, 62.0, 0.0, 3.2)),
        ("concrete", block(-60.5, 61.5, 6.1, 62.1, 3.2, 3.35)),
        ("concrete", block(15.9, 61.5, 36.1, 62.1, 3.2, 3.35)),
        ("brick:#8a5543", block(5.4, 61.3, 6.2, 62.3, 0.0, 4.0)),
        ("brick:#8a5543", block(15.8, 61.3, 16.6, 62.3, 0.0, 4.0)),
    ]
    site.add("yard_wall", "wall", wall, {"material": "brick"})
    store: Parts = [
        ("blocks", block(20, 61.0, 33, 61.4, 0.0, 2.6)),
        ("blocks", block(20, 55.5, 20.3, 61.0, 0.0, 2.6)),
        ("blocks", block(32.7, 55.5, 33, 61.0, 0.0, 2.6)),
    ]
    store += canopy(19.6, 55.0, 33.4, 61.5, 3.4, roof="corrugated:#6f7f74",
                    posts=[(20.2, 55.4), (26.5, 55.4), (32.8, 55.4), (20.2, 61.2), (32.8, 61.2)])  # fmt: skip
    site.add("bin_store", "shelter", store, {"place": "in the loading yard"})
    for x, variant in ((-50, "one_shut"), (-42, "two_half"), (-34, "three_shut"), (-26, "four_half")):
        site.place("dock_door", x, 46.0, 90.0, z=1.15, variant=variant, attributes={"place": "on the loading dock"})


def _restaurant(site: Site) -> None:
    site.paint(rectangle(50, -52, 91, -4), "asphalt:#626365")
    site.paint(rectangle(54, -32, 84, -12), site.material("plaza", "paving"), 0.12)
    plan = rectangle(60, -26, 80, -14)
    wall = "brick:#b98a6a"
    parts: Parts = [
        (wall, block(60, -26, 80, -14, 0.12, 4.4)),
        ("#7d2f2a", block(59.7, -26.3, 80.3, -13.7, 4.4, 5.2)),
        ("gravel:#b5afa4", block(60.2, -25.8, 79.8, -14.2, 5.2, 5.22)),
        ("#7d2f2a", block(66, -26.9, 74, -25.9, 0.12, 6.6)),
        ("marking", letters("GRILL", 1.5, (70, -26.9, 4.7), -90.0, 0.15)),
        ("window", block(68.6, -27.0, 71.4, -26.85, 0.12, 2.7)),
        ("marking", letters("GRILL", 1.0, (60.0 - 0.3, -20, 4.3), 180.0, 0.12)),
    ]
    for x in (61.2, 75.0):
        parts.append(("glass", block(x, -26.08, x + 3.8, -25.9, 0.9, 3.3)))
        parts.append(("#f0ebdf", block(x - 0.1, -26.14, x + 3.9, -25.9, 0.75, 0.9)))
    for y in (-24.5, -19.0):
        parts.append(("glass", block(59.92, y, 60.1, y + 4.0, 0.9, 3.3)))
    parts += canopy(80.3, -22, 85.5, -17, 3.5, roof="#7d2f2a", posts=[(85.2, -21.7), (85.2, -17.3)])
    parts.append(("glass", block(79.95, -20.6, 80.1, -18.4, 1.0, 2.4)))
    parts += canopy(
        54.5, -27.5, 59.7, -14, 3.4, roof="stripes:#b8322c", posts=[(54.8, -27.2), (54.8, -20.7), (54.8, -14.3)]
    )
    site.add("restaurant", "restaurant", parts, {"colour": "brick", "sign": "grill"}, footprint=plan)


def _park(site: Site) -> None:
    path = "gravel:#c2b393"
    site.paint(rectangle(-80.2, -58, -77.8, 58), path)
    site.paint(rectangle(-93, -9, -68, -6.6), path)
    site.paint(Disc(-79, 26).buffer(6.0), path)
    site.paint(Disc(-79, -40).buffer(8.5), "paving:#bfae96")
    site.paint(rectangle(-92, -4, -80.6, 12), "#b5654a")
    site.paint(Disc(-79, 48).buffer(4.6), path)


def _car_park(site: Site, occupancy: float) -> None:
    rows = [(-20.0, 90.0, 33), (-37.0, -90.0, 33), (-38.6, 90.0, 33), (-56.0, -90.0, 33)]
    site.paint(rectangle(-56, -38.6, 31, -37.0), site.material("lawn", "grass"), 0.12)
    bays = [bay for y, yaw, count in rows for bay in parking_row(site, -12.5, y, yaw, count)]
    park_cars(site, bays, occupancy, "in the car park")
