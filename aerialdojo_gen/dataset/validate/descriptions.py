"""Checks that names and descriptions are true of the mesh, as `annotate-import` holds annotations to it.

The reader of English, the relations and what makes a description ambiguous are those of
`aerialdojo_gen.annotations`, which a second account of the English language would not improve on. The input is the
release's own: its tables and meshes, no annotation file. Stricter than there: every value that is said of a thing
counts, not only one that stands before its name, unless the thing's looks or its materials bear it out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from aerialdojo_gen.annotations.ambiguity import Ambiguity
from aerialdojo_gen.annotations.appearance import false_colours, false_phrases
from aerialdojo_gen.annotations.check import make_ambiguity
from aerialdojo_gen.annotations.ground import Surface
from aerialdojo_gen.annotations.parsing import Lexicon
from aerialdojo_gen.annotations.relations import SceneGeometry
from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.dataset.validate.registry import Finding, UncheckedError, check
from aerialdojo_gen.dataset.validate.rows import Rows, SceneData
from aerialdojo_gen.dataset.validate.scene_mesh import scene_mesh
from aerialdojo_gen.scenes.catalogue import Catalogue, load_catalogue
from aerialdojo_gen.scenes.colours import colour_name
from aerialdojo_gen.scenes.model import Instance

_FAULTS = ("object_node", "object_category")
_SIDES = {"northern": (0, 1), "southern": (0, -1), "eastern": (1, 0), "western": (-1, 0)}
# What people call a colour, and what `colour_name` may call it: one word is a shade of several.
_COLOURS = {
    "red": {"red", "brown", "pink", "orange"}, "maroon": {"red", "brown", "purple"},
    "russet": {"red", "brown", "orange"}, "pink": {"pink", "red", "purple", "beige"},
    "purple": {"purple", "pink", "blue"}, "blue": {"blue", "turquoise", "purple"},
    "teal": {"turquoise", "green", "blue"}, "turquoise": {"turquoise", "green", "blue"},
    "green": {"green", "turquoise", "yellow"}, "yellow": {"yellow", "orange", "beige", "brown"},
    "orange": {"orange", "red", "yellow", "brown"}, "gold": {"yellow", "orange", "brown", "beige"},
    "golden": {"yellow", "orange", "brown", "beige"}, "brown": {"brown", "orange", "beige", "red"},
    "beige": {"beige", "white", "orange", "yellow", "brown", "grey"}, "cream": {"beige", "white", "yellow", "grey"},
    "white": {"white", "beige", "grey"}, "silver": {"grey", "white"}, "grey": {"grey", "white", "black"},
    "gray": {"grey", "white", "black"}, "black": {"black", "grey"},
}  # fmt: skip
_ANY_COLOUR = f"({'|'.join(_COLOURS)})"


@dataclass(frozen=True)
class _Words:
    """What texts of a scene are read with."""

    ambiguity: Ambiguity  # Relations, phrases and rivals
    names: dict[str, str]  # What a person says for each category
    catalogue: Catalogue  # Of the props
    surface: Surface  # Ground and water, which hide what is under them


@check("objects", needs=("landmarks", "mesh"), after=_FAULTS)
def object_words(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A name or description names its own thing, and says no value and no relation that is not so in the mesh."""
    words = _words(data)
    instances, index = words.ambiguity.geometry.scene.instances, words.ambiguity.geometry.index
    texts = {name: rows.texts(name) for name in ("name", "description")}
    for row, node in enumerate(rows.texts("mesh_node")):
        if node not in index:
            continue
        i = index[str(node)]
        for name, column in texts.items():
            text = column[row] or ""
            if wrong := _untrue(words, i, text) or _unlike(words, instances[i], text):
                yield Finding(row, f"{name} = {text!r}: {wrong}", f"what is so of {instances[i].node}")
                break


