"""Façades: layouts of the shipped catalogue, the choice among them, and errors in them."""

from itertools import combinations

import numpy as np
import pytest
from support.layout_checks import ASSETS, blank_site

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.rendering.lighting import is_fine, texel_m
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.buildings import Roof, put_up_building
from aerialdojo_gen.scenes.kit.flats import flats
from aerialdojo_gen.scenes.materials import load_materials

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
def test_layouts_tile_without_a_seam_and_differ(name):
    images = [LIBRARY[f"{name}:#b0a090:{layout}"].texture.astype(float) for layout in LAYOUTS[name]]
    for image in images:
        grey = image.mean(axis=2)
        for axis in (0, 1):
            steps = np.abs(np.roll(grey, -1, axis=axis) - grey).mean(axis=1 - axis)
            assert steps[-1] <= steps[:-1].max() * 1.05 + 1.0
    assert min(np.abs(a - b).mean() for a, b in combinations(images, 2)) > 8.0


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_repeated_openings_are_not_alike(name):
    # Curtains, lights and reflections differ from storey to storey though the openings are the same.
    for layout in LAYOUTS[name]:
        image = LIBRARY[f"{name}::{layout}"].texture.astype(float)
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
