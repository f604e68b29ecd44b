"""Every score as one row of a tidy table: CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator
from typing import Any

from aerialdojo_gen.base.constants import MODALITIES
from aerialdojo_gen.benchmark.metrics import METRICS
from aerialdojo_gen.benchmark.tables import Cut, ReportRequest
from aerialdojo_gen.store.schemas import SETTINGS

_HEAD = ("run", "agent", "profile", "radius_m", "setting", "modality", "scope", "name", "episodes")
_ENDS = tuple(f"{metric}_{end}95" for metric in METRICS for end in ("low", "high"))
COLUMNS = (*_HEAD, *METRICS, *(f"{metric}_sd" for metric in METRICS), *_ENDS, "told")


def as_csv(request: ReportRequest) -> str:
    """Write every score as one row of a tidy CSV: fractions and metres, unrounded; empty where there is none."""
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([COLUMNS, *_rows(request)])
    return out.getvalue()


def as_json(request: ReportRequest) -> str:
    """Write the rows of `as_csv` as a JSON list of objects, a line each; null where there is nothing."""
    rows = (dict(zip(COLUMNS, row, strict=True)) for row in _rows(request))
    return "[\n" + ",\n".join(json.dumps(row, ensure_ascii=False, allow_nan=False) for row in rows) + "\n]\n"


def _rows(request: ReportRequest) -> Iterator[list[Any]]:
    for k, run in enumerate(request.runs):
        settings, modalities = (
            request.values(column, Cut(k), order)
            for column, order in (("setting", SETTINGS), ("modality", MODALITIES))
        )
        parts = [("all", "all"), *((s, "all") for s in settings), *(("all", m) for m in modalities)]
        parts += [
            (s, m) for s in settings for m in request.values("modality", Cut(k, where=(("setting", s),)), MODALITIES)
        ]
        for profile in request.profiles:
            for setting, modality in parts:
                where = [(n, v) for n, v in (("setting", setting), ("modality", modality)) if v != "all"]
                head = [run.name, run.agent, profile.name, profile.radius_m, setting, modality]
                for row in _scores(request, Cut(k, profile, tuple(where))):
                    yield [*head, *(None if isinstance(v, float) and math.isnan(v) else v for v in row), run.hints]
    for result in request.paper_results:
        for profile in request.profiles:
            keys = [(metric, profile.radius_m) for metric in METRICS]
            if profile.own and any(key in result.mean for key in keys):
                row = [kind.get(key) for kind in (result.mean, result.spread) for key in keys]
                head = ["paper", result.model, profile.name, profile.radius_m, result.setting, "all"]
                yield [*head, "overall", "overall", None, *row, *[None] * len(_ENDS), ""]


def _scores(request: ReportRequest, whole: Cut) -> Iterator[list[Any]]:
    """Score a part of a log in every scope, with deviations and ends of intervals where they are known."""
    summary, unknown = request.summary(whole), [math.nan] * (3 * len(METRICS))

    def known(scope: str, name: str, cut: Cut) -> list[Any]:
        own = request.summary(cut)
        return [scope, name, *own.overall, *own.deviation[1:], *request.interval(cut).T.ravel().tolist()]

    yield known("overall", "overall", whole)
    yield ["task_weighted", "task_weighted", *request.score(whole | Cut(weighted=True)), *unknown]
    yield from (["family", name, *score, *unknown] for name, score in summary.families.items())
    for column in ("partition", "scene_type", "malls"):
        for name in request.values(column, whole):
            yield [column, name, *request.score(whole | Cut(where=((column, name),))), *unknown]
    yield from (["scene", name, *score, *unknown] for name, score in summary.scenes.items())
    if not whole.where:
        for column, found in request.breakdowns.found.items():
            for part in found.parts:
                yield known(column, part, whole | Cut(where=((column, part),)))
