"""Progress: a bar on a terminal, else plain lines."""

from __future__ import annotations

import os
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from functools import partial
from typing import Any, TextIO

from tqdm import tqdm

from aerialdojo_gen.base.terminal import raw, shown

# tqdm's own lock is a semaphore, which needs a writable /dev/shm and outlives a killed process.
tqdm.set_lock(threading.RLock())

# Without a terminal: least interval of lines, and longest silence.
_PLAIN_EVERY_S, _SILENT_S = 10.0, 30.0
# How many running scenes are named.
_NAMED = 3
# Width of the bar of a whole run, columns.
_BAR = 6
_fill = partial(textwrap.fill, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
_WITHOUT_SPEED = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}{postfix}]"


class _Tqdm(tqdm):  # type: ignore[misc]  # the package has no types
    """A bar that shows the speed of a `Rate`, once it is known."""

    per_s: float | None = None

    @property
    def format_dict(self) -> dict[str, Any]:
        """Fields and format of the line."""
        known: dict[str, Any] = super().format_dict
        return known | ({"rate": self.per_s} if self.per_s else {"bar_format": _WITHOUT_SPEED})


class Rate:
    """Measures items per second from the first item on, without the start-up."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._first: tuple[int, float] | None = None

    def per_s(self, done: int) -> float | None:
        """Return items per second after `done` items; None until the first is as long ago as it took."""
        # Several processes finish their first items almost together, which looks like a high rate.
        now = time.monotonic()
        if self._first is None:
            self._first = done, now
        before, at = self._first
        return (done - before) / (now - at) if done > before and now - at >= at - self._began else None


class _Shown:
    """What is shown of progress: a bar of tqdm's on a terminal, else lines, also while nothing finishes."""

    def __init__(
        self, kind: type[tqdm], text: Callable[[], str], total: float, stream: TextIO, nothing: bool, **bar: Any
    ) -> None:
        self._text, self._stream, self._printed_at = text, stream, time.monotonic()
        self._in_lines = not (nothing or stream.isatty())
        self._tqdm = kind(total=total, file=stream, leave=False, disable=nothing or self._in_lines, **bar)
        self._ended = threading.Event()
        if self._in_lines:
            threading.Thread(target=self._watch, name="progress", daemon=True).start()

    def advance(self, n: int = 1, frames: int = 0) -> None:
        """Count `n` more items and their video frames."""

    def refresh(self) -> None:
        """Show the current progress."""

    def close(self) -> None:
        """Remove the bar."""
        self._tqdm.close()
        self._ended.set()

    def _watch(self) -> None:
        while not self._ended.wait(max(0.1, self._printed_at + _SILENT_S - time.monotonic())):
            self._print(_SILENT_S)

    def _print(self, least_s: float) -> None:
        """Print a line unless the last one is younger."""
        if self._in_lines and time.monotonic() - self._printed_at >= least_s:
            self._printed_at = time.monotonic()
            print(self._text(), file=self._stream, flush=True)


class Bar(_Shown):
    """Counts finished shards, or items of another `unit`; only `advance` changes it."""

    def __init__(self, label: str, total: int, stream: TextIO, quiet: bool, unit: str = "shards") -> None:
        self._label, self._total, self._unit = shown(label), total, unit
        self._done, self._frames, self._rate, self._frame_rate = 0, 0, Rate(), Rate()
        super().__init__(_Tqdm, self._line, total, stream, quiet or not total, desc=self._label, unit=f" {unit}")

    def advance(self, n: int = 1, frames: int = 0) -> None:
        """Count `n` more items and their video frames."""
        self._done += n
        self._frames += frames
        self._tqdm.per_s = self._rate.per_s(self._done)
        frames_per_s = self._frame_rate.per_s(self._frames) if self._frames else None
        if frames_per_s:
            self._tqdm.set_postfix_str(f"{frames_per_s:.1f} frames/s", refresh=False)
        self._tqdm.update(n)
        self._print(_PLAIN_EVERY_S)

    def _line(self) -> str:
        per_s = self._rate.per_s(self._done) if self._done else None
        frames_per_s = self._frame_rate.per_s(self._frames) if self._frames else None
        parts = [f"{self._label}: {self._done}/{self._total} {self._unit}"]
        parts += [f"{per_s:.2f}/s"] if per_s else []
        parts += [f"{self._frames:,} frames"] if self._frames else []
        parts += [f"{frames_per_s:.1f} frames/s"] if frames_per_s else []
        parts += [f"ETA {(self._total - self._done) / per_s:.0f} s"] if per_s else []
        return ", ".join(parts)


