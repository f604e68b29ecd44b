"""The release of a hand-made scene: counts, both instances together, and nothing about the target in `tasks`."""

import itertools
import math
import re
import shutil

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.handmade import box, instance, job_of, write_rows, write_scene, xyz
from support.handmade import scene as handmade_scene

from aerialdojo_gen.base.config.sections import FilterConfig, SplitConfig
from aerialdojo_gen.dataset.card import write_card
from aerialdojo_gen.dataset.contents import counts
from aerialdojo_gen.pipeline.stages.work import filter as filter_stage
from aerialdojo_gen.pipeline.stages.work import split
from aerialdojo_gen.pipeline.stages.work.quota import train_counts, train_mask
from aerialdojo_gen.pipeline.stages.work.task_ids import held_out, key_of, nav_id, reference_id
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store

SCENE = "U_Test_0"
N_OBJECTS = 6


def position(i):
    return np.array([7.0 * i, 3.0 * (i % 3), 1.0 + i])


def anchor(i, a):
    """Where an object's anchor is, and its yaw."""
    return position(i) + np.array([1.5, 0.5 * a, 0]), 0.1 * a


def rows_of_pairs_and_plans():
    for i, a, j in itertools.product(range(N_OBJECTS), range(3), range(N_OBJECTS)):
        if i == j:
            continue
        (p, yaw), (q, _) = anchor(i, a), anchor(j, 1)
        share, length = (i + j) % 3 / 4, float(abs(q[0] - p[0]) + np.linalg.norm((q - p)[1:]))
        yield {
            "pair_id": f"{i}_{a}__{j}", "start_object_id": i, "start_anchor_id": a, "target_object_id": j,
            "euclidean_m": float(np.linalg.norm(q - p)),
            "target_visible_at_start": share, "visible_view_at_start": "down" if share else None,
        }, {
            "pair_id": f"{i}_{a}__{j}", "outcome": "SOLVED", "length_m": length, "n_actions": 3,
            "min_clearance_m": 0.4, "x_m": [p[0], q[0], q[0]], "y_m": [p[1], p[1], q[1]], "z_m": [p[2], p[2], q[2]],
            "yaw_rad": [yaw + math.pi] * 3, "action": [3, 16, 0], "agent_action": [3, 0],
            "free_length_m": length / 1.25, "plan_detour": 1.25, "straight_line_free": False,
            "climb_m": max(0.0, q[2] - p[2]),
        }  # fmt: skip


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A data directory with everything upstream of split, and split's own output."""
    data = tmp_path_factory.mktemp("data")
    pairs, plans = zip(*rows_of_pairs_and_plans(), strict=True)
    nodes = [f"thing_{i:03}" for i in range(N_OBJECTS)]
    things = [instance(node, box(tuple(position(i) - 0.5), tuple(position(i) + 0.5))) for i, node in enumerate(nodes)]
    write_scene(data, handmade_scene(*things, half=60.0, ceiling=20.0, name=SCENE))
    for table, rows in {
        "landmarks": [{"name": "tower"}],
        "objects": [
            {"object_id": i, "name": f"thing {i}", "description": f"It is {i}.", "mesh_node": node, "claims": "[]",
             **xyz(position(i))}
            for i, node in enumerate(nodes)
        ],
        "anchors": [
            {"object_id": i, "anchor_id": a, **xyz(anchor(i, a)[0]), "yaw_rad": anchor(i, a)[1], "selected": a == 1}
            for i in range(N_OBJECTS) for a in range(3)
        ],
        "viewpoints": [{}],
        "references": [{"object_id": i, "reference_image": b"png", "step_back_m": 0.0} for i in range(N_OBJECTS)],
        "descriptions": [
            {"object_id": i, "paraphrase_id": k, "text": f"It is {i}, text {k}.", "held_out": k >= 3}
            for i in range(N_OBJECTS) for k in range(5)
        ],
        "pairs": pairs, "plans": plans,
    }.items():  # fmt: skip
        write_rows(data, table, rows)
    for name, run, config in (("filter", filter_stage.run, FilterConfig()), ("split", split.run, SplitConfig())):
        for table, rows in run(job_of(name, data), config).tables.items():
            store.write_shard(data, table, SCENE, 0, rows)
    return data


