"""The grammar of sentences: templates with alternatives, read from ``grammar.toml``."""

from __future__ import annotations

import hashlib
import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.safe_parse import read_toml

FOLDER = Path(__file__).parent
LEVELS = ("terse", "normal", "detailed", "vague")
SLOTS = frozenset({"a", "the", "np", "be", "ing", "stands", "at", "ref", "byit", "nearit", "w", "clause"})
# One in so many templates of first sentences of a kind is held out: those with the lowest hashes.
_HELD_OUT_OF = 3
_BY_OPENING = (0.9, 1.0, 0.22, 0.08, 0.04)  # by the words before the first slot
_BARE = 0.4
_SLOT = re.compile(r"\{(\w+)\}")


@dataclass(frozen=True)
class Frame:
    """A template with its alternatives chosen: a sentence with slots."""

    text: str
    template: str
    share: float  # Of the template's weight
    held_out: bool  # Whether training tasks have no text with its template

    @cached_property
    def slots(self) -> frozenset[str]:
        """Its slots."""
        return frozenset(_SLOT.findall(self.text))


@cache
def frames(section: str, kind: str) -> tuple[Frame, ...]:
    """List the frames of a section of the grammar (a level, or ``more``) and a kind (``at``, ``ref``, ...)."""
    path = FOLDER / "grammar.toml"
    templates = read_toml(path, AnnotationError)[section].get(kind, ())
    by_hash = sorted(templates, key=_digest) if section != "more" else []
    held = set(by_hash[: -(-len(by_hash) // _HELD_OUT_OF)])
    found: list[Frame] = []
    for template in templates:
        texts = list(dict.fromkeys(" ".join(text.split()) for text in expand(template)))
        unknown = {slot for text in texts for slot in _SLOT.findall(text)} - SLOTS
        if unknown:
            raise AnnotationError(f"{path}: {template!r}: no slot {{{sorted(unknown)[0]}}}")
        # A template with more wordings is used more often, each of them less.
        found += [Frame(text, template, _weight(text) * len(texts) ** -0.35, template in held) for text in texts]
    return tuple(found)


def _weight(text: str) -> float:
    """Weigh a sentence: what begins with many words of its own would make texts begin alike."""
    own = len(text.partition("{")[0].split())
    # A label without a word of its own fits everywhere, and would be the most common.
    bare = not _SLOT.sub("", text).strip(" ,:")
    return _BARE if bare else _BY_OPENING[min(own, len(_BY_OPENING) - 1)]


def expand(template: str) -> Iterator[str]:
    """Yield the texts of a template, one for every choice of its alternatives."""
    start = template.find("[")
    if start < 0:
        yield template
        return
    options, end = _options(template, start)
    for option, rest in itertools.product(options, expand(template[end:])):
        for inner in expand(option):
            yield template[:start] + inner + rest


def _options(template: str, start: int) -> tuple[list[str], int]:
    """Split the alternatives of the bracket that opens at `start`; returns them and where it has closed."""
    depth, options = 0, [""]
    for at in range(start, len(template)):
        sign = template[at]
        depth += (sign == "[") - (sign == "]")
        if depth == 0:
            return options, at + 1
        if depth == 1 and sign == "|":
            options.append("")
        elif at > start:
            options[-1] += sign
    raise AnnotationError(f"grammar: {template!r}: a bracket is not closed")


def _digest(text: str) -> bytes:
    return hashlib.blake2b(text.encode(), digest_size=8, person=b"held out").digest()
