"""Ground that is an open sheet: nobody is put, sent or certified below it, and all else stays open to flight."""

import shutil

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flying import along, town
from support.foreign import raw
from support.handmade import box, instance
from support.hills import Hills, hills, standing, write_hills
from support.planting import Planted, check, poses

from aerialdojo_gen.annotations.draft import DraftOptions
from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.dataset.build import open_pipeline, run_pipeline
from aerialdojo_gen.dataset.validate.reachability import open_ground
from aerialdojo_gen.geometry.ground import Ground
from aerialdojo_gen.imports.command import add_scene
from aerialdojo_gen.imports.drafting import draft_scene
from aerialdojo_gen.imports.import_mesh import MeshOptions, import_mesh
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.planner import Planner
from aerialdojo_gen.scenes.model import Material, Scene
from aerialdojo_gen.store import shards as store

NAME = "Hills_0"


def adopted(field: Hills, *things: trimesh.Trimesh, turned: bool = False) -> tuple[Scene, np.ndarray]:
    """The field as add-scene takes it in, and what to add to its places to be in the field's own frame."""
    bodies = [("Terrain", field.mesh(turned)), *((f"Thing.{k}", thing) for k, thing in enumerate(things))]
    scene, _ = import_mesh(NAME, [raw(mesh, name) for name, mesh in bodies])
    return scene, shift_of(field, things)


def shift_of(field: Hills, things) -> np.ndarray:
    sheet = field.mesh()
    corners = np.concatenate([sheet.vertices[np.unique(sheet.faces)], *(t.vertices for t in things)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return np.array([*(low + high)[:2] / 2, low[2]])


def buried(field: Hills, places: np.ndarray, slack_m: float = 0.0) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return places[:, 2] < field.z(places[:, :2]) - slack_m


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 3), st.booleans(), st.booleans(), st.floats(0.5, 20.0))
def test_what_lies_below_is_what_numpy_says(seed, holes, ragged, turned, relief_m):
    field = hills(seed, cells=14, relief_m=relief_m, holes=holes, ragged=ragged)
    scene, shift = adopted(field, *standing(field, 2, seed), turned=turned)
    ground = Ground.of(scene)
    assert ground is not None
    rays = open_ground(scene)
    assert rays is not None
    low, high = scene.bounds
    p = np.random.default_rng(seed).uniform(low, [*high[:2], relief_m + 1.0], (600, 3))
    z = field.z((p + shift)[:, :2])
    clear = np.isnan(z) | (np.abs((p + shift)[:, 2] - z) > 1e-3)
    expected = buried(field, p + shift)
    assert (ground.below(p) == expected)[clear].all()
    # validate's own answer, by rays.
    up = np.isfinite(rays.first_hit(p, np.tile([0.0, 0.0, 1.0], (len(p), 1)))[0])
    down = np.isfinite(rays.first_hit(p, np.tile([0.0, 0.0, -1.0], (len(p), 1)))[0])
    assert ((up & ~down) == expected)[clear].all()


@pytest.mark.parametrize(("seed", "options"), [(1, {}), (2, {"holes": 2, "ragged": True})])
def test_no_cell_below_the_ground_leads_to_the_sky(seed, options):
    field = hills(seed, cells=16, **options)
    scene, shift = adopted(field, turned=bool(seed % 2))
    closed, open_ = (ClearanceGrid.build(scene, margin_m=0.05, closed_ground=closed) for closed in (True, False))
    places, open_places = (
        grid.arrays.origin + (np.argwhere(grid.sky) + 0.5) * 0.5 + shift for grid in (closed, open_)
    )
    assert len(places) > 5000
    assert not buried(field, places).any()
    # Surfaces alone let the body round the rim: what is tested here is there to be tested.
    assert buried(field, open_places).sum() > 1000


