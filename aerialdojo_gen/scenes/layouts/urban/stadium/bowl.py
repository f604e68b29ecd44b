"""A football ground: a bowl of stands round a pitch, a two-tier main stand under a roof, a forecourt before it.

The pitch runs east and west; the main stand stands north of it, the forecourt and the car park south.
"""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import Pose, slab
from aerialdojo_gen.scenes.grammar_streets import arrow, crossing, parking_row, streets
from aerialdojo_gen.scenes.ground import disc, polygons_of, rectangle
from aerialdojo_gen.scenes.kit.parking import park_cars
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy, columns, letters
from aerialdojo_gen.scenes.layouts.urban.stadium.stand_shells import back_wall, end_walls, platform, roof_parts
from aerialdojo_gen.scenes.layouts.urban.stadium.stands import Tier, gangways, passage, tier_parts
from aerialdojo_gen.scenes.site import Site

Y0 = 6.0
_HALF = (21.0, 13.5)
_CORE = rectangle(-19.5, Y0 - 11.5, 19.5, Y0 + 11.5)
_FRONT = 6.0
_EAST = 17.0
_FAR = 90.0
_UPPER_X = 27.0
_WALKWAY_Z = 4.46
ROOF_Z, SOUTH_ROOF_Z = 13.0, 8.4


def build_bowl(site: Site) -> None:
    """Build ground, stands, roofs, and the forecourt."""
    _ground(site)
    low, east, upper = _tiers()
    _stands(site, low, east, upper)
    _roofs(site)
    _round_the_pitch(site)
    _forecourt(site)
    _grounds(site)


def _platforms() -> list[tuple[Polygon, float, float]]:
    """List platforms among the rows: plan, height of their foot, and of their floor."""
    south, north, west = Y0 - 17.5, Y0 + 17.5, -25.5
    out = [(rectangle(x - 1.8, south - 5.1, x + 1.8, south - 2.55), 1.8, 3.2) for x in (-18.0, -6.0, 6.0, 18.0)]
    out += [(rectangle(x - 1.8, south - 1.7, x + 1.8, south - 0.05), 0.9, 1.52) for x in (-9.0, 9.0)]
    out += [(rectangle(x - 1.8, north + 2.55, x + 1.8, north + 5.1), 1.8, 3.2) for x in (-20.0, -8.0, 8.0, 20.0)]
    out += [(rectangle(west - 5.1, y - 1.8, west - 2.55, y + 1.8), 1.8, 3.2) for y in (Y0 - 8.0, Y0 + 8.0)]
    out += [(rectangle(25.55, y - 1.8, 27.2, y + 1.8), 0.9, 1.52) for y in (Y0 - 8.0, Y0 + 8.0)]
    # In the upper tier: three rows of 0.8 m from the front.
    out += [(rectangle(x - 1.8, 33.35 + 2.4, x + 1.8, 33.35 + 4.8), 7.2, 8.7) for x in (-18.0, 0.0, 18.0)]
    return out


def _tiers() -> tuple[Tier, Tier, Tier]:
    south, north, west = Pose(0, Y0 - 17.5, -90.0), Pose(0, Y0 + 17.5, 90.0), Pose(-25.5, Y0, 180.0)
    portals = [passage(Pose(x, south.y, -90.0), 3.0, 8.6) for x in (-12.0, 0.0, 12.0)]
    portals += [passage(Pose(x, north.y, 90.0), 3.0, 9.0) for x in (-14.0, 0.0, 14.0)]
    portals.append(passage(west, 3.0, 8.6))
    gates = tuple(passage(Pose(25.5, y, 0.0), 2.6, 5.4) for y in (Y0 - 3.4, Y0 + 3.4))
    clear = tuple(area.buffer(0.35) for area, _, _ in _platforms())
    around = rectangle(-_FAR, -_FAR, _EAST, _FAR)
    low = Tier(_CORE, _FRONT, 9, 1.1, region=around, portals=tuple(portals), clear=clear)
    east = Tier(_CORE, _FRONT, 5, 1.1, region=rectangle(_EAST, -_FAR, _FAR, _FAR), portals=gates, clear=clear)
    upper = Tier(
        _CORE, _FRONT + 9 * 0.85 + 2.2, 8, 6.2, foot_m=_WALKWAY_Z, tread_m=0.8, riser_m=0.5,
        region=rectangle(-_UPPER_X, 20.0, _UPPER_X, _FAR), clear=clear,
    )  # fmt: skip
    return low, east, upper


