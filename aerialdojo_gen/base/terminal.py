"""The standard streams: text from outside cannot control the terminal, and a failed write ends the command."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

from aerialdojo_gen.base.errors import DISK_ERRORS, AerialDojoError

# The exit code that a shell reports for a program ended by SIGPIPE: its output has no reader.
CLOSED_PIPE = 141

# C0 and C1 controls, marks and overrides of writing direction, separators that some terminals break lines at.
# Written as JSON escapes them, so that JSON stays JSON.
_HIDDEN = (*range(0x20), *range(0x7F, 0xA0), 0x061C, 0x200E, 0x200F, *range(0x2028, 0x202F), *range(0x2066, 0x206A))
_SHOWN = {code: f"\\u{code:04x}" for code in _HIDDEN if chr(code) not in "\n\t"}


def shown(text: str) -> str:
    """Return a text with its control characters made visible; newlines and tabs stay."""
    return text.translate(_SHOWN)


def shown_in_page(value: object) -> object:
    """Return what a page's template writes for a value: of a text from outside, what `shown` makes of it."""
    return shown(value) if type(value) is str else value  # markup is a template's own


def raw(stream: TextIO) -> TextIO:
    """Return a stream that may control the terminal, as a progress bar does: its text is to be `shown`."""
    return cast(TextIO, _Output(stream.stream, stream.needed, str)) if isinstance(stream, _Output) else stream


@contextmanager
def standard_streams() -> Iterator[None]:
    """Clean standard output and error, for the length of a command."""
    before = sys.stdout, sys.stderr
    # Python has no stream at all where the descriptor is closed.
    out, err = (stream or open(os.devnull, "w", encoding="utf-8") for stream in before)  # noqa: SIM115
    sys.stdout, sys.stderr = cast(TextIO, _Output(out, True)), cast(TextIO, _Output(err, False))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


class _Output:
    """A stream that shows control characters, and raises what `standard_streams` says where it is `needed`."""

    def __init__(self, stream: TextIO, needed: bool, clean: Callable[[str], str] = shown) -> None:
        self.stream, self.needed, self._clean = stream, needed, clean
        if hasattr(stream, "reconfigure"):
            # A file's name need not be text.
            stream.reconfigure(errors="backslashreplace")

    def write(self, text: str) -> int:
        clean = self._clean(text)
        if clean:  # Click writes nothing to learn what kind of stream this is
            self._guarded(lambda: self.stream.write(clean))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        self._guarded(self.stream.flush)

    def _guarded(self, act: Callable[[], object]) -> None:
        try:
            act()
        except OSError as error:
            # What is still in the buffer goes nowhere: Python would fail on it again when it ends.
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.stream.fileno())
            os.close(nowhere)
            if not self.needed:
                return
            if isinstance(error, BrokenPipeError):
                raise SystemExit(CLOSED_PIPE) from None
            reason = DISK_ERRORS.get(error.errno or 0, error.strerror)
            raise AerialDojoError(f"cannot write standard output: {reason}") from None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)
