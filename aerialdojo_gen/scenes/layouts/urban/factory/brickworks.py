"""A brickworks: a clay pit, a press house, open drying sheds, a ring kiln with its firing floor, stacked bricks."""

from __future__ import annotations

import numpy as np
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_scatter import smooth_path
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.kit.structures import Parts, block, stairs
from aerialdojo_gen.scenes.layouts.urban.factory.plant import gallery
from aerialdojo_gen.scenes.layouts.urban.parts.earthworks import grid_terrain, ramped, roughened, shaped
from aerialdojo_gen.scenes.layouts.urban.parts.halls import Hall, flat_roof, gable_roof, open_shed, put_up_hall
from aerialdojo_gen.scenes.layouts.urban.parts.industry import guard_rails, plates, posts, track
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site

FLOOR_M = 3.8
_PIT = rectangle(11, 4.5, 45.5, 39.5)
_KILN = LineString([(-27.5, 5.5), (-6.5, 5.5)]).buffer(6.8, quad_segs=5)


def build_brickworks(site: Site, sign: str) -> None:
    """Build the works on a site of 96 by 84 m."""
    _ground(site)
    _kiln(site)
    _sheds(site)
    _press_house(site, sign)
    _stacks(site)
    _edges(site)


def _ground(site: Site) -> None:
    terrain = grid_terrain(site.recipe.size_m, 1.5)
    terrain = roughened(terrain, _PIT.buffer(-4), 0.12, site.rng_for("clay"))
    terrain = shaped(terrain, _PIT, [(0, 0), (3, -2.6), (6, -2.6), (9, -5.4)])
    terrain = ramped(terrain, (10.0, 9.5, 0.0), (33.0, 9.5, -5.4), 4.6, 1.6)
    terrain = terrain.flattened(rectangle(30, 8, 35, 17), -5.4, 1.0)
    site.set_ground(terrain, site.material("yard", "dirt:#a0705a"))
    clay = site.material("clay", "mud:#9a5f45")
    site.paint(_PIT, clay)
    haul = site.material("haul", "gravel:#b59c86")
    site.paint(ribbon([(10, 9.5), (33, 9.5)], 4.2), haul)
    for path in (
        [(4, -45), (4, 9.5), (12, 9.5)],
        [(4, -11), (-46, -11)],
        [(4, 14.8), (-42, 14.8), (-42, 40)],
        [(4, 9), (4, 40), (-42, 40)],
    ):
        site.paint(ribbon(smooth_path(path, 2), 5.4), haul)
    site.paint(rectangle(10, -38, 46, -2), site.material("apron", "concrete:#a89f92"))
    site.paint(rectangle(-46, 18, 0.5, 37.5), site.material("store", "cobbles:#978778"))
    site.paint(_KILN.buffer(1.4), "brick:#7d5546")
    site.paint(rectangle(33.5, -41, 46.5, -30), "grass:#71894a")


def _kiln(site: Site) -> None:
    """Put up the ring kiln: a vaulted tunnel about a core, doors all around, a firing floor under an open roof."""
    brick = site.material("kiln", "brick:#9c5238")
    x0, y0, x1, y1 = _KILN.bounds
    doors: list[BaseGeometry] = [
        rectangle(x - 0.9, y0 - 1, x + 0.9, y1 + 1) for x in np.linspace(x0 + 7.2, x1 - 7.2, 5)
    ]
    ring = _KILN.difference(_KILN.buffer(-0.8))
    wall = ring
    for door in doors:
        wall = wall.difference(door)
    core = _KILN.buffer(-3.9)
    top = _KILN.buffer(0.25)
    parts: Parts = [
        (brick, plates(wall, 0.0, 2.5)),
        (brick, plates(ring, 2.5, FLOOR_M - 0.3)),
        ("brick:#7a4434", plates(core, 0.0, FLOOR_M - 0.3)),
        ("brick:#b0765a", plates(top, FLOOR_M - 0.3, FLOOR_M)),
    ]
    arches = [
        block(x - 1.15, y - 0.1, x + 1.15, y + 0.1, 2.5, 2.8)
        for d in doors
        for x in (d.centroid.x,)
        for y in (y0 - 0.05, y1 + 0.05)
    ]
    parts.append(("concrete:#c9bba6", merge(arches)))
    piers = [
        block(x - 0.35, y - 0.35, x + 0.35, y + 0.35, 0.0, FLOOR_M - 0.5)
        for x in np.linspace(x0 + 9.3, x1 - 9.3, 4)
        for y in (y0 - 0.2, y1 + 0.2)
    ]
    parts.append((brick, merge(piers)))
    holes = [(float(x), y) for x in np.arange(x0 + 8, x1 - 7.5, 2.0) for y in (2.2, 8.8)]
    parts.append(("iron", posts(holes, FLOOR_M, FLOOR_M + 0.14, 0.3)))
    gap = rectangle(x0 + 1, y0 - 1, x0 + 3.4, y1 + 1).union(rectangle(x1 - 9.2, y0 - 1.0, x1 - 7.6, y0 + 1.0))
    parts += guard_rails(top.buffer(-0.15).exterior.difference(gap), FLOOR_M, material="iron", toe=None, post_m=3.0)
    site.add(None, "ring_kiln", parts)
    site.occupy(wall.buffer(0.1), 0.0, FLOOR_M - 0.3)
    site.occupy(core, 0.0, FLOOR_M - 0.3)
    site.add(
        None,
        "flight_of_stairs",
        stairs((x1 - 8.4, y0 - 5.6), 90.0, 1.2, FLOOR_M, 5.6, tread="planks", stringer="wood"),
    )
    site.occupy(rectangle(x1 - 9.2, y0 - 6.2, x1 - 7.6, y0 + 0.6), 0.0, FLOOR_M + 1.0)
    open_shed(
        site,
        x0 + 3.0,
        y0 + 1.2,
        x1 - 3.0,
        y1 - 1.2,
        3.0,
        3.0,
        site.material("kiln_roof", "roof_tiles:#8f4f3a"),
        z=FLOOR_M,
        post_m=5.6,
    )
    flue: Parts = [(brick, block(-38.0, 4.6, x0 + 0.2, 6.4, 0.0, 1.6))]
    site.add(None, "flue", flue, footprint=rectangle(-38.0, 4.6, x0, 6.4))


