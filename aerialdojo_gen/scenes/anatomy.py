"""Named parts of an instance's mesh, its fronts, and the parts that identify it."""

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
_MAX_RUNS = 100_000


@dataclass(frozen=True)
class Run:
    """Consecutive faces of one part."""

    part: int  # Index into the instance's parts (a part is what has one material)
    first: int  # First face in that part and number of faces, of the first copy
    faces: int
    copies: int = 1  # Consecutive copies of as many faces each


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Named parts and fronts of an instance, from its catalogue."""

    yaw_rad: float  # Direction of its own +x, world frame
    fronts_rad: tuple[float, ...]
    identifying_parts: tuple[str, ...]
    runs: Mapping[str, tuple[Run, ...]]  # The faces of every named part; a name is a tag or a role of the catalogue

    def copies(self, name: str, counts: Sequence[int]) -> list[NDArray[np.int64]]:
        """The copies of a part, each as indices (k,) into the instance's `faces`; empty where it lacks the part."""
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

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON, as stored in a scene file."""
        runs = {name: [[r.part, r.first, r.faces, r.copies] for r in members] for name, members in self.runs.items()}
        return {
            "yaw_rad": self.yaw_rad,
            "fronts_rad": list(self.fronts_rad),
            "tells": list(self.identifying_parts),
            "parts": runs,
        }


def parse_anatomy(raw: Any, counts: Sequence[int]) -> Anatomy:
    """Parse `Anatomy.to_json`; ValueError where it is malformed."""
    runs = {}
    total = 0
    for name, members in raw["parts"].items():
        found = []
        for part, first, faces, copies in members:
            if any(type(n) is not int for n in (part, first, faces, copies)) or min(part, first) < 0:
                raise ValueError("a run of faces is malformed")
            if faces < 1 or copies < 1 or part >= len(counts) or first + faces * copies > counts[part]:
                raise ValueError("a run goes beyond the part's faces")
            found.append(Run(part, first, faces, copies))
        total += len(found)
        runs[name] = tuple(found)
    if total > _MAX_RUNS:
        raise ValueError("too many runs of faces")
    angles = [raw["yaw_rad"], *raw["fronts_rad"]]
    if not all(type(a) in (int, float) and math.isfinite(a) for a in angles):
        raise ValueError("a direction is no finite number")
    if not all(isinstance(text, str) for text in raw["tells"]):
        raise ValueError("an identifying part must be text")
    return Anatomy(float(angles[0]), tuple(float(a) for a in angles[1:]), tuple(raw["tells"]), runs)


def remap_runs(runs: Mapping[str, Iterable[Run]], kept: Sequence[NDArray[np.bool_]]) -> dict[str, tuple[Run, ...]]:
    """Remap runs of faces after dropping the faces that are not `kept`; empty copies are dropped."""
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
