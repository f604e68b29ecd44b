"""Scene files: exact round trip, standard readers, damage."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pygltflib
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from support.foreign import changed_glb

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes import shapes
from aerialdojo_gen.scenes.catalogue import placed
from aerialdojo_gen.scenes.glb import read_glb, write_glb
from aerialdojo_gen.scenes.materials import make_texture
from aerialdojo_gen.scenes.mesh import to_part
from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene

BRICK = Material("brick:#9a4a3c", (150, 80, 60), make_texture("brick", (154, 74, 60)), 0.75)
GREY = Material("#808080", (128, 128, 128))
BLUE = Material("paint:#2040c0", (0x20, 0x40, 0xC0))


def instance(node: str, x: float, yaw: float, materials: tuple[str, ...], attributes: dict[str, str]) -> Instance:
    bodies = [shapes.cylinder(radius=0.3 + k, height=2.7) for k in range(len(materials))]
    parts = [to_part(b, m, 0.75) for b, m in zip(bodies, materials, strict=True)]
    return Instance(node, "post", "tall" if attributes else "", attributes, placed(parts, (x, 1 / 3, 0.1), yaw))


@pytest.fixture
def scene() -> Scene:
    instances = (
        instance("post_000", 7.3, 33.0, (BRICK.name, GREY.name), {"colour": "grün", "state": 'half "open"'}),
        instance("post_001", -120.7, 200.0, (BLUE.name,), {}),
    )
    bounds = np.array([[-130.1, -20.3, -1.7], [130.1, 20.3, 25.9]])
    materials = {m.name: m for m in (BRICK, GREY, BLUE)}
    return Scene("U_Test_0", instances, materials, bounds, (10, 20, 30), (0.6, 0.0, 0.8))


def same(a: Any, b: Any) -> bool:
    """Whether two things are equal to the last bit, and their arrays of one type."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b)
    if is_dataclass(a):
        return all(same(getattr(a, one.name), getattr(b, one.name)) for one in fields(a) if one.init)
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == b)


def test_round_trip_is_exact(scene, tmp_path):
    write_glb(scene, tmp_path / "a.glb")
    again = read_glb(tmp_path / "a.glb")
    assert same(scene, again)
    write_glb(again, tmp_path / "b.glb")
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def one_part(vertices, faces, uv) -> Scene:
    part = Part(vertices, np.array(faces, np.int32), np.array(uv, np.float32), GREY.name)
    return Scene("U_X_0", (Instance("a", "b", "", {}, (part,)),), {GREY.name: GREY}, np.zeros((2, 3)))


@given(
    st.lists(st.floats(-500, 500, width=32), min_size=9, max_size=9),
    st.lists(st.floats(-1e4, 1e4, width=32), min_size=6, max_size=6),
)
def test_any_coordinates_come_back(tmp_path_factory, xyz, uv):
    path = tmp_path_factory.mktemp("glb") / "x.glb"
    scene = one_part(np.array(xyz).reshape(3, 3), [[0, 1, 2]], np.reshape(uv, (3, 2)))
    write_glb(scene, path)
    assert same(scene, read_glb(path))


def test_a_large_part_keeps_its_indices(tmp_path):
    n, rng = 70_000, np.random.default_rng(0)
    vertices = rng.uniform(-50, 50, (n, 3)).astype(np.float32).astype(np.float64)
    scene = one_part(vertices, rng.integers(0, n, (n, 3)), np.zeros((n, 2)))
    write_glb(scene, tmp_path / "a.glb")
    assert same(scene, read_glb(tmp_path / "a.glb"))


def test_other_readers_see_the_scene_with_y_up(scene, tmp_path):
    path = tmp_path / "a.glb"
    write_glb(scene, path)
    seen = trimesh.load(path)
    bounds = np.array([i.bounds for i in scene.instances])
    low, high = bounds[:, 0].min(0), bounds[:, 1].max(0)
    np.testing.assert_allclose(seen.bounds, [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]], atol=1e-4)
    assert sum(len(g.faces) for g in seen.geometry.values()) == scene.n_triangles


def test_file_is_gltf_with_linear_colours_and_repeating_textures(scene, tmp_path):
    path = tmp_path / "a.glb"
    write_glb(scene, path)
    document = pygltflib.GLTF2().load(str(path))
    assert [n.name for n in document.nodes] == ["U_Test_0", "post_000", "post_001"]
    assert document.nodes[1].extras == {
        "category": "post", "variant": "tall", "attributes": {"colour": "grün", "state": 'half "open"'},
    }  # fmt: skip
    by_name = {m.name: m.pbrMetallicRoughness for m in document.materials}
    # sRGB 128 is 0.2158 of full light.
    assert by_name["#808080"].baseColorFactor == pytest.approx([0.2158605] * 3 + [1.0], abs=1e-5)
    assert by_name[BRICK.name].baseColorTexture.index == 0
    assert document.samplers[0].wrapS == document.samplers[0].wrapT == pygltflib.REPEAT
    for accessor in document.accessors:
        view = document.bufferViews[accessor.bufferView]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor.type]
        size = {5126: 4, 5123: 2, 5125: 4}[accessor.componentType]
        assert accessor.count * width * size == view.byteLength
        assert view.byteOffset % 4 == 0


def test_a_file_cut_anywhere_is_refused(scene, tmp_path):
    path = tmp_path / "a.glb"
    write_glb(scene, path)
    whole = path.read_bytes()
    for length in (0, 3, 11, 19, 25, 400, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(AssetError, match=r"a\.glb.*run aerialdojo-gen build-scenes"):
            read_glb(path)


@pytest.mark.parametrize("change", [{"count": 10**9}, {"bufferView": 10**6}, {"componentType": 1}, {"type": "MAT4"}])
def test_lying_headers_are_refused(scene, tmp_path, change):
    path = tmp_path / "a.glb"
    write_glb(scene, path)
    path.write_bytes(changed_glb(path.read_bytes(), lambda document: document["accessors"][0].update(change)))
    with pytest.raises(AssetError, match="damaged"):
        read_glb(path)


def test_missing_and_foreign_files_are_refused(tmp_path):
    with pytest.raises(AssetError, match="run aerialdojo-gen build-scenes"):
        read_glb(tmp_path / "none.glb")
    trimesh.creation.box().export(tmp_path / "foreign.glb")
    with pytest.raises(AssetError, match="no scene file of this program"):
        read_glb(tmp_path / "foreign.glb")
