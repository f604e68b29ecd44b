"""The order of an epoch: shuffled, scene by scene in blocks, and the same for any number of workers.

Who renders on the fly must not change the scene at every sample: its mesh takes a second to load. So every scene's
trajectories are shuffled and cut into blocks, whose samples are shuffled; the blocks of all scenes are dealt out to a
few streams, and batches come from the streams in turn. Worker w of W gets batches w, w + W, …: with as many workers
as streams each has one scene open at a time, and with any number the batches are the same in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import UsageError


class Order:
    """The batches of one epoch, as lists of sample numbers: a batch sampler for ``torch.utils.data.DataLoader``."""

    def __init__(
        self,
        scene: NDArray[np.integer],
        first: NDArray[np.int64],
        batch_size: int,
        *,
        seed: int = 0,
        epoch: int = 0,
        start: int = 0,
        block: int = 2048,
        streams: int = 2,
        shuffle: bool = True,
        drop_last: bool = False,
    ) -> None:
        for what, value in (("batch_size", batch_size), ("block", block), ("streams", streams)):
            if value < 1:
                raise UsageError(f"{what} is at least 1, not {value}")
        self.how = {"block": block, "streams": streams, "shuffle": shuffle, "drop_last": drop_last}
        self._scene, self._first = scene, first
        self._batch_size = batch_size
        self._seed, self._epoch, self._block, self._streams = seed, epoch, block, streams
        self._shuffle = shuffle
        n = int(first[-1])
        self._n_batches = n // batch_size if drop_last else -(-n // batch_size)
        if not 0 <= start <= self._n_batches:
            raise UsageError(f"the epoch has {self._n_batches} batches: there is no batch {start} to go on with")
        self._start = start

    def __len__(self) -> int:
        """Return the number of batches that are left."""
        return self._n_batches - self._start

    def __iter__(self) -> Iterator[list[int]]:
        """Yield the samples of every batch from `start` on."""
        numbers = self._numbers()
        for k in range(self._start, self._n_batches):
            yield numbers[k * self._batch_size : (k + 1) * self._batch_size].tolist()

    def _numbers(self) -> NDArray[np.int64]:
        if not self._shuffle:
            return np.arange(self._first[-1])
        draw = rng.generator(self._seed, "learning", self._epoch)
        blocks = [block for scene in np.unique(self._scene) for block in self._blocks(int(scene), draw)]
        streams: list[list[NDArray[np.int64]]] = [[] for _ in range(min(self._streams, len(blocks)) or 1)]
        lengths = [0] * len(streams)
        for k in draw.permutation(len(blocks)):
            shortest = lengths.index(min(lengths))
            streams[shortest].append(blocks[k])
            lengths[shortest] += len(blocks[k])
        return self._interleave([np.concatenate([*stream, np.empty(0, np.int64)]) for stream in streams])

    def _blocks(self, scene: int, draw: np.random.Generator) -> list[NDArray[np.int64]]:
        own = draw.permutation(np.flatnonzero(self._scene == scene))
        samples = np.cumsum(self._first[own + 1] - self._first[own])
        cuts = np.flatnonzero(np.diff((samples - 1) // self._block)) + 1
        return [
            draw.permutation(np.concatenate([np.arange(self._first[k], self._first[k + 1]) for k in part]))
            for part in np.split(own, cuts)
        ]

    def _interleave(self, streams: list[NDArray[np.int64]]) -> NDArray[np.int64]:
        """Take a batch from every stream in turn; what is left of them at the end fills the last batches."""
        size = self._batch_size
        full = min(len(stream) // size for stream in streams)
        turns = np.stack([stream[: full * size].reshape(full, size) for stream in streams], axis=1)
        return np.concatenate([turns.ravel(), *(stream[full * size :] for stream in streams)])
