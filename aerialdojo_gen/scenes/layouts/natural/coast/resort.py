"""A seaside resort: a beach with groynes, a promenade on a sea wall, a pier, a row of hotels, dunes and a headland.

The sea lies in the south. From there the ground climbs in steps: the beach, the promenade at 4.5 m, the hotels'
terrace at 9 m, and the headland in the east at 13 m.
"""

from __future__ import annotations

import numpy as np
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import along
from aerialdojo_gen.scenes.grammar_streets import streets
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy
from aerialdojo_gen.scenes.layouts.natural.coast.resort_things import GROUPS
from aerialdojo_gen.scenes.layouts.natural.parts.quays import (
    bars,
    end_rail,
    flight,
    groyne,
    pier,
    retaining_wall,
    sand_fence,
)
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

PROMENADE_M, TERRACE_M, HEADLAND_M, PIER_M = 4.5, 9.0, 13.0, 4.5
_WALL = (-38.0, 41.0)
_WALL_Y = (7.5, 9.2)
_UPPER_Y = (21.0, 22.7)
_HEADLAND = [(47, 70), (44, 40), (46, 24), (48, 12), (47, 0), (51, -10), (56, -17), (66, -18), (80, -12), (80, 70)]
_COAST = [(-90, 70), (-90, -11), (-70, -13), (-45, -17), (-20, -15), (5, -16), (25, -14), (40, -13), (49, -16),
          (56, -23), (66, -24), (78, -19), (95, -16), (95, 70)]  # fmt: skip
_PIER = Frame(12.0, 8.6, -90.0)
_PIER_LENGTH = 47.0
_STEPS = (-26.0, 28.0)


def build_resort(site: Site) -> None:
    """Build the resort."""
    land = ragged(_COAST, site.recipe.seed, 1.3, 2.5)
    headland = ragged(_HEADLAND, site.recipe.seed + 1, 1.2, 2.5)
    _ground(site, land, headland)
    _paint(site, land, headland)
    _sea_front(site)
    _pier(site)
    _hotels(site)
    _headland(site)
    for place, things in GROUPS.items():
        settle(site, place, things)
    _planting(site, land, headland)


def _ground(site: Site, land: BaseGeometry, headland: BaseGeometry) -> None:
    def height(x: Floats, y: Floats, noise: Floats) -> Floats:
        inland, cliff = inland_m(land, x, y), inland_m(headland, x, y)
        beach = 0.1 * np.clip(inland, 0.0, 22.0) + 0.12 * noise * rise(inland, 2.0, 8.0)
        dunes = 3.2 * rise(inland, 12.0, 24.0) * (0.75 + 0.8 * np.abs(noise)) + 2.0 * rise(y, 20.0, 50.0)
        step = np.where(y > 22.0, TERRACE_M, PROMENADE_M) + 3.5 * rise(y, 41.0, 58.0) * (1.0 + 0.3 * noise)
        town = np.where((y > 8.3) & (x > -60.0), step, beach)
        west = rise(x, -44.0, -37.5)
        z = np.where(y > 8.3, (beach + dunes) * (1.0 - west) + town * west, beach + dunes * (1.0 - west))
        top = HEADLAND_M + 1.3 * noise * rise(cliff, 3.0, 12.0)
        z = z + (top - z) * rise(cliff, -1.5, 5.0)
        return np.where(inland > 0.0, z, 0.0)

    terrain = shaped(site, 1.5, 26.0, height)
    site.set_ground(terrain, site.material("beach", "sand:#dcc392"))


