"""Every check finds its planted fault, and none of them cries on a sound picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.rendered import courtyard

from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.checks import Solid, ViewChecks, picture_flags
from aerialdojo_gen.rendering.world import PyBulletRenderer
from aerialdojo_gen.store.schemas import VIEWS

CAMERA = Camera(160, 160, 90.0)
HERE, THERE = view_pose((1.0, 0.4, 3.0), 0.3, "front"), view_pose((2.0, 0.4, 3.0), 0.3, "front")


@pytest.fixture(scope="module")
def world():
    with PyBulletRenderer(courtyard()) as world:
        yield world


@pytest.fixture(scope="module")
def solid():
    return Solid(courtyard())


@pytest.fixture(scope="module")
def sound(world):
    return world.render(CAMERA, HERE)


def flags_of(solid, *frames):
    checks = ViewChecks(CAMERA, solid)
    for picture, pose in frames:
        checks.add(picture, pose)
    return checks.flags


@pytest.mark.parametrize("view", VIEWS)
def test_sound_pictures_have_no_flags_and_those_from_within_a_solid_do(world, solid, view):
    poses = [view_pose((-2 + 0.7 * k, 1 - 0.3 * k, 2.5 + 0.4 * k), 0.5 * k, view) for k in range(6)]
    assert flags_of(solid, *((world.render(CAMERA, pose), pose) for pose in poses)) == set()
    inside = view_pose((5.5, 1.5, 1.5), 0.2, view)
    assert "camera_inside" in flags_of(solid, (world.render(CAMERA, inside), inside))


def test_camera_against_a_wall(world):
    """The body's radius keeps its cameras 0.14 m from any surface; this one is at 0.11 m."""
    assert "camera_inside" in picture_flags(world.render(CAMERA, view_pose((7.89, 0.0, 4.0), 0.0, "front")))


def with_one(value):
    def fault(depth_m):
        depth_m = depth_m.copy()
        depth_m[50, 50] = value
        return depth_m

    return fault


@pytest.mark.parametrize(
    ("flag", "name", "fault"),
    [
        ("black", "rgb", np.zeros_like),
        ("uniform", "rgb", lambda rgb: np.full_like(rgb, 130)),
        *(("depth_invalid", "depth_m", with_one(value)) for value in (np.nan, -0.5, 0.0)),
        ("depth_mismatch", "depth_m", lambda depth_m: np.roll(depth_m, 1, axis=0)),  # a row too low
        ("depth_mismatch", "depth_m", lambda depth_m: np.roll(depth_m, 4, axis=1)),
        ("depth_mismatch", "depth_m", lambda depth_m: depth_m * np.float32(1.02)),
        ("depth_mismatch", "depth_m", lambda depth_m: np.full_like(depth_m, np.inf)),  # surfaces taken for sky
        ("depth_mismatch", "depth_m", lambda depth_m: depth_m[:, ::-1].copy()),
    ],
)
def test_a_planted_fault_has_its_flag(sound, solid, flag, name, fault):
    found = flags_of(solid, (replace(sound, **{name: fault(getattr(sound, name))}), HERE))
    assert found == {flag} if flag in ("uniform", "depth_mismatch") else flag in found


def test_frozen_only_where_the_camera_moved(sound, solid):
    assert "frozen" in flags_of(solid, (sound, HERE), (sound, THERE))
    assert flags_of(solid, (sound, HERE), (sound, HERE)) == set()


def test_the_sky_stands_still_until_the_camera_tilts(world, solid):
    # High above everything, looking level: nothing but sky, the same from wherever it is seen; clouds tell the sides.
    low, high, turned, tilted = (
        view_pose((0.0, 0.0, z), yaw, view)
        for z, yaw, view in ((400, 0.2, "front"), (401, 0.2, "front"), (400, 1.2, "front"), (400, 0.2, "down"))
    )
    far = Camera(CAMERA.width, CAMERA.height, 20.0)
    sky = world.render(far, low)
    assert not np.isfinite(sky.depth_m).any()
    assert np.array_equal(sky.rgb, world.render(far, high).rgb)
    assert not np.array_equal(sky.rgb, world.render(far, turned).rgb)
    assert "frozen" not in flags_of(solid, (sky, low), (sky, high), (sky, turned))
    assert "frozen" in flags_of(solid, (sky, low), (sky, tilted))


def test_sky_taken_for_a_surface(world, solid):
    over = view_pose((1.0, 0.4, 7.5), 0.3, "front")
    picture = world.render(CAMERA, over)
    depth_m = np.where(np.isinf(picture.depth_m), np.float32(40.0), picture.depth_m)
    assert flags_of(solid, (picture, over)) == set()
    assert flags_of(solid, (replace(picture, depth_m=depth_m), over)) == {"depth_mismatch"}
