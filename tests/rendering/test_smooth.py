"""Which edges the OpenGL renderer draws smooth."""

import numpy as np

from aerialdojo_gen.rendering.gl_geometry import VERTEX, smooth
from aerialdojo_gen.scenes.mesh import Mesh
from aerialdojo_gen.scenes.shapes import box, sphere


def rows_of(body: Mesh) -> np.ndarray:
    corners = body.vertices[body.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows = np.zeros((len(corners), 3), VERTEX)
    rows["position"], rows["normal"] = corners, (normal / np.linalg.norm(normal, axis=1, keepdims=True))[:, None]
    return rows


def test_a_ball_is_round_and_a_box_is_not() -> None:
    ball = rows_of(sphere(radius=1.0))
    flat = ball["normal"].copy()
    two = np.concatenate([ball[::2], ball[1::2]])  # Of two materials
    smooth(two, np.zeros(len(two), np.int64), np.array([0.7]))
    for half, before in zip(np.split(two, [len(ball[::2])]), (flat[::2], flat[1::2]), strict=True):
        out = half["position"] / np.linalg.norm(half["position"], axis=2, keepdims=True)
        assert (half["normal"] * out).sum(axis=2).min() > 0.99
        assert (before * out).sum(axis=2).min() < 0.98
    crate = rows_of(box(size=[1.0, 2.0, 3.0]))
    before = crate["normal"].copy()
    smooth(crate, np.zeros(len(crate), np.int64), np.array([0.45]))
    np.testing.assert_allclose(crate["normal"], before, atol=1e-6)


def test_groups_are_smooth_by_themselves_and_what_has_none_is_flat() -> None:
    ball = rows_of(sphere(radius=1.0))
    whole, flat = ball.copy(), ball["normal"].copy()
    smooth(whole, np.zeros(len(ball), np.int64), np.array([0.7]))
    three = np.concatenate([ball, ball, ball])
    group = np.repeat(np.array([1, -1, 0]), len(ball))
    smooth(three, group, np.array([0.7, 0.999]))
    sharp, none, soft = np.split(three["normal"], 3)
    np.testing.assert_array_equal(none, flat)
    np.testing.assert_allclose(sharp, flat, atol=1e-6)
    np.testing.assert_array_equal(soft, whole["normal"])
