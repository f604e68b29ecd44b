"""Check the head of a text's first noun phrase against the category and colours of its mesh.

`claims` reads only values before the object's own name: it finds nothing wrong with "a red sedan" for a teal
storefront. Unknown words are ignored.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from aerialdojo_gen.annotations.phrases import plural, spoken
from aerialdojo_gen.scenes.model import Instance

_TOKEN = re.compile(r"[a-z0-9']+|[,.;:!?()]")
# Tokens that end the first noun phrase; words in "-ing" too, unless the catalogue has them, like a building.
_END = re.compile(
    r"[,.;:!?()]|with|of|in|on|at|by|near|next|beside|behind|under|above|over|from|to|and|or|for|between|without|along|"
    r"against|is|are|stands|lies|sits|has|have|that|which|who|where|.*ing"
)
_COLOUR = re.compile(
    r"white|black|grey|red|orange|yellow|green|turquoise|blue|purple|pink|brown|beige|teal|cream|silver|gold"
)
# Colours that people confuse.
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
    """Checks the head noun and colours of a text against the mesh."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self._categories: dict[tuple[str, ...], set[str]] = {}
        for category, name in names.items():
            for form in {name, spoken(category)}:
                for phrase in (form, plural(form)):
                    self._categories.setdefault(_words(phrase), set()).add(category)
        self._own = {category: {*_words(name), *_words(spoken(category))} for category, name in names.items()}
        self._longest = max(map(len, self._categories), default=0)

    def contradictions(self, text: str, instance: Instance) -> Iterator[str]:
        """Yield where a name or description contradicts the mesh."""
        thing, colours = self._head(text)
        if thing and instance.category not in self._categories[thing]:
            # Words in common with the own category ("stone wall", "garden wall") are no contradiction.
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
        """Return the last known thing of the first noun phrase, and the colours before it."""
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
