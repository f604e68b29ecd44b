"""A cliff coast: a fishing cove and its harbour, a village that climbs a valley, two headlands, fields on the cliffs.

The sea lies in the west; the cove opens between the headlands, the valley rises from its head to the east.
"""

from __future__ import annotations

import numpy as np
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle, house
from aerialdojo_gen.scenes.grammar_scatter import smooth_path
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.layouts.natural.coast.cove_things import GROUPS
from aerialdojo_gen.scenes.layouts.natural.parts.quays import bars, field_wall, flight, mole, pier
from aerialdojo_gen.scenes.layouts.natural.parts.shore import (
    boulders,
    broadleaves,
    inland_m,
    paint_sea,
    ragged,
    rise,
    settle,
    shaped,
    steep_area,
)
from aerialdojo_gen.scenes.layouts.natural.parts.woods import patches, strew
from aerialdojo_gen.scenes.mesh import Floats
from aerialdojo_gen.scenes.site import Site

PLATEAU_M, QUAY_M = 11.5, 1.8
_COAST = [
    (80, 70), (-24, 70), (-32, 48), (-42, 38), (-42, 26), (-32, 19), (-18, 17), (-6, 13), (2, 7), (5, 0), (4, -7),
    (-2, -13), (-14, -16), (-28, -18), (-38, -23), (-45, -34), (-38, -46), (-30, -70), (80, -70),
]  # fmt: skip
_LIGHTHOUSE, _LOOKOUT = (-33.0, 33.0), (-36.0, -33.0)
# Houses: where, where the door looks, storeys, wall; they stand on steps cut into the valley's sides.
_HOUSES = (
    (16.0, 8.6, -100.0, 2, "plaster:#efe9dc"),
    (25.5, 9.6, -90.0, 2, "plaster:#e6c9b0"),
    (35.5, 10.4, -85.0, 1, "stone"),
    (15.0, -11.4, 95.0, 2, "plaster:#cfdbe0"),
    (24.5, -12.6, 90.0, 1, "plaster:#efe9dc"),
    (34.0, -13.4, 85.0, 2, "plaster:#e9d69e"),
    (21.0, 20.0, -90.0, 1, "plaster:#dfe6d6"),
    (31.0, 21.0, -90.0, 1, "plaster:#efe9dc"),
)
_STREET = [(6.5, -1.0), (14, -1.5), (24, -0.5), (36, -1.5), (48, -3), (66, -2)]
_PATHS: list[list[tuple[float, float]]] = [
    [(38, -1.5), (40, 8), (38, 16), (28, 15.6), (18, 15.2)],
    [(18, 15.2), (6, 19), (-8, 24), (-20, 27), (-29, 31)],
    [(40, -2), (42, -14), (34, -22), (16, -23), (0, -24), (-16, -26), (-31, -32)],
    [(28, 15.6), (30, 28), (34, 42), (36, 60)],
]


def build_cove(site: Site) -> None:
    """Build the cove."""
    land = ragged(_COAST, site.recipe.seed, 1.5, 2.2)
    street, paths = smooth_path(_STREET), [smooth_path(p) for p in _PATHS]
    _ground(site, land, street, paths)
    _paint(site, land, street, paths)
    for path in (street, *paths):
        site.occupy(ribbon(path, 1.6))
    _harbour(site)
    _village(site)
    for place, things in GROUPS.items():
        settle(site, place, things)
    _rocks(site, land)
    _green(site, land)


