"""Estimate an evaluation of a language model: requests, tokens, hours, dollars."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass

import pyarrow as pa
import pyarrow.compute as pc

from aerialdojo_gen.base.errors import AerialDojoError, UsageError
from aerialdojo_gen.benchmark.agents import InvalidAnswer, agent_class, load_agent
from aerialdojo_gen.benchmark.evaluation import Evaluation
from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent
from aerialdojo_gen.benchmark.tasks import read_tasks, select
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot, Where, open_root

# An address without a service: the agent is made for its prompt alone.
_NOBODY = "http://127.0.0.1:9/v1"
_TASKS, _STEPS = 3, 3
# Assumed without a service: tokens of an answer, seconds of a request.
_ASSUMED_OUT, _ASSUMED_S = 60.0, 2.0


@dataclass(frozen=True)
class Estimate:
    """Estimated requests, tokens, time and cost of an evaluation."""

    episodes: int
    requests: tuple[int, int]
    tokens_in: float  # Per request, as the following three
    tokens_out: float
    request_s: float
    render_s: float
    measured: int  # Number of requests measured; 0 if figures are assumed
    why_not: str  # Why nothing was measured
    cost_usd: tuple[float, float] | None  # For the two numbers of requests

    def lines(self, workers: int) -> list[str]:
        """Return what to print."""
        least, most = self.requests
        each = f"{self.tokens_in:,.0f} tokens in, {self.tokens_out:,.0f} out, {self.request_s:.2f} s"
        how = (
            f"measured on {self.measured} requests: {each} each"
            if self.measured
            else f"not measured ({self.why_not}); reckoned from prompt and pictures, answer and time assumed: {each}"
        )
        # Requests run in parallel; rendering is bound by the cores.
        cores = max(1, min(workers, len(os.sched_getaffinity(0))))
        a_step_s = max((self.request_s + self.render_s) / workers, self.render_s / cores)
        hours = [n * a_step_s / 3600.0 for n in self.requests]
        millions = [n * (self.tokens_in + self.tokens_out) / 1e6 for n in self.requests]
        cost = "" if self.cost_usd is None else f", {self.cost_usd[0]:,.2f} to {self.cost_usd[1]:,.2f} USD"
        return [
            f"{self.episodes:,} episodes: {least:,} requests if each takes as many actions as its reference, "
            f"{most:,} if each spends its budget",
            f"{how}; pictures {self.render_s:.2f} s",
            f"{millions[0]:,.1f} to {millions[1]:,.1f} million tokens, {hours[0]:,.1f} to {hours[1]:,.1f} hours with "
            f"{workers} at a time{cost}",
        ]


def estimate(data: Where, evaluation: Evaluation) -> Estimate:
    """Estimate an evaluation: from a few real requests if the service answers, else from assumptions."""
    cls = agent_class(evaluation.agent)
    if not (isinstance(cls, type) and issubclass(cls, LanguageModelAgent)):
        raise UsageError(f"--estimate is for agents that ask a language model, not {evaluation.agent!r}")
    root = open_root(data)
    rows = select(root, evaluation.selection)
    agent, why_not = _make_agent(evaluation)
    try:
        if not why_not:
            try:
                agent.check()
            except AerialDojoError as error:
                why_not = str(error).removeprefix("checked before the run, nothing flown: ")
        figures = _measure_steps(root, evaluation, rows, agent, asks=not why_not)
    finally:
        agent.close()
    tokens_in, tokens_out, *_ = figures
    requests = _reference_actions(root, rows), int(pc.sum(rows["action_budget"]).as_py())
    least, most = (agent.options.cost_usd(k * tokens_in, k * tokens_out) for k in requests)
    return Estimate(
        rows.num_rows, requests, *figures, why_not, None if least is None or most is None else (least, most)
    )


def _make_agent(evaluation: Evaluation) -> tuple[LanguageModelAgent, str]:
    try:
        agent, why_not = load_agent(evaluation.agent, **evaluation.options), ""
    except UsageError as error:
        if "no API key" not in str(error):
            raise
        offline = {**evaluation.options, "base_url": _NOBODY, "key_env": None}
        agent, why_not = load_agent(evaluation.agent, **offline), str(error)
    assert isinstance(agent, LanguageModelAgent)
    return agent, why_not


def _measure_steps(
    root: DataRoot, evaluation: Evaluation, rows: pa.Table, agent: LanguageModelAgent, asks: bool
) -> tuple[float, float, float, float, int]:
    """Fly the first steps of a few tasks; tokens in and out, seconds of a request and of its pictures, how many."""
    flight = evaluation.flight_of(agent, root)
    # Of one scene: opening another takes longer than all the requests.
    few = rows.filter(pc.equal(rows["scene"], rows["scene"][0].as_py())).slice(0, _TASKS)
    tokens_in = tokens_out = request_s = render_s = 0.0
    requests = renders = 0
    for task in read_tasks(root, few):
        episode = flight.begin(task)
        agent.reset(flight.goal)
        for _ in range(_STEPS):
            began = time.perf_counter()
            observation = flight.observe()
            # The first image of a scene includes the time to open it.
            render_s += time.perf_counter() - began if renders else 0.0
            renders += 1
            if not asks:
                tokens_in += agent.estimate_tokens(observation)
                continue
            try:
                episode.step(agent.act(observation))
            except InvalidAnswer:
                episode.step(None)
            if episode.termination is not None:
                break
        if asks:
            used = agent.usage()
            requests += used.requests or 0
            tokens_in += used.input_tokens or 0
            tokens_out += used.output_tokens or 0
            request_s += used.request_s or 0.0
    render_s /= max(1, renders - 1)
    if not asks:
        return tokens_in / renders, _ASSUMED_OUT, _ASSUMED_S, render_s, 0
    return tokens_in / requests, tokens_out / requests, request_s / requests, render_s, requests


def _reference_actions(root: DataRoot, rows: pa.Table) -> int:
    """Total actions of the references of all task instances."""
    counts: dict[str, int] = {}
    for scene, subset in set(zip(rows["scene"].to_pylist(), rows["subset"].to_pylist(), strict=True)):
        routes = store.read_scene(root, f"routes/{subset}", scene, ("nav_id", "n_actions"))
        counts |= zip(routes["nav_id"].to_pylist(), routes["n_actions"].to_pylist(), strict=True)
    return sum(counts[nav_id] for nav_id in rows["nav_id"].to_pylist())