def test_no_plan_starts_ends_or_leads_below_the_ground():
    field = hills(4, cells=16, relief_m=14.0, holes=2)
    scene, shift = adopted(field)
    planner = Planner(scene, PlanConfig(), 0.25)
    rng = np.random.default_rng(4)
    p = rng.uniform(scene.bounds[0] + 0.3, scene.bounds[1] - 0.3, (400, 3))
    gap = (p + shift)[:, 2] - field.z((p + shift)[:, :2])
    under, over = p[gap < -0.8][:12], p[(gap > 0.8) & (gap < 6.0)][:12]
    assert len(under) == len(over) == 12
    starts = np.column_stack([np.concatenate([under, over]), np.zeros(24)])
    assert {r.outcome for r in planner.plan_target([*under[0], 0.0], starts)} == {
        "START_IN_COLLISION", "GOAL_IN_COLLISION",
    }  # fmt: skip
    routes = planner.plan_target([*over[0], 0.0], starts[:-1])
    assert {r.outcome for r in routes[:12]} == {"START_IN_COLLISION"}
    solved = [r for r in routes[12:] if r.outcome == "SOLVED"]
    assert len(solved) > 6
    assert not any(buried(field, along(r.poses[:, :3], 0.05) + shift).any() for r in solved)


def test_roofs_and_overhangs_are_flown_under_and_earth_and_rock_are_closed():
    field = hills(5, cells=16, relief_m=4.0)
    roof = trimesh.Trimesh([[8, 8, 9], [20, 8, 9], [20, 20, 9], [8, 20, 9]], [[0, 1, 2], [0, 2, 3]], process=False)
    scene, shift = adopted(field, roof, box((2, 22, 8.5), (30, 26, 9.0)))
    under = np.array([[14.1, 14.2], [16.3, 24.1]])
    cases = [(scene, shift, np.c_[under, [7.0, 7.0]], np.c_[under, field.z(under) - 0.6])]
    # A section along x, drawn out along y: a floor, a back wall, a ceiling that comes forward, and a slope on top.
    section = np.array([[0, 2], [14, 2], [14, 6], [8, 6], [8, 7], [20, 9], [30, 3]], dtype=float)
    vertices = np.array([[x, v, z] for v in np.arange(0.0, 31.0) for x, z in section])
    n = len(section)
    cell = np.array(
        [[i * n + j, i * n + j + 1, (i + 1) * n + j + 1, (i + 1) * n + j] for i in range(30) for j in range(6)]
    )
    cliff = trimesh.Trimesh(vertices, np.concatenate([cell[:, :3], cell[:, [0, 2, 3]]]), process=False)
    scene, _ = import_mesh(NAME, [raw(cliff, "Cliff")])
    rock = [(12.0, 15.0, 7.0), (18.0, 15.0, 4.0), (26.0, 15.0, 3.5)]
    cases.append((scene, np.array([15.0, 15.0, 2.0]), [(12.0, 15.0, 4.0)], rock))
    for scene, shift, free, closed in cases:
        grid = ClearanceGrid.build(scene)
        assert grid.ground is not None
        assert all(grid.reachable(place - shift) and not grid.below_ground(place - shift) for place in free)
        assert not any(grid.reachable(place - shift) for place in closed)


def test_solid_ground_is_no_sheet_and_neither_is_a_canopy_over_ground_that_was_laid():
    posts = [box((x - 0.2, y - 0.2, 0), (x + 0.2, y + 0.2, 4)) for x in (2, 10) for y in (2, 8)]
    halls = [box((20, 12 * k, 0), (34, 12 * k + 9, 6)) for k in range(3)]
    roof = trimesh.Trimesh([[0, 0, 4], [12, 0, 4], [12, 10, 4], [0, 10, 4]], [[0, 1, 2], [0, 2, 3]], process=False)
    bodies = [raw(mesh, f"Body.{k}") for k, mesh in enumerate([*posts, *halls, roof])]
    canopy, repairs = import_mesh(NAME, bodies)
    assert any("ground plane added" in line for line in repairs.lines)
    empty = Scene("U_Empty_0", (), {}, np.array([[-5.0, -5, 0], [5, 5, 5]]))
    for scene in (town(), empty, canopy):
        assert Ground.of(scene) is None
        assert open_ground(scene) is None


