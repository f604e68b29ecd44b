"""Harbours: quays over the water, ships afloat beside them, and everything on something."""

import numpy as np
import pytest
import shapely
from support.layout_checks import blank_site, each_scene, props_of

from aerialdojo_gen.scenes.footprints import footprint
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.building_sites import HIGH_M, LONG_M, Stack, container_stacks
from aerialdojo_gen.scenes.kit.houses import HouseStyle, house_row
from aerialdojo_gen.scenes.kit.quays import quay
from aerialdojo_gen.scenes.model import Scene

SCENES = ["I_Harbor_0", "I_Harbor_1"]
of_each_scene = each_scene(SCENES)
_AFLOAT = {"freighter", "fishing_boat", "tugboat", "sailboat", "motor_yacht", "rowing_boat", "buoy"}


def land(scene: Scene) -> shapely.Geometry:
    """What of the ground lies above the water."""
    ground = next(i for i in scene.instances if i.category == "ground")
    corners = ground.vertices[ground.faces]
    level = (np.ptp(corners[:, :, 2], axis=1) < 1e-6) & (corners[:, 0, 2] > 1.0)
    return shapely.union_all(shapely.make_valid(shapely.polygons(corners[level][:, :, :2])), grid_size=0.01)


@of_each_scene
def test_boats_float_clear_of_the_quays(scene_of, name):
    scene = scene_of(name)
    boats = [i for i in props_of(scene) if i.category in _AFLOAT]
    dry = land(scene)
    assert len(boats) >= 10
    for boat in boats:
        assert boat.bounds[0, 2] < 0.05
        hull = footprint(boat, 0.0)
        assert hull.intersection(dry).area < 0.02 * hull.area, boat.node


def test_containers_are_stacked_in_tiers():
    site = blank_site("I_T_0")
    quay(site, area=rectangle(-30, -30, 30, 30), height_m=2.0)
    container_stacks(site, stacks=[Stack((-20.0, -5.0), [[3, 1], [0, 2]])], on=2.0)
    stack = site.instances[-1]
    assert stack.bounds[1, 2] == pytest.approx(2.0 + 3 * HIGH_M, abs=0.1)
    assert np.ptp(stack.bounds[:, 0]) == pytest.approx(2 * LONG_M + 0.5, abs=0.1)
    assert not site.is_free(-10.0, -3.0, 0.3)
    assert site.is_free(-10.0, 6.0, 0.3)


def test_houses_of_a_row_take_turns():
    site = blank_site("I_T_0")
    row = [(-20.0, 0.0), (0.0, 0.0), (20.0, 0.0)]
    house_row(site, at=row, yaw_deg=0.0, style=HouseStyle(), on=2.0, walls=("brick", "planks"), storeys=(1, 2, 3))
    assert [{"brick", "planks"} & {part.material for part in i.parts} for i in site.instances] == [
        {"brick"}, {"planks"}, {"brick"},
    ]  # fmt: skip
    tops = [float(i.bounds[1, 2]) for i in site.instances]
    assert tops == sorted(set(tops))
