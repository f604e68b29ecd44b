"""Flown episodes as arrays on the disk: what the body saw at each step, what it did, and what it should have done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.learning.labels import scatter_rows
from aerialdojo_gen.learning.words import Vocabulary
from aerialdojo_gen.store.atomic import atomic_folder, make_folder

_FRAMES, _STEPS = "frames.npy", "steps.npz"


@dataclass(frozen=True, eq=False)
class Steps:
    """Episodes one after the other; arrays of steps have m rows, those of episodes n."""

    frames: NDArray[np.uint8]  # See `aerialdojo_gen.learning.encoding.packed`; of a blind policy there are no views
    first: NDArray[np.int64]  # (n + 1,) int64; where each episode's steps begin
    label: NDArray[np.int64]  # (m,) int64; what the teacher does there, 0 to 15
    odometry: NDArray[np.float32]  # (m, 4) float32; own motion from the start and in its frame: metres and radians
    offset: NDArray[np.float32]  # (m, 3) float32
    pose: NDArray[np.float32]  # (m, 4) float32; x, y, z in metres and yaw in radians, world frame
    blocked: NDArray[np.bool_]  # (m, 16) bool
    text: NDArray[np.str_]  # (n, 2) str; the goal in words, without and with its description
    image: NDArray[np.int64]  # (n,) int64; row of `images`, -1 without one
    semantic: NDArray[np.bool_]  # (n,) bool; whether there is a semantic instance
    images: NDArray[np.uint8]  # (k, H, W, 4) uint8; the goals' pictures
    nav_id: NDArray[np.str_]  # (n,) str
    scene: NDArray[np.str_]
    shown: NDArray[np.int16] = field(default_factory=lambda: np.zeros((0, 0), np.int16))  # (m, patches) int16
    names: NDArray[np.str_] = field(default_factory=lambda: np.zeros(0, "U1"))  # (k,) str; of those objects

    def __len__(self) -> int:
        return len(self.first) - 1

    def write(self, folder: Path) -> None:
        """Write to a folder that is there whole or not at all."""
        make_folder(folder.parent)
        with atomic_folder(folder) as temporary:
            np.save(temporary / _FRAMES, self.frames, allow_pickle=False)
            named = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "frames"}
            np.savez(temporary / _STEPS, allow_pickle=False, **named)


def is_written(folder: Path) -> bool:
    """Whether a folder holds episodes."""
    return (folder / _STEPS).is_file()


def read_steps(folder: Path) -> Steps:
    """Read episodes; pictures stay on the disk until they are asked for."""
    try:
        with np.load(folder / _STEPS, allow_pickle=False) as file:
            rest = {one.name: file[one.name] for one in fields(Steps) if one.name != "frames"}
        # What is empty, a header of 128 bytes alone, cannot be mapped.
        empty = (folder / _FRAMES).stat().st_size <= 128
        frames = np.load(folder / _FRAMES, mmap_mode=None if empty else "r", allow_pickle=False)
        return Steps(frames=frames, **rest)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{folder} is damaged: remove it, the same command makes it again ({error})") from None


class Pool:
    """All episodes that are learned from."""

    def __init__(self, parts: Sequence[Steps], scenes: Sequence[str], vocabulary: Vocabulary) -> None:
        self.parts = list(parts)
        self._steps, images, self._names = (
            np.cumsum([0, *(len(getattr(p, name)) for p in parts)]) for name in ("label", "images", "names")
        )
        joined: dict[str, NDArray[Any]] = {}
        for name in ("label", "odometry", "offset", "pose", "blocked", "semantic", "nav_id", "images"):
            joined[name] = np.concatenate([getattr(p, name) for p in parts])
        joined["image"] = np.concatenate([_shifted(p.image, n) for p, n in zip(parts, images, strict=False)])
        # The cache has words, not their numbers: another vocabulary asks for no other pictures.
        tokens = [vocabulary.encode(text) for part in parts for text in part.text.ravel().tolist()]
        joined["tokens"] = np.array(tokens, np.int64).reshape(-1, 2, vocabulary.length)
        self._joined = joined
        self.first = np.concatenate([[0], *(p.first[1:] + s for p, s in zip(parts, self._steps, strict=False))])
        self.lengths = np.diff(self.first)
        self.nav_id = joined["nav_id"]
        number = {name: k for k, name in enumerate(scenes)}
        self._scene = np.array([number[name] for p in parts for name in p.scene.tolist()], np.int64)
        self._scene_of_step = np.repeat(self._scene, self.lengths)

    def __len__(self) -> int:
        return len(self.lengths)

    @property
    def n_steps(self) -> int:
        """Steps of all of them."""
        return int(self._steps[-1])

    def frames(self, rows: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Read pictures of steps, in their order."""
        return self._gather("frames", rows, np.uint8)

    def _gather(
        self, name: str, rows: NDArray[np.int64], kind: type[np.generic], shifts: NDArray[np.int64] | None = None
    ) -> NDArray[Any]:
        """Read rows of an array of steps that is too large to be joined."""
        out = np.empty((len(rows), *getattr(self.parts[0], name).shape[1:]), kind)
        part = np.searchsorted(self._steps, rows, side="right") - 1
        for p in np.unique(part):
            at = np.flatnonzero(part == p)
            values = getattr(self.parts[p], name)[rows[at] - self._steps[p]]
            out[at] = values if shifts is None else _shifted(values, shifts[p])
        return out

    def places(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.bool_]]:
        """Read poses of steps, (n, 4), numbers of their scenes, (n,), and which actions are blocked, (n, 16)."""
        return self._joined["pose"][rows], self._scene_of_step[rows], self._joined["blocked"][rows]

    @property
    def names(self) -> list[str]:
        """Of all objects that exploration views show."""
        return [name for part in self.parts for name in part.names.tolist()]

    def shown(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Read which objects the patches of exploration views show: (n, patches), numbers of `names`; see `Steps`."""
        return self._gather("shown", rows, np.int64, self._names)

    def batch(self, episodes: NDArray[np.int64], by_image: NDArray[np.bool_]) -> dict[str, NDArray[Any]]:
        """Put episodes side by side: ``rows`` (m,), (n, T, …) arrays of steps and (n, …) of goals, by name."""
        j, lengths = self._joined, self.lengths[episodes]
        window = int(lengths.max())
        mask = np.arange(window)[None] < lengths[:, None]
        rows = (self.first[episodes][:, None] + np.arange(window)[None])[mask]
        out: dict[str, NDArray[Any]] = {"rows": rows, "mask": mask}
        for name in ("label", "odometry", "offset", "pose", "blocked"):
            out[name] = scatter_rows(j[name][rows], mask)
        image = j["image"][episodes]
        shown = (by_image | ~j["semantic"][episodes]) & (image >= 0)
        out["goal_by_image"] = shown
        out["scene"] = self._scene[episodes]
        out["tokens"] = j["tokens"][episodes, 1 - shown.astype(np.int64)]
        out["images"] = scatter_rows(j["images"][image[shown]], shown)
        return out


def _shifted(numbers: NDArray[Any], by: int) -> NDArray[np.int64]:
    """Numbers of what a part has, counted through all parts; below 0 there is nothing."""
    return np.where(numbers >= 0, numbers.astype(np.int64) + by, numbers)
