"""A street on a slope after a blast: crater in the carriageway, torn fronts on both sides, a cordon at its ends.

The street runs from west (low) to east (high); a park lies south of its eastern half.
"""

from __future__ import annotations

import numpy as np
from shapely.geometry import Polygon
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_streets import crossing, streets
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.layouts.disaster.explosion.industry import pipe_bridge, twisted_steel
from aerialdojo_gen.scenes.layouts.disaster.explosion.street_things import furnish_street
from aerialdojo_gen.scenes.layouts.disaster.parts.buildings import put_up
from aerialdojo_gen.scenes.layouts.disaster.parts.ground import (
    cracks,
    crater,
    heaped,
    slab_pile,
    sloped,
    strew_chunks,
)
from aerialdojo_gen.scenes.layouts.disaster.parts.wreckage import Bite
from aerialdojo_gen.scenes.layouts.disaster.parts.wrecks import Style, Wreck
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import rolling_terrain

BLAST = (-3.0, 1.0)


def build_street(site: Site, crater_m: float, litter: float) -> None:
    """Build the street and what the blast left of it."""
    wrecks = _fronts(site)
    heaps = _heaps(site.recipe.seed)
    _ground(site, crater_m, wrecks, heaps)
    bases = {}
    for name, wreck in wrecks.items():
        bases[name] = site.ground_z(wreck.frame.x, wreck.frame.y)
        put_up(site, wreck, bases[name], node=name)
    pile = slab_pile(site, 9.5, -17.5, 2.0, (15.0, 10.5), 5, "south", wall=site.material("bank", "tiles:#b9b4a6"))
    deck = max(site.ground_z(19.0, 9.0), site.ground_z(19.0, -9.0)) + 5.6
    pipe_bridge(site, (19.0, 10.6), (19.0, -13.0), deck, (0.4, 0.62), "footbridge", 2.4, False, "broken_footbridge")
    _lamps(site)
    furnish_street(site, wrecks, bases, pile, deck)
    twisted_steel(site, [(4.0, 6.0, 3.6), (-9.5, -5.0, 4.2), (7.0, -8.4, 3.4), (-11.5, 5.6, 3.8), (12.5, 2.0, 4.0)],
                  "street")  # fmt: skip
    brick = site.material("shops", "brick:#7d4538")
    for k, (area, _) in enumerate(heaps):
        strew_chunks(site, area.buffer(2.0), 1.0 / litter, f"heap{k}", brick=brick)
    asphalt = "asphalt:#46474a"
    strew_chunks(site, disc(*BLAST, 12.0), 1.3 / litter, "ejecta", plate=asphalt, lump="dirt:#6a543e", brick=brick)
    strew_chunks(site, rectangle(-34.0, -10.0, 34.0, 10.5), 2.6 / litter, "road", plate=asphalt, brick=brick,
                 size_m=(0.3, 1.0))  # fmt: skip


