"""What a text calls its object, held against what the mesh says that it is: the head of its first noun phrase.

`claims` reads values that stand before the object's own name; a "red sedan" that is a teal storefront names another
thing, and says nothing that it would read. Of words that it does not know this says nothing either.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from aerialdojo_gen.annotations.claims import plural, spoken
from aerialdojo_gen.scenes.model import Instance

_TOKEN = re.compile(r"[a-z0-9']+|[,.;:!?()]")
# What ends the noun phrase that a text begins with; "-ing" does unless the catalogue has it, like a building.
_END = re.compile(
    r"[,.;:!?()]|with|of|in|on|at|by|near|next|beside|behind|under|above|over|from|to|and|or|for|between|without|along|"
    r"against|is|are|stands|lies|sits|has|have|that|which|who|where|.*ing"
)
_COLOUR = re.compile(
    r"white|black|grey|red|orange|yellow|green|turquoise|blue|purple|pink|brown|beige|teal|cream|silver|gold"
)
# Colours that one person calls this and another one that.
_NEAR = {
    "teal": {"turquoise", "green", "blue"},
    "turquoise": {"teal", "green", "blue"},
    "cream": {"beige", "white", "yellow"},
    "beige": {"cream", "brown", "yellow", "white"},
    "silver": {"grey", "white"},
    "grey": {"silver", "black", "white"},
    "gold": {"yellow", "orange", "brown"},
    "brown": {"beige", "red", "orange"},
    "orange": {"red", "yellow", "brown"},
    "pink": {"red", "purple"},
    "purple": {"pink", "blue"},
}
_SPELT = {"gray": "grey", "golden": "gold", "silvery": "silver", "aqua": "turquoise"}


class NounChecker:
    """The things and colours that a name can speak of."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self._categories: dict[tuple[str, ...], set[str]] = {}
        for category, name in names.items():
            for form in {name, spoken(category)}:
                for phrase in (form, plural(form)):
                    self._categories.setdefault(_words(phrase), set()).add(category)
        self._own = {category: {*_words(name), *_words(spoken(category))} for category, name in names.items()}
        self._longest = max(map(len, self._categories), default=0)

    def contradictions(self, text: str, instance: Instance) -> Iterator[str]:
        """Say what a name or a description calls an instance that the mesh says it is not."""
        thing, colours = self._head(text)
        if thing and instance.category not in self._categories[thing]:
            # A stone wall may be the catalogue's garden wall: words in common are no contradiction.
            own = self._own.get(instance.category, set(_words(spoken(instance.category))))
            if not own & set(thing):
                called = " ".join(thing)
                yield f"it is called {called!r}, and the mesh says {spoken(instance.category)!r}"
        values = [value for key, value in instance.attributes.items() if key.endswith("colour")]
        mesh = set(_colours(word for value in values for word in _words(value)))
        for colour in colours:
            near = {colour, *_NEAR.get(colour, ()), *(one for one in mesh if colour in _NEAR.get(one, ()))}
            if mesh and not near & mesh:
                yield f"it is called {colour!r}, and the mesh is not"

    def _head(self, text: str) -> tuple[tuple[str, ...], list[str]]:
        """The last thing that the first noun phrase names, and the colours before it."""
        tokens, at = _words(text), 0
        thing: tuple[str, ...] = ()
        colours: list[str] = []
        pending: list[str] = []
        while at < len(tokens):
            longest = min(self._longest, len(tokens) - at)
            lengths = (n for n in range(longest, 0, -1) if tokens[at : at + n] in self._categories)
            length = next(lengths, 0)
            if length:
                thing, colours, pending = tokens[at : at + length], colours + pending, []
            elif _END.fullmatch(tokens[at]):
                break
            else:
                pending += _colours([tokens[at]])
            at += length or 1
        return thing, colours


def _words(text: str) -> tuple[str, ...]:
    return tuple(_TOKEN.findall(text.lower()))


def _colours(words: Iterable[str]) -> list[str]:
    spelt = (_SPELT.get(word, word) for word in words)
    return [word for word in spelt if _COLOUR.fullmatch(word)]
