"""Names of tasks and pictures: a keyed hash, so that nobody enumerates them who does not know the release's salt."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

# 48 bits: two of the paper's 102,866 tasks share an id once in 50,000 salts, and split says so.
_DIGEST_BYTES = 6


def key_of(salt: str | None, seed: int) -> bytes:
    """Make the key that names a release's tasks and pictures.

    Parameters
    ----------
    salt : str or None
        Of the pipeline's section ``[split]``; None makes it from the seed, which a stranger may guess.
    seed : int
        Of the pipeline.

    Returns
    -------
    (32,) bytes
        Never written anywhere.
    """
    text = f"seed {seed}" if salt is None else f"salt {salt}"
    return hashlib.blake2b(text.encode(), digest_size=32, person=b"aerialdojo-ids").digest()


def nav_id(scene: str, pair_id: str, key: bytes) -> str:
    """Name a navigation task without telling its target: the pair's id would.

    Returns
    -------
    str
        The scene and 12 hexadecimal digits of a keyed hash of the pair, e.g. ``"U_Mall_0-3f0c51d2a9be"``.
    """
    return f"{scene}-{_hex(f'{scene}/{pair_id}', key, b'nav')}"


def reference_id(scene: str, object_id: int, key: bytes) -> str:
    """Name an object's picture without giving the object away: ``ref_`` and 12 hexadecimal digits."""
    return "ref_" + _hex(f"{scene}/{object_id}", key, b"reference")


def held_out(scene: str, object_ids: Sequence[int], fraction: float, key: bytes) -> set[int]:
    """Choose the objects of a scene that the split by objects holds out.

    Parameters
    ----------
    scene : str
        Name of the scene.
    object_ids : sequence of int
        All of its objects, in any order.
    fraction : float
        Share of them, rounded half up to a whole number.
    key : bytes
        Of `key_of`.

    Returns
    -------
    set of int
        Those whose keyed hash comes first.
    """
    place = sorted(object_ids, key=lambda k: (_hex(f"{scene}/{k}", key, b"held out"), k))
    return set(place[: int(fraction * len(place) + 0.5)])


def _hex(text: str, key: bytes, kind: bytes) -> str:
    return hashlib.blake2b(text.encode(), digest_size=_DIGEST_BYTES, key=key, person=kind).hexdigest()
