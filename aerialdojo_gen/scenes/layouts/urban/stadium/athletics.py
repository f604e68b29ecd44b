"""An athletics ground: a running track, one roofed stand with a clubhouse, grass banks opposite, a ball court.

The track runs north and south; the stand lies west of it, and behind the stand a forecourt half a storey lower.
"""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import Pose, slab, smooth_path
from aerialdojo_gen.scenes.grammar_streets import parking_row
from aerialdojo_gen.scenes.ground import disc, polygons_of, rectangle, ribbon
from aerialdojo_gen.scenes.kit.parking import park_cars
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns, letters, railing, stairs
from aerialdojo_gen.scenes.layouts.urban.stadium.stand_shells import back_wall, end_walls, platform, roof_parts
from aerialdojo_gen.scenes.layouts.urban.stadium.stands import Tier, gangways, passage, tier_parts
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain

_LINE = LineString([(0, -22), (0, 22)])
_INNER_M, _LANES, _LANE_M = 14.5, 6, 1.1
_OUTER_M = _INNER_M + _LANES * _LANE_M
_FRONT_X, _ROWS = -24.0, 10
_STAND_Y = 27.0
LOW_Z, COURT_Z, TERRACE_Z, ROOF_Z = -2.4, 2.2, 3.8, 9.4


def build_athletics(site: Site) -> None:
    """Build ground, stand, clubhouse, banks, and what stands round them."""
    site.set_ground(_terrain(site.recipe.size_m), site.material("lawn", "grass:#6f9650"))
    _paint(site)
    _stand(site)
    _clubhouse(site)
    _banks(site)
    _edges(site)


def _oval(radius_m: float) -> BaseGeometry:
    return _LINE.buffer(radius_m, quad_segs=12)


def _terrain(size_m: tuple[float, float]) -> Terrain:
    cell = 2.0
    x, y = np.meshgrid(
        np.arange(-size_m[0] / 2, size_m[0] / 2 + 0.1, cell), np.arange(-size_m[1] / 2, size_m[1] / 2 + 0.1, cell)
    )
    away = shapely.distance(_oval(_OUTER_M), shapely.points(np.column_stack([x.ravel(), y.ravel()]))).reshape(x.shape)
    bank = 5.4 * _smooth((away - 3.0) / 10.0) * _smooth((x + 2.0) / 16.0)
    south = COURT_Z * _smooth((-46.0 - y) / 3.0)
    north = 1.8 * _smooth((y - 46.0) / 5.0)
    high = np.maximum(bank, np.maximum(south, north))
    west = _smooth((-42.5 - x) / 3.0)
    return Terrain(-size_m[0] / 2, -size_m[1] / 2, cell, high * (1 - west) + LOW_Z * west)


def _smooth(t: np.ndarray) -> np.ndarray:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _paint(site: Site) -> None:
    paving = site.material("plaza", "paving:#c2b8a6")
    path = site.material("path", "gravel:#b9a98c")
    site.paint(rectangle(-42, -34, -22, 34), paving)
    site.paint(rectangle(-52, -38, -46, 38), paving)
    site.paint(_oval(_OUTER_M + 1.6), site.material("apron", "concrete:#b9b3a6"))
    site.paint(_oval(_OUTER_M), site.material("track", "#b5523c"))
    for k in range(1, _LANES):
        site.paint(_oval(_INNER_M + k * _LANE_M).exterior.buffer(0.05), "marking")
    site.paint(_oval(_INNER_M + 0.12), "marking")
    site.paint(_oval(_INNER_M), site.material("turf", "grass:#57923f"))
    for k in range(0, 9, 2):
        band = rectangle(-_INNER_M, -22 + k * 4.9, _INNER_M, -22 + (k + 1) * 4.9)
        site.paint(band, site.material("turf_light", "grass:#6aa64b"))
    site.paint(rectangle(-_OUTER_M, 13.9, -_INNER_M, 14.1), "marking")
    site.paint(rectangle(-_OUTER_M, -20.1, -_INNER_M, -19.9), "marking")
    # The D at the north end for the high jump, sectors for throws from the south, and the long jump's pit.
    site.paint(_oval(_INNER_M - 1.0).intersection(rectangle(-14, 23, 14, 40)), site.material("track", "#b5523c"))
    for a in (-17.0, 17.0):
        ray = [(0, -26), (40 * np.sin(np.radians(a)), -26 + 40 * np.cos(np.radians(a)))]
        site.paint(ribbon(ray, 0.12), "marking")
    site.paint(disc(0, -26, 1.4, 20), "concrete")
    site.paint(rectangle(10.6, -6, 12.0, 18), site.material("track", "#b5523c"))
    site.paint(rectangle(10.0, -14, 12.6, -6), "sand")
    court = rectangle(-22, -57, 2, -49.4)
    site.paint(court, site.material("court", "#3f6f8a"))
    site.paint(court.buffer(-0.4).exterior.buffer(0.05), "marking")
    site.paint(rectangle(-10.05, -56.6, -9.95, -49.8), "marking")
    hoops = rectangle(-41.4, 33.5, -29.8, 44.5)
    site.paint(hoops, site.material("hoop_court", "#a0623f"))
    arcs = [disc(x, 39, 3.4, 24).exterior.buffer(0.05).intersection(hoops) for x in (-40.6, -30.6)]
    for mark in (hoops.buffer(-0.4).exterior.buffer(0.05), rectangle(-35.65, 34, -35.55, 44), *arcs):
        site.paint(mark, "marking")
    site.paint(rectangle(8, -57, 24, -49.6), site.material("play", "sand:#d8c08a"))
    for line in ([(-24, 36), (-10, 44), (14, 47), (36, 40), (45, 18), (46, 0), (45, -20), (34, -42), (10, -47),
                  (-12, -46), (-30, -40), (-30, -34)],):  # fmt: skip
        site.paint(ribbon(smooth_path(line, 2), 2.4, round_ends=True), path)