def _ground(site: Site) -> None:
    site.set_ground(material=site.material("lawn", "grass:#6f8f4e"))
    paving = site.material("plaza", "paving:#b9b0a4")
    site.paint(_CORE.buffer(_FRONT + 9 * 0.85 + 4.5), paving)
    site.paint(rectangle(-_UPPER_X - 3, 20, _UPPER_X + 3, 44), paving)
    site.paint(rectangle(-46, -34, 46, -18), paving)
    site.paint(rectangle(-4, -42, 4, -33), paving, 0.12)
    site.paint(_CORE.buffer(_FRONT), site.material("apron", "#a5523f"))
    stripes = [site.material("turf", "grass:#4f8f3a"), site.material("turf_light", "grass:#67a84a")]
    x0, y0 = _HALF
    site.paint(rectangle(-x0 - 1.2, Y0 - y0 - 1.2, x0 + 1.2, Y0 + y0 + 1.2), stripes[0])
    for k in range(0, 12, 2):
        site.paint(rectangle(-x0 + 3.5 * k, Y0 - y0, -x0 + 3.5 * (k + 1), Y0 + y0), stripes[1])
    for area in _marks():
        site.paint(area, "marking")


def _marks() -> list[Polygon]:
    x, y = _HALF
    lines = [rectangle(-x, Y0 - y, x, Y0 + y).exterior, disc(0, Y0, 5.0, 32).exterior]
    lines += [rectangle(s * x, Y0 - 8.0, s * (x - 7.0), Y0 + 8.0).exterior for s in (-1, 1)]
    lines += [rectangle(s * x, Y0 - 4.2, s * (x - 2.6), Y0 + 4.2).exterior for s in (-1, 1)]
    marks = [line.buffer(0.07, cap_style="flat", join_style="mitre") for line in lines]
    spots = [disc(u, Y0, 0.2, 10) for u in (-x + 5.0, 0.0, x - 5.0)]
    whole = unary_union([*marks, *spots, rectangle(-0.07, Y0 - y, 0.07, Y0 + y)])
    return polygons_of(whole)


