"""A ferry berth: the ship with her bow open at the ramp, the lanes where vehicles wait, and the ticket hall."""

from __future__ import annotations

from shapely.geometry import Polygon

from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns, letters
from aerialdojo_gen.scenes.layouts.infrastructure.harbor.quays import (
    QUAY_M,
    dashes,
    hall,
    lay,
    line,
    open_shed,
    set_out,
)
from aerialdojo_gen.scenes.mesh import merge, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes_extruded import profile
from aerialdojo_gen.scenes.site import Site

_X, _BOW, _STERN, _HALF = 50.0, -6.0, -40.0, 6.2
_DECK_M = 1.5
_LANES = (41.0, 45.6, 50.2, 54.8, 59.4)


def build_ferry_berth(site: Site) -> None:
    """Build it between the container quay and the fishing basin."""
    lay(site, rectangle(36.0, 1.0, 66.0, 44.0), site.material("lanes", "asphalt:#55575a"))
    for x in (38.7, 43.3, 47.9, 52.5, 57.1, 61.7):
        line(site, [(x, 10.0), (x, 40.0)])
    line(site, [(38.7, 9.4), (61.7, 9.4)], 0.4)
    dashes(site, [(50.0, 1.0), (50.0, 8.0)])
    for k in range(6):
        lay(site, rectangle(44.4 + k * 2.0, 0.7, 45.4 + k * 2.0, 1.4), "hazard")
    _ramp(site)
    _ferry(site)
    _waiting(site)


def _ramp(site: Site) -> None:
    slope = profile(points=[(0.0, QUAY_M - 0.35), (7.2, _DECK_M - 0.25), (7.2, _DECK_M), (0.0, QUAY_M)], width=7.0)
    turned = translated(rotated(slope, rotation(0.0, 0.0, -90.0)), (_X, 0.0, 0.0))
    posts = columns([(_X + s * 4.4, -3.0) for s in (-1, 1)], -0.3, 9.0, 0.3, 8)
    beam = block(_X - 4.8, -3.35, _X + 4.8, -2.65, 9.0, 9.7)
    site.add("ferry_ramp", "ferry_ramp", [("steel:#7c8388", turned), ("marking_yellow", merge([posts, beam]))])


def _ferry(site: Site) -> None:
    white, blue = site.material("ferry", "#eef0ee"), site.material("ferry_hull", "#27496d")
    x0, x1 = _X - _HALF, _X + _HALF
    outline = Polygon([(x0, _BOW), (x1, _BOW), (x1, _STERN + 5), (_X + 3.6, _STERN), (_X - 3.6, _STERN),
                       (x0, _STERN + 5)])  # fmt: skip
    sides = outline.difference(rectangle(x0 + 0.4, _STERN + 4, x1 - 0.4, _BOW + 1))
    deck = outline.buffer(-0.05, join_style="mitre")
    parts: Parts = [
        (blue, slab(outline, -0.3, _DECK_M - 0.1)),
        ("#8f2f28", slab(outline.buffer(0.04, join_style="mitre"), -0.3, 0.35)),
        ("steel:#5f6a6c", slab(deck, _DECK_M - 0.1, _DECK_M)),
    ]
    parts += [(white, slab(p, _DECK_M - 0.1, 6.2)) for p in getattr(sides, "geoms", [sides])]
    house = rectangle(x0, _STERN + 4, x1, _BOW - 8)
    parts += [
        (white, slab(house, 6.2, 6.5)),
        (white, block(x0 + 1.0, _STERN + 8, x1 - 1.0, _BOW - 12, 6.5, 9.0)),
        ("glass", merge([block(x0 + 0.95, _STERN + 9, x0 + 1.0, _BOW - 13, 7.2, 8.3),
                         block(x1 - 1.0, _STERN + 9, x1 - 0.95, _BOW - 13, 7.2, 8.3)])),
        (white, block(x0 - 0.4, _BOW - 18, x1 + 0.4, _BOW - 13, 9.0, 11.4)),
        ("window", block(x0 - 0.2, _BOW - 13.0, x1 + 0.2, _BOW - 12.94, 9.9, 10.9)),
        (blue, block(_X - 1.4, _STERN + 10, _X + 1.4, _STERN + 13.5, 9.0, 13.4)),
        ("#e0a92a", block(_X - 1.45, _STERN + 9.95, _X + 1.45, _STERN + 13.55, 11.4, 12.4)),
        ("steel", columns([(_X, _BOW - 15.5)], 11.4, 15.0, 0.12, 6)),
        (blue, letters("NORTH STAR", 1.3, (x0 - 0.02, (_BOW + _STERN) / 2, 3.4), 180.0, 0.05)),
        (blue, letters("NORTH STAR", 1.3, (x1 + 0.02, (_BOW + _STERN) / 2, 3.4), 0.0, 0.05)),
    ]  # fmt: skip
    for side in (x0 + 0.5, x1 - 0.5):
        boat = block(side - 0.5, _STERN + 16, side + 0.5, _STERN + 20, 6.9, 7.7)
        parts.append(("#d9602b", boat))
    rail = [block(x0 + 0.05, y, x0 + 0.12, y + 0.07, 6.5, 7.5) for y in range(-35, -14, 3)]
    rail += [block(x1 - 0.12, y, x1 - 0.05, y + 0.07, 6.5, 7.5) for y in range(-35, -14, 3)]
    parts.append(("#33373b", merge(rail)))
    site.add("ferry", "ferry", parts, {"colour": "white"}, footprint=outline)
    deck_place = "on the open car deck of the ferry"
    for category, x, y in (("suv", 47.6, -11.6), ("delivery_van", 52.6, -21.0), ("motorcycle", 53.0, -10.8)):
        put(site, category, x, y, -90.0, deck_place, z=_DECK_M)
    upper = [("deck_chair", 46.6, -15.8, 90.0), ("bench", 50.4, -16.4, 90.0), ("lifebuoy_stand", 54.2, -15.6, 90.0),
             ("deck_chair", 48.0, -34.2, -90.0), ("flagpole", 52.4, -34.0, -90.0)]  # fmt: skip
    set_out(site, upper, "on the upper deck of the ferry", 6.5)


