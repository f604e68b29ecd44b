"""Parallel projections: what they show is where rays say it is, and what the plane cuts is cut."""

import numpy as np
import pytest
from support.rendered import MATERIALS, block, courtyard

from aerialdojo_gen.rendering.orthographic import OrthographicPictures, Plane
from aerialdojo_gen.scenes.model import Scene

X, Y, Z = np.eye(3)
RED = 210, 30, 30


@pytest.fixture(scope="module")
def pictures():
    return OrthographicPictures(courtyard())


def looks(colour, rgb):
    """Whether a pixel has a colour's hue, whatever the light."""
    a, b = np.asarray(colour, float), np.asarray(rgb, float)
    return a @ b / (np.linalg.norm(a) * np.linalg.norm(b)) > 0.99


def test_the_map_is_where_the_world_is(pictures):
    plane = Plane.above(20.0, (-10.0, 10.0, -10.0, 10.0))
    picture = pictures.take(plane, 0.05)
    assert picture.shape == (400, 400, 3)

    def pixel(x, y):
        (a, b), *_ = plane.project([[x, y, 1.0]])
        return picture[int((10 - b) / 0.05), int((a + 10) / 0.05)]

    assert all(looks(RED, pixel(*inside)) for inside in ((5.05, 1.05), (5.95, 1.95)))
    assert not any(looks(RED, pixel(*beside)) for beside in ((4.9, 1.5), (6.1, 1.5), (5.5, 2.1)))
    assert looks((40, 70, 190), pixel(-2, -5)), "the blue cube"
    assert looks((140, 140, 140), pixel(8.5, 0)), "a wall"


def test_what_lies_before_the_plane_is_cut_away(pictures):
    # At 4 m the walls (8 m) are cut open: darker than their tops in the sun.
    whole = pictures.take(Plane(20 * Z, X, Y, (8.2, 8.8, -1.0, 1.0)), 0.1)
    opened = pictures.take(Plane(4 * Z, X, Y, (8.2, 8.8, -1.0, 1.0)), 0.1)
    assert whole.mean() > 2 * opened.mean()
    # Below the red cube's top, above its bottom: it is cut, the ground beside it is not.
    low = pictures.take(Plane(1.5 * Z, X, Y, (5.2, 5.8, 1.2, 1.8)), 0.1)
    assert all(looks(RED, p) for p in low.reshape(-1, 3))


def test_the_side_view_fills_the_ground_and_looks_the_right_way(pictures):
    # Looking north (right is east) from inside the court: the northern wall, no sky below it.
    plane = Plane(-7.0 * Y, X, Z, (-4.0, 8.0, -2.0, 9.0))
    assert plane.forward == pytest.approx(Y)
    picture = pictures.take(plane, 0.1)
    earth = picture[-5]
    assert (earth == earth[0]).all()
    red = [looks(RED, p) for p in picture[int((9 - 1.5) / 0.1)]]
    columns = np.flatnonzero(red)
    assert columns.min() == pytest.approx((5 + 4) / 0.1, abs=1)
    assert columns.max() == pytest.approx((6 + 4) / 0.1, abs=1)


def test_the_suns_shadow_falls_where_rays_say():
    ground = block("ground", (-20, -20, -1), (20, 20, 0), "grey")
    tower = block("tower", (-1, -1, 0), (1, 1, 6), "blue")
    bounds = np.array([[-20.0, -20, 0], [20, 20, 20]])
    scene = Scene("U_Sun_0", (ground, tower), MATERIALS, bounds, sun=(0.0, -0.6, 0.8))
    picture = OrthographicPictures(scene).from_above((-10.0, 10.0, -10.0, 10.0), 0.1)
    grey = picture[..., 0].astype(int)
    # The sun stands in the south at atan(0.8 / 0.6): the tower of 6 m throws 4.5 m of shadow to the north.
    column = grey[::-1, 100]  # from south to north through the tower
    dark = np.flatnonzero(column[115:] < column[115:].max() * 0.8)
    assert len(dark) == pytest.approx(45 - 5, abs=2)
    assert grey[180, 100] == grey[20, 20]


def test_the_surface_below_is_found(pictures):
    below = pictures.surface_below(np.array([[5.5, 1.5, 5.0], [0.0, 0.0, 5.0], [8.5, 0.0, 9.0], [500.0, 0.0, 5.0]]))
    assert below[:3] == pytest.approx([2.0, 0.0, 8.0], abs=1e-6)
    assert np.isnan(below[3])