def test_ground_that_fills_the_flight_volume_has_no_curtain():
    sheet = hills(6, cells=16, relief_m=3.0).mesh()
    sheet.vertices -= [16, 16, 0]
    materials, bounds = {"grey": Material("grey", (128, 128, 128))}, np.array([[-15.0, -15, 0], [15, 15, 12]])
    scene = Scene(NAME, (instance("ground", sheet),), materials, bounds)
    grid, plain_grid = (ClearanceGrid.build(scene, closed_ground=closed) for closed in (True, False))
    ground = Ground.of(scene)
    assert ground is not None
    assert not len(ground.curtain(*scene.bounds, 0.25))
    assert not grid.has_curtain
    assert grid.arrays.field.tobytes() == plain_grid.arrays.field.tobytes()


@pytest.fixture(scope="module")
def surveyed(tmp_path_factory):
    """A scene of random terrain with boxes sunk into it, through the real commands up to the release."""
    root, field = tmp_path_factory.mktemp("surveyed"), hills(2, cells=14, holes=2, ragged=True)
    boxes = standing(field, 10, 2)
    mesh = write_hills(field, boxes, root / "hills.glb", turned=True)
    added = add_scene(NAME, mesh, root / "mine", MeshOptions())
    pipeline, roots = open_pipeline(added.pipeline, root / "data")
    draft_scene(NAME, pipeline, roots, DraftOptions(n_landmarks=2, n_objects=8, max_per_category=30))
    run_pipeline(added.pipeline, root / "data", stages=["split"], scenes=[NAME], workers=1)
    return root / "data", pipeline, field, shift_of(field, boxes)


@pytest.mark.pipeline
def test_from_import_to_release_nothing_is_below_the_ground(surveyed):
    data, pipeline, field, shift = surveyed
    anchors = store.read_scene(data, "anchors", NAME).to_pylist()
    places = np.array([[a["x_m"], a["y_m"], a["z_m"]] for a in anchors])
    assert len(places) >= 20
    assert sum(a["selected"] for a in anchors) == 8
    assert not buried(field, places + shift).any()
    solved = [p for p in store.read_scene(data, "plans", NAME).to_pylist() if p["outcome"] == "SOLVED"]
    assert len(solved) > 100
    for plan in solved:
        assert not buried(field, along(poses(plan)[:, :3], 0.1) + shift).any()
    assert check(Planted(data, NAME), pipeline=pipeline) == {}


@pytest.mark.pipeline
def test_validate_finds_what_is_planted_below_the_ground(surveyed, tmp_path):
    data, pipeline, field, shift = surveyed
    for part in ("release", "meshes"):
        shutil.copytree(data / part, tmp_path / part)
    planted = Planted(tmp_path, NAME)

    def under(x: float, y: float) -> float:
        return float(field.z(np.array([[x + shift[0], y + shift[1]]]))[0] - shift[2] - 0.5)

    def middle(r: dict) -> tuple[int, float]:
        k = len(r["z_m"]) // 2
        return k, under(r["x_m"][k], r["y_m"][k])

    anchor = planted.edit("release/anchors", lambda a: a.update(z_m=under(a["x_m"], a["y_m"])))
    goal = planted.edit("routes/train", lambda r: r.update(goal_z_m=under(r["goal_x_m"], r["goal_y_m"])))
    route = planted.edit(
        "routes/test", lambda r: r["z_m"].__setitem__(*middle(r)), lambda r: 0.5 < middle(r)[1] < 20.0
    )
    found = check(planted, pipeline=pipeline)
    assert found["anchor_below_ground"] == [f"object_id={anchor['object_id']} anchor_id={anchor['anchor_id']}"]
    assert found["goal_below_ground"] == [f"nav_id={goal['nav_id']}"]
    assert found["route_below_ground"] == [f"nav_id={route['nav_id']}"]
