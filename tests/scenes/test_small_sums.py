"""What is computed by compiled or scalar code says to the last bit what arrays say: digests hang on it."""

import numpy as np

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.noise import value_noise
from aerialdojo_gen.scenes.terrain import Terrain, flat_terrain, rolling_terrain


def test_the_height_at_a_point_is_that_of_the_array():
    rng = np.random.default_rng(3)
    hills = rolling_terrain((60.0, 41.0), 1.7, 5, 4.0, 19.0)
    for ground in (hills, flat_terrain((60.0, 41.0), 2.5), Terrain(-30.0, -20.0, 1.0, rng.normal(size=(41, 61)))):
        points = [*rng.uniform(-45, 45, (400, 2)), *np.round(rng.uniform(-35, 35, (100, 2))), (-30.0, -20.0)]
        assert [ground.at(x, y) for x, y in points] == [float(ground.z(x, y)) for x, y in points]


def test_areas_are_added_in_the_order_of_arrays():
    rng = np.random.default_rng(4)
    v, f = rng.normal(size=(500, 3)) * 10.0 ** rng.uniform(-3, 3, (500, 1)), rng.integers(0, 500, (2000, 3))
    normal = np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])
    assert np.array_equal(areas(v, f.astype(np.int32)), np.sqrt((normal**2).sum(axis=1)) / 2.0)


def test_noise_is_that_of_four_corners():
    for size, cells, rows in ((64, 7, 7), (32, 4, 18), (128, 64, 8)):
        lattice = generator(0, "texture", "test").uniform(-1.0, 1.0, size=(rows, cells))
        y, x = np.arange(size) * rows / size, np.arange(size) * cells / size
        i, j = np.floor(y).astype(int), np.floor(x).astype(int)
        s, t = y - i, x - j
        s, t = (s * s * (3.0 - 2.0 * s))[:, None], (t * t * (3.0 - 2.0 * t))[None, :]
        a, b, c, d = (lattice[np.ix_((i + p) % rows, (j + q) % cells)] for p in (0, 1) for q in (0, 1))
        expected = (a * (1 - t) + b * t) * (1 - s) + (c * (1 - t) + d * t) * s
        assert np.array_equal(value_noise(size, cells, generator(0, "texture", "test"), rows), expected)
