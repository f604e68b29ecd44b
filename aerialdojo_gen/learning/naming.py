"""Objects' names as words that pictures can be searched for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.learning.words import words_of

# Words that name nothing.
_SMALL = frozenset({"a", "an", "and", "at", "by", "for", "from", "in", "of", "on", "the", "to", "with"})


def naming_words(names: Iterable[str], at_least: int = 2) -> tuple[str, ...]:
    """Collect the words of objects' names that occur in enough of them, by the alphabet."""
    counted = Counter(word for name in names for word in set(words_of(name)))
    return tuple(sorted(w for w, n in counted.items() if n >= at_least and w.isalpha() and w not in _SMALL))


def named_by(names: Sequence[str], words: Sequence[str]) -> NDArray[np.float32]:
    """Which words name objects: (n, words) float32, rows sum to 1 or are 0 where no word is known."""
    place = {word: k for k, word in enumerate(words)}
    out = np.zeros((len(names), len(words)), np.float32)
    for row, name in zip(out, names, strict=True):
        row[[place[w] for w in words_of(name) if w in place]] = 1.0
    return out / np.maximum(out.sum(axis=1, keepdims=True), 1.0)
