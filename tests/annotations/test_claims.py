"""Claims and relations of instances, computed from the mesh: each is true of its own, and tells it from its like."""

from __future__ import annotations

import dataclasses
import json
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import handmade
from support.annotation_scenes import box, street, street_vocabulary

from aerialdojo_gen.annotations.claims import Claim, Kind, Mention, SceneClaims, claims_from_json
from aerialdojo_gen.annotations.format import Landmark
from aerialdojo_gen.annotations.relations import (
    BORDER_DEG,
    DISTRACTOR_SLACK,
    SceneGeometry,
    lies_towards,
    nearest_landmark,
)
from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.base.rng import generator

TOWER = Landmark(id=0, name="clock tower", node="clock_tower_000")


@pytest.fixture(scope="module")
def claims() -> SceneClaims:
    return SceneClaims(street_vocabulary(), [TOWER])


_word = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=8)
_things = st.builds(Mention, _word, _word, st.lists(_word, max_size=3).map(tuple), st.booleans())


@settings(max_examples=25)
@given(st.lists(st.builds(Claim, st.sampled_from(get_args(Kind)), _word, st.lists(_things, max_size=2).map(tuple))))
def test_claims_come_back_from_json(claims):
    assert claims_from_json(json.dumps([claim.to_json() for claim in claims])) == claims


@pytest.mark.parametrize(
    "raw",
    [
        None, [], {}, {"kind": "smell", "key": "bad"}, {"kind": "colour", "key": 3},
        {"kind": "relation", "key": "on", "things": [{}]}, {"kind": "relation", "key": "on", "things": 1},
        {"kind": "relation", "key": "on", "things": [{"node": "a", "noun": "b", "said": "red", "unique": True}]},
        {"kind": "relation", "key": "on", "things": [{"node": "a", "noun": "b", "unique": True}]},
    ],
)  # fmt: skip
def test_what_is_no_claim_is_refused(raw):
    with pytest.raises(ValueError, match="validation error"):
        claims_from_json(json.dumps([raw]))


def test_all_claims_are_true_and_fit_with_slack_as_well(claims):
    for i, instance in enumerate(claims.scene.instances):
        for claim in claims.of(i) if instance.category != "ground" else ():
            assert claims.holds(claim, i), (instance.node, claim)
            assert claims.holds(claim, i, DISTRACTOR_SLACK), (instance.node, claim)


def test_claims_say_colour_place_relation_and_direction_and_those_that_differ_tell_twins_apart(claims):
    first, second, blue = (claims.geometry.index[f"delivery_van_00{k}"] for k in range(3))
    mailbox = Mention("mailbox_000", "mailbox", ("yellow",), True)
    own = {claim.key: claim for claim in claims.of(first)}
    assert own["red"] == Claim("colour", "red")
    assert own["beside"] == Claim("relation", "beside", (mailbox,))
    assert own["northeast"] == Claim("direction", "northeast", (Mention("clock_tower_000", "clock tower", (), True),))
    assert own["south of"] == Claim("relation", "south of", (mailbox,))
    assert claims.candidates(first) == claims.distractors(first, []) == [second, blue]
    assert claims.distractors(first, [own["red"]]) == [second]
    assert claims.distractors(first, [own["red"], own["beside"]]) == []


def test_a_relation_holds_to_any_thing_that_the_words_fit(claims):
    first, second = (claims.geometry.index[f"delivery_van_00{k}"] for k in range(2))
    # The lamp by the second van is not the one that is meant, but is called the same.
    for node, noun, so in (
        ("elsewhere", "street lamp", True), ("street_lamp_000", "lamp", True), ("street_lamp_000", "tree", False),
    ):  # fmt: skip
        assert claims.holds(Claim("relation", "beside", (Mention(node, noun, (), False),)), second) is so
    plain = Claim("relation", "beside", (Mention("bench_000", "bench", (), False),))
    assert claims.holds(plain, second)
    assert not claims.holds(plain, first)


def test_near_a_border_nothing_is_said():
    angle = np.radians(22.5 + 4.0)
    edge = box("bench_001", (8 * np.cos(angle), 8 * np.sin(angle), 0), (1, 1, 1))
    scene = dataclasses.replace(street(), instances=(*street().instances, edge))
    own = SceneClaims(street_vocabulary(scene), [TOWER])
    i = own.geometry.index["bench_001"]
    assert own.bearings[i].direction == "northeast"
    assert [c for c in own.of(i) if c.kind == "direction" or c.key.removesuffix(" of") in DIRECTIONS] == []


# ---- relations ----


def test_vertical_relations():
    g = SceneGeometry(street())
    mailbox, canopy, ground = (g.index[n] for n in ("mailbox_001", "canopy_000", "ground_000"))
    assert g.under(mailbox, canopy)
    assert g.above(canopy, mailbox)
    assert not g.beside(mailbox, canopy)
    assert g.support(mailbox) == ground
    assert g.support(canopy) is None


