"""All checks of an annotation file; faults are reported by JSON path and line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from aerialdojo_gen.annotations.ambiguity import Ambiguity
from aerialdojo_gen.annotations.appearance import Looks, false_colours, false_phrases
from aerialdojo_gen.annotations.bearings import nearest_landmark
from aerialdojo_gen.annotations.format import Landmark, Object, Source
from aerialdojo_gen.annotations.ground import Surface
from aerialdojo_gen.annotations.head_noun import NounChecker
from aerialdojo_gen.annotations.parsing import Lexicon
from aerialdojo_gen.annotations.places import Places, places_of
from aerialdojo_gen.annotations.positions import Fault
from aerialdojo_gen.annotations.relations import SceneGeometry
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.base.safe_parse import JsonPath
from aerialdojo_gen.scenes.model import Scene

# Not allowed in names and descriptions: node names, decimals, number pairs, measured lengths.
_UNSPOKEN = re.compile(
    r"[A-Za-z0-9]+_[A-Za-z0-9_]+|\d+\.\d+|-?\d+\s*,\s*-?\d+|\b\d+\s*(?:m|metres?|meters?|cm|km)\b|\b[xyz]\s*=",
    re.IGNORECASE,
)
_SENTENCES = 3
_WORDS = 60
_SPACES = "has leading, trailing or double spaces"


def check_source(
    source: Source,
    scene: Scene,
    names: Mapping[str, str],
    counts: tuple[int, int] | None = None,
    geometry: SceneGeometry | None = None,
    looks: Looks | None = None,
) -> list[Fault]:
    """Check an annotation file against its scene and return all faults, in line order."""
    faults = list(source.faults)
    if source.document.value is not None:
        faults += _Checker(source, scene, names, geometry or SceneGeometry(scene), looks or {}).faults(counts)
    return sorted(dict.fromkeys(faults), key=lambda fault: fault.line)


class _Checker:
    """The checks of one file; each yields its faults."""

    def __init__(
        self, source: Source, scene: Scene, names: Mapping[str, str], geometry: SceneGeometry, looks: Looks
    ) -> None:
        self._source, self._scene, self._names, self._geometry, self._looks = source, scene, names, geometry, looks
        self._fault, self._raw = source.document.fault, source.document.value
        self._known = sorted({*names, *(instance.category for instance in scene.instances)})
        self._nouns, self._surface = NounChecker(names), Surface(scene)

    def faults(self, counts: tuple[int, int] | None) -> Iterator[Fault]:
        source, scene = self._source, self._scene
        if source.scene and source.scene != scene.name:
            yield self._fault(("scene",), f"is {source.scene!r}, the scene is {scene.name!r}")
        for key, expected in zip(("landmarks", "objects"), counts or (), strict=False):
            found = len(self._raw[key]) if isinstance(self._raw, dict) and isinstance(self._raw.get(key), list) else 0
            if found != expected:
                yield self._fault((key,), f"there are {found}; the paper's inventory has {expected}")
        yield from self._unique()
        for i, landmark in source.landmarks.items():
            yield from self._entry(("landmarks", i), landmark)
        for i, entry in source.objects.items():
            yield from self._entry(("objects", i), entry)
            yield from self._object(("objects", i), entry)
            # The categories of imported scenes are guesses.
            if not scene.imported and entry.node in scene:
                yield from self._appearance(("objects", i), entry)
        yield from self._places()

    def _unique(self) -> Iterator[Fault]:
        landmarks, objects = self._source.landmarks, self._source.objects
        entries: tuple[tuple[str, Mapping[int, Landmark | Object], tuple[str, ...]], ...] = (
            ("landmarks", landmarks, ("id", "name", "node")),
            ("objects", objects, ("id", "node")),
        )
        for kind, members, keys in entries:
            for key in keys:
                first: dict[object, int] = {}
                for i, entry in members.items():
                    value = getattr(entry, key)
                    value = value.strip().lower() if key == "name" else value
                    if value in first:
                        yield self._fault((kind, i, key), f"{value!r} is the {key} of {kind}[{first[value]}] already")
                    first.setdefault(value, i)
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
        elif not _inside(scene, scene[node].centroid):
            yield self._fault((*path, "node"), f"the middle of {node!r} is outside the scene's bounds")

    def _object(self, path: JsonPath, entry: Object) -> Iterator[Fault]:
        scene, category = self._scene, entry.category
        for text in _description_faults(entry.description):
            yield self._fault((*path, "description"), text)
        if category not in self._known:
            yield self._fault((*path, "category"), f"no category {category!r}{nearest(category, self._known, 2)}")
        elif not scene.imported and entry.node in scene and scene[entry.node].category != category:
            text = f"is {category!r}, the node {entry.node!r} is a {scene[entry.node].category!r}"
            yield self._fault((*path, "category"), text)
        if entry.anchor is not None and not _inside(scene, entry.anchor.position_m):
            yield self._fault((*path, "anchor", "position_m"), "outside the scene's bounds")

    def _appearance(self, path: JsonPath, entry: Object) -> Iterator[Fault]:
        thing, materials = self._scene[entry.node], self._scene.materials
        for key in ("name", "description"):
            for message in self._nouns.contradictions(getattr(entry, key), thing):
                yield self._fault((*path, key), message)
        for message in false_phrases(entry.description, thing, self._looks, materials, self._surface):
            yield self._fault((*path, "description"), message)
        for key in ("name", "description"):
            for message in false_colours(getattr(entry, key), thing, materials):
                yield self._fault((*path, key), message)

    def _places(self) -> Iterator[Fault]:
        """Check directions and descriptions against the mesh; only if all landmarks are valid."""
        source, scene, geometry = self._source, self._scene, self._geometry
        nodes = [landmark.node for landmark in sorted(source.landmarks.values(), key=lambda entry: entry.id)]
        raw = self._raw.get("landmarks") if isinstance(self._raw, dict) else None
        if not isinstance(raw, list) or len(nodes) < len(raw) or len(set(nodes)) < len(nodes):
            return
        if not all(node in scene for node in nodes):
            return
        if not nodes:
            if source.objects:
                yield self._fault(("landmarks",), "there is none: objects need one to be located by")
            return
        named = {entry.name: entry.node for entry in source.landmarks.values()}
        ambiguity = make_ambiguity(scene, self._names, named, nodes, geometry)
        described: dict[tuple[object, ...], int] = {}
        for k, entry in source.objects.items():
            if entry.node not in scene or entry.node in nodes:
                continue
            i = geometry.index[entry.node]
            bearing = nearest_landmark(geometry.centres[i], geometry.centres[list(ambiguity.landmarks)])
            if bearing is None:
                text = "is exactly at its nearest landmark's position, so it has no direction"
                yield self._fault(("objects", k, "node"), text)
                continue
            for key in ("name", "description"):
                for false_claim in ambiguity.false_claims(i, getattr(entry, key)):
                    yield self._fault(("objects", k, key), false_claim)
            path = ("objects", k, "description")
            same = (entry.name.lower(), bearing, entry.description.lower())
            if same in described:
                text = f"name, landmark, direction and description are those of objects[{described[same]}]"
                yield self._fault(path, text)
            described.setdefault(same, k)
            if not entry.description.strip():
                continue
            if others := self._listed(ambiguity.distractors(i, entry.description)):
                text = f"ambiguous: it fits {others} as well, {bearing.direction} of the same landmark; "
                yield self._fault(path, f"{text}describe how it differs or what stands near it")
            elif others := self._listed(ambiguity.first_sentence_distractors(i, entry.name, entry.description)):
                text = f"its first sentence fits {others} as well: add what distinguishes it to the first sentence"
                yield self._fault(path, text)

    def _listed(self, instances: Sequence[int]) -> str:
        nodes = ", ".join(self._scene.instances[j].node for j in instances[:3])
        return nodes + ("..." if len(instances) > 3 else "")


def _description_faults(text: str) -> Iterator[str]:
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


def _inside(scene: Scene, point: Sequence[float] | np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
    return bool(np.all(np.asarray(point) >= scene.bounds[0]) and np.all(np.asarray(point) <= scene.bounds[1]))


def make_ambiguity(
    scene: Scene,
    names: Mapping[str, str],
    landmarks: Mapping[str, str],
    order: Sequence[str],
    geometry: SceneGeometry | None = None,
) -> Ambiguity:
    """Make the ambiguity check of a scene."""
    geometry = geometry or SceneGeometry(scene)
    bound = None if scene.imported else places_of(scene.name)
    places = None if bound is None else Places(geometry, bound)
    lexicon = Lexicon(geometry, names, {name: geometry.index[node] for name, node in landmarks.items()}, places)
    return Ambiguity(geometry, lexicon, [geometry.index[node] for node in order])
