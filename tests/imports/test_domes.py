"""A sky dome is drawn behind everything, as it is, by every renderer."""

import cv2
import numpy as np
import pytest
import trimesh
from support.foreign import raw
from support.handmade import box

from aerialdojo_gen.geometry.cameras import Camera, look_at_pose
from aerialdojo_gen.imports.import_mesh import MeshOptions, import_mesh
from aerialdojo_gen.imports.raw import RawNode
from aerialdojo_gen.rendering.gl import GlRenderer
from aerialdojo_gen.rendering.raycast import RayRenderer
from aerialdojo_gen.rendering.world import PyBulletRenderer

CAMERA = Camera(256, 256, 90.0)


@pytest.mark.parametrize("renderer", [GlRenderer, PyBulletRenderer, RayRenderer])
def test_a_dome_is_drawn_as_it_is_behind_everything_and_changes_nothing_else(renderer):
    nodes = [
        raw(box((-2, 8, 0), (2, 12, 3)), "Shed", (200, 40, 40)),
        raw(box((-30, -30, -1), (30, 30, 0)), "Yard", (120, 130, 100)),
    ]
    ball = trimesh.creation.icosphere(3, 300.0)
    halves = np.where(ball.triangles_center[:, :1] > 0, [[40, 90, 200]], [[230, 170, 90]]).astype(np.uint8)
    sky = RawNode("SkyDome", np.asarray(ball.vertices), np.asarray(ball.faces, np.int64), halves)
    under, bare = (import_mesh("Dome", many, MeshOptions(light="sun"))[0] for many in ([*nodes, sky], nodes))
    assert len(under.backdrop) == 1
    poses = [look_at_pose(np.array([0.0, 0, 4]), np.array(at)) for at in ((20.0, 0, 8), (-20, 0, 8), (0, 10, 3))]
    with renderer(under) as camera:
        seen = [camera.render(CAMERA, pose) for pose in poses]
    with renderer(bare) as camera:
        without = [camera.render(CAMERA, pose) for pose in poses]
    # East of the middle it is blue, west of it sandy: neither light nor haze nor distance changes that.
    for picture, colour in zip(seen, ((40, 90, 200), (230, 170, 90)), strict=False):
        np.testing.assert_allclose(picture.rgb[:40].reshape(-1, 3), np.tile(colour, (40 * 256, 1)), atol=2)
    for picture, other in zip(seen, without, strict=True):
        np.testing.assert_array_equal(picture.depth_m, other.depth_m)
        solid = np.isfinite(picture.depth_m)
        assert 0.2 < solid.mean() < 0.8
        # At a border a pixel may be of both.
        inner = cv2.erode(solid.astype(np.uint8), np.ones((3, 3))) > 0
        np.testing.assert_array_equal(picture.rgb[inner], other.rgb[inner])
