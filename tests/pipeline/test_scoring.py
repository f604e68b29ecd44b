"""The geometric scorer, those that ask a model (CLIP in ONNX files made here, a model behind a real HTTP server)."""

import base64
import json
import math
import re
import sys
from dataclasses import asdict, replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.handmade import box, instance, job_of
from support.llm_server import Say, serving
from support.tiny_clip import write_clip
from support.two_coloured import EMBODIMENT, POST, item_of, part, plain_view, redness, sign, world_of, yard

from aerialdojo_gen.base.config.sections import AnchorSampleConfig, ClipConfig, ScorerWeights, VlmConfig
from aerialdojo_gen.base.errors import AssetError, ConfigError, MissingPackage
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.pipeline.scoring.base import AnchorView, CandidateMeasures
from aerialdojo_gen.pipeline.scoring.clip import ClipScorer, digest
from aerialdojo_gen.pipeline.scoring.ensemble import ScorerEnsemble, scorer_ensemble
from aerialdojo_gen.pipeline.scoring.geometric import WEIGHTS, Parts, front_score, judge, part_score
from aerialdojo_gen.pipeline.scoring.vlm import VlmScorer, read_order
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


KEY = "sk-test-0123456789"
RED, GREY, BLUE = plain_view((220, 30, 30)), plain_view((128, 128, 128)), plain_view((30, 40, 210))


@pytest.fixture(scope="session")
def clip(tmp_path_factory):
    return write_clip(tmp_path_factory.mktemp("clip"))


def selected(config, name, folder):
    rows, *_ = anchors_of(item_of(POST, name), world_of(yard(POST)), job_of("anchor-sample", folder), config)
    assert rows[0]["selected"]
    return rows


def looks_south(row):
    return abs(math.remainder(row["yaw_rad"] + math.pi / 2, 2 * math.pi)) < math.radians(50)


def test_clips_scores_are_those_of_its_cosines(clip):
    scorer = ClipScorer(clip)
    pictures = np.stack([view.rgb for view in (RED, GREY, BLUE)])
    mean, std = np.array([0.48145466, 0.4578275, 0.40821073]), np.array([0.26862954, 0.26130258, 0.27577711])
    embedded = (pictures.reshape(3, -1, 3).mean(axis=1) / 255.0 - mean) / std
    red = np.array([1.0, -0.5, -0.5])
    cosine = embedded @ red / np.linalg.norm(embedded, axis=1) / np.linalg.norm(red)
    assert scorer.similarity("red post", pictures) == pytest.approx(cosine, abs=1e-5)
    assert scorer.score("red post", [RED, GREY, BLUE]) == pytest.approx(
        np.exp(100 * (cosine - cosine.max())), abs=1e-3
    )
    assert scorer.score("blue post", [BLUE, RED, GREY])[0] == scorer.score("blue post", [RED])[0] == 1.0


def test_clip_selects_the_side_that_the_name_tells(clip, tmp_path):
    config = AnchorSampleConfig(weights=ScorerWeights(geometric=0.0, clip=1.0), clip=clip)
    rows = selected(config, "red post", tmp_path)
    assert looks_south(rows[0])  # the red side looks north
    assert rows[0]["score"] == rows[0]["score_clip"] == 1.0
    assert all(row["score_geometric"] is None for row in rows)
    assert not looks_south(selected(config, "blue post", tmp_path)[0])


def test_a_changed_model_changes_the_settled_configuration(clip, tmp_path):
    copy = ClipConfig(**{k: tmp_path / getattr(clip, k).name for k in ("vision", "text", "tokenizer")})
    for name in ("vision", "text", "tokenizer"):
        getattr(copy, name).write_bytes(getattr(clip, name).read_bytes())
    resolve_config = BY_NAME["anchor-sample"].resolve_config
    config = AnchorSampleConfig(weights=ScorerWeights(clip=1.0), clip=copy)
    first = resolve_config(config, print)
    assert first.clip.sha256 == digest(clip)
    copy.tokenizer.write_bytes(copy.tokenizer.read_bytes() + b"\n")
    assert resolve_config(config, print).clip.sha256 != first.clip.sha256
    assert resolve_config(AnchorSampleConfig(clip=copy), print).clip.sha256 == ""


@pytest.mark.parametrize("which", ["vision", "text", "tokenizer"])
def test_a_file_that_is_missing_or_wrong_is_named(clip, which, tmp_path):
    with pytest.raises(AssetError, match="nowhere"):
        ClipScorer(clip.model_copy(update={which: tmp_path / "nowhere"}))
    (tmp_path / "wrong").write_bytes(b"\x08\x07 no model")
    with pytest.raises(AssetError, match="wrong"):
        ClipScorer(clip.model_copy(update={which: tmp_path / "wrong"}))