def _sheds(site: Site) -> None:
    roof = site.material("shed_roof", "roof_tiles:#a8604a")
    for k, y in enumerate((-38.6, -29.6, -20.6)):
        open_shed(site, -44.0, y, -9.0, y + 5.6, 2.9, 1.9, roof, post_m=5.0)
        racks: Parts = []
        for x in np.arange(-42.6, -11.0, 5.83):
            if (int(x) + k) % 3 == 0:
                continue
            rows = [
                block(float(x) + 0.9, y + 0.9 + v, float(x) + 4.2, y + 1.7 + v, 0.3 + 0.42 * j, 0.58 + 0.42 * j)
                for v in (0.0, 3.0)
                for j in range(4)
            ]
            legs = posts([(float(x) + u, y + 1.3 + v) for u in (1.0, 4.1) for v in (0.0, 3.0)], 0.0, 2.1, 0.14)
            racks += [(site.material("green_brick", "brick:#b0846a"), merge(rows)), ("wood", legs)]
            for v in (0.0, 3.0):
                site.occupy(rectangle(float(x) + 0.7, y + 0.8 + v, float(x) + 4.4, y + 1.8 + v), 0.0, 2.2)
        site.add(None, "drying_rack", racks)


def _press_house(site: Site, sign: str) -> None:
    press = Hall(
        14.0,
        -24.0,
        33.0,
        -8.0,
        7.0,
        site.material("hall", "brick:#a55f45"),
        site.material("hall_roof", "corrugated:#6f7672"),
        {
            "w": ((5.0, 9.5, 0.0, 4.4),),
            "s": ((3.0, 7.0, 0.0, 4.2), (12.0, 16.0, 0.0, 4.2)),
            "e": ((6.0, 10.0, 0.0, 4.2),),
        },
        base="blocks:#8a8074",
    )
    put_up_hall(site, press, "press_house", gable_roof(press, 3.4), name=sign, sign_side="w", letter_m=0.9)
    engine = Hall(
        36.0,
        -16.5,
        45.0,
        -6.5,
        4.2,
        "brick:#b0704f",
        "gravel:#a39a8c",
        {"w": ((3.5, 6.5, 0.0, 3.2),)},
        base="blocks:#8a8074",
    )
    put_up_hall(site, engine, "engine_house", flat_roof(engine, 0.5))
    gallery(site, (22.0, 3.4, 0.4), (23.2, -8.0, 5.2), "corrugated:#7a6a58", wide_m=2.0, high_m=2.2, legs=(0.6,))
    building(
        site,
        rectangle(35, -40, 45, -32),
        wall=site.material("office", "facade_brick:#a0604a"),
        roof="gravel:#b0a696",
        storeys=2,
        storey_m=3.0,
        category="office_block",
        parapet_m=0.5,
    )
    track(site, [(-45, -7.6), (12.5, -7.6)], gauge_m=0.9)


def _stacks(site: Site) -> None:
    """Set rows of fired bricks, in blocks as tall as a person and taller."""
    colours = ("brick:#a8543c", "brick:#b8694a", "brick:#c99a6a")
    rng = site.rng_for("stacks")
    for j, y in enumerate((19.6, 24.2, 29.0, 33.8)):
        for k, x in enumerate((-40.0, -33.5, -27.0, -15.5, -9.0)):
            if (j, k) in ((1, 2), (2, 0), (3, 3)):
                continue
            high = float(rng.choice([1.7, 2.2, 2.7]))
            wide = float(rng.choice([4.0, 4.8]))
            parts: Parts = [(colours[(j + k) % 3], block(x - wide / 2, y - 0.9, x + wide / 2, y + 0.9, 0.0, high))]
            parts.append(
                (
                    colours[(j + k) % 3],
                    block(x - wide / 2 + 0.4, y - 0.6, x + wide / 2 - 1.2, y + 0.6, high, high + 0.35),
                )
            )
            site.add(None, "brick_stack", parts, footprint=rectangle(x - wide / 2, y - 0.9, x + wide / 2, y + 0.9))


def _edges(site: Site) -> None:
    for path in (
        [(-47.4, -41.4), (0.4, -41.4)],
        [(7.6, -41.4), (47.4, -41.4)],
        [(47.4, -41.4), (47.4, 41.4), (-47.4, 41.4), (-47.4, -41.4)],
    ):
        fence(site, path, "board", site.material("fence", "boards:#7d6650"))
    line = LineString([(10.2, 12.6), (10.2, 40.2), (46.2, 40.2), (46.2, 3.8), (24.5, 3.8)])
    site.add(None, "pit_rail", guard_rails(line, 0.0, material="wood", toe=None, post_m=3.0))
