"""What is solid, ground or sky is decided at the import, stored with the scene, and soups are taken apart."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from support.foreign import raw
from support.hills import CELL_M, Hills, hills, standing
from support.layout_checks import catalogue

from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.geometry.ground import Ground
from aerialdojo_gen.imports.import_mesh import MeshOptions, import_mesh
from aerialdojo_gen.imports.naming import Naming, NodeName, Row
from aerialdojo_gen.imports.raw import RawNode, RawSurface, default_colours, empty_corners
from aerialdojo_gen.imports.split_components import split_components
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld
from aerialdojo_gen.scenes.glb import read_glb, write_glb


def dome(kind: str, radius: float = 300.0) -> trimesh.Trimesh:
    body = trimesh.creation.box((2 * radius,) * 3) if kind == "box" else trimesh.creation.icosphere(3, radius)
    return body.slice_plane([0, 0, -1e-3], [0, 0, 1]) if kind == "half" else body


def yard() -> list[RawNode]:
    rng = np.random.default_rng(3)
    boxes = [trimesh.creation.box((4, 3, 5)).apply_translation([9 * k, 5 * rng.random(), 2.5]) for k in range(5)]
    return [raw(b, f"Shed.{k:03d}") for k, b in enumerate(boxes)]


@pytest.mark.parametrize(("kind", "name"), [("ball", "SkyDome"), ("half", "Sphere.001"), ("box", "")])
def test_a_dome_is_drawn_and_never_in_the_way(kind, name, tmp_path):
    scene, repairs = import_mesh("Yard", [*yard(), raw(dome(kind), name)])
    assert [b.surface for b in scene.backdrop] == ["dome"]
    assert "sky_0000" not in scene
    assert any("sky_0000: drawn as the sky" in line for line in repairs.lines)
    plain_scene, _ = import_mesh("Yard", yard())
    # All else is as if it were not there: extent, ceiling, what may be hit.
    np.testing.assert_array_equal(scene.bounds, plain_scene.bounds)
    assert [i.node for i in scene.instances] == [i.node for i in plain_scene.instances]
    write_glb(scene, tmp_path / "yard.glb")
    again = read_glb(tmp_path / "yard.glb")
    for kept in ("backdrop", "instances"):
        kept_of = [[(i.node, i.surface, len(i.faces)) for i in getattr(one, kept)] for one in (again, scene)]
        assert kept_of[0] == kept_of[1]
    assert ClearanceGrid.build(again).reachable([0.0, 8.0, 3.0])
    free, bare = (CollisionWorld(one).distance_m([0.0, 8.0, 3.0]) for one in (again, plain_scene))
    assert free == bare


def test_what_encloses_and_is_no_sky_stays():
    hall = trimesh.creation.box((70, 40, 18)).apply_translation([18, 0, 9])
    greenhouse = trimesh.creation.icosphere(3, 60.0).slice_plane([0, 0, -1e-3], [0, 0, 1])
    for body, name in ((hall, "Hall"), (hall, ""), (greenhouse, "Greenhouse")):
        scene, _ = import_mesh("Yard", [*yard(), raw(body, name)])
        assert not scene.backdrop
    # A table has the last word, either way.
    sky, shed = (Naming((Row("X*", NodeName(category, {})),)) for category in ("sky", "greenhouse"))
    assert import_mesh("Yard", [*yard(), raw(greenhouse, "X1")], MeshOptions(naming=sky))[0].backdrop
    assert not import_mesh("Yard", [*yard(), raw(greenhouse, "X1")], MeshOptions(naming=shed))[0].backdrop


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10**6), st.floats(2.0, 16.0), st.booleans())
def test_the_ground_that_is_stored_is_the_ground_by_form(seed, relief_m, turned):
    field = hills(seed, cells=14, relief_m=relief_m)
    nodes = [raw(field.mesh(turned), "Mesh.007"), *(raw(b) for b in standing(field, 3, seed))]
    scene, repairs = import_mesh("Hills", nodes)
    assert sorted(i.surface for i in scene.instances) == ["ground", "solid", "solid", "solid"]
    assert any(line.startswith("closed to flight below the open ground") for line in repairs.lines)
    ground = Ground.of(scene)
    assert ground is not None
    p = np.random.default_rng(seed).uniform(scene.bounds[0], scene.bounds[1], (400, 3))
    shift = np.array(repairs.origin_m)
    z = field.z((p + shift)[:, :2])
    clear = np.isnan(z) | (np.abs((p + shift)[:, 2] - z) > 1e-3)
    with np.errstate(invalid="ignore"):
        expected = (p + shift)[:, 2] < z
    assert (ground.below(p) == expected)[clear].all()


def test_terrain_by_name_is_ground_where_its_form_leaves_it_open():
    # A patch of relief in the corner of a wide paved yard that lies lower.
    field = hills(5, cells=16, relief_m=5.0)
    patch = field.mesh().apply_translation([0, 0, 2.0])
    yard_ = trimesh.creation.box(bounds=[[-60, -60, -0.5], [60, 60, 0]])
    scene, _ = import_mesh("Patch", [raw(patch, "Terrain"), raw(yard_, "Yard")])
    assert {i.category: i.surface for i in scene.instances} == {"terrain": "ground", "yard": "solid"}
    nameless, _ = import_mesh("Patch", [raw(patch, "Awning"), raw(yard_, "Yard")])
    assert {i.category: i.surface for i in nameless.instances} == {"awning": "sheet", "yard": "solid"}


def sheet(z: np.ndarray) -> trimesh.Trimesh:
    """One surface of cells of a metre."""
    field = Hills(z, np.zeros(np.subtract(z.shape, 1), dtype=bool))
    return field.mesh().apply_scale((1 / CELL_M, 1 / CELL_M, 1))


def scan(seed: int) -> tuple[RawNode, list[np.ndarray]]:
    """One surface, as photogrammetry makes it: hills, out of which houses rise without a seam."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(0, 81.0), np.arange(0, 81.0))
    ground = 3 * np.sin(x / 17 + seed) + 2 * np.cos(y / 13)
    z, places = ground.copy(), []
    for i in range(3):
        for j in range(3):
            x0, y0 = 8 + 24 * i + rng.integers(0, 4), 8 + 24 * j + rng.integers(0, 4)
            at = np.s_[y0 : y0 + 9, x0 : x0 + 7]
            z[at] = ground[at].max() + rng.uniform(4, 9)
            places.append(np.array([x0 + 3, y0 + 4]))
    return raw(sheet(z)), places


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_stands_out_of_one_surface_becomes_things(seed):
    node, places = scan(seed)
    bodies, stats = split_components([node])
    assert stats.attached == len(places)
    assert len(bodies) == 1 + len(places)
    assert sum(len(b.faces) for b in bodies) == len(node.faces)
    middles = [(b.vertices.min(axis=0) + b.vertices.max(axis=0))[:2] / 2 for b in bodies[1:]]
    for place in places:
        assert min(np.abs(m - place).max() for m in middles) < 2.0
    scene, repairs = import_mesh("Scan", [node])
    assert any(line.startswith("9 things were one surface with the ground") for line in repairs.lines)
    # What was one surface with the ground has nothing below it either, and nobody flies into a house from below.
    ground, origin = Ground.of(scene), np.array(repairs.origin_m)
    assert ground is not None
    for x, y in places:
        assert ground.below([[x - origin[0], y - origin[1], 2.0 - origin[2] - 3.0]]).all()


