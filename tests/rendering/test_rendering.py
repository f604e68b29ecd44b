from __future__ import annotations

import numpy as np
import pytest
from support.rendered import MATERIALS, block, courtyard

from aerialdojo_gen.geometry.cameras import Camera, project, view_pose
from aerialdojo_gen.rendering.backend import scene_renderer
from aerialdojo_gen.rendering.gallery import contact_sheet, look_at
from aerialdojo_gen.rendering.world import PyBulletRenderer, pybullet
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.schemas import VIEWS

CAMERA = Camera(320, 320, 90.0)


@pytest.fixture(scope="module")
def scene():
    return courtyard()


def test_textures_lie_on_surfaces_in_perspective():
    """A checkered ground of 1 m squares: their colours along a row change where the geometry says."""
    ground = block("ground", (-50, -50, -1), (50, 50, 0), "grass")
    with PyBulletRenderer(Scene("flat", (ground,), MATERIALS, np.array([[-50.0] * 3, [50.0] * 3]))) as world:
        albedo, depth, surface = world.rasterise(CAMERA, view_pose((0.0, 0.0, 4.0), 0.0, "front"))
    row = 300
    points = np.array([(depth[row, c], -(c + 0.5 - 160) / 160 * depth[row, c], 0.0) for c in range(320)])
    u, v = points[:, 0] / 2.0, points[:, 1] / 2.0
    dark = (np.floor(2 * u) + np.floor(2 * v)) % 2 == 1
    clear = (np.abs(2 * v - np.rint(2 * v)) > 0.05) & (np.abs(2 * u - np.rint(2 * u)) > 0.05)
    shade = albedo[row, :, 0] > 90
    assert surface[row].min() >= 0
    assert clear.sum() > 250
    assert len(set(shade[clear] == dark[clear])) == 1


def test_shadows_fall_away_from_the_sun(scene):
    sun = np.asarray(scene.sun)
    cube = block("cube", (-1, -1, 0), (1, 1, 2), "grey")
    plain = Scene("plain", (block("ground", (-20, -20, -1), (20, 20, 0), "blue"), cube), MATERIALS, scene.bounds)
    pose = view_pose((0.0, 0.0, 10.0), 0.0, "down")
    with PyBulletRenderer(plain) as world:
        rgb = world.render(CAMERA, pose).rgb.astype(int)
    # The sun stands in the south-east: 1.7 m west and 0.9 m north of the cube's middle, the way to it meets the cube.
    assert sun[0] > 0 > sun[1]
    (shadow, light), _ = project(CAMERA, pose, [(-1.7, 0.9, 0.0), (1.7, -0.9, 0.0)])
    in_shadow, in_light = (rgb[int(p[1]), int(p[0])] for p in (shadow, light))
    assert in_shadow[2] < 0.75 * in_light[2]


def test_a_world_shows_its_sky_gives_its_client_back_and_suffers_vertices_in_the_camera_s_own_plane(scene):
    """PyBullet has 1,024 clients at most: a renderer that keeps one would end a long run.

    TinyRenderer divides by zero at such vertices; routes on whole metres meet them often.
    """
    curb = block("curb", (-24, -1, 0), (24, 1, 0.5), "blue")
    with PyBulletRenderer(Scene("long", (*scene.instances, curb), MATERIALS, scene.bounds)) as long:
        picture, client = long.render(CAMERA, view_pose((0, 0, 7.5), 0.0, "front")), long._client
        for view in VIEWS:
            for position in ((0.0, 0.0, 3.0), (0.0, 0.0, 0.75), (6.0, 0.0, 2.0), (-6.0, 3.0, 2.0)):
                depth_m = long.render(Camera(160, 160, 90.0), view_pose(position, 0.0, view)).depth_m
                assert depth_m.min() > 0.1, "no NaN"
        assert pybullet.isConnected(client)
    assert not pybullet.isConnected(client)
    sky = picture.rgb[np.isinf(picture.depth_m)]
    assert len(sky) > 1000
    assert sky[:, 2].mean() > sky[:, 0].mean() + 20, "not white"
    assert np.ptp(picture.rgb[:100, 160].astype(int), axis=0).max() > 20


def test_previews_keep_the_latest_scene_and_sheets_hold_all_pictures(scene):
    image = look_at(scene, (-6, -6, 6), (5.5, 1.5, 1.5), 40, 24)
    assert image.shape == (24, 40, 3)
    assert scene_renderer(scene, "pybullet") is scene_renderer(scene, "pybullet")
    sheet = contact_sheet([image] * 5, list("abcde"), columns=3)
    assert (np.lib.stride_tricks.sliding_window_view(sheet, image.shape) == image).all(axis=(3, 4, 5)).sum() == 5
    with pytest.raises(ValueError, match="labels"):
        contact_sheet([image], ["a", "b"])
