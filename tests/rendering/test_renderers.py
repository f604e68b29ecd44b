"""Every renderer shows what ray casts say; the two agree; a wrong one is refused."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.rendered import MATERIALS, block, courtyard, same_picture

from aerialdojo_gen.base.errors import RenderError
from aerialdojo_gen.geometry.cameras import Camera, look_at_pose, project, view_pose
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.rendering import backend
from aerialdojo_gen.rendering.backend import (
    check_renderer,
    choose_renderer,
    open_renderer,
    probe_scene,
    scene_renderer,
)
from aerialdojo_gen.rendering.gallery import contact_sheet, look_at
from aerialdojo_gen.rendering.world import PyBulletRenderer, pybullet
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.schemas import VIEWS

CAMERA, LARGE = Camera(160, 160, 90.0), Camera(320, 320, 90.0)
every_renderer = pytest.mark.parametrize("name", ["pybullet", "gl"], scope="module")


@pytest.fixture(scope="module")
def scene():
    return courtyard()


@pytest.fixture(scope="module")
def opened(scene):
    with ExitStack() as stack:
        yield cache(lambda name: stack.enter_context(open_renderer(scene, name)))


@pytest.fixture(scope="module")
def rays(scene):
    return RayCaster(scene)


def cast(rays, camera, pose):
    directions = camera.rays().reshape(-1, 3)
    along, owner = rays.first_hit(pose[:3, 3], directions @ pose[:3, :3].T)
    shape = camera.height, camera.width
    return (along / np.linalg.norm(directions, axis=1)).reshape(shape), owner.reshape(shape)


@every_renderer
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("position", [(-1.0, 2.0, 3.1), (0.0, 0.0, 3.0)])
def test_depth_and_instances_are_what_ray_casts_hit(opened, rays, name, view, position):
    """The second position has vertices in the camera's own plane."""
    pose = view_pose(position, 0.4, view)
    picture = opened(name).render(CAMERA, pose, instances=True)
    depth, owner = cast(rays, CAMERA, pose)
    with np.errstate(invalid="ignore"):
        right = (np.abs(picture.depth_m - depth) < 0.01) | (np.isinf(depth) & np.isinf(picture.depth_m))
    assert right.mean() > 0.999
    assert (picture.instance == owner).mean() > 0.999
    assert np.array_equal(picture.instance < 0, np.isinf(picture.depth_m))
    red, green, blue = np.moveaxis(picture.rgb.astype(int), -1, 0)
    is_red = (red > 2 * green) & (red > 2 * blue)
    assert (is_red == (owner == rays.nodes.index("red_cube"))).mean() > 0.999
    assert (picture.rgb.dtype, picture.depth_m.dtype, picture.instance.dtype) == (np.uint8, np.float32, np.int32)


@given(
    st.tuples(st.floats(-7.5, 7.5), st.floats(-7.5, 7.5), st.floats(0.3, 11.0)),
    st.tuples(*[st.floats(-20, 20)] * 3),
    st.sampled_from([(97, 41, 70.0), (64, 64, 90.0), (30, 120, 20.0)]),
)
@settings(max_examples=25, deadline=None)
def test_nothing_that_is_in_view_is_left_out(opened, rays, eye, target, size):
    """What is not drawn is chosen triangle by triangle: no choice may cost a pixel, whatever the camera."""
    if np.linalg.norm(np.subtract(target, eye)) < 1e-3:
        return
    camera, pose = Camera(*size), look_at_pose(eye, target)
    picture = opened("gl").render(camera, pose)
    depth, _ = cast(rays, camera, pose)
    # From inside a cube, ray casts see its faces from behind; surfaces nearer than the near plane are not drawn.
    if any(
        np.abs(np.subtract(eye, middle)).max() < edge for middle, edge in (((5.5, 1.5, 1.5), 0.8), ((-2, -5, 1), 1.3))
    ):
        return
    with np.errstate(invalid="ignore"):
        near = np.abs(picture.depth_m - depth) < 0.01 + 1e-3 * depth
    # Left are the pixels that an edge crosses.
    assert (near | (np.isinf(depth) & np.isinf(picture.depth_m))).mean() > 0.99


