"""Parts of large meshes: triangles are cut at the border, closed bodies closed again, tiles lie side by side."""

import re

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from support.command_line import said
from support.foreign import raw, read_here
from support.hills import hills, standing, write_hills

from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.imports.command import add_scene, add_tiles
from aerialdojo_gen.imports.cutting import _GRID_M, Region, cut
from aerialdojo_gen.imports.import_mesh import MeshOptions, SourceMesh, import_mesh
from aerialdojo_gen.imports.listing import describe_mesh, infer_axes
from aerialdojo_gen.imports.naming import Naming
from aerialdojo_gen.imports.raw import RawNode
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.recipe import load_imported


def city(seed: int = 0, streets: int = 6, up: str = "z") -> list[RawNode]:
    """One soup of houses on a plate, as a city of a single object is."""
    rng = np.random.default_rng(seed)
    bodies = [trimesh.creation.box(bounds=[[-5, -5, -1], [30 * streets + 5, 30 * streets + 5, 0]])]
    for i in range(streets):
        for j in range(streets):
            size = rng.uniform([8, 8, 5], [18, 18, 25])
            at = np.array([30 * i + 15, 30 * j + 15])
            bodies.append(trimesh.creation.box(bounds=[[*(at - size[:2] / 2), 0], [*(at + size[:2] / 2), size[2]]]))
    soup = trimesh.util.concatenate(bodies)
    if up == "y":
        soup.vertices = np.column_stack([soup.vertices[:, 0], soup.vertices[:, 2], -soup.vertices[:, 1]])
    return [raw(soup)]


def outside(region: Region, xy: np.ndarray) -> float:
    return max(float((xy @ normal - offset).max()) for normal, offset in region.planes)


def volume_within(region: Region, mesh: trimesh.Trimesh) -> float:
    for normal, offset in region.planes:
        inwards, at = -np.array([*normal, 0.0]), np.array([*(normal * offset), 0.0])
        mesh = trimesh.intersections.slice_mesh_plane(mesh, inwards, at, cap=True)
    return float(mesh.volume)


