"""Ids of tasks and pictures: a keyed hash that cannot be enumerated without the release's salt."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

# 48 bits: two of the paper's 102,866 tasks collide once in 50,000 salts, which split reports.
_DIGEST_BYTES = 6


def key_of(salt: str | None, seed: int) -> bytes:
    """The key (32 bytes) of a release's ids; it is never stored."""
    text = f"seed {seed}" if salt is None else f"salt {salt}"
    return hashlib.blake2b(text.encode(), digest_size=32, person=b"aerialdojo-ids").digest()


def nav_id(scene: str, pair_id: str, key: bytes) -> str:
    """Id of a navigation task, which does not reveal the target as the pair's id does."""
    return f"{scene}-{_hex(f'{scene}/{pair_id}', key, b'nav')}"


def reference_id(scene: str, object_id: int, key: bytes) -> str:
    """Id of an object's picture, which does not reveal the object: ``ref_`` and 12 hexadecimal digits."""
    return "ref_" + _hex(f"{scene}/{object_id}", key, b"reference")


def held_out(scene: str, object_ids: Sequence[int], fraction: float, key: bytes) -> set[int]:
    """Choose a scene's objects that the split by objects holds out."""
    place = sorted(object_ids, key=lambda k: (_hex(f"{scene}/{k}", key, b"held out"), k))
    return set(place[: int(fraction * len(place) + 0.5)])


def _hex(text: str, key: bytes, kind: bytes) -> str:
    return hashlib.blake2b(text.encode(), digest_size=_DIGEST_BYTES, key=key, person=kind).hexdigest()
