"""Score a submission: fly its actions again by the evaluator's own episodes, and add it to a folder of scored runs.

Each scored run is a folder: the submission, the log of the replay as `evaluate` writes one, and `score.json`.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import math
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pyarrow as pa
from pydantic import Field, ValidationError

from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.explain import explain
from aerialdojo_gen.base.safe_parse import read_json
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.benchmark.agents.goal import BLIND
from aerialdojo_gen.benchmark.evaluation import Evaluation
from aerialdojo_gen.benchmark.metrics import DEFAULT_PROFILES, METRICS, PROFILES, bootstrap, episodes_of, summarize
from aerialdojo_gen.benchmark.runner import evaluate
from aerialdojo_gen.benchmark.runs import ADAPTED, mark_adapted
from aerialdojo_gen.benchmark.submission import (
    Digest,
    Flown,
    Logged,
    Strict,
    Submission,
    SubmissionRefused,
    Word,
    check_tasks,
    described,
    embodiment_of,
    logged,
    read_submission,
    scene_facts,
)
from aerialdojo_gen.benchmark.tables import text
from aerialdojo_gen.benchmark.tasks import Selection, select
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.store.atomic import atomic_folder, make_folder
from aerialdojo_gen.store.layout import check_run_name
from aerialdojo_gen.store.root import DataRoot, Where, open_root
from aerialdojo_gen.store.schemas import SETTINGS

SCORE = "score.json"
_AGENT = "aerialdojo_gen.benchmark.agents.simple:SubmittedAgent"
# Of poses, path lengths and metrics: sines differ in their last digits between machines.
_TOLERANCE = 1e-5


class ScoreRow(Strict):
    """Scores of a part of the episodes, by one success rule."""

    setting: Word  # all, or one of `SETTINGS`
    partition: Word  # all, ID or OOD
    radius_m: float
    episodes: int
    mean: dict[Word, float | None]  # By metric, fractions and metres; None for unknown
    low: dict[Word, float | None]  # Ends of its 95 % interval
    high: dict[Word, float | None]


class ScoreCard(Strict):
    """What `score.json` holds."""

    format: Literal["aerialdojo-score"] = "aerialdojo-score"
    version: Literal[1] = 1
    name: Word
    agent: Word
    told: Word
    adapted: bool
    scored: Word  # Date, and version of this package
    code: Digest  # That the submission names
    tasks: dict[Word, Digest]  # Of the ids of the tasks, by setting
    rows: list[ScoreRow] = Field(max_length=100)


@dataclass(frozen=True)
class _Replay(Evaluation):
    """The settings of a replay: flown by the submitted actions, logged under the submission's own names."""

    named: dict[str, str] = field(default_factory=dict)

    def identity(self) -> dict[str, str]:
        """Columns of `episodes` that identify the submitted run."""
        return self.named

    @property
    def label(self) -> str:
        """What progress is shown under."""
        return f"score {self.run}"


def score(
    data: Where, file: Path, folder: Path, *, selection: Selection, embodiment: Embodiment | None = None,
    name: str | None = None, adapted: bool = False, replace: bool = False, workers: int | None = 1,
    reporter: Reporter | None = None,
) -> ScoreCard:  # fmt: skip
    """Fly a submission's actions again, and add it to a folder; nothing is written where it is refused."""
    root, submission = open_root(data), read_submission(file)
    name = check_run_name(name or submission.run.name)
    if (folder / name).exists() and not replace:
        raise UsageError(f"{folder} has a scored run {name!r}: give another --name, or --replace")
    rows = select(root, selection)
    _check_release(file, submission, root, rows, selection)
    body = embodiment or Embodiment()
    if submission.run.embodiment != embodiment_of(body):
        flown_with, here = (sorted(of.items()) for of in (submission.run.embodiment, embodiment_of(body)))
        raise SubmissionRefused(f"{file} is refused: it was flown with the body {flown_with}, here it is {here}")
    tasks = _task_digests(rows)
    _check_folder(folder, name, tasks)
    make_folder(folder)
    with atomic_folder(folder / name) as temporary:
        actions = temporary / "actions.json"
        episodes = submission.episodes
        actions.write_text(json.dumps(dict(zip(episodes.task_id, episodes.actions, strict=True))), encoding="utf-8")
        named = {
            "run_id": name, "agent": submission.run.agent, "agent_options": submission.run.agent_options,
            "told": submission.run.told,
        }  # fmt: skip
        replay = _Replay(name, _AGENT, {"file": str(actions)}, selection, BLIND, body, named=named)
        evaluate(root, replay, out=temporary, workers=workers, reporter=reporter)
        found = logged(open_root(temporary), name)
        _check_replay(file, submission, found)
        marked = mark_adapted(found.table, submission.run.agent_options)
        card = ScoreCard(
            name=name, agent=submission.run.agent, told=submission.run.told,
            adapted=adapted or ADAPTED in marked["partition"].to_pylist(),
            scored=f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d}, by {__version__}",
            code=submission.run.code, tasks=tasks, rows=list(_score_rows(found.table)),
        )  # fmt: skip
        # What the runner keeps for going on names the staging folder.
        actions.unlink()
        shutil.rmtree(temporary / "runs")
        (temporary / "submission.json.gz").write_bytes(file.read_bytes())
        (temporary / SCORE).write_text(card.model_dump_json(indent=1) + "\n", encoding="utf-8")
    return card