def load(data, table):
    return pd.concat([pd.read_parquet(data / "release" / table / s) for s in ("id_train", "id_test")])


def test_two_instances_share_everything_but_the_goal(data):
    tasks = load(data, "tasks")
    verdicts = pd.read_parquet(data / "verdicts")
    assert len(tasks) == 2 * verdicts["keep"].sum() > 0
    assert tasks["task_id"].is_unique
    semantic = tasks[tasks["modality"] == "semantic"].set_index("nav_id").sort_index()
    image = tasks[tasks["modality"] == "image"].set_index("nav_id").sort_index()
    differing = ["task_id", "modality", "description", "reference_image_id", "image_distance_m"]
    pd.testing.assert_frame_equal(semantic.drop(columns=differing), image.drop(columns=differing))
    assert semantic["description"].notna().all()
    assert semantic["reference_image_id"].isna().all()
    assert image["description"].isna().all()
    assert image["reference_image_id"].notna().all()


def test_train_share_and_both_instances_on_one_side(data):
    train, test = (pd.read_parquet(data / "release" / "tasks" / s) for s in ("id_train", "id_test"))
    assert set(train["subset"]) == {"train"}
    assert not set(train["nav_id"]) & set(test["nav_id"])
    n = pd.concat([train, test]).groupby("setting").size() // 2
    for setting, total in n.items():
        assert (train["setting"] == setting).sum() // 2 == int(0.8 * total + 0.5)


def test_of_a_scene_that_is_out_of_distribution_a_fifth_trains(data, tmp_path):
    shutil.copytree(data, tmp_path / "data", ignore=shutil.ignore_patterns("release"))
    scene = store.read_scene(data, "scenes", SCENE).to_pylist()[0] | {"partition": "OOD"}
    write_rows(tmp_path / "data", "scenes", [scene])
    output = split.run(job_of("split", tmp_path / "data"), SplitConfig())
    tables = {name: table.to_pandas() for name, table in output.tables.items()}
    n = load(data, "routes").groupby("setting").size()
    for table, instances in (("tasks", 2), ("routes", 1)):
        trains = tables[f"{table}/train"].groupby("setting").size() // instances
        assert trains.to_dict() == {setting: int(0.2 * total + 0.5) for setting, total in n.items()}
        assert len(tables[f"{table}/train"]) + len(tables[f"{table}/test"]) == instances * n.sum()


def test_tasks_tell_the_start_and_nothing_of_the_goal(data):
    tasks, routes = load(data, "tasks").set_index("nav_id"), load(data, "routes").set_index("nav_id")
    telling = ("goal", "target_o", "start_o", "start_a", "len", "euc", "x_", "y_")
    assert set(tasks.columns).isdisjoint({c for c in routes.columns if c.startswith(telling)})
    for name, row in tasks.iterrows():
        route = routes.loc[name]
        assert row["start_x_m"] == route["x_m"][0]
        assert row["start_yaw_rad"] == route["yaw_rad"][0]
        goal = {route["goal_x_m"], route["goal_y_m"], route["goal_z_m"], route["length_m"], route["euclidean_m"]}
        start = {row["start_x_m"], row["start_y_m"], row["start_z_m"]}
        numbers = {v for v in row if isinstance(v, float)}
        assert not numbers & (goal - start)


def test_what_training_has_seen_is_told_by_the_tables_alone(data):
    # So few training tasks that some pairs have none.
    tables = split.run(job_of("split", data), SplitConfig(id_train_fraction=0.2)).tables
    tasks, routes = (
        pd.concat([tables[f"{name}/{side}"].to_pandas() for side in ("train", "test")])
        for name in ("tasks", "routes")
    )
    tasks = tasks.drop_duplicates("nav_id").set_index("nav_id")
    routes = routes.set_index("nav_id").loc[tasks.index]
    train = tasks["subset"] == "train"
    targets, starts = routes["target_object_id"], routes["start_object_id"] * 100 + routes["start_anchor_id"]
    pairs = routes["start_object_id"] * 100 + targets
    for name, own in {"target": targets, "start": starts, "pair": pairs}.items():
        seen = tasks[f"{name}_seen_in_train"]
        assert (seen == own.isin(set(own[train]))).all()
        assert seen[train].all()
    # A pair whose two objects training has, each with another one.
    assert (~tasks["pair_seen_in_train"] & tasks["target_seen_in_train"]).any()


