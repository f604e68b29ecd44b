"""Reading descriptions, relations computed from meshes, and the check that no description fits two things."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.annotation_scenes import GOOD, box, street, street_vocabulary

from aerialdojo_gen.annotations.bearings import BORDER_DEG, lies_towards, nearest_landmark
from aerialdojo_gen.annotations.claims import Claim, Mention, SceneClaims
from aerialdojo_gen.annotations.format import Landmark
from aerialdojo_gen.annotations.matching import Matcher
from aerialdojo_gen.annotations.relations import SceneGeometry
from aerialdojo_gen.store.schemas import DIRECTIONS

TOWER = Landmark(id=0, name="clock tower", node="clock_tower_000")


class _Street:
    """The street's claims, and what texts about it are matched to."""

    def __init__(self, scene=None):
        self.claims = SceneClaims(street_vocabulary(scene), [TOWER])
        self.matcher = Matcher(self.claims)

    def faults(self, node, text):
        return self.matcher.faults(self.claims.geometry.index[node], text)

    def fits(self, node, text):
        i = self.claims.geometry.index[node]
        others = self.claims.distractors(i, self.matcher.true_claims(i, text))
        return {self.claims.scene.instances[j].node for j in others}


@pytest.fixture(scope="module")
def on_street():
    return _Street()


@pytest.mark.parametrize("node", sorted(GOOD))
def test_good_descriptions_are_true_and_fit_nothing_else(on_street, node):
    assert on_street.faults(node, GOOD[node]) == []
    assert on_street.fits(node, GOOD[node]) == set()


@pytest.mark.parametrize(
    ("text", "fits"),
    [
        ("A delivery van.", {"delivery_van_001", "delivery_van_002"}),
        ("A red delivery van.", {"delivery_van_001"}),
        ("A red delivery van in the yard, north-east of here.", {"delivery_van_001"}),
        ("A delivery van with big wheels. It is red.", {"delivery_van_001"}),
        ("A delivery van beside a yellow mailbox.", set()),
        ("A delivery van with a mailbox to be seen somewhere.", {"delivery_van_001", "delivery_van_002"}),
        ("A delivery van that stands south of a yellow mailbox.", set()),
        ("A delivery van northeast of the clock tower.", {"delivery_van_001", "delivery_van_002"}),
    ],
)
def test_planted_ambiguities_are_found(on_street, text, fits):
    assert on_street.fits("delivery_van_000", text) == fits


def test_a_rival_that_is_almost_as_near_counts():
    scene = street()
    # 3.4 m from the second van: too far to be said "beside", near enough to be taken for it.
    extra = box("mailbox_002", (40, 40 - 1 - 3.4 - 0.3, 0), (0.6, 0.6, 1.2), colour="yellow")
    wider = _Street(dataclasses.replace(scene, instances=(*scene.instances, extra)))
    text = GOOD["delivery_van_000"]
    assert wider.fits("delivery_van_000", text) == {"delivery_van_001"}
    assert wider.faults("delivery_van_001", text) != []


@pytest.mark.parametrize(
    ("node", "text"),
    [
        ("delivery_van_000", "A blue delivery van in the yard."),
        ("delivery_van_000", "A red delivery van beside a bench."),
        ("delivery_van_000", "A red delivery van beside a red mailbox."),
        ("delivery_van_000", "A red delivery van on the north side of a mailbox."),
        ("delivery_van_000", "A red delivery van under the canopy."),
        ("delivery_van_000", "A red delivery van to the east of the clock tower."),
        ("mailbox_001", "A red mailbox on the canopy."),
        ("mailbox_001", "A red bench under the canopy."),
        ("delivery_van_001", "A red delivery van between the bench and the clock tower."),
    ],
)
def test_untruths_are_found(on_street, node, text):
    assert len(on_street.faults(node, text)) == 1


def test_colours_of_other_things_are_not_the_subjects(on_street):
    i = on_street.claims.geometry.index["delivery_van_000"]
    matched = on_street.matcher.read("In the yard, next to a yellow mailbox, stands a red delivery van.", i)
    mailbox = Mention("", "mailbox", ("yellow",))
    assert set(matched.claims) == {
        Claim("place", "in the yard"), Claim("colour", "red"), Claim("relation", "beside", (mailbox,)),
    }  # fmt: skip
    assert on_street.claims.fitting(mailbox) == {on_street.claims.geometry.index["mailbox_000"]}


def test_vertical_relations():
    g = SceneGeometry(street())
    mailbox, canopy, ground = (g.index[n] for n in ("mailbox_001", "canopy_000", "ground_000"))
    assert g.under(mailbox, canopy)
    assert g.above(canopy, mailbox)
    assert not g.beside(mailbox, canopy)
    assert g.support(mailbox) == ground
    assert g.support(canopy) is None


_spot = st.tuples(st.floats(-30, 30), st.floats(-30, 30))


@given(_spot, _spot)
def test_relations_grow_with_slack_and_near_is_mutual(a, b):
    scene = dataclasses.replace(
        street(), instances=(box("bench_000", (*a, 0), (2, 0.6, 0.8)), box("mailbox_000", (*b, 0), (0.6, 0.6, 1.2)))
    )
    g = SceneGeometry(scene)
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
    assert bearing is not None
    assert bearing.landmark == 0
    assert nearest_landmark(np.array([1.0, 1.0]), np.array([[1.0, 1.0]])) is None
    assert nearest_landmark(np.array([1.0, 1.0]), np.zeros((0, 2))) is None


def test_boxes_reject_no_pair_that_outlines_would_not():
    geometry = SceneGeometry(street())
    some = range(len(geometry.boxes))
    reaches = (0.5, 3.0, 8.0, 20.0)
    found = [(geometry._within(i, j, r), geometry.gap_m(i, j) <= r) for i in some for j in some for r in reaches]
    assert all(told == true for told, true in found)
    assert {told for told, _ in found} == {True, False}


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
