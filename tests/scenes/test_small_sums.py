"""What is computed by compiled or scalar code says to the last bit what arrays say: digests hang on it."""

import ast
import math
from pathlib import Path

import numpy as np
import trimesh

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry import portable
from aerialdojo_gen.scenes.mesh import Mesh, areas, to_part
from aerialdojo_gen.scenes.noise import value_noise
from aerialdojo_gen.scenes.shapes import sphere
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


def test_functions_are_those_of_the_c_library():
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-9, 9, (2, 4000))
    assert portable.exp(x.reshape(40, 100)).ravel().tolist() == [math.exp(v) for v in x]
    assert portable.atan2(y, x).tolist() == [math.atan2(*v) for v in zip(y, x, strict=True)]
    assert portable.power(abs(x), 1.7).tolist() == [math.pow(abs(v), 1.7) for v in x]


def test_products_are_added_in_order():
    rng = np.random.default_rng(6)
    v, m = rng.normal(size=(300, 3)), rng.normal(size=(3, 3))
    terms = v[:, :, None] * m
    turned = terms[:, 0] + terms[:, 1] + terms[:, 2]
    assert np.array_equal(portable.product(v[:, ::-1], m[::-1]), terms[:, 2] + terms[:, 1] + terms[:, 0])
    assert np.array_equal(portable.product(v, m), turned)
    assert np.array_equal(portable.dot(v[:, None], m.T), turned)
    assert np.array_equal(portable.unit(v), v / np.sqrt((v**2).sum(axis=1))[:, None])


# They go to OpenBLAS or to vector code, whose last bits depend on the processor.
UNEVEN = {
    "arccos", "arcsin", "arctan", "arctan2", "cbrt", "corrcoef", "cosh", "cov", "dot", "einsum", "exp", "exp2",
    "expm1", "float_power", "inner", "linalg", "log", "log10", "log1p", "log2", "matmul", "polyfit", "power", "sinh",
    "tan", "tanh", "tensordot", "vdot",
}  # fmt: skip


def test_code_of_meshes_calls_nothing_that_rounds_by_the_processor():
    root = Path(portable.__file__).parents[1] / "scenes"
    # They compare what is built with thresholds and with named colours.
    files = sorted(set(root.rglob("*.py")) - {root / "claims.py", root / "colours.py"})
    found = [
        f"{path.relative_to(root)}:{node.lineno}: {ast.unparse(node)}"
        for path in files
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.expr | ast.AugAssign) and is_uneven(node)
    ]
    assert len(files) > 80
    assert found == [], "other bytes of meshes on other processors: use aerialdojo_gen.geometry.portable, or math"


def is_uneven(node: ast.AST) -> bool:
    match node:
        case ast.BinOp(op=ast.MatMult()) | ast.AugAssign(op=ast.MatMult()):
            return True
        case ast.Attribute(value=ast.Name("np"), attr=name) | ast.Attribute(attr="dot" as name):
            return name in UNEVEN
        case ast.BinOp(left=base, op=ast.Pow(), right=ast.Constant(exponent)):
            return exponent != 2 and not isinstance(base, ast.Constant)
    return False


def test_texture_coordinates_are_those_of_arrays():
    rng = np.random.default_rng(7)
    v, f = rng.normal(size=(60, 3)), rng.integers(0, 60, (200, 3)).astype(np.int32)
    v[:20, 2] = 0.5
    f[:50] = rng.integers(0, 20, (50, 3))
    given = np.where(rng.random((200, 3, 1)) < 0.3, rng.integers(0, 3, (200, 3, 2)) / 2.0, np.nan)
    made = to_part(Mesh(v, f, given), "brick", 0.7)
    corners = v[f]
    normals = portable.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(portable.norm(normals)[:, None], 1e-300)
    flat = np.abs(normals[:, 2]) > 0.96
    along = np.column_stack([-normals[:, 1], normals[:, 0], np.zeros(len(f))])
    along /= np.maximum(portable.norm(along)[:, None], 1e-12)
    along[flat] = (1.0, 0.0, 0.0)
    up = portable.cross(normals, along)
    up[flat] = (0.0, 1.0, 0.0)
    projected = np.stack([portable.dot(corners, along[:, None]), portable.dot(corners, up[:, None])], axis=2)
    uv = (np.where(np.isnan(given), projected, given).reshape(-1, 2) / 0.7).astype(np.float32)
    keys = np.column_stack([f.reshape(-1), np.rint(uv * 4096.0)])
    _, first, index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    assert flat.any()
    assert not flat.all()
    assert len(first) < len(keys)
    assert np.array_equal(made.faces, index.reshape(-1, 3))
    assert np.array_equal(made.uv, uv[first])
    assert np.array_equal(made.vertices, v[f.reshape(-1)[first]])


def test_spheres_are_cut_as_trimesh_cuts_them():
    ball = trimesh.creation.icosahedron()
    for level in range(4):
        ball.vertices = portable.unit(np.array(ball.vertices))
        made = sphere(radius=1.0, subdivisions=level)
        assert np.array_equal(made.vertices, ball.vertices)
        assert np.array_equal(made.faces, ball.faces)
        ball = ball.subdivide()
