"""What a shard's footer says of it, as JSON with a checksum of its own: damage is detected.

Parquet's page checksums cover the rows and not the footer, so that what stands there must vouch for itself.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from aerialdojo_gen.base.errors import Malformed
from aerialdojo_gen.base.safe_parse import loads_json

_KEYS = frozenset({"fingerprint", "content", "columns", "rows", "parts", "summary", "files", "checksum"})
# Of a footer that vouches for nothing; logs and releases of then are still read.
_EARLIER_KEYS = _KEYS - {"columns", "checksum"}
_DIGEST = re.compile(r"[0-9a-f]{64}")
_HALF_DIGEST = re.compile(r"[0-9a-f]{32}")


@dataclass(frozen=True)
class ShardFile:
    """A file that was written with a shard."""

    size: int  # Bytes
    sha256: str = ""  # Hexadecimal; empty where the shard's rows have it


@dataclass(frozen=True)
class ShardInfo:
    """What a shard's footer says."""

    fingerprint: str  # Of the code, configuration, inputs and assets that it was made from
    content: str  # SHA-256 of the rows
    columns: dict[str, str]  # `aerialdojo_gen.store.tables.column_digests`; empty where an earlier version wrote it
    rows: int  # Rows in the shard; shards of the scene
    parts: int
    summary: dict[str, Any]  # The stage's ``rows_in``, ``rows_out`` and ``counts`` of the shard
    files: dict[str, ShardFile]  # Files that were written with it, by their path relative to the data directory


def encode(info: ShardInfo) -> bytes:
    """Write it as JSON; the same says the same bytes."""
    fields = {
        "fingerprint": info.fingerprint,
        "content": info.content,
        "columns": info.columns,
        "rows": info.rows,
        "parts": info.parts,
        "summary": info.summary,
        "files": {name: [file.size, file.sha256] for name, file in info.files.items()},
    }
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
    if not _well_formed(fields):
        raise ValueError("its footer has impossible values")
    files = {name: ShardFile(*pair) for name, pair in fields.pop("files").items()}
    return ShardInfo(**fields, files=files)


def _checksum(fields: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()


def _well_formed(fields: Mapping[str, Any]) -> bool:
    """Whether all values are of their types: a right checksum says only that some program wrote them."""
    return (
        isinstance(fields["fingerprint"], str)
        and _is_digest(fields["content"])
        and isinstance(fields["columns"], dict)
        and all(_is_digest(value, _HALF_DIGEST) for value in fields["columns"].values())
        and _is_count(fields["rows"])
        and _is_count(fields["parts"])
        and _is_summary(fields["summary"])
        and isinstance(fields["files"], dict)
        and all(_is_file(value) for value in fields["files"].values())
    )


def _is_digest(value: Any, pattern: re.Pattern[str] = _DIGEST) -> bool:
    return isinstance(value, str) and pattern.fullmatch(value) is not None


def _is_count(value: Any) -> bool:
    return type(value) is int and value >= 0


def _is_summary(value: Any) -> bool:
    if value == {}:
        return True
    return (
        isinstance(value, dict)
        and value.keys() == {"rows_in", "rows_out", "counts"}
        and _is_count(value["rows_in"])
        and _is_count(value["rows_out"])
        and isinstance(value["counts"], dict)
        and all(_is_count(number) for number in value["counts"].values())
    )


def _is_file(value: Any) -> bool:
    if not isinstance(value, list) or len(value) != 2:
        return False
    size, sha256 = value
    return _is_count(size) and (sha256 == "" or _is_digest(sha256))