@dataclass(frozen=True)
class Overview:
    """Progress of a run."""

    done_s: float  # Work done and expected to be left, seconds of one core
    left_s: float
    scenes_done: int  # Finished, and all
    scenes: int
    at_work: list[str]  # Names of running tasks
    processes: int = 1  # Peak number of processes

    @property
    def share(self) -> float:
        """Share of the work done, from 0 to 1."""
        return self.done_s / max(self.done_s + self.left_s, 1e-9)

    def text(self, width: int | None = None) -> str:
        """Describe scenes, time left, and as many running tasks as fit a width."""
        left = duration(self.left_s / max(1, min(self.processes, self.scenes - self.scenes_done)))
        # Short, for 80 columns.
        text = f"{self.scenes_done}/{self.scenes} scenes, ~{left} left"
        for named in range(min(_NAMED, len(self.at_work)), 0, -1):
            more = f" +{len(self.at_work) - named}" if len(self.at_work) > named else ""
            longer = shown(f"{text}: {', '.join(self.at_work[:named])}{more}")
            if width is None or len(longer) <= width:
                return longer
        return text


class Overall(_Shown):
    """Shows the progress of a run through several stages, when a shard starts."""

    def __init__(self, get_overview: Callable[[], Overview], stream: TextIO, quiet: bool) -> None:
        self._get_overview = get_overview
        overview = get_overview()
        super().__init__(
            tqdm, self._line, 1.0, stream, quiet or overview.scenes_done == overview.scenes, dynamic_ncols=True,
            bar_format=f"{{percentage:3.0f}}%|{{bar:{_BAR}}}| {{desc}}", mininterval=0.0,
        )  # fmt: skip

    def refresh(self) -> None:
        """Show the current progress."""
        self._print(_PLAIN_EVERY_S)
        if not self._tqdm.disable:
            overview = self._get_overview()
            self._tqdm.n = overview.share
            self._tqdm.set_description_str(overview.text(columns(self._stream) - len(f"100%|{' ' * _BAR}| ")))

    def _line(self) -> str:
        overview = self._get_overview()
        return f"{100 * overview.share:.0f} %, {overview.text()}"


def columns(stream: TextIO) -> int:
    """Number of columns of a terminal that can be used without a line break."""
    try:
        found = os.get_terminal_size(stream.fileno()).columns
    except (OSError, ValueError):
        found = 0
    return (found or 80) - 1


def duration(seconds: float) -> str:
    """Format a duration, e.g. "40 s", "3 min 20 s", "2 h 10 min"."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


class Reporter:
    """Writes progress and summary lines to a stream (standard error by default)."""

    def __init__(self, quiet: bool = False, stream: TextIO | None = None, *, verbose: bool = False) -> None:
        self._quiet, self._stream = quiet, raw(stream or sys.stderr)
        self.verbose = verbose

    def line(self, text: str) -> None:
        """Write a line, above a bar if there is one."""
        if not self._quiet:
            text = shown(text)
            tqdm.write(_fill(text, columns(self._stream)) if self._stream.isatty() else text, file=self._stream)
            self._stream.flush()

    def bar(self, label: str, total: int, unit: str = "shards") -> AbstractContextManager[Bar]:
        """Show progress over `total` shards, or items of another unit, during the block."""
        return closing(Bar(label, total, self._stream, self._quiet, unit))

    def overall(self, get_overview: Callable[[], Overview]) -> AbstractContextManager[Overall]:
        """Show the progress that `get_overview` returns, during the block."""
        return closing(Overall(get_overview, self._stream, self._quiet))