def _paint(site: Site, land: BaseGeometry, headland: BaseGeometry) -> None:
    seed = site.recipe.seed
    paint_sea(site, land)
    west = ragged([(-80, 62), (-80, 8), (-66, 4), (-52, 7), (-41, 10), (-39, 22), (-38, 62)], seed + 2, 2.2)
    site.paint(west, site.material("dune_grass", "meadow:#a3a56a"))
    site.paint(rectangle(-38.0, 22.7, 47.0, 62.0), site.material("grass", "grass:#6f9350"))
    top = headland.buffer(-3.2)
    site.paint(headland.buffer(1.0).intersection(land), site.material("cliff", "rock:#b9a284"))
    site.paint(top, site.material("heath", "grass:#7c9552"))
    site.paint(rectangle(_WALL[0], 9.0, 43.0, 21.0), site.material("promenade", "paving:#cbb7a0"))
    site.paint(rectangle(_WALL[0], 10.4, 43.0, 10.9), site.material("band", "paving:#9a6a58"))
    site.paint(rectangle(_WALL[0], 19.2, 43.0, 19.7), site.material("band", "paving:#9a6a58"))
    streets(site, [[(-38.0, 26.6), (43.0, 26.6)]], lanes=2, lane_m=2.7, pavement_m=1.4)
    walk = LineString([(44, 15.0), (50, 19), (57, 15), (60, 4), (61, -8), (66, -13)])
    site.paint(walk.buffer(0.9).intersection(headland.buffer(-2.0)), site.material("path", "dirt:#b09a72"))
    site.paint(
        steep_area(site.terrain, 42.0).intersection(headland.buffer(2.0)), site.material("cliff", "rock:#b9a284")
    )
    walkway = ribbon([(-46, -2), (-50, 8), (-56, 16), (-58, 30)], 1.5)
    site.paint(walkway, site.material("boardwalk", "boards:#a8916c"))


def _sea_front(site: Site) -> None:
    x0, x1 = _WALL
    beach = 1.0
    gates = [(s - 1.3, s + 1.3) for s in _STEPS] + [(9.0, 15.0)]
    retaining_wall(site, x0, x1, *_WALL_Y, beach, PROMENADE_M, gates=gates)
    uppers = (-30.0, 6.0, 34.0)
    retaining_wall(
        site, x0, 43.6, *_UPPER_Y, PROMENADE_M - 0.5, TERRACE_M, wall=site.material("upper_wall", "brick:#a8705a"),
        gates=[(s - 1.1, s + 1.1) for s in uppers],
    )  # fmt: skip
    for x in _STEPS:
        foot = (x, 1.6)
        flight(
            site, foot, 90.0, 2.2, site.ground_z(*foot) - 0.1, PROMENADE_M, 5.9, tread="concrete", stringer="blocks"
        )
    for x in uppers:
        flight(site, (x, 14.0), 90.0, 1.9, PROMENADE_M, TERRACE_M, 7.0, tread="stone", stringer="iron")
    for x in (-35.0, -16.0, 3.0, 22.0, 38.0):
        groyne(site, [(x, 5.6), (x + 0.8, -22.0)], 1.9)
    _shelters(site)


def _shelters(site: Site) -> None:
    # Seats under a roof look out to sea; one flies through between the posts.
    for x in (-33.0, 22.0):
        corners = [(x - 3.2, 16.4), (x + 3.2, 16.4), (x - 3.2, 18.6), (x + 3.2, 18.6)]
        parts: Parts = canopy(
            x - 3.6, 16.0, x + 3.6, 19.0, PROMENADE_M + 2.9, roof=site.material("shelter", "sheet_metal:#4f8f9a"),
            post="#f1f0ea", posts=corners, foot_m=PROMENADE_M,
        )  # fmt: skip
        parts.append(("planks:#e8e2d2", block(x - 3.2, 18.5, x + 3.2, 18.7, PROMENADE_M, PROMENADE_M + 2.9)))
        parts.append(("wood", block(x - 2.8, 17.9, x + 2.8, 18.4, PROMENADE_M + 0.4, PROMENADE_M + 0.48)))
        parts.append(("wood", block(x - 2.6, 18.0, x - 2.4, 18.3, PROMENADE_M, PROMENADE_M + 0.4)))
        parts.append(("wood", block(x + 2.4, 18.0, x + 2.6, 18.3, PROMENADE_M, PROMENADE_M + 0.4)))
        site.add(None, "promenade_shelter", parts, footprint=rectangle(x - 3.4, 17.8, x + 3.4, 18.8))


