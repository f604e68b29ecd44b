"""The metrics on tables of episodes that were computed by hand."""

import math

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark import metrics
from aerialdojo_gen.benchmark.metrics import PROFILES, episodes_of, outcomes, profile_named, summarize
from aerialdojo_gen.store.schemas import FAMILIES

AT_3, AT_5 = PROFILES["aerialdojo"], PROFILES["aerialdojo-5m"]

# A success: Stop 2 m from the anchor after 12 m, where the reference takes 10 m.
GOOD = {
    "scene": "U_Mall_0", "family": "Urban", "scene_type": "Mall", "partition": "ID", "setting": "base",
    "modality": "semantic",
    "stop_called": True, "collision": False, "n_actions": 9, "action_budget": 90,
    "final_distance_m": 2.0, "min_distance_m": 1.5, "final_horizontal_distance_m": 1.0,
    "min_horizontal_distance_m": 0.5, "path_length_m": 12.0, "reference_length_m": 10.0, "euclidean_m": 9.0,
    "viewpoint_distance_m": 2.0, "target_in_sight": True,
}  # fmt: skip
NO_STOP = {"stop_called": False}


def log(*rows):
    return episodes_of(pa.Table.from_pylist([GOOD | row for row in rows]))


NO_VIEW = {"viewpoint_distance_m": None, "target_in_sight": None}  # Of a release without viewpoints


def test_a_rate_with_a_hole_in_it_is_not_known():
    overall = summarize(log({}, NO_VIEW), AT_3).overall
    assert math.isnan(overall.sr_view)
    assert overall.sr == 1.0
    without = pa.Table.from_pylist([GOOD]).drop_columns(list(NO_VIEW))
    assert math.isnan(summarize(episodes_of(without), AT_3).overall.sr_view)


def test_scenes_average_to_families_and_families_to_the_overall_score():
    miss = {"final_distance_m": 10.0, "min_distance_m": 6.0, "stop_called": False, "n_actions": 90}
    crash = {"final_distance_m": 7.0, "min_distance_m": 2.0, "stop_called": False, "collision": True}
    episodes = log(
        # U_Mall_0: 1 of 2; U_Park_1: 1 of 1, so that Urban is 0.75 and not 2 of 3.
        {}, miss, {"scene": "U_Park_1", "path_length_m": 10.0},
        # N_Desert_0: none of 1, but it was there.
        crash | {"scene": "N_Desert_0", "family": "Natural"},
        {"scene": "I_Harbor_0", "family": "Infrastructure", "path_length_m": 20.0},
        miss | {"scene": "D_Flood_1", "family": "Disaster"},
    )  # fmt: skip
    summary = summarize(episodes, AT_3)
    assert list(summary.families) == ["Urban", "Natural", "Infrastructure", "Disaster"]
    mall, urban = summary.scenes["U_Mall_0"], summary.families["Urban"]
    assert (mall.episodes, mall.sr, mall.osr, mall.spl, mall.dts_m, mall.cr) == (2, 0.5, 0.5, 5 / 12, 6.0, 0.0)
    assert (urban.episodes, urban.sr, urban.osr, urban.dts_m) == (3, 0.75, 0.75, 4.0)
    assert urban.spl == pytest.approx((5 / 12 + 1.0) / 2, abs=1e-15)
    overall = summary.overall
    assert overall.episodes == 6
    assert overall.sr == (0.75 + 0.0 + 1.0 + 0.0) / 4
    assert overall.osr == (0.75 + 1.0 + 1.0 + 0.0) / 4
    assert overall.spl == pytest.approx(((5 / 12 + 1.0) / 2 + 0.5) / 4, abs=1e-15)
    assert overall.dts_m == (4.0 + 7.0 + 2.0 + 10.0) / 4
    assert overall.cr == 0.25
    # Over the five scenes: SR 0.5, 1, 0, 1, 0 has mean 0.5 and squared deviations 0, ¼, ¼, ¼, ¼.
    assert summary.deviation.sr == pytest.approx(math.sqrt(1.0 / 4), abs=1e-15)


def test_one_scene_has_no_deviation_and_one_family_and_an_empty_log_no_score():
    episodes = log({}, {})
    summary = summarize(episodes, AT_3)
    assert math.isnan(summary.deviation.sr)
    assert list(summary.families) == ["Urban"]
    assert summary.overall.sr == 1.0
    empty = summarize(episodes[:0], AT_3)
    assert (empty.scenes, math.isnan(empty.overall.sr)) == ({}, True)


def test_each_rule_sees_a_flight_its_own_way():
    far = {
        "final_distance_m": 18.0, "min_distance_m": 16.0, "final_horizontal_distance_m": 13.0,
        "min_horizontal_distance_m": 13.0,
    }  # fmt: skip
    high = far | {"final_distance_m": 25.0, "min_distance_m": 25.0}
    rows = log({"final_distance_m": 4.5, "min_distance_m": 4.0}, far, far | NO_STOP, far | {"collision": True}, high)
    assert {name: outcomes(rows, profile).sr.tolist() for name, profile in PROFILES.items()} == {
        "aerialdojo": [False, False, False, False, False], "aerialdojo-5m": [True, False, False, False, False],
        "uav-on": [True, True, False, False, False], "aerialvln": [True, True, False, False, True],
        "openfly": [True, True, True, True, False],
    }  # fmt: skip
    assert outcomes(rows, profile_named("openfly")).spl[1] == 9 / 12, "against the straight distance"


