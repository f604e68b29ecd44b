"""Properties of the real output of a whole run on two small scenes, beside those that validate holds."""

import io
import itertools
import json
import math

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import trimesh
from support.command_line import called

from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.tables import content_digest

RADIUS_M = 0.25
SUCCESS_RADIUS_M = 3.0
BUDGETS = {"base": 90, "standard": 180, "long_horizon": 300}
RANGES = {"base": (5, 30), "standard": (30, 60), "long_horizon": (60, 100)}
LISTS = ["x_m", "y_m", "z_m", "yaw_rad", "action"]
# Displacement in the body's frame (forward, left, up) in metres and turn in degrees, from the design's table and
# not from the package.
MOVES = {
    1: (1, 0, 0, 0), 2: (3, 0, 0, 0), 3: (5, 0, 0, 0), 4: (0, 1, 0, 0), 5: (0, 3, 0, 0), 6: (0, 5, 0, 0),
    7: (0, -1, 0, 0), 8: (0, -3, 0, 0), 9: (0, -5, 0, 0), 10: (0, 0, 1, 0), 11: (0, 0, 2, 0), 12: (0, 0, -1, 0),
    13: (0, 0, -2, 0), 14: (0, 0, 0, 15), 15: (0, 0, 0, -15),
}  # fmt: skip


def xyz(row):
    return np.stack([row.x_m, row.y_m, row.z_m], axis=1)


def wrap(angle):
    return (angle + math.pi) % (2 * math.pi) - math.pi


def replay(row):
    """Poses that follow from the start and the actions; Approach stays in place."""
    x, y, z, yaw = row.x_m[0], row.y_m[0], row.z_m[0], row.yaw_rad[0]
    poses = [(x, y, z, yaw)]
    for action in row.action[:-1]:
        if action != schemas.APPROACH:
            forward, left, up, turn = MOVES[action]
            x += forward * math.cos(yaw) - left * math.sin(yaw)
            y += forward * math.sin(yaw) + left * math.cos(yaw)
            z, yaw = z + up, yaw + math.radians(turn)
        poses.append((x, y, z, yaw))
    return np.array(poses)


@pytest.fixture(scope="module")
def plans(smoke):
    return pd.read_parquet(smoke / "plans")


@pytest.fixture(scope="module")
def solved(plans):
    return plans[plans["outcome"] == "SOLVED"]


@pytest.fixture(scope="module")
def routes(smoke):
    return pd.concat([pd.read_parquet(p) for p in sorted((smoke / "release" / "routes").iterdir())])


@pytest.fixture(scope="module")
def tasks(smoke):
    return pd.concat([pd.read_parquet(p) for p in sorted((smoke / "release" / "tasks").iterdir())])


@pytest.fixture(scope="module")
def meshes(smoke):
    result = {}
    for path in sorted((smoke / "meshes").iterdir()):
        model = read_glb(path)
        parts = [trimesh.Trimesh(i.vertices, i.faces, process=False) for i in model.instances]
        result[path.stem] = trimesh.util.concatenate(parts)
    return result


def test_there_is_something_to_test(solved, routes, tasks):
    assert len(solved) > 200
    assert routes.groupby("scene").size().min() > 20
    assert len(tasks) == 2 * len(routes)


def test_every_candidate_has_a_plan_and_a_verdict(smoke, plans):
    pairs, verdicts = pd.read_parquet(smoke / "pairs"), pd.read_parquet(smoke / "verdicts")
    keys = [set(zip(t["scene"], t["pair_id"], strict=True)) for t in (pairs, plans, verdicts)]
    assert keys[0] == keys[1] == keys[2]
    assert set(plans["outcome"]) <= set(schemas.OUTCOMES)
    assert (verdicts["reason"] == "kept").equals(verdicts["keep"])


def test_replay_of_the_actions_reproduces_the_stored_poses(solved):
    for row in solved.itertuples():
        assert len({len(getattr(row, name)) for name in LISTS}) == 1
        assert row.action[-1] == schemas.STOP
        assert list(row.action).count(schemas.STOP) == 1
        assert row.n_actions == len(row.action)
        poses = replay(row)
        approach = np.flatnonzero(row.action == schemas.APPROACH)
        assert len(approach) <= 1
        until = len(poses) if not len(approach) else approach[0] + 1
        assert np.abs(poses[:until, :3] - xyz(row)[:until]).max() < 1e-5
        assert np.abs(wrap(poses[:, 3] - row.yaw_rad)).max() < 1e-5
        # Without Approach an agent still stops within a metre of the anchor.
        assert np.linalg.norm(poses[-1, :3] - xyz(row)[-1]) <= 1.0 + 1e-6


def test_released_routes_hold_the_papers_bounds(routes):
    assert (routes["euclidean_m"] > 3).all()
    assert (routes["length_m"] >= 1.05 * routes["euclidean_m"]).all()
    assert np.allclose(routes["detour_ratio"], routes["length_m"] / routes["euclidean_m"], rtol=1e-12)
    for setting, rows in routes.groupby("setting"):
        low, high = RANGES[setting]
        assert rows["length_m"].between(low, high, inclusive="left").all()
        assert (rows["n_actions"] <= BUDGETS[setting]).all()


