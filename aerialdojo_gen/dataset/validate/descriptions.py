"""Checks that what is said of objects is true of the mesh and fits one thing only.

The claims that texts are made from are held against the mesh one by one; texts are matched to claims besides, as far
as they go, which finds a text that was changed. Relations, places and what makes a claim ambiguous are those of
`aerialdojo_gen.annotations`, which a second account of the English language would not improve on. The input is the
release's own: its tables and meshes, no annotation file.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from typing import Any

from aerialdojo_gen.annotations.claims import Claim, SceneClaims, claims_from_json
from aerialdojo_gen.annotations.format import Landmark
from aerialdojo_gen.annotations.matching import Matcher
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.base.constants import DIRECTIONS
from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Rows, SceneData, UncheckedError
from aerialdojo_gen.scenes.catalogue import load_catalogue
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
# Beside a colour they say nothing of which thing has it: others of the text are dark green, too.
_NO_PART = {*_COLOURS, "and", "dark", "light", "pale", "bright", "deep"}


@check("objects", after=_FAULTS)
def object_claims(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Every claim about an object is so of the mesh, and of the very things that it names."""
    scene_claims = _scene_claims(data)
    for row, i in _placed(scene_claims, rows):
        claims = _claims(rows, row)
        if claims is None:
            yield Finding(row, f"claims = {str(rows.texts('claims')[row])[:80]!r}", "a JSON list of claims")
        elif wrong := next((claim for claim in claims if not scene_claims.is_true(claim, i)), None):
            said = f"{wrong.kind} {wrong.key!r} {' and '.join(thing.node for thing in wrong.things)}".strip()
            yield Finding(row, f"it claims {said}", f"what is so of {data.mesh.instances[i].node}")


