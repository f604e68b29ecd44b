"""Names of tasks and pictures: a keyed hash, so that nobody enumerates them who does not know the release's salt."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

# 48 bits: two of the paper's 102,866 tasks share an id once in 50,000 salts, and split says so.
_DIGEST_BYTES = 6


def key_of(salt: str | None, seed: int) -> bytes:
    """The key (32 bytes) that names a release's tasks and pictures; it is never written anywhere."""
    text = f"seed {seed}" if salt is None else f"salt {salt}"
    return hashlib.blake2b(text.encode(), digest_size=32, person=b"aerialdojo-ids").digest()


def nav_id(scene: str, pair_id: str, key: bytes) -> str:
    """Name a navigation task without telling its target: the pair's id would."""
    return f"{scene}-{_hex(f'{scene}/{pair_id}', key, b'nav')}"


def reference_id(scene: str, object_id: int, key: bytes) -> str:
    """Name an object's picture without giving the object away: ``ref_`` and 12 hexadecimal digits."""
    return "ref_" + _hex(f"{scene}/{object_id}", key, b"reference")


def held_out(scene: str, object_ids: Sequence[int], fraction: float, key: bytes) -> set[int]:
    """Choose the objects of a scene that the split by objects holds out."""
    place = sorted(object_ids, key=lambda k: (_hex(f"{scene}/{k}", key, b"held out"), k))
    return set(place[: int(fraction * len(place) + 0.5)])


def _hex(text: str, key: bytes, kind: bytes) -> str:
    return hashlib.blake2b(text.encode(), digest_size=_DIGEST_BYTES, key=key, person=kind).hexdigest()
