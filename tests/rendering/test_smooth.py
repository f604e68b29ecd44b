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


def test_each_group_is_smooth_by_its_own_angle_and_what_has_none_is_flat() -> None:
    ball, crate = rows_of(sphere(radius=1.0)), rows_of(box(size=[1.0, 2.0, 3.0]))
    two = np.concatenate([ball[::2], ball[1::2]])  # Of two materials
    rows = np.concatenate([ball, ball, two, crate])
    flat = rows["normal"].copy()
    smooth(rows, np.repeat([1, -1, 0, 2], [*[len(ball)] * 3, len(crate)]), np.array([0.7, 0.999, 0.45]))
    soft, others = np.split(np.arange(len(rows)), [2 * len(ball), 3 * len(ball)])[1], np.ones(len(rows), bool)
    others[soft] = False
    np.testing.assert_allclose(rows["normal"][others], flat[others], atol=1e-6)
    out = rows["position"][soft] / np.linalg.norm(rows["position"][soft], axis=2, keepdims=True)
    assert (rows["normal"][soft] * out).sum(axis=2).min() > 0.99
    assert (flat[soft] * out).sum(axis=2).min() < 0.98
