"""Buildings from a plan: whole windows, closed roofs, openings to fly through; layouts of façades."""

from itertools import combinations

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate, translate
from shapely.geometry import Point, Polygon
from support.layout_checks import ASSETS, blank_site, distances, is_seamless

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.rendering.lighting import is_fine, texel_m
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.buildings import (
    Roof,
    before_walls,
    facade,
    pitched_roof,
    put_up_building,
    wall_with_openings,
)
from aerialdojo_gen.scenes.kit.flats import flats
from aerialdojo_gen.scenes.materials import load_materials
from aerialdojo_gen.scenes.mesh import to_part


@given(st.floats(5, 40), st.floats(5, 40), st.integers(1, 6), st.floats(0, 360))
def test_facades_show_whole_windows_on_every_wall(x, y, storeys, turn):
    plan = rotate(rectangle(0, 0, x, y), turn)
    walls = facade(plan, 1.0, 1.0 + 3.1 * storeys, 12.8)
    part = to_part(walls, "facade", 12.8)
    corners = part.uv[part.faces].reshape(-1, 2)
    # Tiles are an even number of bays wide and four storeys high: corners lie on half tiles across, on quarters up.
    np.testing.assert_allclose(corners[:, 0] * 2, np.rint(corners[:, 0] * 2), atol=1e-5)
    np.testing.assert_allclose(corners[:, 1] * 4, np.rint(corners[:, 1] * 4), atol=1e-5)
    assert corners[:, 1].max() * 4 == pytest.approx(storeys, abs=1)
    assert set(corners[:, 0] % 1.0) == {0.0, 0.5}
    c = walls.vertices[walls.faces]
    normals = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(2 * (x + y) * 3.1 * storeys)
    outside = c.mean(axis=1) + 0.01 * normals / np.linalg.norm(normals, axis=1, keepdims=True)
    assert not shapely.contains_xy(plan, outside[:, 0], outside[:, 1]).any()


@settings(deadline=None)
@given(st.floats(6, 30), st.floats(4, 6), st.floats(0, 180), st.booleans())
def test_pitched_roofs_are_closed_and_as_high_as_asked(length, width, turn, hip):
    plan = translate(rotate(rectangle(0, 0, length, width), turn), 30, -20)
    parts = pitched_roof(plan, 6.0, 2.0, "wall", "roof", hip=hip)
    for _, m in parts:
        body = trimesh.Trimesh(m.vertices, m.faces, process=False)
        assert body.is_watertight
        assert body.is_winding_consistent
        assert m.volume_m3 > 0
    top = max(float(m.vertices[:, 2].max()) for _, m in parts)
    assert top == pytest.approx(8.0 + (0.0 if hip else 0.18))
    # The eaves reach beyond every wall.
    roof = shapely.MultiPoint(parts[0][1].vertices[:, :2]).convex_hull
    assert roof.buffer(1e-6).contains(plan)


@pytest.mark.parametrize("roof_kind", ["flat", "gable", "hip"])
@pytest.mark.parametrize("parapet", [0.0, 0.6])
def test_buildings_leave_no_gap_to_the_sky(roof_kind, parapet):
    site = blank_site("U_T_0", ceiling_m=30)
    plan = rotate(rectangle(-8, -5, 8, 5), 20)
    house = put_up_building(site, plan, "facade_brick", Roof("roof_tiles", roof_kind, parapet_m=parapet))
    assert not site.is_free(0, 0, 0.5)
    inside = np.array([(x, y) for x in np.arange(-9, 9, 0.37) for y in np.arange(-9, 9, 0.37)])
    inside = inside[shapely.contains_xy(plan.buffer(-0.03), inside[:, 0], inside[:, 1])]
    origins = np.column_stack([inside, np.full(len(inside), 1.0)])
    assert np.isfinite(distances(site.scene(), origins, (0.0, 0.0, 1.0))).all()
    assert house.bounds[0, 2] == 0.0


def test_openings_let_rays_through_and_walls_do_not():
    site = blank_site("U_T_0", ceiling_m=30)
    openings = [(2.0, 4.0, 0.0, 2.5), (6.0, 7.0, 1.0, 2.0)]
    wall = wall_with_openings((0, 0), (6, 8), 0.0, 4.0, openings, 0.4)
    site.add(None, "wall", [("brick", wall)])
    assert wall.volume_m3 == pytest.approx((10 * 4 - 5 - 1) * 0.4)
    along, across = np.array([0.6, 0.8, 0.0]), np.array([0.8, -0.6, 0.0])
    rng = np.random.default_rng(0)
    u, v = rng.uniform(0.01, 9.99, 500), rng.uniform(0.01, 3.99, 500)
    origins = u[:, None] * along + v[:, None] * np.array([0, 0, 1.0]) + 3 * across
    distance = distances(site.scene(), origins, -across)
    hit = distance < 4.0
    free = np.zeros(500, dtype=bool)
    for u0, u1, sill, head in openings:
        free |= (u > u0) & (u < u1) & (v > sill) & (v < head)
    assert np.array_equal(hit, ~free)
    np.testing.assert_allclose(distance[hit], 2.8, atol=1e-4)


