"""Goals as words and as tokens, and the words of objects' names that images are searched for."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import UsageError

PADDING, UNKNOWN = 0, 1
_WORD = re.compile(r"\w+|[^\w\s]")


def goal_text(target_name: str, landmark: str, direction: str, description: str | None) -> str:
    """Say a goal in words, as the task gives it: name, direction from the landmark, and any description."""
    text = f"{target_name}, {direction} of {landmark}"
    return f"{text}. {description}" if description else text


def words_of(text: str) -> list[str]:
    """Cut a text into words and signs, in lower case."""
    return _WORD.findall(text.lower())


class Vocabulary:
    """Numbers of words: 0 is padding, 1 a word that is not known, the others in the order of `words`.

    Parameters
    ----------
    words : sequence of str
        Each once.
    length : int
        Numbers of a text: longer ones are cut, shorter ones padded.
    """

    def __init__(self, words: Sequence[str], length: int = 64) -> None:
        if length < 1:
            raise UsageError(f"a text has at least 1 token, not {length}")
        if len(set(words)) != len(words):
            raise UsageError("duplicate word in the vocabulary")
        self.words = tuple(words)
        self.length = length
        self._number = {word: k for k, word in enumerate(self.words, start=UNKNOWN + 1)}

    def __len__(self) -> int:
        """Return how many numbers there are, padding and the unknown word with them."""
        return len(self.words) + 2

    @classmethod
    def of(cls, texts: Iterable[str], length: int = 64, at_least: int = 1) -> Vocabulary:
        """Collect the words of texts that occur often enough; the most frequent first, then by the alphabet."""
        counted = Counter(word for text in texts for word in words_of(text))
        kept = [word for word, n in counted.items() if n >= at_least]
        return cls(sorted(kept, key=lambda word: (-counted[word], word)), length)

    def encode(self, text: str) -> NDArray[np.int64]:
        """Number the words of a text: (length,) int64."""
        numbers = [self._number.get(word, UNKNOWN) for word in words_of(text)[: self.length]]
        out = np.full(self.length, PADDING, np.int64)
        out[: len(numbers)] = numbers
        return out


# Words that name nothing.
_STOP_WORDS = frozenset({"a", "an", "and", "at", "by", "for", "from", "in", "of", "on", "the", "to", "with"})


def name_vocabulary(names: Iterable[str]) -> tuple[str, ...]:
    """Collect the words of objects' names that occur in two of them at least, by the alphabet."""
    counted = Counter(word for name in names for word in set(words_of(name)))
    return tuple(sorted(w for w, n in counted.items() if n >= 2 and w.isalpha() and w not in _STOP_WORDS))


def word_targets(names: Sequence[str], words: Sequence[str]) -> NDArray[np.float32]:
    """Which words name objects: (n, words) float32, rows sum to 1 or are 0 where no word is known."""
    place = {word: k for k, word in enumerate(words)}
    out = np.zeros((len(names), len(words)), np.float32)
    for row, name in zip(out, names, strict=True):
        row[[place[w] for w in words_of(name) if w in place]] = 1.0
    return out / np.maximum(out.sum(axis=1, keepdims=True), 1.0)
