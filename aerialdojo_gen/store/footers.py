"""What a shard's footer says of it, as JSON with a checksum of its own: damage is detected.

Parquet's page checksums cover the rows and not the footer, so that what stands there must vouch for itself.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, BeforeValidator, Field, TypeAdapter, ValidationError

from aerialdojo_gen.base.errors import Malformed
from aerialdojo_gen.base.safe_parse import loads_json

_KEYS = frozenset({"fingerprint", "content", "columns", "rows", "parts", "summary", "files", "checksum"})
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
    columns: dict[str, _HalfDigest]  # `aerialdojo_gen.store.tables.column_digests`
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
    """Read what `encode` wrote; ValueError where it is something else."""
    try:
        fields = loads_json(raw)
    except Malformed:
        raise ValueError("its footer is no JSON") from None
    if not isinstance(fields, dict):
        raise ValueError("its footer is no JSON object")
    if "checksum" not in fields:
        raise ValueError("its footer has no checksum, as version 0.1 wrote it")
    if fields.keys() != _KEYS or fields.pop("checksum") != _checksum(fields):
        raise ValueError("its footer's checksum is wrong")
    # A right checksum says only that some program wrote it.
    try:
        return _INFO.validate_python(fields)
    except ValidationError:
        raise ValueError("its footer has impossible values") from None


def _checksum(fields: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()
