"""Claims about instances: each is true of its own, comes back from JSON, and tells it from its like."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.annotation_scenes import box, street, street_vocabulary

from aerialdojo_gen.annotations.claims import KINDS, Claim, Mention, SceneClaims
from aerialdojo_gen.annotations.format import Landmark
from aerialdojo_gen.annotations.relations import DISTRACTOR_SLACK
from aerialdojo_gen.base.constants import DIRECTIONS

TOWER = Landmark(id=0, name="clock tower", node="clock_tower_000")


@pytest.fixture(scope="module")
def claims() -> SceneClaims:
    return SceneClaims(street_vocabulary(), [TOWER])


_word = st.text(min_size=1, max_size=8)
_things = st.builds(Mention, _word, _word, st.lists(_word, max_size=3).map(tuple), st.booleans())


@given(st.builds(Claim, st.sampled_from(KINDS), _word, st.lists(_things, max_size=2).map(tuple)))
def test_a_claim_comes_back_from_json(claim):
    assert Claim.from_json(claim.to_json()) == claim


@pytest.mark.parametrize(
    "raw",
    [
        None, [], {}, {"kind": "smell", "key": "bad"}, {"kind": "colour", "key": 3},
        {"kind": "relation", "key": "on", "things": [{}]}, {"kind": "relation", "key": "on", "things": 1},
        {"kind": "relation", "key": "on", "things": [{"node": "a", "noun": "b", "said": "red", "unique": True}]},
    ],
)  # fmt: skip
def test_what_is_no_claim_is_refused(raw):
    with pytest.raises(ValueError, match=r"of a claim|a claim has"):
        Claim.from_json(raw)


def test_all_claims_are_true_and_fit_with_slack_as_well(claims):
    for i, instance in enumerate(claims.scene.instances):
        for claim in claims.of(i) if instance.category != "ground" else ():
            assert claims.holds(claim, i), (instance.node, claim)
            assert claims.holds(claim, i, DISTRACTOR_SLACK), (instance.node, claim)


def test_claims_say_colour_place_relation_and_direction(claims):
    own = claims.of(claims.geometry.index["delivery_van_000"])
    mailbox = Mention("mailbox_000", "mailbox", ("yellow",), True)
    assert {Claim("colour", "red"), Claim("relation", "beside", (mailbox,))} <= set(own)
    assert Claim("direction", "northeast", (Mention("clock_tower_000", "clock tower", (), True),)) in own
    assert Claim("relation", "south of", (mailbox,)) in own


def test_only_claims_that_differ_tell_twins_apart(claims):
    first, second, blue = (claims.geometry.index[f"delivery_van_00{k}"] for k in range(3))
    own = {c.key: c for c in claims.of(first)}
    assert claims.candidates(first) == [second, blue]
    assert claims.distractors(first, []) == [second, blue]
    assert claims.distractors(first, [own["red"]]) == [second]
    assert claims.distractors(first, [own["red"], own["beside"]]) == []
    plain = Claim("relation", "beside", (Mention("bench_000", "bench"),))
    assert claims.holds(plain, second)
    assert not claims.holds(plain, first)


def test_a_relation_holds_to_any_thing_that_the_words_fit(claims):
    second = claims.geometry.index["delivery_van_001"]
    lamp = claims.scene["street_lamp_000"].node
    # The lamp by the second van is not the one that is meant, but is called the same.
    assert claims.holds(Claim("relation", "beside", (Mention("elsewhere", "street lamp"),)), second)
    assert claims.holds(Claim("relation", "beside", (Mention(lamp, "lamp"),)), second)
    assert not claims.holds(Claim("relation", "beside", (Mention(lamp, "tree"),)), second)


def test_near_a_border_nothing_is_said(claims):
    scene = street()
    angle = np.radians(22.5 + 4.0)
    edge = box("bench_001", (8 * np.cos(angle), 8 * np.sin(angle), 0), (1, 1, 1))
    extended = type(scene)(scene.name, (*scene.instances, edge), scene.materials, scene.bounds)
    own = SceneClaims(street_vocabulary(extended), [TOWER])
    i = own.geometry.index["bench_001"]
    said = [c for c in own.of(i) if c.kind == "direction" or c.key.removesuffix(" of") in DIRECTIONS]
    assert own.bearings[i].direction == "northeast"
    assert said == []
