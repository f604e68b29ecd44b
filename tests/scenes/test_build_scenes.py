"""From recipe to scene file: ground, footprints, errors, and the same bytes in every process."""

import hashlib
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point
from support.layout_checks import ASSETS, catalogue

from aerialdojo_gen.base.config.sections import BuildScenesConfig
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.pipeline.stage import Job, ProjectPaths
from aerialdojo_gen.pipeline.stages.work import build_scenes
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.grammar import poisson_disc, smooth_path
from aerialdojo_gen.scenes.ground import Surface, disc, ground_meshes, rectangle
from aerialdojo_gen.scenes.kit.landforms import hill
from aerialdojo_gen.scenes.kit.streets import crossings, streets
from aerialdojo_gen.scenes.placement import DRAWN, Placement
from aerialdojo_gen.scenes.recipe import SceneHead
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import flat_terrain, rolling_terrain

POST = """
[post]
name = "post"
params = { h = [1.0, 2.0] }
[[post.parts]]
shape = "cylinder"
radius = 0.1
height = "h"
role = "#884422"
[[post.parts]]
shape = "crown"
radius = 0.3
at = [0, 0, "h"]
role = "foliage"
"""
PLAN = """
plan = 1
seed = 3
size_m = [40, 30]
ceiling_m = 12
sky = "#a9c6e8"
sun = [3, 0, 4]
palette = { wall = "brick:#804020" }
[inventory]
post = 4
[ground]
steps = [{ make = "rolling_ground", cell_m = 1, height_m = 2, wavelength_m = 20 }]
[[site]]
make = "streets"
paths = [[[-20, 0], [20, 0]]]
[[site]]
category = "hall"
footprint = [5, 5, 12, 10]
parts = [{ shape = "block", role = "wall", corners = [5, 5, 12, 10], z = [-3, 6] }]
[[site]]
pattern = { of = ["post"], scatter = { disc = [-8, 8, 6] }, spacing_m = 1.5, limit = 4 }
"""


@pytest.fixture
def assets(tmp_path):
    folder = tmp_path / "assets"
    (folder / "props").mkdir(parents=True)
    (folder / "scenes").mkdir()
    (folder / "materials.toml").write_bytes((ASSETS / "materials.toml").read_bytes())
    (folder / "props" / "post.toml").write_text(POST)
    (folder / "scenes" / "U_Test_0.toml").write_text(PLAN)
    return folder


def build(assets: Path):
    return build_scene(assets / "scenes" / "U_Test_0.toml", load_catalogue(assets))


def test_the_stage_writes_the_built_scene_exactly_and_its_row(assets, tmp_path):
    roots = ProjectPaths(tmp_path / "data", assets, assets / "scenes", tmp_path)
    job = Job("build-scenes", "U_Test_0", 0, 1, 0, Embodiment(), roots)
    output = build_scenes.run(job, BuildScenesConfig())
    row = output.tables["scenes"].to_pylist()[0]
    path = tmp_path / "data" / row["mesh_path"]
    scene = read_glb(path)
    assert row["mesh_path"] == "meshes/U_Test_0.glb"
    assert row["mesh_sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (row["family"], row["scene_type"], row["partition"]) == ("Urban", "Test", "ID")
    assert row["n_triangles"] == scene.n_triangles
    assert row["n_instances"] == len(scene.instances) == 6
    assert row["n_categories"] == 3
    assert (row["min_x_m"], row["max_y_m"], row["max_z_m"], row["ceiling_m"]) == (-20, 15, 12, 12)
    assert row["min_z_m"] == scene["ground"].bounds[0, 2]
    assert scene.sun == pytest.approx((0.6, 0, 0.8))
    assert scene.sky == (0xA9, 0xC6, 0xE8)
    assert {i.node for i in scene.instances} == {"ground", "hall_000", *(f"post_{k:03d}" for k in range(4))}
    assert "brick:#804020" in scene.materials
    for stored, built in zip(scene.instances, build(assets).instances, strict=True):
        assert np.array_equal(stored.vertices, built.vertices)
        assert np.array_equal(stored.faces, built.faces)


def test_another_seed_makes_another_scene(assets):
    first = build(assets)
    path = assets / "scenes" / "U_Test_0.toml"
    path.write_text(PLAN.replace("seed = 3", "seed = 4"))
    assert not np.array_equal(build(assets)["ground"].vertices[:, 2], first["ground"].vertices[:, 2])


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("plan = 1", 'layout = "mall"', "scenes are plans since version 0.2.0, without 'layout': docs/plans.md has"),
        ("plan = 1", 'layout = "town"', "scenes are plans since version 0.2.0, without 'layout': run add-map again"),
        ("plan = 1\n", "", "key 'plan' is missing"),
        ("seed = 3", "seed = ", "Invalid value"),
    ],
)
def test_what_is_no_plan_is_said_with_the_file(assets, old, new, says):
    path = assets / "scenes" / "U_Test_0.toml"
    path.write_text(PLAN.replace(old, new, 1))
    with pytest.raises(AssetError, match=rf"^{path}: [^\n]*{says}[^\n]*$"):
        build(assets)