def _pier(site: Site) -> None:
    pier(site, _PIER, _PIER_LENGTH, 6.0, PIER_M, gates=[(_PIER_LENGTH - 13.0, _PIER_LENGTH)])
    head = Frame(12.0, -25.4, -90.0)
    pier(site, head, 26.0, 20.0, PIER_M + 0.02, bay_m=5.2, rail=None)
    south, north = -25.4 - 26.0, -25.4
    ring = [(9.0, north), (2.1, north), (2.1, south + 0.1), (21.9, south + 0.1), (21.9, north), (15.0, north)]
    end_rail(site, ring, PIER_M + 0.02)
    hall = rectangle(7.0, -46.0, 17.0, -36.0)
    building(
        site, hall, wall=site.material("pavilion", "planks:#ece6d6"), roof="sheet_metal:#3f8f8a",
        storeys=1, storey_m=4.0, roof_kind="hip", roof_m=3.4, overhang_m=0.8, z=PIER_M, category="pier_pavilion",
        attributes={"place": "on the pier head"}, extra=_pavilion_trim(),
    )  # fmt: skip


def _pavilion_trim() -> Parts:
    parts: Parts = []
    z = PIER_M
    for k in range(4):
        x = 8.5 + k * 2.3
        for y, out in ((-36.0, 0.04), (-46.0, -0.04)):
            parts.append(("window", block(x - 0.7, min(y, y + out), x + 0.7, max(y, y + out), z + 1.0, z + 2.9)))
            parts.append(
                ("#f8f6f0", block(x - 0.85, min(y, y + out * 2), x + 0.85, max(y, y + out * 2), z + 2.9, z + 3.1))
            )
    for k in range(4):
        y = -44.5 + k * 2.3
        for x, out in ((7.0, -0.04), (17.0, 0.04)):
            parts.append(("window", block(min(x, x + out), y - 0.7, max(x, x + out), y + 0.7, z + 1.0, z + 2.9)))
    parts.append(("#c8553d", block(10.8, -36.0, 13.2, -35.85, z, z + 2.4)))
    return parts


def _hotels(site: Site) -> None:
    # (x0, x1, depth, storeys, wall, roof, roof kind): a terrace that is broken by gaps one can fly through.
    row = (
        (-36.5, -22.0, 9.0, 4, "facade_flats:#e8d2c4", "gravel", "flat"),
        (-18.5, -9.5, 10.0, 3, "shutters:#f0dfae", "roof_tiles", "hip"),
        (-9.4, -1.0, 9.0, 4, "facade_flats:#cfe0e4", "gravel", "flat"),
        (3.0, 15.0, 9.5, 3, "shutters:#e9c7bd", "roof_tiles:#8a4a3c", "hip"),
        (18.5, 33.0, 9.0, 4, "facade_flats:#efe9dc", "gravel", "flat"),
    )
    for k, (x0, x1, depth, storeys, wall, roof, kind) in enumerate(row):
        plan = rectangle(x0, 31.5, x1, 31.5 + depth)
        building(
            site, plan, wall=wall, roof=roof, storeys=storeys, storey_m=3.0 if kind == "hip" else 3.2, roof_kind=kind,
            roof_m=2.2, z=TERRACE_M, category="hotel", extra=_balconies(x0, x1, storeys, k),
        )  # fmt: skip
    fence(site, [(-37.6, 30.2), (-37.6, 40.0)], "railing")


