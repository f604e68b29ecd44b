"""The tables of an evaluation: overall, the paper's Tables 4 and 5, families, parts of the tasks, scenes.

Rates are per cent, distances metres; ± is the standard deviation over scenes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from aerialdojo_gen.base.paper_figures import PaperResult
from aerialdojo_gen.benchmark.grid import NONE, Measure, Row, Table, measures_of, score_table, values_of
from aerialdojo_gen.benchmark.intervals import score_intervals
from aerialdojo_gen.benchmark.metrics import (
    METRICS,
    Bools,
    Profile,
    Score,
    knows_views,
    slices,
    summarize,
    weighted_score,
)
from aerialdojo_gen.benchmark.runs import GROUP_OF, UPPER_BOUND, Run, episode_outcomes
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


_PAPER_TABLES = {"base": "the form of the paper's Table 4", "standard": "the form of the paper's Table 5"}
# At every radius but the first, as in the paper.
_FURTHER = ("sr", "sr_view", "osr")


def result_tables(
    runs: Sequence[Run], profiles: Sequence[Profile], intervals: bool = True, beside: Sequence[PaperResult] = ()
) -> list[Table]:
    """Make a table for every length setting that any run has flown."""
    return [
        _result_table(setting, part, profiles, intervals, [r for r in beside if r.setting == setting])
        for setting in SETTINGS
        if (part := in_setting(runs, setting))
    ]


def in_setting(runs: Sequence[Run], setting: str) -> list[Run]:
    """Return the runs' episodes of a setting; runs that have none are left out."""
    masks = [run.episodes.setting == setting for run in runs]
    return [run.where(mask) for run, mask in zip(runs, masks, strict=True) if mask.any()]


def _result_table(
    setting: str, runs: Sequence[Run], profiles: Sequence[Profile], intervals: bool, beside: Sequence[PaperResult]
) -> Table:
    shown: list[tuple[Profile, tuple[Measure, ...]]] = [
        (profile, shown_measures(runs, profile, _FURTHER if k else METRICS)) for k, profile in enumerate(profiles)
    ]
    lines = []
    for run in runs:
        values: tuple[float, ...] = ()
        spreads: tuple[float, ...] = ()
        ends: tuple[tuple[float, float], ...] = ()
        for profile, measures in shown:
            summary = summarize(run.episodes, profile)
            values += values_of(summary.overall, measures)
            spreads += values_of(summary.deviation, measures)
            if intervals:
                known = dict(zip(METRICS, score_intervals(run.episodes, profile), strict=True))
                ends += tuple(known[m.metric] for m in measures)
        line = line_of(run, values)
        lines.append(Row(line.label, values, line.section, line.rivals, spreads, ends))
    lines += [_paper_line(result, shown) for result in beside]
    notes = ["Mean of the families, each the mean of its scenes; ± is the standard deviation over scenes."]
    if any(not math.isnan(low) for line in lines for low, _ in line.intervals):
        notes[0] += " Below: 95 % bootstrap interval, scenes drawn anew within their family."
    counts = {len(run.episodes) for run in runs}
    if len(counts) == 1:
        notes.append(f"{counts.pop():,} episodes each.")
    else:
        notes.append("Episodes: " + ", ".join(f"{run.label} {len(run.episodes):,}" for run in runs) + ".")
    if beside:
        notes.append(
            "The paper's agents flew in its own simulator (Unreal Engine), on other scenes and tasks, and what its ± "
            "is it does not say: its rows are no comparison with ours, and are ranked among themselves."
        )
    about = f" ({_PAPER_TABLES[setting]})" if setting in _PAPER_TABLES else ""
    groups = [(profile_head(profile), measures) for profile, measures in shown]
    return score_table(f"{NAMES[setting]}{about}", "agent", groups, lines, [*notes, *caveats(runs)])


def _paper_line(result: PaperResult, shown: Sequence[tuple[Profile, tuple[Measure, ...]]]) -> Row:
    # Another rule at the same radius is another measure.
    keys = [
        (m.metric, profile.radius_m) if profile.name.startswith("aerialdojo") else ("", 0.0)
        for profile, measures in shown
        for m in measures
    ]
    return Row(
        result.model,
        tuple(result.mean.get(key, math.nan) for key in keys),
        f"another simulator (Unreal Engine; {result.source}), {result.group}-source",
        "paper",
        tuple(result.spread.get(key, math.nan) for key in keys),
    )


