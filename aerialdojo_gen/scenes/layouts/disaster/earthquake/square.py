"""A square of a modern town after an earthquake: blocks of flats torn, pancaked and leaning, a fault across it.

The fault runs from west to east through the square; everything south of it has sunk.
"""

from __future__ import annotations

from shapely.geometry import LineString, Polygon
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_streets import crossing, streets
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.kit.relief import leaning_poles
from aerialdojo_gen.scenes.kit.rubble import cracks, fault, heap, slab_pile, strew_chunks
from aerialdojo_gen.scenes.kit.ruins import put_up
from aerialdojo_gen.scenes.kit.wreckage import Bite
from aerialdojo_gen.scenes.kit.wrecks import Style, Wreck
from aerialdojo_gen.scenes.layouts.disaster.earthquake.square_things import furnish_square
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import rolling_terrain

_FAULT = [
    (-60.0, -15.0),
    (-30.0, -9.5),
    (-14.0, -6.0),
    (-3.0, -4.5),
    (8.0, -1.5),
    (20.0, 1.0),
    (34.0, 2.0),
    (60.0, 7.0),
]


def build_square(site: Site, drop_m: float, litter: float) -> None:
    """Build the square and what fell about it."""
    wrecks = _wrecks(site)
    heaps = _heaps(site.recipe.seed)
    _ground(site, drop_m, wrecks, heaps)
    bases = {}
    for name, wreck in wrecks.items():
        bases[name] = site.ground_z(wreck.frame.x, wreck.frame.y) - (0.7 if wreck.lean_deg else 0.0)
        put_up(site, wreck, bases[name], node=name)
    pile = slab_pile(
        site,
        (26.0, 3.5),
        90.0,
        (21.0, 11.5),
        6,
        "east",
        floor=site.material("floor", "concrete"),
        wall=site.material("flats_two", "plaster:#c98f6a"),
    )
    furnish_square(site, wrecks["torn_flats"], bases["torn_flats"], pile)
    leaning_poles(
        site,
        [
            (-18.4, 38.0, 9.0, 200.0),
            (-18.0, 24.0, 14.0, 20.0),
            (-18.6, 12.0, 7.0, 250.0),
            (-17.2, -12.0, 16.0, 170.0),
            (-16.4, -26.0, 8.0, 30.0),
        ],
    )
    for k, (area, _) in enumerate(heaps):
        strew_chunks(
            site, area.buffer(2.2), 0.95 / litter, f"heap{k}", brick=site.material("flats", "plaster:#cfc3ab")
        )
    strew_chunks(site, site.extent.buffer(-2.0), 4.2 / litter, "everywhere", size_m=(0.35, 0.8))


def _wrecks(site: Site) -> dict[str, Wreck]:
    one, two = site.material("flats", "plaster:#cfc3ab"), site.material("flats_two", "plaster:#c98f6a")
    plain = Style(wall=one, band="#a5523f")
    warm = Style(wall=two, band="#e4dccb")
    grey = Style(wall=site.material("flats_three", "tiles:#9fb0b4"), band="#5f6a70", panes=0.7)
    shop = Style(
        wall=site.material("shop", "brick:#9a5f4a"),
        band="stone",
        shops=True,
        storey_m=3.3,
        columns=False,
        roof="roof_tiles:#8a4f3c",
    )
    return {
        "torn_flats": Wreck(
            Frame(2.0, 22.0),
            36.0,
            11.0,
            5,
            plain,
            (Bite(4.5, -6.0, 4.2, 9.0, seed=3), Bite(-18.0, 3.0, 2.0, 7.0, 6.5, seed=5)),
            balconies=True,
        ),
        "west_flats": Wreck(
            Frame(-34.0, 6.0, 90.0),
            27.0,
            11.0,
            4,
            warm,
            (Bite(-13.0, -4.0, 5.0, 9.0, seed=8), Bite(12.0, -6.0, 0.6, 5.0, 5.5, seed=9)),
            balconies=True,
        ),
        "leaning_flats": Wreck(
            Frame(-5.0, -32.0, 180.0),
            27.0,
            10.0,
            5,
            grey,
            (Bite(-14.0, -4.0, 0.5, 4.0, 7.0, seed=12),),
            lean_deg=8.5,
            balconies=True,
        ),
        "corner_shop": Wreck(
            Frame(31.0, -32.0, 180.0),
            19.0,
            11.0,
            3,
            shop,
            (Bite(9.0, -5.0, 3.5, 8.0, seed=15), Bite(-4.0, 2.0, 0.5, 4.0, 6.5, seed=16)),
            ridge_m=3.4,
        ),
        "north_west_flats": Wreck(
            Frame(-35.0, 32.0), 14.0, 10.0, 6, grey, (Bite(6.0, -4.0, 0.6, 4.0, 9.5, seed=21),), lean_deg=5.0
        ),
        "north_east_flats": Wreck(
            Frame(34.0, 28.0, -90.0), 20.0, 11.0, 5, warm, (Bite(10.0, -5.0, 3.0, 7.0, 3.0, seed=24),), balconies=True
        ),
        "south_west_flats": Wreck(
            Frame(-35.0, -32.0, 90.0), 13.0, 11.0, 3, plain, (Bite(5.0, -5.0, 3.0, 6.0, seed=27),)
        ),
    }


