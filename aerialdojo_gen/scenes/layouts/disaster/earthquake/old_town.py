"""An old town of masonry on a hillside after an earthquake: a piazza below, a church on a terrace above.

The ground falls to the south; east of a fault that runs through the piazza it has sunk a little.
"""

from __future__ import annotations

import numpy as np
from shapely.geometry import LineString, Polygon

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import smooth_path
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.kit.relief import leaning_poles
from aerialdojo_gen.scenes.kit.rubble import (
    cracks,
    fault,
    heap,
    rises,
    slab_pile,
    strew_chunks,
)
from aerialdojo_gen.scenes.kit.ruins import put_up
from aerialdojo_gen.scenes.kit.structures import columns
from aerialdojo_gen.scenes.kit.wreckage import Bite, Parts, torn_floor
from aerialdojo_gen.scenes.kit.wrecks import Style, Wreck
from aerialdojo_gen.scenes.layouts.disaster.earthquake.old_town_things import furnish_town
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import rolling_terrain

_FAULT = [(6.0, -60.0), (9.0, -30.0), (6.5, -12.0), (10.0, 6.0), (13.0, 22.0), (22.0, 60.0)]
_TERRACE = rectangle(-24.0, 27.5, 25.0, 43.0)
_ARCADE_M = 4.2


def build_old_town(site: Site, drop_m: float, litter: float) -> None:
    """Build the old town."""
    wrecks = _houses(site)
    heaps = _heaps(site.recipe.seed)
    _ground(site, drop_m, wrecks, heaps)
    bases = {}
    for name, wreck in wrecks.items():
        bases[name] = site.ground_z(wreck.frame.x, wreck.frame.y) - (0.5 if wreck.lean_deg else 0.0)
        put_up(site, wreck, bases[name], node=name, category="damaged_house")
    stone = site.material("stone", "blocks:#b5a78c")
    floor, tiles = "boards:#7d6243", site.material("tiles", "roof_tiles:#b0684a")
    pile = slab_pile(site, (3.0, 19.0), 4.0, (13.0, 9.0), 4, "north", floor=floor, wall=stone, gap_m=0.7, top=tiles)
    low = slab_pile(site, (31.5, -13.5), 86.0, (12.0, 8.5), 3, "east", floor=floor, wall=stone, gap_m=0.7, top=tiles)
    arcade = _arcade(site, stone)
    _shores(site, wrecks)
    furnish_town(site, wrecks, bases, (pile, low, arcade))
    leaning_poles(site, [(-22.4, -24.0, 8.0, 80.0), (-21.6, -6.0, 13.0, 300.0), (-21.8, 10.6, 7.0, 120.0),
                         (20.6, 12.4, 15.0, 200.0), (27.0, 22.0, 6.0, 20.0)], 7.0)  # fmt: skip
    for k, (area, _) in enumerate(heaps):
        look = {"plate": "boards:#8a6a46", "brick": stone, "beam": "wood", "lump": "rubble:#b3a58c"}
        strew_chunks(site, area.buffer(2.0), 1.0 / litter, f"heap{k}", **look)  # type: ignore[arg-type]
    edge = site.extent.buffer(-2.0)
    strew_chunks(
        site, edge, 4.6 / litter, "everywhere", plate="roof_tiles", brick=stone, beam="wood", size_m=(0.3, 0.75)
    )


