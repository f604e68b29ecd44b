"""The twin of ``annotate-draft --rewrite``: let a language model write descriptions, and keep what can be verified.

A model gets the facts of an object, numbered, and writes a text. A second request reads the text back to the numbers
of the facts that it says, and to whatever it says besides. What says more than the facts, contradicts the mesh or
fits another object is dropped: the object keeps the text that the program makes.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.annotations.check import description_faults
from aerialdojo_gen.annotations.claims import Claim, SceneClaims
from aerialdojo_gen.annotations.format import Object, write_annotations
from aerialdojo_gen.annotations.matching import Matcher
from aerialdojo_gen.annotations.phrases import LISTS
from aerialdojo_gen.annotations.vocabulary import SHADES, Vocabulary
from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.base.errors import AgentUnavailable, AnnotationError, UsageError
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.benchmark.agents.base import InvalidAnswer
from aerialdojo_gen.benchmark.agents.load import load_agent, read_options
from aerialdojo_gen.benchmark.evaluation import Limits
from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent, Reply
from aerialdojo_gen.benchmark.llm.answer import read_as
from aerialdojo_gen.benchmark.worker import Finished
from aerialdojo_gen.pipeline.stage import ProjectPaths
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.studio.annotate.storage import parse_whole

_WRITE, _READ = read_toml(Path(__file__).with_name("rewrite.toml"), AnnotationError).values()
_MAX_RELATIONS, _MAX_PARTS = 4, 2
_MAX_FAILURES = 3
_PER_LETTER = 0.25  # Tokens
_ANSWER_TOKENS = 60
_RELATIONS = {"front": "in front of", "against": "right against"}
# Words that must be the facts' own, letter by letter.
_EXACT = frozenset({*SHADES, *DIRECTIONS, "no", "not", "without", "never", "left", "right-hand"})
_STEM = 4


class _Written(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    text: str


class _Read(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    said: list[int]
    besides: list[str]


@dataclass
class Rewriting:
    """What a rewriting has done."""

    kept: int = 0  # Texts of the model that are verified
    dropped: Counter[str] = field(default_factory=Counter)  # Texts that are not, by the reason
    left: int = 0  # Objects that nobody was asked about, for a limit or a service that failed
    requests: int = 0
    tokens: list[int] = field(default_factory=lambda: [0, 0])  # Of requests and answers, as the service counts them

    def lines(self) -> Iterator[str]:
        """What was done, for the terminal."""
        dropped = "; ".join(f"{n:,} {why}" for why, n in self.dropped.most_common())
        usage = f", {self.tokens[0]:,} tokens in, {self.tokens[1]:,} out" if any(self.tokens) else ""
        lost = self.dropped.total()
        yield f"rewritten: {self.kept:,} texts kept, {lost:,} dropped ({self.requests:,} requests{usage})"
        if dropped:
            yield f"dropped, the program's text stays: {dropped}"
        if self.left:
            yield f"not asked about: {self.left:,} objects"


class Rewriter:
    """Rewrites the descriptions of one scene's objects."""

    def __init__(self, agent: LanguageModelAgent, claims: SceneClaims) -> None:
        self._agent, self._claims, self._matcher = agent, claims, Matcher(claims)
        self._index = claims.geometry.index
        looks = (look for i in claims.scene.instances for look in claims.vocabulary.appearances_of(i))
        self._adjectives = {adjective for look in looks for adjective in look.adjectives}

    def estimate(self, objects: Sequence[Object]) -> str:
        """Say about what rewriting costs, before anything is sent."""
        same = len(_WRITE["prompt"]) + len(_READ["prompt"]) + 4 * _ANSWER_TOKENS
        letters = sum(same + 2 * len(self._question(entry, self._facts(entry))) for entry in objects)
        into, out = round(letters * _PER_LETTER), 2 * _ANSWER_TOKENS * len(objects)
        cost = self._agent.options.cost_usd(into, out)
        priced = "" if cost is None else f", about ${cost:.2f}"
        return (
            f"{self._agent.service.name}: {2 * len(objects):,} requests about {len(objects):,} objects, some "
            f"{into:,} tokens in and {out:,} out{priced}"
        )

    def rewrite(self, objects: Sequence[Object], limits: Limits) -> tuple[dict[int, str], Rewriting]:
        """Write descriptions of objects; returns those that are verified, by the objects' ids."""
        done, failures = Rewriting(), 0
        texts: dict[int, str] = {}
        for entry in objects:
            cost = self._agent.options.cost_usd(*done.tokens) or 0.0
            if failures >= _MAX_FAILURES or limits.reached(Finished(cost_usd=cost, tokens=sum(done.tokens))):
                done.left += 1
                continue
            try:
                text, why = self._text(entry, done)
                failures = 0
            except AgentUnavailable as error:
                text, why, failures = "", f"without an answer ({error.kind})", failures + 1
            why = why or ("that another object has" if text in texts.values() else "")
            if why:
                done.dropped[why] += 1
            else:
                done.kept += 1
                texts[entry.id] = text
        return texts, done

    def _text(self, entry: Object, done: Rewriting) -> tuple[str, str]:
        """Return a text, and why it is dropped; empty if it is verified."""
        facts = self._facts(entry)
        question = self._question(entry, facts)
        try:
            text = read_as(_Written, self._ask(_WRITE, question, done)).text
            if why := form_fault(text):
                return "", why
            prompt = json.dumps(json.loads(question) | {"text": text}, ensure_ascii=False)
            read = read_as(_Read, self._ask(_READ, prompt, done))
        except InvalidAnswer:
            return "", "whose answer cannot be read"
        return text, self._fault(entry, facts, text, read)

    def _ask(self, what: Mapping[str, Any], text: str, done: Rewriting) -> str:
        done.requests += 1
        reply: Reply = self._agent.ask_for(what["prompt"], text, what["schema"])
        for k, n in enumerate((reply.input_tokens, reply.output_tokens)):
            done.tokens[k] += n or 0
        return reply.text

    def _facts(self, entry: Object) -> list[Claim]:
        """What may be said of an object."""
        room = Counter({"relation": _MAX_RELATIONS, "part": _MAX_PARTS})
        facts = []
        for claim in self._claims.of(self._index[entry.node]):
            if claim.kind not in ("relation", "part") or room[claim.kind] > 0:
                room[claim.kind] -= 1
                facts.append(claim)
        return facts

    def _fact(self, claim: Claim) -> str:
        """Say a fact in plain words."""
        things = [" ".join(["the" if m.unique else "a", *m.said, m.noun]) for m in claim.things]
        if claim.kind == "relation":
            return f"it is {_RELATIONS.get(claim.key, claim.key)} {' and '.join(things)}"
        if claim.kind == "direction":
            return f"it is {claim.key} of {things[0]}"
        verb = "has" if claim.kind == "part" and claim.key not in self._adjectives else "is"
        return f"it {verb} {claim.key.rpartition('=')[2]}"

    def _question(self, entry: Object, facts: Sequence[Claim]) -> str:
        numbered = {str(k): self._fact(fact) for k, fact in enumerate(facts)}
        return json.dumps({"called": entry.name, "facts": numbered}, ensure_ascii=False)

    def _fault(self, entry: Object, facts: Sequence[Claim], text: str, read: _Read) -> str:
        """Why a text is not verified; empty if it is."""
        i = self._index[entry.node]
        if read.besides:
            return "that say more than the facts"
        if not read.said or not all(0 <= k < len(facts) for k in read.said):
            return "whose facts cannot be told"
        said = [facts[k] for k in dict.fromkeys(read.said)]
        words = _tokens(text)
        allowed = set(_tokens(" ".join([entry.name, *map(self._fact, said)])))
        if next((word for word in words if not _is_allowed(word, allowed)), None):
            return "with words of their own"
        if _tokens(entry.name)[-1] not in words:
            return "that do not name their object"
        if any(not _needed(claim) & set(words) for claim in said):
            return "whose facts cannot be told"
        if self._matcher.faults(i, text):
            return "that are false of the mesh"
        return "that fit another object as well" if self._claims.distractors(i, said) else ""