def test_bare_hills_are_not_taken_apart():
    bodies, stats = split_components([raw(hills(7, cells=30, relief_m=14.0).mesh())])
    assert (len(bodies), stats.attached) == (1, 0)


def test_a_fence_does_not_swallow_what_it_stands_around_and_a_house_has_its_chimney():
    corners = (
        [[0, 0, 0], [40, 0.4, 9]], [[0, 39.6, 0], [40, 40, 9]], [[0, 0.3, 0], [0.4, 39.7, 9]],
        [[39.6, 0.3, 0], [40, 39.7, 9]], [[15, 15, 0], [25, 24, 6]], [[16, 16, 6], [20, 20, 8.9]],
        [[60, 10, 0], [66, 16, 20]], [[62, 12, 20], [63, 13, 20.2]],
    )  # fmt: skip
    *sides, house, roof, tower, hatch = (trimesh.creation.box(bounds=both) for both in corners)
    fence = trimesh.util.concatenate(sides)
    ring = trimesh.creation.annulus(18, 20, 9).apply_translation([20, 20, 4.5])
    bodies, stats = split_components([raw(trimesh.util.concatenate([ring, house, roof, tower, hatch]))])
    assert stats.pieces == 5
    assert sorted(len(b.faces) for b in bodies) == sorted([len(ring.faces), 12, 12, 24])
    assert len(split_components([raw(fence, "Fence"), raw(house, "House")])[0]) == 2


