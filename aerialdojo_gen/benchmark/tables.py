"""The tables of an evaluation that speak of all its episodes: overall, families, parts, scenes, conduct, and the CSV.

Rates are per cent, distances metres; ± is the standard deviation over scenes. `formats` writes tables out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from aerialdojo_gen.benchmark.grid import NONE, Measure, Row, Table, measures_of, score_table, values_of
from aerialdojo_gen.benchmark.metrics import knows_views
from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.benchmark.runs import GROUP_OF, UPPER_BOUND, Run, episode_outcomes
from aerialdojo_gen.benchmark.scores import METRICS, Score, slices, summarize
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


def shown_measures(runs: Sequence[Run], profile: Profile, metrics: Sequence[str] = METRICS) -> tuple[Measure, ...]:
    """Choose the columns of scores: SR-view is one of them where any of the runs says it."""
    return measures_of(any(knows_views(run.episodes, profile) for run in runs), metrics)


def line_of(run: Run, values: tuple[float, ...], rivals: str = "", section: str | None = None) -> Row:
    """Make a run's line: under its group's heading, and out of the running where it knows the way."""
    return Row(
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
    rates = ("sr", "sr_view", "osr", "spl")
    shown = [
        (p, shown_measures(runs, p, rates if k and p.planar == profiles[0].planar else METRICS))
        for k, p in enumerate(profiles)
    ]
    lines, notes = [], []
    for run in runs:
        values: tuple[float, ...] = ()
        spreads: tuple[float, ...] = ()
        for profile, measures in shown:
            summary = summarize(run.episodes, profile)
            values += values_of(summary.overall, measures)
            spreads += values_of(summary.deviation, measures)
        line = line_of(run, values)
        lines.append(Row(line.label, values, line.section, line.rivals, spreads, before=(f"{len(run.episodes):,}",)))
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
    notes += _view_notes(runs) + _told_notes(runs)
    if len({frozenset(run.table["task_id"].to_pylist()) for run in runs}) > 1:
        notes.append("The runs flew different tasks: their scores are no comparison of agents.")
    return notes


def _view_notes(runs: Sequence[Run]) -> list[str]:
    """Say what SR-view is, or whose log lacks it and why."""
    lacking = [run.label for run in runs if np.isnan(run.episodes.view_distance_m).any()]
    notes = []
    if len(lacking) < len(runs):
        notes.append("SR-view: stopped that near to any valid viewpoint of the target, with the target in sight.")
    if lacking:
        notes.append(
            f"No SR-view of {', '.join(lacking)}: flown by an older version or on a release without viewpoints/. "
            "Flown again on a release that has them they have one."
        )
    return notes


def _told_notes(runs: Sequence[Run]) -> list[str]:
    """Say which agents were told more than the goal."""
    told = [f"{run.label} ({run.told})" for run in runs if run.told]
    return [f"Told more than the goal: {', '.join(told)}."] if told else []


def family_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set the families side by side."""
    measures = shown_measures(runs, profile)

    def values(run: Run) -> Iterable[float]:
        families = summarize(run.episodes, profile).families
        return (v for family in FAMILIES.values() for v in values_of(families.get(family), measures))

    groups = [(family, measures) for family in FAMILIES.values()]
    return run_table(f"By family, {profile_head(profile)}", runs, groups, values)


def slice_table(runs: Sequence[Run], profile: Profile, column: str) -> Table:
    """Set the length settings (`column` = setting) or the modalities (modality) side by side."""
    order = SETTINGS if column == "setting" else MODALITIES
    measures = shown_measures(runs, profile)

    def values(run: Run) -> Iterable[float]:
        parts = {name: summarize(part, profile).overall for name, part in slices(run.episodes, column, order)}
        return (v for name in order for v in values_of(parts.get(name), measures))

    groups = [(NAMES[name], measures) for name in order]
    return run_table(f"By {column}, {profile_head(profile)}", runs, groups, values)


def stacked_table(
    title: str, stub: str, runs: Sequence[Run], profile: Profile, rows: Sequence[str],
    scores: Sequence[dict[str, Score]],
) -> Table:  # fmt: skip
    """Set the values of a column below one another, a group of columns a run."""
    measures = shown_measures(runs, profile)
    lines = [
        Row(name, tuple(v for part in scores for v in values_of(part.get(name), measures)), rivals=None)
        for name in rows
    ]
    return score_table(f"{title}, {profile_head(profile)}", stub, [(run.label, measures) for run in runs], lines)


def scene_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set the scenes below one another, a group of columns a run."""
    scores = [summarize(run.episodes, profile).scenes for run in runs]
    scenes = sorted({scene for part in scores for scene in part})
    return stacked_table("By scene", "scene", runs, profile, scenes, scores)


def conduct_table(runs: Sequence[Run]) -> Table:
    """Say how episodes ended, and what an outside service was asked."""
    rows: list[tuple[str, tuple[str, ...]]] = []
    sections: dict[int, str] = {}
    above = ""
    for run in runs:
        c = episode_outcomes(run)
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
