"""The geometric scorer, and how scorers are weighed."""

import math
from dataclasses import asdict, replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.handmade import box, instance, job_of
from support.two_coloured import EMBODIMENT, POST, item_of, part, plain_view, sign, world_of, yard

from aerialdojo_gen.base.config.sections import AnchorSampleConfig, ScorerWeights
from aerialdojo_gen.base.errors import ConfigError
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.pipeline.scoring.base import AnchorView, CandidateMeasures
from aerialdojo_gen.pipeline.scoring.ensemble import ScorerEnsemble, scorer_ensemble
from aerialdojo_gen.pipeline.scoring.geometric import WEIGHTS, Parts, front_score, judge, part_score
from aerialdojo_gen.pipeline.stages.work.anchor_sample import anchors_of
from aerialdojo_gen.pipeline.stages.work.anchor_world import Candidates
from aerialdojo_gen.rendering.backend import check_renderer, open_renderer, probe_scene
from aerialdojo_gen.rendering.raycast import RayRenderer
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.store.schemas import VIEWS

CONFIG = AnchorSampleConfig()
BLANK = Parts(*[0.0] * len(WEIGHTS))
RADIUS = EMBODIMENT.radius_m


def all_terms(place, thing, *poses):
    """Terms of the views from (x, y, z, yaw), candidates of one object."""
    world = world_of(place)
    points = Surface.of(thing).sample(400, np.random.default_rng(0))
    at = np.array(poses)
    found = Candidates(world, world.index[thing.node], points, at[:, :3], at[:, 3], RADIUS, CONFIG)
    return [judge(found.picture(k, 128), RADIUS, CONFIG.standoff_m) for k in range(len(poses))]


def terms(place, thing, position, yaw):
    return all_terms(place, thing, (*position, yaw))[0]


def test_the_ray_renderer_passes_the_check_of_renderers():
    with RayRenderer(probe_scene()) as renderer:
        assert "at 100.00 % of 147,456 pixels" in check_renderer(renderer)


def test_the_ray_renderer_draws_what_the_others_draw():
    scene, camera = probe_scene(), Camera(160, 160, 90.0)
    with open_renderer(scene, "pybullet") as other, RayRenderer(scene) as renderer:
        for view in VIEWS:
            pose = view_pose((-1.3, 0.4, 2.6), 0.35, view)
            theirs, ours = other.render(camera, pose), renderer.render(camera, pose)
            # It draws no clouds: the sky is another one.
            away = np.abs(theirs.rgb.astype(int) - ours.rgb).max(axis=-1)[ours.instance >= 0]
            # Where nothing shades, and away from edges, the two differ by rounding.
            assert np.median(away) <= 1, view
            assert (away <= 3).mean() > 0.7, view


def test_unoccluded_is_the_share_that_a_board_leaves():
    panel_ = instance("panel", box((-0.05, -0.9, 0.0), (0.05, 0.9, 1.8)))
    board = instance("board", box((0.1, -4.0, 0.0), (0.12, 4.0, 0.9)))
    eye = (1.05, 0.0, 0.9)
    assert terms(yard(panel_), panel_, eye, math.pi).unoccluded == 1.0
    assert terms(yard(panel_, board), panel_, eye, math.pi).unoccluded == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("term", ["unoccluded", "open", "framed"])
def test_what_hides_an_object_costs_more_than_its_weight(term):
    steps = (0.9, 0.7, 0.5)
    parts = Parts(**dict.fromkeys(WEIGHTS, 1.0))
    assert parts.score == pytest.approx(1.0)
    scores = [1.0, *(replace(parts, **{term: value}).score for value in steps)]
    for value, score in zip(steps, scores[1:], strict=True):
        assert score < 1.0 - WEIGHTS.get(term, 0.0) * (1.0 - value) - 0.02
    assert scores == sorted(scores, reverse=True)


def test_clear_is_the_room_beyond_the_body():
    standoff = CONFIG.standoff_m
    for clearance, mark in ((0.0, 0.0), (RADIUS, 0.0), ((RADIUS + standoff) / 2, 0.5), (standoff, 1.0), (9.0, 1.0)):
        view = replace(plain_view((1, 2, 3)), measures=CandidateMeasures(1.0, 0.0, clearance))
        assert judge(view, RADIUS, standoff).clear == pytest.approx(mark)