def test_scene_names_have_family_type_and_partition():
    parsed = {
        "U_Mall_0": ("Urban", "Mall", "ID"), "D_Flood_1": ("Disaster", "Flood", "OOD"),
        "Campus": ("Custom", "Campus", "ID"), "Campus_1": ("Custom", "Campus", "OOD"),
        "X_Mall_0": ("Custom", "X_Mall", "ID"),
    }  # fmt: skip
    assert {name: build_scenes.parse_name(name) for name in parsed} == parsed


def site() -> Site:
    return Site("U_Test_0", SceneHead(size_m=(60.0, 40.0), ceiling_m=20), catalogue())


def test_ground_covers_the_site_once_and_ground_z_is_its_height():
    place = site()
    rolling = rolling_terrain((60, 40), 2.0, 5, 3.0, 25.0)
    place.set_ground(hill(place, rolling, at=(10, 5), radius_m=8, height_m=4), "meadow")
    streets(place, paths=[[(-30, -5), (0, 3), (30, -5)], [(0, -20), (4, 20)]])
    place.paint(disc(-15, 10, 4), "paving", 0.3)
    crossings(place, at=[(10, 0, 80, 6)])
    scene = place.scene()
    ground = scene["ground"]
    corners = ground.vertices[ground.faces]
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    assert up.min() > -1e-6
    assert up.sum() == pytest.approx(60 * 40, rel=1e-5)
    xy = np.random.default_rng(1).uniform((-29.9, -19.9), (29.9, 19.9), size=(4000, 2))
    origins = np.column_stack([xy, np.full(len(xy), 50.0)])
    distance, index = RayCaster(scene).first_hit(origins, np.tile([0.0, 0.0, -1.0], (len(xy), 1)))
    assert np.all(index == 0), "the ground has a hole"
    z = np.array([place.ground_z(x, y) for x, y in xy])
    # A point on a kerb's very edge may fall to either side.
    assert np.mean(np.abs(50.0 - distance - z) < 1e-4) > 0.999


def test_later_paint_covers_earlier_and_kerbs_face_outwards():
    terrain = flat_terrain((20, 20))
    square = rectangle(-5, -5, 5, 5)
    surfaces = [
        Surface(square, "paving", 0.2),
        Surface(rectangle(-1, -9, 1, 9), "asphalt"),
        Surface(disc(3, 3, 1), "grass"),
    ]
    meshes = ground_meshes(terrain, rectangle(-10, -10, 10, 10), "grass", surfaces)
    area = {}
    for material, m in meshes:
        c = m.vertices[m.faces]
        normal = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
        area[material] = area.get(material, 0.0) + normal[:, 2].sum() / 2
        if material == "concrete":
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            outside = c.mean(axis=1) + 0.01 * normal
            inside = c.mean(axis=1) - 0.01 * normal
            paved = square.difference(surfaces[1].area).difference(surfaces[2].area)
            assert not shapely.contains_xy(paved, outside[:, 0], outside[:, 1]).any()
            assert shapely.contains_xy(paved, inside[:, 0], inside[:, 1]).all()
    round_ = surfaces[2].area.area
    assert area["asphalt"] == pytest.approx(36)
    assert area["paving"] == pytest.approx(100 - 20 - round_, abs=1e-2)
    assert area["grass"] == pytest.approx(400 - 36 - 80 + round_, abs=1e-2)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 50), st.floats(-12, 12), st.floats(-8, 8))
