"""What a shard's footer says of it, as JSON with a checksum of its own: damage is detected.

Parquet's page checksums cover the rows and not the footer, so that what stands there must vouch for itself. What
the footers of a data directory's shards said is kept in the user's cache for the next run.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, BeforeValidator, Field, TypeAdapter, ValidationError

from aerialdojo_gen.base.errors import Malformed
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.store.cache import cache_folder
from aerialdojo_gen.store.root import DataRoot, LocalRoot, changed_ns

_KEYS = frozenset({"fingerprint", "content", "columns", "rows", "parts", "summary", "files", "checksum"})
# Of a footer that vouches for nothing; logs and releases of then are still read.
_EARLIER_KEYS = _KEYS - {"columns", "checksum"}
_Count = Annotated[int, Field(strict=True, ge=0)]
_Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
_HalfDigest = Annotated[str, Field(pattern=r"^[0-9a-f]{32}$")]


class _Summary(BaseModel, extra="forbid"):
    rows_in: _Count
    rows_out: _Count
    counts: dict[str, _Count]


def _checked(summary: Any) -> Any:
    return summary if summary == {} else _Summary.model_validate(summary).model_dump()


class ShardFile(NamedTuple):
    """A file that was written with a shard."""

    size: _Count  # Bytes
    sha256: _Digest | Literal[""]  # Hexadecimal; empty where the shard's rows have it


@dataclass(frozen=True)
class ShardInfo:
    """What a shard's footer says."""

    fingerprint: str  # Of the code, configuration, inputs and assets that it was made from
    content: _Digest  # SHA-256 of the rows
    # `aerialdojo_gen.store.tables.column_digests`; empty where an earlier version wrote it
    columns: dict[str, _HalfDigest]
    rows: _Count  # Rows in the shard; shards of the scene
    parts: _Count
    # The stage's ``rows_in``, ``rows_out`` and ``counts`` of the shard
    summary: Annotated[dict[str, Any], BeforeValidator(_checked)]
    files: dict[str, ShardFile]  # Files that were written with it, by their path relative to the data directory


_INFO = TypeAdapter(ShardInfo)


def encode(info: ShardInfo) -> bytes:
    """Write it as JSON; the same says the same bytes."""
    fields = vars(info)
    return json.dumps(fields | {"checksum": _checksum(fields)}, sort_keys=True).encode()


def decode(raw: bytes) -> ShardInfo:
    """Read what `encode` wrote, or an earlier version, whose footers have no checksums."""
    try:
        fields = loads_json(raw)
    except Malformed:
        raise ValueError("its footer is no JSON") from None
    if not isinstance(fields, dict):
        raise ValueError("its footer is no JSON object")
    if fields.keys() == _EARLIER_KEYS and isinstance(fields["files"], dict):
        fields = fields | {"columns": {}, "files": {name: [size, ""] for name, size in fields["files"].items()}}
    elif fields.keys() != _KEYS or fields.pop("checksum") != _checksum(fields):
        raise ValueError("its footer's checksum is wrong")
    # A right checksum says only that some program wrote it.
    try:
        return _INFO.validate_python(fields)
    except ValidationError:
        raise ValueError("its footer has impossible values") from None


def _checksum(fields: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()


# No file system has coarser times.
_TIME_RESOLUTION_NS = 2 * 10**9


class FooterCache:
    """The footers of a data directory, in a file; one that is damaged, or cannot be written, is none.

    What is kept of a shard counts as long as it is the same version (`DataRoot.version`). A change could hide behind
    times that do not tell it from the one before: of a shard that was changed less than two seconds before its footer
    was read nothing is kept. Digests of files are not kept: who compares one reads the file.
    """

    def __init__(self, root: LocalRoot) -> None:
        self._root = root
        name = hashlib.sha256(os.fsencode(root.path)).hexdigest()
        self._path = cache_folder() / "footers" / f"{name}.json"
        # What another reader of footers made of them would be something else.
        self._reader = hashlib.sha256(Path(__file__).read_bytes()).digest()
        self._entries: dict[str, Any] = {}
        self._used: set[str] = set()
        self._changed = False
        with contextlib.suppress(OSError, ValueError):
            checksum, text = self._path.read_bytes().split(b"\n", 1)
            if checksum == self._checksum(text):
                self._entries = json.loads(text)

    def find(self, root: DataRoot, name: str, version: str) -> ShardInfo | None:
        """Return what the footer of a shard says that has this version; None where that is not known."""
        entry = self._entries.get(name) if root == self._root else None
        if entry is None or entry["version"] != version:
            return None
        self._used.add(name)
        fields = entry["facts"]
        return ShardInfo(**fields | {"files": {file: ShardFile(*pair) for file, pair in fields["files"].items()}})

    def record(self, root: DataRoot, name: str, version: str, read_ns: int, info: ShardInfo) -> None:
        """Keep what the footer of a shard says; `read_ns` is when its version was read."""
        if root == self._root and read_ns - changed_ns(version) > _TIME_RESOLUTION_NS:
            self._used.add(name)
            self._entries[name] = {"version": version, "facts": vars(info)}
            self._changed = True

    def save(self) -> None:
        """Write the file, where something came to it; shards that are gone are left out."""
        if not self._changed:
            return
        self._changed = False
        kept = {name: e for name, e in self._entries.items() if name in self._used or self._root.exists(name)}
        text = json.dumps(kept).encode()
        temporary = self._path.with_name(f".{self._path.name}.{os.getpid()}.tmp")
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            temporary.write_bytes(self._checksum(text) + b"\n" + text)
            temporary.replace(self._path)

    def _checksum(self, text: bytes) -> bytes:
        return hashlib.sha256(self._reader + text).hexdigest().encode()


_current: ContextVar[FooterCache | None] = ContextVar("known footers", default=None)


@contextlib.contextmanager
def cached_footers(root: DataRoot) -> Iterator[None]:
    """Read footers of a data directory once while they stay as they are, here and in later processes."""
    if not isinstance(root, LocalRoot):
        yield
        return
    known = FooterCache(root)
    token = _current.set(known)
    try:
        yield
    finally:
        _current.reset(token)
        known.save()


def footer_cache() -> FooterCache | None:
    """Return what `cached_footers` keeps footers in; None outside of it."""
    return _current.get()
