"""The tables of an evaluation: overall, the paper's Tables 4 and 5, families, parts of the tasks, scenes.

Rates are per cent, distances metres; ± is the standard deviation over scenes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from aerialdojo_gen.base.paper_figures import PaperResult
from aerialdojo_gen.benchmark.grid import (
    NONE,
    Measure,
    Row,
    Table,
    measures_of,
    score_table,
    section_heads,
    values_of,
)
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
    """Name a success rule in a heading: its radius, and its name unless it is the benchmark's own."""
    name = "" if profile.name.startswith("aerialdojo") else f"{profile.name}, "
    return f"{name}{profile.radius_m:g} m"


def shown_measures(runs: Sequence[Run], profile: Profile, metrics: Sequence[str] = METRICS) -> tuple[Measure, ...]:
    """Choose the columns of scores: SR-view only where any run logs it."""
    return measures_of(any(knows_views(run.episodes, profile) for run in runs), metrics)


def run_row(run: Run, values: tuple[float, ...], rank_group: str = "", section: str | None = None) -> Row:
    """Make a run's row, under its group's heading; the oracle is not ranked."""
    return Row(
        run.label,
        values,
        run.group if section is None else section,
        None if GROUP_OF.get(run.agent) == UPPER_BOUND else rank_group,
    )


def parts_table(
    title: str,
    runs: Sequence[Run],
    profile: Profile,
    heads: Iterable[str],
    scores: Sequence[Iterable[Score | None]],
    metrics: Sequence[str] = METRICS,
    notes: Sequence[str] = (),
) -> Table:
    """Make a table with a row per run and a group of columns per part; `scores` are by run and part."""
    measures = shown_measures(runs, profile, metrics)
    rows = [
        run_row(run, tuple(v for score in own for v in values_of(score, measures)))
        for run, own in zip(runs, scores, strict=True)
    ]
    groups = [(head, measures) for head in heads]
    return score_table(f"{title}, {profile_head(profile)}", "agent", groups, rows, notes)


def _profiles_row(
    run: Run,
    shown: Sequence[tuple[Profile, tuple[Measure, ...]]],
    intervals: bool = False,
    leading: tuple[str, ...] = (),
) -> Row:
    """Score a run by several profiles, with deviations over scenes."""
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
    return replace(run_row(run, values), spreads=spreads, intervals=ends, leading_cells=leading)


def main_table(runs: Sequence[Run], profiles: Sequence[Profile]) -> Table:
    """Overall scores with their deviation over scenes, a group of columns per profile."""
    # Another radius changes neither the distance at the end nor the collisions.
    rates = ("sr", "sr_view", "osr", "spl")
    shown = [
        (p, shown_measures(runs, p, rates if k and p.planar == profiles[0].planar else METRICS))
        for k, p in enumerate(profiles)
    ]
    rows = [_profiles_row(run, shown, leading=(f"{len(run.episodes):,}",)) for run in runs]
    groups = [(profile_head(profile), measures) for profile, measures in shown]
    note = "Mean of the four families, each the mean of its scenes; ± is the standard deviation over scenes."
    return score_table("Overall", "agent", groups, rows, [note, *caveats(runs)], ("episodes",))


def caveats(runs: Sequence[Run]) -> list[str]:
    """Notes on what a comparison of runs lacks: families, episodes, common tasks."""
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
    """Define SR-view, or name the runs that do not log it, and why."""
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
    """Name the agents that were given hints."""
    told = [f"{run.label} ({run.told})" for run in runs if run.told]
    return [f"Told more than the goal: {', '.join(told)}."] if told else []


def family_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Scores by family."""
    families = list(FAMILIES.values())
    scores = [map(summarize(run.episodes, profile).families.get, families) for run in runs]
    return parts_table("By family", runs, profile, families, scores)


def slice_table(runs: Sequence[Run], profile: Profile, column: str) -> Table:
    """Scores by length setting (`column` = setting) or by modality (modality)."""
    order = SETTINGS if column == "setting" else MODALITIES
    scores = [map(_slice_scores(run, profile, column, order).get, order) for run in runs]
    return parts_table(f"By {column}", runs, profile, [NAMES[name] for name in order], scores)


def _slice_scores(run: Run, profile: Profile, column: str, order: Sequence[str]) -> dict[str, Score]:
    return {name: summarize(part, profile).overall for name, part in slices(run.episodes, column, order)}


def stacked_table(
    title: str, stub: str, runs: Sequence[Run], profile: Profile, rows: Sequence[str],
    scores: Sequence[dict[str, Score]],
) -> Table:  # fmt: skip
    """Make a table with a row per value of a column, a group of columns per run."""
    measures = shown_measures(runs, profile)
    lines = [
        Row(name, tuple(v for part in scores for v in values_of(part.get(name), measures)), rank_group=None)
        for name in rows
    ]
    return score_table(f"{title}, {profile_head(profile)}", stub, [(run.label, measures) for run in runs], lines)


def scene_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Scores by scene, a group of columns per run."""
    scores = [summarize(run.episodes, profile).scenes for run in runs]
    scenes = sorted({scene for part in scores for scene in part})
    return stacked_table("By scene", "scene", runs, profile, scenes, scores)