def _houses(site: Site) -> dict[str, Wreck]:
    common = {"band": "stone", "storey_m": 3.2, "bay_m": 2.9, "window_m": (1.05, 0.95, 2.3), "wall_m": 0.45,
              "columns": False, "floor": "boards:#8a6a46", "panes": 0.6}  # fmt: skip
    roof = site.material("tiles", "roof_tiles:#b0684a")

    def style(wall: str, shops: bool = False) -> Style:
        return Style(wall=wall, roof=roof, shops=shops, **common)  # type: ignore[arg-type]

    ochre, rose = site.material("house", "plaster:#d6b27a"), site.material("house_two", "plaster:#cf9c86")
    cream, stone = site.material("house_three", "plaster:#e2d8c0"), site.material("stone", "blocks:#b5a78c")
    church = Style(wall=stone, band="stone", roof=roof, floor="tiles", storey_m=8.0, bay_m=4.6,
                   window_m=(1.3, 2.6, 6.4), wall_m=0.6, columns=False, panes=0.35)  # fmt: skip
    return {
        "town_hall": Wreck(Frame(-13.0, -29.0, 180.0), 17.0, 10.0, 3, style(ochre, True),
                           (Bite(-8.0, -4.5, 2.6, 6.5, seed=51),), ridge_m=3.0),
        "south_house": Wreck(Frame(1.0, -28.6, 180.0), 11.0, 9.0, 2, style(cream, True),
                             (Bite(0.5, -4.0, 2.4, 5.0, 3.0, seed=52),), ridge_m=2.6),
        "corner_house": Wreck(Frame(13.6, -28.8, 180.0), 14.0, 9.0, 3, style(rose, True),
                              (Bite(-6.0, -4.0, 3.6, 6.5, seed=53),), ridge_m=2.6),
        "west_house": Wreck(Frame(-33.0, -18.0, 90.0), 15.0, 9.0, 3, style(rose), lean_deg=6.0, ridge_m=2.6),
        "split_house": Wreck(Frame(-33.0, 1.0, 90.0), 16.0, 9.0, 3, style(ochre),
                             (Bite(2.0, -4.5, 2.2, 5.0, seed=55),), ridge_m=2.6),
        "hill_house": Wreck(Frame(-14.0, 19.0), 15.0, 9.0, 3, style(cream),
                            (Bite(6.5, -4.5, 3.4, 6.0, seed=56),), ridge_m=2.6),
        "lane_house": Wreck(Frame(18.5, 19.4), 11.0, 9.0, 2, style(rose), (Bite(-5.0, -4.0, 2.4, 5.0, seed=57),),
                            ridge_m=2.6),
        "east_house": Wreck(Frame(33.0, 4.5, -90.0), 16.0, 9.5, 3, style(cream, True),
                            (Bite(-6.5, -4.5, 2.6, 5.5, 0.4, seed=58),), ridge_m=2.8),
        "church": Wreck(Frame(-8.0, 36.0), 25.0, 11.0, 1, church,
                        (Bite(9.5, -4.5, 3.0, 6.5, 0.6, 12.0, seed=59),
                         Bite(-4.0, 2.0, 0.6, 4.0, 8.5, 12.0, seed=60)),
                        ridge_m=5.0, rooms_m=60.0),
        "north_west_house": Wreck(Frame(-36.0, 27.0, 90.0), 18.0, 9.5, 3, style(rose),
                                  (Bite(-8.0, -4.0, 2.4, 5.5, seed=62),), ridge_m=2.8),
        "north_east_house": Wreck(Frame(38.0, 30.0, -90.0), 18.0, 9.5, 3, style(ochre),
                                  (Bite(7.0, -4.0, 2.4, 5.0, seed=63),), ridge_m=2.8),
        "far_house": Wreck(Frame(37.0, -31.0, 180.0), 14.0, 9.0, 2, style(ochre), lean_deg=5.0, ridge_m=2.6),
    }  # fmt: skip


def _heaps(seed: int) -> list[tuple[Polygon, float]]:
    spots = ((5.0, 12.6, 5.0, 1.6), (-6.5, 12.8, 3.6, 1.6), (-5.4, -22.6, 4.0, 1.7), (19.4, -22.4, 4.0, 1.8),
             (25.6, -12.6, 5.0, 1.8), (-26.6, 2.0, 3.8, 1.6), (12.4, 13.6, 3.4, 1.3), (26.0, 9.6, 4.0, 1.5),
             (2.4, 29.6, 4.4, 1.9), (-28.4, 19.0, 4.0, 1.6), (31.0, 37.0, 4.4, 1.6))  # fmt: skip
    return [(blob(x, y, r, seed + k, 0.3), h) for k, (x, y, r, h) in enumerate(spots)]


