"""A small fair on a hillside: three terraces behind planted walls, an axis of stairs from the gate to the big wheel.

The hill rises to the north; the gate and the car park lie at its foot.
"""

from __future__ import annotations

import numpy as np
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.grammar_streets import parking_row
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.kit.parking import park_cars
from aerialdojo_gen.scenes.kit.structures import Parts, block
from aerialdojo_gen.scenes.layouts.urban.park.rides import booths, entrance_gate, light_strings, pavilion, queue_rails
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain

STEPS_Y, STEPS_Z = (-8.0, 7.0), (2.0, 2.2)
LEVELS_Z = (0.0, 2.0, 4.2)
_STAIR_HALF = 3.2
_WALL_HALF = 31.0


def build_hill_fair(site: Site) -> None:
    """Build terraces, walls and stairs, halls and booths, the gate, the pond, and trees."""
    site.set_ground(_terrain(site.recipe.size_m), site.material("lawn", "grass:#6a9a48"))
    _paint(site)
    _walls(site)
    _structures(site)
    _trees(site)


def _terrain(size_m: tuple[float, float]) -> Terrain:
    cell = 1.0
    x, y = np.meshgrid(
        np.arange(-size_m[0] / 2, size_m[0] / 2 + 0.1, cell), np.arange(-size_m[1] / 2, size_m[1] / 2 + 0.1, cell)
    )
    heights = np.zeros_like(x)
    for at, rise in zip(STEPS_Y, STEPS_Z, strict=True):
        # Steep behind the walls, a soft slope beyond their ends.
        soft = np.clip((np.abs(x) - _WALL_HALF) / 4.0, 0.0, 1.0)
        run = 1.0 + 7.0 * soft
        t = np.clip((y - at + run / 2 - 0.1) / run, 0.0, 1.0)
        heights += rise * t * t * (3.0 - 2.0 * t)
    return Terrain(-size_m[0] / 2, -size_m[1] / 2, cell, heights)


def _paint(site: Site) -> None:
    paving, path = site.material("plaza", "paving:#c9b49a"), site.material("path", "gravel:#cdb88f")
    site.paint(rectangle(-20, -22, 20, -8.6), paving)
    site.paint(rectangle(-24, -7.4, 24, 6.4), path)
    site.paint(rectangle(-20, 7.6, 20, 17), paving)
    site.paint(rectangle(-3.2, -36, 3.2, -20), paving)
    site.paint(rectangle(-3.2, 7.6, 3.2, 21), paving)
    site.paint(disc(0, 24, 9.5, 36), paving)
    site.paint(disc(0, -15.0, 3.2), site.material("inlay", "checker:#c9805a"))
    site.paint(disc(-10, 12.6, 4.4, 28), site.material("inlay", "checker:#c9805a"))
    site.paint(blob(-29, -24, 6.6, 5), "sand")
    site.paint(blob(-29, -24, 5.4, 5), "water")
    site.paint(rectangle(14, -38, 42, -25), "asphalt")
    site.paint(rectangle(-42, -38, 42, -33.4), "asphalt")


def _walls(site: Site) -> None:
    stone, hedge = site.material("wall", "blocks:#b0a48e"), "hedge:#4f7f38"
    step = site.material("steps", "concrete:#d4cdbf")
    parts: Parts = []
    areas = []
    for k, at in enumerate(STEPS_Y):
        low, high = LEVELS_Z[k], LEVELS_Z[k + 1]
        for s in (-1, 1):
            x0, x1 = sorted((s * _STAIR_HALF, s * _WALL_HALF))
            parts.append((stone, block(x0, at - 0.6, x1, at - 0.25, low - 0.3, high + 0.5)))
            parts.append((stone, block(x0, at + 0.5, x1, at + 0.75, high - 0.6, high + 0.5)))
            parts.append(("soil", block(x0, at - 0.25, x1, at + 0.5, low, high + 0.42)))
            for a in np.arange(x0 + 0.4, x1 - 2.4, 2.9):
                parts.append((hedge, block(a, at - 0.2, a + 2.3, at + 0.45, high + 0.42, high + 1.05)))
            areas.append(rectangle(x0, at - 0.6, x1, at + 0.75))
            cheek = s * _STAIR_HALF
            parts.append(
                (
                    stone,
                    block(
                        min(cheek, cheek - s * 0.4),
                        at - 4.2,
                        max(cheek, cheek - s * 0.4),
                        at + 0.75,
                        low - 0.3,
                        high + 0.5,
                    ),
                )
            )
        count = 10
        rise, run = (high - low) / count, 3.6 / count
        treads = [
            block(
                -_STAIR_HALF + 0.4, at - 3.6 + run * i, _STAIR_HALF - 0.4, at + 0.9, low - 0.1, low + rise * (i + 1)
            )
            for i in range(count)
        ]
        parts.append((step, merge(treads)))
    site.add("terrace_walls", "terrace_wall", parts, {"material": "stone"}, footprint=unary_union(areas))


