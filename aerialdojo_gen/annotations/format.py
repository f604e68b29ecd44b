"""The annotation file: a versioned JSON format, written so that diffs are small (see annotations/README.md)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, StrictFloat, StrictInt, StrictStr, ValidationError

from aerialdojo_gen.annotations.positions import Document, Fault, read_json
from aerialdojo_gen.base.explain import faults_of
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.store.atomic import atomic_file

FORMAT = "aerialdojo-annotations"
VERSION = 1

_KEYS = ("format", "version", "scene", "landmarks", "objects")
_Id = Annotated[StrictInt, Field(ge=0, le=2**31 - 1)]
_Finite = Annotated[StrictFloat, Field(allow_inf_nan=False)]


class Strict(BaseModel):
    """Values that do not change, under no keys but these."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Anchor(Strict):
    """A viewpoint that a person chose for an object."""

    position_m: tuple[_Finite, _Finite, _Finite]  # Position of the body's centre, metres, world frame
    yaw_deg: _Finite  # Degrees, counter-clockwise from +x


class Landmark(Strict):
    """A landmark: an id, a name that is unique in the scene, and a node of the scene's mesh."""

    id: _Id
    name: StrictStr
    node: StrictStr


class Object(Strict):
    """A target object."""

    id: _Id  # Unique in the scene
    name: StrictStr  # What a person would call it, e.g. ``"red delivery van"``
    category: StrictStr  # Category of the catalogue, the node's own
    description: StrictStr | None = None  # One to three sentences by a person; None: the program makes them
    node: StrictStr  # Node of the scene's mesh
    anchor: Anchor | None = None  # The viewpoint that a person chose, where one did


@dataclass(frozen=True)
class Annotations:
    """The content of one annotation file."""

    scene: str  # Name of the scene
    landmarks: tuple[Landmark, ...]
    objects: tuple[Object, ...]


@dataclass(frozen=True)
class Source:
    """The readable part of an annotation file."""

    document: Document  # The JSON with the line of every value
    scene: str  # Empty if missing
    landmarks: dict[int, Landmark]  # The well-formed entries by their index in the file
    objects: dict[int, Object]
    faults: tuple[Fault, ...]  # Faults of form; faulty entries are in neither dict

    @property
    def annotations(self) -> Annotations:
        """The well-formed entries in the file's order."""
        return Annotations(self.scene, tuple(self.landmarks.values()), tuple(self.objects.values()))


_E = TypeVar("_E", bound=Strict)


def parse_annotations(text: str) -> Source:
    """Read an annotation file's text."""
    document = read_json(text)
    faults = list(document.faults)
    raw = document.value
    if not isinstance(raw, dict):
        if not faults:
            faults.append(document.fault((), f"must be an object with the keys {', '.join(_KEYS)}"))
        return Source(document, "", {}, {}, tuple(faults))
    faults += [document.fault((key,), unknown("unknown key", key, _KEYS)) for key in raw if key not in _KEYS]
    faults += [document.fault((), f"the key {key!r} is missing") for key in _KEYS if key not in raw]
    if "format" in raw and raw["format"] != FORMAT:
        faults.append(document.fault(("format",), f"must be {FORMAT!r}, is {raw['format']!r}"))
    if "version" in raw and (raw["version"] != VERSION or isinstance(raw["version"], bool)):
        faults.append(document.fault(("version",), f"version {raw['version']!r} is not known; this is {VERSION}"))
    scene = raw.get("scene", "")
    if not isinstance(scene, str):
        faults.append(document.fault(("scene",), "must be a text"))
        scene = ""
    landmarks = _entries(document, "landmarks", raw.get("landmarks", []), Landmark, faults)
    objects = _entries(document, "objects", raw.get("objects", []), Object, faults)
    return Source(document, scene, landmarks, objects, tuple(faults))


def format_annotations(annotations: Annotations) -> str:
    """Write annotations as the file's text: two spaces of indent, one key a line, keys in a fixed order."""
    return json.dumps(
        {
            "format": FORMAT,
            "version": VERSION,
            "scene": annotations.scene,
            "landmarks": [entry.model_dump() for entry in annotations.landmarks],
            "objects": [entry.model_dump(exclude_none=True) for entry in annotations.objects],
        },
        indent=2,
        ensure_ascii=False,
    ) + "\n"  # fmt: skip


def write_annotations(annotations: Annotations, path: Path) -> None:
    """Write an annotation file atomically."""
    with atomic_file(path.parent, path.name) as temporary:
        temporary.write_text(format_annotations(annotations), encoding="utf-8")


def _entries(document: Document, key: str, raw: Any, kind: type[_E], faults: list[Fault]) -> dict[int, _E]:
    if not isinstance(raw, list):
        faults.append(document.fault((key,), "must be a list"))
        return {}
    entries: dict[int, _E] = {}
    for i, item in enumerate(raw):
        try:
            entries[i] = kind.model_validate(item)
        except ValidationError as error:
            faults += [document.fault((key, i, *fault.path), fault.message) for fault in faults_of(error, kind)]
    return entries
