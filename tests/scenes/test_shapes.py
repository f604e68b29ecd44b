"""Solids of the vocabulary are closed, outward, of their stated size, and textured at scale."""

import math
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon
from support.layout_checks import is_seamless

from aerialdojo_gen.scenes import shapes
from aerialdojo_gen.scenes.expressions import evaluate, evaluate_arrays, names_in
from aerialdojo_gen.scenes.materials import TEXTURES, make_texture
from aerialdojo_gen.scenes.mesh import Mesh, merge, mirrored, rotated, rotation, to_part, translated
from aerialdojo_gen.scenes.textures_natural import NATURAL
from aerialdojo_gen.scenes.vocabulary import _STROKES, SHAPES, part_mesh, text

size = st.floats(0.05, 20.0)
few = st.integers(3, 24)


def solid(m: Mesh) -> trimesh.Trimesh:
    body = trimesh.Trimesh(m.vertices, m.faces, process=False)
    assert body.is_watertight
    assert body.is_winding_consistent
    assert m.volume_m3 > 0
    assert body.area_faces.min() > 0
    return body


def assert_extent(m: Mesh, low: tuple[float, ...], high: tuple[float, ...]) -> None:
    np.testing.assert_allclose(m.vertices.min(axis=0), low, atol=1e-9)
    np.testing.assert_allclose(m.vertices.max(axis=0), high, atol=1e-9)


@settings(max_examples=20)
@given(size, size, size, few, st.floats(0.1, 1.0), st.floats(0.1, 1.0))
def test_solids_are_closed_and_have_their_size_and_volume(x, y, z, n, fx, fy):
    box = shapes.box(size=(x, y, z), taper=(fx, fy))
    solid(box)
    assert_extent(box, (-x / 2, -y / 2, 0), (x / 2, y / 2, z))
    assert box.volume_m3 == pytest.approx(x * y * z * (1 + fx * fy + (1 + fx) * (1 + fy)) / 6)
    cylinder, cone = (make(radius=x, height=y, segments=n) for make in (shapes.cylinder, shapes.cone))
    assert len(solid(cylinder).faces) == 4 * n - 4
    assert cylinder.volume_m3 == pytest.approx(n / 2 * x * x * math.sin(2 * math.pi / n) * y)
    assert (cylinder.vertices[:, 2].min(), cylinder.vertices[:, 2].max()) == (0, y)
    solid(cone)
    assert cone.volume_m3 * 3 == pytest.approx(cylinder.volume_m3)
    capsule = shapes.capsule(radius=x, height=y, segments=min(n, 16))
    solid(capsule)
    assert (capsule.vertices[:, 2].min(), capsule.vertices[:, 2].max()) == pytest.approx((-x, y + x))
    for section, share in (("gable", 0.5), ("wedge", 0.5), ("trapezoid", 0.75)):
        prism = shapes.prism(size=(x, y, z), section=section)
        solid(prism)
        assert_extent(prism, (-x / 2, -y / 2, 0), (x / 2, y / 2, z))
        assert prism.volume_m3 == pytest.approx(share * x * y * z)
    torus = shapes.torus(radius=1 + x, tube=fx, segments=n, sides=3 + n % 8)
    assert solid(torus).euler_number == 0
    assert np.hypot(*torus.vertices[:, :2].T).min() >= 1 + x - fx - 1e-9
    solid(shapes.lathe(points=[(x, 0.0), (y, fx), (z, fx + fy)], segments=n))


@given(st.tuples(size, size, size), st.integers(0, 2), st.booleans(), st.floats(0, 0.6), st.integers(0, 1000))
def test_ellipsoids_and_crowns_lie_within_their_radii(radii, level, half, noise, seed):
    ball = shapes.sphere(radii=radii, subdivisions=level, half=half)
    solid(ball)
    assert np.linalg.norm(ball.vertices / radii, axis=1).max() == pytest.approx(1.0)
    assert ball.vertices[:, 2].min() >= (0.0 if half else -radii[2])
    crown, again = (shapes.crown(radii=radii, noise=noise, subdivisions=level, seed=seed) for _ in range(2))
    solid(crown)
    reach = np.linalg.norm(crown.vertices / radii, axis=1)
    assert reach.min() >= 1 - noise - 1e-9
    assert reach.max() <= 1 + noise + 1e-9
    assert np.array_equal(crown.vertices, again.vertices)


