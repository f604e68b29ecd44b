"""What is computed by compiled or scalar code says to the last bit what arrays say: digests hang on it."""

import ast
import math
from pathlib import Path

import numpy as np

from aerialdojo_gen.geometry import portable
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.terrain import Terrain, flat_terrain, rolling_terrain


def test_the_height_at_a_point_is_that_of_the_array():
    rng = np.random.default_rng(3)
    hills = rolling_terrain((60.0, 41.0), 1.7, 5, 4.0, 19.0)
    for ground in (hills, flat_terrain((60.0, 41.0)), Terrain(-30.0, -20.0, 1.0, rng.normal(size=(41, 61)))):
        points = [*rng.uniform(-45, 45, (400, 2)), *np.round(rng.uniform(-35, 35, (100, 2))), (-30.0, -20.0)]
        assert [ground.at(x, y) for x, y in points] == [float(ground.z(x, y)) for x, y in points]


def test_areas_are_added_in_the_order_of_arrays():
    rng = np.random.default_rng(4)
    v, f = rng.normal(size=(500, 3)) * 10.0 ** rng.uniform(-3, 3, (500, 1)), rng.integers(0, 500, (2000, 3))
    normal = np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])
    assert np.array_equal(areas(v, f.astype(np.int32)), np.sqrt((normal**2).sum(axis=1)) / 2.0)


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
    files = sorted(set(root.rglob("*.py")) - {root / "appearances.py", root / "colours.py"})
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
