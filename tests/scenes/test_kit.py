"""The builders of the kit, each by itself: with the arguments of plans, and with others near them."""

from itertools import islice

import numpy as np
import pytest
from support.layout_checks import ASSETS, catalogue, drawn

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.rendering.gallery import settings_of, uses_of
from aerialdojo_gen.scenes.kit import kit
from aerialdojo_gen.scenes.plans.build import build_tables

USES = uses_of(sorted(ASSETS.glob("s[cm]*/*_[01].toml")))
# Builders that only add-map and add-terrain call: tests/imports builds with them.
OF_PLACES = {
    "bar_fences", "buildings", "garden_walls", "street_network", "surveyed_heights", "surveyed_surfaces",
    "water_over_low_ground",
}  # fmt: skip
# Buildings whose storeys stand on each other or on the ground, without floors in between: open along level edges.
STACKED = {
    "building", "canopy", "flats", "gable_cabins", "long_balconies", "sash_windows", "shopping_hall", "town_blocks",
}  # fmt: skip
MAX_TRIANGLES = 60_000
SETTINGS = 5


def test_every_builder_is_used():
    assert set(kit()) - set(USES) <= OF_PLACES


def open_edges(parts):
    """Find the edges of a body that no face borders the other way round, (n, 2, 3) metres."""
    corners = np.concatenate([part.vertices[part.faces] for part in parts]).astype(np.float64)
    places, index = np.unique(np.round(corners.reshape(-1, 3), 3), axis=0, return_inverse=True)
    a, b, c = index.reshape(-1, 3).T
    there = np.concatenate([[a, b], [b, c], [c, a]], axis=1)
    there = there[:, there[0] != there[1]]
    ways, counts = np.unique(there[0] * len(places) + there[1], return_counts=True)
    back = dict(zip(ways.tolist(), counts.tolist(), strict=True))
    turned = (ways % len(places)) * len(places) + ways // len(places)
    lacking = np.array([back.get(way, 0) for way in turned.tolist()]) != counts
    return places[np.column_stack([ways // len(places), ways % len(places)])[lacking]]


@pytest.mark.parametrize("name", drawn(sorted(USES), 3))
def test_what_a_builder_makes_is_sound_or_refused_in_a_line(name):
    built = 0
    for use, label in islice(settings_of(name, USES[name]), SETTINGS):
        entries: dict[str, str] = {}
        refusal = ""
        try:
            scene = build_tables(use.plan, {**use.tables, "horizon": {"kind": "none"}}, catalogue(), entries)
        except AssetError as error:
            refusal = str(error)
        if refusal:
            assert use.plan in refusal, label
            assert "\n" not in refusal, label
            continue
        built += 1
        floor = scene["ground"].bounds[0, 2]
        for instance in scene.instances:
            if entries.get(instance.node) != use.entry or instance.category in catalogue():
                continue
            assert sum(len(part.faces) for part in instance.parts) <= MAX_TRIANGLES, label
            assert instance.bounds[0, 2] > floor - 30.0, label
            edges = open_edges(instance.parts)
            if name in STACKED:
                edges = edges[edges[:, 0, 2] != edges[:, 1, 2]]
            assert edges.tolist() == [], f"{label}: {instance.node} is open"
            for part in instance.parts:
                assert np.isfinite(part.vertices).all(), label
                assert part.faces.min() >= 0
                assert part.faces.max() < len(part.vertices)
    assert built