_DIFFERENCES = (Measure("SR", "sr", signed=True), Measure("OSR", "osr", signed=True))
_SHORT = ("sr", "sr_view", "osr", "spl")


def by_setting(runs: Sequence[Run]) -> Iterable[tuple[str, Run]]:
    """Yield the parts of runs by length setting, with the heading that they stand under."""
    for setting in SETTINGS:
        for run in in_setting(runs, setting):
            yield NAMES[setting], run


def partition_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set scenes of the training's distribution beside those out of it, in every length setting."""
    return _halves(runs, profile, "ID and OOD scenes", "partition", PARTITIONS, ("ID", "OOD", "OOD − ID, points"))


def goal_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set semantic goals beside image goals, in every length setting."""
    heads = ("Semantic goal", "Image goal", "image − semantic, points")
    return _halves(runs, profile, "Goal type", "modality", MODALITIES, heads)


def _halves(
    runs: Sequence[Run], profile: Profile, title: str, column: str, names: Sequence[str], heads: tuple[str, str, str]
) -> Table:
    """Set the episodes of one value of a column beside those of the other, and the difference of their rates."""
    lines = []
    measures = shown_measures(runs, profile)
    for section, run in by_setting(runs):
        parts = {name: summarize(p, profile).overall for name, p in slices(run.episodes, column, names)}
        one, other = (values_of(parts.get(name), measures) for name in names)
        rates = (values_of(parts.get(name), _DIFFERENCES) for name in names)
        gap = tuple(b - a for a, b in zip(*rates, strict=True))
        lines.append(line_of(run, (*one, *other, *gap), rivals=section, section=section))
    groups = list(zip(heads, (measures, measures, _DIFFERENCES), strict=True))
    return score_table(f"{title}, {profile_head(profile)}", "agent", groups, lines)


def type_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set the scene types below one another, by family, a group of columns a run."""
    scores = []
    home: dict[str, str] = {}
    for run in runs:
        home |= dict(zip(run.episodes.scene_type.tolist(), run.episodes.family.tolist(), strict=True))
        found: dict[str, Score] = {}
        for name, part in slices(run.episodes, "scene_type", sorted(home)):
            found[name] = summarize(part, profile).overall
        scores.append(found)
    order = list(FAMILIES.values())
    types = sorted(home, key=lambda t: (order.index(home[t]) if home[t] in order else len(order), t))
    table = stacked_table("By scene type", "scene type", runs, profile, types, scores)
    heads = {i: home[t] for i, t in enumerate(types) if not i or home[t] != home[types[i - 1]]}
    return Table(table.title, table.stub, table.groups, table.rows, table.notes, heads, table.marks)


def average_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Set the mean of the families beside the mean of all episodes (paper, appendix C: different populations)."""
    measures = shown_measures(runs, profile)

    def values(run: Run) -> Iterable[float]:
        both = summarize(run.episodes, profile).overall, weighted_score(run.episodes, profile)
        return (value for score in both for value in values_of(score, measures))

    groups = [("mean of the families", measures), ("mean of the tasks", measures)]
    note = "A family counts a quarter on the left, as much as it has tasks on the right: two different populations."
    return run_table(f"Two averages, {profile_head(profile)}", runs, groups, values, [note])


def part_table(
    title: str, runs: Sequence[Run], profile: Profile, parts: Sequence[tuple[str, Sequence[Bools]]], note: str = ""
) -> Table | None:
    """Set parts of the episodes, boolean masks of (n,) a run, beside one another.

    None where not two parts have episodes.
    """
    there = [(head, masks) for head, masks in parts if any(np.any(mask) for mask in masks)]
    if len(there) < 2:
        return None
    lines: list[Row] = []
    measures = shown_measures(runs, profile, _SHORT)
    for k, run in enumerate(runs):
        values: tuple[float, ...] = ()
        for _, masks in there:
            part = run.episodes.where(masks[k])
            values += values_of(summarize(part, profile).overall if len(part) else None, measures)
        lines.append(line_of(run, values))
    groups = [(head, measures) for head, _ in there]
    return score_table(f"{title}, {profile_head(profile)}", "agent", groups, lines, [note] if note else [])