def test_encoders_in_each_others_place_are_noticed(clip):
    with pytest.raises(AssetError, match="takes no pictures"):
        ClipScorer(clip.model_copy(update={"vision": clip.text}))
    with pytest.raises(AssetError, match="input_ids"):
        ClipScorer(clip.model_copy(update={"text": clip.vision}))


def test_clip_without_its_package_says_what_to_install(clip, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(MissingPackage, match=r"pip install 'aerialdojo-gen\[clip\]'"):
        ClipScorer(clip)


@pytest.fixture
def key(monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    monkeypatch.delenv("OPENAI_BASE_URL", raising=False)


def vlm(service, **options):
    return VlmConfig(model="m", base_url=f"{service.url}/v1", retries=0, **options)


def shown(body):
    """The pictures that a model is sent."""
    parts = body["messages"][-1]["content"]
    pictures = []
    for url in (p["image_url"]["url"] for p in parts if p["type"] == "image_url"):
        data = np.frombuffer(base64.b64decode(url.removeprefix("data:image/jpeg;base64,")), np.uint8)
        pictures.append(cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1])
    return pictures


def by_redness(body):
    """A model that likes red: it looks at the pictures that it is sent."""
    pictures = shown(body)
    order = sorted(range(len(pictures)), key=lambda k: -redness(pictures[k]))
    return json.dumps({"order": [k + 1 for k in order]})


def test_a_model_is_shown_the_pictures_and_the_name_and_orders_them(key):
    with serving() as service:
        service.policy = by_redness
        assert VlmScorer(vlm(service)).score("red post", [BLUE, GREY, RED]) == [0.0, 0.5, 1.0]
        (request,) = service.requests
    assert request["path"] == "/v1/chat/completions"
    assert request["headers"]["authorization"] == f"Bearer {KEY}"
    assert KEY not in json.dumps(request["body"])
    assert '"red post"' in request["body"]["messages"][-1]["content"][-1]["text"]
    assert request["body"]["model"] == "m"
    assert request["body"]["temperature"] == 0.0


def test_the_models_order_selects_the_anchor(key, tmp_path):
    with serving() as service:
        service.policy = by_redness
        config = AnchorSampleConfig(weights=ScorerWeights(geometric=0.0, vlm=1.0), vlm=vlm(service))
        rows = selected(config, "red post", tmp_path)
        assert len(service.requests) == 1
    scorer_ensemble.cache_clear()
    # A model is shown more than the thumbnails that geometry makes do with.
    assert min(min(picture.shape[:2]) for picture in shown(service.requests[0]["body"])) >= 320
    assert looks_south(rows[0])
    assert [row["score_vlm"] for row in rows] == sorted((row["score_vlm"] for row in rows), reverse=True)
    assert rows[0]["score"] == 1.0


def test_an_answer_that_is_no_order_is_asked_for_once_more(key):
    with serving(Say("I like the second one."), Say('```json\n{"order": [2, 1]}\n```')) as service:
        assert VlmScorer(vlm(service)).score("post", [RED, BLUE]) == [0.0, 1.0]
        assert len(service.requests) == 2
    again = service.requests[1]["body"]["messages"]
    assert again[-2] == {"role": "assistant", "content": "I like the second one."}
    assert "not one JSON object" in again[-1]["content"]


def test_a_model_that_gives_no_order_has_no_opinion(key, caplog):
    with serving(Say('{"order": [1, 1]}')) as service:
        assert VlmScorer(vlm(service)).score("post", [RED, BLUE]) == [None, None]
        assert len(service.requests) == 2
    assert "gave no order for post" in caplog.text


def test_one_candidate_needs_no_model(key):
    with serving() as service:
        assert VlmScorer(vlm(service)).score("post", [RED]) == [1.0]
        assert service.requests == []


def test_orders_that_are_read():
    assert read_order('<think>the third?</think>\n{"order": [3, 1, 2]}', 3) == [2, 0, 1]
    assert read_order('```\n{"order": [1, 2, 3]}\n```', 3) == [0, 1, 2]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "JSON"),
        ('{"order": [1, 2, 3]} and more', "JSON"),
        ("[1, 2, 3]", "order"),
        ('{"order": [1, 2, 3], "why": "x"}', "order"),
        ('{"order": [1, 2]}', "1 to 3"),
        ('{"order": [1, 2, 2]}', "1 to 3"),
        ('{"order": [1, 2, 3.0]}', "1 to 3"),
        ('{"order": [true, 2, 3]}', "1 to 3"),
        ("[" * 100_000, "JSON"),
    ],
)
def test_orders_that_are_refused(text, why):
    with pytest.raises(ValueError, match=re.escape(why)):
        read_order(text, 3)
