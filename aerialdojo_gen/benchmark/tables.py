"""The tables of an evaluation that speak of all its episodes: overall, families, parts, scenes, conduct, and the CSV.

Rates are per cent, distances metres; ± is the standard deviation over scenes. `formats` writes tables out.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Sequence

from aerialdojo_gen.benchmark.grid import MEASURES, NONE, Line, Measure, Table, score_table, values_of
from aerialdojo_gen.benchmark.intervals import score_intervals
from aerialdojo_gen.benchmark.metrics import Episodes
from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.benchmark.runs import GROUP_OF, UPPER_BOUND, Run, conduct
from aerialdojo_gen.benchmark.scores import METRICS, Score, Summary, slices, summarize, weighted_score
from aerialdojo_gen.common.paper import PaperResult
from aerialdojo_gen.store.schemas import FAMILIES, SETTINGS

MODALITIES = ("semantic", "image")
PARTITIONS = ("ID", "OOD")
NAMES = {
    "base": "Base",
    "standard": "Standard",
    "long_horizon": "Long-Horizon",
    "semantic": "Semantic",
    "image": "Image",
}


def profile_head(profile: Profile) -> str:
    """Name a rule in a heading: its radius, and its name where it is not the benchmark's own."""
    name = "" if profile.name.startswith("aerialdojo") else f"{profile.name}, "
    return f"{name}{profile.radius_m:g} m"


def line_of(run: Run, values: tuple[float, ...], rivals: str = "", section: str | None = None) -> Line:
    """Make a run's line: under its group's heading, and out of the running where it knows the way."""
    return Line(
        run.label,
        values,
        run.group if section is None else section,
        None if GROUP_OF.get(run.agent) == UPPER_BOUND else rivals,
    )


def run_table(
    title: str,
    runs: Sequence[Run],
    groups: Sequence[tuple[str, Sequence[Measure]]],
    values: Callable[[Run], Iterable[float]],
    notes: Sequence[str] = (),
) -> Table:
    """Make a table with a line a run."""
    return score_table(title, "agent", groups, [line_of(run, tuple(values(run))) for run in runs], notes)


def main_table(runs: Sequence[Run], profiles: Sequence[Profile]) -> Table:
    """Set overall scores side by side, with their deviation over scenes, a group of columns a profile."""
    # Another radius changes neither the distance at the end nor the collisions.
    shown = [(p, MEASURES[:3] if k and p.planar == profiles[0].planar else MEASURES) for k, p in enumerate(profiles)]
    lines, notes = [], []
    for run in runs:
        values: tuple[float, ...] = ()
        spreads: tuple[float, ...] = ()
        for profile, measures in shown:
            summary = summarize(run.episodes, profile)
            values += values_of(summary.overall, measures)
            spreads += values_of(summary.deviation, measures)
        line = line_of(run, values)
        lines.append(Line(line.label, values, line.section, line.rivals, spreads, before=(f"{len(run.episodes):,}",)))
    groups = [(profile_head(profile), measures) for profile, measures in shown]
    notes.append("Mean of the four families, each the mean of its scenes; ± is the standard deviation over scenes.")
    return score_table("Overall", "agent", groups, lines, [*notes, *caveats(runs)], ("episodes",))


def caveats(runs: Sequence[Run]) -> list[str]:
    """Say what a comparison of runs lacks: families, episodes, common tasks."""
    lacking: dict[tuple[str, ...], list[str]] = {}
    for run in runs:
        if missing := tuple(f for f in FAMILIES.values() if not (run.episodes.family == f).any()):
            lacking.setdefault(missing, []).append(run.label)
    notes = [
        f"{', '.join(labels)}: no episodes of {', '.join(missing)}; overall is the mean of the others."
        for missing, labels in lacking.items()
    ]
    notes += [
        f"{run.label}: {run.failed:,} more episodes failed for reasons outside the agent."
        for run in runs
        if run.failed
    ]
    if len({frozenset(run.table["task_id"].to_pylist()) for run in runs}) > 1:
        notes.append("The runs flew different tasks: their scores are no comparison of agents.")
    return notes


