"""add-terrain: heights as the model has them, by another interpolation, and one line for each fault of a file."""

import re
import shutil
import zipfile

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from support import maps
from support.layout_checks import ASSETS, catalogue

from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.imports.dem import read_dem
from aerialdojo_gen.imports.places import add_terrain
from aerialdojo_gen.imports.relief import ReliefOptions
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.scenes.build import build_scene


@pytest.fixture(scope="module")
def hill(tmp_path_factory):
    """The hill as a grid in metres, 2 m apart, 80 m wide."""
    path = tmp_path_factory.mktemp("dem") / "hill.npz"
    np.savez(path, heights_m=maps.heights(2.0, 40.0), cell_m=2.0)
    return path


@pytest.fixture(scope="module")
def added(hill, tmp_path_factory):
    return add_terrain("Hill", hill, tmp_path_factory.mktemp("mine"), ReliefOptions(water_m=98.5, snow_m=113.0))


def test_the_ground_is_the_models_by_interpolation(added):
    at = np.arange(-40.0, 40.1, 2.0)
    reference = RegularGridInterpolator((at, at), maps.heights(2.0, 40.0)[::-1])
    rng = np.random.default_rng(3)
    places = rng.uniform(-39.5, 39.5, size=(600, 2))
    z = maps.ground_z(added.scene, places)
    origin = maps.origin_z(added)
    # A cell is two flat triangles here and a bent sheet there: they part by a quarter of its bend at the most.
    assert np.abs(z + origin - reference(places[:, ::-1])).max() < 0.06
    # On the model's own points there is nothing between them but the rounding to a centimetre.
    corners = np.array([(x, y) for x in at[5:-5:7] for y in at[5:-5:7]])
    assert np.abs(maps.ground_z(added.scene, corners) + origin - reference(corners[:, ::-1])).max() < 0.006


def test_nobody_flies_below_the_relief(added):
    grid = ClearanceGrid.build(added.scene)
    rng = np.random.default_rng(8)
    low, high = added.scene.bounds
    p = rng.uniform([*low[:2] + 1, low[2]], [*high[:2] - 1, high[2]], size=(4000, 3))
    over = p[:, 2] + maps.origin_z(added) - maps.hill(p[:, 0], p[:, 1])
    reached = np.array([grid.reachable(x) for x in p])
    assert (over < -0.3).sum() > 300
    assert not reached[over < -0.1].any()
    # Over it there is little but trees and stones.
    assert reached[over > 1.0].mean() > 0.8


def test_it_is_painted_by_slope_and_height_and_grows_what_such_ground_has(added):
    scene = added.scene
    materials = {part.material.split(":")[0] for part in scene["ground"].parts}
    assert {"meadow", "rock", "snow"} & materials >= {"meadow", "snow"}
    snow = [part for part in scene["ground"].parts if part.material == "snow"]
    lowest = min(float(part.vertices[:, 2].min()) for part in snow) + maps.origin_z(added)
    assert lowest > 113.0 - 3.0
    water = [i for i in scene.instances if i.category == "water_surface"]
    assert len(water) == 1
    assert water[0].bounds[1, 2] + maps.origin_z(added) == pytest.approx(98.5, abs=0.011)
    # Trees and stones stand on the ground, none in the water.
    things = [i for i in scene.instances if i.category not in ("ground", "water_surface")]
    assert len(things) > 15
    feet = np.array([i.centroid[:2] for i in things])
    z = maps.ground_z(scene, feet)
    assert all(i.bounds[0, 2] <= h + 1.0 and i.bounds[1, 2] > h for i, h in zip(things, z, strict=True))
    assert (z + maps.origin_z(added) > 98.0).all()


def test_the_same_file_makes_the_same_bytes(hill, added, tmp_path):
    again = add_terrain("Hill", hill, tmp_path / "other", ReliefOptions(water_m=98.5, snow_m=113.0))
    assert again.recipe.read_bytes() == added.recipe.read_bytes()
    assert maps.same_scene(again.scene, added.scene)


