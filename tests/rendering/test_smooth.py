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
    halves = ball[::2].copy(), ball[1::2].copy()  # Of two materials
    smooth(*halves, crease=0.7)
    for half, before in zip(halves, (flat[::2], flat[1::2]), strict=True):
        out = half["position"] / np.linalg.norm(half["position"], axis=2, keepdims=True)
        assert (half["normal"] * out).sum(axis=2).min() > 0.99
        assert (before * out).sum(axis=2).min() < 0.98
    crate = rows_of(box(size=[1.0, 2.0, 3.0]))
    before = crate["normal"].copy()
    smooth(crate, crease=0.45)
    np.testing.assert_allclose(crate["normal"], before, atol=1e-6)
