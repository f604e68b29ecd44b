"""The stage `plan` on a made-up town, and choosing before searching, on lengths that scatter about predicted ones."""

import math
from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.flying import town
from support.handmade import job_of, write_rows, write_scene, xyz

from aerialdojo_gen.base.config.sections import FilterConfig, PairObjectsConfig, PlanConfig, QuotaConfig
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.paper_figures import PaperScene
from aerialdojo_gen.pipeline.stages.work import candidate_policy, pair_objects, plan
from aerialdojo_gen.pipeline.stages.work.candidate_policy import (
    Accepted,
    Candidates,
    PaperQuota,
    difficulty_level,
    select_quota,
)
from aerialdojo_gen.pipeline.stages.work.rules import judge
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.planner import Route
from aerialdojo_gen.scenes.context import release_scenes
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.tables import check_table

SCENE = "U_Test_0"
CONFIG = PlanConfig(targets_per_part=2)
N_OBJECTS = 5


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    """A store with the town, five objects of three anchors each, one of them inside a house, and their pairs."""
    root = tmp_path_factory.mktemp("data")
    world = town()
    write_scene(root, world)
    write_rows(root, "objects", [{"object_id": k, "mesh_node": f"thing_{k:02d}"} for k in range(N_OBJECTS)])
    grid = ClearanceGrid.build(world)
    rng = np.random.default_rng(11)
    anchors = []
    for k in range(N_OBJECTS):
        for a in range(3):
            p = (0.0, 0.0, 0.0)
            while not (grid.reachable(p) and grid.distance_m(p) > 0.4):
                p = rng.uniform([-16, -16, 0.5], [16, 16, 6])
            if (k, a) == (4, 2):
                p = world["thing_00"].centroid
            turn = rng.uniform(-math.pi, math.pi)
            anchors.append({"object_id": k, "anchor_id": a, **xyz(p), "yaw_rad": turn, "selected": a == 1})
    write_rows(root, "anchors", anchors)
    pairs = pair_objects.run(job_of("pair-objects", root), PairObjectsConfig()).tables["pairs"]
    store.write_shard(root, "pairs", SCENE, 0, pairs)
    return root


