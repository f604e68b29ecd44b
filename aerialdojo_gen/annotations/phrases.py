"""Noun phrases of instances: words of English and by category (`*.toml`), adjectives, grammatical number."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import AnnotationError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.scenes.model import Instance

TABLES = read_toml(Path(__file__).with_name("words.toml"), AnnotationError)
LISTS = {name: frozenset(words.split()) for name, words in TABLES["lists"].items()}

_SINGULAR_ENDS = ("ss", "us", "is", "as")
_GROUPS = {word: group for group, words in TABLES["groups"].items() for word in words.split()}


def group_of(name: str) -> str:
    """Return the determiner for a plural or mass noun ("a group of"); empty for a singular."""
    word = name.lower().split()[-1] if name.split() else ""
    if word in _GROUPS:
        return _GROUPS[word]
    many = (
        word.endswith("s") and len(word) > 3 and not word.endswith(_SINGULAR_ENDS) and word not in LISTS["singular"]
    )
    return "a group of" if many or word in LISTS["plural"] else ""


# Attributes before the noun, in English order: a small rotten brown wooden bench.
_ADJECTIVES = ("size", "state", "pattern", "shape", "colour", "material")
# Phrases of place, and naming attributes of imported nodes (see `aerialdojo_gen.imports.naming`).
_UNSAID = frozenset({"place", "called", "group"})
_VERBS = {"vehicle": ("is parked", "parked"), "vegetation": ("grows", "growing")}


def spoken(category: str) -> str:
    """Return a category as words: ``delivery_van`` is a delivery van."""
    return category.replace("_", " ")


def plural(name: str) -> str:
    """Return the regular plural of a name."""
    if name.endswith(("s", "x", "ch", "sh")):
        return name + "es"
    if name.endswith("y") and name[-2:-1] not in "aeiou":
        return name[:-1] + "ies"
    return name + "s"


@dataclass(frozen=True)
class CategoryWords:
    """Words that drafts use for a category."""

    name: str  # Common name
    nouns: tuple[str, ...] = ()  # Synonyms, true of every instance; of a collective whole: ``"line of wheelie bins"``
    # A collective's words: ``"wheelie bins"``, which adjectives precede, and ``"row"``; empty for all else.
    plural_heads: tuple[str, ...] = ()
    collectives: tuple[str, ...] = ()
    verbs: tuple[tuple[str, str], ...] = (("stands", "standing"),)  # Verbs and their participles, the usual one first
    group: str = ""  # Determiner of plural names: ``"a patch of"``; else empty
    reference: bool = True  # Whether descriptions of other objects may refer to it
    target: bool = True  # Whether it may become an object


_KEYS = ("nouns", "plural_head", "collective", "verbs", "group", "reference", "target")


@cache
def _tables() -> tuple[dict[str, dict[str, Any]], dict[str, Any], frozenset[str]]:
    """Read the entries by category, the phrases of values (those of one category in a table), and the colours."""
    tables: dict[str, Any] = {}
    for path in sorted((Path(__file__).parent / "phrases").glob("*.toml")):
        for name, entry in read_toml(path, AnnotationError).items():
            if name in tables:
                raise AnnotationError(f"{path}: [{name}] stands in another file of its folder already")
            for key in entry if name not in ("values", "colours") else ():
                if key not in _KEYS:
                    raise AnnotationError(f"{path}: [{name}]: unknown key {key!r}{nearest(key, _KEYS)}")
            tables[name] = entry
    colours, values = frozenset(tables.pop("colours")), tables.pop("values")
    return tables, values, colours


def words_of(category: str, name: str | None, kind: str, target: bool = True) -> CategoryWords:
    """Look up the words for a category."""
    entry = _tables()[0].get(category, {})
    verbs = entry.get("verbs", [_VERBS.get(kind, ("stands", "standing"))])
    in_catalogue = name is not None
    return CategoryWords(
        name=name or spoken(category),
        nouns=tuple(entry.get("nouns", ())),
        plural_heads=tuple(entry.get("plural_head", ())),
        collectives=tuple(entry.get("collective", ())),
        verbs=tuple((verb, participle) for verb, participle in verbs),
        group=str(entry.get("group", "")),
        # People and animals move: what stands beside them is not described by them.
        reference=bool(entry.get("reference", in_catalogue and kind != "life")),
        target=bool(in_catalogue and target and entry.get("target", True)),
    )


@dataclass(frozen=True)
class Noun:
    """A noun phrase in parts."""

    adjectives: tuple[str, ...]  # Before the name
    name: str  # The category's
    after: str  # After it: ``"with a black roof"``; may be empty

    @property
    def bare(self) -> str:
        """Without article: ``"orange hatchback with a black roof"``."""
        return " ".join(filter(None, (*self.adjectives, self.name, self.after)))

    @property
    def short(self) -> str:
        """Without article and without the tail, unless only the name would remain."""
        return " ".join([*self.adjectives, self.name]) if self.adjectives or not self.after else self.bare


def noun_of(instance: Instance, words: CategoryWords) -> Noun:
    """Make the noun phrase from an instance's attributes."""
    name = instance.attributes.get("called") or words.name
    said = {k: v for k, v in instance.attributes.items() if k not in _UNSAID}
    before: list[str] = []
    tail = ""
    for key in dict.fromkeys((*_ADJECTIVES, *said)):
        value = said.get(key)
        if not value or value in name.split() or any(value in v.split() for k, v in said.items() if k != key):
            continue
        phrase = phrases_of_value(key, value, instance.category)[0]
        if phrase.startswith("+"):
            before.append(phrase[1:])
        elif phrase.startswith("with ") and "with " in tail:
            tail += " and " + phrase.removeprefix("with ")
        else:
            tail += (" " if tail else "") + phrase
    if " with " in name and tail.startswith("with "):
        tail = "and" + tail.removeprefix("with")
    return Noun(tuple(before), name, tail)


