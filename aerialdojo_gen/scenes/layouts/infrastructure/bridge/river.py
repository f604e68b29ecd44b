"""A cable-stayed road bridge over a river: a stone quay on one bank, a gravel beach on the other, a toll plaza above.

The road lies at z = 0, the water `-WATER_M` below.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy, letters, railing, stairs
from aerialdojo_gen.scenes.layouts.infrastructure.bridge.decks import Deck, approach
from aerialdojo_gen.scenes.layouts.infrastructure.bridge.river_things import furnish_river
from aerialdojo_gen.scenes.mesh import Floats, merge
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain, rolling_terrain

WATER_M = 12.0
QUAY_M = -9.6
PYLONS = (-22.0, 22.0)
_WEST, _EAST = -48.0, 50.0


def build_river(site: Site) -> None:
    """Build the bridge, its banks and what stands on them."""
    site.set_ground(_terrain(site), site.material("bank", "grass:#6f9448"))
    _paint(site)
    _bridge(site)
    _quay(site)
    _banks(site)
    furnish_river(site)


def _terrain(site: Site) -> Terrain:
    t = rolling_terrain(site.recipe.size_m, 1.5, site.recipe.seed, 1.0, 40.0)
    xy = t.corners().reshape(*t.heights_m.shape, 3)
    x, y = xy[..., 0], xy[..., 1]
    level = _smooth((np.abs(y) - 24.0) / 14.0) * _smooth((np.abs(x) - 54.0) / 10.0)
    h = t.heights_m * level
    # West: water, a quay wall, the quay, a slope; east: a beach that rises from the water.
    slope = _smooth((x + 49.5) / 8.5)
    h = np.where(x < -33.5, h * (1 - slope) + QUAY_M * slope, h)
    beach = _smooth((49.5 - x) / 24.0)
    h = np.where(x > 0, h * (1 - beach) - (WATER_M + 1.0) * beach, np.where(x > -33.5, -WATER_M - 1.0, h))
    return replace(t, heights_m=h)


def _smooth(t: Floats) -> Floats:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _paint(site: Site) -> None:
    half = site.recipe.size_m[1] / 2
    site.paint(rectangle(27.0, -half, 41.0, half), site.material("beach", "gravel:#b3a88e"))
    site.paint(rectangle(-41.5, -half, -33.0, half), site.material("quay", "cobbles:#9c948a"))
    approach(site, -86.0, _WEST, 3.7, 7.2)
    approach(site, _EAST, 86.0, 3.7, 7.2)
    site.paint(rectangle(-78.0, -14.5, -55.5, 14.5), "asphalt")
    for y in (-8.6, 0.0, 8.6):
        site.paint(rectangle(-72.0, y - 0.9, -60.5, y + 0.9), "concrete", 0.12)
        for x in (-76.5, -58.5):
            site.paint(rectangle(x - 1.4, y - 0.08, x + 1.4, y + 0.08), "marking")
    site.paint(rectangle(54.0, -36.0, 82.0, -9.5), site.material("depot", "gravel:#8f8a80"))
    site.paint(rectangle(52.5, 9.0, 80.0, 26.0), site.material("terrace", "paving:#b8a288"), 0.1)
    site.paint(rectangle(-53.5, 9.0, -49.8, 40.0).union(rectangle(-53.5, -40.0, -49.8, -9.0)), "gravel:#c0b090")


def _bridge(site: Site) -> None:
    steel = site.material("girder", "#5f7d8c")
    deck = Deck(_WEST - 1.0, _EAST + 1.0, 3.7, 7.3, girder=steel, girders=(-3.4, 3.4))
    legs = [rectangle(x - 1.25, min(s * 6.0, s * 8), x + 1.25, max(s * 6.0, s * 8)) for x in PYLONS for s in (-1, 1)]
    gaps = [(x - 1.3, x + 1.3, s) for x in PYLONS for s in (-1, 1)] + [(5.6, 11.4, 1), (-11.4, -5.6, -1)]
    site.add("bridge_deck", "bridge_deck", [*deck.parts(legs), *deck.parapets("#44525a", gaps)])
    piers: Parts = []
    for x in (-40.2, 41.0):
        foot = site.ground_z(x, 0.0) - 1.0
        piers.append(
            ("concrete", merge([block(x - 0.7, y - 0.9, x + 0.7, y + 0.9, foot, -2.1) for y in (-4.6, 4.6)]))
        )
        piers.append(("concrete", block(x - 0.9, -6.2, x + 0.9, 6.2, -2.2, -1.0)))
    for x0, x1 in ((_WEST - 3.0, _WEST + 0.4), (_EAST - 0.4, _EAST + 3.0)):
        piers.append(
            (
                site.material("abutment", "blocks:#9a9186"),
                merge(
                    [
                        block(x0, -7.6, x1, 7.6, -6.5, -1.05),
                        *[block(x0, s * 7.45 - 0.25, x1, s * 7.45 + 0.25, -1.1, 0.9) for s in (-1, 1)],
                    ]
                ),
            )
        )
    for x in PYLONS:
        piers.append(
            ("blocks:#857d72", merge([block(x - 3.6, y - 3.6, x + 3.6, y + 3.6, -14.0, -11.3) for y in (-7.5, 7.5)]))
        )
        piers.append(
            ("hazard", merge([block(x - 3.65, y - 3.65, x + 3.65, y + 3.65, -11.75, -11.45) for y in (-7.5, 7.5)]))
        )
    site.add("bridge_piers", "bridge_piers", piers)
    for x, state in zip(PYLONS, ("western", "eastern"), strict=True):
        site.place("bridge_pylon", x, 0.0, 0.0, z=-12.3, variant="white_red_cables", params={"h": 32.0},
                   attributes={"state": state}, solid=False)  # fmt: skip
    half = site.recipe.size_m[1] / 2
    site.add(
        "river",
        "river",
        [(site.material("water", "water:#4f7f8c"), block(-33.3, -half, 30.4, half, -WATER_M - 0.5, -WATER_M))],
    )


def _quay(site: Site) -> None:
    half = site.recipe.size_m[1] / 2
    wall = site.material("quay_wall", "blocks:#8b8378")
    parts: Parts = [(wall, block(-35.0, -half, -33.0, half, -13.5, QUAY_M + 0.02)),
                    ("concrete:#c2bbae", block(-33.9, -half, -32.8, half, QUAY_M - 0.3, QUAY_M + 0.12))]  # fmt: skip
    for y in np.arange(-half + 6.0, half, 8.0):
        if abs(y) > 9:
            parts.append(("rubber", block(-32.95, y - 0.25, -32.6, y + 0.25, -12.2, -10.2)))
    site.add("quay_wall", "quay_wall", parts)
    flights = stairs((-41.2, 16.0), 180.0, 2.6, 9.75, 9.6, z_m=QUAY_M, stringer="concrete")
    flights += stairs((-41.2, -18.0), 180.0, 2.6, 9.75, 9.6, z_m=QUAY_M, stringer="concrete")
    site.add("quay_stairs", "stairs", flights)
    for y in (16.0, -18.0):
        site.occupy(rectangle(-51, y - 2, -41, y + 2))
    edge: Parts = []
    for a, b in (((-49.7, 18.2), (-49.7, half)), ((-49.7, 8.2), (-49.7, 13.8)), ((-49.7, -15.8), (-49.7, -8.2)),
                 ((-49.7, -half), (-49.7, -20.2))):  # fmt: skip
        edge += railing([a, b], min(site.ground_z(*a), site.ground_z(*b)), frame="#44525a")
    site.add("rim_railing", "railing", edge)
    pontoon: Parts = [("boards:#8f7a5c", block(-32.6, 21.0, -29.4, 39.0, -12.1, -11.4)),
                      ("#3a5068", block(-32.4, 21.2, -29.6, 38.8, -12.5, -12.1))]  # fmt: skip
    site.add("pontoon", "pontoon", pontoon)


def _banks(site: Site) -> None:
    """Put up the toll office, the café and the depot's shed, and the blocks of the town behind."""
    toll: Parts = canopy(-72.5, -14.0, -60.5, 14.0, 5.4, roof="sheet_metal:#5f7d8c", post="#e6e4dc",
                         posts=[(x, y) for x in (-71.6, -61.4) for y in (-8.6, 0.0, 8.6)])  # fmt: skip
    toll.append(("marking", letters("TOLL", 1.0, (-60.4, 0.0, 5.8), 0.0, 0.1)))
    toll.append(("#2f5f7a", block(-60.7, -2.6, -60.45, 2.6, 5.6, 7.0)))
    site.add("toll_canopy", "toll_canopy", toll)
    building(site, rectangle(-76, 18, -62, 26), wall="facade_office:#b8b4ac", roof="gravel:#a09a90", storeys=2, z=0.0,
             category="toll_office")  # fmt: skip
    cafe: Parts = canopy(58.0, 12.5, 70.0, 17.0, 3.2, roof="stripes:#b8543c", post="wood",
                         posts=[(x, 12.9) for x in (58.4, 64.0, 69.6)], foot_m=0.1)  # fmt: skip
    cafe.append(("marking", letters("RIVER CAFE", 0.6, (64.0, 16.96, 3.5), -90.0, 0.05)))
    building(site, rectangle(57, 17, 71, 24), wall="planks:#a8774a", roof="sheet_metal:#6a6f70", storeys=1,
             storey_m=4.4, z=0.0, category="cafe", extra=cafe, parapet_m=0.0)  # fmt: skip
    building(site, rectangle(66, -36, 82, -26), wall="corrugated:#7d8f86", roof="sheet_metal:#8f9694", storeys=2,
             storey_m=2.8, roof_kind="gable", roof_m=2.2, z=0.0, category="depot_shed")  # fmt: skip
    for (x0, y0, x1, y1), face, storeys in (
        ((-84, 32, -64, 44), "facade_brick:#8f4a3c", 3), ((-84, -44, -66, -22), "facade_flats:#c9b295", 4),
        ((-62, -46, -56, -26), "facade_flats:#b0b8ba", 3), ((66, 34, 84, 46), "facade_brick:#a5795a", 3),
    ):  # fmt: skip
        low = min(site.ground_z(x, y) for x in (x0, x1) for y in (y0, y1))
        building(site, rectangle(x0, y0, x1, y1), wall=face, roof="gravel:#a09a90", storeys=storeys, z=low,
                 category="town_block")  # fmt: skip
    put(site, "clock_tower", 76.0, 16.0, 180.0, variant="sandstone")
