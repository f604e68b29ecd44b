"""The tables of scores: what a report is asked for, and one engine that fills a table from the outcomes.

Rates are per cent, distances metres; ± is the standard deviation over scenes. CSV and JSON have every score as one
row of a tidy table, fractions and metres.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from aerialdojo_gen.base.cached import cached_method
from aerialdojo_gen.base.constants import MODALITIES
from aerialdojo_gen.base.paper_figures import PaperResult
from aerialdojo_gen.base.text_table import BEST, SECOND, Column, TextTable
from aerialdojo_gen.benchmark.difficulty import Breakdowns, find_breakdowns
from aerialdojo_gen.benchmark.metrics import (
    MEASURES,
    METRICS,
    Bools,
    Floats,
    Profile,
    Score,
    Summary,
    bootstrap,
    knows_views,
    outcomes,
    score,
    summarize_values,
)
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.dataset.protocol import Sample
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import SETTINGS, TERMINATIONS

GROUPS = ("scene", "family", "scene_type", "partition", "setting", "modality")
# They have 29 % of the paper's tasks.
MALLS = ("U_Mall_0", "U_Mall_1")


@dataclass(frozen=True)
class Cut:
    """Some episodes, and how they are judged and averaged; what is None or empty is left to another cut."""

    run: int | None = None
    profile: Profile | None = None
    where: tuple[tuple[str, str], ...] = ()  # Column and value
    weighted: bool = False  # Whether every episode has the same weight, else every family
    along_way: bool = False  # Whether the smallest distance is that of the way, else that of the poses

    def __or__(self, other: Cut) -> Cut:
        """Combine two cuts."""
        return Cut(
            self.run if other.run is None else other.run,
            other.profile or self.profile,
            self.where + other.where,
            self.weighted or other.weighted,
            self.along_way or other.along_way,
        )


NONE = "–"
DEFAULT_RADII_M = (3.0, 5.0)


@dataclass(frozen=True)
class ReportRequest:
    """Runs, success rules and options of a report; all episodes, judged by a rule when it is first needed."""

    data: DataRoot  # Root of the release that the tasks are from; runs may be elsewhere
    runs: Sequence[Run]  # In the order and groups of the rows
    profiles: Sequence[Profile]  # Success rules; a cut without one is judged by the first
    radii_m: Sequence[float] = DEFAULT_RADII_M  # Of the table of radii, metres
    intervals: bool = True  # Whether 95 % intervals are shown
    paper_results: Sequence[PaperResult] = ()  # Results of the paper to show beside the runs'
    sample: Sample | None = None  # The tasks of the paper's protocol, to which the runs are cut

    @cached_property
    def breakdowns(self) -> Breakdowns:
        """Breakdowns of the episodes by difficulty and by what training shows."""
        return find_breakdowns(self.data, self.runs)

    @cached_method
    def column(self, name: str) -> Any:
        """Return a group of every episode, (n,): of the log's columns, ``malls``, ``run``, or a breakdown's parts."""
        if name == "run":
            return np.repeat(np.arange(len(self.runs)), [len(run.episodes) for run in self.runs])
        if name == "malls":
            return np.where(np.isin(self.column("scene"), MALLS), "malls", "other scenes")
        if name in GROUPS:
            return np.concatenate([run.episodes[name] for run in self.runs])
        return np.concatenate(self.breakdowns.found[name].labels)

    @cached_method
    def _judged(self, profile: Profile | None, along_way: bool) -> Floats:
        """Return the `METRICS` of every episode, (n, 6), by a profile."""
        return np.concatenate([
            np.column_stack(outcomes(
                run.episodes, profile or self.profiles[0], run.path_clearance_to_goal_m if along_way else None
            ))
            for run in self.runs
        ])  # fmt: skip

    def mask(self, cut: Cut) -> Bools:
        """Select the episodes of a cut."""
        mask = np.ones(len(self.column("run")), np.bool_)
        for name, value in (*cut.where, *([] if cut.run is None else [("run", cut.run)])):
            mask &= self.column(name) == value
        return mask

    def values(self, name: str, cut: Cut, order: Sequence[str] | None = None) -> list[str]:
        """List the values of a column that a cut has, in an order."""
        there = set(self.column(name)[self.mask(cut)].tolist()) - {""}
        return sorted(there) if order is None else [value for value in order if value in there]

    @cached_method
    def summary(self, cut: Cut) -> Summary:
        """Average a cut by scene, family and overall."""
        mask = self.mask(cut)
        values = self._judged(cut.profile, cut.along_way)[mask]
        return summarize_values(values, self.column("scene")[mask], self.column("family")[mask])

    def score(self, cut: Cut) -> Score:
        """Average a cut to one score."""
        if cut.weighted:
            return score(self._judged(cut.profile, cut.along_way)[self.mask(cut)])
        return self.summary(cut).overall

    @cached_method
    def interval(self, cut: Cut) -> Floats:
        """Return the 95 % intervals of a cut's overall `METRICS`, (2, 6)."""
        return bootstrap(self.summary(cut).scene_scores())

    def shown(self, metrics: Sequence[str] = METRICS, profile: Profile | None = None) -> list[str]:
        """Choose measures: SR-view only where any run logs it."""
        known = any(knows_views(run.episodes, profile or self.profiles[0]) for run in self.runs)
        return [name for name in metrics if known or name != "sr_view"]


