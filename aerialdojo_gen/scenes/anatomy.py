"""Which of an instance's faces are which of its parts, and from where a person would recognise it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Directions of a category's fronts in its own frame, degrees counter-clockwise from +x.
FRONTS: Mapping[str, tuple[float, ...]] = {
    "none": (), "+x": (0.0,), "-x": (180.0,), "+y": (90.0,), "-y": (-90.0,), "x": (0.0, 180.0), "y": (90.0, -90.0),
}  # fmt: skip
_MOST_RUNS = 100_000


@dataclass(frozen=True)
class Run:
    """Faces of one part that follow each other."""

    part: int  # Index into the instance's parts (a part is what has one material)
    first: int  # First face in that part and number of faces, of the first copy
    faces: int
    copies: int = 1  # How many copies follow each other, of as many faces each


@dataclass(frozen=True, eq=False)
class Anatomy:
    """What the catalogue says of an instance's body."""

    yaw_rad: float  # Direction of its own +x, world frame
    fronts_rad: tuple[float, ...]
    tells: tuple[str, ...]
    runs: Mapping[str, tuple[Run, ...]]  # The faces of every named part; a name is a tag or a role of the catalogue

    def copies(self, name: str, counts: Sequence[int]) -> list[NDArray[np.int64]]:
        """The copies of a part, as indices (k,) into the instance's `faces`.

        None where the instance lacks the part.
        """
        offsets = np.cumsum([0, *counts])
        found = []
        for one in name.split("|"):
            for run in self.runs.get(one, ()):
                start = int(offsets[run.part]) + run.first
                found += [np.arange(start + k * run.faces, start + (k + 1) * run.faces) for k in range(run.copies)]
        return found

    def faces(self, name: str, counts: Sequence[int]) -> NDArray[np.int64]:
        """All faces of a part, sorted: indices into the instance's `faces`; see `copies`."""
        copies = self.copies(name, counts)
        return np.unique(np.concatenate(copies)) if copies else np.zeros(0, np.int64)

    def document(self) -> dict[str, Any]:
        """Say it in JSON, as a scene file keeps it."""
        runs = {name: [[r.part, r.first, r.faces, r.copies] for r in members] for name, members in self.runs.items()}
        return {
            "yaw_rad": self.yaw_rad,
            "fronts_rad": list(self.fronts_rad),
            "tells": list(self.tells),
            "parts": runs,
        }


def read_anatomy(raw: Any, counts: Sequence[int]) -> Anatomy:
    """Read what `Anatomy.document` said."""
    runs = {}
    total = 0
    for name, members in raw["parts"].items():
        found = []
        for part, first, faces, copies in members:
            if any(type(n) is not int for n in (part, first, faces, copies)) or min(part, first) < 0:
                raise ValueError("a run of faces is none")
            if faces < 1 or copies < 1 or part >= len(counts) or first + faces * copies > counts[part]:
                raise ValueError("a run goes beyond the part's faces")
            found.append(Run(part, first, faces, copies))
        total += len(found)
        runs[name] = tuple(found)
    if total > _MOST_RUNS:
        raise ValueError("too many runs of faces")
    angles = [raw["yaw_rad"], *raw["fronts_rad"]]
    if not all(type(a) in (int, float) and math.isfinite(a) for a in angles):
        raise ValueError("a direction is no finite number")
    if not all(isinstance(text, str) for text in raw["tells"]):
        raise ValueError("a tell is no text")
    return Anatomy(float(angles[0]), tuple(float(a) for a in angles[1:]), tuple(raw["tells"]), runs)


def moved(runs: Mapping[str, Iterable[Run]], kept: Sequence[NDArray[np.bool_]]) -> dict[str, tuple[Run, ...]]:
    """Follow runs of faces through the loss of those that are not `kept`.

    A copy without a face is no copy any more.
    """
    if all(k.all() for k in kept):
        return {name: tuple(members) for name, members in runs.items()}
    before = [np.concatenate([[0], np.cumsum(k)]) for k in kept]
    place = np.cumsum([0, *(bool(k.any()) for k in kept)])
    out = {}
    for name, members in runs.items():
        left = []
        for run in members:
            at = before[run.part]
            ends = [(run.first + k * run.faces, run.first + (k + 1) * run.faces) for k in range(run.copies)]
            spans = [(int(at[a]), int(at[b])) for a, b in ends]
            left += [Run(int(place[run.part]), a, b - a) for a, b in spans if b > a]
        if left:
            out[name] = tuple(left)
    return out