def test_a_view_off_the_front_or_of_half_of_what_tells_is_worth_little():
    off = np.radians([0.0, 25.0, 42.5, 60.0, 60.1, 120.0, 180.0])
    assert front_score(off) == pytest.approx([1.0, 1.0, 0.75, 0.5, 0.15, 0.0, 0.0], abs=1e-3)
    assert part_score(np.array([[1.0, 1.0], [1.0, 0.0], [0.4, 0.8]])) == pytest.approx([1.0, 0.25, 0.5])


def test_open_is_what_stands_nearer_and_no_floor():
    cabinet = instance("cabinet", box((-0.4, -0.4, 0.0), (0.4, 0.4, 1.8)))
    trolley = instance("trolley", box((1.6, -1.0, 0.0), (2.4, -0.3, 0.8)))
    eye = (3.4, 0.0, 0.9)
    alone, beside = (terms(yard(cabinet, *more), cabinet, eye, math.pi) for more in ((), (trolley,)))
    # The ground between is nearer as well, and hinders nobody.
    assert alone.open == 1.0
    assert beside.open < 0.95
    assert beside.score < alone.score
    assert terms(yard(cabinet, trolley), cabinet, (-3.4, 0.0, 0.9), 0.0).open == 1.0


def test_what_the_edge_cuts_off_is_not_framed():
    cabinet = instance("cabinet", box((-0.4, -0.4, 0.0), (0.4, 0.4, 1.8)))
    whole, cut = all_terms(yard(cabinet), cabinet, (2.4, 0.0, 0.9, math.pi), (2.4, 0.0, 0.9, math.pi + math.pi / 4))
    assert whole.framed == 1.0
    assert 0.1 < cut.framed < 0.9


def test_a_sign_is_better_from_the_front_than_from_its_edge():
    thing = sign()
    front, edge = all_terms(yard(thing), thing, (1.02, 0.0, 1.1, math.pi), (0.0, 2.0, 1.1, -math.pi / 2))
    assert front.score > edge.score + 0.1
    assert front.shown > 1.5 * edge.shown
    assert front.size > edge.size


def test_contrast_is_the_colour_and_not_the_light():
    cube = ((-0.4, -0.4, 0.0), (0.4, 0.4, 0.8))
    grey = instance("cube", box(*cube))
    orange = Instance("cube", "thing", "", {}, (part(*cube, "blue"),))
    eye = (1.4, 0.0, 0.9)
    plain, loud = (terms(yard(thing), thing, eye, math.pi) for thing in (grey, orange))
    assert loud.contrast > 0.8
    assert plain.contrast < 0.45
    assert (plain.unoccluded, plain.shown, plain.size) == pytest.approx((loud.unoccluded, loud.shown, loud.size))


def test_sky_is_what_stands_behind():
    lamp = instance("lamp", box((-0.15, -0.15, 5.0), (0.15, 0.15, 5.4)))
    wall = instance("wall", box((-1.0, -8.0, 0.0), (-0.8, 8.0, 11.0)))
    eye = (1.15, 0.0, 5.2)
    assert terms(yard(lamp), lamp, eye, math.pi).sky > 0.75
    assert terms(yard(lamp, wall), lamp, eye, math.pi).sky == 0.0


def test_what_is_not_in_the_picture_scores_next_to_nothing():
    away = terms(yard(POST), POST, (1.5, 0.0, 1.1), 0.0)
    assert (away.unoccluded, away.shown, away.size, away.centred, away.contrast) == (0.0,) * 5


masks = st.integers(0, 2**32 - 1)


