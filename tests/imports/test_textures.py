"""Textures, vertex colours, holes and both sides of foreign meshes: from the file to pictures and words."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from support import textured
from support.foreign import raw, read_here
from support.handmade import box
from support.interchange import collada, fbx

from aerialdojo_gen.annotations.vocabulary import colour_shares, unsupported_colours
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.pictures import image_size
from aerialdojo_gen.geometry.cameras import Camera, look_at_pose
from aerialdojo_gen.imports.import_mesh import MeshOptions, import_mesh
from aerialdojo_gen.imports.pictures import SourceMaterial, decode_surfaces
from aerialdojo_gen.imports.raw import RawNode
from aerialdojo_gen.rendering.checks import Solid
from aerialdojo_gen.rendering.gl import GlRenderer
from aerialdojo_gen.rendering.orthographic import OrthographicPictures
from aerialdojo_gen.rendering.raycast import RayRenderer
from aerialdojo_gen.rendering.world import PyBulletRenderer
from aerialdojo_gen.scenes.glb import read_glb, write_glb
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.studio.web.payload import scene_payload

RENDERERS = (GlRenderer, PyBulletRenderer, RayRenderer)
CAMERA = Camera(256, 256, 90.0)


def stored(scene: Scene, path: Path) -> Scene:
    write_glb(scene, path)
    return read_glb(path)


def thing(scene: Scene, category: str):
    (one,) = [i for i in scene.instances if i.category == category]
    return one


def imported(path: Path, **options) -> Scene:
    return import_mesh("Mine", read_here(path), MeshOptions(**options))[0]


@pytest.fixture(scope="module")
def yard(tmp_path_factory) -> Scene:
    folder = tmp_path_factory.mktemp("yard")
    return stored(imported(textured.yard(folder / "yard.glb"), light="sun"), folder / "scene.glb")


@pytest.fixture(scope="module")
def board(tmp_path_factory) -> Scene:
    """A checkerboard on a wall that faces south, whose colours are drawn as they are."""
    folder = tmp_path_factory.mktemp("board")
    out = textured.Gltf()
    paint = out.material(textured.picture_file(textured.checkerboard()))
    out.node("Wall", textured.WALL, textured.WALL_FACES, paint, textured.WALL_UV)
    ground = np.array([[-30.0, -30, 0], [30, -30, 0], [30, 30, 0], [-30, 30, 0]])
    out.node("Ground", ground, textured.WALL_FACES, out.material(factor=[0.2, 0.25, 0.15, 1]))
    return stored(imported(out.write(folder / "board.glb"), light="baked"), folder / "scene.glb")


@pytest.mark.parametrize("renderer", RENDERERS)
def test_a_wall_shows_its_texture_pixel_for_pixel_and_its_mean_colour_from_both_sides_near_and_far(board, renderer):
    wanted = textured.checkerboard()
    with renderer(board) as camera:
        for side, away in ((-1, 4.0), (-1, 23.0), (1, 4.0), (1, 23.0)):
            pose = look_at_pose(np.array([0.0, side * away, 4]), np.array([0.0, 0, 4]))
            picture = camera.render(CAMERA, pose)
            shown = picture.rgb[np.abs(picture.depth_m - away) < 0.02]
            assert len(shown) > 1000
            # Haze is all that is added.
            np.testing.assert_allclose(shown.mean(axis=0), wanted.reshape(-1, 3).mean(axis=0), atol=5.0)
            if (side, away) == (-1, 4.0):
                # From 4 m a picture of 90 degrees shows 8 m of the wall; between two squares a pixel may be of both.
                assert (np.abs(picture.rgb.astype(int) - wanted).max(axis=2) > 4).mean() < 0.06
                assert np.abs(picture.rgb[:20, :20].astype(int) - (20, 40, 200)).max() <= 4
                np.testing.assert_allclose(picture.depth_m[40:200, 40:200], 4.0, atol=1e-3)


@pytest.mark.parametrize("renderer", RENDERERS)
def test_a_lit_wall_shows_its_texture_and_holes_are_looked_through(yard, renderer):
    hedge = thing(yard, "hedge").centroid
    with renderer(yard) as camera:
        rgb = camera.render(CAMERA, look_at_pose(np.array([0.0, -6, 4]), np.array([0.0, 0, 4]))).rgb[64:192, 64:192]
        leaves = np.abs(camera.render(CAMERA, look_at_pose(hedge + np.array([0, 6, 0]), hedge)).depth_m - 6.0) < 0.02
    # From 6 m the middle half of the picture shows 6 of the wall's 8 m.
    wanted = cv2.resize(textured.photograph()[32:224, 32:224], (128, 128), interpolation=cv2.INTER_AREA)
    for channel in range(3):
        assert np.corrcoef(rgb[..., channel].ravel(), wanted[..., channel].ravel())[0, 1] > 0.8
    # A quarter of the hedge's 4 x 4 m has leaves: its middle.
    edge = 2.0 / 6.0 * 128
    assert leaves[128, 128]
    assert leaves.sum() == pytest.approx(edge**2, rel=0.15)
    assert np.ptp(np.nonzero(leaves), axis=1) == pytest.approx([edge, edge], abs=4)


@pytest.mark.parametrize(
    "renderer", [GlRenderer, pytest.param(PyBulletRenderer, marks=pytest.mark.nightly), RayRenderer]
)
def test_a_dome_is_drawn_as_it_is_behind_everything_and_changes_nothing_else(renderer):
    nodes = [
        raw(box((-2, 8, 0), (2, 12, 3)), "Shed", (200, 40, 40)),
        raw(box((-30, -30, -1), (30, 30, 0)), "Yard", (120, 130, 100)),
    ]
    ball = trimesh.creation.icosphere(3, 300.0)
    halves = np.where(ball.triangles_center[:, :1] > 0, [[40, 90, 200]], [[230, 170, 90]]).astype(np.uint8)
    sky = RawNode("SkyDome", np.asarray(ball.vertices), np.asarray(ball.faces, np.int64), halves)
    under, bare = (import_mesh("Dome", many, MeshOptions(light="sun"))[0] for many in ([*nodes, sky], nodes))
    assert len(under.backdrop) == 1
    poses = [look_at_pose(np.array([0.0, 0, 4]), np.array(at)) for at in ((20.0, 0, 8), (-20, 0, 8), (0, 10, 3))]
    with renderer(under) as camera:
        pictures = [camera.render(CAMERA, pose) for pose in poses]
    with renderer(bare) as camera:
        without = [camera.render(CAMERA, pose) for pose in poses]
    # East of the middle it is blue, west of it sandy: neither light nor haze nor distance changes that.
    for picture, colour in zip(pictures, ((40, 90, 200), (230, 170, 90)), strict=False):
        np.testing.assert_allclose(picture.rgb[:40].reshape(-1, 3), np.tile(colour, (40 * 256, 1)), atol=2)
    for picture, other in zip(pictures, without, strict=True):
        np.testing.assert_array_equal(picture.depth_m, other.depth_m)
        solid = np.isfinite(picture.depth_m)
        assert 0.2 < solid.mean() < 0.8
        # At a border a pixel may be of both.
        inner = cv2.erode(solid.astype(np.uint8), np.ones((3, 3))) > 0
        np.testing.assert_array_equal(picture.rgb[inner], other.rgb[inner])


def test_vertex_colours_run_over_a_face(yard):
    stone = thing(yard, "stone")
    assert stone.attributes["colour"] in ("purple and yellow", "yellow and purple", "pink and yellow")
    with GlRenderer(yard) as camera:
        rgb = camera.render(CAMERA, look_at_pose(stone.centroid - (0, 4, 0), stone.centroid)).rgb
    column = rgb[100:157, 128].astype(int)
    # From yellow at the top to purple at the bottom, a little at a time.
    assert (np.diff(column[:, 1]) <= 0).all()
    assert column[0, 1] - column[-1, 1] > 60


def test_words_for_colours_are_what_textures_show(yard):
    truck = thing(yard, "truck")
    assert truck.attributes["colour"] == "blue and white"
    shares = colour_shares(truck, yard.materials)
    assert [shares["blue"], shares["white"]] == pytest.approx([0.5, 0.5], abs=0.05)
    assert unsupported_colours("blue and white", truck, yard.materials) == []
    assert unsupported_colours("red", truck, yard.materials) == ["red"]
    assert thing(yard, "hedge").attributes["colour"] == "green"


def test_from_neither_side_of_a_wall_is_a_camera_inside_and_in_a_house_it_is(yard):
    solid = Solid(yard)
    directions = CAMERA.rays().reshape(-1, 3)[::97]
    for y in (-3.0, 3.0):
        pose = look_at_pose(np.array([0.0, y, 4]), np.array([0.0, 0, 4]))
        _, behind = solid.first_hit(pose[:3, 3], directions @ pose[:3, :3].T)
        assert behind == 0.0
    # Upwards: the ground lies in the plane of the truck's underside, and which a ray hits first differs by processor.
    middle = thing(yard, "truck").centroid
    inside = look_at_pose(middle, middle + np.array([1.0, 0.5, 2.0]))
    # A ray along an edge may slip through between two sides.
    assert solid.first_hit(inside[:3, 3], directions @ inside[:3, :3].T)[1] > 0.95


def test_a_map_shows_both_sides_alike_and_no_stipples(yard):
    ground = thing(yard, "ground")
    (x0, y0, _), (x1, y1, _) = ground.bounds
    picture = OrthographicPictures(yard).from_above((x0, x1, y0, y1), 0.25)
    free = picture[2:20, 2:118]  # the north, where nothing stands
    assert np.ptp(free.reshape(-1, 3), axis=0).max() == 0


def test_a_scene_comes_back_from_its_file_to_the_bit_and_twice_the_same(tmp_path):
    made = set()
    for k in range(2):
        scene = imported(textured.yard(tmp_path / f"{k}.glb"))
        back = stored(scene, tmp_path / "scene.glb")
        write_glb(back, tmp_path / "again.glb")
        made |= {(tmp_path / name).read_bytes() for name in ("scene.glb", "again.glb")}
    assert len(made) == 1
    for one, other in zip(scene.instances, back.instances, strict=True):
        for a, b in zip(one.parts, other.parts, strict=True):
            assert np.array_equal(a.uv, b.uv)
            assert np.array_equal(a.colours, b.colours)  # None is itself
    for name, material in scene.materials.items():
        assert np.array_equal(material.texture, back.materials[name].texture)
        assert np.array_equal(material.mask, back.materials[name].mask)
    assert scene_payload(back) == scene_payload(back)


def scan_of(folder: Path, **options) -> Path:
    return textured.scan(folder / "scan.obj", cells=8, **options)


def texture_of(scene: Scene):
    (material,) = [m for m in scene.materials.values() if m.texture is not None]
    return material


def test_a_scan_keeps_its_jpeg_and_is_drawn_as_it_is(tmp_path):
    scene, repairs = import_mesh("Scan", read_here(scan_of(tmp_path)))
    material = texture_of(scene)
    assert material.jpeg == (tmp_path / "scan.jpg").read_bytes()
    assert material.unlit
    assert any("drawn as they are" in line for line in repairs.lines)
    assert sum(len(p.faces) for i in scene.instances for p in i.parts if p.material == material.name) == 2 * 8**2
    stored(scene, tmp_path / "s.glb")
    assert material.jpeg in (tmp_path / "s.glb").read_bytes()


def test_a_scans_jpeg_is_taken_as_it_is_stored_however_the_camera_was_held(tmp_path):
    path = scan_of(tmp_path, texture_px=128)
    picture = cv2.imread(str(tmp_path / "scan.jpg"))[:64]
    turned = cv2.imencode(".jpg", picture)[1].tobytes()
    # Orientation 6, a quarter turn, as cameras write it.
    tiff = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    exif = b"Exif\0\0" + tiff
    turned = turned[:2] + b"\xff\xe1" + (2 + len(exif)).to_bytes(2, "big") + exif + turned[2:]
    (tmp_path / "scan.jpg").write_bytes(turned)
    scene = imported(path)
    mine = texture_of(scene).texture
    assert mine.shape == (64, 128, 3)
    np.testing.assert_array_equal(mine, texture_of(stored(scene, tmp_path / "s.glb")).texture)


@pytest.mark.parametrize("kind", ["jpeg", "bmp"])
def test_a_scene_that_asks_for_gigabytes_of_pixels_is_refused(kind, tmp_path, monkeypatch):
    """Scenes come from the Hub too: neither may a file of another kind pass for a small PNG."""
    write_glb(imported(scan_of(tmp_path, texture_px=64)), tmp_path / "s.glb")
    whole, jpeg = (tmp_path / "s.glb").read_bytes(), (tmp_path / "scan.jpg").read_bytes()
    if kind == "jpeg":
        at = jpeg.index(b"\xff\xc0") + 5
        bad = jpeg[:at] + (60000).to_bytes(2, "big") * 2 + jpeg[at + 4 :]
    else:
        head = b"BM" + bytes(8) + (54).to_bytes(4, "little") + (40).to_bytes(4, "little")
        bad = head + (16384).to_bytes(4, "little") * 2 + b"\1\0\x18\0"
        bad += bytes(len(jpeg) - len(bad))
    assert whole.count(jpeg) == 1
    (tmp_path / "s.glb").write_bytes(whole.replace(jpeg, bad))
    decoded: list[int] = []
    decode = cv2.imdecode
    monkeypatch.setattr(cv2, "imdecode", lambda *given: decoded.append(1) or decode(*given))
    with pytest.raises(AssetError, match="damaged"):
        read_glb(tmp_path / "s.glb")
    assert not decoded


def test_textures_keep_to_their_budget_and_missing_ones_are_told(tmp_path):
    path = scan_of(tmp_path, texture_px=512)
    scene, repairs = import_mesh("Scan", read_here(path, texture_px=128))
    assert texture_of(scene).texture.shape == (128, 128, 3)
    assert any("512 x 512 pixels is kept at 128 x 128" in line for line in repairs.lines)
    (tmp_path / "scan.jpg").unlink()
    scene, repairs = import_mesh("Scan", read_here(path))
    assert all(m.texture is None for m in scene.materials.values())
    assert any("scan.jpg" in line for line in repairs.lines)
    path.with_suffix(".mtl").unlink()
    assert any("scan.mtl" in line for line in import_mesh("Scan", read_here(path))[1].lines)


def test_an_object_of_several_materials_has_all_of_them(tmp_path):
    corners = "v -4 0 0\nv 4 0 0\nv 4 0 8\nv -4 0 8\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    faces = "usemtl one\nf 1/1 2/2 3/3\nusemtl two\nf 1/1 3/3 4/4\n"
    (tmp_path / "wall.obj").write_text(f"mtllib m.mtl\no Wall\n{corners}{faces}")
    (tmp_path / "m.mtl").write_text("newmtl one\nmap_Kd a.png\nnewmtl two\nKd 0 1 0\n")
    (tmp_path / "a.png").write_bytes(textured.picture_file(textured.checkerboard()))
    (node,) = read_here(tmp_path / "wall.obj")
    assert node.name == "Wall"
    shown = [node.surfaces[k] for k in node.surface]
    assert sorted((s.texture is not None, s.colour) for s in shown)[0] == (False, (0, 255, 0))
    assert [s.texture is not None for s in shown].count(True) == 1
    # An object stays one where its materials are not there, or are not told apart.
    for library in ("newmtl one\nKd 0 1 0\n", "", None):
        (tmp_path / "m.mtl").unlink() if library is None else (tmp_path / "m.mtl").write_text(library)
        (node,) = read_here(tmp_path / "wall.obj")
        assert (node.name, len(node.faces)) == ("Wall", 2)


def test_ply_keeps_the_colours_of_its_vertices(tmp_path):
    body = trimesh.creation.icosphere(3, 8.0)
    height = (body.vertices[:, 2] + 8.0) / 16.0
    paint = np.column_stack([255 * height, 80 * np.ones_like(height), 255 * (1 - height)])
    body.visual.vertex_colors = np.rint(paint).astype(np.uint8)
    body.export(tmp_path / "ball.ply")
    scene = imported(tmp_path / "ball.ply")
    (part,) = next(i for i in scene.instances if i.category != "ground").parts
    high = part.vertices[:, 2] / np.ptp(part.vertices[:, 2])
    np.testing.assert_allclose(part.colours[:, 0], 255 * high, atol=2.0)


def test_gltf_says_more_than_plain_triangles(tmp_path):
    """Normalised integers, a second set of coordinates, a moved texture, a strip, a factor, a mirrored node."""
    out = textured.Gltf()
    paint = out.material(textured.picture_file(textured.checkerboard(2)), factor=[0.5, 1, 1, 1])
    texture = out.document["materials"][paint]["pbrMetallicRoughness"]["baseColorTexture"]
    texture |= {"texCoord": 1, "extensions": {"KHR_texture_transform": {"scale": [2, 2], "offset": [0.5, 0]}}}
    out.node("Wall", textured.WALL[[0, 1, 3, 2]], [0, 1, 2, 3], paint)
    primitive = out.document["meshes"][0]["primitives"][0]
    uv = (textured.WALL_UV[[0, 1, 3, 2]] * 65535).astype(np.uint16)
    primitive["attributes"]["TEXCOORD_1"] = out.accessor(uv, normalized=True)
    primitive["mode"] = 5
    out.document["nodes"][0] |= {"scale": [-1, 1, 1]}
    (node,) = read_here(out.write(tmp_path / "wall.glb"))
    assert len(node.faces) == 2
    np.testing.assert_allclose(np.unique(node.corners[..., 0]), [0.5, 2.5], atol=1e-4)
    normal = np.cross(*(node.vertices[node.faces[:, k]] - node.vertices[node.faces[:, 0]] for k in (1, 2)))
    # Turned by the mirror, and turned back.
    assert (normal[:, 1] < 0).all()
    texture = node.surfaces[0].texture
    # Half the light of 235 is 173, of 190 139 and of 20 12 (IEC 61966-2-1); what is not red stays.
    np.testing.assert_allclose(np.unique(texture[..., 0]), [12, 139, 173], atol=1)
    assert set(np.unique(texture[..., 1])) == {40, 235}
    # Two primitives of one mesh are one node of two materials.
    out.document["meshes"][0]["primitives"].append(primitive | {"material": out.material(factor=[0, 1, 0, 1])})
    (node,) = read_here(out.write(tmp_path / "wall.glb"))
    assert [node.surfaces[k].texture is None for k in node.surface] == [False, False, True, True]


@pytest.mark.parametrize(
    ("file", "said"),
    [
        (b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(40), "KTX2"),
        (b"no picture at all", "not PNG, JPEG"),
        (b"\x89PNG\r\n\x1a\n" + bytes(8) + (60000).to_bytes(4, "big") * 2, "60000 x 60000"),
    ],
)
def test_bad_textures_are_told_and_the_mesh_stays(file, said):
    (surface,), _ = decode_surfaces([SourceMaterial("wall", (1.0, 0.0, 0.0), file)])
    assert (surface.texture, surface.colour) == (None, (255, 0, 0))
    assert said in surface.notes[0]


def test_sizes_of_pictures_are_told_without_decoding():
    picture = np.zeros((20, 30, 3), dtype=np.uint8)
    for suffix in (".png", ".jpg", ".bmp", ".webp"):
        assert image_size(textured.picture_file(picture, suffix)) == (30, 20)


@pytest.mark.parametrize("suffix", [".dae", ".fbx"])
def test_interchange_files_bring_their_textures_and_places(tmp_path, suffix):
    (tmp_path / "board.png").write_bytes(textured.picture_file(textured.checkerboard()))
    flat = textured.WALL[:, [0, 2, 1]]  # y up
    text = {
        ".dae": collada(textured.WALL, textured.WALL_FACES, textured.WALL_UV, move=(0, 5, 0)),
        ".fbx": fbx(flat, textured.WALL_FACES, textured.WALL_UV, move=(0, 0, -5)),
    }
    (tmp_path / f"wall{suffix}").write_text(text[suffix])
    (node,) = read_here(tmp_path / f"wall{suffix}")
    assert node.name == "Body"
    # Whatever the file's axis, Assimp turns Collada y up.
    np.testing.assert_allclose(node.vertices[:, 2], -5.0)
    np.testing.assert_array_equal(node.surfaces[node.surface[0]].texture, textured.checkerboard())
    at = node.vertices[node.faces]
    np.testing.assert_allclose(node.corners[..., 0], (at[..., 0] + 4) / 8, atol=1e-6)
    np.testing.assert_allclose(node.corners[..., 1], at[..., 1] / 8, atol=1e-6)