def _ground(site: Site, drop_m: float, wrecks: dict[str, Wreck], heaps: list[tuple[Polygon, float]]) -> None:
    ground = rolling_terrain(site.recipe.size_m, 1.7, site.recipe.seed, 0.3, 26.0, octaves=2)
    ground = rises(site, ground, [(-24.0, 4.0, 0.9), (3.0, 27.0, 3.6), (24.0, 42.0, 1.4)], "y")
    ground = rises(site, ground, [(-50.0, -22.0, -1.4), (20.0, 50.0, 1.2)], "x")
    ground = fault(site, ground, _FAULT, drop_m, 1.4)
    ground = ground.flattened(_TERRACE, float(ground.z(0.0, 36.0)) + 0.7, blend_m=2.2)
    for wreck in wrecks.values():
        ground = ground.flattened(wreck.frame.area(wreck.plan), blend_m=2.2)
    ground = ground.flattened(disc(-2.0, -8.0, 5.0), blend_m=3.0)
    for k, (area, height) in enumerate(heaps):
        ground = heap(site, ground, area, height, site.recipe.seed + k)
    site.set_ground(ground, site.material("garden", "meadow:#7d8450"))
    cobbles, lane = site.material("piazza", "paving:#c2b195"), site.material("lane", "cobbles:#8f877a")
    lanes: list[tuple[list[tuple[float, float]], float]] = [
        ([(-56, 9.0), (-20, 9.5), (8, 8.8), (30, 11.0), (56, 13.0)], 6.0), ([(-23.5, -48), (-23.5, 9)], 5.0),
        ([(23.5, -48), (24.5, -20), (23.5, 9)], 5.0), ([(-56, -38), (56, -38)], 5.0),
        ([(-24, 9), (-27, 24), (-24, 34), (-16, 47)], 4.4), ([(24, 11), (28, 24), (29, 48)], 4.4),
        ([(11, 11), (10.5, 20), (9.5, 30)], 3.4),
    ]  # fmt: skip
    for path, width in lanes:
        site.paint(ribbon(smooth_path(path), width).intersection(site.extent), lane)
    site.paint(rectangle(-21.0, -23.5, 21.5, 6.0), cobbles)
    for r in (13.5, 9.0):
        site.paint(
            disc(-2.0, -8.0, r, 32).difference(disc(-2.0, -8.0, r - 0.6, 32)), site.material("band", "cobbles")
        )
    site.paint(_TERRACE.buffer(1.7, join_style="mitre").difference(_TERRACE), site.material("bank", "rock:#9a8c74"))
    site.paint(_TERRACE, site.material("terrace", "gravel:#bfae8f"))
    scarp = LineString(_FAULT).buffer(0.9, quad_segs=2).union(
        Polygon().union(blob(6.5, -12.0, 1.6, 1, 0.4)).union(blob(10.0, 6.0, 1.7, 2, 0.4))
    )  # fmt: skip
    site.paint(scarp.intersection(site.extent), "dirt:#77634a")
    cracks(site, [(7.0, -12.0, 170.0), (8.0, -4.0, 20.0), (-20.0, -14.0, 40.0), (-12.0, 9.0, 5.0), (24.0, -6.0, 80.0),
                  (-14.0, -3.0, -50.0), (14.0, -18.0, 60.0), (-16.0, 30.0, 20.0)], 9.0, 2)  # fmt: skip
    for area, _ in heaps:
        site.paint(area, site.material("heap", "rubble:#b3a58c"))


def _arcade(site: Site, stone: str) -> float:
    """Put up the arcade on the west side of the piazza, its north end fallen; return the height of its roof."""
    base = site.ground_z(-18.0, -9.0)
    top = base + _ARCADE_M
    plan = rectangle(-20.6, -21.0, -15.6, 1.0)
    bites = (Bite(-16.5, -2.0, 2.2, 3.4, 0.0, 5.0, seed=71),)
    parts: Parts = []
    roof = torn_floor(plan, top, [Bite(b.x, b.y, b.foot_m, b.head_m, -99.0, 5.0, b.seed) for b in bites], 0.45)
    if roof is not None:
        parts.append((stone, roof))
    posts = [(x, y) for y in np.arange(-20.4, -5.0, 3.7) for x in (-20.2, -16.0)]
    parts.append((stone, columns([(float(x), float(y)) for x, y in posts], base - 0.6, top - 0.4, 0.36, 10)))
    stub = [(float(x), float(y)) for x, y in ((-16.0, -1.9), (-20.2, -1.9), (-20.2, 0.5))]
    heights = (0.9, _ARCADE_M - 0.45, _ARCADE_M - 0.45)
    rest = [columns([p], base - 0.6, base + h, 0.36, 10) for p, h in zip(stub, heights, strict=True)]
    parts.append((stone, merge(rest)))
    site.add("arcade", "arcade", parts)
    for x, y in [*posts, *stub]:
        site.occupy(disc(float(x), float(y), 0.5, 8), -100.0, top - 0.3)
    return top


def _shores(site: Site, wrecks: dict[str, Wreck]) -> None:
    """Prop leaning and cracked walls with raking timbers."""
    timber = []
    for name, us in (("split_house", (-6.0, -3.5, 6.0)), ("east_house", (2.0, 4.0, 6.0)),
    ("town_hall", (1.0, 3.0, 5.0)),
                     ("west_house", (-5.0, -2.5, 0.0, 2.5, 5.0))):  # fmt: skip
        wreck = wrecks[name]
        reach = 3.2 + (1.1 if wreck.lean_deg else 0.0)
        for u in us:
            v = -wreck.depth_m / 2
            foot, head = wreck.frame.at(u, v - reach), wreck.frame.at(u, v - (0.75 if wreck.lean_deg else 0.1))
            z0, z1 = site.ground_z(*foot), site.ground_z(*wreck.frame.at(u, 0.0)) + 5.4
            timber.append(sweep(path=[(*foot, z0 - 0.2), (*head, z1)], section=(0.2, 0.24)))
            low = wreck.frame.at(u, v - 0.25)
            tie = [(*wreck.frame.at(u, v - reach * 0.55), z0 + 2.2), (*low, z0 + 2.3)]
            timber.append(sweep(path=tie, section=(0.14, 0.16)))
            site.occupy(LineString([foot, head]).buffer(0.3))
    site.add("shores", "shores", [("wood", merge(timber))])