def phrases_of_value(key: str, value: str, category: str) -> tuple[str, ...]:
    """Phrase one value of a category, the usual way first: with the prefix ``+`` if it goes before the noun."""
    _, table, _ = _tables()
    for patterns in (table.get(category, {}), table):
        found = patterns.get(f"{key}={value}") or patterns.get(f"{key}=*")
        if found:
            patterns = [found] if isinstance(found, str) else found
            filled = (one.replace("{a}", with_article(value)).replace("{up}", value.upper()) for one in patterns)
            return tuple(one.replace("{}", value) for one in filled)
    return (_phrase_by_rule(key, value),)


def _phrase_by_rule(key: str, value: str) -> str:
    colours = _tables()[2]
    words = value.split()
    if key in ("size", "material", "shape") or (key == "colour" and words[-1] in colours):
        return "+" + value
    if words[0] in LISTS["openers"] or words[0] in ("in", "on", "under", "without", "with", "of", "full"):
        return value
    if key == "state" and len(words) > 1 and words[-1] in LISTS["after_noun"]:
        return f"with its {value}"
    if key in ("state", "pattern") and (len(words) == 1 or words[0].endswith("ly")) and not _noun(words[-1]):
        return "+" + value
    return f"with {value if _plural(words) else with_article(value)}"


def _noun(word: str) -> bool:
    return (word.endswith("s") and not word.endswith("ss")) or word in LISTS["mass"]


def _plural(words: list[str]) -> bool:
    head = next((before for before, word in pairwise(words) if word in LISTS["prepositions"]), words[-1])
    return _noun(head) or words[0] in ("a", "an", "the", "its", "one", "two", "three", "four")


def with_article(text: str) -> str:
    """Put a or an before a text."""
    return f"{article(text)} {text}"


def article(text: str) -> str:
    """Choose between a and an by the initial sound."""
    first = text.split()[0].lower() if text else ""
    if first in ("suv", "sos", "atm", "led", "hour", "mp3", "x-shaped"):
        return "an"
    if first.startswith(("uni", "use", "one", "eu")) and first != "uninviting":
        return "a"
    return "an" if first[:1] in tuple("aeiou") else "a"