@pytest.mark.parametrize("view", VIEWS)
def test_the_renderers_agree_on_colour_away_from_edges(opened, view):
    pose = view_pose((-1.0, 2.0, 3.1), 0.4, view)
    one, other = (opened(name).render(Camera(320, 320), pose).rgb for name in ("pybullet", "gl"))
    difference = np.abs(one.astype(int) - other).mean(axis=2)
    kernel, flat = np.ones((3, 3), dtype=np.uint8), np.ones(difference.shape, dtype=bool)
    for rgb in (one, other):
        flat &= (cv2.dilate(rgb, kernel).astype(int) - cv2.erode(rgb, kernel)).max(axis=2) < 24
    assert flat.mean() > 0.4
    assert difference[flat].mean() < 1.0
    assert difference.mean() < 3.0


@every_renderer
def test_textures_lie_the_right_way_up(name):
    """A sign whose texture is red at the top (row 0) and blue below, on a wall seen from the west."""
    texture = np.zeros((8, 8, 3), dtype=np.uint8)
    texture[:4], texture[4:] = (220, 20, 20), (20, 20, 220)
    sign = block("sign", (5.0, -1.0, 0.0), (5.2, 1.0, 2.0), "grass")
    part = sign.parts[0]
    upright = replace(part, uv=(part.vertices[:, 1:] / 2).astype(np.float32))
    materials = MATERIALS | {"grass": replace(MATERIALS["grass"], texture=texture)}
    scene = Scene("sign", (replace(sign, parts=(upright,)),), materials, np.array([[-9.0] * 3, [9.0] * 3]))
    with open_renderer(scene, name) as renderer:
        rgb = renderer.render(Camera(200, 200), view_pose((2.0, 0.0, 1.0), 0.0, "front")).rgb.astype(int)
    assert rgb[85, 100, 0] > 2 * rgb[85, 100, 2]
    assert rgb[115, 100, 2] > 2 * rgb[115, 100, 0]


@every_renderer
def test_a_picture_depends_on_nothing_drawn_before_or_beside_it(scene, opened, name):
    """Drawn alone, by a renderer made anew after another size, and together with views of the same eye and others."""
    camera = Camera(160, 120, 90.0)
    places = (((-1, 2, 2.5), 0.3), ((1, 1, 3), 2.0), ((0, -3, 4), 1.0))
    poses = [view_pose(*place, view) for view in VIEWS for place in places]
    alone = [opened(name).render(camera, pose, instances=True) for pose in poses]
    assert opened(name).render(camera, poses[0]).instance is None
    with open_renderer(scene, name) as anew:
        anew.render(Camera(32, 64), poses[0])
        together = anew.render_views(camera, poses, instances=True)
    assert len(together) == len(poses)
    assert all(same_picture(one, other) for one, other in zip(alone, together, strict=True))


@every_renderer
def test_a_sound_renderer_passes_the_check_at_start(name):
    choice = choose_renderer(name)
    assert choice.name == name
    assert choose_renderer("auto").name == "gl", "the fast one"
    assert "depth within 1 cm of ray casts at 100.00 % of 147,456 pixels" in choice.why
    assert "\n" not in choice.why


@pytest.fixture
def fresh_choice():
    choose_renderer.cache_clear()
    yield
    choose_renderer.cache_clear()


@pytest.fixture(scope="module")
def probe():
    with open_renderer(probe_scene(), "pybullet") as renderer:
        yield renderer


