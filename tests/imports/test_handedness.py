"""No import is a mirror image: corners of an asymmetric body lie where the file's axes say, in every format."""

import numpy as np
import pytest
import trimesh
from PIL import Image
from support import foreign, maps
from support.interchange import collada, fbx

from aerialdojo_gen.imports.dem import read_dem
from aerialdojo_gen.imports.earth import LocalFrame
from aerialdojo_gen.imports.import_mesh import MeshOptions, import_mesh

# A tetrahedron, x east, y north, z up: four edges of different lengths meet in a corner, so that no mirror image and
# no other turn of it has its corners in these places.
CORNERS = np.array([[0.0, 0, 0], [30, 0, 0], [0, 20, 0], [0, 0, 10]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
# In a file whose y points up, x points east and so z south: right-handed as all of these formats are.
IN_FILE = {"z": CORNERS, "y": np.column_stack([CORNERS[:, 0], CORNERS[:, 2], -CORNERS[:, 1]])}


def write(path, vertices, up):
    if path.suffix == ".dae":
        path.write_text(collada(vertices, FACES, up=up))
    elif path.suffix == ".fbx":
        path.write_text(fbx(vertices, FACES))
    elif path.suffix == ".3ds":
        path.write_bytes(foreign.three_ds([("body", trimesh.Trimesh(vertices, FACES, process=False))], (9, 9, 9)))
    else:
        trimesh.Scene(trimesh.Trimesh(vertices, FACES, process=False)).export(path)


def corners_of(scene):
    """Corners of all but the ground, from the corner of the right angles, in the order of their distances."""
    (body,) = [i for i in scene.instances if i.category != "ground"]
    own = np.unique(np.round(body.vertices, 3), axis=0)
    # As in CORNERS: it has the least x, the least y and the least z.
    own = own - own.min(axis=0)
    return own[np.argsort(np.linalg.norm(own, axis=1))], trimesh.Trimesh(body.vertices, body.faces)


@pytest.mark.parametrize(
    ("suffix", "up"),
    # Assimp turns Collada y up, whatever its own axis.
    [(f".{s}", up) for s in ("glb", "gltf", "obj", "stl", "ply", "3ds", "fbx", "dae") for up in "zy"],
)
def test_an_import_is_turned_and_never_mirrored(tmp_path, suffix, up):
    write(tmp_path / f"body{suffix}", IN_FILE[up], up)
    scene, _ = import_mesh(
        "Body", foreign.read_here(tmp_path / f"body{suffix}"), MeshOptions(up="y" if suffix == ".dae" else up)
    )
    corners, mesh = corners_of(scene)
    np.testing.assert_allclose(corners, CORNERS[[0, 3, 2, 1]], atol=2e-3)
    assert mesh.volume == pytest.approx(30 * 20 * 10 / 6, rel=1e-3)


@pytest.mark.parametrize("up", ["z", "y"])
@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_a_picture_on_a_wall_is_read_from_left_to_right(tmp_path, suffix, up):
    """Seen from the south: u runs east and v up, and the picture's first row is the highest one."""
    letter = np.zeros((8, 8, 3), dtype=np.uint8)
    letter[:4, :4, 0] = letter[:4, 4:, 1] = letter[4:, :4, 2] = 255
    wall = np.array([[0.0, 0, 0], [30, 0, 0], [30, 0, 10], [0, 0, 10]])
    wall = wall if up == "z" else np.column_stack([wall[:, 0], wall[:, 2], -wall[:, 1]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    visual = trimesh.visual.TextureVisuals(uv=uv, image=Image.fromarray(letter))
    mesh = trimesh.Trimesh(wall, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)
    trimesh.Scene(mesh).export(tmp_path / f"wall{suffix}")
    scene, _ = import_mesh("Wall", foreign.read_here(tmp_path / f"wall{suffix}"), MeshOptions(up=up))
    (part,) = next(i for i in scene.instances if i.category != "ground").parts
    np.testing.assert_array_equal(scene.materials[part.material].texture > 128, letter > 128)
    at = (part.vertices - part.vertices.min(axis=0)) / (30, 1, 10)
    np.testing.assert_allclose(part.uv, at[:, [0, 2]], atol=1e-5)


def test_every_height_model_has_north_up_and_east_on_the_right(tmp_path):
    """The hill is higher in the east and in the south: a mirror image differs by metres."""
    from rasterio import warp

    x, y = np.array([20.0, -20, 20, -20]), np.array([-10.0, -10, 10, 10])
    z, wanted = maps.heights(2.0, 60.0), maps.hill(x, y)
    assert np.ptp(wanted) > 5.0
    np.savez(tmp_path / "cell.npz", heights_m=z, cell_m=2.0)
    np.savez(tmp_path / "bbox.npz", heights_m=z, bbox_deg=maps.box(60.0))
    head = f"ncols {z.shape[1]}\nnrows {z.shape[0]}\nxllcenter -60\nyllcenter -60\ncellsize 2\n"
    (tmp_path / "grid.asc").write_text(head + "\n".join(" ".join(map(str, row)) for row in z))
    maps.hill_tif(tmp_path / "grid.tif")
    lon, lat = maps.FRAME.degrees(x, y)
    np.testing.assert_allclose(read_dem(tmp_path / "cell.npz").at(x + 60, y + 60), wanted, atol=0.01)
    np.testing.assert_allclose(read_dem(tmp_path / "grid.asc").at(x, y), wanted, atol=0.01)
    for name in ("bbox.npz", "grid.tif"):
        np.testing.assert_allclose(read_dem(tmp_path / name).at_degrees(lon, lat), wanted, atol=0.02)
    # On the middle meridian of zone 35 its north is north; its scale there is 0.9996.
    (x0,), (y0,) = warp.transform("EPSG:4326", "EPSG:32635", [27.0], [60.2])
    utm = maps.write_geotiff(tmp_path / "utm.tif", z, "EPSG:32635", x0 - 61.0, y0 + 61.0, 2.0, 2.0)
    np.testing.assert_allclose(read_dem(utm).at_degrees(*LocalFrame(27.0, 60.2).degrees(x, y)), wanted, atol=0.03)