def _stands(site: Site, low: Tier, east: Tier, upper: Tier) -> None:
    concrete, step = site.material("terrace", "concrete:#b3b0a8"), site.material("steps", "concrete:#d8d5cc")
    seats = [site.material("seats", "#2f5f9e"), site.material("seats_two", "#e9e7de")]

    def seat(x: float, y: float, row: int) -> str:
        # Slanting stripes, as clubs lay them out in their colours.
        return seats[int((x + y + 2.4 * row) // 6.0) % 3 == 0]

    names = ("bowl_stand", "east_stand", "main_stand_upper_tier")
    for name, tier in zip(names, (low, east, upper), strict=True):
        feet = gangways(tier, 8.2)
        parts = tier_parts(tier, feet, concrete=concrete, step=step, seat=seat)
        site.add(
            name,
            "grandstand",
            parts,
            {"material": "concrete"},
            footprint=tier.plan.difference(unary_union(tier.portals)),
        )
    parts = []
    for area, foot, z in _platforms():
        parts += platform(area, foot, z, floor=concrete, rim=site.material("rim", "marking_yellow"))
    site.add("platforms", "platform", parts)
    site.add("stand_walls", "wall", _walls(site, low, east, upper))


def _walls(site: Site, low: Tier, east: Tier, upper: Tier) -> Parts:
    wall, band = site.material("wall", "brick:#a05a44"), site.material("band", "#2f5f9e")
    concrete = site.material("terrace", "concrete:#b3b0a8")
    # The outer wall leaves the north side to the main stand's own back wall.
    outer = Tier(_CORE, _FRONT, 9, 1.1, region=rectangle(-_FAR, -_FAR, _EAST, 24.0))
    gates = [passage(Pose(x, -19.15, -90.0), 3.0, 3.0) for x in (-24.0, -18.0, -12.0, -6.0, 0.0, 6.0, 12.0)]
    gates += [passage(Pose(-33.15, y, 180.0), 3.0, 3.0) for y in (Y0 - 12.0, Y0 - 6.0, Y0, Y0 + 6.0, Y0 + 12.0)]
    parts = back_wall(outer, 5.7, gates, 3.3, wall=wall, band=band)
    parts += back_wall(east, 3.8, list(east.portals), 3.3, wall=wall, band=band)
    parts.append((concrete, end_walls(low, rectangle(_EAST - 0.25, -_FAR, _EAST, _FAR))))
    ends = [rectangle(s * _UPPER_X, 20, s * (_UPPER_X - 0.25), _FAR) for s in (-1, 1)]
    parts += [(concrete, end_walls(upper, end)) for end in ends]
    walk = upper.edge(0).difference(low.edge(9)).intersection(upper.region or upper.plan)
    parts += [(concrete, slab(p, _WALKWAY_Z - 0.35, _WALKWAY_Z)) for p in polygons_of(walk)]
    north = [passage(Pose(float(x), 39.75, 90.0), 3.4, 3.0) for x in np.linspace(-17.67, 17.67, 7)]
    parts += back_wall(_from_ground(upper), 11.0, north, 3.6, wall=wall, band=band)
    for s in (-1, 1):
        # Side walls of the main stand, with a doorway under the tier.
        for y0, y1, z0 in ((29.5, 31.5, 0.0), (31.5, 35.0, 3.4), (35.0, 39.8, 0.0)):
            top = 4.0 if y1 < 33 else _WALKWAY_Z + 1.6
            parts.append((wall, block(min(s * 27, s * 27.3), y0, max(s * 27, s * 27.3), y1, z0, top)))
    grid = [(x, y) for x in (-24.5, -17.5, -10.5, -3.5, 3.5, 10.5, 17.5, 24.5) for y in (32.2, 36.2)]
    parts.append((concrete, columns(grid, 0.0, _WALKWAY_Z - 0.3, 0.3)))
    rear = [(x, -14.6) for x in (-21.0, -15.0, -9.0, -3.0, 3.0, 9.0, 15.0)]
    parts.append((concrete, columns(rear, 0.0, 2.0, 0.25)))
    parts.append(("marking", letters("CITY GROUND", 1.1, (0.0, -19.47, 3.95), -90.0, 0.1)))
    return parts


def _from_ground(upper: Tier) -> Tier:
    """Give the upper tier's plan a foot on the ground, for the wall behind it."""
    return Tier(upper.core, upper.front_m, upper.rows, upper.z_m, tread_m=upper.tread_m, region=upper.region)


def _roofs(site: Site) -> None:
    roof, truss = site.material("roof", "sheet_metal:#c9cdd0"), site.material("truss", "#f1f0ea")
    band = site.material("band", "#2f5f9e")
    main = roof_parts(Frame(0.0, 40.6, -90.0), 54.0, 17.0, ROOF_Z, foot_m=0.0, roof=roof, truss=truss, fascia=band)
    main.append(("marking", letters("MAIN STAND", 0.55, (0.0, 23.46, ROOF_Z - 0.1), -90.0, 0.06)))
    site.add("main_stand_roof", "stand_roof", main, {"material": "metal"})
    south = roof_parts(
        Frame(0.0, -19.7, 90.0), 31.0, 8.0, SOUTH_ROOF_Z,
        foot_m=0.0, rise_m=1.6, roof=roof, truss=truss, fascia=band,
    )  # fmt: skip
    site.add("south_stand_roof", "stand_roof", south, {"material": "metal"})


def _round_the_pitch(site: Site) -> None:
    colours = ["#c9382e", "#e9b52a", "#2f5f9e", "#3f7d4e", "#f1f0ea"]
    words = ["ENERGY", "BANK", "RADIO", "FRESH", "TRAVEL"]
    parts: Parts = []
    for side, yaw in ((-1, 90.0), (1, -90.0)):
        y = Y0 + side * (_HALF[1] + 1.0)
        for k in range(9):
            x = -19.2 + 4.8 * k
            # The middle is open, and nothing hides the dugouts.
            if abs(x) < (12.0 if side > 0 else 4.0):
                continue
            colour = colours[(k + 2 * (side > 0)) % 5]
            parts.append((colour, block(x - 2.2, y - 0.06, x + 2.2, y + 0.06, 0.08, 0.95)))
            ink = "#26282c" if colour in ("#f1f0ea", "#e9b52a") else "#f1f0ea"
            parts.append((ink, letters(words[(k + 2 * (side > 0)) % 5], 0.5, (x, y - side * 0.06, 0.28), yaw, 0.02)))
            parts.append(("iron", block(x - 2.0, y - 0.1, x + 2.0, y + 0.1, 0.0, 0.08)))
    site.add("hoardings", "advertising_boards", parts)


def _forecourt(site: Site) -> None:
    wall = site.material("wall", "brick:#a05a44")
    gate: Parts = canopy(-9.0, -34.4, 9.0, -30.6, 3.5, roof="sheet_metal:#c9cdd0", post="iron",
                         posts=[(x, y) for x in (-8.6, 0.0, 8.6) for y in (-34.0, -31.0)])  # fmt: skip
    band = site.material("band", "#2f5f9e")
    gate.append((band, block(-9.2, -34.6, 9.2, -34.4, 3.3, 4.6)))
    gate.append(("marking", letters("TURNSTILES", 0.7, (0.0, -34.6, 3.6), -90.0, 0.06)))
    site.add("gate_canopy", "gate_canopy", gate, {"material": "metal"})
    fences = [rectangle(-46, -32.7, -9.4, -32.3), rectangle(9.4, -32.7, 33, -32.3), rectangle(38, -32.7, 46, -32.3)]
    fences += [rectangle(-46.4, -32.7, -46, -20), rectangle(46, -32.7, 46.4, 38)]
    parts: Parts = [(wall, slab(f, 0.0, 2.5)) for f in fences]
    parts += [("concrete", slab(f.buffer(0.08, join_style="mitre"), 2.5, 2.64)) for f in fences]
    site.add("forecourt_wall", "wall", parts, {"material": "brick"}, footprint=unary_union(fences))
    for name, word, x0, x1, colour in (
        ("ticket_office", "TICKETS", -30.0, -20.0, "plaster:#dccfb4"), ("club_shop", "CLUB SHOP", 19.0, 31.0, band),
    ):  # fmt: skip
        house: Parts = [
            (colour, block(x0, -30.5, x1, -25.5, 0.0, 3.6)),
            ("sheet_metal:#7d8488", block(x0 - 0.3, -30.8, x1 + 0.3, -25.2, 3.6, 3.85)),
            ("shopfront", block(x0 + 0.6, -25.5, x1 - 0.6, -25.44, 0.1, 2.5)),
            ("marking", letters(word, 0.6, ((x0 + x1) / 2, -25.5, 2.75), 90.0, 0.08)),
            ("#26282c", block(x0, -25.5, x1, -25.46, 2.6, 3.5)),
        ]
        site.add(name, "ticket_office", house, footprint=rectangle(x0, -30.5, x1, -25.5))
    streets(site, [[(-58, -46.5), (58, -46.5)]], lane_m=2.9, pavement_m=1.4)
    crossing(site, 0.0, -46.5, 90.0, 5.8)
    bays = []
    for x, count in ((-27.0, 13), (27.0, 13)):
        site.paint(rectangle(x - 18.5, -43.0, x + 18.5, -33.6), site.material("asphalt", "asphalt"))
        bays += parking_row(site, x, -33.9, 90.0, count, bay_m=(2.6, 4.8))
        arrow(site, x, -41.2, 0.0)
    park_cars(site, bays, 0.55, "in the car park")


def _grounds(site: Site) -> None:
    """Raise the floodlight masts, and plant trees along the borders."""
    masts = (
        ("grey", 36.0, 29.0, -140.0),
        ("white", -38.5, 29.0, -40.0),
        ("grey", -39.0, -15.0, 35.0),
        ("green", 37.0, -14.5, 145.0),
    )
    for variant, x, y, yaw in masts:
        site.place("floodlight_mast", x, y, yaw, variant=variant, params={"h": 15.0})
    rows = [(-53.0, float(y)) for y in range(-28, 46, 9)] + [(51.5, float(y)) for y in range(-30, 46, 9)]
    rows += [(float(x), 45.5) for x in range(-40, 44, 10)] + [(-43.0, -20.6)]
    for k, (x, y) in enumerate(rows):
        site.try_place("urban_tree", x, y, 40.0 * k, variant=("green", "column", "green")[k % 3])
