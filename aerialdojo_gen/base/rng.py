"""Random generators that depend on what is drawn for, never on the order of drawing."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

_T = TypeVar("_T")


def _digest(seed: int, stage: str, key: tuple[object, ...]) -> bytes:
    """Hash (seed, stage, key); lengths are part of the hash, so that ("a", "bc") and ("ab", "c") differ."""
    parts = [str(part).encode() for part in (seed, stage, *key)]
    raw = b"".join([len(part).to_bytes(4, "little") + part for part in parts])
    return hashlib.blake2b(raw, digest_size=16).digest()


def generator(seed: int, stage: str, *key: object) -> np.random.Generator:
    """Make the generator of one row."""
    return np.random.Generator(np.random.PCG64(int.from_bytes(_digest(seed, stage, key), "little")))


def pick(options: Sequence[_T], rng: np.random.Generator) -> _T:
    """Draw one of some options."""
    return options[int(rng.integers(len(options)))]


def rank(seed: int, stage: str, *key: object) -> int:
    """Give the row its place in a random but fixed order: an integer in [0, 2**64)."""
    return int.from_bytes(_digest(seed, stage, key)[:8], "little")