def _fronts(site: Site) -> dict[str, Wreck]:
    office = Style(wall=site.material("office", "tiles:#a9b7bd"), band="#5b6468", storey_m=3.5, bay_m=3.3,
                   window_m=(2.1, 0.8, 2.7), panes=0.18, soot=0.25, shops=True)  # fmt: skip
    shops = Style(wall=site.material("shops", "brick:#7d4538"), band="stone", storey_m=3.4, bay_m=3.0, panes=0.2,
                  soot=0.45, shops=True, wall_m=0.36)  # fmt: skip
    hotel = Style(wall=site.material("hotel", "plaster:#d9c58f"), band="#8a3f35", storey_m=3.2, bay_m=3.1, panes=0.2,
                  soot=0.3, shops=True)  # fmt: skip
    plain = Style(wall=site.material("flats", "plaster:#b8c0a8"), band="concrete", panes=0.45, soot=0.1)
    return {
        "office": Wreck(Frame(-19.0, 18.0), 25.0, 12.0, 5, office,
                        (Bite(12.5, -6.0, 4.0, 8.5, seed=81), Bite(-6.0, -7.0, 0.6, 3.6, 8.0, seed=82))),
        "store": Wreck(Frame(8.0, 17.5), 27.0, 12.0, 4, shops,
                       (Bite(-8.0, -7.0, 5.0, 9.0, seed=83), Bite(9.0, -6.5, 1.0, 4.0, 4.5, seed=84))),
        "east_flats": Wreck(Frame(32.0, 18.0), 18.0, 11.0, 3, plain, (Bite(-8.0, -5.0, 0.8, 4.0, 4.0, seed=85),),
                            balconies=True),
        "hotel": Wreck(Frame(-16.5, -17.0, 180.0), 28.0, 12.0, 4, hotel,
                       (Bite(-11.0, -6.5, 5.0, 9.5, seed=86), Bite(9.0, -6.0, 0.6, 3.0, 7.0, seed=87)),
                       balconies=True),
        "west_flats": Wreck(Frame(-46.5, 17.0, -90.0), 20.0, 10.0, 4, plain,
                            (Bite(-8.0, -5.0, 0.5, 3.0, 7.0, seed=88),)),
        "corner_shop": Wreck(Frame(-46.0, -17.0, 90.0), 18.0, 10.0, 2, shops,
                             (Bite(7.0, -4.0, 1.5, 4.0, seed=89),),
                             ridge_m=3.0),
        "row_house": Wreck(Frame(-10.0, -35.5), 22.0, 8.0, 2, plain, ridge_m=2.6),
        "back_house": Wreck(Frame(2.0, 35.5, 180.0), 30.0, 8.0, 3, plain,
                            (Bite(-10.0, -3.0, 0.6, 3.0, 6.0, seed=91),)),
    }  # fmt: skip


def _heaps(seed: int) -> list[tuple[Polygon, float]]:
    spots = ((-6.5, 11.5, 5.0, 2.1), (0.5, 9.6, 5.4, 2.3), (-5.0, -10.6, 5.4, 2.3), (9.5, -11.2, 4.6, 1.6),
             (18.6, 13.0, 2.6, 1.0), (23.4, -6.0, 3.0, 0.8), (-24.6, 10.4, 2.6, 0.9))  # fmt: skip
    return [(blob(x, y, r, seed + k, 0.3), h) for k, (x, y, r, h) in enumerate(spots)]