@check("objects", needs=("landmarks", "mesh"), after=(*_FAULTS, "object_words"))
def object_ambiguous(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A description fits nothing else of its category in the same direction of the same landmark."""
    ambiguity = _words(data).ambiguity
    index, instances = ambiguity.geometry.index, ambiguity.geometry.scene.instances
    for row, (node, text) in enumerate(zip(rows.texts("mesh_node"), rows.texts("description"), strict=True)):
        distractors = ambiguity.distractors(index[str(node)], text or "") if node in index else []
        if others := _listed(instances, distractors):
            yield Finding(row, f"{text!r}, which fits {others} as well", "words that fit one thing")


@check("objects", needs=("landmarks", "mesh"), after=(*_FAULTS, "object_words", "object_ambiguous"))
def object_twins(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A name and the first sentence of its description fit nothing else of that landmark and direction."""
    ambiguity = _words(data).ambiguity
    index, instances = ambiguity.geometry.index, ambiguity.geometry.scene.instances
    columns = (rows.texts(name) for name in ("mesh_node", "name", "description"))
    for row, (node, name, text) in enumerate(zip(*columns, strict=True)):
        twins = (
            ambiguity.first_sentence_distractors(index[str(node)], name or "", text or "") if node in index else []
        )
        if others := _listed(instances, twins):
            yield Finding(
                row, f"{text!r}, the first sentence of which fits {others} as well", "words that tell them apart"
            )


def _listed(instances: Sequence[Instance], some: Sequence[int]) -> str:
    return ", ".join(instances[j].node for j in some[:3]) + ("..." if len(some) > 3 else "")


@check("objects", after=("object_words",))
def text_form(_data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Names and descriptions are clean text: not empty, no space too many, no letters that are no letters."""
    for name in ("name", "description"):
        for row, text in enumerate(rows.texts(name)):
            if text is None:
                continue
            if not text.strip() or text != " ".join(text.split()):
                yield Finding(row, f"{name} = {text!r}", "words with one space between them")
            elif any(not letter.isprintable() or letter == "�" for letter in text):
                yield Finding(row, f"{name} = {text!r}", "printable letters")


@check("landmarks", needs=("mesh",), after=("landmark_node",))
def landmark_name(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A landmark's name is one of a kind, names its own thing, and says no value that the mesh does not bear out."""
    words = _words(data, landmarks=False)
    geometry, first = words.ambiguity.geometry, dict[str, int]()
    for row, (node, name) in enumerate(zip(rows.texts("mesh_node"), rows.texts("name"), strict=True)):
        if node not in geometry.index:
            continue
        i, text = geometry.index[str(node)], name or ""
        wrong = _untrue(words, i, text) or _other_side(words, data, i, text)
        if first.setdefault(text.lower(), row) != row:
            wrong = f"as {rows.key(first[text.lower()])}"
        if wrong:
            yield Finding(row, f"name = {text!r}: {wrong}", f"what is so of {node}")


def _words(data: SceneData, landmarks: bool = True) -> _Words:
    return data.keep(f"words {landmarks}", lambda: _read_words(data, landmarks))


def _read_words(data: SceneData, landmarks: bool) -> _Words:
    scene = scene_mesh(data).scene
    geometry = data.keep("relations", lambda: SceneGeometry(scene))
    marks = data["landmarks"]
    nodes = [str(node) for node in marks.texts("mesh_node")]
    if not nodes or len(set(nodes)) < len(nodes) or not all(node in scene for node in nodes):
        raise UncheckedError("the landmarks are at fault")
    catalogue = _catalogue(data.pipeline.scene_assets)
    if catalogue is None:
        raise UncheckedError("no catalogue of props: the pipeline names no scene_assets")
    names = {category: catalogue[category].name for category in catalogue}
    order = [nodes[k] for k in np.argsort(marks.ints("landmark_id"), kind="stable")]
    called = dict(zip((str(name) for name in marks.texts("name")), nodes, strict=True))
    ambiguity = make_ambiguity(scene, names, called if landmarks else {}, order, geometry)
    # A colour that nothing in the scene has is a colour all the same.
    ambiguity.lexicon.add_values("colour", _COLOURS)
    return _Words(ambiguity, names, catalogue, Surface(scene))


@lru_cache(maxsize=2)
def _catalogue(folder: Path | None) -> Catalogue | None:
    try:
        return load_catalogue(folder) if folder else None
    except (AerialDojoError, OSError):
        return None


def _untrue(words: _Words, i: int, text: str) -> str:
    """Say what a text says of its thing, as a name, claim, value or colour, that is not so."""
    wrong = _misnamed(words, i, text) or next(iter(words.ambiguity.false_claims(i, text)), "")
    return wrong or _unborne(words, i, text) or _recoloured(words.ambiguity.geometry.scene.instances[i], text)


def _misnamed(words: _Words, i: int, text: str) -> str:
    """Say what a text calls its thing, where that is the name of other things and its own is not in it."""
    lexicon, instance = words.ambiguity.lexicon, words.ambiguity.geometry.scene.instances[i]
    called = lexicon.read(text, i).subjects
    own = words.names.get(instance.category, instance.category.replace("_", " "))
    if not called or own.lower() in text.lower() or any(i in lexicon.members(name) for name in called):
        return ""
    return f"it is called {called[0]!r}, and the mesh has a {own}"


def _unborne(words: _Words, i: int, text: str) -> str:
    """Say which value a text says of its thing that neither attributes nor looks nor materials bear out."""
    instance = words.ambiguity.geometry.scene.instances[i]
    lexicon: Lexicon = words.ambiguity.lexicon
    known = _looks(words, instance) | {word for value in instance.attributes.values() for word in _split(value)}
    known |= set(_split(words.names.get(instance.category, "")))
    for value in lexicon.read(text, i).values:
        if not lexicon.denied(i, value) or set(_split(value)) <= known:
            continue
        if value not in _COLOURS or not _COLOURS[value] & _shades(words, instance):
            return f"it is said to be {value!r}, and nothing of it is"
    return ""


def _recoloured(instance: Instance, text: str) -> str:
    """Say which of a thing's attributes with a colour in it stands in a text with another colour alone."""
    normalized = " ".join(_split(text))
    for key, value in instance.attributes.items():
        words = _split(value)
        # Said of a part that the attribute is called after: a green poster, yellow flowers.
        words += _split(key) if len(words) == 1 and key != "colour" else []
        for k, word in enumerate(words):
            rest = [*words[:k], *words[k + 1 :]]
            if word not in _COLOURS or {*rest} <= {*_COLOURS, "and"}:
                continue
            phrase = " ".join([*words[:k], _ANY_COLOUR, *words[k + 1 :]]).removeprefix("a ")
            found = re.findall(rf"\b{phrase}\b", normalized)
            if found and word not in found:
                return f"{found[0]!r} stands where {value!r} has {word!r}"
    return ""


def _unlike(words: _Words, instance: Instance, text: str) -> str:
    """Say which of the catalogue's phrases, or of its colours, a text says of a thing that is not so."""
    materials = words.ambiguity.geometry.scene.materials
    looks = {key: words.catalogue[key].looks for key in (instance.category,) if key in words.catalogue}
    # What no part is known of, as in a release of an older version, cannot be asked.
    wrong = (
        list(false_phrases(text, instance, looks, materials, words.surface)) if instance.anatomy is not None else []
    )
    return next(iter([*wrong, *false_colours(text, instance, materials)]), "")


def _looks(words: _Words, instance: Instance) -> set[str]:
    looks = words.catalogue[instance.category].looks if instance.category in words.catalogue else ()
    return {word for look in looks for wording in look.wordings for word in _split(wording)}


def _shades(words: _Words, instance: Instance) -> set[str]:
    """What a person calls the colours of a thing's materials."""
    materials = words.ambiguity.geometry.scene.materials
    return {colour_name(materials[part.material].colour) for part in instance.parts}


def _other_side(words: _Words, data: SceneData, i: int, text: str) -> str:
    """Say which side a landmark is said to be on of its like, where it is on another."""
    geometry, marks = words.ambiguity.geometry, words.ambiguity.landmarks
    category = geometry.scene.instances[i].category
    alike = [j for j in marks if j != i and geometry.scene.instances[j].category == category]
    for side, (dx, dy) in _SIDES.items():
        if alike and side in _split(text):
            offset = geometry.centres[i, :2] - geometry.centres[alike, :2].mean(axis=0)
            if float(offset @ (dx, dy)) <= 0.0:
                return f"it does not stand {side.removesuffix('ern')} of its like"
    return ""


def _split(text: str) -> list[str]:
    return re.findall(r"[a-z0-9]+", text.lower())