def _ground(
    site: Site, land: BaseGeometry, street: list[tuple[float, float]], paths: list[list[tuple[float, float]]]
) -> None:
    def height(x: Floats, y: Floats, noise: Floats) -> Floats:
        inland = inland_m(land, x, y)
        top = PLATEAU_M + 1.3 * noise + 2.0 * rise(x, 20.0, 60.0)
        axis = -1.0 - 2.0 * rise(x, 30.0, 60.0)
        floor = 1.6 + 0.155 * np.clip(x - 8.0, 0.0, 60.0) + 0.2 * noise * rise(x, 10.0, 20.0)
        half = 5.5 + 0.05 * np.clip(x - 4.0, 0.0, 60.0)
        valley = rise(np.abs(y - axis), half, half + 15.0 + 0.1 * np.clip(x, 0.0, 60.0))
        z = floor + (np.maximum(top, floor) - floor) * valley
        # The beach fans out at the cove's head; elsewhere the cliff rises from the water.
        head = 1.0 - rise(np.hypot(x - 6.0, y + 1.0), 9.0, 14.0)
        shelf = head * rise(inland, 0.0, 9.0) * (z / np.maximum(z, 0.1)) * 1.6
        cliff = z * rise(inland, -0.6, 5.2 + 1.2 * noise)
        z = np.where(head > 0.0, shelf * head + cliff * (1.0 - head), cliff)
        return np.where(inland > 0.0, np.maximum(z, 0.05), 0.0)

    ground = shaped(site, 1.5, 24.0, height)
    ground = ground.graded(street, 3.2, blend_m=2.5, smooth_m=9.0)
    for path in paths:
        ground = ground.graded(path, 1.4, blend_m=2.0, smooth_m=9.0)
    for x, y, _, storeys, _ in _HOUSES:
        ground = ground.flattened(disc(x, y, 4.2 if storeys == 2 else 4.0), blend_m=2.6)
    ground = ground.flattened(disc(*_LIGHTHOUSE, 5.6), blend_m=3.0)
    ground = ground.flattened(disc(*_LOOKOUT, 4.0), blend_m=3.0)
    ground = ground.flattened(rectangle(3.6, -12.0, 8.0, 7.6).intersection(land.buffer(-0.4)), 1.5, blend_m=2.0)
    site.set_ground(ground, site.material("turf", "grass:#6f8f4a"))


def _paint(
    site: Site, land: BaseGeometry, street: list[tuple[float, float]], paths: list[list[tuple[float, float]]]
) -> None:
    seed = site.recipe.seed
    fields = (
        (rectangle(40, 10, 60, 36), "meadow:#9aa04c"), (rectangle(6, 30, 27, 53), "meadow:#b5a95a"),
        (rectangle(44, -46, 60, -14), "dirt:#8a6b48"), (rectangle(2, -46, 28, -30), "meadow:#93a252"),
    )  # fmt: skip
    for area, material in fields:
        site.paint(area, material)
    spots = ((-30, 42, 9), (-24, 28, 9), (-30, -40, 9), (-18, -30, 8), (-36, -30, 8), (-6, 24, 6), (-4, -26, 6))
    heath = [blob(x, y, r, seed + 20 + k, 0.3) for k, (x, y, r) in enumerate(spots)]
    for area in heath:
        site.paint(area.intersection(land), site.material("heath", "meadow:#858a52"))
    rock = site.material("cliff", "rock:#8f8578")
    site.paint(land.difference(land.buffer(-2.6)), rock)
    site.paint(steep_area(site.terrain, 37.0).intersection(land), rock)
    beach = Point(5.0, -1.0).buffer(12.5).intersection(land).intersection(rectangle(-20, -15, 9.5, 14))
    site.paint(beach, site.material("shingle", "gravel:#b8ab94"))
    paint_sea(site, land, 7.0)
    for path in paths:
        site.paint(ribbon(path, 1.5, round_ends=True), site.material("path", "dirt:#a48c66"))
    site.paint(ribbon(street, 4.2, round_ends=True), site.material("street", "cobbles:#8f8a82"))
    site.paint(blob(13.0, -1.2, 4.6, seed + 8, 0.1), site.material("square", "cobbles:#a39c90"))
    for k, (x, y, _, _, _) in enumerate(_HOUSES):
        site.paint(blob(x, y, 5.8, seed + 40 + k, 0.15), site.material("garden", "grass:#7d9c50"))
    for at in (_LIGHTHOUSE, _LOOKOUT):
        site.paint(blob(*at, 6.4, seed + 60, 0.15), site.material("lawn", "grass:#84a054"))