@pytest.fixture(scope="module")
def shards(data):
    parts = -(-N_OBJECTS // CONFIG.targets_per_part)
    assert parts == 3
    return [plan.run(job_of("plan", data, SCENE, k, parts), CONFIG) for k in range(parts)]


def test_every_candidate_has_one_row_in_one_shard(data, shards):
    ids = []
    for out in shards:
        table = check_table(schemas.PLANS, out.tables["plans"])
        part = table["pair_id"].to_pylist()
        assert part == sorted(part)
        assert out.rows_in == out.rows_out == len(part) == sum(out.counts.values())
        ids += part
    assert sorted(ids) == sorted(store.read_scene(data, "pairs", SCENE)["pair_id"].to_pylist())
    assert len(ids) > 40


def test_the_anchor_inside_a_house_starts_nothing(shards):
    rows = [r for out in shards for r in out.tables["plans"].to_pylist()]
    for r in rows:
        inside = r["pair_id"].startswith("4_2__")
        assert r["outcome"] == ("START_IN_COLLISION" if inside else "SOLVED")
        if inside:
            assert (r["length_m"], r["n_actions"], r["x_m"], r["action"]) == (0.0, 0, [], [])
            assert r["min_clearance_m"] is None


def test_a_shard_does_not_depend_on_what_was_planned_before(data, shards):
    release_scenes()
    again = plan.run(job_of("plan", data, SCENE, 1, 3), CONFIG)
    assert again.tables["plans"].equals(shards[1].tables["plans"])


def test_a_part_beyond_the_targets_is_empty(data):
    out = plan.run(job_of("plan", data, SCENE, 3, 4), CONFIG)
    assert (out.rows_in, out.rows_out, out.tables["plans"].num_rows) == (0, 0, 0)
    check_table(schemas.PLANS, out.tables["plans"])


def test_a_pair_without_its_anchor_is_named(data, tmp_path):
    for name in ("scenes", "objects", "anchors", "pairs"):
        table = store.read_scene(data, name, SCENE)
        if name == "anchors":
            table = table.filter(pc.not_equal(table["object_id"], 3))
        store.write_shard(tmp_path, name, SCENE, 0, table)
    (tmp_path / "meshes").symlink_to(data / "meshes")
    with pytest.raises(StoreError, match="pair-objects"):
        plan.run(job_of("plan", tmp_path), CONFIG)


def test_as_much_is_searched_as_is_released_and_nothing_of_it_differs(data, shards, monkeypatch):
    every = {r["pair_id"]: r for out in shards for r in out.tables["plans"].to_pylist()}
    # A fifth of the town's short routes, and metres that they can have.
    paper = PaperScene(SCENE, 1, N_OBJECTS, 12, 3, 0, 330.0)
    monkeypatch.setattr(candidate_policy, "inventory", lambda: {SCENE: paper})

    def planned(**values):
        config = PlanConfig(search="released", quota=QuotaConfig(prefer_harder=5.0, **values))
        out = plan.run(job_of("plan", data), config)
        assert out.rows_in == out.rows_out == len(every)
        return {r["pair_id"]: r for r in check_table(schemas.PLANS, out.tables["plans"]).to_pylist()}, out.counts

    some, counts = planned()
    assert counts["NOT_NEEDED"] > 10
    assert counts["SOLVED"] >= 15
    kept = {"base": 0, "standard": 0}
    for key, row in some.items():
        if row["outcome"] != "NOT_NEEDED":
            assert row == every[key]
            kept["base" if row["length_m"] < 30 else "standard"] += row["length_m"] >= 5
        else:
            assert (row["length_m"], row["x_m"]) == (0.0, [])
            assert row["predicted_length_m"] == pytest.approx(every[key]["length_m"], rel=0.15)
    assert kept["base"] >= 12
    assert kept["standard"] >= 3
    # By another number of candidates searched at first the rest are searched later: there is enough in any case.
    _, fewer = planned(search_margin=0.02)
    assert 15 <= fewer["SOLVED"] <= counts["SOLVED"]


PREFERENCE = 5.0


def scene(seed: int, n: int) -> tuple[Candidates, np.ndarray, np.ndarray]:
    """Candidates, and what searches would find: outcomes and lengths, 3 in 100 nothing."""
    rng = np.random.default_rng(seed)
    free = rng.uniform(3.5, 95.0, n)
    length = free * (1.0 + rng.exponential(0.12, n))
    predicted = length * rng.normal(1.0, 0.02, n)
    # As of the cost-to-go: some goals cannot be reached, and some grid paths are too straight for a search.
    predicted[rng.random(n) < 0.05] = np.inf
    outcome = np.where(rng.random(n) < 0.03, "BUDGET_EXHAUSTED", "SOLVED")
    euclidean = free * rng.uniform(0.75, 0.93, n)
    keys = [f"U_Test_0-{k:012x}" for k in rng.permutation(n)]
    visible = np.where(rng.random(n) < 0.4, 0.0, rng.random(n))
    return Candidates("U_Test_0", keys, euclidean, free, visible, predicted), outcome, length


def searched(draw: PaperQuota, c: Candidates, outcome: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Search in rounds as `plan` does; which candidates were."""
    found: list[Route | None] = [None] * len(length)
    rows = draw.initial_batch(c)
    while len(rows):
        for k in rows.tolist():
            assert found[k] is None, "searched twice"
            solved = outcome[k] == "SOLVED"
            found[k] = Route(outcome[k], length_m=float(length[k]) if solved else 0.0)
        rows = draw.next_batch(found)
    return np.array([route is not None for route in found])


def kept(c: Candidates, outcome: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    reason, setting = judge(
        outcome.astype("U24"), c.euclidean_m, length, np.zeros(len(length), np.int32), FilterConfig(),
        length / c.free_length_m, c.visible,
    )  # fmt: skip
    return reason == "kept", setting


def released(c: Candidates, rows: np.ndarray, setting: np.ndarray, length: np.ndarray, paper: PaperScene):
    levels = difficulty_level(length[rows] / c.free_length_m[rows], c.visible[rows])
    pool = Accepted([c.sampling_keys[k] for k in rows], setting[rows].tolist(), length[rows], levels)
    return rows[select_quota(pool, paper.tasks, paper.path_m, 200, PREFERENCE)]


@settings(max_examples=10)
@given(st.integers(0, 10_000), st.sampled_from([0.1, 0.25, 0.6]), st.floats(0.9, 1.1))
def test_what_is_searched_holds_the_papers_numbers_and_metres(seed, margin, longer):
    c, outcome, length = scene(seed, 1500)
    paper = PaperScene("U_Test_0", 1, 20, 120, 90, 25, longer * (120 * 18 + 90 * 45 + 25 * 75))
    config = QuotaConfig(search_margin=margin, prefer_harder=PREFERENCE)
    which = searched(PaperQuota(paper, config, 200), c, outcome, length)
    keep, setting = kept(c, outcome, length)
    rows = released(c, np.flatnonzero(keep & which), setting, length, paper)
    assert {name: int(np.count_nonzero(setting[rows] == name)) for name in paper.tasks} == paper.tasks
    assert length[rows].sum() == pytest.approx(paper.path_m, rel=0.01)
    assert np.count_nonzero(which) < 0.5 * np.isfinite(c.predicted_m).sum()
    # As hard as what all candidates would have given: no more than one task in eight is another kind.
    best = released(c, np.flatnonzero(keep & np.isfinite(c.predicted_m)), setting, length, paper)
    hard, hardest = (difficulty_level(length[k] / c.free_length_m[k], c.visible[k]).mean() for k in (rows, best))
    assert hard > hardest - 1 / 8


@settings(max_examples=5)
@given(st.integers(0, 10_000))
def test_a_pool_that_is_too_small_is_searched_whole(seed):
    c, outcome, length = scene(seed, 200)
    paper = PaperScene("U_Test_0", 1, 20, 400, 90, 25, 20_000.0)
    config = QuotaConfig(prefer_harder=PREFERENCE)
    which = searched(PaperQuota(paper, config, 200), c, outcome, length)
    assert which.tolist() == np.isfinite(c.predicted_m).tolist()


def test_rows_in_another_order_are_searched_all_the_same():
    c, outcome, length = scene(5, 800)
    paper = PaperScene("U_Test_0", 1, 20, 60, 60, 9, 5000.0)
    config = QuotaConfig(prefer_harder=PREFERENCE)
    which = searched(PaperQuota(paper, config, 200), c, outcome, length)
    order = np.random.default_rng(0).permutation(800)
    mixed = Candidates(
        c.scene, [c.sampling_keys[k] for k in order], c.euclidean_m[order], c.free_length_m[order], c.visible[order],
        c.predicted_m[order],
    )  # fmt: skip
    again = searched(PaperQuota(paper, config, 200), mixed, outcome[order], length[order])
    assert again.tolist() == which[order].tolist()


def test_a_few_more_are_kept_than_are_released():
    """`filter` may still refuse some: two more a setting, or one in fifty."""
    n = 200
    keys = [f"U_Test_0-{k:012x}" for k in range(n)]
    length = np.full(n, 20.0)
    c = Candidates("U_Test_0", keys, length / 1.2, length / 1.1, np.zeros(n), length)
    for wanted, spare in ((40, 2), (150, 3)):
        paper = PaperScene("U_Test_0", 1, 20, wanted, 0, 0, wanted * 20.0)
        config = QuotaConfig(search_margin=0.02, prefer_harder=PREFERENCE)
        # One in a hundred has no route.
        outcome = np.where(np.arange(n) % 100 == 0, "NO_PATH", "SOLVED")
        which = searched(PaperQuota(paper, config, 200), c, outcome, length)
        assert np.count_nonzero(which & (outcome == "SOLVED")) >= wanted + spare
