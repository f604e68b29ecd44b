"""Progress on a terminal as a bar, elsewhere as plain lines."""

from __future__ import annotations

import os
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TextIO

from tqdm import tqdm

from aerialdojo_gen.base.terminal import raw, shown

# Its own lock is a semaphore, which needs a /dev/shm that can be written and outlives a process that is killed.
tqdm.set_lock(threading.RLock())

# Where there is no terminal, lines are at least so far apart, and at most so far while nothing happens.
_PLAIN_EVERY_S, _SILENT_S = 10.0, 30.0
# So many scenes are named that are under way.
_NAMED = 3
# Columns of the bar of a whole run.
_BAR = 6
_WITHOUT_SPEED = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}{postfix}]"


class _Tqdm(tqdm):  # type: ignore[misc]  # the package has no types
    """Leaves speed and time left out until they are known, and shows those of a `Rate`."""

    per_s: float | None = None

    @property
    def format_dict(self) -> dict[str, Any]:
        """Return what a line is made of, its format among it."""
        known: dict[str, Any] = super().format_dict
        return known | ({"rate": self.per_s} if self.per_s else {"bar_format": _WITHOUT_SPEED})


class Rate:
    """Measures how many things are finished a second, from the first one on: starting up is no part of it."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._first: tuple[int, float] | None = None

    def per_s(self, done: int) -> float | None:
        """Return things a second now that `done` are finished; None before it is known.

        Several processes finish their first things almost together. So it is not known before as much time has passed
        since the first thing as before it.
        """
        now = time.monotonic()
        if self._first is None:
            self._first = done, now
        before, at = self._first
        return (done - before) / (now - at) if done > before and now - at >= at - self._began else None


class _Lines:
    """Prints how far it is where there is no terminal: when something happens, and now and then when nothing does."""

    def __init__(self, text: Callable[[], str], stream: TextIO) -> None:
        self._text, self._stream, self._said = text, stream, time.monotonic()
        self._ended = threading.Event()
        threading.Thread(target=self._watch, name="progress", daemon=True).start()

    def happened(self) -> None:
        if time.monotonic() - self._said >= _PLAIN_EVERY_S:
            self._say()

    def close(self) -> None:
        self._ended.set()

    def _watch(self) -> None:
        while not self._ended.wait(max(0.1, self._said + _SILENT_S - time.monotonic())):
            if time.monotonic() - self._said >= _SILENT_S:
                self._say()

    def _say(self) -> None:
        self._said = time.monotonic()
        print(self._text(), file=self._stream, flush=True)


class Bar:
    """Counts finished shards (or what `unit` says); `advance` counts them."""

    def __init__(self, label: str, total: int, stream: TextIO, quiet: bool, unit: str = "shards") -> None:
        label = shown(label)
        self._label, self._total, self._unit = label, total, unit
        self._frames = 0
        self._done, self._rate, self._frame_rate = 0, Rate(), Rate()
        self._lines = _Lines(self._text, stream) if total and not quiet and not stream.isatty() else None
        self._tqdm = _Tqdm(
            total=total,
            desc=label,
            unit=f" {unit}",
            file=stream,
            leave=False,
            disable=quiet or self._lines is not None or not total,
        )

    def advance(self, n: int = 1, frames: int = 0) -> None:
        """Count `n` more, with as many frames of video."""
        self._done += n
        self._frames += frames
        self._tqdm.per_s = self._rate.per_s(self._done)
        frames_per_s = self._frame_rate.per_s(self._frames) if self._frames else None
        if frames_per_s:
            self._tqdm.set_postfix_str(f"{frames_per_s:.1f} frames/s", refresh=False)
        self._tqdm.update(n)
        if self._lines:
            self._lines.happened()

    def _text(self) -> str:
        per_s = self._rate.per_s(self._done) if self._done else None
        frames_per_s = self._frame_rate.per_s(self._frames) if self._frames else None
        said = [f"{self._label}: {self._done}/{self._total} {self._unit}"]
        said += [f"{per_s:.2f}/s"] if per_s else []
        said += [f"{self._frames:,} frames"] if self._frames else []
        said += [f"{frames_per_s:.1f} frames/s"] if frames_per_s else []
        said += [f"ETA {(self._total - self._done) / per_s:.0f} s"] if per_s else []
        return ", ".join(said)

    def refresh(self) -> None:
        """Show what is known; of shards nothing changes but by `advance`."""

    def close(self) -> None:
        """Take the bar off the screen."""
        self._tqdm.close()
        if self._lines:
            self._lines.close()


@dataclass(frozen=True)
class Overview:
    """How far a run is."""

    done_s: float  # What was done, and what is expected to be left, seconds of one core
    left_s: float
    scenes_done: int  # Scenes that nothing is to be done of, and all
    scenes: int
    at_work: list[str]  # What is under way, in words
    processes: int = 1  # How many are at work when there is enough to do

    @property
    def share(self) -> float:
        """What was done of it all, from 0 to 1."""
        return self.done_s / max(self.done_s + self.left_s, 1e-9)

    def __str__(self) -> str:
        """Scenes, time left, and what is under way."""
        return self.text()

    def text(self, width: int | None = None) -> str:
        """Say scenes, time left, and as much of what is under way as fits a width."""
        left = duration(self.left_s / max(1, min(self.processes, self.scenes - self.scenes_done)))
        # Short, for 80 columns.
        text = f"{self.scenes_done}/{self.scenes} scenes, ~{left} left"
        for named in range(min(_NAMED, len(self.at_work)), 0, -1):
            more = f" +{len(self.at_work) - named}" if len(self.at_work) > named else ""
            longer = shown(f"{text}: {', '.join(self.at_work[:named])}{more}")
            if width is None or len(longer) <= width:
                return longer
        return text


class Overall:
    """Shows how far a run through several stages is."""

    def __init__(self, look: Callable[[], Overview], stream: TextIO, quiet: bool) -> None:
        self._look, self._stream = look, stream
        seen = look()
        nothing = quiet or seen.scenes_done == seen.scenes
        self._lines = None if nothing or stream.isatty() else _Lines(self._text, stream)
        self._tqdm = tqdm(
            total=1.0, file=stream, leave=False, disable=nothing or self._lines is not None, dynamic_ncols=True,
            bar_format=f"{{percentage:3.0f}}%|{{bar:{_BAR}}}| {{desc}}", mininterval=0.0,
        )  # fmt: skip

    def refresh(self) -> None:
        """Show how far it is now."""
        if self._lines:
            self._lines.happened()
        elif not self._tqdm.disable:
            seen = self._look()
            self._tqdm.n = seen.share
            self._tqdm.set_description_str(seen.text(columns(self._stream) - len(f"100%|{' ' * _BAR}| ")))

    def _text(self) -> str:
        seen = self._look()
        return f"{100 * seen.share:.0f} %, {seen}"

    def advance(self, frames: int = 0) -> None:
        """Nothing by itself: how far it is is shown when the next shard is begun."""

    def close(self) -> None:
        """Take it off the screen."""
        self._tqdm.close()
        if self._lines:
            self._lines.close()


def columns(stream: TextIO) -> int:
    """Count the columns of a terminal that can be written to without it breaking the line."""
    try:
        found = os.get_terminal_size(stream.fileno()).columns
    except (OSError, ValueError):
        found = 0
    return (found or 80) - 1


def duration(seconds: float) -> str:
    """Say a time in words, e.g. "40 s", "3 min 20 s", "2 h 10 min"."""
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
        """Write one line, above a bar if there is one."""
        if not self._quiet:
            text = shown(text)
            if self._stream.isatty():
                text = textwrap.fill(
                    text,
                    columns(self._stream),
                    subsequent_indent="  ",
                    break_long_words=False,
                    break_on_hyphens=False,
                )
            tqdm.write(text, file=self._stream)
            self._stream.flush()

    @contextmanager
    def bar(self, label: str, total: int, unit: str = "shards") -> Iterator[Bar]:
        """Show progress over `total` shards, or things of another kind, for the length of the block."""
        bar = Bar(label, total, self._stream, self._quiet, unit)
        try:
            yield bar
        finally:
            bar.close()

    @contextmanager
    def overall(self, look: Callable[[], Overview]) -> Iterator[Overall]:
        """Show how far a run is, as `look` tells, for the length of the block."""
        shown = Overall(look, self._stream, self._quiet)
        try:
            yield shown
        finally:
            shown.close()