def scored_runs(folder: Path) -> list[ScoreCard]:
    """Read the runs of a folder of scored runs, by name; none where there is no such folder."""
    cards = []
    for path in sorted(folder.glob(f"*/{SCORE}")):
        try:
            cards.append(ScoreCard.model_validate(read_json(path)))
        except ValidationError as error:
            raise StoreError(f"{path}: {explain(error, ScoreCard)[0]}; score the submission again") from None
    return cards


def _task_digests(rows: pa.Table) -> dict[str, str]:
    """Return a digest of the task ids of every setting that has tasks."""
    ids: dict[str, list[str]] = {}
    for setting, task in zip(rows["setting"].to_pylist(), rows["task_id"].to_pylist(), strict=True):
        ids.setdefault(setting, []).append(task)
    return {s: hashlib.sha256("\n".join(sorted(ids[s])).encode()).hexdigest() for s in SETTINGS if s in ids}


def _check_folder(folder: Path, name: str, tasks: dict[str, str]) -> None:
    """Refuse to put runs on different tasks beside each other."""
    for other in scored_runs(folder):
        differing = [setting for setting, digest in tasks.items() if other.tasks.get(setting, digest) != digest]
        if differing and other.name != name:
            raise UsageError(
                f"{folder} has {other.name!r}, scored on other {differing[0]} tasks: choose the same tasks by "
                "the options of evaluate, or another --into"
            )


def _check_release(file: Path, submission: Submission, root: DataRoot, rows: pa.Table, selection: Selection) -> None:
    """Refuse a submission on other tasks, or whose scenes were others."""
    scenes = scene_facts(root, rows)
    for scene, own in scenes.items():
        theirs = submission.scenes.get(scene)
        if theirs is not None and theirs.mesh_sha256 != own.mesh_sha256:
            raise SubmissionRefused(
                f"{file} is refused: {scene} was flown on another mesh (SHA-256 {theirs.mesh_sha256[:12]}…, here "
                f"{own.mesh_sha256[:12]}…): fly it on the release in {root}"
            )
    said = described(submission.run.selection)
    check_tasks(
        rows["task_id"].to_pylist(), submission.episodes.task_id, f"{file} is refused: it",
        f"it says that it flew {said}, and is scored on {described(selection)}",
    )  # fmt: skip
    for scene, own in scenes.items():
        if submission.scenes.get(scene) != own:
            raise SubmissionRefused(
                f"{file} is refused: the tasks of {scene} were others: fly it on the release in {root}"
            )


def _check_replay(file: Path, submission: Submission, found: Logged) -> None:
    """Hold what a submission says against what came out."""
    theirs, own = submission.episodes, found.flown
    place = {task: k for k, task in enumerate(theirs.task_id)}
    faults = [
        f"task {task}: {fault}"
        for k, task in enumerate(own.task_id)
        if (fault := _fault(theirs, place[task], own, k))
    ]
    if faults:
        raise SubmissionRefused(f"{file} is refused: {len(faults):,} of {len(place):,} episodes do not replay; "
                                f"{faults[0]}")  # fmt: skip
    for metric, measured in (found.metrics or {}).items():
        if submission.metrics is None:
            return
        claimed = submission.metrics.get(metric)
        off = abs((claimed or 0.0) - (measured or 0.0))
        if (claimed is None) != (measured is None) or off > _TOLERANCE:
            shown = [text(metric, math.nan if value is None else value) for value in (claimed, measured)]
            raise SubmissionRefused(
                f"{file} is refused: it claims {metric} = {shown[0]}, and its actions give {shown[1]}"
            )


def _fault(theirs: Flown, i: int, own: Flown, k: int) -> str:
    """Say what of an episode does not come out; empty where all does."""
    claimed, flown = len(theirs.actions[i]), len(own.actions[k])
    if flown > claimed:
        return f"its {claimed} actions do not end it"
    if flown < claimed:
        return f"it ends by {own.termination[k]} after {flown} of its {claimed} actions"
    if theirs.termination[i] != own.termination[k]:
        return f"it ends by {own.termination[k]}, not by {theirs.termination[i]}"
    for name in ("x_m", "y_m", "z_m", "yaw_rad", "path_length_m"):
        claim, value = getattr(theirs, name)[i], getattr(own, name)[k]
        off = abs(claim - value)
        # Half a turn has two names.
        if min(off, abs(math.tau - off)) > _TOLERANCE if name == "yaw_rad" else off > _TOLERANCE:
            return f"it ends with {name} = {value:.3f}, not {claim:.3f}"
    return ""


def _score_rows(table: pa.Table) -> Iterator[ScoreRow]:
    """Score every setting, all scenes and those of a partition, with intervals."""
    episodes = episodes_of(table)
    for setting in ("all", *SETTINGS):
        for partition in ("all", "ID", "OOD"):
            chosen = (episodes["setting"] == setting) | (setting == "all")
            chosen &= (episodes["partition"] == partition) | (partition == "all")
            if not chosen.any():
                continue
            for profile in map(PROFILES.__getitem__, DEFAULT_PROFILES):
                summary = summarize(episodes[chosen], profile)
                low, high = bootstrap(summary.scene_scores()).tolist()
                yield ScoreRow(
                    setting=setting, partition=partition, radius_m=profile.radius_m, episodes=int(chosen.sum()),
                    mean=_known(summary.overall[1:]), low=_known(low), high=_known(high),
                )  # fmt: skip


def _known(values: Sequence[float]) -> dict[str, float | None]:
    """Name the values of all metrics; None for NaN."""
    return {m: None if math.isnan(value) else value for m, value in zip(METRICS, values, strict=True)}
