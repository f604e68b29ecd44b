"""The paper's Tables 4 and 5: the agents' results in one length setting, at 3 m and at 5 m."""

from __future__ import annotations

import math
from collections.abc import Sequence

from aerialdojo_gen.base.paper_figures import PaperResult
from aerialdojo_gen.benchmark.grid import Measure, Row, Table, score_table, values_of
from aerialdojo_gen.benchmark.intervals import score_intervals
from aerialdojo_gen.benchmark.profiles import Profile
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.scores import METRICS, summarize
from aerialdojo_gen.benchmark.tables import NAMES, caveats, line_of, profile_head, shown_measures
from aerialdojo_gen.store.schemas import SETTINGS

_TABLES = {"base": "the form of the paper's Table 4", "standard": "the form of the paper's Table 5"}
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
    about = f" ({_TABLES[setting]})" if setting in _TABLES else ""
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
