"""Agents of both protocols of language models, with a goal and observations."""

from __future__ import annotations

from typing import Any

import numpy as np
from support.llm_server import Service

from aerialdojo_gen.benchmark.agents import load_agent
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Rules
from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent
from aerialdojo_gen.store.schemas import ACTION_NAMES

KEY = "sk-test-51f0c1e7a9b24d6e8f30"
FORWARD_3 = ACTION_NAMES.index("MoveForward3")
PROTOCOLS = ["openai", "anthropic"]


def agent_of(protocol: str, service: Service, **options: Any) -> LanguageModelAgent:
    base_url = service.url + ("/v1" if protocol == "openai" else "")
    given = {"model": "m", "base_url": base_url, "timeout_s": 5.0, "request_retries": 0} | options
    agent = load_agent(protocol, **given)
    assert isinstance(agent, LanguageModelAgent)
    return agent


def goal_for(agent: LanguageModelAgent, image: bool = False) -> Goal:
    picture = np.full((8, 8, 3), 200, np.uint8) if image else None
    kind, text = ("image", None) if image else ("semantic", "A van.")
    return Goal(kind, "red van", "clock tower", "north", text, picture, Rules(90, sensors=agent.sensors))


def observation(step: int = 0, views: tuple[str, ...] = ("front",)) -> Observation:
    rgb = {view: np.full((64, 64, 3), 40 * k, np.uint8) for k, view in enumerate(views)}
    depth = {view: np.full((64, 64), 10.0 + k, np.float32) for k, view in enumerate(views)}
    return Observation(step, 90 - step, False, rgb, depth)


def begun(protocol: str, service: Service, **options: Any) -> LanguageModelAgent:
    agent = agent_of(protocol, service, **options)
    agent.reset(goal_for(agent))
    return agent
