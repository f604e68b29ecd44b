"""Choosing before searching, on made-up scenes whose true lengths scatter about the predicted ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerialdojo_gen.base.config.sections import FilterConfig, QuotaConfig
from aerialdojo_gen.base.paper_figures import PaperScene
from aerialdojo_gen.pipeline.stages.work.candidate_policy import (
    Accepted,
    Candidates,
    PaperQuota,
    difficulty_level,
    select_quota,
)
from aerialdojo_gen.pipeline.stages.work.rules import judge
from aerialdojo_gen.planning.planner import Route

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
