"""Agents: `load_agent` makes one by name, or by ``package.module:Class``."""

from aerialdojo_gen.base.errors import AgentUnavailable, ServiceDown
from aerialdojo_gen.benchmark.agents.base import Agent, AgentBase, InvalidAnswer, Usage
from aerialdojo_gen.benchmark.agents.goal import BLIND, Goal, Heading, Observation, Rules, Sensors
from aerialdojo_gen.benchmark.agents.load import BUILT_IN, agent_class, load_agent

__all__ = [
    "BLIND",
    "BUILT_IN",
    "Agent",
    "AgentBase",
    "AgentUnavailable",
    "Goal",
    "Heading",
    "InvalidAnswer",
    "Observation",
    "Rules",
    "Sensors",
    "ServiceDown",
    "Usage",
    "agent_class",
    "load_agent",
]
