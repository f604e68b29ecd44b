"""The annotation file: a versioned JSON format, written so that diffs are small (see annotations/README.md).

It is read with the line of every value, so that faults are named by path and line.
"""

from __future__ import annotations

import json
import json.scanner
import re
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

from pydantic import BaseModel, ConfigDict, Field, StrictFloat, StrictInt, StrictStr, ValidationError

from aerialdojo_gen.base.errors import BeyondBounds, brief
from aerialdojo_gen.base.explain import faults_of
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.safe_parse import JsonPath, find_violation, scan_json
from aerialdojo_gen.store.atomic import atomic_write

FORMAT = "aerialdojo-annotations"
VERSION = 1

_KEYS = ("format", "version", "scene", "landmarks", "objects")
_Id = Annotated[StrictInt, Field(ge=0, le=2**31 - 1)]
_Finite = Annotated[StrictFloat, Field(allow_inf_nan=False)]
MAX_VALUES = 200_000
_HALF = re.compile("[\ud800-\udfff]")


@dataclass(frozen=True)
class Fault:
    """A fault in an annotation file."""

    line: int  # 1-based; 0 if unknown
    path: str  # JSON path, e.g. ``"objects[3].node"``; empty for the file itself
    message: str  # What is wrong, and a suggestion if there is one

    def __str__(self) -> str:
        where = f"line {self.line}: " if self.line else ""
        return f"{where}{brief(self.path) + ': ' if self.path else ''}{brief(self.message)}"


@dataclass(frozen=True)
class Document:
    """A parsed JSON text."""

    value: Any  # What `json.loads` would return; None where the text is not JSON
    lines: dict[JsonPath, int]  # Line of every value, counted from 1; the path ``()`` is the whole document
    faults: tuple[Fault, ...]  # Syntax error, or duplicate keys

    def fault(self, path: JsonPath, message: str) -> Fault:
        """Make a fault at a path, or at its nearest existing ancestor."""
        known = path
        while known and known not in self.lines:
            known = known[:-1]
        return Fault(self.lines.get(known, 0), dotted(path), message)


def dotted(path: JsonPath) -> str:
    """Write a path as ``objects[3].node``."""
    text = ""
    for key in path:
        text += f"[{key}]" if isinstance(key, int) else f".{key}"
    return text.removeprefix(".")


@dataclass(frozen=True)
class _Located:
    value: Any
    offset: int


class _Decoder(json.JSONDecoder):
    """The standard library's decoder, in its Python form, keeping the offset of every value."""

    def __init__(self) -> None:
        super().__init__(object_pairs_hook=_Pairs)
        scan: Callable[[str, int], tuple[Any, int]]

        def located(text: str, start: int) -> tuple[_Located, int]:
            value, end = scan(text, start)
            return _Located(value, start), end

        # The scanner passes its inner function to these two: replace it by ours.
        module = cast(Any, json.decoder)
        vars(self)["parse_object"] = lambda at, strict, _, *rest: module.JSONObject(at, strict, located, *rest)
        vars(self)["parse_array"] = lambda at, _: module.JSONArray(at, located)
        scan = cast(Any, json.scanner).py_make_scanner(self)
        vars(self)["scan_once"] = located


class _Pairs(list[tuple[str, _Located]]):
    """Keys and values of an object, in order, with duplicates."""


def read_json(text: str) -> Document:
    """Parse a JSON text and record the line of every value."""
    if text.count(",") + text.count("[") + text.count("{") > MAX_VALUES:
        return Document(None, {}, (Fault(0, "", f"holds more than {MAX_VALUES} values"),))
    try:
        scan_json(text)
        root = cast(_Located, _Decoder().decode(text))
    except json.JSONDecodeError as error:
        return Document(None, {}, (Fault(error.lineno, "", f"not JSON: {error.msg} (column {error.colno})"),))
    except BeyondBounds as error:
        return Document(None, {}, (Fault(0, "", str(error)),))
    except (RecursionError, ValueError) as error:
        return Document(None, {}, (Fault(0, "", f"not readable as JSON: {error}"),))
    starts = [i for i, c in enumerate(text) if c == "\n"]
    lines: dict[JsonPath, int] = {}
    faults: list[Fault] = []
    value = _unwrap(root, (), starts, lines, faults)
    found = find_violation(value, finite=False, integers=False)
    if found is not None:
        # Such texts can be neither shown nor written: use nothing of the file.
        path, why = found
        return Document(None, lines, (Document(None, lines, ()).fault(path, why),))
    return Document(value, lines, tuple(faults))


def _unwrap(
    node: _Located, path: JsonPath, newlines: list[int], lines: dict[JsonPath, int], faults: list[Fault]
) -> Any:
    lines[path] = bisect_left(newlines, node.offset) + 1
    if isinstance(node.value, _Pairs):
        plain: dict[str, Any] = {}
        for raw, child in node.value:
            key = _clean_text(raw, path, lines, faults)
            inner = _unwrap(child, (*path, key), newlines, lines, faults)
            if key in plain:
                fault = Fault(lines[*path, key], dotted((*path, key)), f"the key {key!r} occurs twice in one object")
                faults.append(fault)
            plain[key] = inner
        return plain
    if isinstance(node.value, list):
        return [_unwrap(child, (*path, i), newlines, lines, faults) for i, child in enumerate(node.value)]
    return _clean_text(node.value, path, lines, faults) if isinstance(node.value, str) else node.value


def _clean_text(text: str, path: JsonPath, lines: dict[JsonPath, int], faults: list[Fault]) -> str:
    """Replace half surrogate pairs, which JSON can encode and UTF-8 cannot."""
    half = _HALF.search(text)
    if half is None:
        return text
    faults.append(
        Fault(lines[path], dotted(path), f"\\u{ord(half[0]):04x} is half of a surrogate pair: no character")
    )
    return _HALF.sub("\N{REPLACEMENT CHARACTER}", text)


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
    atomic_write(path.parent, path.name, format_annotations(annotations))


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
