"""Parse the claims of an English description by a small grammar.

It knows three kinds of phrase: *things* (names of the scene's categories and landmarks), *values* (of the instances'
attributes: red, open, in the car park) and *relations* (beside, under, north of, between ... and). Values before a
thing, or with no thing after them in the clause, belong to it or to the subject; a relation and the things after it
make a claim. Unknown words are skipped: a missed claim makes the ambiguity check stricter, never laxer.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from aerialdojo_gen.annotations.phrases import plural, spoken
from aerialdojo_gen.annotations.places import Places
from aerialdojo_gen.annotations.relations import SceneGeometry
from aerialdojo_gen.store.schemas import DIRECTIONS

GROUP = "group"  # the determiner of a plural name ("a row of"): not a value
PLACE = "place"  # the attribute with the phrase of place from the layout

_TOKEN = re.compile(r"[a-z0-9']+|[,.;:!?()]")
# Compass corners are one word in the tables; people write two.
_CORNER = re.compile(r"\b(north|south)[- ](east|west)")
_STOPS = frozenset(".;:!?")
_VERBS = frozenset(
    [
        "is",
        "are",
        "stands",
        "grows",
        "lies",
        "sits",
        "hangs",
        "rises",
        "leans",
        "floats",
        "flies",
        "waits",
        "has",
        "have",
        "which",
        "that",
        "it",
        "its",
        "you",
    ]
)


def _relations() -> dict[str, str]:
    phrases = {
        "beside": "beside, right beside, next to, right next to, alongside, by, adjacent to, flanked by, "
        "close beside, at the foot of",
        "against": "leaning against, right against",
        "near": "near, nearby, close to, not far from, a few steps from, a short way from, a short walk from, "
        "surrounded by, facing, around",
        "at": "at",
        "front": "in front of, before",
        "behind": "behind, at the back of",
        "on": "on, on top of, atop, upon, on the top of",
        "under": "under, beneath, underneath, below, sheltered by, in the shade of, under the cover of",
        "above": "above, over, high above",
        "between": "between, in between",
    }
    table = {phrase.strip(): relation for relation, many in phrases.items() for phrase in many.split(",")}
    for direction in DIRECTIONS:
        for form in ("{} of", "to the {} of", "just {} of", "on the {} side of", "at the {} side of"):
            table[form.format(direction)] = f"side:{direction}"
    return table


RELATIONS: Mapping[str, str] = _relations()


def _tokens(text: str) -> list[str]:
    return _TOKEN.findall(_CORNER.sub(r"\1\2", text.lower()))


@dataclass(frozen=True)
class Claim:
    """A relation that a description asserts of its object."""

    relation: str
    things: tuple[frozenset[int], ...]
    text: str  # The matched words, for messages

    def holds(self, geometry: SceneGeometry, i: int, slack: float = 1.0) -> bool:
        """Whether the claim is true of instance `i`; see `relations` for `slack`."""
        reach = 15.0 * slack
        close = set(geometry.neighbours(i, reach))
        sets = [sorted((things & close) - {i}) for things in self.things]
        if self.relation == "between":
            return len(sets) == 2 and any(geometry.between(i, j, k, slack) for j in sets[0] for k in sets[1])
        if self.relation.startswith("side:"):
            direction = self.relation.removeprefix("side:")
            return any(geometry.side(i, j, direction, slack) for j in sets[0])
        test = _TESTS[self.relation]
        return any(test(geometry, i, j, slack) for j in sets[0])


_TESTS: Mapping[str, Callable[[SceneGeometry, int, int, float], bool]] = {
    "beside": SceneGeometry.beside, "against": SceneGeometry.against, "at": SceneGeometry.at,
    "near": SceneGeometry.near, "front": SceneGeometry.front, "behind": SceneGeometry.behind, "on": SceneGeometry.on,
    "under": SceneGeometry.under, "above": SceneGeometry.above,
}  # fmt: skip


@dataclass
class Reading:
    """The result of parsing a text."""

    values: list[str] = field(default_factory=list)  # Attribute values asserted of the subject, anywhere
    named: list[str] = field(default_factory=list)  # Those directly before the subject's own name
    claims: list[Claim] = field(default_factory=list)  # Relations asserted of the subject
    # Names of things outside any relation: what the text calls the subject.
    subjects: list[str] = field(default_factory=list)
    places: list[str] = field(default_factory=list)  # Phrases of place, lower case, bound to conditions or not


@dataclass
class _State(Reading):
    """A reading under way."""

    relation: str = ""
    words: list[str] = field(default_factory=list)
    pending: list[str] = field(default_factory=list)
    first: frozenset[int] | None = None
    adjacent: bool = False

    def end_clause(self) -> None:
        # After "beside a bench with ..." the values belong to the bench, not to the subject.
        self.values += [] if self.relation else self.pending
        self.pending, self.relation, self.words, self.first = [], "", [], None


class Lexicon:
    """The phrases that descriptions of a scene are parsed with."""

    def __init__(
        self,
        geometry: SceneGeometry,
        names: Mapping[str, str],
        landmarks: Mapping[str, int],
        places: Places | None = None,
    ) -> None:
        self.places = places
        instances = geometry.scene.instances
        self._attributes = [i.attributes for i in instances]
        self._categories = [i.category for i in instances]
        self._keys_of: dict[str, set[str]] = {}
        self._phrases: dict[tuple[str, ...], tuple[str, str]] = {}
        self._things: dict[str, frozenset[int]] = {}
        by_name: dict[str, set[int]] = {}
        for i, instance in enumerate(instances):
            by_name.setdefault(names.get(instance.category, spoken(instance.category)).lower(), set()).add(i)
        things = {name: frozenset(members) for name, members in by_name.items()}
        things |= {name.lower(): frozenset([i]) for name, i in landmarks.items()}
        given = [item for attributes in self._attributes for item in attributes.items()]
        where = {value.lower() for key, value in given if key == PLACE and places is not None}
        values = {value for key, value in given if (places is None or key != PLACE) and key != GROUP}
        for key, value in given:
            if value in values:
                self._keys_of.setdefault(value.lower(), set()).add(key)
        for phrase, relation in RELATIONS.items():
            self._add(phrase, "relation", relation)
        for value in sorted(values):
            self._add(value, "value", value.lower())
        for phrase in sorted(where | set(places.phrases() if places else ())):
            self._add(phrase, "place", phrase)
        for name in sorted(things):
            self._things[name] = things[name]
            for form in (plural(name), name):
                self._add(form, "thing", name)
        self._longest = max(map(len, self._phrases), default=0)
        self._general: frozenset[str] = frozenset()

    def add_values(self, key: str, words: Iterable[str]) -> None:
        """Add words as values of an attribute; they match any word of a value ("green" in "dark green")."""
        new = {word for word in words if (word,) not in self._phrases}
        for word in new:
            self._add(word, "value", word)
            self._keys_of.setdefault(word, set()).add(key)
        self._general |= new
        self._longest = max(self._longest, 1)

    def members(self, name: str) -> frozenset[int]:
        """Return the instances with a name."""
        return self._things.get(name, frozenset())

    def _add(self, phrase: str, kind: str, meaning: str) -> None:
        tokens = tuple(_tokens(phrase))
        if tokens:
            self._phrases[tokens] = (kind, meaning)

    def read(self, text: str, subject: int) -> Reading:
        """Parse a description or a name."""
        tokens = _tokens(text)
        state, at = _State(), 0
        while at < len(tokens):
            if tokens[at] in _STOPS or (tokens[at] in ",()" and state.first is None):
                state.end_clause()
            length, kind, meaning = self._match(tokens, at)
            words = tokens[at : at + length]
            if not kind and tokens[at] in _VERBS:
                state.end_clause()
            if kind == "relation":
                state.end_clause()
                state.relation, state.words = meaning, list(words)
            elif kind == "place":
                state.end_clause()
                state.places.append(meaning)
            elif kind == "value":
                state.pending.append(meaning)
                state.words += words
            elif kind == "thing":
                self._thing(state, meaning, words, subject)
            elif state.relation:
                state.words += words
            state.adjacent = kind == "value" or (state.adjacent and tokens[at] == "and")
            at += length
        state.end_clause()
        return state

    def _match(self, tokens: list[str], at: int) -> tuple[int, str, str]:
        for length in range(min(self._longest, len(tokens) - at), 0, -1):
            found = self._phrases.get(tuple(tokens[at : at + length]))
            if found:
                return length, *found
        return 1, "", ""

    def _thing(self, state: _State, name: str, words: list[str], subject: int) -> None:
        members = self._things[name]
        if state.relation:
            chosen = frozenset(i for i in members if self.fits(i, state.pending))
            text = " ".join([*state.words, *words])
            if state.relation != "between":
                state.claims.append(Claim(state.relation, (chosen,), text))
            elif state.first is None:
                state.first = chosen
            else:
                state.claims.append(Claim("between", (state.first, chosen), text))
                state.first = None
            state.words = [*state.words, *words]
        else:
            state.subjects.append(name)
        if not state.relation and subject in members:
            state.values += state.pending
            state.named += state.pending if state.adjacent else []
        state.pending = []

    def fits(self, i: int, values: Iterable[str]) -> bool:
        """Whether an instance can have these values; values of attributes that it lacks are ignored."""
        return not any(self.denied(i, value) for value in values)

    def denied(self, i: int, value: str) -> bool:
        """Whether an instance has attributes of this value's kind, but not this value."""
        attributes = self._attributes[i]
        own = [attributes[key].lower() for key in self._keys_of.get(value, ()) if key in attributes]
        if value in self._general:
            own = [word for words in own for word in _TOKEN.findall(words)]
        return bool(own) and value not in own

    def has(self, i: int, value: str) -> bool:
        """Whether an instance has that value."""
        return value in {v.lower() for v in self._attributes[i].values()}
