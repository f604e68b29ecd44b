"""JSON files of others, of any size: a record at a time, in bounded memory, and its fields, checked when read.

The standard library's own scanner reads each record, so that a NaN in one (which is not JSON, but which Python
writes) is a value to be named in its row, not the end of the file. Fields that are never read could not be mapped.
"""

from __future__ import annotations

import codecs
import contextlib
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import ImportRefused, brief, check_regular
from aerialdojo_gen.base.safe_parse import MAX_DEPTH, exceeds_depth, loads_json

Floats = NDArray[np.float64]

# Farther than half the earth's circumference is no place in metres.
_FARTHEST_M = 2.1e7


class BadField(Exception):  # noqa: N818 - it is caught where rows are read, and becomes a line of a report
    """A field of a record makes no sense."""

    def __init__(self, field: str, why: str) -> None:
        self.field, self.why = brief(field, 120), brief(why)
        super().__init__(f"{self.field}: {self.why}")


def shown(value: object) -> str:
    """A value as an error names it: short."""
    return brief(repr(value), 60)


def plain(key: str) -> str:
    """A key of a file as reports name it: short, and without what a terminal or a file would choke on."""
    return key if key.isprintable() and len(key) <= 60 else ascii(key)[:60]


class Fields:
    """An object of a file."""

    def __init__(self, value: Any, path: str = "") -> None:
        if not isinstance(value, dict):
            raise BadField(path or "the row", f"expected an object, found {shown(value)}")
        self._value: Mapping[str, Any] = value
        self._path = path
        self._read: set[str] = set()
        self._children: list[Fields] = []

    def path(self, key: str) -> str:
        """Where a field of this object stands in its record."""
        return f"{self._path}.{key}" if self._path else key

    def has(self, key: str) -> bool:
        """Whether there is such a field, and it is not null."""
        return self._value.get(key) is not None

    def take(self, key: str) -> Any:
        """The field as it is."""
        self._read.add(key)
        if key not in self._value:
            raise BadField(self.path(key), "is missing")
        return self._value[key]

    def text(self, key: str, *, empty: bool = True) -> str:
        """A string, without the blanks around it."""
        value = self.take(key)
        if not isinstance(value, str):
            raise BadField(self.path(key), f"expected a text, found {shown(value)}")
        try:
            value.encode()
        except UnicodeEncodeError:
            raise BadField(self.path(key), "has half a Unicode character (a lone surrogate)") from None
        value = value.strip()
        if not value and not empty:
            raise BadField(self.path(key), "is empty")
        return value

    def optional_text(self, key: str) -> str | None:
        """A string, or None where it is missing, null or blank."""
        if not self.has(key):
            self._read.add(key)
            return None
        return self.text(key) or None

    def name(self, key: str) -> str:
        """A string or a whole number, as a string: files have both for ids."""
        value = self.take(key)
        if type(value) is int:
            return str(value)
        return self.text(key, empty=False)

    def flag(self, key: str) -> bool:
        """0, 1, true or false."""
        value = self.take(key)
        if value not in (0, 1):
            raise BadField(self.path(key), f"expected 0 or 1, found {shown(value)}")
        return bool(value)

    def number(self, key: str) -> float:
        """A finite number."""
        return _numbers([self.take(key)], self.path(key))[0]

    def position(self, key: str) -> Floats:
        """(3,) float64, metres."""
        return self.positions_of([self.take(key)], key)[0]

    def positions(self, key: str) -> Floats:
        """(n, 3) float64, metres; n is at least 1."""
        return self.positions_of(self.items(key), key)

    def positions_of(self, rows: Sequence[Any], key: str) -> Floats:
        """Check rows that stand at `key` as positions: (n, 3) float64, metres."""
        path = self.path(key)
        return positions_of(rows, lambda i: f"{path}[{i}]" if len(rows) > 1 else path)

    def numbers(self, key: str) -> Floats:
        """(n,) float64, all finite."""
        return np.array(_numbers(self.items(key), self.path(key)), np.float64)

    def whole_numbers(self, key: str) -> list[int]:
        """A list of integers."""
        values = self.items(key)
        if wrong := [value for value in values if type(value) is not int]:
            raise BadField(self.path(key), f"expected whole numbers, found {shown(wrong[0])}")
        return values

    def items(self, key: str) -> list[Any]:
        """A list that is not empty."""
        value = self.take(key)
        if not isinstance(value, list):
            raise BadField(self.path(key), f"expected a list, found {shown(value)}")
        if not value:
            raise BadField(self.path(key), "is empty")
        return value

    def quaternion(self, key: str) -> Floats:
        """(4,) float64 of unit length (to 5 %, as files round), in the file's order."""
        return quaternions_of([self.take(key)], lambda _: self.path(key))[0]

    def child(self, key: str) -> Fields:
        """An object in this one."""
        child = Fields(self.take(key), self.path(key))
        self._children.append(child)
        return child

    def unread(self) -> Iterator[str]:
        """Paths of the fields that were never read, in this object and its children."""
        yield from (self.path(plain(key)) for key in self._value if key not in self._read)
        for child in self._children:
            yield from child.unread()


