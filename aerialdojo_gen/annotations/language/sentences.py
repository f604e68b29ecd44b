"""Sentences: templates with alternatives, read from ``grammar.toml``, chosen for what a text says and filled in."""

from __future__ import annotations

import hashlib
import itertools
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np

from aerialdojo_gen.annotations.language.locations import Location
from aerialdojo_gen.annotations.language.nouns import NounPhrase, Wording
from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.rng import pick
from aerialdojo_gen.base.safe_parse import read_toml

_T = TypeVar("_T")
LEVELS = ("terse", "normal", "detailed", "vague")
SLOTS = frozenset({"a", "the", "np", "be", "ing", "stands", "at", "ref", "byit", "nearit", "w", "clause"})
# One in so many templates of first sentences of a kind is held out: those with the lowest hashes.
_HELD_OUT_OF = 3
_BY_OPENING = (0.9, 1.0, 0.22, 0.08, 0.04)  # by the words before the first slot
_BARE = 0.4
_SLOT = re.compile(r"\{(\w+)\}")

_STARTS = re.compile(r"(^|[.?!] +)([a-zé])")
_GOES_ON = re.compile(r"\{(?:a|the|np)\} (?:[a-z]|\{ing\})")
_WITH = re.compile(r"\bwith \{w\}")
# "Put up up on the hill", "with a sign with a P".
_AWKWARD = re.compile(r"\b(\w+) \1\b|\bwith (?:an?|the) [^.,;:?]*\bwith (?:an?|the)\b", re.IGNORECASE)
_LOOKING = re.compile(r"\b(?:note|notice|see|look|find|spot|make|watch)\b")
_OPENING = 2  # words that no other text of the object begins with
# How often a kind of first sentence is used where there is something to say with it.
_KINDS = {"at": 1.0, "ref": 0.5, "at_with": 1.0, "at_telling": 1.5}
# "In front of the ..." begins a text more rarely than "by the ...": many would begin alike.
_SHORT_LEAD, _RARELY = 2, 0.8
_SHORT, _LONG = 5, 8  # words of a place: what is short needs no comma, what is longer ends its clause
_VERBS = frozenset({"be", "ing", "stands"})  # slots of a verb, which is not said twice
_TURNED = 0.6  # how often a further place is said of the thing that it names
_CLAUSE, _UNIQUE = 0.5, 0.6
_SECOND_IN_FIRST = 0.6  # how often the first sentence says two places


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
    path = Path(__file__).with_name("grammar.toml")
    templates = read_toml(path, AnnotationError)[section].get(kind, ())
    by_hash = sorted(templates, key=_hash) if section != "more" else []
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


def _hash(text: str) -> bytes:
    return hashlib.blake2b(text.encode(), digest_size=8, person=b"held out").digest()


@dataclass(frozen=True)
class Content:
    """What a text says, in words."""

    level: str
    phrase: NounPhrase
    verb: tuple[str, str]  # "is parked", "parked"
    places: Sequence[Location]
    details: Sequence[tuple[Wording, bool]]  # With whether it is true of no other of the category


