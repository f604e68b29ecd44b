"""Batches for training: shuffled scene by scene, from worker processes where wanted, resumable within an epoch."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import AerialDojoError, MissingPackage, StoreError, UsageError, first_line, no_package
from aerialdojo_gen.benchmark.observations import used_opengl

if TYPE_CHECKING:
    from aerialdojo_gen.learning.trajectories import Trajectories


@dataclass(frozen=True, eq=False)
class Order:
    """The batches of one epoch, as lists of sample numbers: a batch sampler for ``torch.utils.data.DataLoader``.

    Who renders on the fly must not change the scene at every sample: its mesh takes a second to load. So every
    scene's trajectories are shuffled and cut into blocks, whose samples are shuffled; the blocks of all scenes are
    dealt out to a few streams, and batches come from the streams in turn. Worker w of W gets batches w, w + W, …:
    with as many workers as streams each has one scene open at a time, and with any number the batches are the same.
    """

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


class WorkerDied(AerialDojoError):  # noqa: N818 - it says what happened
    """A worker process of a loader ended before its batches were drawn: killed, or out of memory."""


class Loader:
    """The batches of a data set, epoch after epoch; an iteration is what is left of the epoch.

    What comes depends on the data set, `seed`, the epoch and the batch alone: not on the number of workers, and not
    on what was iterated before. `state_dict` says where it is, and `load_state_dict` goes on there.

    Parameters
    ----------
    data : Trajectories
    batch_size : int
    workers : int
        Processes that draw; 0 draws in this one, without torch.
    seed : int
        Of the order.
    tensors : bool
        Whether arrays come as torch tensors.
    context : str, optional
        How workers start: ``"fork"`` or ``"spawn"``. Where absent it is fork, but spawn where this process has
        drawn by OpenGL, whose forks could not.
    **how
        ``block``, ``streams``, ``shuffle``, ``drop_last`` of `Order`.

    Attributes
    ----------
    epoch : int
        The one under way.
    batches_done : int
        Of it; batches that were handed out, not those that workers have ready.

    Raises
    ------
    UsageError
        A value makes no sense.
    MissingPackage
        There is no torch for what needs it.
    """

    def __init__(
        self,
        data: Trajectories,
        batch_size: int = 32,
        *,
        workers: int = 0,
        seed: int = 0,
        tensors: bool = False,
        context: str | None = None,
        **how: Any,
    ) -> None:
        if workers < 0:
            raise UsageError(f"there are 0 or more workers, not {workers}")
        if context not in (None, "fork", "spawn", "forkserver"):
            raise UsageError(f"workers start by fork, spawn or forkserver, not by {context!r}")
        self._data, self._batch_size, self._seed, self._how = data, batch_size, seed, how
        self._workers, self._tensors, self._context = workers, tensors, context
        self._torch = torch_package("a loader with workers or tensors") if workers or tensors else None
        # Refuses what makes no sense.
        self._order = data.order(batch_size, seed=seed, **how).how
        # A DataLoader keeps its sampler: the batches of the epoch under way.
        self._left: list[list[int]] = []
        self._loading: Any = None
        self.epoch = self.batches_done = 0

    def close(self) -> None:
        """End the workers; the next iteration starts new ones."""
        self._loading = None

    def __len__(self) -> int:
        """Return the number of batches of a whole epoch."""
        return len(self._data.order(self._batch_size, **self._how))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield what is left of the epoch; the next iteration is the next epoch."""
        at = {"seed": self._seed, "epoch": self.epoch, "start": self.batches_done}
        order = self._data.order(self._batch_size, **at, **self._how)
        batches = self._from_workers(order) if self._workers else (self._data.batch(n) for n in order)
        for batch in batches:
            self.batches_done += 1
            yield as_tensors(batch) if self._tensors and not self._workers else batch
        self.epoch, self.batches_done = self.epoch + 1, 0

    def state_dict(self) -> dict[str, Any]:
        """Return where the loader is: JSON, for a checkpoint."""
        return {
            "seed": self._seed, "epoch": self.epoch, "batch": self.batches_done, "batch_size": self._batch_size,
            "order": dict(self._order), "fingerprint": self._data.fingerprint,
        }  # fmt: skip

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on where a state was taken.

        Raises
        ------
        StoreError
            The state is of another data set, seed, size of batches or order.
        """
        own = self.state_dict()
        if set(state) != set(own):
            raise StoreError(f"a loader's state has {', '.join(sorted(own))}, not {', '.join(sorted(state))}")
        for name in ("fingerprint", "seed", "batch_size", "order"):
            if state[name] != own[name]:
                raise StoreError(
                    f"the state is of another loader: its {name} is {state[name]}, and here it is {own[name]}"
                )
        epoch, batch = state["epoch"], state["batch"]
        if not (isinstance(epoch, int) and isinstance(batch, int) and epoch >= 0 and 0 <= batch <= len(self)):
            raise StoreError(f"a loader has no batch {batch} of epoch {epoch}")
        self.epoch, self.batches_done = epoch, batch

    def _from_workers(self, order: Order) -> Iterator[dict[str, Any]]:
        assert self._torch is not None
        self._left[:] = order
        if self._loading is None:
            # Kept over the epochs: what a worker has opened stays open.
            self._loading = self._torch.utils.data.DataLoader(
                _Batches(self._data),
                sampler=self._left,
                batch_size=None,
                num_workers=self._workers,
                multiprocessing_context=self._context or ("spawn" if used_opengl() else "fork"),
                worker_init_fn=_one_thread,
                persistent_workers=True,
            )
        try:
            for batch in self._loading:
                yield batch if self._tensors else _as_arrays(batch)
        except (RuntimeError, ConnectionError, EOFError) as error:
            # torch has no class for it; what a worker raises itself comes as its own class. A worker that dies while
            # it hands a batch over breaks the connection.
            if isinstance(error, RuntimeError) and "DataLoader worker" not in str(error):
                raise
            self._loading = None
            raise WorkerDied(
                f"a worker of the loader died ({first_line(error)}): fewer workers or smaller batches take less "
                "memory; load_state_dict goes on at the batch"
            ) from None


class _Batches:
    """A data set whose items are batches, by the list of their samples."""

    def __init__(self, data: Trajectories) -> None:
        self._data = data

    def __getitem__(self, numbers: list[int]) -> dict[str, Any]:
        """Draw a batch."""
        return as_tensors(self._data.batch(numbers))


def torch_package(who: str = "a policy", name: str = "torch") -> Any:
    """Import torch, or safetensors; raise MissingPackage, which names the extra, if it is not installed."""
    try:
        importlib.import_module({"torch": "torch.utils.data", "safetensors": "safetensors.torch"}[name])
        return importlib.import_module(name)
    except ImportError:
        raise MissingPackage(no_package(who, name, "train")) from None


def as_tensors(batch: Mapping[str, Any]) -> dict[str, Any]:
    """Make tensors of a batch's arrays, without copying them; texts stay as they are."""
    torch = torch_package()
    return {
        name: torch.from_numpy(np.ascontiguousarray(value)) if isinstance(value, np.ndarray) else value
        for name, value in batch.items()
    }


def _as_arrays(batch: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value.numpy() if hasattr(value, "numpy") else value for name, value in batch.items()}


def _one_thread(worker: int) -> None:
    """Leave the cores to the other workers."""
    del worker
    torch_package().set_num_threads(1)