def test_the_heights_lie_beside_the_plan_and_count_as_its_source(hill, tmp_path):
    from aerialdojo_gen.pipeline.registry import scene_sources
    from aerialdojo_gen.pipeline.stage import ProjectPaths

    place = add_terrain("Hill", hill, tmp_path / "mine", ReliefOptions(bare=True))
    assert maps.same_scene(build_scene(place.recipe, catalogue()), place.scene)
    table = place.recipe.with_name("Hill.heights.asc")
    assert table in scene_sources(ProjectPaths(tmp_path, ASSETS, table.parent, tmp_path), "Hill")
    # An ESRI ASCII grid, that this program reads as any other one.
    assert np.abs(read_dem(table).heights_m + maps.origin_z(place) - maps.heights(2.0, 40.0)).max() < 0.0051
    text = table.read_text()
    *head, first, rest = text.split("\n", 6)
    faults = {
        "is it truncated": text[: len(text) // 2],
        "ncols": text.replace("ncols", "columns"),
        "each within 2,000 m": "\n".join([*head, first.replace("0.00", "-9999", 1), rest]),
        "the site has 80 by 80 m": text.replace("cellsize 2.0", "cellsize 1.0"),
    }
    for said, wrong in faults.items():
        table.write_text(wrong)
        place_of = re.escape(f"{place.recipe}: [ground] steps[0] 'surveyed_heights': ")
        with pytest.raises(AssetError, match=rf"^{place_of}[^\n]*{said}[^\n]*\Z"):
            build_scene(place.recipe, catalogue())
    table.unlink()
    with pytest.raises(AssetError, match=r"Hill\.heights\.asc cannot be read .*: it belongs beside the plan"):
        build_scene(place.recipe, catalogue())
    (tmp_path / "elsewhere.asc").write_text(text)
    table.symlink_to(tmp_path / "elsewhere.asc")
    with pytest.raises(AssetError, match="points outside its folder"):
        build_scene(place.recipe, catalogue())


def test_a_geotiff_in_degrees_is_the_same_relief_in_metres(tmp_path):
    options = ReliefOptions(size_m=(80.0, 80.0), cell_m=4.0, bare=True, attribution="A survey")
    place = add_terrain("Degrees", maps.hill_tif(tmp_path / "x.tif"), tmp_path / "mine", options)
    x, y = np.meshgrid(np.arange(-36.0, 37.0, 8.0), np.arange(-36.0, 37.0, 8.0))
    z = maps.ground_z(place.scene, np.column_stack([x.ravel(), y.ravel()])) + maps.origin_z(place)
    np.testing.assert_allclose(z, maps.hill(x, y).ravel(), atol=0.05)
    assert place.scene.attribution == "A survey"


def test_missing_heights_are_the_nearest_ones(tmp_path):
    z = maps.heights(2.0, 60.0)
    z[10:14, 20:24] = -9999.0
    rows = "\n".join(" ".join(f"{v:.3f}" for v in row) for row in z)
    path = tmp_path / "hole.asc"
    path.write_text(f"ncols 61\nnrows 61\nxllcenter -60\nyllcenter -60\ncellsize 2\nNODATA_value -9999\n{rows}\n")
    place = add_terrain("Hole", path, tmp_path / "mine", ReliefOptions(bare=True))
    assert any("16 of 3,721 heights" in line for line in place.notes)
    model = maps.heights(2.0, 60.0)
    filled = maps.ground_z(place.scene, np.array([[2 * 21 - 60.0, 60.0 - 2 * 11]]))[0] + maps.origin_z(place)
    assert model[9:15, 19:25].min() - 0.02 <= filled <= model[9:15, 19:25].max() + 0.02


def tif(folder, z=None, crs="EPSG:4326", dx=1e-5, nodata=None):
    z = maps.heights(2.0, 60.0) if z is None else z
    return maps.write_geotiff(folder / "x.tif", z, crs, 24.9, 60.2, dx, dx, nodata)


def cut(path, end):
    """A file of the same name without its end."""
    path.write_bytes(path.read_bytes()[:end])
    return path


def asc(folder, head, numbers):
    (folder / "x.asc").write_text(f"{head}xllcorner 0\nyllcorner 0\ncellsize 1\n{numbers}\n")
    return folder / "x.asc"


def npz(folder):
    np.savez(folder / "x.npz", heights_m=np.zeros((4, 4)), cell_m=1.0)
    return folder / "x.npz"


@pytest.mark.parametrize(
    ("make", "options", "said"),
    [
        (lambda d: tif(d, np.full((9, 9), -5.0), nodata=-5.0), {}, "contains no heights: every cell is nodata"),
        (lambda d: tif(d, crs=""), {}, "has no coordinate system"),
        (lambda d: tif(d, crs="EPSG:2263", dx=2.0), {}, "not in metres or degrees"),  # feet
        (lambda d: tif(d, dx=1e-3), {}, "--size 400 400 crops to its centre"),
        (tif, {"bbox": (10.0, 50.0, 10.001, 50.001)}, "has no height: x.tif covers 24.9000"),
        (lambda d: tif(d, dx=5e-5), {"cell_m": 0.3}, "take cells of"),
        (lambda d: d / "none.tif", {}, "No such file"),
        (lambda d: d / "x.png", {}, "a height model is a file .tif"),
        # Cut short, or with sizes that are none.
        *((lambda d, end=end: cut(tif(d), end), {}, "as a GeoTIFF, or is cut short") for end in (0, 60, 7000)),
        (lambda d: cut(npz(d), 80), {}, "x.npz cannot be read"),
        (lambda d: asc(d, "ncols 4\nnrows 4\n", "1 2 3"), {}, "says 4 by 4 heights and has 3: is it truncated"),
        (lambda d: asc(d, "ncols inf\nnrows 4\n", "1 2 3 4"), {}, "is not an ESRI ASCII grid"),
        (lambda d: asc(d, "ncols -2\nnrows -2\n", "1 2 3 4"), {}, "is not an ESRI ASCII grid"),
    ],
)
def test_a_fault_is_one_line(make, options, said, tmp_path):
    with pytest.raises((AssetError, UsageError), match=rf"^[^\n]*{said}[^\n]*\Z"):
        add_terrain("X", make(tmp_path), tmp_path / "mine", ReliefOptions(**options))
    assert not (tmp_path / "mine" / "scenes").exists()


def test_heights_that_are_no_numbers_are_none(tmp_path):
    assert np.nanmax(read_dem(asc(tmp_path, "ncols 2\nnrows 2\n", "1 inf 1e300 nan")).heights_m) == 1.0


def test_a_geotiff_is_no_way_to_other_files(tmp_path):
    """GDAL reads by content: a text of the name of a GeoTIFF may name any file of the machine, or an address."""
    whole = tif(tmp_path)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "vrt.tif").write_text(
        '<VRTDataset rasterXSize="61" rasterYSize="61"><SRS>EPSG:4326</SRS>'
        "<GeoTransform>24.9, 1e-5, 0, 60.2, 0, -1e-5</GeoTransform>"
        '<VRTRasterBand dataType="Float64" band="1"><SimpleSource>'
        f"<SourceFilename>{whole}</SourceFilename><SourceBand>1</SourceBand>"
        "</SimpleSource></VRTRasterBand></VRTDataset>"
    )
    with pytest.raises(AssetError, match="cannot be read as a GeoTIFF"):
        read_dem(tmp_path / "in" / "vrt.tif")


def test_arrays_far_larger_than_their_file_are_refused_before_they_are_made(tmp_path):
    path = tmp_path / "bomb.npz"
    for name in ("heights_m.npy", "bbox_deg.npy"):
        with zipfile.ZipFile(path, "w") as archive:
            for key, shape in (("heights_m.npy", (4, 4)), ("cell_m.npy", ()), ("bbox_deg.npy", (4,))):
                with archive.open(key, "w") as file:
                    head = {"descr": "<f8", "fortran_order": False, "shape": (1 << 22,) * 2 if key == name else shape}
                    np.lib.format.write_array_header_1_0(file, head)
                    file.write(bytes(8 * max(1, int(np.prod(shape)))))
        with pytest.raises(AssetError, match=rf"{name} has 17,592,186,044,416 numbers"):
            read_dem(path)


def test_a_files_name_cannot_write_into_the_recipe(hill, tmp_path):
    odd = tmp_path / "hill\nlayout = 'yard'\n.npz"
    shutil.copy(hill, odd)
    place = add_terrain("Odd", odd, tmp_path / "mine", ReliefOptions(bare=True))
    assert place.recipe.read_text().startswith("# Made by add-terrain of hill?layout = 'yard'?.npz: ")
