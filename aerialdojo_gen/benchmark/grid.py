"""What a table of scores is made of: columns of measures, a line an agent, the best of them marked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from aerialdojo_gen.benchmark.scores import METRICS, Score

HEADS = {"sr": "SR ↑", "sr_view": "SR-view ↑", "osr": "OSR ↑", "spl": "SPL ↑", "dts_m": "DTS ↓", "cr": "CR ↓"}
NONE = "–"
BEST, SECOND = "best", "second"


@dataclass(frozen=True)
class Table:
    """A table of text."""

    title: str  # What it shows
    stub: str  # Head of the first column
    groups: tuple[tuple[str, tuple[str, ...]], ...]  # Groups of columns: their head, and the heads of the columns
    rows: tuple[tuple[str, tuple[str, ...]], ...]  # tuple of (str, tuple of str)
    notes: tuple[str, ...] = ()  # What must be known to read it
    sections: Mapping[int, str] = field(default_factory=dict)
    marks: Mapping[tuple[int, int], str] = field(default_factory=dict)  # `BEST` or `SECOND`, by row and cell


@dataclass(frozen=True)
class Measure:
    """A column of a table of scores."""

    head: str  # Its heading
    metric: str
    signed: bool = False  # Whether it is a difference: printed with its sign, and none is the best

    def text(self, value: float) -> str:
        """Format a value: two decimals, as the paper has them; a dash for NaN."""
        if math.isnan(value):
            return NONE
        shown = f"{self.printed(value):{'+' if self.signed else ''}.2f}"
        return shown.replace("-", "−")

    def printed(self, value: float) -> float:
        """Return a value in the unit and with the digits in which it is printed; never a negative zero."""
        return round(value if self.metric == "dts_m" else 100.0 * value, 2) + 0.0

    @property
    def direction(self) -> int:
        """1 where more is better, -1 where less is, 0 for differences."""
        return 0 if self.signed else -1 if self.metric in ("dts_m", "cr") else 1


MEASURES = tuple(Measure(HEADS[metric], metric) for metric in METRICS)


@dataclass(frozen=True)
class Row:
    """A line of a table of scores."""

    label: str  # First column
    values: tuple[float, ...]  # A value a measure: fractions and metres; NaN where there is none
    section: str = ""  # Heading that it stands under; empty for none
    rivals: str | None = ""
    spreads: tuple[float, ...] = ()  # ± of every value, or empty
    intervals: tuple[tuple[float, float], ...] = ()  # Interval of every value, or empty; printed in a row of its own
    before: tuple[str, ...] = ()  # Cells of columns that are no measures, and stand first


def measures_of(known: bool, metrics: Sequence[str] = METRICS) -> tuple[Measure, ...]:
    """Take measures by their metrics; SR-view only where it is known of any run."""
    return tuple(m for m in MEASURES if m.metric in metrics and (known or m.metric != "sr_view"))


def values_of(score: Score | None, measures: Sequence[Measure]) -> tuple[float, ...]:
    """Take the measures out of a score; NaN where there is none."""
    return tuple(math.nan if score is None else float(getattr(score, m.metric)) for m in measures)


def score_table(
    title: str,
    stub: str,
    groups: Sequence[tuple[str, Sequence[Measure]]],
    lines: Sequence[Row],
    notes: Sequence[str] = (),
    before: tuple[str, ...] = (),
) -> Table:
    """Write lines of scores as a table."""
    measures = [m for _, part in groups for m in part]
    rows: list[tuple[str, tuple[str, ...]]] = []
    sections: dict[int, str] = {}
    row_of: list[int] = []
    above = ""
    for line in lines:
        if line.section != above:
            sections[len(rows)] = above = line.section
        row_of.append(len(rows))
        cells = [m.text(v) for m, v in zip(measures, line.values, strict=True)]
        for k, spread in enumerate(line.spreads):
            if not math.isnan(spread):
                cells[k] += f" ± {measures[k].text(spread)}"
        rows.append((line.label, (*line.before, *cells)))
        if any(not math.isnan(low) for low, _ in line.intervals):
            shown = tuple(_interval(m, *ends) for m, ends in zip(measures, line.intervals, strict=True))
            rows.append(("", ("",) * len(before) + shown))
    marks = {
        (row_of[i], len(before) + k): mark
        for k, measure in enumerate(measures)
        for i, mark in _marks(measure, lines, k).items()
    }
    heads = [(head, tuple(m.head for m in part)) for head, part in groups]
    if before:
        heads.insert(0, ("", before))
    return Table(title, stub, tuple(heads), tuple(rows), tuple(notes), sections, marks)


def _interval(measure: Measure, low: float, high: float) -> str:
    return NONE if math.isnan(low) else f"{measure.text(low)}–{measure.text(high)}"


def _marks(measure: Measure, lines: Sequence[Row], k: int) -> dict[int, str]:
    """Find the best and the second best of a column among rivals, as they are printed: equal figures share a mark."""
    if not measure.direction:
        return {}
    races: dict[str, list[tuple[float, int]]] = {}
    for i, line in enumerate(lines):
        if line.rivals is not None and not math.isnan(line.values[k]):
            value = measure.direction * measure.printed(line.values[k])
            races.setdefault(line.rivals, []).append((value, i))
    marks = {}
    for race in races.values():
        levels = sorted({value for value, _ in race}, reverse=True)
        # Where all are alike there is no best.
        if len(levels) < 2:
            continue
        for value, i in race:
            if value == levels[0]:
                marks[i] = BEST
            # The last is second only in name.
            elif value == levels[1] and len(levels) > 2:
                marks[i] = SECOND
    return marks
