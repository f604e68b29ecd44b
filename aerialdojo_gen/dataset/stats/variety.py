"""How varied texts are as language: words, frames, shared openings, n-grams, self-BLEU, patterns."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from aerialdojo_gen.annotations.language.sentences import LEVELS
from aerialdojo_gen.base.rng import generator, rank
from aerialdojo_gen.dataset.stats.comparison import Listing
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where, open_root

_TOKEN = re.compile(r"[a-zé]+(?:['’-][a-zé]+)*|\d+")
_OPENING, _LONGEST = 4, 4
PATTERNS = {
    "adjective before a collective": re.compile(
        r"\b(?:red|blue|green|grey|gray|white|black|brown|yellow|orange|pink|purple|beige|rusty|wooden|empty|brick|"
        r"concrete|steel|dark|light)\s+(?:row|pile|heap|stack|group|bundle|cluster|set|line|clump)s? of\b"
    ),
    "with a ... with a": re.compile(r"\bwith (?:an?|the) [^.,;:]*\bwith (?:an?|the)\b"),
    "It is also": re.compile(r"\bit is also\b"),
    "You will know it by, the one with": re.compile(r"\b(?:you will know it by|you can tell it by|the one with)\b"),
    "beside, next to": re.compile(r"\b(?:beside|next to)\b"),
}


def words_of(text: str) -> list[str]:
    """Split a text into its words, lower case."""
    return _TOKEN.findall(text.lower())


def measure(texts: Sequence[str], owners: Sequence[object], frames: Sequence[str]) -> dict[str, str]:
    """Measure texts; `owners` are the objects that they describe, `frames` the derivations that they were made by."""
    tokens = [words_of(text) for text in texts]
    counts, built = Counter(word for words in tokens for word in words), Counter(frames)
    covered, lengths = np.cumsum([n for _, n in built.most_common()]), sorted(map(len, tokens))
    patterns = {name: sum(bool(p.search(t.lower())) for t in texts) / len(texts) for name, p in PATTERNS.items()}
    return {
        "texts": f"{len(texts):,}",
        "words": f"{sum(lengths):,}",
        "fewest, median, most words": f"{lengths[0]}, {lengths[len(lengths) // 2]}, {lengths[-1]}",
        "vocabulary": f"{len(counts):,}",
        "words that occur once": f"{sum(n == 1 for n in counts.values()):,}",
        "frames": f"{len(built):,}",
        "frames that cover 99.9 %": f"{int(np.searchsorted(covered, 0.999 * len(texts)) + 1):,}",
        "most common frame": f"{max(built.values()) / len(texts):.2%}",
        "first four words shared": f"{_shared_openings(tokens, owners):.1%}",
        "distinct 1-, 2-, 3- and 4-grams": ", ".join(f"{_distinct(tokens, n):.3f}" for n in range(1, _LONGEST + 1)),
        "self-BLEU-4": f"{self_bleu(tokens, owners):.3f}",
        **{f"pattern: {name}": f"{share:.1%}" for name, share in patterns.items()},
    }


def _shared_openings(tokens: Sequence[Sequence[str]], owners: Sequence[object]) -> float:
    users: defaultdict[tuple[str, ...], set[object]] = defaultdict(set)
    for words, owner in zip(tokens, owners, strict=True):
        users[tuple(words[:_OPENING])].add(owner)
    return sum(len(users[tuple(words[:_OPENING])]) > 1 for words in tokens) / len(tokens)


def _grams(words: Sequence[str], n: int) -> Iterable[tuple[str, ...]]:
    return zip(*(words[k:] for k in range(n)), strict=False)


def _distinct(tokens: Sequence[Sequence[str]], n: int) -> float:
    counts = Counter(gram for words in tokens for gram in _grams(words, n))
    return len(counts) / max(counts.total(), 1)


def self_bleu(tokens: Sequence[Sequence[str]], owners: Sequence[object], sample: int = 500) -> float:
    """Mean BLEU-4 of texts of a sample against the sample's texts of other objects as references.

    The sample has at most one text an object, drawn with a fixed seed. Precisions of 1- to 4-grams count alike,
    clipped as in BLEU; one without a match counts as half a match. No penalty for length.
    """
    rng = generator(0, "self-bleu")
    order = [k for k in rng.permutation(len(tokens)).tolist() if len(tokens[k]) >= _LONGEST]
    by_owner = {owners[k]: k for k in reversed(order)}
    chosen = sorted(by_owner.values(), key=order.index)[:sample]
    logs = np.zeros(len(chosen))
    for n in range(1, _LONGEST + 1):
        own = [Counter(_grams(tokens[k], n)) for k in chosen]
        best: defaultdict[tuple[str, ...], list[int]] = defaultdict(lambda: [0, 0])
        for counter in own:
            for gram, count in counter.items():
                best[gram] = sorted([*best[gram], count])[1:]
        for k, counter in enumerate(own):
            # The most that another text has: the second most where the most is this one's own.
            matches = sum(min(c, best[g][1] if c < best[g][1] else best[g][0]) for g, c in counter.items())
            logs[k] += math.log(max(matches, 0.5) / counter.total()) / _LONGEST
    return float(np.exp(logs).mean()) if len(chosen) else 0.0


_DEFINITION = (
    "Frames: texts with slots for noun phrases, places, details. Openings: first four words that a text of another "
    "object has. Self-BLEU-4: mean over 500 texts of different objects, each against the others."
)


def variety_table(measured: Mapping[str, Mapping[str, str]]) -> Listing:
    """Set measures of several sets of texts side by side."""
    rows = tuple((name, *(of[name] for of in measured.values())) for name in next(iter(measured.values())))
    return Listing("Variety of the descriptions", ("measure", *measured), rows, (_DEFINITION,))


def read_variety(data: Where, scenes: Sequence[str]) -> dict[str, dict[str, str]]:
    """Measure a release's descriptions: all, one an object, and by level; empty for a release without paraphrases."""
    root = open_root(data)
    found: list[tuple[tuple[str, int], dict[str, Any]]] = []
    for scene in scenes:
        rows = store.read_stored(root, "release/objects", scene, ("object_id", "paraphrases"))
        if "paraphrases" in rows.column_names:
            found += [((scene, row["object_id"]), text) for row in rows.to_pylist() for text in row["paraphrases"]]
    # One an object: not the first of each, which are all of one level.
    one = dict(sorted(found, key=lambda item: rank(0, "variety", *item[0], item[1]["text"])))
    sets = {"all": found, "one an object": list(one.items())}
    sets |= {level: [item for item in found if item[1]["level"] == level] for level in LEVELS}
    return {
        name: measure([text["text"] for _, text in some], [owner for owner, _ in some], [t["frame"] for _, t in some])
        for name, some in sets.items()
        if some
    }
