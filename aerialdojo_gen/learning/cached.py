"""Small pictures kept on the disk, a file a trajectory: what was drawn once is read in the next epoch.

A file holds each step's pictures compressed on their own, so that one step is read without the others, and a checksum
with each: a file that is cut off or damaged is drawn again. Nothing is ever thrown out for something newer: who goes
through a data set in a new order every epoch would meet just what was thrown out last. What finds no room is drawn.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.observations import renderer_name
from aerialdojo_gen.learning.index import Index
from aerialdojo_gen.learning.pictures import Frames, Source, empty_frames, take
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.store.atomic import make_folder

_MAGIC = b"ADPIX1\n\0"
# Offset and length of a step's bytes, and their CRC-32.
_ENTRY = struct.Struct("<QII")
# How many bytes this process writes before it counts anew what others have written.
_RECOUNT = 256 << 20


@dataclass(frozen=True)
class CacheOptions:
    """Where pictures are kept."""

    base: Path  # Pictures that are made in another way have another folder in it
    most_bytes: int  # How large the folder of one way may grow
    source: str  # Where pictures come from, and what draws them
    renderer: str


class CachedFrames:
    """Pictures of a source, kept in a folder."""

    def __init__(
        self, source: Source, index: Index, sensors: Sensors, store: CacheOptions, meshes: dict[str, str]
    ) -> None:
        self._source, self._index, self._sensors = source, index, sensors
        self._store, self._meshes = store, meshes
        self._full = False
        self._used: int | None = None
        self._since = 0

    def frames(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> Frames:
        """Read what is there, draw the rest, and keep what was drawn while there is room; see `Source`."""
        out = empty_frames(self._sensors, len(steps))
        missing = []
        for k in np.unique(trajectories):
            rows = np.flatnonzero(trajectories == k)
            if not self._read(int(k), steps[rows], rows, out):
                missing.append((int(k), rows))
        for k, rows in missing:
            if not self._full and self._room():
                n = int(self._index.steps[k])
                whole = self._source.frames(np.full(n, k), np.arange(n))
                self._keep(k, whole)
                drawn = take(whole, steps[rows])
            else:
                drawn = self._source.frames(trajectories[rows], steps[rows])
            for name, seen in drawn.items():
                out[name][rows] = seen
        return out

    @property
    def _codec(self) -> pa.Codec:
        # Not kept: it cannot be sent to another process.
        return pa.Codec("lz4_raw")

    @cached_property
    def _folder(self) -> Path:
        # In the process that reads: to find out which renderer works here is to draw.
        return pictures_folder(self._store, self._sensors)

    def _path(self, k: int) -> Path:
        index = self._index
        flown = hashlib.sha256(index.start[k].tobytes() + index.actions_of(k).tobytes()).hexdigest()[:16]
        mesh = self._meshes[index.scenes[index.scene[k]]][:16]
        return self._folder / mesh / f"{index.nav_id[k]}-{flown}.pix"

    def _read(self, k: int, steps: NDArray[np.int64], rows: NDArray[np.int64], out: Frames) -> bool:
        n = int(self._index.steps[k])
        try:
            with self._path(k).open("rb") as file:
                head = file.read(len(_MAGIC) + n * _ENTRY.size)
                if len(head) != len(_MAGIC) + n * _ENTRY.size or not head.startswith(_MAGIC):
                    return False
                for step, row in zip(steps.tolist(), rows.tolist(), strict=True):
                    at, length, crc = _ENTRY.unpack_from(head, len(_MAGIC) + step * _ENTRY.size)
                    file.seek(at)
                    packed = file.read(length)
                    if len(packed) != length or zlib.crc32(packed) != crc:
                        return False
                    self._unpack(packed, row, out)
        except OSError:
            return False
        return True

    def _unpack(self, packed: bytes, row: int, out: Frames) -> None:
        sizes = {name: seen[row].nbytes for name, seen in out.items()}
        plain = np.frombuffer(self._codec.decompress(packed, sum(sizes.values())), np.uint8)
        if "rgb" in out:
            out["rgb"][row] = plain[: sizes["rgb"]].reshape(out["rgb"][row].shape)
        if "depth_m" in out:
            # The bytes of one significance together, which are alike: see `_pack`.
            planes = np.ascontiguousarray(plain[-sizes["depth_m"] :].reshape(4, -1).T)
            out["depth_m"][row] = planes.view("<f4").reshape(out["depth_m"][row].shape)

    def _pack(self, frames: Frames, row: int) -> bytes:
        parts = [frames["rgb"][row].tobytes()] if "rgb" in frames else []
        if "depth_m" in frames:
            parts.append(frames["depth_m"][row].astype("<f4").view(np.uint8).reshape(-1, 4).T.tobytes())
        return bytes(self._codec.compress(b"".join(parts), asbytes=True))

    def _keep(self, k: int, frames: Frames) -> None:
        packed = [self._pack(frames, row) for row in range(int(self._index.steps[k]))]
        starts = np.cumsum([len(_MAGIC) + len(packed) * _ENTRY.size, *(len(p) for p in packed)])
        head = b"".join(_ENTRY.pack(int(at), len(p), zlib.crc32(p)) for at, p in zip(starts, packed, strict=False))
        path = self._path(k)
        size = int(starts[-1])
        if self._used is not None and self._used + size > self._store.most_bytes:
            self._full = True
            return
        make_folder(path.parent)
        temporary = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            temporary.write_bytes(b"".join([_MAGIC, head, *packed]))
            temporary.replace(path)
        except OSError:
            # A full disk ends what is kept, not the training.
            self._full = True
            with contextlib.suppress(OSError):
                temporary.unlink()
            return
        self._used = (self._used or 0) + size
        self._since += size

    def _room(self) -> bool:
        if self._used is None or self._since > _RECOUNT:
            self._used, self._since = sum(_sizes(self._folder)), 0
        return self._used < self._store.most_bytes


def pictures_folder(store: CacheOptions, sensors: Sensors) -> Path:
    """Return the folder of pictures that are made in one way, made where it is not there."""
    s = sensors
    facts = {
        "code": [code_of(f"aerialdojo_gen.rendering.{name}").digest for name in ("bodies", "gl", "world", "reader")],
        "source": store.source,
        "renderer": renderer_name(store.renderer), "views": s.views, "rgb": s.rgb, "depth": s.depth,
        "width": s.width, "height": s.height, "fov_deg": s.fov_deg, "max_depth_m": s.max_depth_m,
    }  # fmt: skip
    text = json.dumps(facts, sort_keys=True)
    folder = store.base / hashlib.sha256(text.encode()).hexdigest()[:16]
    make_folder(folder)
    return folder


def _sizes(folder: Path) -> Iterator[int]:
    for path in folder.glob("*/*.pix"):
        with contextlib.suppress(OSError):
            yield path.stat().st_size