def _heaps(seed: int) -> list[tuple[Polygon, float]]:
    # Area and height of the rubble slopes.
    spots = (
        (6.5, 15.0, 7.0, 2.9),
        (26.0, 3.5, 13.0, 1.2),
        (-26.5, -7.0, 6.0, 2.2),
        (17.0, -28.0, 6.5, 2.2),
        (22.5, -26.0, 5.0, 1.8),
        (-15.5, 27.0, 4.0, 1.2),
        (28.0, 36.0, 6.0, 1.8),
        (-29.0, -27.0, 5.0, 1.7),
        (15.5, -8.0, 3.2, 1.4),
    )
    return [(blob(x, y, r, seed + k, 0.3), h) for k, (x, y, r, h) in enumerate(spots)]


def _ground(site: Site, drop_m: float, wrecks: dict[str, Wreck], heaps: list[tuple[Polygon, float]]) -> None:
    ground = rolling_terrain(site.recipe.size_m, 1.6, site.recipe.seed, 0.22, 30.0, octaves=2)
    ground = fault(site, ground, _FAULT, drop_m, 1.3)
    for wreck in wrecks.values():
        ground = ground.flattened(wreck.frame.area(wreck.plan), blend_m=2.5)
    for k, (area, height) in enumerate(heaps):
        ground = heap(site, ground, area, height, site.recipe.seed + k)
    site.set_ground(ground, site.material("yard", "dirt:#8b8271"))
    for area in (rectangle(-44, -40, -27, 40), rectangle(-17, 14, 44, 40), rectangle(-18, -40, 44, -24)):
        site.paint(area.buffer(-1.0), site.material("lawn", "grass:#77844f"))
    site.paint(rectangle(-18.5, -14.5, 19.0, 15.0), site.material("square", "paving:#b3a796"))
    for k in range(4):
        site.paint(rectangle(-18.5, -11.0 + 7.0 * k, 19.0, -10.5 + 7.0 * k), site.material("band", "paving:#8f8478"))
    streets(site, [[(-23.6, 42), (-23.6, -8.4)]], lane_m=2.9, pavement_m=1.6)
    streets(site, [[(-22.2, -9.4), (-22.2, -42)], [(-46, -19.4), (46, -19.4)]], lane_m=2.9, pavement_m=1.6)
    crossing(site, -12.0, -19.4, 90.0, 5.6, 2.6)
    scarp = (
        LineString(_FAULT)
        .buffer(1.1, quad_segs=2)
        .union(unary_union([blob(x, y + 0.2, 1.5, k, 0.4) for k, (x, y) in enumerate(_FAULT)]))
    )
    site.paint(scarp.intersection(site.extent), "dirt:#6f5a42")
    cracks(
        site,
        [
            (-10.0, -5.5, 100.0),
            (3.0, -3.5, -70.0),
            (-22.0, -12.0, -95.0),
            (-5.0, -19.0, 10.0),
            (12.0, 1.0, 85.0),
            (-25.0, 8.0, 80.0),
            (20.0, -19.0, -20.0),
            (-14.0, -8.0, -60.0),
        ],
        9.0,
        1,
    )
    for area, _ in heaps:
        site.paint(area, site.material("heap", "rubble"))
