"""Tables of counts, a row a run: visits that end as failures, and how episodes went."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from aerialdojo_gen.base.text_table import Column, TextTable
from aerialdojo_gen.benchmark.metrics import Profile, outcomes
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.tables import NONE, ReportRequest, Row
from aerialdojo_gen.store.schemas import TERMINATIONS


@dataclass(frozen=True)
class CountSpec:
    """How a table of counts is made, a row a run."""

    title: str
    groups: Mapping[str, Sequence[str]]
    rows: Callable[[ReportRequest], Sequence[Row]]
    cells: Callable[[Run, Profile], tuple[str, ...]]
    note: str = ""
    headed: bool = False


def count_table(spec: CountSpec, request: ReportRequest) -> TextTable:
    """Make a table of counts."""
    profile, rows = request.profiles[0], spec.rows(request)
    lines = []
    for row in rows:
        assert row.cut.run is not None
        run = request.runs[row.cut.run]
        for name, value in row.cut.where:
            run = run.where(getattr(run.episodes, name) == value)
        lines.append((row.label, spec.cells(run, profile)))
    sections = {k: row.section for k, row in enumerate(rows) if row.section != (rows[k - 1].section if k else "")}
    heads = [Column(head, group) for group, names in spec.groups.items() for head in names]
    title = f"{spec.title}, {profile.radius_m:g} m" if spec.headed else spec.title
    notes = [spec.note.format(radius=f"{profile.radius_m:g} m")] if spec.note else []
    return TextTable("agent", heads, lines, title, notes, sections)


def visit_cells(run: Run, profile: Profile) -> tuple[str, ...]:
    """Count episodes that were within the radius and are no success, by how they ended."""
    e = run.episodes
    judged = outcomes(e, profile)
    lost = judged.oracle_success & ~judged.success
    within = judged.distance_m <= profile.radius_m
    stopped = e.stop_called & ~e.collision & (e.n_actions <= e.action_budget)
    unstopped = ~stopped & ~e.collision
    n = int(lost.sum())
    counts = (len(e), int(judged.oracle_success.sum()), int(judged.success.sum()), n)
    ends = (stopped, e.collision, unstopped & ~within, unstopped & within)
    shares = (f"{100.0 * int((lost & end).sum()) / n:.1f}" if n else NONE for end in ends)
    return (*(f"{count:,}" for count in counts), *shares)


def conduct_cells(run: Run, _: Profile) -> tuple[str, ...]:
    """Say how episodes ended, and what a language-model service used."""
    ends = run.table["termination"].to_pylist()
    cells = [f"{100 * (ends.count(how) / len(ends)):.1f}" for how in TERMINATIONS]
    cells.append(f"{run.episodes.n_actions.mean():.1f}")
    for name, form in (
        ("n_refused", ",.0f"), ("n_invalid", ",.0f"), ("n_requests", ",.0f"), ("input_tokens", ",.0f"),
        ("output_tokens", ",.0f"), ("cost_usd", ",.2f"),
    ):  # fmt: skip
        column = run.table[name]
        # A sum is not known where any episode does not know its part.
        cells.append(NONE if column.null_count else f"{math.fsum(column.to_pylist()):{form}}")
    return tuple(cells)