def family_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set the families side by side."""

    def values(run: Run) -> Iterable[float]:
        families = summarize(run.episodes, profile).families
        return (v for family in FAMILIES.values() for v in values_of(families.get(family)))

    groups = [(family, MEASURES) for family in FAMILIES.values()]
    return run_table(f"By family, {profile_head(profile)}", runs, groups, values)


def slice_table(runs: Sequence[Run], profile: Profile, column: str) -> Table:
    """Set the length settings (`column` = setting) or the modalities (modality) side by side."""
    order = SETTINGS if column == "setting" else MODALITIES

    def values(run: Run) -> Iterable[float]:
        parts = {name: summarize(part, profile).overall for name, part in slices(run.episodes, column, order)}
        return (v for name in order for v in values_of(parts.get(name)))

    return run_table(
        f"By {column}, {profile_head(profile)}", runs, [(NAMES[name], MEASURES) for name in order], values
    )


def stacked_table(
    title: str, stub: str, runs: Sequence[Run], rows: Sequence[str], scores: Sequence[dict[str, Score]]
) -> Table:
    """Set the values of a column below one another, a group of columns a run."""
    lines = [Line(name, tuple(v for part in scores for v in values_of(part.get(name))), rivals=None) for name in rows]
    return score_table(title, stub, [(run.label, MEASURES) for run in runs], lines)


def scene_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set the scenes below one another, a group of columns a run."""
    scores = [summarize(run.episodes, profile).scenes for run in runs]
    scenes = sorted({scene for part in scores for scene in part})
    return stacked_table(f"By scene, {profile_head(profile)}", "scene", runs, scenes, scores)


def conduct_table(runs: Sequence[Run]) -> Table:
    """Say how episodes ended, and what an outside service was asked."""
    rows: list[tuple[str, tuple[str, ...]]] = []
    sections: dict[int, str] = {}
    above = ""
    for run in runs:
        c = conduct(run)
        counts = (c.refused, c.invalid, c.requests, c.input_tokens, c.output_tokens)
        cells = [f"{100 * share:.1f}" for share in c.ended.values()]
        cells += [f"{c.actions:.1f}", *(NONE if count is None else f"{count:,}" for count in counts)]
        cells.append(NONE if c.cost_usd is None else f"{c.cost_usd:,.2f}")
        if run.group != above:
            sections[len(rows)] = above = run.group
        rows.append((run.label, tuple(cells)))
    groups = (
        ("ended by, %", ("Stop", "collision", "budget")),
        ("actions", ("mean", "refused", "unreadable")),
        ("service", ("requests", "tokens in", "tokens out", "USD")),
    )
    return Table("How episodes went", "agent", groups, tuple(rows), sections=sections)


_CSV_HEAD = ("run", "agent", "profile", "radius_m", "setting", "modality", "scope", "name", "episodes")


def as_csv(runs: Sequence[Run], profiles: Sequence[Profile], beside: Sequence[PaperResult] = ()) -> str:
    """Write every score as one row of a tidy CSV: fractions and metres, unrounded; empty where there is none.

    Parameters
    ----------
    runs, profiles
        What is scored, and by which rules.
    beside : sequence of PaperResult
        Results of the paper, written as rows of the run ``paper``.

    Returns
    -------
    str
        Scopes: ``overall`` (with ``_sd`` over scenes and 95 % intervals), ``task_weighted`` (the mean of all
        episodes), ``family``, ``partition``, ``scene_type``, ``scene``.
    """
    out = io.StringIO()
    write = csv.writer(out, lineterminator="\n").writerow
    ends = [f"{metric}_{end}95" for metric in METRICS for end in ("low", "high")]
    write([*_CSV_HEAD, *METRICS, *(f"{metric}_sd" for metric in METRICS), *ends])
    for run in runs:
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
                for scope, name, score, more in _scores(part, profile):
                    values = [getattr(score, m) for m in METRICS] + more
                    write([*head, scope, name, score.episodes, *("" if math.isnan(v) else v for v in values)])
    for result in beside:
        for profile in profiles:
            keys = [(metric, profile.radius_m) for metric in METRICS]
            if profile.name.startswith("aerialdojo") and any(key in result.mean for key in keys):
                row = [kind.get(key, "") for kind in (result.mean, result.spread) for key in keys]
                head = ["paper", result.model, profile.name, profile.radius_m, result.setting, "all"]
                write([*head, "overall", "overall", "", *row, *[""] * len(ends)])
    return out.getvalue()


def _scores(part: Episodes, profile: Profile) -> list[tuple[str, str, Score, list[float]]]:
    """Score a part of a log in every scope, with deviations and ends of intervals where they are known."""
    summary: Summary = summarize(part, profile)
    unknown = [math.nan] * (3 * len(METRICS))
    known = [getattr(summary.deviation, m) for m in METRICS]
    known += [end for ends in score_intervals(part, profile) for end in ends]
    return [
        ("overall", "overall", summary.overall, known),
        ("task_weighted", "task_weighted", weighted_score(part, profile), unknown),
        *(("family", name, score, unknown) for name, score in summary.families.items()),
        *(
            (column, name, summarize(half, profile).overall, unknown)
            for column in ("partition", "scene_type")
            for name, half in slices(part, column, sorted(set(getattr(part, column).tolist())))
        ),
        *(("scene", name, score, unknown) for name, score in summary.scenes.items()),
    ]
