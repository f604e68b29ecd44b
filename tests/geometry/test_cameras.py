from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerialdojo_gen.geometry.cameras import Camera, look_at_pose, project, view_pose
from aerialdojo_gen.store.schemas import VIEWS

metres = st.floats(-100, 100)
yaws = st.floats(-math.pi, math.pi)


def test_intrinsics_put_the_axis_in_the_middle_and_the_field_of_view_at_the_edges():
    camera = Camera(640, 640, 90.0)
    assert camera.matrix == pytest.approx(np.array([[320, 0, 320], [0, 320, 320], [0, 0, 1]]), abs=1e-9)
    uv, depth = project(camera, np.eye(4), [(0, 0, 5), (5, 0, 5), (0, -5, 5)])
    assert uv == pytest.approx(np.array([(320, 320), (640, 320), (320, 0)]), abs=1e-9)
    assert depth == pytest.approx(5.0)


def test_rays_go_through_pixel_centres():
    camera = Camera(64, 48, 70.0)
    rays = camera.rays()
    assert rays.shape == (48, 64, 3)
    uv, _ = project(camera, np.eye(4), rays)
    assert uv[0, 0] == pytest.approx((0.5, 0.5))
    assert uv[47, 63] == pytest.approx((63.5, 47.5))


@pytest.mark.parametrize(
    ("view", "forward", "up"),
    [
        ("front", (0, 1, 0), (0, 0, 1)),
        ("left", (-1, 0, 0), (0, 0, 1)),
        ("right", (1, 0, 0), (0, 0, 1)),
        ("down", (0, 0, -1), (0, 1, 0)),
    ],
)
def test_views_of_a_body_that_faces_north(view, forward, up):
    pose = view_pose((1, 2, 3), math.pi / 2, view)
    assert pose[:3, 2] == pytest.approx(np.array(forward), abs=1e-12)
    assert -pose[:3, 1] == pytest.approx(np.array(up), abs=1e-12)
    assert pose[:3, 3] == pytest.approx((1, 2, 3))


@given(st.tuples(metres, metres, metres), yaws, st.sampled_from(VIEWS))
def test_poses_are_rigid(position, yaw, view):
    rotation = view_pose(position, yaw, view)[:3, :3]
    assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@given(
    st.tuples(metres, metres, metres), yaws, st.sampled_from(VIEWS),
    st.tuples(st.floats(0, 640), st.floats(0, 480)), st.floats(0.1, 200),
)  # fmt: skip
def test_a_point_is_projected_where_its_ray_left_the_image(position, yaw, view, uv, depth):
    camera, pose = Camera(640, 480, 75.0), view_pose(position, yaw, view)
    plane = (np.array(uv) - [320.0, 240.0]) / camera.focal_px
    back, back_depth = project(camera, pose, [pose[:3, :3] @ [*(plane * depth), depth] + pose[:3, 3]])
    assert back[0] == pytest.approx(uv, abs=1e-6)
    assert back_depth[0] == pytest.approx(depth, abs=1e-9)


@given(st.tuples(metres, metres, metres), yaws, st.floats(0.5, 50), st.floats(-1, 1))
def test_front_and_left_meet_at_their_shared_edge(position, yaw, along, height):
    """A point at 45° between two views lies on the edge of both, in the same row and at the same depth."""
    camera = Camera(640, 640, 90.0)
    c, s = math.cos(yaw + math.pi / 4), math.sin(yaw + math.pi / 4)
    point = np.asarray(position) + along * np.array([c, s, height * math.sqrt(0.5)])
    (u_front, v_front), depth_front = (a[0] for a in project(camera, view_pose(position, yaw, "front"), [point]))
    (u_left, v_left), depth_left = (a[0] for a in project(camera, view_pose(position, yaw, "left"), [point]))
    assert (u_front, u_left) == pytest.approx((0, 640), abs=1e-6)
    assert v_front == pytest.approx(v_left, abs=1e-6)
    assert depth_front == pytest.approx(depth_left, abs=1e-9)


@given(st.tuples(metres, metres, metres), st.tuples(metres, metres, metres))
def test_look_at_sees_its_target_in_the_middle_upright(eye, target):
    if np.linalg.norm(np.subtract(eye, target)) < 0.1:
        with pytest.raises(ValueError, match="cannot look"):
            look_at_pose(eye, eye)
        return
    pose = look_at_pose(eye, target)
    uv, depth = project(Camera(), pose, [target])
    assert uv[0] == pytest.approx((320, 320), abs=0.1)
    assert depth[0] > 0
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    assert -pose[2, 1] > -1e-9


@pytest.mark.parametrize("away", [0.0, 1e-9, -1e-9])
@pytest.mark.parametrize(("below", "right"), [(-10.0, (1, 0, 0)), (10.0, (-1, 0, 0))])
def test_looking_straight_down_or_up_north_is_at_the_top(below, right, away):
    pose = look_at_pose((3.0, 4.0, 5.0), (3.0 + away, 4.0 - away, 5.0 + below))
    axes = np.array([right, (0, -1, 0), (0, 0, math.copysign(1, below))]).T
    assert pose[:3, :3] == pytest.approx(axes, abs=1e-9)
    assert pose[:3, 3] == pytest.approx((3, 4, 5))


@given(st.floats(-math.pi, math.pi), st.sampled_from([-1.0, 1.0]), st.floats(1e-3, 1.0))
def test_nearly_straight_what_is_ahead_is_at_the_top_of_a_look_down_and_at_the_bottom_of_a_look_up(yaw, up, tilt):
    c, s = math.cos(yaw), math.sin(yaw)
    pose = look_at_pose((0.0, 0.0, 0.0), (tilt * c, tilt * s, up))
    assert pose[:3, 0] == pytest.approx((s, -c, 0.0), abs=1e-9)
    (_, middle), (_, ahead) = project(
        Camera(), pose, [(tilt * c, tilt * s, up), (1.5 * tilt * c, 1.5 * tilt * s, up)]
    )[0]
    assert (ahead < middle) == (up < 0)


def test_a_camera_without_pixels_is_refused():
    with pytest.raises(ValueError, match="no camera"):
        Camera(0, 10)
    with pytest.raises(ValueError, match="no camera"):
        Camera(10, 10, 180.0)
