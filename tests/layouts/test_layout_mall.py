"""The mall as it is built: what stands in it, and where a drone can fly."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.layout_checks import ASSETS, catalogue, props_of, touching

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.checks import SITTER
from aerialdojo_gen.scenes.model import Scene

RECIPE = ASSETS / "scenes" / "U_Mall_0.toml"


@pytest.fixture(scope="module")
def mall(scene_of: Callable[[str], Scene]) -> Scene:
    return scene_of("U_Mall_0")


@pytest.fixture(scope="module")
def world(mall: Scene) -> CollisionWorld:
    return CollisionWorld(mall)


def test_every_prop_says_where_it_stands(mall: Scene) -> None:
    for i in props_of(mall):
        assert i.attributes.get("place", "").strip() or catalogue()[i.category].kind == "life", i.node


def test_props_do_not_stand_in_each_other(mall: Scene) -> None:
    pairs = touching(i for i in props_of(mall) if catalogue()[i.category].kind != "building" and i.category != SITTER)
    # Hedges run on from block to block, and trees grow out of them.
    assert [p for p in sorted(pairs) if not any("hedge" in n for n in p)] == []


@pytest.mark.parametrize(
    ("p", "q"),
    [
        ((-10.5, 15.0, 3.2), (-10.5, 60.0, 3.2)),
        ((-29.0, 17.7, 4.3), (8.0, 17.7, 4.3)),
        ((-33.65, 3.0, 3.9), (-33.65, 14.0, 3.9)),
        ((-11.0, -20.0, 3.3), (-11.0, -1.5, 3.3)),
        ((-59.6, 0.0, 4.4), (-59.6, 40.0, 4.4)),
        ((47.0, 18.6, 2.4), (90.0, 18.6, 2.4)),
        ((51.0, 37.0, 6.3), (90.0, 37.0, 6.3)),
        ((57.0, -30.0, 2.9), (57.0, -12.0, 2.9)),
        ((38.0, -14.0, 7.0), (38.0, 50.0, 7.0)),
    ],
    ids=["passage", "north arcade", "west arcade", "gate", "west canopy", "deck", "middle floor", "terrace", "drive"],
)
def test_a_drone_can_fly_under_it(world: CollisionWorld, p: tuple[float, ...], q: tuple[float, ...]) -> None:
    assert not world.segment_in_collision(np.array(p), np.array(q), 0.25)


@pytest.mark.parametrize(
    ("p", "q"),
    [
        ((-20.0, 10.0, 2.0), (-20.0, 55.0, 2.0)),
        ((0.0, 30.0, 12.0), (0.0, 30.0, 3.0)),
        ((65.0, 30.0, 2.0), (65.0, 30.0, 9.0)),
    ],
    ids=["hall", "roof", "slab"],
)
def test_walls_and_floors_stop_it(world: CollisionWorld, p: tuple[float, ...], q: tuple[float, ...]) -> None:
    assert world.segment_in_collision(np.array(p), np.array(q), 0.25)


def test_a_thing_that_the_catalogue_lacks_is_named(tmp_path: Path) -> None:
    recipe = tmp_path / "U_Mall_9.toml"
    recipe.write_text(RECIPE.read_text().replace('["ice_cream_cart"', '["ice_cream_card"', 1))
    with pytest.raises(AssetError, match=r"ice_cream_card.*ice_cream_cart"):
        build_scene(recipe, catalogue())