def _harbour(site: Site) -> None:
    mole(site, [(-9.0, 17.5), (-10.5, 8.0), (-8.5, 0.5)], 4.2, QUAY_M + 0.4)
    mole(site, [(-12.0, -18.0), (-12.0, -9.5)], 3.8, QUAY_M + 0.4)
    pier(
        site,
        Frame(4.0, 6.2, 180.0),
        11.0,
        2.6,
        QUAY_M,
        bay_m=3.6,
        rail=None,
        floor="boards:#8d816e",
        category="jetty",
    )
    pier(
        site,
        Frame(3.0, -10.4, 180.0),
        9.0,
        2.4,
        QUAY_M,
        bay_m=3.0,
        rail=None,
        floor="boards:#8d816e",
        category="jetty",
    )
    top = site.ground_z(-17.5, 24.6)
    flight(site, (-11.4, 16.6), 128.0, 1.8, QUAY_M + 0.4, top, 10.2, tread="stone", stringer="stone")


def _village(site: Site) -> None:
    for k, (x, y, yaw, storeys, wall) in enumerate(_HOUSES):
        style = HouseStyle(
            width_m=7.2, depth_m=5.8, storeys=storeys, storey_m=2.6, wall=wall, roof="shingles:#5c6068", roof_m=2.0,
            door=("#2f5f8e", "#8a2f2a", "#3f7d4e", "#d9a52c")[k % 4], roof_kind="gable" if k % 3 else "hip",
        )  # fmt: skip
        house(site, Frame(x, y, yaw), style)
    for path in (
        [(10.5, 12.6), (29.5, 14.0)],
        [(11.0, -15.8), (29.0, -17.2)],
        [(40, 10), (40, 36), (60, 36)],
        [(28, 28.0), (27, 53)],
        [(2, -30), (28, -30), (28, -46)],
        [(44, -14), (44, -46)],
        [(6, 30), (6, 52)],
    ):
        field_wall(site, path)
    for path in ([(-41.0, -30.0), (-41.6, -35.0), (-38.0, -39.0)], [(-39.0, 28.5), (-39.5, 35.0)]):
        z = min(site.ground_z(x, y) for x, y in path) - 0.1
        site.add(None, "railing", bars(path, z, "wood", 1.2))


def _rocks(site: Site, land: BaseGeometry) -> None:
    stone = site.material("boulder", "rock:#857b70")
    foot = land.boundary.buffer(2.4).intersection(rectangle(-60, -52, -14, 52))
    boulders(site, foot, 2.4, (0.6, 1.7), stone, limit=80)
    for x, y, r in ((-50.0, 6.0, 2.4), (-47.5, 9.5, 1.6), (-53.0, -48.0, 2.0)):
        boulders(site, Point(x, y).buffer(r), 1.6, (0.9, 1.9), stone, category="sea_stack", limit=6, flat=1.5)


def _green(site: Site, land: BaseGeometry) -> None:
    wild = patches(site.recipe.seed + 11, 12.0, 1.2)
    top = land.buffer(-6.5).intersection(site.extent.buffer(-1.5))

    def grown(x: float, y: float) -> float:
        return min(1.0, wild(x, y)) if site.ground_z(x, y) > 6.0 else 0.0

    strew(site, "bush", top, 3.6, grown, 44, variant="yellow_blossom")
    strew(site, "fern", top, 2.2, grown, 70, scale=1.3)
    for south, north in ((13, 30), (-30, -14)):
        broadleaves(site, top.intersection(rectangle(14, south, 60, north)), 5.0, grown, 12, (5.0, 7.5))
    strew(site, "pine_tree", top.intersection(rectangle(44, -10, 60, 12)), 5.0, grown, 8, variant="low")
    strew(site, "boulder", top.intersection(rectangle(-60, -60, 0, 60)), 7.0, grown, 14, variant="grey", scale=0.8)
