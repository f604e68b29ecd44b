"""What grows and lies on open country: trees, stones, a landmark on the highest free place, a resting place."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.imports.placing import Placer
from aerialdojo_gen.scenes.grammar import Pose, poisson_disc
from aerialdojo_gen.scenes.kit.town_buildings import surface_areas

_LANDMARKS = ("summit_cross", "fire_tower", "radio_mast")
# Category, least distance, most of them, on which ground.
_GROWTH = (
    ("spruce_tree", 7.0, 70, "grass"), ("oak_tree", 12.0, 18, "grass"), ("birch_tree", 9.0, 24, "grass"),
    ("bush", 6.0, 40, "grass"), ("boulder", 9.0, 36, "rock"), ("boulder", 16.0, 16, "grass"),
    ("dead_tree", 26.0, 8, "rock"), ("tree_stump", 20.0, 10, "grass"), ("fallen_log", 22.0, 8, "grass"),
    ("driftwood", 18.0, 8, "sand"), ("reed_clump", 6.0, 20, "sand"),
)  # fmt: skip
_CAMP = ("picnic_set", "log_bench", "backpack", "direction_sign", "cooler_box", "camp_chair")


def place_things(placer: Placer, surfaces: Mapping[str, float], water_z_m: float | None) -> None:
    """Grow and strew what such ground has; `surfaces` are the arguments of the plan's surfaces."""
    site = placer.site
    areas = surface_areas(site, **surfaces, water_to_m=water_z_m)
    bare = shapely.union_all([areas[key] for key in ("sand", "snow", "rock", "wet")])
    free = {
        "grass": site.extent.difference(bare), "rock": areas["rock"].difference(areas["wet"]),
        "sand": areas["sand"].difference(areas["wet"]),
    }  # fmt: skip
    placer.begin("Landmarks, and a resting place on level grass")
    _landmarks(placer, water_z_m)
    for k, (x, y) in enumerate(_level_places(placer, free["grass"])):
        placer.place(_CAMP[k % len(_CAMP)], Pose(x, y, 37.0 * k))
    placer.begin("Trees, bushes and stones")
    for category, spacing, most, kind in _GROWTH:
        area = free[kind].intersection(site.extent.buffer(-1.5))
        for x, y, yaw in poisson_disc(area, spacing, site.rng_for("grow", category, kind), limit=most):
            placer.place(category, Pose(x, y, yaw), drawn=True)


def _landmarks(placer: Placer, water_z_m: float | None) -> None:
    site = placer.site
    corners = site.terrain.corners()
    spots = corners[shapely.contains_xy(site.extent.buffer(-8.0), corners[:, 0], corners[:, 1])]
    for k, category in enumerate(_LANDMARKS):
        dry = spots if water_z_m is None else spots[spots[:, 2] > water_z_m + 1.0]
        if not len(dry):
            return
        x, y, _ = dry[int(np.argmax(dry[:, 2]))]
        placer.place(category, Pose(float(x), float(y), 90.0 * k), settle_m=1.0, drawn=True)
        # The next one stands far from it.
        spots = spots[np.hypot(spots[:, 0] - x, spots[:, 1] - y) > 0.45 * max(site.head.size_m)]


def _level_places(placer: Placer, grass: BaseGeometry) -> list[tuple[float, float]]:
    site, ground = placer.site, placer.site.terrain
    inner = grass.intersection(site.extent.buffer(-4.0)).buffer(-1.0)
    spots = poisson_disc(inner, 14.0, site.rng_for("level"), limit=120)

    def tilt(pose: tuple[float, float, float]) -> float:
        x, y, _ = pose
        return float(abs(ground.z(x + 1, y) - ground.z(x - 1, y)) + abs(ground.z(x, y + 1) - ground.z(x, y - 1)))

    return [(x, y) for x, y, _ in sorted(spots, key=tilt)[: 2 * len(_CAMP)]]