def _waiting(site: Site) -> None:
    queue = "in the queue for the ferry"
    cars = [
        ("sedan", 0, 13.0), ("caravan", 0, 21.0), ("hatchback", 1, 13.2), ("pickup_truck", 1, 20.4),
        ("city_bus", 2, 16.0), ("sedan", 2, 27.4), ("box_truck", 3, 14.4), ("suv", 3, 23.0), ("motorcycle", 4, 12.6),
        ("scooter", 4, 16.2), ("bicycle", 4, 19.6), ("hatchback", 4, 25.0), ("delivery_van", 1, 29.0),
        ("golf_cart", 0, 29.6), ("pickup_truck", 3, 31.0),
        ("scooter", 4, 31.4), ("hatchback", 2, 34.6), ("motorcycle", 1, 36.4), ("bicycle", 4, 35.6),
    ]  # fmt: skip
    for category, lane, y in cars:
        put(site, category, _LANES[lane], y, -90.0, queue)
    place = "at the ferry terminal"
    hall(site, 27.0, 44.0, 46.0, 54.0, 5.4, wall=site.material("terminal", "planks:#b9c4c8"), roof="gravel",
         doors="sheet_metal:#27496d", name="FERRY", facing_deg=-90.0, category="ferry_terminal")  # fmt: skip
    put(site, "water_tank", 31.0, 49.0, 0.0, "on the roof of the ferry terminal", z=QUAY_M + 5.4)
    put(site, "satellite_dish", 40.6, 50.4, -90.0, "on the roof of the ferry terminal", z=QUAY_M + 5.4)
    open_shed(site, 28.0, 24.0, 35.0, 38.0, 3.4, "sheet_metal:#6f8a9a")
    set_out(site, [("bench", 30.2, 34.8, 0.0), ("luggage_trolley", 31.6, 30.0, 60.0),
                   ("vending_machine", 29.6, 27.0, 0.0)], "in the waiting shed of the ferry terminal")  # fmt: skip
    set_out(site, [
        ("ticket_booth", 50.0, 43.6, 90.0), ("direction_sign", 64.4, 40.0, 90.0), ("food_truck", 57.6, 47.4, -90.0),
        ("information_board", 34.0, 20.6, 0.0), ("lifebuoy_stand", 63.6, 1.6, 90.0),
        ("traffic_light", 42.6, 4.6, 90.0),
        ("mooring_bollard", 41.0, 1.5, -90.0), ("mooring_bollard", 60.0, 1.5, -90.0),
        ("phone_booth", 48.8, 52.6, -90.0),
        ("advertising_column", 64.0, 30.0, 0.0),
    ], place)  # fmt: skip
