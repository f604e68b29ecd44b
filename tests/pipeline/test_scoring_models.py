"""Scorers that ask a model: CLIP in ONNX files made here, a model behind a real HTTP server."""

import base64
import json
import math
import re
import sys

import cv2
import numpy as np
import pytest
from support.handmade import job_of
from support.llm_server import Say, serving
from support.tiny_clip import write_clip
from support.two_coloured import POST, item_of, plain_view, redness, world_of, yard

from aerialdojo_gen.base.config.sections import AnchorSampleConfig, ClipConfig, ScorerWeights, VlmConfig
from aerialdojo_gen.base.errors import AssetError, MissingPackage
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.pipeline.scoring.clip import ClipScorer, digest
from aerialdojo_gen.pipeline.scoring.ensemble import scorer_ensemble
from aerialdojo_gen.pipeline.scoring.vlm import VlmScorer, read_order
from aerialdojo_gen.pipeline.stages.work.anchor_sample import anchors_of

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
