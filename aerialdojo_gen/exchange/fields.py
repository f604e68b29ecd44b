"""The fields of a record, each checked as it is read; what nobody read is what could not be mapped."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Farther than half the earth's circumference is no place in metres.
_FARTHEST_M = 2.1e7


class BadField(Exception):  # noqa: N818 - it is caught where rows are read, and becomes a line of a report
    """A field of a record makes no sense.

    Attributes
    ----------
    field : str
        Its path in the record, e.g. ``start_pose.start_position``.
    why : str
        What is wrong with it.
    """

    def __init__(self, field: str, why: str) -> None:
        super().__init__(f"{field}: {why}")
        self.field, self.why = field, why


def shown(value: object) -> str:
    """A value as an error names it: short."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


class Fields:
    """An object of a file.

    Parameters
    ----------
    value : object
        What the file has; BadField unless it is an object.
    path : str
        Where it stands in its record.
    """

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
        """The field as it is.

        Raises
        ------
        BadField
            There is none, as in every method here.
        """
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
        points = self.rows_of(rows, key, 3)
        if np.abs(points).max() > _FARTHEST_M:
            raise BadField(self.path(key), f"{np.abs(points).max():.3g} m is no place on earth")
        return points

    def rows_of(self, rows: Sequence[Any], key: str, width: int) -> Floats:
        """Check rows that stand at `key` as lists of so many finite numbers: (n, width) float64."""
        path = self.path(key)
        flat: list[float] = []
        for i, row in enumerate(rows):
            where = f"{path}[{i}]" if len(rows) > 1 else path
            if not isinstance(row, list):
                raise BadField(where, f"expected {width} numbers, found {shown(row)}")
            if len(row) != width:
                raise BadField(where, f"expected {width} numbers, found {len(row)}")
            flat += _numbers(row, where)
        return np.array(flat, np.float64).reshape(-1, width)

    def numbers(self, key: str) -> Floats:
        """(n,) float64, all finite."""
        return np.array(_numbers(self.items(key), self.path(key)), np.float64)

    def whole_numbers(self, key: str) -> list[int]:
        """A list of integers."""
        values = self.items(key)
        for value in values:
            if type(value) is not int:
                raise BadField(self.path(key), f"expected whole numbers, found {shown(value)}")
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
        value = self.rows_of([self.take(key)], key, 4)[0]
        norm = float(np.linalg.norm(value))
        if not 0.95 <= norm <= 1.05:
            raise BadField(self.path(key), f"is no unit quaternion: its length is {norm:.3g}")
        return value / norm

    def child(self, key: str) -> Fields:
        """An object in this one."""
        child = Fields(self.take(key), self.path(key))
        self._children.append(child)
        return child

    def unread(self) -> Iterator[str]:
        """Paths of the fields that nobody asked for, in this object and its children."""
        for key in self._value:
            if key not in self._read:
                yield self.path(key)
        for child in self._children:
            yield from child.unread()


def _numbers(values: Sequence[Any], path: str) -> list[float]:
    for value in values:
        # A bool is an int to Python, and a string of digits a number to numpy: neither is one here.
        if type(value) is not float and type(value) is not int:
            raise BadField(path, f"expected a number, found {shown(value)}")
        if type(value) is float and not math.isfinite(value):
            raise BadField(path, f"{value} is no finite number")
        if type(value) is int and abs(value) > 1e300:
            raise BadField(path, "is too large a number")
    return [float(value) for value in values]