def test_the_split_by_objects_keeps_both_ends_out_of_training(data):
    tasks, routes = load(data, "tasks").drop_duplicates("nav_id").set_index("nav_id"), load(data, "routes")
    routes = routes.set_index("nav_id").loc[tasks.index]
    out = held_out(SCENE, range(N_OBJECTS), 0.2, key_of(None, 0))
    assert len(out) == 1
    for end in ("target", "start"):
        assert (tasks[f"{end}_held_out"] == routes[f"{end}_object_id"].isin(out)).all()
    train = tasks["target_split"] == "train"
    assert not set(routes.loc[train, "target_object_id"]) & out
    assert not set(routes.loc[train, "start_object_id"]) & out
    assert (train == ~(tasks["target_held_out"] | tasks["start_held_out"])).all()
    assert 0 < train.sum() < len(tasks)


def test_difficulty_goes_from_plans_and_pairs_to_routes(data):
    told = ["free_length_m", "plan_detour", "straight_line_free", "climb_m"]
    seen = ["target_visible_at_start", "visible_view_at_start"]
    pairs, plans = (pd.read_parquet(data / name).set_index("pair_id") for name in ("pairs", "plans"))
    figures = pairs[seen].join(plans[told])
    ends = ["start_object_id", "start_anchor_id", "target_object_id"]
    for row in load(data, "routes").itertuples():
        pair = "{}_{}__{}".format(*(getattr(row, name) for name in ends))
        own = figures.loc[pair]
        assert all(getattr(row, name) == own[name] for name in (*told, seen[0]))
        assert [row.visible_view_at_start == "down", own["visible_view_at_start"] == "down"] == [
            row.target_visible_at_start > 0
        ] * 2
        assert row.agent_action.tolist() == [3, 0]


def test_verdicts_are_judged_by_each_candidates_own_figures(data):
    verdicts, pairs, plans = (
        pd.read_parquet(data / name).set_index("pair_id") for name in ("verdicts", "pairs", "plans")
    )
    assert not set(verdicts) & (set(pairs) | set(plans)) - {"scene"}
    figures = pairs[["euclidean_m", "target_visible_at_start"]].join(plans[["length_m", "plan_detour"]])
    paper = figures.loc[verdicts.index[verdicts["keep"]]]
    assert (paper["length_m"] / paper["euclidean_m"]).min() >= 1.05
    routes = load(data, "routes")
    assert np.allclose(routes["detour_ratio"], routes["length_m"] / routes["euclidean_m"], atol=1e-12)
    for rule, kept in (
        ({"max_visible_at_start": 0.25}, paper["target_visible_at_start"] <= 0.25),
        ({"min_plan_detour": 1.25}, paper["plan_detour"] >= 1.25),
        ({"min_plan_detour": 1.26}, paper["plan_detour"] >= 1.26),
    ):
        output = filter_stage.run(job_of("filter", data), FilterConfig(**rule))
        rows = output.tables["verdicts"].to_pandas().set_index("pair_id")
        assert set(rows.index[rows["keep"]]) == set(paper.index[kept])
    assert 0 < (paper["target_visible_at_start"] <= 0.25).sum() < len(paper)


def test_routes_end_on_the_selected_anchor_of_the_named_target(data):
    routes, objects = load(data, "routes"), pd.read_parquet(data / "release" / "objects").set_index("object_id")
    tasks = load(data, "tasks").drop_duplicates("nav_id").set_index("nav_id")
    anchors = pd.read_parquet(data / "release" / "anchors").query("selected").set_index("object_id")
    for row in routes.itertuples():
        goal = anchors.loc[row.target_object_id]
        assert (row.x_m[-1], row.y_m[-1], row.z_m[-1]) == (goal.x_m, goal.y_m, goal.z_m)
        assert (row.goal_x_m, row.goal_y_m, row.goal_z_m) == (goal.x_m, goal.y_m, goal.z_m)
        assert tasks.loc[row.nav_id, "target_name"] == objects.loc[row.target_object_id, "name"]


