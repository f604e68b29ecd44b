"""The tables of an evaluation as the paper prints them; `formats` writes them out.

Rates are per cent, distances metres; ± is the standard deviation over scenes.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.benchmark.runs import Run, conduct
from aerialdojo_gen.benchmark.scores import METRICS, Score, Summary, slices, summarize
from aerialdojo_gen.schemas import FAMILIES, SETTINGS

HEADS = {"sr": "SR ↑", "osr": "OSR ↑", "spl": "SPL ↑", "dts_m": "DTS ↓", "cr": "CR ↓"}
_NAMES = {
    "base": "Base",
    "standard": "Standard",
    "long_horizon": "Long-Horizon",
    "semantic": "Semantic",
    "image": "Image",
}
_NONE = "–"


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes
    ----------
    title : str
        What it shows.
    stub : str
        Head of the first column.
    groups : tuple of (str, tuple of str)
        Groups of columns: their head, and the heads of the columns.
    rows : tuple of (str, tuple of str)
        First column and cells.
    notes : tuple of str
        What must be known to read it.
    """

    title: str
    stub: str
    groups: tuple[tuple[str, tuple[str, ...]], ...]
    rows: tuple[tuple[str, tuple[str, ...]], ...]
    notes: tuple[str, ...] = ()


def main_table(runs: Sequence[Run], profiles: Sequence[Profile]) -> Table:
    """Set overall scores side by side, with their deviation over scenes, a group of columns a profile."""
    rows, notes = [], []
    for run in runs:
        cells: list[str] = []
        for profile in profiles:
            summary = summarize(run.episodes, profile)
            cells += _cells(summary.overall, summary.deviation)
        rows.append((run.label, (f"{len(run.episodes):,}", *cells)))
        if missing := summarize(run.episodes, profiles[0]).missing_families:
            notes.append(f"{run.label}: no episodes of {', '.join(missing)}; overall is the mean of the others.")
        if run.failed:
            notes.append(f"{run.label}: {run.failed:,} more episodes failed for reasons outside the agent.")
    if len({frozenset(run.table["task_id"].to_pylist()) for run in runs}) > 1:
        notes.append("The runs flew different tasks: their scores are no comparison of agents.")
    groups = [("", ("episodes",)), *((_profile_head(profile), tuple(HEADS.values())) for profile in profiles)]
    notes.insert(
        0, "Mean of the four families, each the mean of its scenes; ± is the standard deviation over scenes."
    )
    return Table("Overall", "agent", tuple(groups), tuple(rows), tuple(notes))


def family_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set the families side by side."""
    rows = []
    for run in runs:
        summary = summarize(run.episodes, profile)
        rows.append((run.label, _joined(summary.families.get(family) for family in FAMILIES.values())))
    groups = tuple((family, tuple(HEADS.values())) for family in FAMILIES.values())
    return Table(f"By family, {_profile_head(profile)}", "agent", groups, tuple(rows))


def slice_table(runs: Sequence[Run], profile: Profile, column: str) -> Table:
    """Set the length settings (`column` = setting) or the modalities (modality) side by side."""
    order = SETTINGS if column == "setting" else ("semantic", "image")
    rows = []
    for run in runs:
        parts = {name: summarize(part, profile).overall for name, part in slices(run.episodes, column, order)}
        rows.append((run.label, _joined(parts.get(name) for name in order)))
    groups = tuple((_NAMES[name], tuple(HEADS.values())) for name in order)
    return Table(f"By {column}, {_profile_head(profile)}", "agent", groups, tuple(rows))


def scene_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set the scenes below one another, a group of columns a run."""
    summaries = [summarize(run.episodes, profile) for run in runs]
    scenes = sorted({scene for summary in summaries for scene in summary.scenes})
    rows = tuple((scene, _joined(summary.scenes.get(scene) for summary in summaries)) for scene in scenes)
    groups = tuple((run.label, tuple(HEADS.values())) for run in runs)
    return Table(f"By scene, {_profile_head(profile)}", "scene", groups, rows)


