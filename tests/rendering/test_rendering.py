from __future__ import annotations

import math

import numpy as np
import pytest
from support.handmade import box, instance
from support.rendered import MATERIALS, block, courtyard

from aerialdojo_gen.geometry.cameras import Camera, look_at_pose, project, view_pose
from aerialdojo_gen.rendering.backend import scene_renderer
from aerialdojo_gen.rendering.gallery import contact_sheet, look_at
from aerialdojo_gen.rendering.raycast import RayRenderer
from aerialdojo_gen.rendering.world import PyBulletRenderer, pybullet
from aerialdojo_gen.scenes.model import Material, Scene
from aerialdojo_gen.store.schemas import VIEWS

CAMERA = Camera(320, 320, 90.0)


@pytest.fixture(scope="module")
def scene():
    return courtyard()


@pytest.fixture(scope="module")
def world(scene):
    with PyBulletRenderer(scene) as world:
        yield world


@pytest.mark.parametrize(("view", "yaw"), [("front", 0.3), ("left", 0.3 - math.pi / 2), ("right", 0.3 + math.pi / 2)])
def test_a_red_cube_appears_where_projection_says(scene, world, view, yaw):
    pose = view_pose((-2.0, 0.5, 2.0), yaw, view)
    rgb = world.render(CAMERA, pose).rgb.astype(int)
    red = (rgb[..., 0] > 2 * rgb[..., 1]) & (rgb[..., 0] > 2 * rgb[..., 2])
    rows, columns = np.nonzero(red)
    uv, _ = project(CAMERA, pose, scene["red_cube"].vertices)
    assert (columns.min(), columns.max() + 1) == pytest.approx((uv[:, 0].min(), uv[:, 0].max()), abs=1.0)
    assert (rows.min(), rows.max() + 1) == pytest.approx((uv[:, 1].min(), uv[:, 1].max()), abs=1.0)
    assert not ((np.abs(rgb - [210, 30, 30]).sum(axis=-1) < 60) & ~red).any()


def test_textures_lie_on_surfaces_in_perspective():
    """A checkered ground of 1 m squares: their colours along a row change where the geometry says."""
    flat = Scene("flat", (block("ground", (-50, -50, -1), (50, 50, 0), "grass"),), MATERIALS, np.array([[-50.0] * 3, [50.0] * 3]))  # fmt: skip  # noqa: E501
    camera, pose = Camera(320, 320, 90.0), view_pose((0.0, 0.0, 4.0), 0.0, "front")
    with PyBulletRenderer(flat) as world:
        albedo, depth, surface = world.rasterise(camera, pose)
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
    camera, pose = Camera(320, 320, 90.0), view_pose((0.0, 0.0, 10.0), 0.0, "down")
    with PyBulletRenderer(plain) as world:
        rgb = world.render(camera, pose).rgb.astype(int)
    # The sun stands in the south-east: 1.7 m west and 0.9 m north of the cube's middle, the way to it meets the cube.
    assert sun[0] > 0 > sun[1]
    (shadow, light), _ = project(camera, pose, [(-1.7, 0.9, 0.0), (1.7, -0.9, 0.0)])
    in_shadow, in_light = (rgb[int(p[1]), int(p[0])] for p in (shadow, light))
    assert in_shadow[2] < 0.75 * in_light[2]


def test_the_sky_is_the_scene_s_and_not_white(scene, world):
    picture = world.render(CAMERA, view_pose((0, 0, 7.5), 0.0, "front"))
    sky = picture.rgb[np.isinf(picture.depth_m)]
    assert len(sky) > 1000
    assert sky[:, 2].mean() > sky[:, 0].mean() + 20
    assert np.ptp(picture.rgb[:100, 160].astype(int), axis=0).max() > 20


def test_a_world_gives_its_client_back(scene):
    """PyBullet has 1,024 clients at most: a renderer that keeps one would end a long run."""
    with PyBulletRenderer(Scene("small", scene.instances[:1], MATERIALS, scene.bounds)) as small:
        client = small._client
        assert pybullet.isConnected(client)
    assert not pybullet.isConnected(client)


def test_vertices_in_the_camera_s_own_plane_do_no_harm(scene):
    """TinyRenderer divides by zero there; routes on whole metres meet such vertices often."""
    curb = block("curb", (-24, -1, 0), (24, 1, 0.5), "blue")
    with PyBulletRenderer(Scene("long", (*scene.instances, curb), MATERIALS, scene.bounds)) as long:
        for view in VIEWS:
            for position in ((0.0, 0.0, 3.0), (0.0, 0.0, 0.75), (6.0, 0.0, 2.0), (-6.0, 3.0, 2.0)):
                depth = long.render(CAMERA, view_pose(position, 0.0, view)).depth_m
                assert not np.isnan(depth).any()
                assert depth.min() > 0.1


def test_previews_keep_the_latest_scene_and_sheets_hold_all_pictures(scene):
    image = look_at(scene, (-6, -6, 6), (5.5, 1.5, 1.5), 200, 120)
    assert image.shape == (120, 200, 3)
    assert scene_renderer(scene, "pybullet") is scene_renderer(scene, "pybullet")
    sheet = contact_sheet([image] * 5, list("abcde"), columns=3)
    assert sheet.shape[0] > 2 * 120
    assert sheet.shape[1] > 3 * 200
    found = sum(
        np.array_equal(sheet[r : r + 120, c : c + 200], image)
        for r in range(sheet.shape[0] - 119)
        for c in (4, 208, 412)
        if np.array_equal(sheet[r, c : c + 200], image[0])
    )
    assert found == 5
    with pytest.raises(ValueError, match="labels"):
        contact_sheet([image], ["a", "b"])


@pytest.mark.parametrize(("below", "east_is_right"), [(-6.0, True), (6.0, False)])
def test_a_look_straight_down_or_up_shows_north_at_the_top(below, east_is_right):
    north = instance("north", box((-0.5, 2.0, 5.0), (0.5, 3.0, 6.0)))
    east = instance("east", box((2.0, -0.5, 5.0), (3.0, 0.5, 6.0)))
    place = Scene("U_Test_0", (north, east), {"grey": Material("grey", (128, 128, 128))}, np.zeros((2, 3)))
    with RayRenderer(place) as renderer:
        picture = renderer.render(CAMERA, look_at_pose((0.0, 0.0, 5.5 - below), (0.0, 0.0, 5.5)))
    (rows, columns), (rows_east, columns_east) = (np.nonzero(picture.instance == k) for k in (0, 1))
    assert rows.max() < 160
    assert abs(columns.mean() - 159.5) < 1.0
    assert columns_east.min() > 160 if east_is_right else columns_east.max() < 160
    assert abs(rows_east.mean() - 159.5) < 1.0
