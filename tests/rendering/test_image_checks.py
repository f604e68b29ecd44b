"""Every check finds its planted fault, and none of them cries on a sound picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.rendered import MATERIALS, block, courtyard

from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.checks import Solid, ViewChecks, picture_flags
from aerialdojo_gen.rendering.world import PyBulletRenderer
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.schemas import VIEWS

CAMERA = Camera(320, 320, 90.0)
HERE, THERE = view_pose((1.0, 0.4, 3.0), 0.3, "front"), view_pose((2.0, 0.4, 3.0), 0.3, "front")


@pytest.fixture(scope="module")
def scene():
    return courtyard()


@pytest.fixture(scope="module")
def world(scene):
    with PyBulletRenderer(scene) as world:
        yield world


@pytest.fixture(scope="module")
def solid(scene):
    return Solid(scene)


@pytest.fixture(scope="module")
def sound(world):
    return world.render(CAMERA, HERE)


def flags_of(solid, *frames):
    checks = ViewChecks(CAMERA, solid)
    for picture, pose in frames:
        checks.add(picture, pose)
    return checks.flags


@pytest.mark.parametrize("view", VIEWS)
def test_sound_pictures_have_no_flags(world, solid, view):
    poses = [view_pose((-2 + 0.7 * k, 1 - 0.3 * k, 2.5 + 0.4 * k), 0.5 * k, view) for k in range(6)]
    assert flags_of(solid, *((world.render(CAMERA, pose), pose) for pose in poses)) == set()


def test_black(sound, solid):
    assert "black" in flags_of(solid, (replace(sound, rgb=np.zeros_like(sound.rgb)), HERE))


def test_uniform(sound, solid):
    assert flags_of(solid, (replace(sound, rgb=np.full_like(sound.rgb, 130)), HERE)) == {"uniform"}


def test_frozen_only_where_the_camera_moved(sound, solid):
    assert "frozen" in flags_of(solid, (sound, HERE), (sound, THERE))
    assert flags_of(solid, (sound, HERE), (sound, HERE)) == set()


def test_the_sky_stands_still_until_the_camera_tilts(world, solid):
    # High above everything, looking level: nothing but sky, the same from wherever it is seen; clouds tell the sides.
    low, high, turned, tilted = (
        view_pose((0.0, 0.0, z), yaw, view)
        for z, yaw, view in (
            (400.0, 0.2, "front"),
            (401.0, 0.2, "front"),
            (400.0, 1.2, "front"),
            (400.0, 0.2, "down"),
        )
    )
    far = Camera(CAMERA.width, CAMERA.height, 20.0)
    sky = world.render(far, low)
    assert not np.isfinite(sky.depth_m).any()
    assert np.array_equal(sky.rgb, world.render(far, high).rgb)
    assert not np.array_equal(sky.rgb, world.render(far, turned).rgb)
    assert "frozen" not in flags_of(solid, (sky, low), (sky, high), (sky, turned))
    assert "frozen" in flags_of(solid, (sky, low), (sky, tilted))


@pytest.mark.parametrize("value", [np.nan, -0.5, 0.0])
def test_depth_invalid(sound, solid, value):
    depth = sound.depth_m.copy()
    depth[100, 100] = value
    assert "depth_invalid" in flags_of(solid, (replace(sound, depth_m=depth), HERE))


@pytest.mark.parametrize(
    "fault",
    [
        lambda depth: np.roll(depth, 1, axis=0),  # a row too low
        lambda depth: np.roll(depth, 4, axis=1),
        lambda depth: depth * np.float32(1.02),
        lambda depth: np.full_like(depth, np.inf),  # surfaces taken for sky
        lambda depth: depth[:, ::-1].copy(),
    ],
)
def test_depth_mismatch(sound, solid, fault):
    assert flags_of(solid, (replace(sound, depth_m=fault(sound.depth_m)), HERE)) == {"depth_mismatch"}


def test_sky_taken_for_a_surface():
    flat = Scene("flat", (block("ground", (-50, -50, -1), (50, 50, 0), "grass"),), MATERIALS, np.array([[-50.0] * 3, [50.0] * 3]))  # fmt: skip  # noqa: E501
    with PyBulletRenderer(flat) as world:
        picture = world.render(CAMERA, HERE)
    depth = np.where(np.isinf(picture.depth_m), np.float32(40.0), picture.depth_m)
    assert flags_of(Solid(flat), (picture, HERE)) == set()
    assert flags_of(Solid(flat), (replace(picture, depth_m=depth), HERE)) == {"depth_mismatch"}


@pytest.mark.parametrize("view", VIEWS)
def test_camera_inside_a_solid(world, solid, view):
    pose = view_pose((5.5, 1.5, 1.5), 0.2, view)
    assert "camera_inside" in flags_of(solid, (world.render(CAMERA, pose), pose))


def test_camera_against_a_wall(world):
    """The body's radius keeps its cameras 0.14 m from any surface; this one is at 0.11 m."""
    assert "camera_inside" in picture_flags(world.render(CAMERA, view_pose((7.89, 0.0, 4.0), 0.0, "front")))