def test_an_unknown_rule_is_named():
    with pytest.raises(UsageError, match=r"no profile 'uavon': did you mean 'uav-on'"):
        profile_named("uavon")


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"path_length_m": -1.0}, "path_length_m has values that are no length"),
        ({"final_distance_m": math.nan}, "final_distance_m has values that are no length"),
        ({"min_distance_m": 2.5}, "a smallest distance exceeds the last one"),
    ],
)
def test_a_log_that_contradicts_itself_is_refused(row, message):
    with pytest.raises(StoreError, match=message):
        log(row)


# Success radii, of which each is inside, are likely; so are routes and flights without length.
lengths = st.sampled_from([0.0, 3.0, 5.0, 10.0, 20.0]) | st.floats(0.0, 60.0)


@st.composite
def rows(draw):
    letter = draw(st.sampled_from("UNID"))
    final, flat = draw(lengths), draw(lengths)
    return {
        "scene": f"{letter}_Scene_{draw(st.integers(0, 2))}", "family": FAMILIES[letter],
        "stop_called": draw(st.booleans()), "collision": draw(st.booleans()),
        "n_actions": draw(st.integers(1, 88) | st.sampled_from([89, 90, 91])), "final_distance_m": final,
        "min_distance_m": final * draw(st.floats(0.0, 1.0)), "final_horizontal_distance_m": flat,
        "min_horizontal_distance_m": flat * draw(st.floats(0.0, 1.0)), "path_length_m": draw(lengths),
        "reference_length_m": draw(lengths), "euclidean_m": draw(lengths),
        "viewpoint_distance_m": final * draw(st.floats(0.0, 1.0)), "target_in_sight": draw(st.booleans()),
    }  # fmt: skip


def by_the_paper(row, profile):
    """SR, SR-view, OSR and SPL of one episode, word by word."""
    end, least = (row[f"{when}_{'horizontal_' * profile.planar}distance_m"] for when in ("final", "min"))
    counts = row["n_actions"] <= row["action_budget"]
    counts = counts and (row["stop_called"] or not profile.needs_stop)
    counts = counts and not (row["collision"] and profile.fails_on_collision)
    success = counts and end <= profile.radius_m
    route = row["euclidean_m" if profile.straight_reference else "reference_length_m"]
    longer = max(route, row["path_length_m"])
    known = row["target_in_sight"] is not None and not profile.planar
    sees = counts and known and row["target_in_sight"] and row["viewpoint_distance_m"] <= profile.radius_m
    # Nothing to fly and nothing flown is perfect.
    spl = float(success) * (route / longer if longer else 1.0)
    return success, float(sees) if known else math.nan, least <= profile.radius_m, spl


@given(rows(), st.booleans(), st.sampled_from(list(PROFILES.values())))
@example(GOOD, True, AT_3)
@example(GOOD | {"final_distance_m": 3.01}, True, AT_3)  # Stop outside; it was inside once
@example(GOOD | {"collision": True}, True, AT_3)  # Stop and collision in one step
@example(GOOD | {"viewpoint_distance_m": 3.0, "final_distance_m": 9.0}, True, AT_3)  # Near another viewpoint
@settings(max_examples=200)
def test_outcomes_are_those_of_the_paper_and_of_the_other_rules(row, viewed, profile):
    row = GOOD | row | ({} if viewed else NO_VIEW)
    found = outcomes(log(row), profile)
    assert [found.sr[0], found.sr_view[0], found.osr[0], found.spl[0]] == pytest.approx(
        by_the_paper(row, profile), nan_ok=True, abs=1e-12
    )


@given(st.lists(rows(), min_size=1, max_size=25), st.sampled_from(list(PROFILES.values())))
def test_scores_are_bounded_and_ordered(drawn, profile):
    episodes = log(*drawn)
    summary = summarize(episodes, profile)
    for scored in (*summary.scenes.values(), *summary.families.values(), summary.overall):
        assert 0.0 <= scored.spl <= scored.sr <= scored.osr <= 1.0
        assert 0.0 <= scored.cr <= 1.0
        assert scored.dts_m >= 0.0
        if profile.fails_on_collision:
            assert scored.sr + scored.cr <= 1.0 + 1e-12
        assert math.isnan(scored.sr_view) if profile.planar else 0.0 <= scored.sr_view <= 1.0
    # A goal is a viewpoint of its target: who succeeds and sees it succeeds so too.
    judged = outcomes(episodes, profile)
    sees = np.isfinite(episodes["view_distance_m"])
    if not profile.planar:
        assert (judged.sr_view[judged.sr & sees] == 1.0).all()
        assert not judged.sr_view[~sees].any()
    assert sum(s.episodes for s in summary.scenes.values()) == len(drawn) == summary.overall.episodes
    np.testing.assert_equal(summarize(log(*drawn[::-1]), profile).overall, summary.overall)  # In any order


@given(st.lists(rows(), min_size=1, max_size=25), st.sampled_from(list(PROFILES.values())))
def test_the_curve_never_falls_and_meets_the_summary(drawn, profile):
    episodes = log(*drawn)
    radii = np.array([0.0, 1.0, profile.radius_m, 30.0, 60.0, np.inf])
    radii.sort()
    sr, osr = metrics.success_curve(episodes, profile, radii)
    assert (np.diff([sr, osr]) >= 0).all()
    assert (sr <= osr + 1e-12).all()
    assert osr[-1] == pytest.approx(1.0)
    here = int(np.searchsorted(radii, profile.radius_m))
    overall = summarize(episodes, profile).overall
    assert (sr[here], osr[here]) == (pytest.approx(overall.sr), pytest.approx(overall.osr))