def conduct_table(runs: Sequence[Run]) -> Table:
    """How episodes ended, and what a language-model service used."""
    rows: list[tuple[str, tuple[str, ...]]] = []
    for run in runs:
        c = episode_outcomes(run)
        counts = (c.refused, c.invalid, c.requests, c.input_tokens, c.output_tokens)
        cells = [f"{100 * share:.1f}" for share in c.ended.values()]
        cells += [f"{c.actions:.1f}", *(NONE if count is None else f"{count:,}" for count in counts)]
        cells.append(NONE if c.cost_usd is None else f"{c.cost_usd:,.2f}")
        rows.append((run.label, tuple(cells)))
    sections = section_heads([run.group for run in runs])
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
    runs: Sequence[Run],
    profiles: Sequence[Profile],
    intervals: bool = True,
    paper_results: Sequence[PaperResult] = (),
) -> list[Table]:
    """Make a table per length setting that any run has flown."""
    return [
        _result_table(setting, part, profiles, intervals, [r for r in paper_results if r.setting == setting])
        for setting in SETTINGS
        if (part := in_setting(runs, setting))
    ]


def in_setting(runs: Sequence[Run], setting: str) -> list[Run]:
    """Return the runs' episodes of a setting, without runs that have none."""
    masks = [run.episodes.setting == setting for run in runs]
    return [run.where(mask) for run, mask in zip(runs, masks, strict=True) if mask.any()]


def _result_table(
    setting: str,
    runs: Sequence[Run],
    profiles: Sequence[Profile],
    intervals: bool,
    paper_results: Sequence[PaperResult],
) -> Table:
    shown: list[tuple[Profile, tuple[Measure, ...]]] = [
        (profile, shown_measures(runs, profile, _FURTHER if k else METRICS)) for k, profile in enumerate(profiles)
    ]
    lines = [_profiles_row(run, shown, intervals) for run in runs]
    lines += [_paper_line(result, shown) for result in paper_results]
    notes = ["Mean of the families, each the mean of its scenes; ± is the standard deviation over scenes."]
    if any(not math.isnan(low) for line in lines for low, _ in line.intervals):
        notes[0] += " Below: 95 % bootstrap interval, scenes drawn anew within their family."
    counts = {len(run.episodes) for run in runs}
    if len(counts) == 1:
        notes.append(f"{counts.pop():,} episodes each.")
    else:
        notes.append("Episodes: " + ", ".join(f"{run.label} {len(run.episodes):,}" for run in runs) + ".")
    if paper_results:
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
    """Yield each run's episodes by length setting, with the setting's heading."""
    for setting in SETTINGS:
        for run in in_setting(runs, setting):
            yield NAMES[setting], run


def partition_table(runs: Sequence[Run], profile: Profile) -> Table:
    """In-distribution scenes beside out-of-distribution scenes, in every length setting."""
    return _halves(runs, profile, "ID and OOD scenes", "partition", PARTITIONS, ("ID", "OOD", "OOD − ID, points"))


def goal_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Semantic goals beside image goals, in every length setting."""
    heads = ("Semantic goal", "Image goal", "image − semantic, points")
    return _halves(runs, profile, "Goal type", "modality", MODALITIES, heads)


def _halves(
    runs: Sequence[Run], profile: Profile, title: str, column: str, names: Sequence[str], heads: tuple[str, str, str]
) -> Table:
    """Scores for the two values of a column, and the difference of their rates."""
    lines = []
    measures = shown_measures(runs, profile)
    for section, run in by_setting(runs):
        parts = _slice_scores(run, profile, column, names)
        one, other = (values_of(parts.get(name), measures) for name in names)
        rates = (values_of(parts.get(name), _DIFFERENCES) for name in names)
        gap = tuple(b - a for a, b in zip(*rates, strict=True))
        lines.append(run_row(run, (*one, *other, *gap), rank_group=section, section=section))
    groups = list(zip(heads, (measures, measures, _DIFFERENCES), strict=True))
    return score_table(f"{title}, {profile_head(profile)}", "agent", groups, lines)


def type_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Scores by scene type, grouped by family, a group of columns per run."""
    family_of: dict[str, str] = {}
    scores = []
    for run in runs:
        family_of |= dict(zip(run.episodes.scene_type.tolist(), run.episodes.family.tolist(), strict=True))
        scores.append(_slice_scores(run, profile, "scene_type", sorted(family_of)))
    order = list(FAMILIES.values())
    types = sorted(family_of, key=lambda t: (order.index(f) if (f := family_of[t]) in order else len(order), t))
    table = stacked_table("By scene type", "scene type", runs, profile, types, scores)
    return replace(table, sections=section_heads([family_of[t] for t in types]))


def average_table(runs: Sequence[Run], profile: Profile) -> Table:
    """The mean of the families beside the mean of all episodes (paper, appendix C: different populations)."""
    scores = [(summarize(run.episodes, profile).overall, weighted_score(run.episodes, profile)) for run in runs]
    note = "A family counts a quarter on the left, as much as it has tasks on the right: two different populations."
    heads = ("mean of the families", "mean of the tasks")
    return parts_table("Two averages", runs, profile, heads, scores, notes=[note])


def masks_table(
    title: str, runs: Sequence[Run], profile: Profile, parts: Sequence[tuple[str, Sequence[Bools]]], note: str = ""
) -> Table | None:
    """Scores of parts of the episodes, masks (n,) per run; None where fewer than two parts have episodes."""
    filled = [(head, masks) for head, masks in parts if any(np.any(mask) for mask in masks)]
    if len(filled) < 2:
        return None
    scores = [[_mask_score(run, masks[k], profile) for _, masks in filled] for k, run in enumerate(runs)]
    heads = [head for head, _ in filled]
    return parts_table(title, runs, profile, heads, scores, _SHORT, [note] if note else [])


def _mask_score(run: Run, mask: Bools, profile: Profile) -> Score | None:
    return summarize(run.episodes.where(mask), profile).overall if mask.any() else None