@dataclass(frozen=True)
class Row:
    """A row of a table."""

    label: str
    cut: Cut
    section: str = ""  # Heading of its section; empty for none
    rank_group: str | None = ""  # Best values are marked among these; None for a row that is not compared
    leading: Mapping[str, str] = field(default_factory=dict)  # Cells that are no measures, by their headings
    result: PaperResult | None = None  # Of the paper, in place of episodes


@dataclass(frozen=True)
class Cell:
    """A column: a measure of a cut, or the difference of two."""

    group: str
    measure: str
    cut: Cut
    head: str = ""  # That of the measure where it is empty
    minus: tuple[str, Cut] | None = None


def profile_head(profile: Profile) -> str:
    """Name a success rule in a heading: its radius, and its name unless it is the benchmark's own."""
    return f"{'' if profile.own else f'{profile.name}, '}{profile.radius_m:g} m"


def printed(measure: str, value: float) -> float:
    """Return a value in the unit and with the digits in which it is printed; never a negative zero."""
    return round(value if MEASURES[measure].metres else 100.0 * value, 2) + 0.0


def text(measure: str, value: float, signed: bool = False) -> str:
    """Format a value: two decimals, as the paper has them; a dash for NaN."""
    return NONE if math.isnan(value) else f"{printed(measure, value):{'+' if signed else ''}.2f}".replace("-", "−")


def make_table(
    request: ReportRequest, title: str, rows: Sequence[Row], columns: Sequence[Cell], *, stub: str = "agent",
    notes: Sequence[str] = (), leading: Sequence[str] = (), spread: bool = False, intervals: bool = False,
) -> TextTable:  # fmt: skip
    """Evaluate a table: every cell is a measure of its row's and its column's episodes.

    `leading` are headings of columns that are no measures; `spread` shows deviations over scenes.
    """
    lines: list[tuple[str, tuple[str, ...]]] = []
    sections: dict[int, str] = {}
    ranked: list[dict[str, list[tuple[float, int]]]] = [{} for _ in columns]
    above = ""
    for row in rows:
        if row.section != above:
            sections[len(lines)] = above = row.section
        cells = []
        for column, group in zip(columns, ranked, strict=True):
            value, off = _value(request, row, column, spread)
            deviation = "" if math.isnan(off) else f" ± {text(column.measure, off)}"
            cells.append(text(column.measure, value, signed=column.minus is not None) + deviation)
            if row.rank_group is not None and column.minus is None and not math.isnan(value):
                figure = MEASURES[column.measure].direction * printed(column.measure, value)
                group.setdefault(row.rank_group, []).append((figure, len(lines)))
        lines.append((row.label, (*(row.leading.get(head, NONE) for head in leading), *cells)))
        if intervals and row.result is None:
            ends = [_interval(request, row.cut | column.cut, column.measure) for column in columns]
            lines += [("", ("",) * len(leading) + (*ends,))] if {*ends} != {NONE} else []
    shift = len(leading)
    marks = {(i, shift + k): mark for k, groups in enumerate(ranked) for i, mark in _marks(groups).items()}
    heads = [Column(head) for head in leading]
    heads += [Column(column.head or MEASURES[column.measure].head, column.group) for column in columns]
    return TextTable(stub, heads, lines, title, notes, sections, marks)


