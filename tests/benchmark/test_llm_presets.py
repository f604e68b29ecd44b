"""Presets against a local server of both protocols, and what an evaluation is estimated to take."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.llm_server import Say, Status, serving

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.agents import load_agent
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Rules
from aerialdojo_gen.benchmark.estimate import estimate
from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent
from aerialdojo_gen.benchmark.llm.options import preset, presets
from aerialdojo_gen.benchmark.runner import Evaluation
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.store.schemas import ACTION_NAMES

MOVE_UP = '{"thought": "Higher.", "action": "MoveUp"}'
# Of Table 4.
PAPER = {
    "Qwen3-VL-4B", "InternVL3.5-8B", "Ministral 3 8B", "Phi-4-multimodal", "MiniCPM-V 4.6", "GPT-5.6 Sol", "Grok-4.5",
    "Gemini 3.8 Flash", "Claude Opus 5",
}  # fmt: skip


def test_the_papers_nine_are_there() -> None:
    assert {p.title for p in presets().values() if p.paper} == PAPER
    assert sum(p.paper for p in presets().values()) == 9
    with pytest.raises(UsageError, match="did you mean 'qwen3-vl-4b'"):
        preset("qwen3-vl-4bb")


@pytest.mark.parametrize("name", presets())
def test_a_preset_flies(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = preset(name)
    key = f"key-of-{name}-0123456789"
    monkeypatch.setenv(found.options.get("key_env", f"{found.agent.upper()}_API_KEY"), key)
    with serving(Say(MOVE_UP)) as service:
        url = service.url + ("/v1" if found.agent == "openai" else "")
        agent = load_agent(found.agent, **found.options | {"base_url": url, "actions": "eight"})
        assert isinstance(agent, LanguageModelAgent)
        agent.check()
        rules = Rules(90, sensors=agent.sensors)
        agent.reset(Goal("image", "van", "tower", "northeast", None, np.zeros((8, 8, 3), np.uint8), rules))
        for step in range(3):
            rgb, depth = np.zeros((640, 640, 3), np.uint8), np.ones((640, 640), np.float32)
            seen = Observation(step, 90 - step, False, {"front": rgb}, {"front": depth})
            assert agent.act(seen) == ACTION_NAMES.index("MoveUp1")
        agent.close()
    body, headers = (service.requests[-1][part] for part in ("body", "headers"))
    assert body["model"] == found.options["model"]
    assert key in headers.get("authorization", "") + headers.get("x-api-key", "")
    pictures = [
        part for m in body["messages"] for part in m["content"] if isinstance(part, dict) and "text" not in part
    ]
    assert len(pictures) == agent.options.pictures <= (agent.options.max_pictures or 20)
    if found.served in ("vLLM", "Ollama"):
        assert found.options["base_url"].startswith("http://127.0.0.1:")
        assert found.serve is not None
        assert found.options["model"] in found.serve or "lora" in found.serve


def test_more_pictures_than_a_model_takes_are_refused() -> None:
    options = preset("qwen3-vl-4b").options
    with pytest.raises(UsageError, match="7 pictures, more than max_pictures = 4"):
        load_agent("openai", **options | {"history_images": 4})


def test_an_evaluation_is_estimated_by_real_requests_or_by_reckoning(smoke: Path) -> None:
    prices = {"input_usd_per_million": 1.0, "output_usd_per_million": 10.0}
    with serving(Say('{"action": "TurnLeft15"}', usage=(500, 30))) as service:
        options = {"model": "m", "base_url": service.url + "/v1", "image_size_px": 32} | prices
        job = Evaluation("r", "openai", options, Selection(settings=("base",), modalities=("semantic",), limit=5))
        found = estimate(smoke, job)
        assert (found.episodes, found.tokens_in, found.tokens_out) == (5, 500, 30)
        assert found.measured == len(service.requests)
        assert found.measured > 2
        assert found.requests[1] == 5 * 90
        assert 5 * 2 <= found.requests[0] < found.requests[1]
        assert found.cost_usd == pytest.approx([n * (500 + 300) / 1e6 for n in found.requests])
        assert "million tokens" in found.lines(2)[-1]
        assert found.request_s > 0
        service.refuses = lambda _: Status(503, "loading")
        reckoned = estimate(smoke, job)
        assert (reckoned.measured, len(service.requests)) == (0, found.measured)
        assert "HTTP 503: loading" in reckoned.lines(1)[1]
        assert 300 < reckoned.tokens_in < 3_000
    with pytest.raises(UsageError, match="not 'random'"):
        estimate(smoke, Evaluation("r", "random", {}, Selection(limit=1)))
