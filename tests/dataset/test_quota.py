"""Quotas: the paper's numbers to the integer, chosen by the tasks' own ids, or a word on what is lacking."""

import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.handmade import write_rows

from aerialdojo_gen.base.errors import PoolError
from aerialdojo_gen.base.paper_figures import inventory, splits
from aerialdojo_gen.dataset.build import open_pipeline
from aerialdojo_gen.pipeline import runner
from aerialdojo_gen.pipeline.runner import stages_named
from aerialdojo_gen.pipeline.stages.work.candidate_policy import (
    Accepted,
    apportion,
    difficulty_level,
    select_quota,
    train_quotas,
)
from aerialdojo_gen.pipeline.stages.work.candidate_pool import pool_lines, pool_of, require_pools
from aerialdojo_gen.pipeline.stages.work.split import held_out, key_of, reference_id

SETTINGS = {"base": (5.0, 30.0), "standard": (30.0, 60.0), "long_horizon": (60.0, 100.0)}


def test_every_cell_of_the_papers_splits_is_met():
    for (partition, subset), cells in splits().items():
        scenes = [row for row in inventory().values() if (row.scene.endswith("_1")) == (partition == "OOD")]
        for setting, n in cells.items():
            trains = sum(train_quotas(row.scene, inventory(), splits())[setting] for row in scenes)
            every = sum(row.tasks[setting] for row in scenes)
            assert (trains if subset == "train" else every - trains) == n
    for row in inventory().values():
        share = 0.2 if row.scene.endswith("_1") else 0.8
        for setting, n in train_quotas(row.scene, inventory(), splits()).items():
            assert abs(n - share * row.tasks[setting]) < 1 + 0.01 * row.tasks[setting], (row.scene, setting)


@given(
    st.dictionaries(st.text("abc", min_size=1, max_size=4), st.integers(0, 500), min_size=1, max_size=12),
    st.floats(0, 1),
)
def test_shares_are_whole_fair_and_sum_up(sizes, part):
    total = int(part * sum(sizes.values()))
    shares = apportion(total, sizes)
    assert sum(shares.values()) == total
    for name, size in sizes.items():
        assert 0 <= shares[name] <= size
        assert abs(shares[name] - total * size / max(sum(sizes.values()), 1)) < 1


def pool(n, seed):
    rng = np.random.default_rng(seed)
    settings = rng.choice(list(SETTINGS), size=n)
    lengths = np.array([rng.uniform(*SETTINGS[s]) for s in settings])
    return [f"U_Test_0-{k:012x}" for k in rng.permutation(n)], settings.tolist(), lengths


def test_lengths_out_of_reach_take_the_nearest_other_seeds_other_tasks_and_all_where_all_are_wanted():
    ids, setting, lengths = pool(300, 3)
    accepted, bases = Accepted(ids, setting, lengths), np.sort(lengths[np.asarray(setting) == "base"])
    for path_m, nearest in ((1.0, bases[:40]), (1e9, bases[-40:])):
        chosen = lengths[select_quota(accepted, {"base": 40}, path_m, 0)]
        assert chosen.sum() == pytest.approx(nearest.sum(), rel=0.02)
    assert len({select_quota(accepted, {"base": 40}, 700.0, seed).tobytes() for seed in range(4)}) == 4
    every = {s: setting.count(s) for s in SETTINGS}
    assert select_quota(Accepted(ids, setting, lengths, np.arange(300) % 3), every, 1.0, 0, 50.0).all()


@settings(max_examples=10)
@given(st.integers(0, 1000), st.floats(0.9, 1.1), st.sampled_from([0.5, 2.0, 5.0, 50.0]))
def test_numbers_and_metres_hold_and_harder_tasks_are_preferred(seed, longer, preference):
    ids, setting, lengths = pool(1500, seed)
    rng = np.random.default_rng(seed)
    levels = difficulty_level(rng.choice([1.0, 1.2], 1500), rng.choice([0.0, 0.4], 1500))
    assert set(levels.tolist()) == {0, 1, 2}
    wanted = {"base": 150, "standard": 120, "long_horizon": 40}
    path_m = longer * sum(n * (SETTINGS[s][0] + SETTINGS[s][1]) / 2 for s, n in wanted.items())
    order = rng.permutation(1500)
    chosen = []
    for told, asked in (((), 0.0), ((levels,), preference)):
        mask = select_quota(Accepted(ids, setting, lengths, *told), wanted, path_m, seed, asked)
        assert {s: sum(m and t == s for m, t in zip(mask, setting, strict=True)) for s in wanted} == wanted
        assert lengths[mask].sum() == pytest.approx(path_m, rel=0.01)
        # The order of rows is no preference.
        mixed = Accepted([ids[k] for k in order], [setting[k] for k in order], *(v[order] for v in (lengths, *told)))
        again = select_quota(mixed, wanted, path_m, seed, asked)
        assert {ids[k] for k in np.flatnonzero(mask)} == {ids[order[k]] for k in np.flatnonzero(again)}
        chosen.append(mask)
    plain, hard = chosen
    assert levels[hard].sum() > levels[plain].sum()
    alike = Accepted(ids, setting, lengths, np.ones(1500, np.int64))
    assert (select_quota(alike, wanted, path_m, seed, preference) == plain).all()


