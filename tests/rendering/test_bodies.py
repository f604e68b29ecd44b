"""Pictures of many bodies in a row are those that the renderer takes one by one, to the bit, and draw far less."""

import numpy as np
import pytest
from support.flying import town
from support.rendered import boxes_and_a_wall, courtyard

from aerialdojo_gen import GlRenderer
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.bodies import draw_bodies
from aerialdojo_gen.rendering.gl import clip_from_world
from aerialdojo_gen.rendering.picture import FAR_M, NEAR_M
from aerialdojo_gen.rendering.world import PyBulletRenderer
from aerialdojo_gen.store.schemas import VIEWS


def poses_in(world, n, seed):
    draw = np.random.default_rng(seed)
    low, high = world.bounds
    return np.column_stack([draw.uniform(low, high, (n, 3)), draw.uniform(-np.pi, np.pi, n)])


@pytest.mark.parametrize("make", [courtyard, town])
@pytest.mark.parametrize(("width", "height", "fov"), [(64, 64, 90.0), (33, 17, 70.0), (128, 96, 110.0), (1, 1, 90.0)])
def test_they_equal_what_is_rendered_one_by_one(make, width, height, fov):
    """Anywhere, inside of things and below the ground too, in whatever order sizes come."""
    world, camera = make(), Camera(width, height, fov)
    poses = poses_in(world, 24, width)
    views = [VIEWS[k] for k in (3, 0, 2)]
    with GlRenderer(world) as renderer, GlRenderer(world) as plain:
        rgb, depth_m = draw_bodies(renderer, camera, poses, views)
        other, _ = draw_bodies(renderer, Camera(20, 20, 90.0), poses[:3], ["left"])
        again, _ = draw_bodies(renderer, camera, poses, views)
        assert (again == rgb).all()
        for k, pose in enumerate(poses):
            for v, view in enumerate(views):
                picture = plain.render(camera, view_pose(pose[:3], pose[3], view))
                assert (rgb[k, v] == picture.rgb).all(), (k, view)
                assert (depth_m[k, v] == picture.depth_m).all(), (k, view)
    assert other.shape == (3, 1, 20, 20, 3)
    assert len(np.unique(rgb)) > (20 if width > 1 else 5)


def test_what_stands_behind_a_wall_is_not_drawn():
    """Two hundred boxes behind a wall cost next to nothing, and those before it are all drawn."""
    world = boxes_and_a_wall()
    camera, pose = Camera(128, 128, 90.0), np.array([0.0, 0.0, 3.0, 0.0])
    with GlRenderer(world) as renderer:
        matrices = [view_pose(pose[:3], yaw, "front") for yaw in (0.0, np.pi)]
        clips = np.stack([clip_from_world(camera, m, NEAR_M, FAR_M) for m in matrices])
        nearness = np.zeros((2, 128, 128), np.float32)
        visible = [c.visible_indices(clips, pose[:3], 128, 128, nearness) for c in renderer.bodies()._cullings]
        ahead, behind = (sum(len(kind[v]) // 3 for kind in visible) for v in (0, 1))
        assert ahead < 40, "but for pixels on the seam of the wall's triangles"
        assert behind > 100
        rgb, depth_m = draw_bodies(renderer, camera, pose[None], ["front"])
        assert depth_m[0, 0, 64, 64] == pytest.approx(10.0, abs=1e-3)
        assert (rgb[0, 0] == renderer.render(camera, matrices[0]).rgb).all()


def test_nothing_to_draw_is_no_error():
    with GlRenderer(courtyard()) as renderer:
        rgb, depth_m = draw_bodies(renderer, Camera(8, 8, 90.0), np.empty((0, 4)), ["front"])
    assert rgb.shape == (0, 1, 8, 8, 3)
    assert depth_m.shape == (0, 1, 8, 8)


@pytest.mark.parametrize("kind", [GlRenderer, PyBulletRenderer])
def test_who_asks_for_them_has_instance_ids_too(kind):
    """Those of each picture alone; and colours and depths are what they are without."""
    world, camera = courtyard(), Camera(24, 16, 90.0)
    poses, views = poses_in(world, 6, 5), ["front", "down", "left"]
    instance_ids = np.full((6, 3, 16, 24), -9, np.int32)
    with kind(world) as renderer:
        rgb, depth_m = draw_bodies(renderer, camera, poses, views, instance_ids)
        without = draw_bodies(renderer, camera, poses, views)
        for k, pose in enumerate(poses):
            for v, view in enumerate(views):
                picture = renderer.render(camera, view_pose(pose[:3], pose[3], view), instances=True)
                assert (instance_ids[k, v] == picture.instance).all(), (k, view)
                assert (rgb[k, v] == picture.rgb).all()
                assert (depth_m[k, v] == picture.depth_m).all()
    assert (rgb == without[0]).all()
    assert (depth_m == without[1]).all()
    assert len(np.unique(instance_ids)) > 3
