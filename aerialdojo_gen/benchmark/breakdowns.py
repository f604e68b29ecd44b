"""Scores by what tasks differ in: partition, goal, scene type, averaging, seen targets, difficulty."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from aerialdojo_gen.benchmark.grid import Measure, Row, Table, score_table, values_of
from aerialdojo_gen.benchmark.metrics import Bools
from aerialdojo_gen.benchmark.paper_tables import in_setting
from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.scores import Score, slices, summarize, weighted_score
from aerialdojo_gen.benchmark.tables import (
    MODALITIES,
    NAMES,
    PARTITIONS,
    line_of,
    profile_head,
    run_table,
    shown_measures,
    stacked_table,
)
from aerialdojo_gen.store.schemas import FAMILIES, SETTINGS

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
