"""Puts a description together from a template and its pieces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerialdojo_gen.annotations.phrases import Noun, Words
from aerialdojo_gen.annotations.templates import FULL, MORE, PLAIN

_LONG_PLACE = 5


def compose(
    words: Words,
    noun: Noun,
    place: str,
    needed: list[str],
    extra: list[str],
    rng: np.random.Generator,
    used: dict[str, int],
) -> tuple[str, str]:
    """Compose a description of one to three sentences; returns it and the template that it was made from."""
    if place and needed and place.split()[0] == needed[0].split()[0] == "beside":
        needed = [needed[0].replace("beside", "next to", 1), *needed[1:]]
    look = _least_used(words.looks, rng, used) if words.looks else ""
    comma = "," if place and needed and (len(place.split()) > _LONG_PLACE or len(needed) > 1) else ""
    template = _template(noun, look, bool(comma), bool(extra), rng, used)
    rel = " ".join([*([place + comma] if place else []), *([_listed(needed)] if needed else [])])
    fields = {
        "a": noun.a(),
        "bare": noun.bare,
        "the": noun.the(),
        "look": look,
        "verb": words.verb,
        "stands": "stands" if words.verb.startswith("is ") else words.verb,
        "ing": words.participle,
        "rel": rel,
    }
    text = template.format(**fields, A=_upper(fields["a"]), Rel=_upper(rel))
    if extra:
        more = MORE[int(rng.integers(len(MORE)))]
        text += " " + more.format(verb=words.verb, rel=_listed(extra))
    return text, template


def _listed(texts: list[str]) -> str:
    return " and ".join([*([", ".join(texts[:-1])] if texts[1:] else []), texts[-1]])


def _template(noun: Noun, look: str, parted: bool, more: bool, rng: np.random.Generator, used: dict[str, int]) -> str:
    pool = [
        template
        for template in (FULL if look else PLAIN)
        if not ("with {look}" in template and noun.after)
        and not ("{bare}" in template and noun.group)
        and not (parted and "{rel} and " in template)
        and not (more and template.count(".") > 2)
    ]
    return _least_used(pool, rng, used)


def _least_used(pool: Sequence[str], rng: np.random.Generator, used: dict[str, int]) -> str:
    least = min(used.get(text, 0) for text in pool)
    fresh = [text for text in pool if used.get(text, 0) <= least]
    return fresh[int(rng.integers(len(fresh)))]


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]