def test_no_ray_along_the_body_hits_anything(solved, meshes):
    """Rays along every segment, on the body's axis and on eight lines of its hull, against embree."""
    for scene, rows in solved.groupby("scene"):
        intersector = trimesh.ray.ray_pyembree.RayMeshIntersector(meshes[scene])
        starts, ends = [], []
        for row in rows.itertuples():
            points = xyz(row)
            moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-9
            starts.append(points[:-1][moved])
            ends.append(points[1:][moved])
        p, q = np.concatenate(starts), np.concatenate(ends)
        length = np.linalg.norm(q - p, axis=1)
        along = (q - p) / length[:, None]
        side = np.cross(along, np.where(np.abs(along[:, 2:]) > 0.9, [[1.0, 0, 0]], [[0, 0, 1.0]]))
        side /= np.linalg.norm(side, axis=1)[:, None]
        up = np.cross(side, along)
        for k in range(9):
            angle = k * math.pi / 4
            offset = 0 if k == 8 else 0.98 * RADIUS_M * (math.cos(angle) * side + math.sin(angle) * up)
            distance = np.linalg.norm(hit_locations(intersector, p + offset, along) - (p + offset), axis=1)
            assert not np.count_nonzero(distance < length - 1e-3), (scene, k)


def hit_locations(intersector, origins, directions):
    """First hits of rays, infinity where there is none."""
    locations, rays, _ = intersector.intersects_location(origins, directions, multiple_hits=False)
    result = np.full(origins.shape, np.inf)
    result[rays] = locations
    return result


def test_the_body_never_touches_the_mesh_at_sampled_points(routes, meshes):
    """Exact point-to-mesh distances by trimesh, which the planner does not use."""
    for scene, rows in routes.groupby("scene"):
        query = trimesh.proximity.ProximityQuery(meshes[scene])
        for row in rows.sort_values("nav_id").head(12).itertuples():
            points = xyz(row)
            dense = np.concatenate([np.linspace(a, b, 6) for a, b in itertools.pairwise(points)])
            distance = query.on_surface(np.unique(dense, axis=0))[1]
            assert distance.min() > RADIUS_M - 1e-4, row.nav_id
            # The stored clearance is the route's smallest: no sampled point is nearer than it says.
            assert min(distance.min(), 5.0) >= row.min_clearance_m - 1e-3


def test_recordings_are_there_and_well(smoke):
    recordings = pd.read_parquet(smoke / "recordings")
    frames = pd.read_parquet(smoke / "frames")
    assert set(recordings["view"]) == set(schemas.VIEWS)
    assert set(recordings["modality"]) == {"rgb", "depth"}
    assert recordings["ok"].all()
    n_frames = frames.groupby("nav_id").size()
    for row in recordings.itertuples():
        path = smoke / row.path
        assert path.stat().st_size == row.bytes
        assert row.n_frames == n_frames[row.nav_id]


def test_tasks_and_routes_meet_on_their_key(tasks, routes):
    assert set(tasks["nav_id"]) == set(routes["nav_id"])
    assert routes["nav_id"].is_unique
    split = tasks.groupby("nav_id")[["subset", "partition"]].nunique()
    assert (split == 1).all().all()


def test_every_shard_says_what_it_was_made_from(smoke):
    for path in sorted(smoke.rglob("part-*.parquet")):
        info = store.read_info(path.parent, path.name)
        assert len(info.fingerprint) == 64
        meta = json.loads(pq.read_schema(path).metadata[b"aerialdojo"])
        assert meta["content"] == content_digest(pq.read_table(path, partitioning=None)), path


def test_the_card_is_written(smoke, tasks):
    card = (smoke / "release" / "README.md").read_text()
    assert f"{len(tasks):,} task instances" in card
    assert io.StringIO(card).readline() == "---\n"


def test_render_command_keeps_to_the_pipelines_scenes(smoke, project):
    before = {p: p.stat().st_mtime_ns for p in smoke.rglob("*.parquet")}
    done = called("render", "--pipeline", "pipelines/smoke.toml", "--limit", 1, "--data", smoke, cwd=project)
    assert done.returncode == 0, done.stderr
    tasks = pd.read_parquet(smoke / "release/tasks")
    trained = tasks[tasks["subset"] == "train"].groupby(["scene", "setting"]).ngroups
    assert f"render: {trained} rows in, {8 * trained} out" in done.stderr
    assert {p: p.stat().st_mtime_ns for p in smoke.rglob("*.parquet")} == before


def test_a_run_prints_what_stats_prints(smoke, project):
    def said(*args):
        done = called(*args, "--data", smoke, cwd=project)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert said("run", "pipelines/smoke.toml", "--stats") == said("stats")
    assert said("run", "pipelines/smoke.toml") == ""
