"""All checks of an annotation file; faults are reported by JSON path and line."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.annotations.claims import SceneClaims
from aerialdojo_gen.annotations.format import Fault, Landmark, Object, Source
from aerialdojo_gen.annotations.matching import Matcher
from aerialdojo_gen.annotations.relations import Bearing
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.base.safe_parse import JsonPath
from aerialdojo_gen.scenes.model import Instance, Scene

# Not allowed in names and descriptions: node names, decimals, number pairs, measured lengths.
_UNSPOKEN = re.compile(
    r"[A-Za-z0-9]+_[A-Za-z0-9_]+|\d+\.\d+|-?\d+\s*,\s*-?\d+|\b\d+\s*(?:m|metres?|meters?|cm|km)\b|\b[xyz]\s*=",
    re.IGNORECASE,
)
_SENTENCES = 3
_WORDS = 60
_SPACES = "has leading, trailing or double spaces"


class SourceCheck:
    """The checks of an annotation file against its scene, and what they found."""

    def __init__(self, source: Source, vocabulary: Vocabulary, counts: tuple[int, int] | None = None) -> None:
        self._source, self._scene, self._vocabulary = source, vocabulary.scene, vocabulary
        self._fault, raw = source.document.fault, source.document.value
        self._raw: dict[str, Any] = raw if isinstance(raw, dict) else {}
        self._known = sorted({*vocabulary.names, *(instance.category for instance in self._scene.instances)})
        self.claims: SceneClaims | None = None  # None where the landmarks are at fault
        self.unchecked: dict[int, list[str]] = {}  # Words of texts that match no claim, by the object's index
        found = () if raw is None else self._find(counts)
        self.faults = sorted(dict.fromkeys([*source.faults, *found]), key=lambda fault: fault.line)

    def _find(self, counts: tuple[int, int] | None) -> Iterator[Fault]:
        source, scene = self._source, self._scene
        if source.scene and source.scene != scene.name:
            yield self._fault(("scene",), f"is {source.scene!r}, the scene is {scene.name!r}")
        for key, expected in zip(("landmarks", "objects"), counts or (), strict=False):
            entries = self._raw.get(key)
            found = len(entries) if isinstance(entries, list) else 0
            if found != expected:
                yield self._fault((key,), f"there are {found}; the paper's inventory has {expected}")
        yield from self._unique()
        for i, landmark in source.landmarks.items():
            yield from self._entry(("landmarks", i), landmark)
        for i, entry in source.objects.items():
            yield from self._entry(("objects", i), entry)
            yield from self._object(("objects", i), entry)
        yield from self._texts()

    def _unique(self) -> Iterator[Fault]:
        landmarks, objects = self._source.landmarks, self._source.objects
        entries: tuple[tuple[str, Mapping[int, Landmark | Object], tuple[str, ...]], ...] = (
            ("landmarks", landmarks, ("id", "name", "node")),
            ("objects", objects, ("id", "node")),
        )
        first: dict[tuple[object, ...], int] = {}
        for kind, members, keys in entries:
            for key, (i, entry) in itertools.product(keys, members.items()):
                value = getattr(entry, key)
                value = value.strip().lower() if key == "name" else value
                if (other := first.setdefault((kind, key, value), i)) != i:
                    yield self._fault((kind, i, key), f"{value!r} is the {key} of {kind}[{other}] already")
        landmark_nodes = {entry.node: i for i, entry in landmarks.items()}
        for i, item in objects.items():
            if item.node in landmark_nodes:
                text = f"{item.node!r} is landmarks[{landmark_nodes[item.node]}]: an object must be a different node"
                yield self._fault(("objects", i, "node"), text)

    def _entry(self, path: JsonPath, entry: Landmark | Object) -> Iterator[Fault]:
        name, node, scene = entry.name, entry.node, self._scene
        if not name.strip():
            yield self._fault((*path, "name"), "is empty")
        elif name != " ".join(name.split()):
            yield self._fault((*path, "name"), _SPACES)
        elif _UNSPOKEN.search(name):
            yield self._fault((*path, "name"), f"{name!r} must be plain words, without node names or numbers")
        if node not in scene:
            text = f"no node {node!r} in the scene{nearest(node, (i.node for i in scene.instances), 2)}"
            yield self._fault((*path, "node"), text)
        elif isinstance(entry, Landmark):
            if not reaches_into(scene, scene[node]):
                yield self._fault((*path, "node"), f"{node!r} stands outside the scene's bounds")
        elif not is_inside(scene, scene[node].centroid):
            yield self._fault((*path, "node"), f"the middle of {node!r} is outside the scene's bounds")

    def _object(self, path: JsonPath, entry: Object) -> Iterator[Fault]:
        scene, category = self._scene, entry.category
        for text in description_faults(entry.description) if entry.description is not None else ():
            yield self._fault((*path, "description"), text)
        if category not in self._known:
            yield self._fault((*path, "category"), f"no category {category!r}{nearest(category, self._known, 2)}")
        elif not scene.imported and entry.node in scene and scene[entry.node].category != category:
            text = f"is {category!r}, the node {entry.node!r} is a {scene[entry.node].category!r}"
            yield self._fault((*path, "category"), text)
        if entry.anchor is not None and not is_inside(scene, entry.anchor.position_m):
            yield self._fault((*path, "anchor", "position_m"), "outside the scene's bounds")

    def _texts(self) -> Iterator[Fault]:
        """Check directions, texts and that objects can be distinguished; only if all landmarks are valid."""
        source, scene = self._source, self._scene
        landmarks = sorted(source.landmarks.values(), key=lambda entry: entry.id)
        nodes = [landmark.node for landmark in landmarks]
        raw = self._raw.get("landmarks")
        if not isinstance(raw, list) or len({node for node in nodes if node in scene}) < len(raw):
            return
        if not nodes:
            if source.objects:
                yield self._fault(("landmarks",), "there is none: objects need one to be located by")
            return
        self.claims = SceneClaims(self._vocabulary, landmarks)
        matcher = Matcher(self.claims)
        described: dict[tuple[object, ...], int] = {}
        for k, entry in source.objects.items():
            if entry.node not in scene or entry.node in nodes:
                continue
            i = self.claims.geometry.index[entry.node]
            bearing = self.claims.bearings[i]
            if bearing is None:
                text = "is exactly at its nearest landmark's position, so it has no direction"
                yield self._fault(("objects", k, "node"), text)
                continue
            for false in matcher.faults(i, entry.name):
                yield self._fault(("objects", k, "name"), false)
            if entry.description is None or not entry.description.strip():
                if others := self.claims.listed(self.claims.distractors(i, self.claims.of(i))):
                    text = f"nothing tells it from {others}, {bearing.direction} of the same landmark"
                    yield self._fault(("objects", k, "node"), f"{text}: choose another object")
                continue
            yield from self._description(matcher, k, entry, bearing)
            same = (entry.name.lower(), bearing, entry.description.lower())
            if (other := described.setdefault(same, k)) != k:
                text = f"name, landmark, direction and description are those of objects[{other}]"
                yield self._fault(("objects", k, "description"), text)

    def _description(self, matcher: Matcher, k: int, entry: Object, bearing: Bearing) -> Iterator[Fault]:
        """Check a person's text: what is matched to claims must be so, and fit one thing."""
        assert self.claims is not None
        assert entry.description is not None
        path, i = ("objects", k, "description"), self.claims.geometry.index[entry.node]
        for false in matcher.faults(i, entry.description):
            yield self._fault(path, false)
        if words := matcher.read(entry.description, i).unchecked:
            self.unchecked[k] = words
        # A reader may stop after the first sentence.
        start = f"The {entry.name}: {re.split(r'(?<=[.!?])[ ]', entry.description.strip(), maxsplit=1)[0]}"
        for text, what in ((entry.description, "it"), (start, "its start")):
            if others := self.claims.listed(self.claims.distractors(i, matcher.true_claims(i, text))):
                where = f"{what} fits {others} as well, {bearing.direction} of the same landmark"
                hint = "" if what == "it" else " in the first sentence"
                yield self._fault(path, f"ambiguous: {where}; say{hint} how it differs or what stands near it")
                break