def _value(request: ReportRequest, row: Row, column: Cell, spread: bool) -> tuple[float, float]:
    """Return the value of a cell and its deviation over scenes; NaN for unknown."""
    cut = row.cut | column.cut
    if row.result is not None:
        profile = cut.profile or request.profiles[0]
        # Another rule at the same radius is another measure.
        key = (column.measure, profile.radius_m) if profile.own else ("", 0.0)
        return row.result.mean.get(key, math.nan), row.result.spread.get(key, math.nan)
    value: float = getattr(request.score(cut), column.measure)
    if column.minus is not None:
        value -= getattr(request.score(row.cut | column.minus[1]), column.minus[0])
    return value, getattr(request.summary(cut).deviation, column.measure) if spread else math.nan


def _interval(request: ReportRequest, cut: Cut, measure: str) -> str:
    low, high = request.interval(cut)[:, METRICS.index(measure)].tolist()
    return NONE if math.isnan(low) else f"{text(measure, low)}–{text(measure, high)}"


def _marks(groups: Mapping[str, Sequence[tuple[float, int]]]) -> dict[int, str]:
    """Find the best and second best of a column per rank group, as printed: equal figures share a mark."""
    marks = {}
    for ranked in groups.values():
        levels = sorted({value for value, _ in ranked}, reverse=True)
        # All equal: no best. Of two values the second is the last.
        named = dict(zip(levels, (BEST, SECOND) if len(levels) > 2 else (BEST,), strict=False))
        marks.update({i: named[value] for value, i in ranked if value in named and len(levels) > 1})
    return marks


def count_table(
    request: ReportRequest, title: str, rows: Sequence[Row], groups: Mapping[str, Sequence[str]],
    cells: Callable[[Run, Profile], tuple[str, ...]], notes: Sequence[str] = (),
) -> TextTable:  # fmt: skip
    """Make a table of counts, a row a run: visits that end as failures, or how episodes went."""
    profile = request.profiles[0]
    lines = []
    for row in rows:
        assert row.cut.run is not None
        run = request.runs[row.cut.run]
        for name, value in row.cut.where:
            run = run.where(run.episodes[name] == value)
        lines.append((row.label, cells(run, profile)))
    sections = {k: row.section for k, row in enumerate(rows) if row.section != (rows[k - 1].section if k else "")}
    heads = [Column(head, group) for group, names in groups.items() for head in names]
    return TextTable("agent", heads, lines, title, notes, sections)


def visit_cells(run: Run, profile: Profile) -> tuple[str, ...]:
    """Count episodes that were within the radius and are no success, by how they ended."""
    e = run.episodes
    judged = outcomes(e, profile)
    lost = judged.osr & ~judged.sr
    within = judged.dts_m <= profile.radius_m
    stopped = e["stop_called"] & ~e["collision"] & (e["n_actions"] <= e["action_budget"])
    unstopped = ~stopped & ~e["collision"]
    n = int(lost.sum())
    counts = (len(e), int(judged.osr.sum()), int(judged.sr.sum()), n)
    ends = (stopped, e["collision"], unstopped & ~within, unstopped & within)
    shares = (f"{100.0 * int((lost & end).sum()) / n:.1f}" if n else NONE for end in ends)
    return (*(f"{count:,}" for count in counts), *shares)


def outcome_cells(run: Run, _: Profile) -> tuple[str, ...]:
    """Say how episodes ended, and what a language-model service used."""
    ends = run.table["termination"].to_pylist()
    cells = [f"{100 * (ends.count(how) / len(ends)):.1f}" for how in TERMINATIONS]
    cells.append(f"{run.episodes['n_actions'].mean():.1f}")
    for name in ("n_refused", "n_invalid", "n_requests", "input_tokens", "output_tokens", "cost_usd"):
        column, digits = run.table[name], 2 if name == "cost_usd" else 0
        # A sum is not known where any episode does not know its part.
        cells.append(NONE if column.null_count else f"{math.fsum(column.to_pylist()):,.{digits}f}")
    return tuple(cells)


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