def test_extruded_solids_by_hand():
    straight = shapes.polygon(points=[[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [0, 1]], height=1)
    assert len(solid(straight).faces) == 12, "corners on a straight side leave no crack"
    profile = shapes.profile(points=[[0, 0], [3, 0], [3, 1]], width=2)
    solid(profile)
    assert_extent(profile, (0, -1, 0), (3, 1, 1))
    upright = shapes.sweep(path=[[0, 0, 1], [4, 0, 1], [4, 4, 1]], section=[0.2, 1.0])
    assert_extent(upright, (0, -0.1, 0.5), (4.1, 4, 1.5))
    ring = shapes.sweep(path=[[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], section=[0.2, 0.2], closed=True)
    assert solid(ring).euler_number == 0
    assert ring.volume_m3 == pytest.approx(16 * 0.04)


@given(st.integers(3, 12), size, st.floats(0.1, 5), st.booleans(), st.booleans())
def test_polygon_with_hole_has_its_volume_whatever_its_sense(n, r, h, turned, holed):
    outline = np.array(Point(0, 0).buffer(r, quad_segs=n).exterior.coords)[:-1]
    hole = outline * 0.4
    body = shapes.polygon(
        points=outline[:: -1 if turned else 1].tolist(), height=h, holes=[hole.tolist()] if holed else []
    )
    solid(body)
    area = Polygon(outline).area * (1 - 0.16 * holed)
    assert body.volume_m3 == pytest.approx(area * h)


@settings(max_examples=20)
@given(
    st.lists(
        st.tuples(st.floats(0.5, 3), st.floats(-60, 60), st.just(0.0) | st.floats(-1, 1)), min_size=1, max_size=6
    ),
    st.booleans(),
)
def test_sweep_is_closed_and_contains_its_path(legs, round_):
    heading, points = 0.0, [np.zeros(3)]
    for length, turn, climb in legs:
        heading += math.radians(turn)
        points.append(points[-1] + length * np.array([math.cos(heading), math.sin(heading), climb]))
    kind = {"radius": 0.05} if round_ else {"section": (0.1, 0.1)}
    body = shapes.sweep(path=[p.tolist() for p in points], **kind)
    solid(body)
    length = sum(np.linalg.norm(b - a) for a, b in pairwise(points))
    area = 6 / 2 * 0.05**2 * math.sin(math.pi / 3) if round_ else 0.01
    # Mitres are exact where a path bends in the plane; where it also climbs, the section twists a little.
    level = all(climb == 0 for _, _, climb in legs)
    assert body.volume_m3 == pytest.approx(length * area, rel=1e-9 if level else 0.25)


@pytest.mark.parametrize("letter", sorted(_STROKES))
def test_letters_are_plates_of_their_height(letter):
    body = text(text=f"{letter}H", height=0.6, depth=0.05)
    solid(body)
    assert body.vertices[:, 0].min() == 0
    assert body.vertices[:, 0].max() == pytest.approx(0.05)
    assert np.ptp(body.vertices[:, 2]) == pytest.approx(0.6, abs=0.06)
    assert body.vertices[:, 1].max() == pytest.approx(-body.vertices[:, 1].min())


def test_letters_read_from_the_front():
    """Seen from +x, y runs to the right: L has its foot right of its stem."""
    body = text(text="L", height=1.0)
    assert np.all(
        np.cross(*(body.vertices[body.faces][:, k] - body.vertices[body.faces][:, 0] for k in (1, 2)))[:, 0] > 0
    )
    foot = body.vertices[body.vertices[:, 2] < 0.3]
    head = body.vertices[body.vertices[:, 2] > 0.7]
    assert foot[:, 1].max() > head[:, 1].max() + 0.2


@pytest.mark.parametrize(
    ("shape", "keys", "message"),
    [
        ("box", {"size": [1, 2]}, "size needs 3 numbers"),
        ("box", {"size": [1, 2, 0]}, "size must be positive, got 1, 2, 0"),
        ("sphere", {}, "give radius or radii, one of them"),
        ("polygon", {"points": [[0, 0], [1, 1], [1, 0], [0, 1]], "height": 1}, "no simple polygon"),
        ("prism", {"size": [1, 1, 1], "section": "round"}, "section 'round' is none of gable, wedge, trapezoid"),
        ("sweep", {"path": [[0, 0, 0]], "radius": 1}, "two distinct points"),
        ("text", {"text": "a€", "height": 1}, "no letter '€'"),
        ("text", {"text": "  ", "height": 1}, "has no letter"),
        ("crown", {"radius": 1, "noise": 2}, "noise 2 is outside 0 to 0.6"),
    ],
)
def test_impossible_sizes_are_refused(shape, keys, message):
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        SHAPES[shape](**keys)


def test_part_is_turned_repeated_moved_and_mirrored_in_that_order():
    part = {
        "shape": "box", "size": [0.2, "w", 1], "rotate": [0, 0, 90], "at": [0, 2, 0], "role": "x",
        "array": {"count": "n", "step": [1, 0, 0]}, "mirror": "y",
    }  # fmt: skip
    body = part_mesh(part, {"w": 0.4, "n": 3}, {})
    assert len(body.faces) == 12 * 3 * 2
    assert_extent(body, (-0.2, -2.1, 0), (2.2, 2.1, 1))
    assert body.volume_m3 == pytest.approx(6 * 0.08)


@pytest.mark.parametrize(("axis", "flat"), [("z", 2), ("y", 1), ("x", 0)])
def test_ring_keeps_copies_at_its_radius(axis, flat):
    part = {"shape": "sphere", "radius": 0.1, "role": "x", "ring": {"count": 5, "radius": 2.0, "axis": axis}}
    centres = part_mesh(part, {}, {}).vertices.reshape(5, -1, 3).mean(axis=1)
    np.testing.assert_allclose(np.linalg.norm(centres, axis=1), 2.0)
    np.testing.assert_allclose(centres[:, flat], 0.0, atol=1e-12)
    np.testing.assert_allclose(centres.mean(axis=0), 0.0, atol=1e-12)


def test_mirror_keeps_faces_outward():
    body = translated(shapes.cylinder(radius=1, height=2), (3, 0, 0))
    for axis in range(3):
        assert mirrored(body, axis).volume_m3 == pytest.approx(body.volume_m3)
    solid(merge([body, mirrored(body, 0)]))


@given(st.floats(-360, 360), st.floats(-360, 360), st.floats(-360, 360), st.floats(0.5, 4))
def test_texture_keeps_its_scale_on_every_face(a, b, c, tile):
    """The area that a face covers in the texture is its own over tile², but for slopes taken from above."""
    body = rotated(shapes.box(size=(1, 2, 3)), rotation(a, b, c))
    part = to_part(body, "brick", tile)
    p, q = part.vertices[part.faces], part.uv.astype(np.float64)[part.faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    u, v = q[:, 1] - q[:, 0], q[:, 2] - q[:, 0]
    covered = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) * tile**2
    assert np.all(np.abs(covered) <= area * 1.001)
    assert np.all(np.abs(covered) >= area * 0.959)
    upward = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])[:, 2] > -0.9 * area
    assert np.all(covered[upward] > 0), "a texture stands mirrored"


