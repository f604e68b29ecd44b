"""A rocky northern islet: a fishing hamlet round an inlet, a lighthouse on a knoll, a windmill on a heath, skerries.

The inlet opens to the south; the knoll lies in the north-east, the heath with the windmill in the west.
"""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle, house
from aerialdojo_gen.scenes.grammar_scatter import smooth_path
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.layouts.natural.island.huts import boathouse, drying_rack
from aerialdojo_gen.scenes.layouts.natural.island.islet_things import GROUPS
from aerialdojo_gen.scenes.layouts.natural.parts.quays import field_wall, pier
from aerialdojo_gen.scenes.layouts.natural.parts.shore import (
    boulders,
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

_COAST = [
    (-48, -4), (-50, 14), (-40, 30), (-20, 36), (2, 34), (22, 40), (42, 30), (48, 12), (44, -8), (34, -20), (20, -26),
    (10, -20), (8, -8), (-2, -5), (-9, -11), (-12, -24), (-26, -28), (-40, -20),
]  # fmt: skip
_SKERRIES = ((-22.0, -43.0, 3.6), (33.0, -39.0, 4.6), (52.0, -30.0, 2.6), (-54.0, 34.0, 3.0), (44.0, -43.0, 2.2))
_KNOLL, _MILL = (24.0, 19.0), (-29.0, 11.0)
# Where a house stands, where its door looks, and what colour it has.
_HOUSES = (
    (-19.0, -9.0, 20.0, "planks:#a03c2e"),
    (-25.0, -19.5, 0.0, "planks:#d9b45a"),
    (17.0, -4.0, -160.0, "planks:#a03c2e"),
    (5.0, 5.5, -95.0, "planks:#e6e2d6"),
    (-7.5, 7.5, -60.0, "planks:#a03c2e"),
    (23.0, -15.0, 180.0, "planks:#7f97a3"),
)
_PATHS = [
    [(-6, -6), (-12, -4), (-17, -2), (-24, 4), (-29, 6)],
    [(-6, -6), (0, -2), (8, 0), (13, 5), (18, 12), (22, 15)],
    [(0, -2), (-1, 8), (-4, 18), (-10, 28)],
    [(-12, -4), (-15, -14), (-20, -20)],
    [(8, 0), (13, -9), (17, -14)],
]


def build_islet(site: Site) -> None:
    """Build the islet."""
    main = ragged(_COAST, site.recipe.seed, 1.8, 2.2)
    skerries = [blob(x, y, r, site.recipe.seed + 60 + k, 0.35) for k, (x, y, r) in enumerate(_SKERRIES)]
    land = shapely.union_all([main, *skerries])
    paths = [smooth_path(p) for p in _PATHS]
    _ground(site, land, paths)
    _paint(site, land, paths)
    for path in paths:
        site.occupy(ribbon(path, 1.4))
    _hamlet(site)
    for place, things in GROUPS.items():
        settle(site, place, things)
    _rocks(site, land)
    _heath(site, main)


def _ground(site: Site, land: BaseGeometry, paths: list[list[tuple[float, float]]]) -> None:
    def height(x: Floats, y: Floats, noise: Floats) -> Floats:
        inland = inland_m(land, x, y)
        z = 1.3 * rise(inland, 0.0, 3.2) + 0.07 * np.clip(inland, 0.0, 22.0)
        z = z + 1.5 * noise * rise(inland, 2.0, 11.0)
        knoll = np.hypot(x - _KNOLL[0], y - _KNOLL[1])
        hill = np.hypot(x - _MILL[0], y - _MILL[1])
        z = z + 8.0 * np.exp(-((knoll / 13.0) ** 2)) * (1.0 + 0.12 * noise) + 4.6 * np.exp(-((hill / 12.0) ** 2))
        return np.where(inland > 0.0, np.maximum(z, 0.25 * rise(inland, 0.0, 1.0)), 0.0)

    ground = shaped(site, 1.5, 17.0, height)
    for path in paths:
        ground = ground.graded(path, 1.2, blend_m=2.0, smooth_m=7.0)
    for x, y, *_ in _HOUSES:
        ground = ground.flattened(disc(x, y, 4.0), blend_m=3.5)
    ground = ground.flattened(disc(*_KNOLL, 5.8), blend_m=4.0)
    ground = ground.flattened(disc(*_MILL, 5.5), blend_m=4.0)
    site.set_ground(ground, site.material("rock", "rock:#9d928a"))


def _paint(site: Site, land: BaseGeometry, paths: list[list[tuple[float, float]]]) -> None:
    seed, rng = site.recipe.seed, site.rng_for("heath")
    heath, moss = site.material("heath", "meadow:#7d8556"), site.material("moss", "moss:#77804a")
    inner = land.buffer(-4.0)
    patch = []
    for k in range(46):
        x, y = rng.uniform((-46, -24), (46, 38))
        patch.append(blob(float(x), float(y), float(rng.uniform(3.5, 8.0)), seed + 100 + k, 0.45))
    site.paint(shapely.union_all(patch).intersection(inner), heath)
    tufts = []
    for k in range(40):
        x, y = rng.uniform((-46, -24), (46, 38))
        tufts.append(blob(float(x), float(y), float(rng.uniform(1.2, 3.2)), seed + 200 + k, 0.5))
    site.paint(shapely.union_all(tufts).intersection(land.buffer(-3.0)), moss)
    bloom = []
    for k in range(14):
        x, y = rng.uniform((-44, -4), (0, 34))
        bloom.append(blob(float(x), float(y), float(rng.uniform(1.5, 3.2)), seed + 300 + k, 0.5))
    site.paint(shapely.union_all(bloom).intersection(inner), site.material("heather", "moss:#8f6a84"))
    grass = site.material("grass", "grass:#71904a")
    for k, (x, y, *_) in enumerate(_HOUSES):
        site.paint(blob(x, y, 7.0, seed + 20 + k, 0.2).intersection(land.buffer(-1.2)), grass)
    for k, at in enumerate((_KNOLL, _MILL)):
        site.paint(blob(*at, 7.5, seed + 30 + k, 0.2), grass)
    site.paint(steep_area(site.terrain, 38.0).intersection(land), site.material("cliff", "rock:#8a7f78"))
    for path in paths:
        site.paint(ribbon(path, 1.3, round_ends=True), site.material("path", "gravel:#a79c8a"))
    paint_sea(site, land, 6.0)


def _hamlet(site: Site) -> None:
    for k, (x, y, yaw, wall) in enumerate(_HOUSES):
        style = HouseStyle(
            width_m=6.8, depth_m=5.6, storeys=1, storey_m=2.7, wall=wall, roof="roof_tiles" if k % 2 else "shingles",
            roof_m=2.4, door=("#2f5f6e", "#6e2f2a", "#e9dcb0")[k % 3], garage=0, chimney=True,
        )  # fmt: skip
        house(site, Frame(x, y, yaw), style)
    pier(
        site, Frame(-6.6, -8.0, -90.0), 19.0, 2.8, 1.5, bay_m=3.8, rail=None, floor="boards:#8c8272", category="jetty"
    )
    pier(
        site,
        Frame(36.5, -17.0, -70.0),
        11.0,
        2.4,
        1.5,
        bay_m=3.6,
        rail=None,
        floor="boards:#8c8272",
        category="jetty",
    )
    for x, y, yaw, wall in (
        (9.6, -13.0, 180.0, "planks:#a03c2e"),
        (11.4, -19.6, 180.0, "planks:#8a4a34"),
        (1.6, -4.4, -90.0, "planks:#a03c2e"),
    ):
        boathouse(site, Frame(x, y, yaw), 1.7, wall=wall)
    drying_rack(site, Frame(-33.0, -11.0, 35.0), 7.0)
    drying_rack(site, Frame(-37.0, -4.5, 35.0), 7.0)
    fence(site, [(-22.6, -13.6), (-15.4, -13.4)], "picket")
    fence(site, [(12.6, 0.6), (18.4, 1.2)], "picket")
    mill = [(-38, 4), (-37, 15), (-30, 21), (-20, 20), (-17, 12)]
    field_wall(site, mill)
    field_wall(site, [(8, 12), (10, 22), (16, 29), (26, 31)])
    field_wall(site, [(-14, 12), (-12, 20), (-16, 27)])


def _rocks(site: Site, land: BaseGeometry) -> None:
    stone = site.material("boulder", "rock:#8d837c")
    outer = land.boundary.buffer(1.8).difference(rectangle(-14, -26, 14, 2))
    boulders(site, outer, 3.0, (0.5, 1.5), stone, limit=110, flat=0.65)
    boulders(site, land.buffer(-6.0), 9.0, (0.5, 1.2), stone, category="erratics", limit=22, flat=0.8)


def _heath(site: Site, land: BaseGeometry) -> None:
    wild = patches(site.recipe.seed + 11, 12.0, 1.2)
    inner = land.buffer(-5.0)

    def grown(x: float, y: float) -> float:
        return min(1.0, wild(x, y))

    pines = inner.intersection(rectangle(-20, 12, 16, 40))
    strew(site, "pine_tree", pines, 4.0, grown, 20, variant="low", attributes={"place": "in the pine grove"})
    strew(site, "birch_tree", inner, 7.0, grown, 9, scale=0.75, attributes={"place": "on the heath"})
    strew(site, "bush", inner, 3.4, grown, 40, attributes={"place": "on the heath"})
    strew(site, "fern", inner, 2.2, grown, 70, variant="rusty", scale=1.2, attributes={"place": "on the heath"})
    strew(site, "reed_clump", land.difference(land.buffer(-3.0)), 3.2, grown, 26, variant="dry")
    strew(site, "mossy_rock", inner, 6.0, grown, 18, attributes={"place": "on the heath"})
