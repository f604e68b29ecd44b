"""The release of the smoke scenes: shares, rules and ids; that its rows agree, `validate` finds (tests/dataset)."""

import re

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.handmade import job_of

from aerialdojo_gen.base.config.sections import FilterConfig, SplitConfig
from aerialdojo_gen.pipeline.stages.work import filter as filter_stage
from aerialdojo_gen.pipeline.stages.work import split
from aerialdojo_gen.pipeline.stages.work.candidate_policy import train_counts, train_mask
from aerialdojo_gen.pipeline.stages.work.split import key_of, nav_id, reference_id
from aerialdojo_gen.store import shards as store

SCENE, OTHER = "U_Courtyard_0", "U_Courtyard_1"
ENDS = ["start_object_id", "start_anchor_id", "target_object_id"]


def written(smoke, scene=SCENE, **values):
    """What `split` writes: tasks and routes of both sides, and the objects."""
    tables = split.run(job_of("split", smoke, scene), SplitConfig(**values)).tables
    sides = {
        name: pd.concat([tables[f"{name}/{side}"].to_pandas() for side in ("train", "test")])
        for name in ("tasks", "routes")
    }
    return sides["tasks"], sides["routes"], tables


@pytest.mark.pipeline
@pytest.mark.parametrize(("scene", "share"), [(SCENE, 0.8), (OTHER, 0.2)])
def test_train_share_and_both_instances_on_one_side(smoke, scene, share):
    """Of a scene that is out of distribution a fifth trains."""
    tasks, routes, tables = written(smoke, scene)
    train = set(tables["tasks/train"]["nav_id"].to_pylist())
    assert train == set(tables["routes/train"]["nav_id"].to_pylist())
    assert not train & set(tables["tasks/test"]["nav_id"].to_pylist())
    assert set(tasks["subset"][tasks["nav_id"].isin(train)]) == {"train"}
    for _, own in routes.groupby("setting"):
        assert own["nav_id"].isin(train).sum() == int(share * len(own) + 0.5)


@pytest.mark.pipeline
def test_rules_keep_by_each_candidates_own_figures(smoke):
    pairs, plans = (
        store.read_scene(smoke, name, SCENE).to_pandas().set_index("pair_id") for name in ("pairs", "plans")
    )
    figures = pairs[["euclidean_m", "target_visible_at_start"]].join(plans[["length_m", "plan_detour"]])

    def kept(**rule):
        rows = filter_stage.run(job_of("filter", smoke, SCENE), FilterConfig(**rule)).tables["verdicts"].to_pandas()
        return set(rows["pair_id"][rows["keep"]])

    paper = figures.loc[sorted(kept())]
    assert (paper["length_m"] / paper["euclidean_m"]).min() >= 1.05
    hidden, detour = paper["target_visible_at_start"] <= 0.25, paper["plan_detour"] >= 1.05
    assert kept(max_visible_at_start=0.25) == set(paper.index[hidden])
    assert kept(min_plan_detour=1.05) == set(paper.index[detour])
    assert all(0 < chosen.sum() < len(paper) for chosen in (hidden, detour))


def test_ids_hang_on_the_salt_and_tell_no_pair():
    salted = ("a salt of one's own", 0), ("another of one's own", 0), (None, 0), (None, 1)
    keys = [key_of(*given) for given in salted]
    names = {nav_id("U_A_0", pair, key) for key in keys for pair in ("1_0__2", "2_0__1")}
    assert len(names) == 8
    assert all(re.fullmatch(r"U_A_0-[0-9a-f]{12}", name) for name in names)
    assert len({reference_id("U_A_0", 1, key) for key in keys}) == 4
    assert key_of("a salt of one's own", 0) == key_of("a salt of one's own", 1)


@pytest.mark.pipeline
def test_another_salt_renames_the_same_tasks(smoke):
    """Which candidates are released, and on which side, hangs on the pairs alone."""
    tables, others = written(smoke)[2], written(smoke, salt="nobody is to know this")[2]
    for side in ("routes/train", "routes/test"):
        ours, theirs = (t[side].to_pandas().sort_values(ENDS, ignore_index=True) for t in (tables, others))
        assert not set(ours["nav_id"]) & set(theirs["nav_id"])
        pd.testing.assert_frame_equal(ours.drop(columns="nav_id"), theirs.drop(columns="nav_id"))
    names = [set(t["release/objects"]["reference_image_id"].to_pylist()) for t in (tables, others)]
    assert not names[0] & names[1]


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
    ids = [f"t{i}" for i in range(60)]
    assert len({tuple(train_mask(ids, ["base"] * 60, {"base": 48}, k)) for k in (seed, seed + 1)}) == 2