def _structures(site: Site) -> None:
    roof, trim = site.material("roof", "sheet_metal:#b8423a"), site.material("trim", "#f1e6cf")
    pavilion(site, "dodgem_hall", Frame(-12.5, -0.6, 0.0), (9.0, 8.0), sign="DODGEMS", roof=roof, trim=trim,
             floor="checker:#5a6a7a")  # fmt: skip
    pavilion(site, "arcade_hall", Frame(13.0, -2.4, 180.0), (7.0, 6.0), sign="ARCADE", roof="sheet_metal:#3f7f8a",
             trim=trim, floor="checker:#a05a4a")  # fmt: skip
    colours = ("#c9382e", "#2f6fa8", "#e0a02a", "#3f8f5a")
    booths(site, "south_booths", Frame(14.4, -12.4, -90.0), 4, colours, ("DARTS", "RINGS", "PRIZES", "HOOPLA"))
    booths(site, "west_booths", Frame(-17.6, -13.0, 0.0), 3, colours[1:], ("DUCKS", "CANS", "LUCKY"))
    booths(site, "upper_booths", Frame(6.6, 16.2, -90.0), 2, colours[2:], ("POPCORN", "TEA"))
    queue_rails(site, "wheel_queue", Frame(-8.6, 19.0, 0.0), 3, 5.4)
    light_strings(site, "lights_south", [(-19, -9.6), (-9.5, -20.6), (0.0, -11.0), (9.5, -20.6), (19, -9.6)])
    light_strings(site, "lights_north", [(-18.6, 16.9), (-5.4, 17.0), (2.4, 9.0)])
    entrance_gate(site, Frame(0.0, -27.5, -90.0), "HILL FAIR", 6.4, wall=site.material("gate", "plaster:#e3c9a0"),
                  roof="shingles:#8a3a34", sign="#2f5f8a")  # fmt: skip
    for a, b in (
        ((-22, -27.5), (-6.6, -27.5)),
        ((6.6, -27.5), (14, -27.5)),
        ((14, -27.5), (14, -24.6)),
        ((14, -24.6), (42, -24.6)),
    ):
        fence(site, [a, b], "picket", "#f1e6cf")
    bays = parking_row(site, 28.0, -25.4, 90.0, 9, bay_m=(2.8, 5.0))
    park_cars(site, bays[:4], 0.6, "in the car park", kinds={"hatchback": 1.0})
    parts: Parts = [
        ("planks:#8a6a48", merge([block(-35 + 0.9 * k, -19.0, -34.3 + 0.9 * k, -16.4, 0.25, 0.35) for k in range(8)]))
    ]
    site.add(
        "pond_deck",
        "pond_deck",
        [
            *parts,
            ("wood", block(-35.2, -18.9, -27.8, -18.6, -0.1, 0.25)),
            ("wood", block(-35.2, -16.8, -27.8, -16.5, -0.1, 0.25)),
        ],
    )


def _trees(site: Site) -> None:
    rng = site.rng_for("trees")
    keep = rectangle(-25, -24, 25, 36).union(rectangle(-8, -38, 42, -24)).union(disc(-29, -24, 9))
    keep = keep.union(unary_union([disc(29, -14, 9.5), disc(27, 22, 11), disc(-24.6, -16, 7), disc(19.4, 2.2, 7)]))
    for k, spot in enumerate(poisson_disc(site.extent.buffer(-6.0).difference(keep), 5.4, rng)):
        site.try_place(("urban_tree", "oak_tree", "birch_tree")[k % 3], *spot)
    for k, (x, y) in enumerate(((-23, 3), (21.4, -20.4), (-19, 20), (19, 20.4), (-22, 12), (22, 11))):
        site.try_place("urban_tree", float(x), float(y), 50.0 * k, variant=("blossom", "green", "yellow")[k % 3])
