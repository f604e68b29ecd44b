"""The order of an epoch: shuffled, scene by scene in blocks, and the same for any number of workers.

Who renders on the fly must not change the scene at every sample: its mesh takes a second to load. So every scene's
trajectories are shuffled and cut into blocks, whose samples are shuffled; the blocks of all scenes are dealt out to a
few streams, and batches come from the streams in turn. Worker w of W gets batches w, w + W, …: with as many workers
as streams each has one scene open at a time, and with any number the batches are the same in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import UsageError


@dataclass(frozen=True, eq=False)
class Order:
    """The batches of one epoch, as lists of sample numbers: a batch sampler for ``torch.utils.data.DataLoader``."""

    scene: NDArray[np.integer]
    first: NDArray[np.int64]  # Number of every trajectory's first sample, and of what would come next
    batch_size: int
    _: KW_ONLY
    seed: int = 0
    epoch: int = 0
    start: int = 0  # The batch to begin with
    block: int = 2048  # Samples of a block
    streams: int = 2
    shuffle: bool = True
    drop_last: bool = False

    def __post_init__(self) -> None:
        """Refuse what makes no order."""
        for what in ("batch_size", "block", "streams"):
            if getattr(self, what) < 1:
                raise UsageError(f"{what} is at least 1, not {getattr(self, what)}")
        if not 0 <= self.start <= (n := self._n_batches):
            raise UsageError(f"the epoch has {n} batches: there is no batch {self.start} to go on with")

    @property
    def how(self) -> dict[str, Any]:
        """What decides the order beside the seed, by name: JSON."""
        return {name: getattr(self, name) for name in ("block", "streams", "shuffle", "drop_last")}

    @property
    def _n_batches(self) -> int:
        n = int(self.first[-1])
        return n // self.batch_size if self.drop_last else -(-n // self.batch_size)

    def __len__(self) -> int:
        """Return the number of batches that are left."""
        return self._n_batches - self.start

    def __iter__(self) -> Iterator[list[int]]:
        """Yield the samples of every batch from `start` on."""
        numbers = self._numbers()
        for k in range(self.start, self._n_batches):
            yield numbers[k * self.batch_size : (k + 1) * self.batch_size].tolist()

    def _numbers(self) -> NDArray[np.int64]:
        if not self.shuffle:
            return np.arange(self.first[-1])
        draw = rng.generator(self.seed, "learning", self.epoch)
        blocks = [block for scene in np.unique(self.scene) for block in self._blocks(int(scene), draw)]
        streams: list[list[NDArray[np.int64]]] = [[] for _ in range(min(self.streams, len(blocks)) or 1)]
        lengths = [0] * len(streams)
        for k in draw.permutation(len(blocks)):
            shortest = lengths.index(min(lengths))
            streams[shortest].append(blocks[k])
            lengths[shortest] += len(blocks[k])
        return self._interleave([np.concatenate([*stream, np.empty(0, np.int64)]) for stream in streams])

    def _blocks(self, scene: int, draw: np.random.Generator) -> list[NDArray[np.int64]]:
        own = draw.permutation(np.flatnonzero(self.scene == scene))
        samples = np.cumsum(self.first[own + 1] - self.first[own])
        cuts = np.flatnonzero(np.diff((samples - 1) // self.block)) + 1
        return [
            draw.permutation(np.concatenate([np.arange(self.first[k], self.first[k + 1]) for k in part]))
            for part in np.split(own, cuts)
        ]

    def _interleave(self, streams: list[NDArray[np.int64]]) -> NDArray[np.int64]:
        """Take a batch from every stream in turn; what is left of them at the end fills the last batches."""
        size = self.batch_size
        full = min(len(stream) // size for stream in streams)
        turns = np.stack([stream[: full * size].reshape(full, size) for stream in streams], axis=1)
        return np.concatenate([turns.ravel(), *(stream[full * size :] for stream in streams)])
