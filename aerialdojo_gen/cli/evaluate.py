"""Commands that evaluate and train agents, and let a person fly."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerialdojo_gen.base import cli_context
from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import AerialDojoError, UsageError
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import interruptible, key_values, merge_scenes, selection
from aerialdojo_gen.dataset.build import default_workers, open_pipeline

if TYPE_CHECKING:
    from aerialdojo_gen.benchmark.agents.goal import Sensors
    from aerialdojo_gen.benchmark.evaluation import Outcome
    from aerialdojo_gen.pipeline.progress import Reporter

app = typer.Typer()


@app.command("evaluate")
def evaluate(
    scenes: options.Scenes = None,
    data: options.Data = "data",
    agent: Annotated[
        str | None,
        typer.Option(
            autocompletion=options.complete_agents,
            help="oracle, random, stop, explorer, policy, …, or package.module:Class.  (default: random)",
        ),
    ] = None,
    preset: Annotated[
        str | None, typer.Option(help="A preset language model instead of --agent: qwen3-vl-4b, …")
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option(help="Option of the agent, repeatable: --option seed=1; converted to the type of its default."),
    ] = None,
    run: Annotated[str | None, typer.Option(help="Name of the run.  (default: that of the agent or preset)")] = None,
    split: options.Split = None,
    setting: options.Setting = None,
    modality: options.Modality = None,
    protocol: options.Protocol = None,
    scene: options.Scene = None,
    limit: options.TaskLimit = None,
    seed: options.SelectionSeed = 0,
    view: Annotated[
        list[str] | None, typer.Option(help="front, left, right, down; repeatable; overrides the agent's.")
    ] = None,
    width: Annotated[
        int | None, typer.Option(min=1, max=4096, help="Image width in pixels; overrides the agent's.")
    ] = None,
    height: Annotated[
        int | None, typer.Option(min=1, max=4096, help="Image height in pixels; overrides the agent's.")
    ] = None,
    renderer: options.RendererName = "auto",
    tell: options.Hints = None,
    out: options.Out = None,
    submission: options.SubmissionFile = None,
    attempts: Annotated[
        int,
        typer.Option(min=1, max=1000, help="Maximum attempts per episode if something other than the agent fails."),
    ] = 5,
    rerun_failed: Annotated[
        bool,
        typer.Option(
            "--rerun-failed", help="Run only those episodes again that failed for reasons outside the agent."
        ),
    ] = False,
    tolerate: Annotated[
        bool,
        typer.Option(
            "--tolerate",
            help="Continue when the agent raises or returns no valid action; the episode counts as failed.",
        ),
    ] = False,
    traceback: Annotated[
        bool, typer.Option("--traceback", help="Print the whole traceback of an agent that raises.")
    ] = False,
    restart: Annotated[bool, typer.Option("--restart", help="Delete what the run has written before.")] = False,
    estimate: Annotated[
        bool,
        typer.Option(
            "--estimate", help="Estimate time and cost of a language model with a few requests; fly nothing."
        ),
    ] = False,
    max_cost: Annotated[
        float | None, typer.Option(min=0, help="Start no further episode after this cost, US dollars.")
    ] = None,
    max_tokens: Annotated[
        int | None, typer.Option(min=0, help="Start no further episode after this number of tokens.")
    ] = None,
    requests_per_minute: Annotated[
        float | None, typer.Option(min=0.001, help="Maximum request rate of all workers together.")
    ] = None,
    failures_in_row: Annotated[
        int, typer.Option(min=1, help="Stop after this many failed episodes of one kind in a row.")
    ] = 5,
    workers: options.Workers = None,
    executor: options.ExecutorName = "local",
    address: options.Address = None,
    pipeline: options.PipelineFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Evaluate an agent on released tasks, closed loop; finished episodes are kept."""
    from aerialdojo_gen.benchmark.evaluation import Limits
    from aerialdojo_gen.benchmark.runner import Evaluation
    from aerialdojo_gen.benchmark.runner import evaluate as run_evaluation
    from aerialdojo_gen.benchmark.worker import RetryPolicy
    from aerialdojo_gen.dataset.protocol import sample_shortfall
    from aerialdojo_gen.pipeline.progress import Reporter

    config, _ = open_pipeline(pipeline, data, reads=True)
    chosen = selection(merge_scenes(scenes, scene), split, setting, modality, protocol, limit, seed)
    with _tracebacks(traceback):
        name, given = _agent(agent, preset, key_values(option or []))
        evaluation = Evaluation(
            run or (preset or name).replace(".", "-").replace(":", "-"), name, given, chosen,
            _sensors(name, given, view, width, height), config.embodiment, renderer,
            RetryPolicy(attempts, tolerate=tolerate), requests_per_minute, hints=tuple(tell or ()),
            withheld=submission is not None,
        )  # fmt: skip
    if protocol and (less := sample_shortfall(data)):
        print(f"--protocol {protocol}: {less}", file=sys.stderr)
    if estimate:
        from aerialdojo_gen.benchmark.estimate import estimate as estimate_cost

        print("\n".join(estimate_cost(data, evaluation).lines(workers or default_workers())))
        return
    reporter = Reporter(quiet=quiet)
    with interruptible("finished episodes are kept, the same command continues from here"), _tracebacks(traceback):
        outcome = run_evaluation(
            data, evaluation, out=out, workers=workers, executor=executor, address=address,
            rerun_failed=rerun_failed, restart=restart,
            limits=Limits(max_cost, max_tokens, failures_in_row), reporter=reporter,
        )  # fmt: skip
    scores = command("report", evaluation.run, log=out, protocol=protocol)
    _print_outcome(outcome, evaluation.run, scores, data, reporter)
    if submission is not None:
        from aerialdojo_gen.benchmark.submission import write_submission

        size = write_submission(data, out or data, evaluation.run, submission)
        known = outcome.successes is not None
        withheld = "" if known else "; the goals are withheld: score it with the whole release"
        reporter.line(f"{submission}: {outcome.finished:,} episodes, {size:,} bytes{withheld}")