def welded(corners: np.ndarray, apart_m: float) -> trimesh.Trimesh:
    """Triangles whose corners are one vertex where they lie no farther apart; rounding would part some of them."""
    pairs = cKDTree(corners).query_pairs(apart_m, output_type="ndarray")
    n = len(corners)
    _, label = connected_components(coo_array((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)
    _, first = np.unique(label, return_index=True)
    made = trimesh.Trimesh(corners[first], label.reshape(-1, 3), process=False)
    made.update_faces(made.nondegenerate_faces(height=0))
    return made


@settings(max_examples=5, deadline=None)
@example(12408, True)  # ends of the rim that are hardly apart
@example(1976, True)  # and on two sides of a border of the grid: a whole side was left open
@given(st.integers(0, 10**6), st.booleans())
def test_what_is_kept_lies_within_and_closed_bodies_stay_closed(seed, round_):
    rng = np.random.default_rng(seed)
    body = trimesh.creation.torus(8, 3, 12, 8) if seed % 2 else trimesh.creation.box((14, 9, 6))
    body.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
    at = rng.uniform(-6, 6, 2)
    region = Region.circle(*at, rng.uniform(3, 9)) if round_ else Region.box(*at, *(at + rng.uniform(2, 12, 2)))
    pieces = cut(np.asarray(body.vertices), np.asarray(body.faces, np.int64), region)
    if not len(pieces.source):
        return
    assert outside(region, pieces.corners[:, :, :2].reshape(-1, 2)) < 1e-9
    # Corners are what their weights make of the triangle that they were cut from, but for those that close a cut.
    mixed = np.einsum("kij,kjd->kid", pieces.weights, body.vertices[body.faces[pieces.source]])
    own = ~(pieces.weights[:, :, 0] == 1.0).all(axis=1)
    np.testing.assert_allclose(mixed[own], pieces.corners[own], atol=1e-9)
    made = welded(pieces.corners.reshape(-1, 3), 2 * _GRID_M)
    edges, count = np.unique(np.sort(made.edges, axis=1), axis=0, return_counts=True)
    gaping = np.linalg.norm(made.vertices[edges[count % 2 == 1, 0]] - made.vertices[edges[count % 2 == 1, 1]], axis=1)
    assert gaping.sum() < 1e-3
    if not round_:
        assert made.volume == pytest.approx(volume_within(region, body), abs=1e-3)


def test_a_crop_cuts_triangles_of_one_large_object_and_closes_its_houses():
    nodes = city()
    for options, region in (
        ({"crop_m": (70.0, 80.0, 40.0)}, Region.circle(70, 80, 40)),
        ({"box_m": (110.0, 131.5, 60.0, 44.0)}, Region.box(60, 44, 110, 131.5)),
    ):
        scene, repairs = import_mesh("City", nodes, MeshOptions(**options))
        origin = np.array(repairs.origin_m)
        for thing in scene.instances:
            if thing.category != "ground":
                assert outside(region, thing.vertices[:, :2] + origin[:2]) < 1e-4
                assert thing.surface == "solid"
                assert trimesh.Trimesh(thing.vertices, thing.faces).is_watertight
        # The plate, and more than a handful of houses: nothing is kept or dropped by the middle of a whole body.
        assert len(scene.instances) > 5
        assert (scene.bounds[0, :2] + origin[:2] >= region.low - 1e-9).all()
        assert (scene.bounds[1, :2] + origin[:2] <= region.high + 1e-9).all()


def test_a_part_without_anything_says_what_lies_where():
    nodes = city()
    with pytest.raises(AssetError, match=r"--crop 900 900 5: contains no part of the mesh: x is -5 to 185, y -5 to"):
        import_mesh("City", nodes, MeshOptions(crop_m=(900.0, 900.0, 5.0)))
    large = r"too large to plan in.*--box X0 Y0 X1 Y1.*--tiles 200.*x is -250 to 9250, y"
    for scale, why in ((50.0, large), (0.02, r"too small.*--scale")):
        with pytest.raises(AssetError, match=why):
            import_mesh("City", nodes, MeshOptions(scale=scale))


def test_tiles_lie_side_by_side_in_one_frame(tmp_path):
    mesh = write_hills(hills(3, cells=30), [], tmp_path / "hills.glb")
    made = add_tiles("Valley_1", mesh, tmp_path / "mine", 25.0, MeshOptions())
    names = [added.scene.name for added in made]
    assert names == [f"Valley-x{x}y{y}_1" for y in range(3) for x in range(3)]
    corners = {}
    for added in made:
        scene = read_glb(tmp_path / "mine/scenes" / f"{added.scene.name}.glb")
        recipe = load_imported(tmp_path / "mine/scenes" / f"{added.scene.name}.toml")
        assert recipe.origin_m == made[0].repairs.origin_m
        x0, y0, x1, y1 = np.array(recipe.box_m) - np.tile(np.array(recipe.origin_m)[:2], 2)
        sheet = next(i for i in scene.instances if i.category == "terrain")
        assert sheet.surface == "ground"
        v = sheet.vertices
        assert (v[:, :2] >= [x0 - 1e-4, y0 - 1e-4]).all()
        assert (v[:, :2] <= [x1 + 1e-4, y1 + 1e-4]).all()
        for axis, at in ((0, x1), (0, x0), (1, y1), (1, y0)):
            corners.setdefault((axis, round(at, 3)), []).append(v[np.abs(v[:, axis] - at) < 1e-4])
    # What two tiles have at their common border are the same places, heights too.
    shared = [(1 - axis, both) for (axis, at), both in corners.items() if len(both) == 6]
    assert len(shared) == 4
    for along, places in shared:
        for part in places:
            middles = [abs(p[:, along].mean() - part[:, along].mean()) for p in places]
            (other,) = (p for p, m in zip(places, middles, strict=True) if p is not part and m < 1.0)
            order = np.argsort(other[:, along])
            heights = np.interp(part[:, along], other[order, along], other[order, 2])
            np.testing.assert_allclose(part[:, 2], heights, atol=1e-3)
    with pytest.raises(UsageError, match="--force"):
        add_tiles("Valley_1", mesh, tmp_path / "mine", 25.0, MeshOptions())
    with pytest.raises(UsageError, match=r"--tiles 1: the edge"):
        add_tiles("Other", mesh, tmp_path / "mine", 1.0, MeshOptions())
    assert not list((tmp_path / "mine/scenes").glob("Other*"))


@pytest.mark.parametrize(
    ("up", "scale", "unit"),
    [("z", 1.0, "metres"), ("y", 100.0, "centimetres"), ("y", 1000.0, "millimetres"), ("z", 1 / 0.3048, "metres")],
)
def test_axis_and_unit_are_guessed_by_form(up, scale, unit):
    (node,) = city(up=up)
    axes = infer_axes([node.with_vertices(node.vertices * scale)])
    assert axes.up == up
    assert axes.up_sure
    # 190 m in millimetres may be 1.9 km in centimetres: the second guess. Metres and centimetres are the first one.
    assert [name for _, name in axes.units].index(unit) <= (unit == "millimetres")


@given(st.floats(51.0, 900.0))
def test_a_file_in_centimetres_is_not_taken_for_one_in_inches(wide_m):
    """Between 50 and 157 m wide it was, as 250 m are the usual width."""
    units = infer_axes([raw(trimesh.creation.box((100 * wide_m, 60 * wide_m, 1500.0)))]).units
    assert units[0] == (0.01, "centimetres")
    assert (0.0254, "inches") in units


def test_what_is_in_no_unit_has_its_size_in_plain_digits(tmp_path):
    text = "\n".join(f"v {x} {y} {z}" for x, y, z in [(0, 0, 0), (12e6, 0, 0), (12e6, 12e6, 0), (9, 9, 2.84e6)])
    (tmp_path / "no names.obj").write_text(f"{text}\nf 1 2 3\nf 1 2 4\nf 2 3 4\n")
    out = "\n".join(describe_mesh(read_here(tmp_path / "no names.obj"), None, 0.001, Naming(), None))
    assert "scale: 0.001 as given: 12,000 by 12,000 by 2,840 m (x, y, z)\n" in out
    assert re.search(r"densest about x -?\d+, y -?\d+ \(\d of 3 triangles\)", out)
    assert re.search(r"^- +- +3 ", out, re.MULTILINE)  # the only node, without a name
    assert str(tmp_path) not in out
    assert "e+" not in out


@pytest.mark.parametrize(
    "options",
    ["--up Y", "--scale -1", "--scale nan", "--light moon", "--crop 0 0 0", "--crop 0 nan 5", "--box 1 0 1 9",
     "--crop 0 0 9 --box 0 0 9 9"],
)  # fmt: skip
def test_wrong_options_are_refused_before_the_mesh_is_read(tmp_path, capsys, options):
    word, *_ = given = options.split()
    for how in ([], ["--tiles", "100"], ["--list"])[: 3 if word in ("--up", "--scale") else 2]:
        up = [] if word == "--up" else ["--up", "z"]
        code, _, err = said(capsys, "add-scene", "A", tmp_path / "missing.glb", *up, *given, *how)
        assert code == 2
        assert re.fullmatch(rf"error: {word} [^\n]*\n", err)
        assert "missing.glb" not in err


def test_a_list_says_what_a_file_holds_and_writes_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    field = hills(2, cells=40)
    scene = trimesh.Scene()
    scene.add_geometry(field.mesh(), node_name="Terrain")
    for k, box in enumerate(standing(field, 5, 2)):
        scene.add_geometry(box, node_name=f"Hut.{k:03d}")
    dome = trimesh.creation.icosphere(3, 500.0)
    dome.invert()
    scene.add_geometry(dome, node_name="SkyDome")
    scene.export("place.glb")
    before = sorted(p.name for p in tmp_path.rglob("*"))
    code, out, err = said(capsys, "add-scene", "Place", "place.glb", "--list")
    assert code == 0, err
    assert "7 nodes" in out
    assert "x is 0 to 80, y 0 to 80 m" in out
    assert re.search(r"up: z .*--up z is the guess", out)
    assert re.search(
        r"scale: 1 if its unit is metres: 80 by 80 by .*\n +or: 0\.3048 if its unit is feet: 24.4 by", out
    )
    assert "dome: SkyDome, 1,280 triangles" in out
    assert re.search(r"^Terrain +terrain +3,200 +1 +0% +0\.0 to 80\.0 +0\.0 to 80\.0", out, re.MULTILINE)
    assert max(map(len, out.splitlines())) <= 120
    assert sorted(p.name for p in tmp_path.rglob("*")) == before
    code, _, err = said(capsys, "add-scene", "Place", "place.glb")
    assert code == 2
    assert re.search(r"--up is missing: z or y; .*add-scene Place place.glb --list guesses it", err)
    assert sorted(p.name for p in tmp_path.rglob("*")) == before


def test_a_part_of_a_place_far_from_its_origin_is_one_recipe_like_others(tmp_path):
    # Metres of a map: millions.
    (node,) = city(streets=4)
    mesh = trimesh.Trimesh(node.vertices + np.array([4.1e5, 6.6e6, 12.0]), node.faces, process=False)
    mesh.export(tmp_path / "city.glb")
    place = SourceMesh.of([node.with_vertices(np.asarray(mesh.vertices))], MeshOptions())
    assert place.bounds[0] == pytest.approx([4.1e5 - 5, 6.6e6 - 5, 11.0])
    options = MeshOptions(crop_m=(410060.0, 6600060.0, 40.0))
    added = add_scene("Far", tmp_path / "city.glb", tmp_path / "mine", options)
    recipe = load_imported(tmp_path / "mine/scenes/Far.toml")
    assert recipe.origin_m == added.repairs.origin_m
    assert recipe.origin_m[1] == pytest.approx(6600060.0, abs=1.0)
    assert np.abs(added.scene.bounds[:, :2]).max() <= 41
    assert recipe.crop_m == options.crop_m