def rows_of(rows: Sequence[Any], width: int, where: Callable[[int], str]) -> Floats:
    """Check rows of `width` finite numbers each and return them, (n, width) float64."""
    if all(type(row) is list and len(row) == width for row in rows):
        flat = list(chain.from_iterable(rows))
        if set(map(type, flat)) <= {float, int}:
            with contextlib.suppress(OverflowError):
                values = np.array(flat, np.float64).reshape(-1, width)
                if np.isfinite(values).all():
                    return values
    for i, row in enumerate(rows):
        if not isinstance(row, list):
            raise BadField(where(i), f"expected {width} numbers, found {shown(row)}")
        if len(row) != width:
            raise BadField(where(i), f"expected {width} numbers, found {len(row)}")
        _numbers(row, where(i))
    raise AssertionError("rows are valid one by one, but not together")


def positions_of(rows: Sequence[Any], where: Callable[[int], str]) -> Floats:
    """Check positions as `rows_of` does: (n, 3) float64, metres."""
    points = rows_of(rows, 3, where)
    far = np.abs(points).max(axis=1)
    if (far > _FARTHEST_M).any():
        k = int(far.argmax())
        raise BadField(where(k), f"{far[k]:.3g} m is no place on earth")
    return points


def quaternions_of(rows: Sequence[Any], where: Callable[[int], str]) -> Floats:
    """Check unit quaternions (to 5 %, as files round) as `rows_of` does: (n, 4) float64, of unit length."""
    values = rows_of(rows, 4, where)
    norms = np.sqrt((values**2).sum(axis=1))
    wrong = np.abs(norms - 1) > 0.05
    if wrong.any():
        k = int(wrong.argmax())
        raise BadField(where(k), f"is no unit quaternion: its length is {norms[k]:.3g}")
    return values / norms[:, None]


def _numbers(values: Sequence[Any], path: str) -> list[float]:
    for value in values:
        # A bool is an int to Python, and a string of digits a number to numpy: neither is one here.
        if type(value) is not float and type(value) is not int:
            raise BadField(path, f"expected a number, found {shown(value)}")
        if type(value) is float and not math.isfinite(value):
            raise BadField(path, f"{value} is no finite number")
        if type(value) is int and abs(value) > 10**300:
            raise BadField(path, "is too large a number")
    return [float(value) for value in values]


# Most characters of a record.
RECORD_LIMIT = 16 << 20
_CHUNK = 1 << 20
_SPACE = " \t\r\n"
_LONGEST_EXPONENT = 8


class _Text:
    """What of a file is read and not yet used."""

    def __init__(self, file: BinaryIO, path: Path) -> None:
        self.path = path
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
            while self._at < len(self._text):
                if self._text[self._at] not in _SPACE:
                    return self._text[self._at]
                self._at += 1
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
        opening, closing = tuple(brackets)
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
            if len(self._text) - self._at > RECORD_LIMIT:
                raise self.fail(f"larger than {RECORD_LIMIT >> 10:,} KiB, or damaged ({why or 'no end'})")
            if not self._more():
                raise self.fail(f"damaged or truncated ({why})")


def records(path: Path, key: str | None = None) -> Iterator[Any]:
    """Read a JSON list a record at a time: the file's own, or the one at a key of its object."""
    try:
        with path.open("rb") as file:
            text = _Text(file, path)
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


def small_document(path: Path) -> Any:
    """Read a whole JSON file of at most `RECORD_LIMIT` bytes."""
    check_regular(path)
    with path.open("rb") as file:
        raw = file.read(RECORD_LIMIT + 1)
    if len(raw) > RECORD_LIMIT:
        raise ValueError(f"is larger than {RECORD_LIMIT >> 10:,} KiB")
    # NaN is a value to be named in its row.
    return loads_json(raw, finite=False)
