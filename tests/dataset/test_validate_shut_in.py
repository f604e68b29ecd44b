"""The way out to the open sky, looked for by rays alone."""

import numpy as np
import trimesh
from support.flying import town
from support.handmade import instance

from aerialdojo_gen.dataset.validate.reachability import open_above, over_lattice, way_aside
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.scenes.model import Material, Scene


def hall(door: bool) -> Scene:
    """A hall around a closet around a place; with doors on sides that face away from each other."""

    def shell(half: float, side: int) -> trimesh.Trimesh:
        body = trimesh.creation.box((2 * half, 2 * half, 6 + half)).apply_translation([0, 0, (6 + half) / 2])
        body = body.subdivide().subdivide().subdivide()
        middle = body.triangles_center
        open_ = (middle[:, 0] * side > half - 1e-6) & (np.abs(middle[:, 1]) < half / 3) & (middle[:, 2] < 4)
        body.update_faces(~(open_ if door else np.zeros(len(middle), dtype=bool)))
        return body

    ground = trimesh.creation.box(bounds=[[-30, -30, -1], [30, 30, 0]])
    bodies = (("ground", ground), ("hall", shell(12, 1)), ("closet", shell(4, -1)))
    return Scene(
        "Hall_0", tuple(instance(n, b) for n, b in bodies), {"grey": Material("grey", (128, 128, 128))},
        np.array([[-30.0, -30, 0], [30, 30, 25]]),
    )  # fmt: skip


def test_a_way_out_is_found_round_corners_and_none_through_walls():
    places = np.array([[20.0, 20, 3], [8, 8, 3], [0, 0, 2]])
    for door, expected in ((False, [True, False, False]), (True, [True, True, True])):
        scene = hall(door)
        rays = RayCaster(scene)
        assert open_above(rays, places).tolist() == [True, False, False]
        assert over_lattice(rays, scene.bounds, places).tolist() == expected
        assert not way_aside(rays, places)[~np.array(expected)].any()


def test_where_the_generator_has_a_way_rays_find_one():
    scene = town()
    grid, rays = ClearanceGrid.build(scene), RayCaster(scene)
    p = np.random.default_rng(1).uniform(scene.bounds[0] + 0.3, scene.bounds[1] - 0.3, (1500, 3))
    reachable = np.array([grid.reachable(x) for x in p])
    assert reachable.sum() > 300
    free = way_aside(rays, p[reachable])
    assert over_lattice(rays, scene.bounds, p[reachable][~free]).all()