def conduct_table(runs: Sequence[Run]) -> Table:
    """Say how episodes ended, and what an outside service was asked."""
    rows = []
    for run in runs:
        c = conduct(run)
        counts = (c.refused, c.invalid, c.requests, c.input_tokens, c.output_tokens)
        cells = [f"{100 * share:.1f}" for share in c.ended.values()]
        cells += [f"{c.actions:.1f}", *(_NONE if count is None else f"{count:,}" for count in counts)]
        cells.append(_NONE if c.cost_usd is None else f"{c.cost_usd:,.2f}")
        rows.append((run.label, tuple(cells)))
    groups = (
        ("ended by, %", ("Stop", "collision", "budget")),
        ("actions", ("mean", "refused", "unreadable")),
        ("service", ("requests", "tokens in", "tokens out", "USD")),
    )
    return Table("How episodes went", "agent", groups, tuple(rows))


def tables_of(runs: Sequence[Run], profiles: Sequence[Profile]) -> list[Table]:
    """Make the tables of a report; all but the first judge by the first profile."""
    first = profiles[0]
    by_part = [family_table(runs, first), slice_table(runs, first, "setting"), slice_table(runs, first, "modality")]
    return [main_table(runs, profiles), *by_part, conduct_table(runs)]


def _profile_head(profile: Profile) -> str:
    name = "" if profile.name.startswith("aerialdojo") else f"{profile.name}, "
    return f"{name}{profile.radius_m:g} m"


def _cells(score: Score | None, deviation: Score | None = None) -> tuple[str, ...]:
    if score is None:
        return (_NONE,) * len(METRICS)
    cells = []
    for metric in METRICS:
        scale = 1.0 if metric == "dts_m" else 100.0
        value = getattr(score, metric)
        cell = _NONE if math.isnan(value) else f"{scale * value:.1f}"
        if deviation is not None and not math.isnan(spread := getattr(deviation, metric)):
            cell += f" ± {scale * spread:.1f}"
        cells.append(cell)
    return tuple(cells)


def _joined(scores: Iterable[Score | None]) -> tuple[str, ...]:
    return tuple(cell for score in scores for cell in _cells(score))


def as_csv(runs: Sequence[Run], profiles: Sequence[Profile]) -> str:
    """Write every score as one row of a tidy CSV: fractions and metres, unrounded; empty where there is none."""
    out = io.StringIO()
    write = csv.writer(out, lineterminator="\n").writerow
    deviations = [f"{metric}_sd" for metric in METRICS]
    write(
        [
            "run",
            "agent",
            "profile",
            "radius_m",
            "setting",
            "modality",
            "scope",
            "name",
            "episodes",
            *METRICS,
            *deviations,
        ]
    )
    for run in runs:
        parts = [("all", "all", run.episodes)]
        parts += [(name, "all", part) for name, part in slices(run.episodes, "setting", SETTINGS)]
        parts += [("all", name, part) for name, part in slices(run.episodes, "modality", ("semantic", "image"))]
        for profile in profiles:
            for setting, modality, part in parts:
                head = [run.name, run.agent, profile.name, profile.radius_m, setting, modality]
                for scope, name, score, spread in _scores(summarize(part, profile)):
                    values = [getattr(s, m) if s else math.nan for s in (score, spread) for m in METRICS]
                    write([*head, scope, name, score.episodes, *("" if math.isnan(v) else v for v in values)])
    return out.getvalue()


def _scores(summary: Summary) -> list[tuple[str, str, Score, Score | None]]:
    return [
        ("overall", "overall", summary.overall, summary.deviation),
        *(("family", name, score, None) for name, score in summary.families.items()),
        *(("scene", name, score, None) for name, score in summary.scenes.items()),
    ]
