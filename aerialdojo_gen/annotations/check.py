"""All checks of an annotation file; faults are reported by JSON path and line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from aerialdojo_gen.annotations.ambiguity import Ambiguity, nearest_landmark
from aerialdojo_gen.annotations.appearance import Looks, false_colours, false_phrases
from aerialdojo_gen.annotations.claims import Lexicon
from aerialdojo_gen.annotations.format import Landmark, Object, Source
from aerialdojo_gen.annotations.ground import Surface
from aerialdojo_gen.annotations.head_noun import NounChecker
from aerialdojo_gen.annotations.places import Places, places_of
from aerialdojo_gen.annotations.positions import Fault
from aerialdojo_gen.annotations.relations import SceneGeometry
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.scenes.model import Scene

# Not allowed in names and descriptions: node names, decimals, number pairs, measured lengths.
_UNSPOKEN = re.compile(
    r"[A-Za-z0-9]+_[A-Za-z0-9_]+|\d+\.\d+|-?\d+\s*,\s*-?\d+|\b\d+\s*(?:m|metres?|meters?|cm|km)\b|\b[xyz]\s*=",
    re.IGNORECASE,
)
_SENTENCES = 3
_WORDS = 60


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
        if source.scene and source.scene != scene.name:
            faults.append(source.document.fault(("scene",), f"is {source.scene!r}, the scene is {scene.name!r}"))
        faults += _counts(source, counts)
        faults += _unique(source)
        for i, landmark in source.landmarks.items():
            faults += _landmark(source, scene, ("landmarks", i), landmark)
        noun_checker, surface = NounChecker(names), Surface(scene)
        for i, entry in source.objects.items():
            faults += _object(source, scene, names, ("objects", i), entry)
            faults += _nouns(source, scene, noun_checker, ("objects", i), entry)
            faults += _looks(source, scene, looks or {}, surface, ("objects", i), entry)
        faults += _geometry(source, scene, names, geometry or SceneGeometry(scene))
    return sorted(dict.fromkeys(faults), key=lambda fault: fault.line)


def _counts(source: Source, counts: tuple[int, int] | None) -> Iterable[Fault]:
    raw = source.document.value
    for key, expected in zip(("landmarks", "objects"), counts or (), strict=False):
        found = len(raw[key]) if isinstance(raw, dict) and isinstance(raw.get(key), list) else 0
        if found != expected:
            yield source.document.fault((key,), f"there are {found}; the paper's inventory has {expected}")


def _unique(source: Source) -> Iterable[Fault]:
    entries: tuple[tuple[str, Mapping[int, Landmark | Object], tuple[str, ...]], ...] = (
        ("landmarks", source.landmarks, ("id", "name", "node")),
        ("objects", source.objects, ("id", "node")),
    )
    for kind, members, keys in entries:
        for key in keys:
            first: dict[object, int] = {}
            for i, entry in members.items():
                value = getattr(entry, key)
                value = value.strip().lower() if key == "name" else value
                if value in first:
                    text = f"{value!r} is the {key} of {kind}[{first[value]}] already"
                    yield source.document.fault((kind, i, key), text)
                first.setdefault(value, i)
    landmark_nodes = {entry.node: i for i, entry in source.landmarks.items()}
    for i, item in source.objects.items():
        if item.node in landmark_nodes:
            text = f"{item.node!r} is landmarks[{landmark_nodes[item.node]}]: an object must be a different node"
            yield source.document.fault(("objects", i, "node"), text)


def _landmark(source: Source, scene: Scene, path: tuple[str | int, ...], entry: Landmark) -> Iterable[Fault]:
    yield from _name(source, path, entry.name)
    yield from _node(source, scene, path, entry.node)


def _object(
    source: Source, scene: Scene, names: Mapping[str, str], path: tuple[str | int, ...], entry: Object
) -> Iterable[Fault]:
    yield from _name(source, path, entry.name)
    yield from _node(source, scene, path, entry.node)
    yield from _description(source, (*path, "description"), entry.description)
    known = sorted({*names, *(instance.category for instance in scene.instances)})
    if entry.category not in known:
        text = f"no category {entry.category!r}{nearest(entry.category, known, 2)}"
        yield source.document.fault((*path, "category"), text)
    elif not scene.imported and entry.node in scene and scene[entry.node].category != entry.category:
        text = f"is {entry.category!r}, the node {entry.node!r} is a {scene[entry.node].category!r}"
        yield source.document.fault((*path, "category"), text)
    if entry.anchor is not None and not _inside(scene, entry.anchor.position_m):
        yield source.document.fault((*path, "anchor", "position_m"), "outside the scene's bounds")


def _nouns(
    source: Source, scene: Scene, noun_checker: NounChecker, path: tuple[str | int, ...], entry: Object
) -> Iterable[Fault]:
    """Check the nouns of name and description; not for imported scenes, whose categories are guesses."""
    if scene.imported or entry.node not in scene:
        return
    for key in ("name", "description"):
        for message in noun_checker.contradictions(getattr(entry, key), scene[entry.node]):
            yield source.document.fault((*path, key), message)


def _looks(
    source: Source, scene: Scene, looks: Looks, surface: Surface, path: tuple[str | int, ...], entry: Object
) -> Iterable[Fault]:
    if scene.imported or entry.node not in scene:
        return
    thing = scene[entry.node]
    for message in false_phrases(entry.description, thing, looks, scene.materials, surface):
        yield source.document.fault((*path, "description"), message)
    for key in ("name", "description"):
        for message in false_colours(getattr(entry, key), thing, scene.materials):
            yield source.document.fault((*path, key), message)


def _name(source: Source, path: tuple[str | int, ...], name: str) -> Iterable[Fault]:
    if not name.strip():
        yield source.document.fault((*path, "name"), "is empty")
    elif name != " ".join(name.split()):
        yield source.document.fault((*path, "name"), "has leading, trailing or double spaces")
    elif _UNSPOKEN.search(name):
        yield source.document.fault((*path, "name"), f"{name!r} must be plain words, without node names or numbers")


def _node(source: Source, scene: Scene, path: tuple[str | int, ...], node: str) -> Iterable[Fault]:
    if node not in scene:
        text = f"no node {node!r} in the scene{nearest(node, (i.node for i in scene.instances), 2)}"
        yield source.document.fault((*path, "node"), text)
    elif not _inside(scene, scene[node].centroid):
        yield source.document.fault((*path, "node"), f"the middle of {node!r} is outside the scene's bounds")


def _description(source: Source, path: tuple[str | int, ...], text: str) -> Iterable[Fault]:
    if not text.strip():
        yield source.document.fault(path, "is empty")
        return
    if text != " ".join(text.split()):
        yield source.document.fault(path, "has leading, trailing or double spaces")
    unspoken = _UNSPOKEN.search(text)
    if unspoken:
        yield source.document.fault(path, f"{unspoken.group()!r}: coordinates and node names are not allowed")
    if text.strip()[-1] not in ".!?":
        yield source.document.fault(path, "must end with a full stop")
    if len(re.findall(r"[.!?](?:\s|$)", text)) > _SENTENCES:
        yield source.document.fault(path, f"has more than {_SENTENCES} sentences")
    if len(text.split()) > _WORDS:
        yield source.document.fault(path, f"has more than {_WORDS} words")


def _inside(scene: Scene, point: Sequence[float] | np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
    return bool(np.all(np.asarray(point) >= scene.bounds[0]) and np.all(np.asarray(point) <= scene.bounds[1]))


def _geometry(source: Source, scene: Scene, names: Mapping[str, str], geometry: SceneGeometry) -> Iterable[Fault]:
    """Check directions and descriptions against the mesh; only if all landmarks are valid."""
    nodes = [landmark.node for landmark in sorted(source.landmarks.values(), key=lambda entry: entry.id)]
    raw = source.document.value.get("landmarks") if isinstance(source.document.value, dict) else None
    if not isinstance(raw, list) or len(nodes) < len(raw) or len(set(nodes)) < len(nodes):
        return
    if not all(node in scene for node in nodes):
        return
    if not nodes:
        if source.objects:
            yield source.document.fault(("landmarks",), "there is none: objects need one to be located by")
        return
    ambiguity = make_ambiguity(scene, names, {e.name: e.node for e in source.landmarks.values()}, nodes, geometry)
    described: dict[tuple[object, ...], int] = {}
    for k, entry in source.objects.items():
        if entry.node not in scene or entry.node in nodes:
            continue
        i = geometry.index[entry.node]
        bearing = nearest_landmark(geometry.centres[i], geometry.centres[list(ambiguity.landmarks)])
        if bearing is None:
            text = "is exactly at its nearest landmark's position, so it has no direction"
            yield source.document.fault(("objects", k, "node"), text)
            continue
        for key in ("name", "description"):
            for false_claim in ambiguity.false_claims(i, getattr(entry, key)):
                yield source.document.fault(("objects", k, key), false_claim)
        same = (entry.name.lower(), bearing, entry.description.lower())
        if same in described:
            text = f"name, landmark, direction and description are those of objects[{described[same]}]"
            yield source.document.fault(("objects", k, "description"), text)
        described.setdefault(same, k)
        distractors = ambiguity.distractors(i, entry.description) if entry.description.strip() else []
        if distractors:
            others = ", ".join(scene.instances[j].node for j in distractors[:3]) + (
                "..." if len(distractors) > 3 else ""
            )
            text = (
                f"ambiguous: it fits {others} as well, {bearing.direction} of the same landmark; "
                "describe how it differs or what stands near it"
            )
            yield source.document.fault(("objects", k, "description"), text)
            continue
        twins = (
            ambiguity.first_sentence_distractors(i, entry.name, entry.description)
            if entry.description.strip()
            else []
        )
        if twins:
            others = ", ".join(scene.instances[j].node for j in twins[:3]) + ("..." if len(twins) > 3 else "")
            text = f"its first sentence fits {others} as well: add what distinguishes it to the first sentence"
            yield source.document.fault(("objects", k, "description"), text)


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