def test_budget_follows_the_setting(data):
    budgets = load(data, "tasks").groupby("setting")["action_budget"].unique()
    assert {s: list(b) for s, b in budgets.items()}.items() <= {
        "base": [90], "standard": [180], "long_horizon": [300]
    }.items()  # fmt: skip


def test_card_counts_what_is_there(data):
    card = write_card(data).read_text()
    found = counts(data, [SCENE])
    assert f"| `id_train` | {found['tasks']['id_train']:,} | {found['routes']['id_train']:,} |" in card
    assert found["objects"] == {"all": N_OBJECTS}
    for spec in (schemas.TASKS, schemas.ROUTES, schemas.RELEASE_OBJECTS):
        assert all(f"| `{name}` |" in card for name in spec.schema.names)


def test_ids_hang_on_the_salt_and_tell_no_pair():
    keys = [
        key_of(salt, seed)
        for salt, seed in (("a salt of one's own", 0), ("another of one's own", 0), (None, 0), (None, 1))
    ]
    names = {nav_id("U_A_0", pair, key) for key in keys for pair in ("1_0__2", "2_0__1")}
    assert len(names) == 8
    assert all(re.fullmatch(r"U_A_0-[0-9a-f]{12}", name) for name in names)
    assert len({reference_id("U_A_0", 1, key) for key in keys}) == 4
    assert key_of("a salt of one's own", 0) == key_of("a salt of one's own", 1)


def test_another_salt_renames_the_same_tasks(data, tmp_path):
    """Which candidates are released, and on which side, hangs on the pairs alone; the salt stands nowhere."""
    shutil.copytree(data, tmp_path / "data", ignore=shutil.ignore_patterns("release"))
    salt = "nobody is to know this"
    output = split.run(job_of("split", tmp_path / "data"), SplitConfig(salt=salt))
    pair = ["start_object_id", "start_anchor_id", "target_object_id"]
    for subset in ("train", "test"):
        ours = pd.read_parquet(data / "release" / "routes" / f"id_{subset}").sort_values(pair, ignore_index=True)
        theirs = output.tables[f"routes/{subset}"].to_pandas().sort_values(pair, ignore_index=True)
        assert not set(ours["nav_id"]) & set(theirs["nav_id"])
        pd.testing.assert_frame_equal(ours.drop(columns="nav_id"), theirs.drop(columns="nav_id"), check_dtype=False)
    ours = pd.read_parquet(data / "release" / "objects")
    assert not set(ours["reference_image_id"]) & set(
        output.tables["release/objects"]["reference_image_id"].to_pylist()
    )
    for table, rows in output.tables.items():
        store.write_shard(tmp_path / "data", table, SCENE, 0, rows)
    write_card(tmp_path / "data")
    for path in (tmp_path / "data/release").rglob("*"):
        assert path.is_dir() or salt.encode() not in path.read_bytes()


@given(
    n=st.integers(0, 60), fraction=st.floats(0, 1), seed=st.integers(0, 9),
    order=st.randoms(use_true_random=False),
)  # fmt: skip
def test_training_tasks_are_chosen_by_key_not_by_row(n, fraction, seed, order):
    ids, settings = [f"t{i}" for i in range(n)], [("base", "standard")[i % 2] for i in range(n)]
    trains = train_counts(settings, fraction)
    mask = train_mask(ids, settings, trains, seed)
    for setting in ("base", "standard"):
        total = settings.count(setting)
        assert sum(m for m, s in zip(mask, settings, strict=True) if s == setting) == int(fraction * total + 0.5)
    shuffled = list(range(n))
    order.shuffle(shuffled)
    again = train_mask([ids[i] for i in shuffled], [settings[i] for i in shuffled], trains, seed)
    assert [mask[i] for i in shuffled] == list(again)


def test_another_seed_trains_on_other_tasks():
    ids = [f"t{i}" for i in range(60)]
    masks = {tuple(train_mask(ids, ["base"] * 60, {"base": 48}, seed)) for seed in range(5)}
    assert len(masks) == 5