def _balconies(x0: float, x1: float, storeys: int, k: int) -> Parts:
    awning = ("stripes:#c8553d", "stripes:#2f6fa0", "stripes:#3f8a5a", "stripes:#c89a2c", "stripes:#8a4a7a")[k]
    parts: Parts = [
        (awning, block(x0 + 0.8, 30.3, x1 - 0.8, 31.5, TERRACE_M + 2.75, TERRACE_M + 2.9)),
        ("glass", block(x0 + 0.8, 31.42, x1 - 0.8, 31.5, TERRACE_M + 0.3, TERRACE_M + 2.6)),
    ]
    for s in range(1, storeys):
        z = TERRACE_M + s * 3.2
        if k % 2 == 0:
            parts.append(("concrete:#efece4", block(x0 + 1.0, 30.4, x1 - 1.0, 31.5, z, z + 0.15)))
            parts.append(("iron", block(x0 + 1.0, 30.4, x1 - 1.0, 30.46, z + 0.95, z + 1.05)))
            for x in np.arange(x0 + 1.0, x1 - 0.9, (x1 - x0 - 2.0) / 8):
                parts.append(("iron", block(float(x) - 0.02, 30.4, float(x) + 0.03, 30.46, z + 0.15, z + 0.95)))
    return parts


def _headland(site: Site) -> None:
    # Steps climb from the promenade's end to the top of the headland.
    flight(
        site,
        (42.6, 18.2),
        0.0,
        1.8,
        PROMENADE_M,
        site.ground_z(52.6, 18.2) + 0.1,
        10.0,
        tread="stone",
        stringer="wood",
    )
    foot = LineString([(46, -12), (49, -19), (56, -26), (66, -27), (76, -22)]).buffer(3.6)
    boulders(site, foot, 2.0, (0.6, 1.7), site.material("boulder", "rock:#a8977c"), limit=60)
    path = [(56.0, -9.0), (60.5, -13.0), (68.0, -13.5)]
    z = min(site.ground_z(x, y) for x, y in path)
    site.add(None, "railing", bars(path, z, "wood", 1.1))


def _planting(site: Site, land: BaseGeometry, headland: BaseGeometry) -> None:
    for x, y, yaw in along([(-36.0, 20.3), (42.0, 20.3)], 6.0):
        site.try_place("palm_tree", x, y, yaw, attributes={"place": "on the promenade"})
    for x in (-20.0, -11.0, 1.0, 16.6):
        site.try_place("palm_tree", x, 43.5, 0.0)
    back = rectangle(-36.0, 44.0, 46.0, 58.0)
    every = patches(site.recipe.seed + 5, 14.0, 1.0)
    strew(site, "urban_tree", back, 4.5, lambda x, y: min(1.0, every(x, y)), 20)
    strew(site, "bush", back, 4.0, lambda _x, _y: 0.6, 16)
    dunes = rectangle(-73.0, 8.0, -42.0, 56.0)
    strew(site, "reed_clump", dunes, 1.8, lambda x, y: min(1.0, every(x, y)), 60, variant="dry")
    strew(site, "bush", dunes, 5.0, lambda _x, _y: 0.6, 12, variant="yellow_blossom")
    top = headland.buffer(-6.0).intersection(site.extent.buffer(-2.0))
    strew(site, "bush", top, 4.0, lambda _x, _y: 0.7, 22, variant="yellow_blossom")
    strew(site, "pine_tree", top.intersection(rectangle(50, 22, 80, 60)), 6.0, lambda _x, _y: 0.8, 14)
    strew(site, "boulder", top, 9.0, lambda _x, _y: 0.7, 8, variant="sandstone", scale=0.7)
    for path in (
        [(-42, 4), (-47, 12), (-50, 22)],
        [(-62, 2), (-60, 12), (-63, 24)],
        [(-70, -2), (-56, 2), (-50, -1)],
    ):
        sand_fence(site, path)
    tide = land.buffer(-4).difference(land.buffer(-7)).intersection(rectangle(-72, -30, -30, 0))
    strew(site, "driftwood", tide, 9.0, lambda _x, _y: 1.0, 4)