def test_wall_texture_runs_up_and_around_the_corner():
    body = shapes.polygon(points=[[0, 0], [4, 0], [4, 3], [0, 3]], height=2)
    part = to_part(body, "brick", 1.0)
    walls = part.uv[part.faces[4:]].reshape(-1, 2)
    assert np.allclose([walls[:, 0].min(), walls[:, 0].max()], [0, 14])
    assert np.allclose([walls[:, 1].min(), walls[:, 1].max()], [0, 2])


expression = st.recursive(
    st.floats(0, 9).map(lambda x: f"{x:.2f}") | st.sampled_from(["a", "b_1", "pi"]),
    lambda inner: (
        st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda t: f"({t[0]}{t[1]}{t[2]})")
        | inner.map(lambda t: f"-{t}")
        | st.tuples(inner, inner).map(lambda t: f"max({t[0]},{t[1]})")
    ),
    max_leaves=8,
)


@given(expression, st.floats(-5, 5), st.floats(-5, 5))
def test_expressions_compute_what_python_computes(text, a, b):
    names = {"a": a, "b_1": b}
    assert evaluate(text, names) == eval(text, {"pi": math.pi, "max": max}, names)
    assert names_in(text) == {n for n in names if n in text.replace("max", "")}


@given(expression, st.lists(st.floats(-5, 5), min_size=1, max_size=4))
def test_expressions_over_arrays_compute_what_they_do_of_each_number(text, values):
    try:
        expected = [evaluate(text, {"a": a, "b_1": 2.0}) for a in values]
    except ValueError:
        return
    arrays = {"a": np.array(values), "b_1": 2.0}
    assert np.broadcast_to(evaluate_arrays(text, arrays), len(values)).tolist() == pytest.approx(expected)


def test_expressions_over_arrays_have_functions_of_their_own():
    text, t = "choose(t, clip(t, 0, 1), eased(t, -2, 0))", np.array([-1.0, 0.5, 3.0])
    assert evaluate_arrays(text, {"t": t}).tolist() == [0.5, 0.5, 1.0]


NOT_ARITHMETIC = "__import__('os')", "a.b", "a[0]", "lambda: 1", "'x'", "a if 1 else 2", "True", "2**9", "", "1;2"


@pytest.mark.parametrize(
    ("compute", "text", "message"),
    [
        *((evaluate, text, "is no arithmetic expression") for text in NOT_ARITHMETIC),
        (evaluate, "1/t", "division by zero"),
        (evaluate, "t + u", "unknown parameter 'u'"),
        (evaluate_arrays, "1/(t - t)", "not finite"),
        (evaluate_arrays, "t + u", "unknown name 'u'"),
        (evaluate_arrays, "floor(t)", "is no arithmetic expression"),
    ],
)
def test_expressions_are_arithmetic_of_known_names_with_finite_results(compute, text, message):
    with pytest.raises(ValueError, match=message):
        compute(text, {"t": np.zeros(3) if compute is evaluate_arrays else 0.0})


@pytest.mark.parametrize("name", sorted(TEXTURES))
def test_textures_tile_without_a_seam_show_contrast_and_of_nature_keep_their_tint(name):
    image = make_texture(name, (150, 120, 90))
    assert image.dtype == np.uint8
    assert image.shape[2] == 3
    assert image.astype(float).std() > 2.0
    assert is_seamless(image)
    if name in NATURAL:
        np.testing.assert_allclose(image.reshape(-1, 3).mean(axis=0), (150, 120, 90), atol=3)