def test_what_is_not_known_is_not_hard():
    known = difficulty_level(np.array([1.04, 1.05, np.nan, np.nan]), np.array([0.01, 0.0, 0.0, np.nan]))
    assert known.tolist() == [0, 2, 1, 0]


@given(st.sets(st.integers(0, 10_000), max_size=80), st.floats(0, 1), st.integers(0, 5))
def test_held_out_objects_are_a_share_of_their_scene_by_the_salt(objects, fraction, salt):
    key = key_of(f"salt number {salt:04}", 0)
    out = held_out("U_Test_0", sorted(objects), fraction, key)
    assert out <= objects
    assert len(out) == int(fraction * len(objects) + 0.5)
    assert held_out("U_Test_0", sorted(objects, reverse=True), fraction, key) == out
    assert out <= held_out("U_Test_0", sorted(objects), 1.0, key) == objects


def test_another_salt_or_scene_holds_out_other_objects_and_ids_of_pictures_do_not_tell_which():
    keys = [key_of(salt, 0) for salt in ("a salt of one's own", "another of one's own")]
    sets = [held_out(scene, range(200), 0.2, key) for scene in ("U_A_0", "U_B_0") for key in keys]
    assert all(len(out) == 40 for out in sets)
    assert len({frozenset(out) for out in sets}) == 4
    by_id = sorted(range(200), key=lambda k: reference_id("U_A_0", k, keys[0]))
    # By chance a fifth of the 40 that come first.
    assert len(sets[0] & set(by_id[:40])) < 20


def judged(data, scene, kept):
    """Write the plans and verdicts of a scene with so many kept candidates of each setting."""
    pairs = [(setting, k, n, f"{setting}_{k:05}") for setting, n in kept.items() for k in range(n)]
    lengths = [SETTINGS[s][0] + (SETTINGS[s][1] - SETTINGS[s][0]) * (k + 0.5) / n for s, k, n, _ in pairs]
    plans = [{"pair_id": p[-1], "outcome": "SOLVED", "length_m": m} for p, m in zip(pairs, lengths, strict=True)]
    write_rows(data, "plans", plans, scene)
    verdicts = [{"pair_id": pair_id, "keep": True, "reason": "kept", "setting": s} for s, _, _, pair_id in pairs]
    write_rows(data, "verdicts", verdicts, scene)


def test_a_pool_that_is_too_small_is_named_and_nothing_else(tmp_path):
    judged(tmp_path, "D_Flood_1", {"base": 150, "standard": 94, "long_horizon": 5})
    judged(tmp_path, "U_Park_0", {"base": 173, "standard": 45, "long_horizon": 3})
    with pytest.raises(PoolError) as error:
        require_pools(tmp_path, ["D_Flood_1", "U_Park_0"])
    lines = str(error.value).splitlines()
    assert lines[0] == "D_Flood_1: 1 standard tasks short: 94 are kept, the paper has 95"
    assert len(lines) == 2
    assert "nothing is released" in lines[1]
    require_pools(tmp_path, ["U_Park_0"])
    shown = pool_lines([pool_of(tmp_path, name) for name in ("D_Flood_1", "U_Park_0")])
    assert "94/95!" in shown[2]
    assert "173/173 " in shown[3]


def test_split_writes_nothing_where_a_pool_is_too_small(smoke, tmp_path):
    """The tables of a small scene, called after one of the paper's."""
    (split,) = stages_named(["split"])
    for table in split.reads:
        shutil.copytree(smoke / table / "U_Courtyard_0", tmp_path / table / "D_Flood_1")
    config, roots = open_pipeline(None, tmp_path)
    with pytest.raises(PoolError, match=r"D_Flood_1: \d+ standard tasks short"):
        runner.run([split], ["D_Flood_1"], config, roots)
    assert not (tmp_path / "release").exists()
