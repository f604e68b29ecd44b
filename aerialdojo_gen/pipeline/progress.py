"""Progress on a terminal as a bar, elsewhere as plain lines."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from tqdm import tqdm

_PLAIN_EVERY_S = 10.0
_WITHOUT_SPEED = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}{postfix}]"


class _Tqdm(tqdm):  # type: ignore[misc]  # the package has no types
    """Leaves speed and time left out until something is finished, where tqdm says ``?, ? shards/s``."""

    @property
    def format_dict(self) -> dict[str, Any]:
        """Return what a line is made of, its format among it."""
        known: dict[str, Any] = super().format_dict
        begun = known["n"] > known["initial"] and known["elapsed"] > 0.0
        return known if begun else known | {"bar_format": _WITHOUT_SPEED}


class Bar:
    """Counts finished shards (or what `unit` says); `advance` counts them."""

    def __init__(self, label: str, total: int, stream: TextIO, quiet: bool, unit: str = "shards") -> None:
        self._label, self._total, self._stream, self._unit = label, total, stream, unit
        self._frames = 0
        self._done, self._started, self._said = 0, time.monotonic(), time.monotonic()
        self._plain = not quiet and not stream.isatty()
        self._tqdm = _Tqdm(
            total=total,
            desc=label,
            unit=f" {unit}",
            file=stream,
            leave=False,
            disable=quiet or self._plain or not total,
        )

    def advance(self, n: int = 1, frames: int = 0) -> None:
        """Count `n` more, with as many frames of video."""
        self._done += n
        self._frames += frames
        speed = self._frames / max(time.monotonic() - self._started, 1e-9)
        if self._frames:
            self._tqdm.set_postfix_str(f"{speed:.1f} frames/s", refresh=False)
        self._tqdm.update(n)
        now = time.monotonic()
        if self._plain and now - self._said >= _PLAIN_EVERY_S:
            self._said = now
            rate = self._done / (now - self._started)
            left = (self._total - self._done) / rate
            pictures = f", {self._frames:,} frames, {speed:.1f} frames/s" if self._frames else ""
            print(
                f"{self._label}: {self._done}/{self._total} {self._unit}, {rate:.2f}/s{pictures}, ETA {left:.0f} s",
                file=self._stream,
                flush=True,
            )

    def close(self) -> None:
        """Take the bar off the screen."""
        self._tqdm.close()


class Reporter:
    """Writes progress and summary lines to a stream (standard error by default).

    Parameters
    ----------
    quiet : bool
        Say nothing.
    stream : text stream, optional
        Where to write.
    """

    def __init__(self, quiet: bool = False, stream: TextIO | None = None) -> None:
        self._quiet, self._stream = quiet, stream or sys.stderr

    def line(self, text: str) -> None:
        """Write one line, above a bar if there is one."""
        if not self._quiet:
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
