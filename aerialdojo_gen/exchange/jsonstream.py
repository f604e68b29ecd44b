"""JSON files of any size, a record at a time, in bounded memory.

The standard library's own scanner reads each record, so that a NaN in one (which is not JSON, but which Python
writes) is a value to be named in its row, not the end of the file.
"""

from __future__ import annotations

import codecs
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from aerialdojo_gen.base.errors import ImportRefused, brief, check_regular
from aerialdojo_gen.base.safe_parse import MAX_DEPTH, exceeds_depth, loads_json
from aerialdojo_gen.exchange.fields import shown

RECORD_LIMIT = 16 << 20
_CHUNK = 1 << 20
_SPACE = " \t\r\n"
_LONGEST_EXPONENT = 8


class _Text:
    """What of a file is read and not yet used."""

    def __init__(self, file: BinaryIO, path: Path, limit: int) -> None:
        self.path, self.limit = path, limit
        self.place = "the beginning"
        self._file = file
        self._decoder = codecs.getincrementaldecoder("utf-8-sig")()
        self._json = json.JSONDecoder()
        self._text, self._at, self._done = "", 0, False

    def fail(self, why: str) -> ImportRefused:
        return ImportRefused(f"{self.path}: {self.place}: {brief(why)}")

    def _more(self) -> bool:
        if self._done:
            return False
        raw = self._file.read(max(_CHUNK, len(self._text) - self._at))
        try:
            new = self._decoder.decode(raw, final=not raw)
        except UnicodeDecodeError:
            raise self.fail("is not UTF-8: save the file in that encoding") from None
        self._done = not raw
        self._text, self._at = self._text[self._at :] + new, 0
        return True

    def peek(self) -> str:
        """The next character that is no blank, unused; empty at the end."""
        while True:
            while self._at < len(self._text) and self._text[self._at] in _SPACE:
                self._at += 1
            if self._at < len(self._text):
                return self._text[self._at]
            if not self._more():
                return ""

    def take(self, wanted: str) -> str:
        """Use the next character, one of `wanted`."""
        found = self.peek()
        if not found or found not in wanted:
            got = f"{found!r}" if found else "the end of the file (is it truncated?)"
            raise self.fail(f"expected {' or '.join(wanted)}, found {got}")
        self._at += 1
        return found

    def members(self, brackets: str, expected: str) -> Iterator[int]:
        """Stop before each member of a list or an object, with its number; who goes on has used it."""
        opening, closing = brackets
        if self.peek() != opening:
            raise self.fail(f"expected {expected}")
        self.take(opening)
        more, row = self.peek() != closing, 0
        while more:
            yield row
            more, row = self.take(f",{closing}") == ",", row + 1
        if not row:
            self.take(closing)
        self.place = "the end"

    def value(self) -> Any:
        """Use the next value, whole."""
        self.peek()
        while True:
            try:
                value, end = self._json.raw_decode(self._text, self._at)
            except RecursionError:
                raise self.fail(f"nested more than {MAX_DEPTH} deep") from None
            except ValueError as error:
                why = getattr(error, "msg", str(error))
            else:
                # A number may go on beyond what is read: 1, 1. and 1.5e+ begin alike.
                cut = type(value) in (int, float) and len(self._text) - end < _LONGEST_EXPONENT
                if self._done or (end < len(self._text) and not (cut and self._text[end] in ".eE")):
                    if exceeds_depth(value):
                        raise self.fail(f"nested more than {MAX_DEPTH} deep")
                    self._at = end
                    return value
                why = ""
            if len(self._text) - self._at > self.limit:
                raise self.fail(f"larger than {self.limit >> 10:,} KiB, or damaged ({why or 'no end'})")
            if not self._more():
                raise self.fail(f"damaged or truncated ({why})")


def records(path: Path, key: str | None = None, *, limit: int = RECORD_LIMIT) -> Iterator[Any]:
    """Read a JSON list a record at a time: the file's own, or the one at a key of its object."""
    try:
        with path.open("rb") as file:
            text = _Text(file, path, limit)
            yield from _list(text) if key is None else _under(text, key)
            if text.peek():
                raise text.fail(f"{text.peek()!r} after the end of the value")
    except OSError as error:
        raise ImportRefused(f"{path}: {error.strerror or error}") from None


def _under(text: _Text, key: str) -> Iterator[Any]:
    found = False
    for _ in text.members("{}", f"an object that has a list {key!r}"):
        name = text.value()
        text.place = f"key {shown(name)}"
        text.take(":")
        if name == key:
            found = True
            yield from _list(text)
        else:
            text.value()
    if not found:
        raise text.fail(f"there is no list {key!r}")


def _list(text: _Text) -> Iterator[Any]:
    for row in text.members("[]", f"a list of records, found {text.peek()!r}"):
        text.place = f"row {row}"
        yield text.value()


def small_document(path: Path, *, limit: int = RECORD_LIMIT) -> Any:
    """Read a whole JSON file of at most `limit` bytes."""
    check_regular(path)
    with path.open("rb") as file:
        raw = file.read(limit + 1)
    if len(raw) > limit:
        raise ValueError(f"is larger than {limit >> 10:,} KiB")
    # NaN is a value to be named in its row.
    return loads_json(raw, finite=False)
