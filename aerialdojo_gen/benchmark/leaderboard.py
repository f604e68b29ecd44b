"""The leaderboard: one HTML file with a table for every setting, that loads nothing and sorts by a click."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, groupby
from pathlib import Path

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.paper_figures import PaperResult, results
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.benchmark.metrics import DEFAULT_PROFILES, MEASURES, METRICS, PROFILES
from aerialdojo_gen.benchmark.registry import NAMES_OF
from aerialdojo_gen.benchmark.report import page_environment, page_parts
from aerialdojo_gen.benchmark.scoring import SCORE, ScoreCard, ScoreRow, scored_runs
from aerialdojo_gen.benchmark.tables import NONE, text
from aerialdojo_gen.store.atomic import atomic_file, make_folder
from aerialdojo_gen.store.schemas import SETTINGS

_NEAR_M, _FAR_M = (PROFILES[name].radius_m for name in DEFAULT_PROFILES)
_TITLES = NAMES_OF | {"all": "All settings"}


@dataclass(frozen=True)
class Head:
    """A column of scores."""

    group: str
    metric: str
    radius_m: float
    partition: str
    adapted: bool | None = None  # Only of agents that were, or were not, trained on OOD scenes; None for all


_HEADS = (
    *(Head(f"all scenes, {_NEAR_M:g} m", metric, _NEAR_M, "all") for metric in METRICS),
    *(Head(f"{_FAR_M:g} m", metric, _FAR_M, "all") for metric in ("sr", "osr")),
    *(Head("ID", metric, _NEAR_M, "ID") for metric in ("sr", "spl")),
    *(Head("OOD", metric, _NEAR_M, "OOD", False) for metric in ("sr", "spl")),
    *(Head("OOD, adapted", metric, _NEAR_M, "OOD", True) for metric in ("sr", "spl")),
)


@dataclass(frozen=True)
class Cell:
    """A figure, with its interval or deviation."""

    value: float | None
    shown: str
    spread: str = ""


@dataclass(frozen=True)
class Row:
    """A row: a scored run, or one of the paper's."""

    label: str
    agent: str
    episodes: int | None
    cells: Sequence[Cell]
    is_paper: bool = False


def write_leaderboard(folder: Path, page: Path) -> int:
    """Write the page of a folder of scored runs; returns how many there are."""
    cards = scored_runs(folder)
    if not cards:
        raise StoreError(
            f"{folder} has no scored run (*/{SCORE}): score a submission with score FILE --into {folder}"
        )
    scored = [(card, row) for card in cards for row in card.rows]
    heads = [head for head in _HEADS if any(_has(head, row, card.adapted) for card, row in scored)]
    groups = [(group, len(list(part))) for group, part in groupby(heads, key=lambda head: head.group)]
    tables = {_TITLES[setting]: _lines(cards, setting, heads) for setting in (*SETTINGS, "all")}
    template = page_environment().get_template("leaderboard.html.j2")
    html = template.render(
        version=__version__,
        cards=cards,
        heads=heads,
        measures=MEASURES,
        groups=groups,
        starts={0, *accumulate(count for _, count in groups)},
        tables={title: lines for title, lines in tables.items() if any(not line.is_paper for line in lines)},
        **page_parts(["report.css", "leaderboard.css"], "leaderboard.js"),
    )
    make_folder(page.parent)
    with atomic_file(page.parent, page.name) as temporary:
        temporary.write_text(html, encoding="utf-8")
    return len(cards)


def _has(head: Head, row: ScoreRow, adapted: bool) -> bool:
    at = row.partition, row.radius_m
    return at == (head.partition, head.radius_m) and _cell(head, row, adapted).value is not None


def _lines(cards: Sequence[ScoreCard], setting: str, heads: Sequence[Head]) -> list[Row]:
    """Make the rows of a setting, the highest success rate first."""
    lines = []
    for card in cards:
        rows = {(row.partition, row.radius_m): row for row in card.rows if row.setting == setting}
        if rows:
            cells = [_cell(head, rows.get((head.partition, head.radius_m)), card.adapted) for head in heads]
            label = f"{card.name} + {card.told}" if card.told else card.name
            lines.append(Row(label, card.agent, rows["all", _NEAR_M].episodes, cells))
    lines += [_paper_row(result, heads) for result in results() if result.setting == setting]
    return sorted(lines, key=lambda line: -(line.cells[0].value or 0.0))


def _cell(head: Head, row: ScoreRow | None, adapted: bool) -> Cell:
    value = None if row is None or head.adapted not in (None, adapted) else row.mean.get(head.metric)
    if row is None or value is None:
        return Cell(None, NONE)
    low, high = row.low.get(head.metric), row.high.get(head.metric)
    ends = "" if low is None or high is None else f"{text(head.metric, low)}–{text(head.metric, high)}"
    return Cell(value, text(head.metric, value), ends)


def _paper_row(result: PaperResult, heads: Sequence[Head]) -> Row:
    cells = []
    for head in heads:
        key = head.metric, head.radius_m
        value = result.mean.get(key) if head.partition == "all" else None
        spread = result.spread.get(key)
        shown = f"± {text(head.metric, spread)}" if value is not None and spread is not None else ""
        cells.append(Cell(value, NONE if value is None else text(head.metric, value), shown))
    return Row(result.model, "paper", None, cells, is_paper=True)
