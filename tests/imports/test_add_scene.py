"""add-scene: meshes that nobody here made, whole, broken and hostile; two real ones up to planned tasks."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pytest
import trimesh
from support import foreign
from support.foreign import raw, read_here

from aerialdojo_gen.annotations.draft import DraftOptions
from aerialdojo_gen.base.errors import AnnotationError, AssetError, StoreError, UsageError
from aerialdojo_gen.dataset.build import open_pipeline, run_pipeline
from aerialdojo_gen.imports.command import add_scene
from aerialdojo_gen.imports.drafting import draft_scene
from aerialdojo_gen.imports.files import read_mesh
from aerialdojo_gen.imports.gltf import read_gltf
from aerialdojo_gen.imports.import_mesh import MeshOptions, import_mesh
from aerialdojo_gen.imports.raw import RawNode, default_colours
from aerialdojo_gen.scenes.colours import colour_name
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.materials import parse_colour
from aerialdojo_gen.store import shards as store


def things(scene):
    return [i for i in scene.instances if i.category not in ("ground", "clutter")]


@pytest.fixture(scope="module")
def village(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("meshes")
    scene = foreign.village()
    scene.export(folder / "village.glb")
    whole = scene.to_mesh()
    for suffix in ("stl", "ply", "obj"):
        whole.export(folder / f"village.{suffix}")
    bodies = foreign.bodies(scene)
    (folder / "village.3ds").write_bytes(
        foreign.three_ds([(f"House{k}", b) for k, b in enumerate(bodies)], (9, 90, 200))
    )
    return folder


@pytest.mark.parametrize("suffix", ["glb", "obj", "stl", "ply", "3ds"])
def test_every_format_gives_the_same_nine_bodies_and_the_names_and_colours_that_it_has(village, suffix):
    scene, _ = import_mesh("Village", read_here(village / f"village.{suffix}"))
    assert len(things(scene)) == 9
    assert [i.category for i in scene.instances].count("ground") == 1
    solid = np.concatenate([i.vertices for i in things(scene)])
    np.testing.assert_allclose(solid.max(axis=0) - solid.min(axis=0), [32.0, 13.0, 14.0], atol=0.05)
    np.testing.assert_allclose(solid.min(axis=0)[2], 0.0, atol=1e-5)
    np.testing.assert_allclose((solid.max(axis=0) + solid.min(axis=0))[:2], 0.0, atol=1e-4)
    assert scene.ceiling_m == pytest.approx(20.0, abs=0.1)
    if suffix == "glb":
        assert sorted({i.category for i in things(scene)}) == ["clock_tower", "house"]
        assert {i.attributes["colour"] for i in things(scene) if i.category == "house"} == {"red", "blue", "green"}
    if suffix == "3ds":
        assert {i.attributes["colour"] for i in things(scene)} == {"blue"}


def test_axes_and_units():
    box = trimesh.creation.box((2000, 300, 1000))
    scene, _ = import_mesh("Box", [raw(box)], MeshOptions(up="y", scale=0.01))
    (body,) = things(scene)
    np.testing.assert_allclose(body.bounds[1] - body.bounds[0], [20, 10, 3], atol=1e-4)


def test_what_is_inside_out_is_turned_and_what_is_open_is_there_from_both_sides():
    closed = trimesh.creation.box((10, 10, 4))
    closed.invert()
    scene, repairs = import_mesh("Box", [raw(closed)])
    (body,) = things(scene)
    assert trimesh.Trimesh(body.vertices, body.faces).volume == pytest.approx(400, rel=1e-4)
    assert any("inside out" in line for line in repairs.lines)
    open_box = trimesh.Trimesh(closed.vertices, closed.faces[2:], process=False)
    scene, _ = import_mesh("Box", [raw(open_box)])
    assert sum(len(i.faces) for i in things(scene)) == len(open_box.faces)
    assert all(scene.materials[p.material].double_sided for i in things(scene) for p in i.parts)


def test_what_has_no_place_is_dropped_and_said_and_nothing_left_is_an_error():
    box = trimesh.creation.box((10, 10, 4))
    vertices = np.vstack([box.vertices, [[np.nan, 0, 0], [np.inf, 1, 1]]])
    faces = np.vstack([box.faces, [[8, 0, 1], [9, 0, 1], [0, 0, 1]]])
    scene, repairs = import_mesh("Box", [RawNode("", vertices, faces, default_colours(len(faces)))])
    assert np.isfinite(np.concatenate([i.vertices for i in scene.instances])).all()
    assert sum(len(i.faces) for i in things(scene)) == 12
    text = "\n".join(repairs.lines)
    assert "2 triangles of the mesh with no place" in text
    assert "1 triangles of the mesh without area" in text
    empty = RawNode("", np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), default_colours(0))
    for node in (empty, RawNode("", np.full((3, 3), np.nan), np.array([[0, 1, 2]]), default_colours(1))):
        with pytest.raises(AssetError, match="empty or degenerate"):
            import_mesh("Nothing", [node])


def test_many_degenerate_triangles_take_bounded_memory():
    n = 200_000
    vertices = np.zeros((n + 8, 3))
    vertices[:n, 0] = np.arange(n) % 7
    box = trimesh.creation.box((20, 20, 5))
    vertices[n:] = box.vertices
    faces = np.vstack([np.column_stack([np.arange(n), np.arange(n), np.arange(n)]), box.faces + n])
    node = RawNode("", vertices, faces, default_colours(len(faces)))
    tracemalloc.start()
    scene, repairs = import_mesh("Slivers", [node])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert sum(len(i.faces) for i in things(scene)) == 12
    assert "200,000 triangles of the mesh without area dropped" in repairs.lines
    assert peak < 120e6


def test_a_glb_that_asks_for_terabytes_or_less_than_nothing_is_refused_before_it_gets_them():
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    }  # fmt: skip
    many = {"nodes": [{"mesh": 0}] * 100_000}  # one small mesh that a hundred thousand nodes show
    for count, change, said in (
        (2_000_000_000, {}, "asks for"), (3000, many, "100,000,000 triangles"),
        (-(2**40), {}, f"^is a damaged GLB file: an array of {-(2**40):,} numbers$"),
    ):  # fmt: skip
        accessors = {"accessors": [{"componentType": 5126, "count": count, "type": "VEC3"}]}
        with pytest.raises(AssetError, match=said):
            read_gltf(foreign.glb(json.dumps(document | accessors | change).encode()), "GLB", {}.__getitem__)


def test_a_reader_that_wants_too_much_is_ended(village):
    with pytest.raises(AssetError, match=r"needs more than 64 MB of memory to read: simplify or split the mesh"):
        read_mesh(village / "village.glb", max_memory_bytes=64 << 20)


def test_a_file_reads_nothing_outside_its_folder(tmp_path):
    folder = tmp_path / "mesh"
    folder.mkdir()
    box = trimesh.creation.box((10, 10, 5)).export(file_type="obj", include_normals=False)
    for place, is_read in ((tmp_path, False), (folder, True)):
        (place / "secret.mtl").write_text("newmtl wall\nKd 1 0 0\n")
        library = "secret.mtl" if is_read else "../secret.mtl"
        (folder / "box.obj").write_text(f"mtllib {library}\nusemtl wall\n{box}")
        (body,) = things(import_mesh("Box", read_here(folder / "box.obj"))[0])
        assert (body.attributes["colour"] == "red") == is_read


def test_a_scene_is_added_once_and_whole(village, tmp_path):
    added = add_scene("Village", village / "village.glb", tmp_path / "mine", MeshOptions())
    assert read_glb(tmp_path / "mine" / "scenes" / "Village.glb").n_triangles == added.scene.n_triangles
    before = (tmp_path / "mine" / "scenes" / "Village.glb").read_bytes()
    with pytest.raises(UsageError, match="--force"):
        add_scene("Village", village / "village.stl", tmp_path / "mine", MeshOptions())
    assert (tmp_path / "mine" / "scenes" / "Village.glb").read_bytes() == before
    add_scene("Village", village / "village.glb", tmp_path / "mine", MeshOptions(), force=True)
    assert (tmp_path / "mine" / "scenes" / "Village.glb").read_bytes() == before
    with pytest.raises(StoreError, match="not a scene name"):
        add_scene("../Village", village / "village.glb", tmp_path / "mine", MeshOptions())
    other = tmp_path / "other.json"
    other.write_text('{"scene": "Elsewhere", "landmarks": [], "objects": []}')
    with pytest.raises(AnnotationError, match="Elsewhere"):
        add_scene("V2", village / "village.glb", tmp_path / "mine", MeshOptions(), annotations=other)


@pytest.mark.nightly
@pytest.mark.parametrize("place", ["Helsinki", "Monastery"])
def test_a_real_place_up_to_planned_tasks(tmp_path, place):
    if place == "Helsinki":
        mesh, n_objects, options = tmp_path / "helsinki.glb", 8, MeshOptions(crop_m=(628.0, 97.0, 110.0))
        assert foreign.helsinki(mesh) == 486
    else:
        # The middle of it: drafting asks every one of its 1,400 bodies for viewpoints, and 32 m take three minutes.
        mesh, n_objects, options = foreign.monastery(), 4, MeshOptions(up="y", crop_m=(-7.0, 1.0, 14.0))
        assert import_mesh(place, read_mesh(mesh), MeshOptions(up="y"))[0].n_triangles > 100_000
    added, data = add_scene(place, mesh, tmp_path / "mine", options), tmp_path / "data"
    assert len(things(added.scene)) > 20
    assert place == "Monastery" or {i.category for i in things(added.scene)} == {"building"}
    pipeline, roots = open_pipeline(added.pipeline, data)
    draft_scene(place, pipeline, roots, DraftOptions(n_landmarks=2, n_objects=n_objects, max_per_category=30))
    run_pipeline(added.pipeline, data, stages=["filter"], scenes=[place], workers=1)
    assert pc.sum(store.read_scene(data, "verdicts", place)["keep"]).as_py() > 10


def test_colours_have_everyday_names():
    words = {
        "red": "#c81e1e", "white": "#fafafa #e6e6e2", "black": "#141414", "grey": "#828282 #2d2d30",
        "blue": "#2850c8", "green": "#3c963c", "brown": "#785032 #a5633c", "beige": "#e6d2aa", "purple": "#a03ca0",
    }  # fmt: skip
    assert {w: {colour_name(parse_colour(c)) for c in colours.split()} for w, colours in words.items()} == {
        w: {w} for w in words
    }