def description_faults(text: str) -> Iterator[str]:
    """Yield what is wrong with the form of a person's text."""
    if not text.strip():
        yield "is empty"
        return
    if text != " ".join(text.split()):
        yield _SPACES
    unspoken = _UNSPOKEN.search(text)
    if unspoken:
        yield f"{unspoken.group()!r}: coordinates and node names are not allowed"
    if text.strip()[-1] not in ".!?":
        yield "must end with a full stop"
    if len(re.findall(r"[.!?](?:\s|$)", text)) > _SENTENCES:
        yield f"has more than {_SENTENCES} sentences"
    if len(text.split()) > _WORDS:
        yield f"has more than {_WORDS} words"


def is_inside(scene: Scene, point: ArrayLike) -> bool:
    """Whether a point is within a scene's bounds."""
    return bool(np.all(np.asarray(point) >= scene.bounds[0]) and np.all(np.asarray(point) <= scene.bounds[1]))


def reaches_into(scene: Scene, instance: Instance) -> bool:
    """Whether a landmark's middle lies over the site and some of it below the ceiling, as a high mast's does."""
    (x0, y0, z0), (x1, y1, z1) = scene.bounds.tolist()
    x, y, _ = instance.centroid.tolist()
    bottom, top = instance.bounds[:, 2].tolist()
    return x0 <= x <= x1 and y0 <= y <= y1 and bottom <= z1 and top >= z0