def _tier() -> Tier:
    portals = tuple(passage(Pose(_FRONT_X, y, 180.0), 3.0, 6.0) for y in (-15.0, 0.0, 15.0))
    clear = tuple(area.buffer(0.35) for area, _, _ in _platforms())
    return Tier(
        rectangle(_FRONT_X, -90, 90, 90), 0.0, _ROWS, 1.4, riser_m=0.45, head_m=2.9,
        region=rectangle(-60, -_STAND_Y, 0, _STAND_Y), portals=portals, clear=clear,
    )  # fmt: skip


def _platforms() -> list[tuple[Polygon, float, float]]:
    mid = [(rectangle(-28.25, y - 1.8, -25.7, y + 1.8), 1.5, 3.65) for y in (-22.0, -8.0, 8.0, 22.0)]
    return mid + [(rectangle(-32.45, y - 1.8, -29.95, y + 1.8), 3.0, 5.45) for y in (-15.0, 0.0, 15.0)]


def _stand(site: Site) -> None:
    tier = _tier()
    concrete, step = site.material("terrace", "concrete:#bdb8ac"), site.material("steps", "concrete:#dedacf")
    colours = [site.material("seats", "#3f7d4e"), site.material("seats_two", "#e9b52a")]

    def seat(x: float, y: float, row: int) -> str:
        return colours[abs(int(y // 9.0) + row // 5) % 2]

    parts = tier_parts(tier, gangways(tier, 9.0), concrete=concrete, step=step, seat=seat)
    ends = [rectangle(-60, s * _STAND_Y, 0, s * (_STAND_Y - 0.25)) for s in (-1, 1)]
    parts += [(concrete, end_walls(tier, end)) for end in ends]
    gates = [passage(Pose(-32.5, y, 180.0), 3.2, 2.0) for y in (-22.0, -15.0, 0.0, 15.0, 22.0)]
    wall = site.material("wall", "blocks:#b9a98c")
    parts += back_wall(tier, 6.5, gates, 3.2, wall=wall, band=site.material("band", "#3f7d4e"))
    site.add(
        "main_stand",
        "grandstand",
        parts,
        {"material": "concrete"},
        footprint=tier.plan.difference(unary_union(tier.portals)),
    )
    decks: Parts = []
    for area, foot, z in _platforms():
        decks += platform(area, foot, z, floor=concrete, rim="marking_yellow")
    site.add("platforms", "platform", decks)
    roof = roof_parts(
        Frame(-33.4, 0.0, 0.0), 2 * _STAND_Y, 11.0, ROOF_Z, foot_m=0.0, bay_m=7.6, rise_m=2.0,
        roof=site.material("roof", "corrugated:#4f7d5a"), truss=site.material("truss", "#e9e4d6"),
        fascia=site.material("band", "#3f7d4e"),
    )  # fmt: skip
    roof.append(("marking", letters("RIVERSIDE ATHLETICS", 0.5, (-22.27, 0.0, ROOF_Z), 0.0, 0.06)))
    site.add("main_stand_roof", "stand_roof", roof, {"material": "metal"})


def _clubhouse(site: Site) -> None:
    wall, trim = site.material("club_wall", "planks:#c9b48a"), site.material("band", "#3f7d4e")
    parts: Parts = []
    for a, b in ((-20.0, -4.0), (4.0, 20.0)):
        parts += [
            (wall, block(-41.0, a, -34.6, b, 0.0, TERRACE_Z - 0.3)),
            ("curtain_wall", block(-41.06, a + 1.0, -41.0, b - 1.0, 0.5, 3.0)),
            ("curtain_wall", block(-34.6, a + 1.0, -34.54, b - 1.0, 0.8, 2.8)),
        ]
    floor = rectangle(-41.4, -20.4, -34.2, 20.4)
    parts.append(("boards:#a08a6a", slab(floor, TERRACE_Z - 0.3, TERRACE_Z)))
    parts += railing([(-34.3, -20.3), (-41.3, -20.3), (-41.3, 20.3), (-34.3, 20.3)], TERRACE_Z)
    parts.append((trim, columns([(-41.0, y) for y in (-3.6, 3.6)], 0.0, TERRACE_Z - 0.3, 0.2)))
    parts.append(("marking", letters("CLUBHOUSE", 0.55, (-41.42, 0.0, TERRACE_Z - 0.95), 180.0, 0.08)))
    parts.append((trim, block(-41.42, -4.0, -41.3, 4.0, TERRACE_Z - 1.1, TERRACE_Z)))
    rooms = unary_union([rectangle(-41, -20, -34.6, -4), rectangle(-41, 4, -34.6, 20)])
    site.add("clubhouse", "clubhouse", parts, {"material": "wooden"}, footprint=rooms)
    flight: Parts = []
    for y in (-26.0, 0.0, 26.0):
        flight += stairs((-46.4, y), 0.0, 4.0, -LOW_Z + 0.05, 4.6, z_m=LOW_Z)
    site.add("forecourt_stairs", "stairs", flight, {"material": "concrete"})


def _banks(site: Site) -> None:
    """Set the bank's steps: low timber walls that follow the curve of the track."""
    kerbs = []
    for away in (5.2, 7.4, 9.6, 11.8):
        ring = _oval(_OUTER_M + away).exterior.intersection(rectangle(14, -44, 60, 44))
        for leg in getattr(ring, "geoms", [ring]):
            line = [leg.interpolate(s) for s in np.arange(0.0, leg.length, 2.0)]
            runs: list[list[tuple[float, float, float]]] = [[]]
            for p in line:
                if any(abs(p.y - y) < 1.6 for y in (-24.0, 0.0, 24.0)):
                    runs.append([])
                else:
                    runs[-1].append((p.x, p.y, site.ground_z(p.x, p.y) + 0.15))
            kerbs += [sweep(path=run, section=(0.3, 0.7)) for run in runs if len(run) > 1]
    site.add("bank_steps", "bank_steps", [(site.material("sleepers", "planks:#8a6a48"), merge(kerbs))])
    spots = (
        (51, -34), (52, -22), (52, -10), (50.4, 3), (51.5, 14), (51, 25), (49, 36), (40, 47), (27, 53),
        (12, 55), (-3, 55), (-18, 54), (-30, 52), (40, -47), (32, -54),
    )  # fmt: skip
    for k, (x, y) in enumerate(spots):
        site.try_place(("oak_tree", "urban_tree", "birch_tree")[k % 3], float(x), float(y), 47.0 * k)


def _edges(site: Site) -> None:
    wall = site.material("wall", "blocks:#b9a98c")
    runs = [rectangle(-53.6, -59, -53.2, -20), rectangle(-53.6, -13, -53.2, 6), rectangle(-53.6, 13, -53.2, 59)]
    parts: Parts = [(wall, merge([slab(p, LOW_Z, LOW_Z + 2.3) for p in runs]))]
    parts.append(
        ("concrete", merge([slab(p.buffer(0.08, join_style="mitre"), LOW_Z + 2.3, LOW_Z + 2.45) for p in runs]))
    )
    for y in (-20.0, -13.0, 6.0, 13.0):
        parts.append((wall, block(-53.8, y - 0.5, -53.0, y + 0.5, LOW_Z, LOW_Z + 3.2)))
    site.add("forecourt_wall", "wall", parts, {"material": "stone"}, footprint=unary_union(runs))
    for points in (
        [(-22.4, -57.4), (-22.4, -49.0)],
        [(2.4, -49.0), (2.4, -57.4), (-22.4, -57.4)],
        [(7.6, -57.4), (24.4, -57.4), (24.4, -49.2)],
    ):
        fence(site, points, "board" if points[0][0] > 5 else "railing")
    rail = [(float(x), float(y)) for x, y in _oval(_OUTER_M + 1.5).exterior.simplify(0.05).coords]
    ring = _oval(_OUTER_M + 1.56).difference(_oval(_OUTER_M + 1.44))
    keep = polygons_of(ring.intersection(rectangle(-2, -46, 30, 46)))
    rails: Parts = [("#f1f0ea", merge([slab(p, 0.95, 1.05) for p in keep] + [slab(p, 0.5, 0.56) for p in keep]))]
    posts = [(x, y) for x, y in rail if x > -2]
    rails.append(("#f1f0ea", columns(posts, 0.0, 1.0, 0.06, 6)))
    site.add("track_railing", "track_railing", rails)
    bays = []
    for y in (-28.0, 26.0):
        site.paint(rectangle(-52.6, y - 9.4, -46.4, y + 9.4), "asphalt")
        bays += parking_row(site, -52.4, y, 180.0, 7, bay_m=(2.6, 4.8))
    park_cars(site, bays, 0.5, "in the forecourt")
    for variant, x, y, yaw in (
        ("grey", -27.0, 36.0, -60.0),
        ("white", -27.0, -36.5, 60.0),
        ("grey", 29.5, 33.0, -135.0),
        ("green", 29.5, -33.0, 135.0),
    ):
        site.place("floodlight_mast", x, y, yaw, variant=variant, params={"h": 14.0})