@check("objects", after=_FAULTS)
def object_words(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """Names and texts name their own thing, and say no value, relation or direction that is not so in the mesh."""
    scene_claims, matcher, instances = _scene_claims(data), _matcher(data), data.mesh.instances
    for row, i in _placed(scene_claims, rows):
        made = {one["text"] for one in _made(rows, row) if one["claims"]}
        for column, text in (("name", rows.texts("name")[row] or ""), *_texts(rows, row)):
            # What was made of claims is held to these, not read back.
            wrong = "" if text in made else next(iter(matcher.faults(i, text)), "")
            wrong = wrong or _recoloured(instances[i], text)
            if wrong := wrong or _turned(scene_claims, i, text):
                yield Finding(row, f"{column} = {text!r}: {wrong}", f"what is so of {instances[i].node}")
                break


@check("objects", after=(*_FAULTS, "object_words", "object_claims"))
def object_ambiguous(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A text fits nothing else of its category in the same direction of the same landmark."""
    scene_claims, matcher = _scene_claims(data), _matcher(data)
    for row, i in _placed(scene_claims, rows):
        own = _claims(rows, row) or []
        made = [(one["text"], one["claims"]) for one in _made(rows, row) if one["claims"]]
        texts = [(text, [own[k] for k in chosen if k < len(own)]) for text, chosen in made]
        made_texts = {text for text, _ in made}
        texts += [(t, matcher.true_claims(i, t)) for _, t in _texts(rows, row) if t not in made_texts]
        for text, claims in texts or [("all that is claimed", own)]:
            if others := scene_claims.listed(scene_claims.distractors(i, claims)):
                yield Finding(row, f"{text!r}, which fits {others} as well", "words that fit one thing")
                break


def _placed(scene_claims: SceneClaims, rows: Rows) -> Iterator[tuple[int, int]]:
    """Rows whose node is in the mesh, and its index there."""
    index = scene_claims.geometry.index
    yield from ((row, index[str(node)]) for row, node in enumerate(rows.texts("mesh_node")) if node in index)


def _made(rows: Rows, row: int) -> list[dict[str, Any]]:
    """The texts that the program made of an object's claims."""
    return rows.table["paraphrases"][row].as_py() or []


def _texts(rows: Rows, row: int) -> list[tuple[str, str]]:
    """All texts about an object, and their columns."""
    text = rows.texts("description")[row]
    made = [("paraphrases", one["text"]) for one in _made(rows, row)]
    return [("description", text), *made] if text else made


def _claims(rows: Rows, row: int) -> list[Claim] | None:
    """Read an object's claims; None where they are malformed."""
    try:
        return claims_from_json(str(rows.texts("claims")[row]))
    except (AerialDojoError, ValueError):
        return None


def _turned(scene_claims: SceneClaims, i: int, text: str) -> str:
    """Say which direction from the object's own landmark a text says, where the goal says another."""
    bearing = scene_claims.bearings[i]
    if bearing is None:
        return ""
    node = scene_claims.scene.instances[scene_claims.landmarks[bearing.landmark]].node
    name = next(name for name, own in scene_claims.landmark_names.items() if own == node)
    plain = re.sub(r"\b(north|south)[- ](east|west)", r"\1\2", text.lower())
    said = re.findall(rf"\b({'|'.join(DIRECTIONS)})(?:ern)?(?: side)? of the {re.escape(name)}\b", plain)
    wrong = [direction for direction in said if direction != bearing.direction]
    return f"{wrong[0]} of the {name}, and the goal says {bearing.direction}" if wrong else ""


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


@check("landmarks", after=("landmark_node",))
def landmark_name(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A landmark's name is one of a kind, names its own thing, and says no value that the mesh does not bear out."""
    scene_claims, matcher, instances = _scene_claims(data), _matcher(data), data.mesh.instances
    first = dict[str, int]()
    for row, i in _placed(scene_claims, rows):
        text = rows.texts("name")[row] or ""
        wrong = next(iter(matcher.faults(i, text)), "") or _recoloured(instances[i], text)
        wrong = wrong or _other_side(scene_claims, i, text)
        if first.setdefault(text.lower(), row) != row:
            wrong = f"as {rows.key(first[text.lower()])}"
        if wrong:
            yield Finding(row, f"name = {text!r}: {wrong}", f"what is so of {instances[i].node}")


def _matcher(data: SceneData) -> Matcher:
    return data.cached("matcher", lambda: Matcher(_scene_claims(data)))


def _scene_claims(data: SceneData) -> SceneClaims:
    return data.cached("claims", lambda: _read_claims(data))


def _read_claims(data: SceneData) -> SceneClaims:
    scene = data.mesh
    marks = data["landmarks"]
    nodes = [str(node) for node in marks.texts("mesh_node")]
    if not nodes or len(set(nodes)) < len(nodes) or not all(node in scene for node in nodes):
        raise UncheckedError("the landmarks are at fault")
    catalogue = None
    if data.pipeline.scene_assets:
        with contextlib.suppress(AerialDojoError, OSError):
            catalogue = load_catalogue(data.pipeline.scene_assets)
    if catalogue is None:
        raise UncheckedError("no catalogue of props: the pipeline names no scene_assets")
    named = zip(marks.ints("landmark_id").tolist(), map(str, marks.texts("name")), nodes, strict=True)
    landmarks = [Landmark.model_construct(id=k, name=name, node=node) for k, name, node in named]
    landmarks.sort(key=lambda mark: mark.id)
    return SceneClaims(Vocabulary(scene, catalogue), landmarks)


def _recoloured(instance: Instance, text: str) -> str:
    """Say which of a thing's attributes with a colour in it stands in a text with another colour alone."""
    normalized = " ".join(_split(text))
    # In "a red jib crane" the crane is red, though its jib is white.
    head = instance.category.rsplit("_", 1)[-1]
    for key, value in instance.attributes.items():
        words = _split(value)
        if words[:1] in (["at"], ["by"], ["on"]):
            continue  # of a place, such as "by the green"
        # Said of a part that the attribute is called after: a green poster, yellow flowers.
        words += _split(key) if len(words) == 1 and key != "colour" else []
        for k, word in enumerate(words):
            rest = [*words[:k], *words[k + 1 :]]
            if word not in _COLOURS or {*rest} <= _NO_PART:
                continue
            phrase = " ".join([*words[:k], _ANY_COLOUR, *words[k + 1 :]]).removeprefix("a ")
            found = re.findall(rf"\b{phrase}\b(?! {head}\b)", normalized)
            if found and word not in found:
                return f"{found[0]!r} stands where {value!r} has {word!r}"
    return ""


def _other_side(scene_claims: SceneClaims, i: int, text: str) -> str:
    """Say which side a landmark is said to be on of its like, where it is on another."""
    geometry = scene_claims.geometry
    category = geometry.scene.instances[i].category
    alike = [j for j in scene_claims.landmarks if j != i and geometry.scene.instances[j].category == category]
    for side, (dx, dy) in _SIDES.items():
        if alike and side in _split(text):
            offset = geometry.centres[i, :2] - geometry.centres[alike, :2].mean(axis=0)
            if float(offset @ (dx, dy)) <= 0.0:
                return f"it does not stand {side.removesuffix('ern')} of its like"
    return ""


def _split(text: str) -> list[str]:
    return re.findall(r"[a-z0-9]+", text.lower())
