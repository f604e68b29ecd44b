"""What a text says of how its thing looks, held against the mesh: the catalogue's phrases, and colours."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from aerialdojo_gen.annotations.colours import uncoloured
from aerialdojo_gen.annotations.hidden_parts import Surface
from aerialdojo_gen.scenes.claims import untrue
from aerialdojo_gen.scenes.looks import Look
from aerialdojo_gen.scenes.model import Instance, Material

Looks = Mapping[str, tuple[Look, ...]]
# Attributes that name no part: a phrase that holds the colour's word speaks of that part.
_ELSEWHERE = frozenset({"colour", "size", "material", "place"})
_STEM = 4
_EMPTY = frozenset({"a", "an", "the", "of", "on", "in", "its", "it", "and", "with", "without", "around", "full"})


def unlike(
    text: str, instance: Instance, looks: Looks, materials: Mapping[str, Material], surface: Surface | None = None
) -> Iterator[str]:
    """Say which of the catalogue's phrases stand in a text and are not so of its instance, or not to be seen."""
    said = _plain(text)
    for look in looks.get(instance.category, ()):
        if f" {_plain(look.say).strip()} " in said:
            wrong = untrue(look, instance, materials)[:1]
            if not wrong and surface is not None and not surface.shows(look, instance):
                wrong = ["that is under the ground or under water"]
            for claim in wrong:
                yield f"{look.say!r} is not so of {instance.node}: {claim}"


def discoloured(text: str, instance: Instance, materials: Mapping[str, Material]) -> Iterator[str]:
    """Say which of its colours a text says of an instance whose surface does not have it."""
    value = instance.attributes.get("colour", "")
    if value and f" {_plain(value).strip()} " in _plain(text):
        for word in uncoloured(value, instance, materials):
            yield f"{word!r} is not the colour of {instance.node}: hardly any of its surface is"


def repeats(say: str, instance: Instance) -> bool:
    """Whether a phrase says again what an attribute of its instance says."""
    said = _stems(say)
    for key, value in instance.attributes.items():
        telling = _stems(value)
        lacking = value.startswith("without ") and say.startswith("no ")
        if key not in _ELSEWHERE and len(telling) >= (1 if lacking else 2) and telling <= said:
            return True
    return False


def _stems(text: str) -> set[str]:
    return {word[:_STEM] for word in _plain(text).split() if word not in _EMPTY}


def _plain(text: str) -> str:
    words = " ".join(re.findall(r"[^\W_]+", text.lower()))
    return f" {words} "
