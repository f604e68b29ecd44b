"""What is found out before a run: whether the agent's service answers, and whether its limits can be kept."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.agents import agent_class, load_agent
from aerialdojo_gen.pipeline.progress import Reporter

if TYPE_CHECKING:
    from aerialdojo_gen.benchmark.limits import Limits
    from aerialdojo_gen.benchmark.runner import Evaluation


def preflight(evaluation: Evaluation, limits: Limits, reporter: Reporter) -> Evaluation:
    """Check an agent that asks a service, by one request; other agents are left alone."""
    # By the class: an agent without a check may take long to make, and is made by the workers.
    if not hasattr(agent_class(evaluation.agent), "check"):
        return evaluation
    agent: Any = load_agent(evaluation.agent, **evaluation.options)
    try:
        if limits.cost_usd is not None and not getattr(agent, "priced", True):
            raise UsageError(
                "--max-cost needs prices: --option input_usd_per_million=… --option output_usd_per_million=…"
            )
        found = agent.check()
        for option, limit in (("--max-cost", limits.cost_usd), ("--max-tokens", limits.tokens)):
            if limit is not None and not getattr(agent, "tells_tokens", True):
                raise UsageError(f"{option} cannot be kept: {found}")
        if found:
            reporter.line(f"{evaluation.agent}: {found}")
        settled: dict[str, Any] = getattr(agent, "settled", dict)()
        used: dict[str, Any] | None = agent.used_options() if hasattr(agent, "used_options") else None
    finally:
        agent.close()
    return replace(evaluation, options={**evaluation.options, **settled}, used=used)