@pytest.mark.parametrize(
    "fault",
    [
        lambda p: replace(p, depth_m=np.roll(p.depth_m, 1, axis=0)),
        lambda p: replace(p, depth_m=np.roll(p.depth_m, 1, axis=1)),
        lambda p: replace(p, depth_m=p.depth_m * np.float32(1.01)),
        lambda p: replace(p, depth_m=np.where(np.isinf(p.depth_m), np.float32(2000), p.depth_m)),  # sky is a hit
        lambda p: replace(p, rgb=p.rgb[..., ::-1].copy()),
        lambda p: replace(p, rgb=p.rgb[:, ::-1].copy()),
    ],
)
def test_a_renderer_that_draws_what_is_not_there_is_refused(probe, fault, monkeypatch):
    draw = probe.render
    monkeypatch.setattr(probe, "render", lambda *view: fault(draw(*view)))
    with pytest.raises(RenderError, match="rejected: "):
        check_renderer(probe)


def test_auto_passes_over_what_does_not_work_and_says_so(monkeypatch, fresh_choice, probe):
    def open_one(scene, name="auto"):
        if name == "gl":
            raise RenderError("the renderer gl lacks the package moderngl: install it")
        return nullcontext(probe)

    monkeypatch.setattr(backend, "open_renderer", open_one)
    choice = choose_renderer()
    assert choice.name == "pybullet"
    assert "lacks the package moderngl: install it" in choice.why
    with pytest.raises(RenderError, match="lacks the package moderngl"):
        choose_renderer("gl")


def test_an_unknown_renderer_is_named():
    with pytest.raises(RenderError, match="unknown renderer 'blender': one of gl, pybullet, or auto"):
        open_renderer(probe_scene(), "blender")


def test_every_thread_draws_by_itself(scene, opened):
    """A thread that is gone, one beside it, and the closing of what another one made harm nobody's pictures."""
    pose = view_pose((1, 1, 3), 2.0, "front")
    expected = opened("gl").render(CAMERA, pose).rgb

    def drawn():
        return scene_renderer(scene, "gl").render(CAMERA, pose).rgb, scene_renderer(scene, "gl")

    pictures, kept = [], []
    for _ in range(2):
        with ThreadPoolExecutor(1) as one:
            rgb, renderer = one.submit(drawn).result()
            pictures.append(rgb)
            kept.append(renderer)
    with ThreadPoolExecutor(2) as both:
        pictures += [rgb for rgb, _ in both.map(lambda _: drawn(), range(4))]
    for renderer in kept:
        renderer.close()
    pictures += [drawn()[0], opened("gl").render(CAMERA, pose).rgb]
    assert kept[0] is not kept[1]
    assert all(np.array_equal(rgb, expected) for rgb in pictures)


def test_textures_lie_on_surfaces_in_perspective():
    """A checkered ground of 1 m squares: their colours along a row change where the geometry says."""
    ground = block("ground", (-50, -50, -1), (50, 50, 0), "grass")
    with PyBulletRenderer(Scene("flat", (ground,), MATERIALS, np.array([[-50.0] * 3, [50.0] * 3]))) as world:
        albedo, depth, surface = world.rasterise(LARGE, view_pose((0.0, 0.0, 4.0), 0.0, "front"))
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
        rgb = world.render(LARGE, pose).rgb.astype(int)
    # The sun stands in the south-east: 1.7 m west and 0.9 m north of the cube's middle, the way to it meets the cube.
    assert sun[0] > 0 > sun[1]
    (shadow, light), _ = project(LARGE, pose, [(-1.7, 0.9, 0.0), (1.7, -0.9, 0.0)])
    in_shadow, in_light = (rgb[int(p[1]), int(p[0])] for p in (shadow, light))
    assert in_shadow[2] < 0.75 * in_light[2]


def test_a_world_shows_its_sky_gives_its_client_back_and_suffers_vertices_in_the_camera_s_own_plane(scene):
    """PyBullet has 1,024 clients at most: a renderer that keeps one would end a long run.

    TinyRenderer divides by zero at such vertices; routes on whole metres meet them often.
    """
    curb = block("curb", (-24, -1, 0), (24, 1, 0.5), "blue")
    with PyBulletRenderer(Scene("long", (*scene.instances, curb), MATERIALS, scene.bounds)) as long:
        picture, client = long.render(LARGE, view_pose((0, 0, 7.5), 0.0, "front")), long._client
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
