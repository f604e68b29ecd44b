from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from aerialdojo_gen.geometry.cameras import Camera, look_at_pose, project, view_pose
from aerialdojo_gen.store.schemas import VIEWS

metres = st.floats(-100, 100)
places = st.tuples(metres, metres, metres)
yaws = st.floats(-math.pi, math.pi)
# Where each view looks and what is at its top, seen from a body that faces east.
AXES = {
    "front": ((1, 0, 0), (0, 0, 1)), "left": ((0, 1, 0), (0, 0, 1)), "right": ((0, -1, 0), (0, 0, 1)),
    "down": ((0, 0, -1), (1, 0, 0)),
}  # fmt: skip


def test_intrinsics_put_the_axis_in_the_middle_and_the_field_of_view_at_the_edges():
    camera = Camera(640, 640, 90.0)
    assert camera.matrix == pytest.approx(np.array([[320, 0, 320], [0, 320, 320], [0, 0, 1]]), abs=1e-9)
    uv, depth = project(camera, np.eye(4), [(0, 0, 5), (5, 0, 5), (0, -5, 5)])
    assert uv == pytest.approx(np.array([(320, 320), (640, 320), (320, 0)]), abs=1e-9)
    assert depth == pytest.approx(5.0)


@given(places, yaws, st.sampled_from(VIEWS))
def test_views_are_turned_with_the_body(place, yaw, view):
    pose, c, s = view_pose(place, yaw, view), math.cos(yaw), math.sin(yaw)
    forward, up = (np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ axis for axis in AXES[view])
    assert pose[:3, :3] == pytest.approx(np.stack([np.cross(forward, up), -up, forward], axis=1), abs=1e-12)
    assert pose[:, 3] == pytest.approx([*place, 1.0])


@given(places, yaws, st.sampled_from(VIEWS), st.floats(0.1, 200))
def test_a_point_is_projected_where_its_ray_left_the_image(place, yaw, view, depth):
    camera, pose = Camera(24, 18, 75.0), view_pose(place, yaw, view)
    uv, back_depth = project(camera, pose, depth * camera.rays() @ pose[:3, :3].T + pose[:3, 3])
    centres = np.meshgrid(np.arange(24) + 0.5, np.arange(18) + 0.5)
    assert uv == pytest.approx(np.stack(centres, axis=-1), abs=1e-6)
    assert back_depth == pytest.approx(depth, abs=1e-9)


@given(places, places)
@example((0.0, 0.0, 0.0), (1e-3, 0.0, 1.0))
@example((0.0, 0.0, 0.0), (0.0, 1e-3, -1.0))
def test_a_look_is_level_and_has_its_target_in_the_middle(eye, target):
    if np.linalg.norm(np.subtract(eye, target)) < 0.1:
        with pytest.raises(ValueError, match="cannot look"):
            look_at_pose(eye, eye)
        return
    pose = look_at_pose(eye, target)
    uv, depth = project(Camera(), pose, [target])
    assert uv[0] == pytest.approx((320, 320), abs=0.1)
    assert depth[0] > 0
    right, down, forward = pose[:3, :3].T
    assert np.cross(right, down) == pytest.approx(forward, abs=1e-9)
    assert np.linalg.norm(pose[:3, :3], axis=0) == pytest.approx(1.0)
    assert right[2] == 0.0
    assert down[2] < 1e-9


@pytest.mark.parametrize("away", [0.0, 1e-9, -1e-9])
@pytest.mark.parametrize(("below", "right"), [(-10.0, (1, 0, 0)), (10.0, (-1, 0, 0))])
def test_looking_straight_down_or_up_north_is_at_the_top(below, right, away):
    pose = look_at_pose((3.0, 4.0, 5.0), (3.0 + away, 4.0 - away, 5.0 + below))
    axes = np.array([right, (0, -1, 0), (0, 0, math.copysign(1, below))]).T
    assert pose[:3, :3] == pytest.approx(axes, abs=1e-9)
    assert pose[:3, 3] == pytest.approx((3, 4, 5))


def test_a_camera_without_pixels_is_refused():
    for wrong in ((0, 10), (10, 10, 180.0)):
        with pytest.raises(ValueError, match="no camera"):
            Camera(*wrong)
