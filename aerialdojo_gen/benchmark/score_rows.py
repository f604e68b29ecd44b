"""Every score as one row of a tidy table: CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

from aerialdojo_gen.base.paper_figures import PaperResult
from aerialdojo_gen.benchmark.difficulty import Breakdowns
from aerialdojo_gen.benchmark.intervals import score_intervals
from aerialdojo_gen.benchmark.metrics import (
    METRICS,
    Episodes,
    Profile,
    Score,
    Summary,
    slices,
    summarize,
    weighted_score,
)
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.tables import MODALITIES
from aerialdojo_gen.store.schemas import SETTINGS

_HEAD = ("run", "agent", "profile", "radius_m", "setting", "modality", "scope", "name", "episodes")
_ENDS = tuple(f"{metric}_{end}95" for metric in METRICS for end in ("low", "high"))
COLUMNS = (*_HEAD, *METRICS, *(f"{metric}_sd" for metric in METRICS), *_ENDS, "told")
_NO_BREAKDOWNS = Breakdowns()


def as_csv(
    runs: Sequence[Run],
    profiles: Sequence[Profile],
    paper_results: Sequence[PaperResult] = (),
    breakdowns: Breakdowns = _NO_BREAKDOWNS,
) -> str:
    """Write every score as one row of a tidy CSV: fractions and metres, unrounded; empty where there is none."""
    out = io.StringIO()
    write = csv.writer(out, lineterminator="\n").writerow
    write(COLUMNS)
    for row in _rows(runs, profiles, paper_results, breakdowns):
        write(["" if value is None else value for value in row])
    return out.getvalue()


def as_json(
    runs: Sequence[Run],
    profiles: Sequence[Profile],
    paper_results: Sequence[PaperResult] = (),
    breakdowns: Breakdowns = _NO_BREAKDOWNS,
) -> str:
    """Write the rows of `as_csv` as a JSON list of objects, a line each; null where there is nothing."""
    rows = (dict(zip(COLUMNS, row, strict=True)) for row in _rows(runs, profiles, paper_results, breakdowns))
    lines = (json.dumps(row, ensure_ascii=False, allow_nan=False) for row in rows)
    return "[\n" + ",\n".join(lines) + "\n]\n"


def _rows(
    runs: Sequence[Run], profiles: Sequence[Profile], paper_results: Sequence[PaperResult], breakdowns: Breakdowns
) -> Iterator[list[Any]]:
    for k, run in enumerate(runs):
        parts: list[tuple[str, str, Episodes]] = [("all", "all", run.episodes)]
        parts += [(name, "all", part) for name, part in slices(run.episodes, "setting", SETTINGS)]
        parts += [("all", name, part) for name, part in slices(run.episodes, "modality", MODALITIES)]
        parts += [
            (setting, name, part)
            for setting, whole in slices(run.episodes, "setting", SETTINGS)
            for name, part in slices(whole, "modality", MODALITIES)
        ]
        for profile in profiles:
            for setting, modality, part in parts:
                head = [run.name, run.agent, profile.name, profile.radius_m, setting, modality]
                scored = _scores(part, profile)
                if setting == modality == "all":
                    scored += _breakdown_scores(run, k, profile, breakdowns)
                for scope, name, score, more in scored:
                    values = [getattr(score, m) for m in METRICS] + more
                    known = [None if math.isnan(v) else v for v in values]
                    yield [*head, scope, name, score.episodes, *known, run.told]
    for result in paper_results:
        for profile in profiles:
            keys = [(metric, profile.radius_m) for metric in METRICS]
            if profile.name.startswith("aerialdojo") and any(key in result.mean for key in keys):
                row = [kind.get(key) for kind in (result.mean, result.spread) for key in keys]
                head = ["paper", result.model, profile.name, profile.radius_m, result.setting, "all"]
                yield [*head, "overall", "overall", None, *row, *[None] * len(_ENDS), ""]


_UNKNOWN = [math.nan] * (3 * len(METRICS))


def _scores(part: Episodes, profile: Profile) -> list[tuple[str, str, Score, list[float]]]:
    """Score a part of a log in every scope, with deviations and ends of intervals where they are known."""
    summary: Summary = summarize(part, profile)
    return [
        ("overall", "overall", summary.overall, _known(part, profile, summary)),
        ("task_weighted", "task_weighted", weighted_score(part, profile), _UNKNOWN),
        *(("family", name, score, _UNKNOWN) for name, score in summary.families.items()),
        *(
            (column, name, summarize(half, profile).overall, _UNKNOWN)
            for column in ("partition", "scene_type")
            for name, half in slices(part, column, sorted(set(getattr(part, column).tolist())))
        ),
        *(("scene", name, score, _UNKNOWN) for name, score in summary.scenes.items()),
    ]


def _breakdown_scores(
    run: Run, k: int, profile: Profile, breakdowns: Breakdowns
) -> list[tuple[str, str, Score, list[float]]]:
    """Score the parts of the k-th run's episodes."""
    scored = []
    for breakdown in breakdowns.found:
        for part in breakdown.parts:
            episodes = run.episodes.where(part.masks[k])
            summary = summarize(episodes, profile)
            scored.append((breakdown.name, part.head, summary.overall, _known(episodes, profile, summary)))
    return scored


def _known(part: Episodes, profile: Profile, summary: Summary) -> list[float]:
    """Deviations and ends of intervals of an overall score."""
    spread = [getattr(summary.deviation, m) for m in METRICS]
    return spread + [end for ends in score_intervals(part, profile) for end in ends]