def test_poses_before_walls_stand_outside_and_face_away():
    plan = Polygon([(0, 0), (20, 0), (20, 10), (8, 10), (8, 20), (0, 20)])
    poses = before_walls(plan, 3.0, 1.5)
    assert len(poses) >= 15
    for p in poses:
        assert plan.distance(Point(p.x, p.y)) == pytest.approx(1.5)
        back = Point(p.x - 1.6 * np.cos(np.radians(p.yaw_deg)), p.y - 1.6 * np.sin(np.radians(p.yaw_deg)))
        assert plan.contains(back)


LIBRARY = load_materials(ASSETS / "materials.toml")
LAYOUTS = {name: found for name in LIBRARY.names if (found := LIBRARY.layouts(name))}
FACADE = """
[front]
colour = "#c0b0a0"
tile_m = 12.0
[front.layouts.plain]
rows = ["a b"]
openings.a = { size = [1.0, 1.5] }
openings.b = { size = [2.0, 1.5], frame = "#303030" }
"""


def walls(site, node, wall):
    house = put_up_building(site, rectangle(-8, -5, 8, 5), wall, Roof("gravel"), node=node)
    (found,) = (part.material for part in house.parts if part.material.partition(":")[0] in LAYOUTS)
    return found


def test_there_are_many_layouts_in_every_family():
    assert sum(map(len, LAYOUTS.values())) >= 20
    assert {name: len(found) >= 3 for name, found in LAYOUTS.items()} == dict.fromkeys(LAYOUTS, True)


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_layouts_tile_without_a_seam_and_differ_as_their_storeys_do(name):
    images = [LIBRARY[f"{name}:#b0a090:{layout}"].texture.astype(float) for layout in LAYOUTS[name]]
    assert all(map(is_seamless, images))
    assert min(np.abs(a - b).mean() for a, b in combinations(images, 2)) > 8.0
    # Curtains, lights and reflections differ from storey to storey though the openings are the same.
    for image in images:
        assert np.abs(image - np.roll(image, len(image) // 2, axis=0)).mean() > 0.8


def test_buildings_of_one_row_differ_and_depend_on_their_own_names():
    site, again = blank_site("U_T_0"), blank_site("U_T_0")
    row = [walls(site, f"house_{k:03d}", "facade_flats:#c9b295") for k in range(4)]
    assert len(set(row)) == 4
    assert all(one.startswith("facade_flats:#c9b295:") for one in row)
    assert walls(again, "house_002", "facade_flats:#c9b295") == row[2]
    others = {walls(again, f"{word}_000", "facade_flats") for word in ("inn", "school", "station", "office", "shop")}
    assert len(others) > 1


def test_a_plan_can_name_a_layout():
    site = blank_site("U_T_0")
    assert walls(site, "a", "facade_brick:#8f4a3c:arches") == "facade_brick:#8f4a3c:arches"
    assert walls(site, "b", "facade_brick::lofts") == "facade_brick::lofts"
    with pytest.raises(AssetError, match="facade_brick has no layout 'archs': did you mean 'arches'"):
        walls(site, "c", "facade_brick::archs")
    with pytest.raises(AssetError, match="brick has no layout 'arches'"):
        LIBRARY.check("brick:#8f4a3c:arches", "x")


def test_built_balconies_stand_before_flush_walls():
    site = blank_site("U_T_0", size_m=400)
    for k in range(8):
        flats(site, at=(-150.0 + 40 * k, 0.0), yaw_deg=0.0, size_m=(30.0, 12.0), storeys=4, wall="facade_flats",
              band="steel", name=f"house {k}")  # fmt: skip
    found = {p.material for i in site.instances for p in i.parts if p.material.startswith("facade_flats")}
    assert len(found) >= 5
    assert not {layout.rpartition(":")[2] for layout in found} & {"balconies", "loggias", "french"}


def test_rows_of_windows_are_seen_further_than_joints():
    front, wall = LIBRARY["facade_flats"], LIBRARY["concrete"]
    assert is_fine(front)
    assert not is_fine(wall)
    assert texel_m(front) > 2 * front.tile_m / front.texture.shape[1]
    assert texel_m(wall) == wall.tile_m / wall.texture.shape[1]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"a b"', '"a b a"', "even number of bays"),
        ('"a b"', '"a c"', "no opening 'c'"),
        ("size = [2.0, 1.5]", "size = [2.0, -1.5]", "size"),
        ('frame = "#303030"', 'frame = "black"', "frame"),
        ('frame = "#303030"', "fram = 1", "fram"),
        ('colour = "#c0b0a0"', 'colour = "#c0b0a0"\ntexture = "brick"', "a texture or layouts, not both"),
    ],
)
def test_errors_in_layouts_say_where(tmp_path, old, new, says):
    path = tmp_path / "materials.toml"
    path.write_text(FACADE)
    assert load_materials(path).layouts("front") == ("plain",)
    path.write_text(FACADE.replace(old, new))
    with pytest.raises(AssetError) as caught:
        load_materials(path)
    assert says in str(caught.value)
    assert "material 'front'" in str(caught.value)
