"""Properties of the real output of a whole run on two small scenes, beside those that validate holds."""

import math

import numpy as np
import pandas as pd
import pytest
import trimesh
from support.command_line import called

from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.store import schemas

RADIUS_M = 0.25
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
def solved(smoke):
    return pd.read_parquet(smoke / "plans", filters=[("outcome", "==", "SOLVED")])


def test_replay_of_the_actions_reproduces_the_stored_poses(solved):
    assert len(solved) > 200
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


def test_no_ray_along_the_body_hits_anything(smoke, solved):
    """Rays along every segment, on the body's axis and on eight lines of its hull, against embree."""
    for scene, rows in solved.groupby("scene"):
        instances = read_glb(smoke / "meshes" / f"{scene}.glb").instances
        mesh = trimesh.util.concatenate([trimesh.Trimesh(i.vertices, i.faces, process=False) for i in instances])
        intersector = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh)
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
            hits, rays, _ = intersector.intersects_location(p + offset, along, multiple_hits=False)
            assert (np.linalg.norm(hits - (p + offset)[rays], axis=1) > length[rays] - 1e-3).all(), (scene, k)


def test_render_command_keeps_to_the_pipelines_scenes(smoke, project):
    before = {p: p.stat().st_mtime_ns for p in smoke.rglob("*.parquet")}
    assert pd.read_parquet(smoke / "recordings")["ok"].all()
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