def form_fault(text: str) -> str:
    """Why a text has no form that is read on; empty if it has."""
    if not (text.isprintable() and all(letter.isascii() or letter in "’‘“”–" for letter in text)):
        return "with letters that no English text has"
    return "of no form that a description has" if next(iter(description_faults(text)), "") else ""


def _needed(claim: Claim) -> set[str]:
    """Words of which a text has to have one if it says a fact."""
    if claim.things:
        return {_tokens(m.noun)[-1] for m in claim.things}
    return {word for word in _tokens(claim.key.rpartition("=")[2]) if word not in LISTS["free"]}


def _tokens(text: str) -> list[str]:
    joined = re.sub(r"\b(north|south)[- ](east|west)", r"\1\2", text.lower().replace("’", "'"))
    return re.findall(r"[a-z0-9']+", joined)


def _is_allowed(word: str, facts: set[str]) -> bool:
    if word in facts or word in LISTS["free"]:
        return True
    if word in _EXACT or len(word) <= _STEM or any(word.startswith(d) for d in ("north", "south", "east", "west")):
        return False
    return any(word[:_STEM] == own[:_STEM] and abs(len(word) - len(own)) <= 3 for own in facts - _EXACT)


def rewrite_scene(
    name: str, roots: ProjectPaths, agent: LanguageModelAgent, limits: Limits | None, *, again: bool = False,
    say: Callable[[str], object] = lambda line: None,
) -> Rewriting | None:  # fmt: skip
    """Rewrite descriptions in an annotation file, people's only if `again`; without limits it sends nothing: None."""
    path = roots.annotations / f"{name}.json"
    if not path.exists():
        raise AnnotationError(f"{path} does not exist: there is nothing to rewrite")
    annotations, catalogue = parse_whole(path.read_bytes(), name, str(path)), load_catalogue(roots.scene_assets)
    scene = build_scene(roots.recipes / f"{name}.toml", catalogue)
    for node in (*(m.node for m in annotations.landmarks), *(o.node for o in annotations.objects)):
        if node not in scene:
            raise AnnotationError(f"{path}: no node {node!r} in the scene: draft the file again")
    rewriter = Rewriter(agent, SceneClaims(Vocabulary(scene, catalogue), annotations.landmarks))
    objects = [entry for entry in annotations.objects if again or entry.description is None]
    say(rewriter.estimate(objects))
    if limits is None:
        return None
    texts, done = rewriter.rewrite(objects, limits)
    changed = (
        entry.model_copy(update={"description": texts[entry.id]}) if entry.id in texts else entry
        for entry in annotations.objects
    )
    write_annotations(replace(annotations, objects=tuple(changed)), path)
    for line in done.lines():
        say(line)
    return done


def make_agent(protocol: str, options: Mapping[str, str]) -> LanguageModelAgent:
    """Make the client of a service; keys come from the environment only."""
    if protocol not in ("openai", "anthropic"):
        raise UsageError(f"--rewrite {protocol[:20]!r}: must be openai or anthropic")
    agent = load_agent(protocol, **read_options(protocol, options))
    assert isinstance(agent, LanguageModelAgent)
    return agent