def test_terrain_height_is_that_of_its_triangles(seed, x, y):
    terrain = rolling_terrain((25, 17), 1.3, seed, 4.0, 15.0)
    corners, faces = terrain.corners(), terrain.triangles()
    for a, b, c in corners[faces]:
        m = np.column_stack([b[:2] - a[:2], c[:2] - a[:2]])
        u, v = np.linalg.solve(m, np.array([x, y]) - a[:2])
        if u >= 0 and v >= 0 and u + v <= 1:
            assert float(terrain.z(x, y)) == pytest.approx(a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]))
            return
    pytest.fail("no triangle holds the point")


def test_terrain_is_level_where_flattened_and_gentle_along_a_path():
    rough = rolling_terrain((80, 60), 1.0, 2, 6.0, 18.0)
    area = Point(10, 5).buffer(6)
    level = rough.flattened(area, blend_m=4)
    xy = np.random.default_rng(0).uniform(-60, 60, size=(3000, 2))
    near = shapely.contains_xy(area, xy[:, 0], xy[:, 1])
    assert np.ptp(level.z(*xy[near].T)) < 1e-9
    far = ~shapely.contains_xy(area.buffer(8), xy[:, 0], xy[:, 1])
    np.testing.assert_array_equal(level.z(*xy[far].T), rough.z(*xy[far].T))
    path = smooth_path([(-35, -10), (-10, 15), (20, -15), (38, 20)])
    graded = rough.graded(path, 2.0)
    line = shapely.LineString(path)
    points = shapely.get_coordinates(line.interpolate(np.arange(1.0, line.length - 1, 0.5)))
    climb = np.abs(np.diff(graded.z(*points.T)))
    assert climb.max() < 0.7 * np.abs(np.diff(rough.z(*points.T))).max()


def test_footprints_know_height_and_ground():
    place = site()
    category = next(iter(place.catalogue))
    post = place.place(Placement(category, 0, 0))
    assert post.node == f"{category}_000"
    assert not place.is_free(0, 0, 0.3)
    assert place.is_free(0, 0, 0.3, z=float(post.bounds[1, 2]) + 0.1)
    assert place.place(Placement(category, 0, 0), "skip") is None
    assert place.is_free(20, 10, 1.0)
    assert not place.is_free(29.5, 0, 1.0), "partly outside the site"
    place.occupy(rectangle(15, 5, 25, 15))
    assert not place.is_free(20, 10, 1.0)
    assert place.place(Placement(category, -20, 0)).node == f"{category}_001"
    with pytest.raises(AssetError, match="exists already"):
        place.place(Placement(category, 5, 5, node=f"{category}_000"))


def test_adding_one_thing_does_not_change_another():
    """A prop draws from its own name: what stands before it in the plan leaves it as it is."""
    one, two = site(), site()
    categories = sorted(one.catalogue)[:2]
    two.place(Placement(categories[1], 10, 10, variant=DRAWN))
    a, b = (some.place(Placement(categories[0], 0, 0, variant=DRAWN)) for some in (one, two))
    assert a.variant == b.variant
    assert np.array_equal(a.vertices, b.vertices)


@given(st.integers(0, 2**32 - 1), st.floats(0.3, 2.0), st.integers(1, 200), st.booleans())
@settings(max_examples=12, deadline=None)
def test_poisson_discs_are_those_of_the_rule_taken_dart_by_dart(seed, radius, limit, even):
    area, density = disc(3.0, -40.0, 6.0), None if even else lambda x, y: abs(math.sin(x)) * abs(math.cos(y))
    rng, taken, wanted = np.random.default_rng(seed), [], []
    x0, y0, x1, y1 = area.bounds
    for x, y, yaw in rng.uniform((x0, y0, 0.0), (x1, y1, 360.0), size=(int(30 * area.area / radius**2), 3)).tolist():
        share = density(x, y) if density else 1.0
        if shapely.contains_xy(area, x, y) and share > 0.01 and len(wanted) < limit:
            own = radius / math.sqrt(share)
            if all((x - u) ** 2 + (y - v) ** 2 >= max(own, other) ** 2 for u, v, other in taken):
                taken.append((x, y, own))
                wanted.append((x, y, yaw))
    assert [tuple(pose) for pose in poisson_disc(area, radius, np.random.default_rng(seed), density, limit)] == wanted
