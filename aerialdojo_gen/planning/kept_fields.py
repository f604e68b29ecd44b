"""Goals' cost-to-go, kept between two visits to the same goals: the first as they are, the others compressed.

A field is whole quanta, and neighbours in a column are nearly equal, so that differences take a tenth of its bytes.
To pack and unpack one takes a quarter of the time of finding it again.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.planning.column_kernels import QUANTUM_M

_CODEC = "lz4_raw"
_NOWHERE = -1


class FieldCache:
    """Fields by their goals."""

    def __init__(self, plain_mb: float, packed_mb: float) -> None:
        self._room = {True: plain_mb * 1e6, False: packed_mb * 1e6}
        self._plain: dict[bytes, NDArray[np.float32]] = {}
        self._packed: dict[bytes, pa.Buffer] = {}

    def find(self, goal: bytes, scratch: NDArray[np.float32]) -> NDArray[np.float32] | None:
        """Return a goal's field (nx, ny, nz), decompressed into `scratch` if need be; None where it was not kept."""
        if goal in self._plain:
            return self._plain[goal]
        if goal not in self._packed:
            return None
        steps = pa.decompress(self._packed[goal], 4 * scratch.size, _CODEC)
        _unpack(np.frombuffer(steps, np.int32), scratch.reshape(-1))
        return scratch

    def keep(self, goal: bytes, field: NDArray[np.float32]) -> None:
        """Keep a copy of a goal's field, multiples of `QUANTUM_M` or inf, where there is room."""
        if self._takes(True, field.nbytes):
            self._plain[goal] = field.copy()
        elif self._room[False] > 0.0:
            steps = np.empty(field.size, np.int32)
            _pack(field.reshape(-1), steps)
            packed = pa.compress(steps, _CODEC)
            if self._takes(False, packed.size):
                self._packed[goal] = packed

    def _takes(self, plain: bool, n_bytes: int) -> bool:
        if n_bytes > self._room[plain]:
            return False
        self._room[plain] -= n_bytes
        return True


@njit(cache=True)
def _pack(field: NDArray[np.float32], steps: NDArray[np.int32]) -> None:
    before = np.int32(0)
    for i in range(field.shape[0]):
        value = np.int32(field[i] / np.float32(QUANTUM_M)) if field[i] < np.inf else np.int32(_NOWHERE)
        steps[i] = value - before
        before = value


@njit(cache=True)
def _unpack(steps: NDArray[np.int32], field: NDArray[np.float32]) -> None:
    value = np.int32(0)
    for i in range(steps.shape[0]):
        value += steps[i]
        field[i] = np.float32(value) * np.float32(QUANTUM_M) if value != _NOWHERE else np.float32(np.inf)