@settings(max_examples=60, deadline=None)
@given(
    masks, st.floats(0, 1), st.floats(-90, 90), st.floats(0, 50), st.lists(st.floats(0, 1), max_size=3),
    st.none() | st.floats(0, math.pi),
)  # fmt: skip
def test_every_term_and_the_score_lie_in_the_unit_interval(seed, shown, elevation, clearance, told, off_front):
    rng = np.random.default_rng(seed)
    alone = rng.random((24, 24)) < rng.random()
    visible = alone & (rng.random((24, 24)) < rng.random())
    rgb = rng.integers(0, 256, (24, 24, 3), np.uint8)
    view = AnchorView(
        rgb, visible, alone, ~alone, CandidateMeasures(shown, elevation, clearance, tuple(told), off_front)
    )
    parts = judge(view, RADIUS, CONFIG.standoff_m)
    assert (parts.tells is None) == (not told)
    assert (parts.front is None) == (off_front is None)
    assert all(0.0 <= value <= 1.0 for value in asdict(parts).values() if value is not None)
    assert 0.0 <= parts.score <= 1.0
    # Whatever it shows, what hides or cuts it off, or a steep look, takes from it and adds nothing.
    weighed = sum(w * asdict(parts)[k] for k, w in WEIGHTS.items())
    if not told and off_front is None:
        assert parts.score <= weighed + 1e-9
        plain = replace(parts, unoccluded=1.0, level=1.0, framed=1.0, open=1.0)
        assert plain.score == pytest.approx(sum(w * asdict(plain)[k] for k, w in WEIGHTS.items()))


def test_rows_hold_the_scores_their_parts_and_a_thumbnail(tmp_path):
    rows, rejected, _ = anchors_of(
        item_of(POST, "post"), world_of(yard(POST)), job_of("anchor-sample", tmp_path), CONFIG
    )
    assert sum(rejected.values()) + len(rows) >= 24
    assert len(rows) == 3
    for row in rows:
        parts = Parts(**{name: row[f"part_{name}"] for name in asdict(BLANK)})
        assert row["score"] == row["score_geometric"] == pytest.approx(parts.score)
        assert row["score_clip"] is row["score_vlm"] is None
        picture = cv2.imdecode(np.frombuffer(row["thumbnail"], np.uint8), cv2.IMREAD_COLOR)
        assert picture.shape == (CONFIG.picture_px, CONFIG.picture_px, 3)
    north = min(rows, key=lambda r: abs(math.remainder(r["yaw_rad"] + math.pi / 2, 2 * math.pi)))
    picture = cv2.imdecode(np.frombuffer(north["thumbnail"], np.uint8), cv2.IMREAD_COLOR)[..., ::-1].astype(float)
    shows_red = bool((picture[..., 0] > 2 * picture[..., 1:].max(axis=-1)).mean() > 0.05)
    assert shows_red == (abs(math.remainder(north["yaw_rad"] + math.pi / 2, 2 * math.pi)) < math.radians(80))


def test_only_the_best_few_are_pictured(tmp_path, monkeypatch):
    taken = []
    picture = Candidates.picture
    monkeypatch.setattr(Candidates, "picture", lambda self, k, *a: taken.append(k) or picture(self, k, *a))
    config = AnchorSampleConfig(pictured=5)
    rows, rejected, _ = anchors_of(
        item_of(POST, "post"), world_of(yard(POST)), job_of("anchor-sample", tmp_path), config
    )
    # Fewer where no other can be chosen any more.
    assert 1 <= len(taken) == len(set(taken)) <= 5
    assert rejected["not_shortlisted"] > 20
    assert len(rows) == 3


class Opinion:
    """A scorer that says what it is told to."""

    def __init__(self, name, scores):
        self.name, self._scores = name, scores

    def score(self, name, views):
        return self._scores


def test_the_panel_weighs_those_that_have_an_opinion():
    judges = ScorerEnsemble(AnchorSampleConfig(), RADIUS)
    judges._weighted = [(3.0, Opinion("geometric", [0.2, 0.4, 0.9])), (1.0, Opinion("vlm", [1.0, None, 0.0]))]
    verdicts = judges.judge("post", [plain_view((1, 2, 3))] * 3)
    assert [v.score for v in verdicts] == pytest.approx([0.4, 0.4, 0.675])
    assert [v.parts["score_vlm"] for v in verdicts] == [1.0, None, 0.0]
    assert [v.parts["score_clip"] for v in verdicts] == [None] * 3
    assert judges.judge("post", []) == []


@pytest.mark.parametrize(
    ("weights", "said"), [({"clip": 1.0}, "anchor-sample.clip"), ({"vlm": 0.5}, "anchor-sample.vlm")]
)
def test_a_scorer_without_its_section_is_named(weights, said):
    with pytest.raises(ConfigError, match=said):
        scorer_ensemble(AnchorSampleConfig(weights=ScorerWeights(**weights)), RADIUS)