def _ground(site: Site, crater_m: float, wrecks: dict[str, Wreck], heaps: list[tuple[Polygon, float]]) -> None:
    ground = rolling_terrain(site.recipe.size_m, 1.7, site.recipe.seed, 0.2, 24.0, octaves=2)
    ground = sloped(ground, [(-60.0, -6.0, 2.2), (-10.0, 55.0, 3.6)], 0)
    ground = sloped(ground, [(-40.0, -10.0, 1.4)], 1)
    for wreck in wrecks.values():
        ground = ground.flattened(wreck.frame.area(wreck.plan), blend_m=2.2)
    ground = crater(ground, *BLAST, crater_m, 2.8, 0.7, site.recipe.seed)
    for k, (area, height) in enumerate(heaps):
        ground = heaped(ground, area, height, site.recipe.seed + k)
    site.set_ground(ground, site.material("yard", "gravel:#8f897e"))
    site.paint(rectangle(21.5, -40.0, 55.0, -9.5), site.material("park", "grass:#6f8a4a"))
    site.paint(rectangle(-34.0, 24.5, 24.0, 31.0), site.material("park", "grass:#6f8a4a"))
    streets(site, [[(-36.5, -44), (-36.5, 44)], [(-57, 0.5), (57, 0.5)]], lanes=4, lane_m=2.9, pavement_m=3.4)
    for x in (-28.0, 28.0):
        crossing(site, x, 0.5, 90.0, 11.0, 3.0)
    site.paint(disc(34.0, -22.0, 6.4, 28), site.material("path", "gravel:#c4b692"))
    for line in (
        rectangle(21.5, -22.8, 30.0, -21.2),
        rectangle(33.2, -40.0, 34.8, -9.5),
        rectangle(38.0, -22.8, 55, -21.2),
    ):
        site.paint(line, site.material("path", "gravel:#c4b692"))
    seed = site.recipe.seed
    site.paint(blob(*BLAST, crater_m * 2.7, seed, 0.4), "asphalt:#3a3a3b")
    rng = site.rng_for("rays")
    rays = []
    for _ in range(24):
        a, r = float(rng.uniform(0, 2 * np.pi)), crater_m * float(rng.uniform(2.4, 4.2))
        w = float(rng.uniform(0.06, 0.15))
        rays.append(Polygon([(BLAST[0] + q * float(np.cos(b)), BLAST[1] + q * float(np.sin(b)))
                             for q, b in ((crater_m, a - w), (r, a), (crater_m, a + w))]))  # fmt: skip
    site.paint(unary_union(rays), "asphalt:#303031")
    site.paint(blob(*BLAST, crater_m * 1.6, seed + 1, 0.35), "dirt:#6a543e")
    site.paint(blob(*BLAST, crater_m * 0.95, seed + 2, 0.15), "mud:#4d4032")
    # The main under the street burst: its water stands in the crater.
    site.paint(blob(BLAST[0] + 0.4, BLAST[1] - 0.3, crater_m * 0.42, seed + 3, 0.2), "water:#5d6a62")
    cracks(
        site,
        [(-9.0, 2.0, 170.0), (4.0, -1.0, -10.0), (0.0, 6.0, 60.0), (-8.0, -3.0, 220.0), (3.0, 4.0, 30.0)],
        8.0,
        3,
    )
    for area, _ in heaps:
        site.paint(area, site.material("heap", "rubble:#9d9184"))


def _lamps(site: Site) -> None:
    """Bend the street's lamps away from the blast, and lay the pipes of the main bare in the crater."""
    bodies, heads = [], []
    for x in (-31.0, -22.0, -13.0, 7.5, 15.0, 24.5, 33.0):
        for y in (-6.9, 7.9):
            away = np.array([x - BLAST[0], y - BLAST[1]])
            d = float(np.hypot(*away))
            lean = 5.5 * float(np.exp(-((d / 12.0) ** 2)))
            if d < 9.0:
                continue
            u = away / d
            z = site.ground_z(x, y) - 0.2
            path = [(x, y, z), (x + 0.1 * lean * u[0], y + 0.1 * lean * u[1], z + 3.0),
                    (x + 0.55 * lean * u[0], y + 0.55 * lean * u[1], z + 6.2 - 0.3 * lean),
                    (x + (lean + 0.4) * u[0], y + (lean + 0.4) * u[1], z + 7.4 - 0.75 * lean)]  # fmt: skip
            bodies.append(sweep(path=path, radius=0.09, sides=6))
            end = path[-1]
            heads.append(
                sweep(path=[end, (end[0] + 0.7 * u[0], end[1] + 0.7 * u[1], end[2] - 0.1)], section=(0.3, 0.14))
            )
            site.occupy(disc(x, y, 0.4, 8))
    z = site.ground_z(*BLAST) + 0.9
    main = []
    for side in (-1, 1):
        path = [(BLAST[0] + side * 5.6, BLAST[1] + 0.6, z), (BLAST[0] + side * 2.2, BLAST[1] + 0.4, z - 0.1),
                (BLAST[0] + side * 1.5, BLAST[1] + 0.2, z + 0.35 * side)]  # fmt: skip
        main.append(sweep(path=path, radius=0.32, sides=10))
    site.add("bent_lamps", "bent_lamps", [("#4a5055", merge(bodies)), ("#c9cdc8", merge(heads))])
    site.add("water_main", "water_main", [("rust", merge(main))])