def terrace() -> tuple[np.ndarray, np.ndarray]:
    """Eight houses in a row without a seam, 80 m long, every one with faces of its own."""
    rows = [trimesh.creation.box(bounds=[[10 * k, 0, 0], [10 * k + 10, 9, 8 + k % 3]]) for k in range(8)]
    whole = trimesh.util.concatenate(rows)
    whole.merge_vertices()
    return np.asarray(whole.vertices), np.asarray(whole.faces, np.int64)


@pytest.mark.parametrize("by", ["colour", "texture"])
def test_wide_bodies_of_several_colours_or_textures_fall_apart_by_material(by):
    turns = np.repeat([0, 1] * 4, 12)
    colours = np.array([[200, 40, 40], [40, 90, 200] if by == "colour" else [200, 40, 40]], np.uint8)[turns]
    node = RawNode("", *terrace(), colours)
    if by == "texture":
        # Two pictures of one mean colour.
        paint = [np.full((8, 8, 3), (200, 40, 40), np.uint8) for _ in range(2)]
        paint[1][::2], paint[1][1::2] = (220, 60, 60), (180, 20, 20)
        surfaces = tuple(RawSurface(f"m{k}", (200, 40, 40), picture) for k, picture in enumerate(paint))
        node = replace(node, surface=turns.astype(np.int32), corners=empty_corners(len(turns)), surfaces=surfaces)
    bodies, _ = split_components([node])
    assert 8 <= len(bodies) <= 16
    assert sum(len(b.faces) for b in bodies) == 96
    assert by == "colour" or all(len(np.unique(b.surface)) == 1 for b in bodies)


@settings(max_examples=3, deadline=None)
@given(st.randoms(use_true_random=False))
def test_nodes_in_any_order_make_the_same_bytes(tmp_path_factory, random):
    folder = tmp_path_factory.mktemp("order")
    field = hills(4, cells=12)
    nodes = [raw(field.mesh(), "Terrain"), *(raw(b, f"Hut.{k}") for k, b in enumerate(standing(field, 4, 4)))]
    nodes += [raw(trimesh.creation.icosphere(2, 200.0), "Sky"), *[raw(trimesh.creation.box((3, 3, 3)), "Twin")] * 2]
    nodes += [RawNode("Hut.9", np.full((3, 3), np.nan), np.array([[0, 1, 2]]), default_colours(1))]
    made = []
    for order in (list(range(len(nodes))), random.sample(range(len(nodes)), len(nodes))):
        scene, repairs = import_mesh("Hills", [nodes[k] for k in order], MeshOptions(crop_m=(12.0, 12.0, 10.0)))
        write_glb(scene, folder / "x.glb")
        made.append(((folder / "x.glb").read_bytes(), repairs))
    assert made[0] == made[1]


def test_the_ground_of_a_scan_without_a_name_is_nothing_to_look_for():
    at = np.linspace(-60.0, 60.0, 121)
    x, y = np.meshgrid(at, at)
    z = 4.0 * np.sin(x / 25.0) + 3.0 * np.cos(y / 20.0)
    for u, v in ((-30.0, -20.0), (10.0, 25.0), (35.0, -35.0)):
        z[(np.abs(x - u) < 6.0) & (np.abs(y - v) < 5.0)] += 6.0
    scene, _ = import_mesh("Scan", [raw(sheet(z), "Mesh_0")])
    wide = [i for i in scene.instances if np.ptp(i.bounds, axis=0)[:2].min() > 100.0]
    assert [(i.category, i.surface) for i in wide] == [("terrain", "ground")]
    # What stands on it stays: three blocks, each to be found.
    things = [i for i in scene.instances if i.category == "object"]
    assert len(things) == 3
    vocabulary = Vocabulary(replace(scene, imported=True), catalogue())
    targets = {i.node for i, w in zip(scene.instances, vocabulary.words, strict=True) if w.target}
    assert targets == {i.node for i in things}