def _print_outcome(outcome: Outcome, run: str, scores: str, data: str, reporter: Reporter) -> None:
    """Say what a run gave, the command for its scores, and how to fly again what failed."""
    scored = outcome.finished and outcome.successes is not None
    reporter.line(f"evaluate {run}: {outcome}{f'; for all scores: {scores}' if scored else ''}")
    last = outcome.failure_message(rerun_command(["--rerun-failed"], without=["--restart"], data=data))
    if outcome.stopped or outcome.all_failed:
        raise AerialDojoError(last)
    if last:
        # Not the reporter's: a failure is printed under --quiet too.
        print(last, file=sys.stderr)


@contextmanager
def _tracebacks(enabled: bool) -> Iterator[None]:
    """Print an agent's traceback, if it raises in the block."""
    try:
        yield
    except AerialDojoError as error:
        if enabled and error.traceback:
            print(error.traceback, file=sys.stderr)
        raise


def _agent(agent: str | None, preset: str | None, given: dict[str, str]) -> tuple[str, dict[str, Any]]:
    """Return the agent and its options; given options override a preset's."""
    from aerialdojo_gen.benchmark.agents.load import read_options

    if preset is None:
        return agent or "random", read_options(agent or "random", given)
    from aerialdojo_gen.benchmark.llm.options import preset as find

    model = find(preset)
    if agent is not None and agent != model.agent:
        raise UsageError(f"preset {preset!r} is of the agent {model.agent!r}: leave --agent {agent} out")
    return model.agent, model.options | read_options(model.agent, given)


def _sensors(
    agent: str, options: dict[str, Any], view: list[str] | None, width: int | None, height: int | None
) -> Sensors | None:
    """Return the agent's sensors with the requested changes; None if there are none."""
    if view is None and width is None and height is None:
        return None
    from dataclasses import replace

    from aerialdojo_gen.benchmark.agents import load_agent
    from aerialdojo_gen.benchmark.agents.goal import Sensors

    own = getattr(load_agent(agent, **options), "sensors", None)
    sensors = own if isinstance(own, Sensors) else Sensors()
    views = sensors.views if view is None else tuple(view)
    return replace(sensors, views=views, width=width or sensors.width, height=height or sensors.height)


