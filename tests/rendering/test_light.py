"""Light: where the sun stands, that walls do not tell north, and lights that are chosen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.layout_checks import ASSETS
from support.rendered import MATERIALS, block

from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.backend import open_renderer, scene_renderer
from aerialdojo_gen.rendering.raycast import RayRenderer
from aerialdojo_gen.scenes.light import RANDOM, WEATHERS, Light, LightHead, chosen_light, sun_at
from aerialdojo_gen.scenes.model import Scene

PLANS = sorted((ASSETS / "scenes").glob("*.toml"))


def court() -> Scene:
    """A square court between four walls of one grey, which is the same from all sides."""
    places = (((8, -9, 0), (9, 9, 8)), ((-9, -9, 0), (-8, 9, 8)), ((-8, 8, 0), (8, 9, 8)), ((-8, -9, 0), (8, -8, 8)))
    walls = [block(f"wall_{k}", low, high, "grey") for k, (low, high) in enumerate(places)]
    ground = block("ground", (-12, -12, -1), (12, 12, 0), "grey")
    return Scene("U_Court_0", (ground, *walls), MATERIALS, np.array([[-12.0] * 3, [12.0] * 3]))


def lights() -> list[Light]:
    heads = [LightHead(**read_toml(path, AssetError)["light"]) for path in PLANS]
    return [Light(sun_at(head.latitude_deg, head.date, head.hour), head.weather) for head in heads]


@pytest.mark.parametrize(
    ("latitude", "day", "hour", "azimuth", "elevation"),
    [
        (50.0, "06-21", 12.0, 180.0, 63.4),
        (50.0, "12-21", 12.0, 180.0, 16.6),
        (-35.0, "12-21", 12.0, 0.0, 78.4),
        (0.0, "03-21", 9.0, 90.0, 45.0),
    ],
)
def test_the_sun_stands_where_almanacs_say(latitude, day, hour, azimuth, elevation):
    x, y, z = sun_at(latitude, day, hour)
    assert math.degrees(math.asin(z)) == pytest.approx(elevation, abs=0.5)
    assert math.degrees(math.atan2(x, y)) % 360.0 == pytest.approx(azimuth, abs=1.0)


def test_the_suns_of_the_scenes_stand_all_round():
    azimuth = np.array([math.atan2(light.sun[0], light.sun[1]) for light in lights()])
    assert np.histogram(azimuth, bins=8, range=(-math.pi, math.pi))[0].min() >= 3
    assert abs(np.exp(1j * azimuth).mean()) < 0.1
    assert {light.weather for light in lights()} == set(WEATHERS)


def test_walls_do_not_tell_north():
    """A linear probe on the brightness of columns, fitted in half of the lights, knows no heading in the others."""
    scene, camera = court(), Camera(32, 32, 90.0)
    renderer, seen, headings = RayRenderer(scene), [], np.arange(8) * math.pi / 4
    for light in lights():
        renderer.relight(light)
        for heading in headings:
            rgb = renderer.render(camera, view_pose((0.0, 0.0, 3.0), heading, "front")).rgb
            seen.append(np.append(rgb.astype(float).mean(axis=(0, 2)) / 255.0, 1.0))
    x = np.array(seen)
    target = np.tile(np.stack([np.cos(headings), np.sin(headings)], axis=1), (len(PLANS), 1))
    right = []
    for k in range(30):
        train = np.repeat(generator(0, "probe", k).permutation(len(PLANS)) < len(PLANS) // 2, 8)
        ridge = x[train].T @ x[train] + 0.1 * np.eye(x.shape[1])
        told = x[~train] @ np.linalg.solve(ridge, x[train].T @ target[train])
        told /= np.linalg.norm(told, axis=1, keepdims=True)
        right.append(np.einsum("ij,ij->i", told, target[~train]).mean())
    # The mean cosine of its error: 0 is a blind guess, 1 a compass.
    assert np.mean(right) < 0.08


@pytest.mark.parametrize("name", ["pybullet", "gl", "rays"])
def test_a_renderer_that_is_lit_anew_draws_as_one_of_that_light(name):
    scene, camera, pose = court(), Camera(48, 48, 90.0), view_pose((1.0, 1.0, 3.0), 0.5, "front")
    # Another sun throws other shadows.
    low = Light((-0.6, 0.5, 0.62), "dusk")
    with opened(scene, name) as renderer, opened(replace(scene, sun=low.sun, weather=low.weather), name) as fresh:
        own = renderer.render(camera, pose).rgb
        renderer.relight(low)
        assert renderer.light == low
        lit = renderer.render(camera, pose).rgb
        assert np.array_equal(lit, fresh.render(camera, pose).rgb)
        assert not np.array_equal(lit, own)


def opened(scene, name):
    return RayRenderer(scene) if name == "rays" else open_renderer(scene, name)


def test_a_scenes_renderer_is_lit_as_is_asked_for_each_time():
    scene, camera, pose = court(), Camera(48, 48, 90.0), view_pose((1.0, 1.0, 3.0), 0.5, "front")
    own, wet, again = (
        scene_renderer(scene, "gl", light).render(camera, pose).rgb
        for light in (None, chosen_light(scene.light, "wet"), None)
    )
    assert not np.array_equal(wet, own)
    assert np.array_equal(again, own)


def test_drawn_lights_are_those_of_their_key_and_differ():
    own = Light((0.0, 0.0, 1.0))
    drawn = [chosen_light(own, RANDOM, 0, f"task-{k}") for k in range(40)]
    assert drawn == [chosen_light(own, RANDOM, 0, f"task-{k}") for k in range(40)]
    assert {light.weather for light in drawn} == set(WEATHERS)
    assert len({light.sun for light in drawn}) == 40
    assert min(light.sun[2] for light in drawn) > 0.0
    with pytest.raises(UsageError, match="no light 'fog'"):
        Sensors(light="fog")
