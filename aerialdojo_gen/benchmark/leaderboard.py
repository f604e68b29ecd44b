"""The leaderboard: one HTML file with a table for every setting, that loads nothing and sorts by a click."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate, groupby
from pathlib import Path
from typing import NamedTuple

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.paper_figures import results
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.benchmark.metrics import DEFAULT_PROFILES, MEASURES, METRICS, PROFILES
from aerialdojo_gen.benchmark.registry import NAMES_OF
from aerialdojo_gen.benchmark.report import page_environment, page_parts
from aerialdojo_gen.benchmark.scoring import SCORE, ScoreCard, ScoreRow, scored_runs
from aerialdojo_gen.benchmark.tables import NONE, text
from aerialdojo_gen.store.atomic import atomic_write, make_folder
from aerialdojo_gen.store.schemas import SETTINGS

_NEAR_M, _FAR_M = (PROFILES[name].radius_m for name in DEFAULT_PROFILES)
_TITLES = NAMES_OF | {"all": "All settings"}


# An adapted agent's scores of OOD scenes are in a partition of their own.
_ADAPTED = "OOD, adapted"
# What a column shows: metric, radius and partition; by the heading over it.
_Key = tuple[str, float, str]
_HEADS: dict[_Key, str] = {
    **{(metric, _NEAR_M, "all"): f"all scenes, {_NEAR_M:g} m" for metric in METRICS},
    **{(metric, _FAR_M, "all"): f"{_FAR_M:g} m" for metric in ("sr", "osr")},
    **{(metric, _NEAR_M, part): part for part in ("ID", "OOD", _ADAPTED) for metric in ("sr", "spl")},
}


class Cell(NamedTuple):
    """A figure, with its interval or deviation."""

    value: float | None = None
    shown: str = NONE
    spread: str = ""


class Row(NamedTuple):
    """A row: a scored run, or one of the paper's."""

    label: str
    agent: str
    episodes: int | None
    cells: Mapping[_Key, Cell]
    is_paper: bool = False


def write_leaderboard(folder: Path, page: Path) -> int:
    """Write the page of a folder of scored runs; returns how many there are."""
    cards = scored_runs(folder)
    if not cards:
        raise StoreError(
            f"{folder} has no scored run (*/{SCORE}): score a submission with score FILE --into {folder}"
        )
    tables = {_TITLES[setting]: _lines(cards, setting) for setting in (*SETTINGS, "all")}
    known = {key for lines in tables.values() for line in lines if not line.is_paper for key in line.cells}
    heads = [key for key in _HEADS if key in known]
    groups = [(group, len(list(part))) for group, part in groupby(heads, key=_HEADS.__getitem__)]
    template = page_environment().get_template("leaderboard.html.j2")
    html = template.render(
        version=__version__,
        cards=cards,
        heads=heads,
        nothing=Cell(),
        measures=MEASURES,
        groups=groups,
        starts={0, *accumulate(count for _, count in groups)},
        tables={title: lines for title, lines in tables.items() if any(not line.is_paper for line in lines)},
        **page_parts(["report.css", "leaderboard.css"], "leaderboard.js"),
    )
    make_folder(page.parent)
    atomic_write(page.parent, page.name, html)
    return len(cards)


def _lines(cards: Sequence[ScoreCard], setting: str) -> list[Row]:
    """Make the rows of a setting, the highest success rate first."""
    lines = []
    for card in cards:
        rows = [row for row in card.rows if row.setting == setting]
        if rows:
            cells = {key: cell for row in rows for key, cell in _cells(row, card.adapted)}
            label = f"{card.name} + {card.told}" if card.told else card.name
            whole = next(row.episodes for row in rows if (row.partition, row.radius_m) == ("all", _NEAR_M))
            lines.append(Row(label, card.agent, whole, cells))
    for result in results():
        if result.setting == setting:
            spread = {key: f"± {text(key[0], value)}" for key, value in result.spread.items()}
            cells = {(*key, "all"): Cell(v, text(key[0], v), spread[key]) for key, v in result.mean.items()}
            lines.append(Row(result.model, "paper", None, cells, is_paper=True))
    return sorted(lines, key=lambda line: -(line.cells.get(("sr", _NEAR_M, "all"), Cell()).value or 0.0))


def _cells(row: ScoreRow, adapted: bool) -> Iterator[tuple[_Key, Cell]]:
    partition = _ADAPTED if adapted and row.partition == "OOD" else row.partition
    for metric, value in row.mean.items():
        if value is not None:
            low, high = row.low.get(metric), row.high.get(metric)
            ends = "" if low is None or high is None else f"{text(metric, low)}–{text(metric, high)}"
            yield (metric, row.radius_m, partition), Cell(value, text(metric, value), ends)