def compose(
    content: Content, held_out: bool, used: Collection[str], rng: np.random.Generator
) -> tuple[str, str, bool] | None:
    """Write a text: it, its frame, and whether that is held out; None if no sentence is left.

    `used` are first words that it must not begin with.
    """
    if content.level in ("terse", "vague") and content.details:
        # The detail is said right after the noun.
        if content.phrase.tail or " with " in content.phrase.bare or len(content.details) > 1:
            return None
        tail = f"with {pick(content.details[0][0].details, rng)}"
        content = replace(content, phrase=replace(content.phrase, tail=tail), details=())
    places, details = list(content.places), list(content.details)
    section = "normal" if content.level == "detailed" else content.level
    kinds = {"at": _KINDS["at"]}
    if places[0].thing and places[0].unique and (len(places) == 1 or content.level == "detailed"):
        kinds["ref"] = _KINDS["ref"]
    if details and section == "normal":
        kinds |= {kind: _KINDS[kind] for kind in ("at_telling" if details[0][1] else "at_with",)}
    kind = _drawn(list(kinds), list(kinds.values()), rng)
    # Nothing is "with ..." twice, and no tail stands: "a planter with flowers standing by ...".
    tailed = bool(content.phrase.tail) or " with " in content.phrase.bare
    pool = _fitting(section, kind, held_out, bool(content.verb[1]), tailed)
    if not pool:
        return None
    first = _drawn(pool, [frame.share for frame in pool], rng)
    verb, participle = content.verb
    slots = {
        "a": content.phrase.a, "the": content.phrase.the, "np": content.phrase.bare,
        "be": verb, "ing": participle, "stands": "is" if " " in verb else verb,
    }  # fmt: skip
    own = places[:1]
    if kind == "ref":
        slots |= {"ref": own[0].thing, "byit": own[0].pronoun}
    else:
        if len(places) > 1 and (content.level != "detailed" or rng.random() < _SECOND_IN_FIRST):
            own = places[:2]
        slots["at"] = _joined(own, first.text, rng)
        if len(slots["at"].split()) > _LONG and "{at} " in first.text:
            return None
        if first.text.startswith("{at}") and own[0].lead > _SHORT_LEAD and rng.random() < _RARELY:
            return None
    if "w" in first.slots:
        slots["w"] = pick(details.pop(0)[0].details, rng)
    said = [(first, slots)]
    for wording, unique in details:
        said.append(_detail(wording, unique, said, rng))
    for place in places[len(own) :]:
        said.append(_place(place, "" if first.slots & _VERBS else verb, said, rng))
    sentences = [frame.text.format(**slots) for frame, slots in said]
    text = " ".join(one if one[-1] in ".?!" else f"{one}." for one in sentences)
    text = _STARTS.sub(lambda m: m[1] + m[2].upper(), " ".join(text.split()))
    text = text.removesuffix(".") if content.level == "terse" else text
    if " ".join(text.split()[:_OPENING]) in used or _AWKWARD.search(text):
        return None
    return text, " | ".join(frame.text for frame, _ in said), first.held_out


@cache
def _fitting(section: str, kind: str, held_out: bool, participle: bool, tailed: bool) -> tuple[Frame, ...]:
    """Frames of first sentences that go with a verb and a noun phrase: with a participle or a tail, or without."""
    return tuple(
        f for f in frames(section, kind)
        if f.held_out == held_out
        if participle or "ing" not in f.slots
        if not tailed or not (_WITH.search(f.text) or _GOES_ON.search(f.text))
    )  # fmt: skip


def _drawn(options: Sequence[_T], weights: Sequence[float], rng: np.random.Generator) -> _T:
    shares = np.array(weights)
    return options[int(rng.choice(len(options), p=shares / shares.sum()))]


def _joined(places: Sequence[Location], template: str, rng: np.random.Generator) -> str:
    if len(places) == 1:
        return places[0].text
    first, second = sorted(places, key=lambda place: (place.kind != "place", place.key == "between"))
    after = template.partition("{at}")[2]
    # No comma before words that go on, and none after a short phrase.
    if first.kind == "place":
        short = len(first.text.split()) <= _SHORT
        comma = "" if after[:1] == " " or (short and rng.random() < 0.6) else ","
        return f"{first.text}{comma} {second.text}"
    # "By the kiosk and the fountain" rather than "by the kiosk and next to the fountain".
    return f"{first.text} and {second.thing if first.key == second.key != 'between' else second.text}"


def _detail(
    wording: Wording, unique: bool, said: Sequence[tuple[Frame, object]], rng: np.random.Generator
) -> tuple[Frame, dict[str, str]]:
    if wording.clauses and rng.random() < _CLAUSE:
        return _frame("clause", said, rng), {"clause": pick(wording.clauses, rng)}
    kind = "telling" if unique and rng.random() < _UNIQUE else "with"
    return _frame(kind, said, rng), {"w": pick(wording.details, rng)}


def _place(
    place: Location, verb: str, said: Sequence[tuple[Frame, object]], rng: np.random.Generator
) -> tuple[Frame, dict[str, str]]:
    if place.turned and rng.random() < _TURNED:
        return _frame("near", said, rng), {"ref": place.thing, "nearit": place.turned}
    return _frame("at", said, rng, bool(verb)), {"at": place.text, "be": verb}


def _frame(
    kind: str, said: Sequence[tuple[Frame, object]], rng: np.random.Generator, with_verb: bool = True
) -> Frame:
    pool = [frame for frame in frames("more", kind) if with_verb or "be" not in frame.slots]
    heard = {word for frame, _ in said for word in _LOOKING.findall(frame.text)}
    # "You'll see a keypad. You'll see it by the gate."
    pool = [frame for frame in pool if not heard & set(_LOOKING.findall(frame.text))] or pool
    return _drawn(pool, [frame.share for frame in pool], rng)
