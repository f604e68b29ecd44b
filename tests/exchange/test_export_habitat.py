"""The export as Habitat's ObjectNav-v1, read by a strict reader of the published schema."""

import gzip
import io
import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from support.releases import files_of, released

from aerialdojo_gen.dataset.contents import scenes_in_release
from aerialdojo_gen.exchange.exporting import estimate_size, export_release
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.schemas import ACTION_NAMES

FIELDS = {
    "view": "agent_state iou",
    "goal": "position object_id object_name object_category room_id view_points",
    "point": "position rotation action",
    "episode": "episode_id scene_id scene_dataset_config start_position start_rotation info goals shortest_paths "
    "object_category",
}


def strict(kind: str, value: dict) -> SimpleNamespace:
    """An object of the format, which has its fields and no others."""
    assert set(value) == set(FIELDS[kind].split())
    return SimpleNamespace(**value)


def load(path: Path) -> tuple[dict[str, list[SimpleNamespace]], list[SimpleNamespace], dict[str, int]]:
    """Read a file of the dataset as Habitat's loader does, which asserts the same of the categories."""
    document = json.loads(gzip.decompress(path.read_bytes()))
    task_ids = document.pop("category_to_task_category_id")
    assert task_ids == document.pop("category_to_scene_annotation_category_id")
    assert sorted(task_ids.values()) == list(range(len(task_ids)))
    goals = {}
    for key, values in document.pop("goals_by_category").items():
        goals[key] = [strict("goal", value) for value in values]
        for goal in goals[key]:
            goal.view_points = [strict("view", view) for view in goal.view_points]
            assert all(set(view.agent_state) == {"position", "rotation"} for view in goal.view_points)
    episodes = [strict("episode", value) for value in document.pop("episodes")]
    for episode in episodes:
        assert episode.goals == []
        episode.goals = goals[f"{Path(episode.scene_id).name}_{episode.object_category}"]
        episode.shortest_paths = [[strict("point", p) for p in path] for path in episode.shortest_paths]
    assert document == {}
    return goals, episodes, task_ids


@pytest.fixture(scope="module")
def habitat(smoke, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("habitat") / "out"
    export_release("habitat", smoke, out)
    return out


def test_every_split_has_its_own_file_and_one_a_scene(habitat):
    numbers = set()
    for split, scene in (("id_train", 0), ("id_test", 0), ("ood_train", 1), ("ood_test", 1)):
        goals, episodes, task_ids = load(habitat / split / f"{split}.json.gz")
        assert (goals, episodes) == ({}, [])
        assert [p.name for p in (habitat / split / "content").iterdir()] == [f"U_Courtyard_{scene}.json.gz"]
        numbers.add(json.dumps(task_ids))
        numbers.add(json.dumps(load(habitat / split / "content" / f"U_Courtyard_{scene}.json.gz")[2]))
    assert len(numbers) == 1


def to_world(p):
    """Ours of Habitat's: x east, y up, z south."""
    x, y, z = p
    return [x, -z, y]


def heading(rotation):
    """World yaw of a body that looks along -z before it is turned."""
    ahead = to_world(Rotation.from_quat(rotation).apply([0, 0, -1]))
    assert ahead[2] == pytest.approx(0)
    return math.atan2(ahead[1], ahead[0])


def turned(a, b):
    return abs(math.remainder(a - b, 2 * math.pi))


@pytest.mark.parametrize(("split", "scene"), [("id_train", "U_Courtyard_0"), ("ood_test", "U_Courtyard_1")])
def test_episodes_are_the_navigation_tasks(habitat, smoke, split, scene):
    _, episodes, _ = load(habitat / split / "content" / f"{scene}.json.gz")
    routes = released(smoke, "routes")
    subset = set(pd.read_parquet(smoke / "release/tasks" / split)["nav_id"])
    objects = pd.read_parquet(smoke / "release/objects").query("scene == @scene").set_index("object_id")
    assert {e.info["nav_id"] for e in episodes} == subset
    assert [e.episode_id for e in episodes] == [str(k) for k in range(len(episodes))]
    for episode in episodes:
        route = routes.loc[episode.info["nav_id"]]
        assert (smoke / episode.scene_id).is_file()
        assert to_world(episode.start_position) == [route["x_m"][0], route["y_m"][0], route["z_m"][0]]
        assert turned(heading(episode.start_rotation), route["yaw_rad"][0]) < 1e-9
        assert episode.info["geodesic_distance"] == route["length_m"]
        target = route["target_object_id"]
        assert episode.object_category == objects.loc[target, "category"]
        assert target in {goal.object_id for goal in episode.goals}
        (path,) = episode.shortest_paths
        assert [ACTION_NAMES[p.action] for p in path][-2:] == ["Approach", "Stop"]
        points = np.array([to_world(p.position) for p in path])
        assert np.array_equal(points, np.column_stack([route["x_m"], route["y_m"], route["z_m"]]))
        assert max(turned(heading(p.rotation), yaw) for p, yaw in zip(path, route["yaw_rad"], strict=True)) < 1e-9
        assert to_world(episode.info["goal_position"]) == points[-1].tolist()


def test_goals_are_all_objects_of_the_mesh_seen_from_their_anchors(habitat, smoke):
    goals, episodes, _ = load(habitat / "id_train/content/U_Courtyard_0.json.gz")
    mesh = trimesh.load_scene(smoke / episodes[0].scene_id)
    parents = mesh.graph.transforms.parents
    objects = pd.read_parquet(smoke / "release/objects").query("scene == 'U_Courtyard_0'").set_index("object_id")
    anchors = pd.read_parquet(smoke / "release/anchors").query("scene == 'U_Courtyard_0'")
    found = {goal.object_id: goal for values in goals.values() for goal in values}
    assert set(found) == set(objects.index)
    for number, goal in found.items():
        row = objects.loc[number]
        assert to_world(goal.position) == [row["x_m"], row["y_m"], row["z_m"]]
        # Where the mesh has it.
        parts = [mesh.graph.get(node) for node in mesh.graph.nodes_geometry if parents[node] == row["mesh_node"]]
        corners = np.vstack([trimesh.transform_points(mesh.geometry[name].vertices, t) for t, name in parts])
        assert (corners.min(axis=0) + corners.max(axis=0)) / 2 == pytest.approx(goal.position, abs=1e-3)
        mine = anchors[anchors["object_id"] == number]
        assert len(goal.view_points) == len(mine)
        for view, (_, anchor) in zip(goal.view_points, mine.iterrows(), strict=True):
            position = to_world(view.agent_state["position"])
            assert position == [anchor["x_m"], anchor["y_m"], anchor["z_m"]]
            yaw = heading(view.agent_state["rotation"])
            # An anchor faces its object.
            assert turned(yaw, math.atan2(row["y_m"] - position[1], row["x_m"] - position[0])) < 1e-6
            assert view.iou == (row["image_fraction"] if anchor["selected"] else None)


def test_the_size_is_announced_and_the_same_release_gives_the_same_bytes(habitat, smoke, tmp_path):
    size, said = estimate_size("habitat", open_root(smoke), scenes_in_release(smoke), 0), io.StringIO()
    export_release("habitat", smoke, tmp_path / "again", reporter=Reporter(stream=said))
    files = files_of(tmp_path / "again")
    assert files == files_of(habitat)
    assert size.files == len(files)
    assert size.bytes == pytest.approx(sum(map(len, files.values())), rel=0.6)
    assert said.getvalue().startswith(f"export: {size}, into {tmp_path / 'again'}")