def rerun_command(more: Sequence[str], *, without: Sequence[str] = (), data: str | None = None) -> str:
    """Return this process's command with all its options, quoted for a shell."""
    kept = [argument for argument in sys.argv[1:] if argument not in without]
    named = any(argument.partition("=")[0] == "--data" for argument in kept)
    if data is not None and os.environ.get("AERIALDOJO_DATA") and not named:
        kept += ["--data", data]
    kept += [argument for argument in more if argument not in kept]
    called = cli_context.program(sys.argv[0])
    program = [called] if called else [sys.executable, "-m", "aerialdojo_gen.cli"]
    return Secrets().text(shlex.join([*program, *kept]))


@app.command("fly")
def fly(
    name: Annotated[
        str, typer.Option(help="The pilot's name in the tables: small letters, digits and -; any name does.")
    ],
    scenes: options.Scenes = None,
    data: options.Data = "data",
    run: Annotated[str | None, typer.Option(help="Name of the run.  (default: human-NAME)")] = None,
    split: options.Split = None,
    setting: options.Setting = None,
    modality: options.Modality = None,
    protocol: options.Protocol = None,
    scene: options.Scene = None,
    limit: options.TaskLimit = None,
    seed: options.SelectionSeed = 0,
    renderer: options.RendererName = "auto",
    tell: options.Hints = None,
    out: options.Out = None,
    submission: options.SubmissionFile = None,
    restart: Annotated[bool, typer.Option("--restart", help="Delete the run's earlier flights.")] = False,
    port: options.Port = 0,
    browser: options.Browser = True,
    pipeline: options.PipelineFile = None,
) -> None:
    """Fly released tasks yourself in the browser; finished flights are kept, as episodes of human:NAME."""
    from aerialdojo_gen.studio.web.serving import require_web

    require_web()
    from aerialdojo_gen.benchmark.evaluation import Evaluation
    from aerialdojo_gen.studio.fly.server import serve_session
    from aerialdojo_gen.studio.fly.session import agent_name

    config, _ = open_pipeline(pipeline, data, reads=True)
    chosen = selection(merge_scenes(scenes, scene), split, setting, modality, protocol, limit, seed)
    evaluation = Evaluation(
        run or f"human-{name}", agent_name(name), selection=chosen, embodiment=config.embodiment, renderer=renderer,
        hints=tuple(tell or ()),
    )  # fmt: skip
    say = partial(print, flush=True)
    serve_session(data, evaluation, out=out, restart=restart, port=port, browser=browser, say=say)
    if submission is not None:
        from aerialdojo_gen.benchmark.submission import write_submission

        size = write_submission(data, out or data, evaluation.run, submission)
        say(f"{submission}: {size:,} bytes")


@app.command("train")
def train(
    recipe: Annotated[
        Path, typer.Argument(metavar="RECIPE", help="Recipe file, or the name of a shipped one: imitation, blind, …")
    ],
    data: options.Data = "data",
    small: Annotated[
        bool,
        typer.Option("--small", help="Use the recipe's section [small], with few scenes and epochs, as a first try."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for weights and checkpoints.  (default: policies/NAME in --data)"),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Cache for rendered images.  (default: policies/cache in --data)"),
    ] = None,
    init: Annotated[
        Path | None,
        typer.Option(
            metavar="WEIGHTS",
            help="Begin with the weights of another training, to adapt them to the "
            "recipe's scenes.  (default: random weights)",
        ),
    ] = None,
    device: Annotated[str, typer.Option(help="auto, cpu or cuda.")] = "auto",
    renderer: options.RendererName = "auto",
    restart: Annotated[bool, typer.Option("--restart", help="Delete an earlier training of this name.")] = False,
    workers: options.Workers = None,
    quiet: options.Quiet = False,
) -> None:
    """Train a policy by imitation and DAgger; after an interruption the same command continues."""
    from aerialdojo_gen.learning.recipe import load_recipe
    from aerialdojo_gen.learning.training import train as run_training
    from aerialdojo_gen.pipeline.progress import Reporter

    chosen = load_recipe(recipe)
    with interruptible("the same command continues from the last checkpoint"):
        run_training(
            data, chosen.reduced() if small else chosen, out=out, cache=cache, init=init, device=device,
            workers=workers, renderer=renderer, restart=restart, reporter=Reporter(quiet=quiet),
        )  # fmt: skip