def test_in_front_and_behind_ask_for_the_front_that_a_thing_has(catalogue):
    sign = catalogue.instantiate("stop_sign", "stop_sign_000", generator(0, "test", "front"), yaw_deg=0.0)
    (front,) = sign.anatomy.fronts_rad
    assert front == pytest.approx(0.0)
    before, after = (box(f"bench_{k:03d}", (x, 0, 0), (1, 1, 1)) for k, x in enumerate((2.5, -2.5)))
    g = SceneGeometry(dataclasses.replace(street(), instances=(sign, before, after)))
    assert [g.front(1, 0), g.behind(2, 0), g.front(2, 0), g.behind(1, 0)] == [True, True, False, False]


_spot = st.tuples(st.floats(-30, 30), st.floats(-30, 30))


@given(_spot, _spot)
def test_relations_grow_with_slack_and_near_is_mutual(a, b):
    pair = box("bench_000", (*a, 0), (2, 0.6, 0.8)), box("mailbox_000", (*b, 0), (0.6, 0.6, 1.2))
    g = SceneGeometry(dataclasses.replace(street(), instances=pair))
    assert g.near(0, 1) == g.near(1, 0)
    assert g.gap_m(0, 1) == pytest.approx(g.gap_m(1, 0), abs=1e-9)
    for relation in (g.near, g.beside):
        assert not relation(0, 1) or relation(0, 1, 1.35)
    sides = [d for d in DIRECTIONS if g.side(0, 1, d)]
    assert len(sides) <= 2
    assert all(g.side(0, 1, d, 1.35) for d in sides)


@given(st.lists(_spot, min_size=1, max_size=6), _spot)
def test_nearest_landmark_is_nearest_and_its_direction_is_the_octant_from_there(places, here):
    bearing = nearest_landmark(np.array(here), np.array(places))
    offsets = np.array(here) - np.array(places)
    away = np.hypot(*offsets.T)
    if bearing is None:
        assert away.min() < 1e-3
        return
    assert away[bearing.landmark] <= away.min() + 1e-3
    dx, dy = offsets[bearing.landmark]
    degrees = np.degrees(np.arctan2(dy, dx)) % 360.0
    off = (degrees - 45.0 * DIRECTIONS.index(bearing.direction) + 180.0) % 360.0 - 180.0
    assert abs(off) <= 22.5 + 1e-9
    assert bearing.clear == (abs(off) <= 22.5 - BORDER_DEG) or abs(abs(off) - 22.5 + BORDER_DEG) < 1e-9
    assert [d for d in DIRECTIONS if lies_towards((dx, dy), d, 22.4999)] in ([bearing.direction], [])


def test_the_first_of_equally_near_landmarks_is_taken():
    bearing = nearest_landmark(np.array([0.0, 0.0]), np.array([[3.0, 4.0], [5.0, 0.0], [0.0, -5.0]]))
    assert bearing.landmark == 0
    assert nearest_landmark(np.array([1.0, 1.0]), np.array([[1.0, 1.0]])) is None
    assert nearest_landmark(np.array([1.0, 1.0]), np.zeros((0, 2))) is None


def test_boxes_reject_no_pair_that_outlines_would_not():
    g = SceneGeometry(street())
    some = range(len(g.boxes))
    found = [(g._within(i, j, r), g.gap_m(i, j) <= r) for i in some for j in some for r in (0.5, 3.0, 8.0, 20.0)]
    assert all(told == true for told, true in found)
    assert {told for told, _ in found} == {True, False}


def test_what_stands_in_the_corner_of_a_large_thing_is_as_far_as_its_sides():
    arms = [handmade.box((0, 0, 0), (20, 1, 3)), handmade.box((0, 0, 0), (1, 20, 3))]
    wall, bins = handmade.instance("wall_000", *arms, category="wall"), box("bin_000", (8, 5, 0), (1, 1, 1))
    # The convex hull of the wall holds the bin; its outline does not.
    g = SceneGeometry(dataclasses.replace(street(), instances=(wall, bins)))
    assert g.gap_m(1, 0) == pytest.approx(3.5, abs=2e-3)
    assert g.near(1, 0)
    assert not g.beside(1, 0)


def test_heights_over_a_place_are_those_of_the_triangles_there():
    geometry = SceneGeometry(street())
    for i, (x, y, _) in enumerate(geometry.centres.tolist()):
        for j, instance in enumerate(geometry.scene.instances):
            a, b, c = np.moveaxis(instance.vertices[instance.faces], 1, 0)
            upright = np.abs(np.cross(b - a, c - a)[:, 2]) <= 1e-12
            basis = np.stack([b - a, c - a], axis=2)[~upright]
            u, v = np.linalg.solve(basis[:, :2], (np.array([x, y]) - a[~upright, :2])[:, :, None])[:, :, 0].T
            inside = (u >= 1e-9) & (v >= 1e-9) & (u + v <= 1 - 1e-9)
            edge = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
            z = a[~upright, 2] + u * basis[:, 2, 0] + v * basis[:, 2, 1]
            heights = np.sort(geometry._heights(j, x, y))
            assert inside.sum() <= len(heights) <= edge.sum(), (i, j)
            assert np.isin(heights.round(6), z[edge].round(6)).all()
            assert np.isin(z[inside].round(6), heights.round(6)).all()
