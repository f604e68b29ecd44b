"""Point clouds and occupancy grids of scenes, against trimesh, FCL and the planner's grid; meshes alone are there."""

import json
from functools import partial

import fcl
import numpy as np
import pytest
import trimesh
from support.command_line import called
from support.handmade import box, instance, mesh_of, scene

from aerialdojo_gen.base.errors import AerialDojoError, StoreError, UsageError
from aerialdojo_gen.exchange.exporting import export_shapes
from aerialdojo_gen.exchange.shape_export import sample_surface
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.occupancy import SLACK_M, Occupancy
from aerialdojo_gen.scenes.glb import write_glb
from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene

HALF, PER_M2 = 8.0, 50.0
BOARD = np.zeros((4, 4, 3), np.uint8)
BOARD[:2], BOARD[2:] = (10, 20, 200), (190, 40, 30)  # Blue above, red below


def made(name: str = "U_Test_0") -> Scene:
    """A crate and a ball on the ground, a leaning board with a picture, a slab of two colours at its corners."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.3)
    ball.apply_translation([3.03, -2.0, 2.5])
    ball.vertices = np.float32(ball.vertices).astype(float)
    corners = np.array([[-4, 2, 0.5], [-1, 2, 0.5], [-1, 3, 2.5], [-4, 3, 2.5]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    board = Instance("board", "sign", "", {}, (Part(corners, faces, uv, "picture"),))
    ends = np.array([[0, 0, 0], [200, 0, 0], [200, 0, 0], [0, 0, 0]], np.uint8)
    slab = Instance("slab", "sign", "", {}, (Part(corners + np.array([5, 2, 0]), faces, uv, "grey", ends),))
    crate = instance("crate", box((-5.0, -5.0, 0.0), (-2.0, -3.0, 2.0)))
    plain = scene(crate, instance("ball", ball), board, slab, half=HALF, ceiling=9.0, name=name)
    picture = Material("picture", (100, 30, 115), BOARD, atlas=True)
    return Scene(name, plain.instances, {**plain.materials, "picture": picture}, plain.bounds)


def write(data, *scenes: Scene):
    (data / "meshes").mkdir(parents=True, exist_ok=True)
    for one in scenes:
        write_glb(one, data / "meshes" / f"{one.name}.glb")
    return data


def positions(points) -> np.ndarray:
    return np.stack([points[name] for name in "xyz"], axis=1).astype(float)


@pytest.fixture(scope="module")
def points():
    return sample_surface(made(), PER_M2)


def test_points_lie_on_the_instance_that_they_name(points):
    for number, one in enumerate(made().instances, 1):
        own = positions(points[points["instance"] == number])
        mesh = mesh_of(one)
        assert len(own) == pytest.approx(mesh.area * PER_M2, abs=1)
        _, distance_m, _ = trimesh.proximity.closest_point(mesh, own[:: max(1, len(own) // 400)])
        assert distance_m.max() < 1e-3


def test_points_are_spread_evenly(points):
    own = positions(points[points["instance"] == 1])
    top = own[(own[:, 2] == 0.0) & (np.abs(own[:, :2]) < HALF).all(axis=1)]
    count, *_ = np.histogram2d(top[:, 0], top[:, 1], bins=np.arange(-HALF, HALF + 1, 1.0))
    assert count.mean() == pytest.approx(PER_M2, rel=0.02)
    assert count.std() < 0.75 * np.sqrt(PER_M2), "more even than chance"
    assert count.min() > 0.5 * PER_M2


def test_points_have_the_colour_of_their_surface(points):
    rgb = np.stack([points[name] for name in ("red", "green", "blue")], axis=1)
    assert (rgb[points["instance"] == 2] == 128).all()
    board = points["instance"] == 4
    above = points["z"][board] > 1.5
    assert (rgb[board][above] == BOARD[0, 0]).all()
    assert (rgb[board][~above] == BOARD[3, 0]).all()
    slab = points["instance"] == 5
    assert rgb[slab][:, 0] == pytest.approx(200 * (points["x"][slab] - 1.0) / 3.0, abs=1)


def test_points_depend_on_the_scene_and_the_instance_alone(points):
    whole = made()
    less = Scene(whole.name, whole.instances[:-1], whole.materials, whole.bounds)
    np.testing.assert_array_equal(sample_surface(less, PER_M2), points[points["instance"] < 5])
    assert (positions(sample_surface(made("U_Test_1"), PER_M2))[:9] != positions(points)[:9]).any()


@pytest.mark.parametrize("voxel_m", [0.5, 0.3])
def test_voxels_are_occupied_where_a_surface_touches_them(points, voxel_m):
    world = made()
    grid = Occupancy.of(world, voxel_m)
    shape = np.array(grid.occupied.shape)
    at = np.floor((positions(points) - grid.origin_m) / voxel_m).astype(int)
    inside = ((at >= 0) & (at < shape)).all(axis=1)
    assert inside.mean() > 0.4, "the ground reaches further"
    assert grid.occupied[tuple(at[inside].T)].all()
    model = fcl.BVHModel()
    vertices, faces = soup(world.instances)
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices, faces.astype(np.int64))
    model.endModel()
    surfaces = fcl.CollisionObject(model)

    def touched(cell, edge):
        centre = grid.origin_m + voxel_m * (cell + 0.5)
        cube = fcl.CollisionObject(fcl.Box(edge, edge, edge), fcl.Transform(centre))
        return bool(fcl.collide(surfaces, cube, fcl.CollisionRequest(), fcl.CollisionResult()))

    rng = np.random.default_rng(0)
    near = np.argwhere(ClearanceGrid.build(world, voxel_m).arrays.field < 1.5 * voxel_m)
    near = np.concatenate([near[near[:, 2] > 2], near[rng.permutation(len(near))[:1000]]])
    seen = set()
    for cell in near[rng.permutation(len(near))[:3000]]:
        is_occupied = bool(grid.occupied[tuple(cell)])
        seen.add(is_occupied)
        # What touches to a tenth of a millimetre may be either.
        if touched(cell, voxel_m - 4 * SLACK_M):
            assert is_occupied
        if is_occupied:
            assert touched(cell, voxel_m + 4 * SLACK_M)
    assert seen == {False, True}


def test_voxels_are_the_planners_cells():
    world = made()
    grid, planned = Occupancy.of(world), ClearanceGrid.build(world)
    field, half = planned.arrays.field, 0.25
    np.testing.assert_array_equal(grid.origin_m, planned.arrays.origin)
    np.testing.assert_array_equal(grid.reachable, planned.sky)
    assert grid.occupied[field < half].all()
    assert not grid.occupied[field > half * np.sqrt(3.0) + 0.01].any()
    aloft, in_ball = ((np.array(p) - grid.origin_m) // 0.5 for p in ([0.2, 0.2, 7.2], [3.03, -2.0, 2.5]))
    aloft, in_ball = tuple(aloft.astype(int)), tuple(in_ball.astype(int))
    assert not grid.occupied[aloft]
    assert grid.reachable[aloft]
    assert not grid.occupied[in_ball], "bodies are hollow"
    assert not grid.reachable[in_ball]


def test_files_are_read_with_plain_libraries_and_are_the_same_each_time(tmp_path):
    data = write(tmp_path / "data", made(), made("U_Test_1"), made("N_Other_0"))
    for form, suffixes in (("pointcloud", (".nodes.json", ".ply")), ("occupancy", (".npz",))):
        first, second = tmp_path / f"{form}1", tmp_path / f"{form}2"
        counts = export_shapes(form, data, first, ["U_*"])
        assert export_shapes(form, data, second, ["U_Test_1", "U_Test_0"]) == counts
        names = sorted([f"U_Test_{k}{suffix}" for k in (0, 1) for suffix in suffixes] + ["export.json"])
        assert sorted(path.name for path in first.iterdir()) == names
        assert all((first / name).read_bytes() == (second / name).read_bytes() for name in names)
        assert json.loads((first / "export.json").read_text())["counts"] == counts
    path = tmp_path / "pointcloud1" / "U_Test_0.ply"
    cloud = trimesh.load(path)
    stored = sample_surface(made(), 20.0)
    np.testing.assert_array_equal(cloud.vertices, positions(stored))
    np.testing.assert_array_equal(cloud.colors[:, 1], stored["green"])
    raw = cloud.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(raw["instance"], stored["instance"])
    nodes = json.loads((tmp_path / "pointcloud1" / "U_Test_0.nodes.json").read_text())["nodes"]
    assert nodes == ["ground", "crate", "ball", "board", "slab"]
    with np.load(tmp_path / "occupancy1" / "U_Test_0.npz", allow_pickle=False) as grid:
        assert set(grid) == {"occupied", "reachable", "origin_m", "voxel_m"}
        assert grid["occupied"].dtype == bool
        assert (grid["origin_m"].dtype, grid["origin_m"].shape) == (np.float64, (3,))
        assert grid["voxel_m"] == 0.5
        np.testing.assert_array_equal(grid["occupied"], Occupancy.of(made()).occupied)


def test_the_command_says_what_it_wrote_and_what_is_wrong_is_left_out(tmp_path):
    data = write(tmp_path / "data", made())
    out = tmp_path / "out"
    call = partial(called, "export", "--data", data, "--out", out)
    done = call("--format", "pointcloud", "--points-per-m2", "2")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().startswith(f"{out}: 1 scenes, 1,")
    assert "--force replaces it" in call("--format", "occupancy").stderr
    assert call("--format", "occupancy", "--voxel-m", "1", "--force", "--quiet").stdout == ""
    assert sorted(path.name for path in out.iterdir()) == ["U_Test_0.npz", "export.json"]
    wide = made("U_Wide_0")
    write(data, Scene(wide.name, wide.instances, wide.materials, wide.bounds * 40))
    with pytest.raises(UsageError, match=r"U_Wide_0: .* voxels are more than"):
        export_shapes("occupancy", data, tmp_path / "wide", ["U_Wide_0"])
    with pytest.raises(StoreError, match=r"there is no mesh in .*no/meshes"):
        export_shapes("occupancy", tmp_path / "no", tmp_path / "none")
    (data / "meshes/U_Test_0.glb").write_bytes(b"no mesh")
    with pytest.raises(AerialDojoError, match=r"U_Test_0\.glb"):
        export_shapes("pointcloud", data, tmp_path / "none")
    assert {path.name for path in tmp_path.iterdir()} == {"data", "out"}
