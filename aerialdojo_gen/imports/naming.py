"""Names of foreign nodes: meaningful words, or the user's own table."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from aerialdojo_gen.annotations.phrases import group_of
from aerialdojo_gen.base.errors import AssetError, check_regular

# Words of exporters and defaults that mean nothing.
_NOISE = frozenset({
    "api", "asset", "body", "box", "brep", "capsule", "circle", "clone", "col", "collada", "collider", "collision",
    "component", "cone", "copy", "cube", "curve", "cylinder", "default", "dummy", "dup", "duplicate", "elem",
    "element", "empty", "entity", "export", "exported", "face", "faces", "fbx", "feature", "fragment", "geo",
    "geom", "geometry", "glb", "gltf", "grid", "group", "grp", "guid", "helper", "high", "icosphere", "id",
    "import", "imported", "instance", "item", "layer", "line", "lod", "lods", "low", "mat", "material", "max",
    "mesh", "meshes", "model", "msh", "nan", "new", "node", "nodes", "none", "null", "nurbs", "obj", "object",
    "objects", "osgb", "osm", "part", "parts", "piece", "placeholder", "plane", "poly", "polygon", "polysurface",
    "prefab", "prim", "primitive", "proxy", "ref", "relation", "root", "rotation", "scan", "scene", "set", "shape",
    "shell", "skeleton", "sketchup", "skp", "solid", "sphere", "static", "sub", "submesh", "surface", "suzanne",
    "temp", "test", "tmp", "torus", "transform", "tri", "triangle", "ucx", "undefined", "unknown", "unnamed",
    "untitled", "uuid", "uv", "vert", "visual", "volume", "way", "world", "xform",
})  # fmt: skip
# Words that could be hexadecimal.
_HEX_WORDS = frozenset({"bed", "cab", "cafe", "facade", "facades", "beds", "cabs", "cafes"})
_SHORT = frozenset({"atm", "bus", "gym", "hut", "van", "tv", "spa", "shrub", "sky", "crypt", "gypsum"})
_MAX_WORDS = 4
_MAX_LETTERS = 18
_COLUMNS = ("pattern", "name", "category", "plural")
_MAX_BYTES = 4 << 20


@dataclass(frozen=True)
class NodeName:
    """Category and naming attributes of a node."""

    category: str  # E.g. ``"fire_engine"``; empty if unknown
    attributes: dict[str, str]


UNNAMED = NodeName("", {})


@dataclass(frozen=True)
class Naming:
    """A user's table of node name patterns."""

    rows: Sequence[tuple[str, NodeName]] = ()  # glob, name

    def name_of(self, node: str) -> NodeName:
        """Return the name of a node: from the table, else from the words in its name."""
        entry = self.from_table(node)
        words = words_in(node)
        return entry if entry is not UNNAMED else _node_name(" ".join(words), "", "") if words else UNNAMED

    def from_table(self, node: str) -> NodeName:
        """Return the table's name for a node; `UNNAMED` if it has none."""
        return next((name for pattern, name in self.rows if fnmatchcase(node, pattern)), UNNAMED)


def words_in(node: str) -> list[str]:
    """List the meaningful words in a node's name: no numbers, ids, hexadecimal digits or exporter defaults."""
    split = re.sub(r"([a-z])([A-Z])", r"\1 \2", node)
    tokens = [token for token in re.split(r"[^A-Za-z0-9]+", split) if token]
    words = [word for word in map(_word, tokens) if word]
    # Mesh and node often have the same name: "building building".
    words = [word for k, word in enumerate(words) if word not in words[:k]]
    return words[:_MAX_WORDS]


def _word(token: str) -> str:
    stem = re.fullmatch(r"([A-Za-z]{3,})\d{1,4}", token)
    if stem and not re.fullmatch(r"[a-fA-F]+", stem.group(1)):
        token = stem.group(1)  # House03
    word = token.lower()
    if not word.isalpha() or word in _NOISE or not 2 <= len(word) <= _MAX_LETTERS:
        return ""
    if word in _SHORT or word in _HEX_WORDS:
        return word
    hexadecimal = re.fullmatch(r"[a-f]+", word)
    spoken = len(word) > 2 and re.search(r"[aeiouy]", word) and not re.search(r"[^aeiouy]{5}|([a-z])\1\1", word)
    return word if spoken and not hexadecimal else ""


def _node_name(name: str, category: str, group: str) -> NodeName:
    kind = category or re.sub(r"[^a-z]+", "_", name.lower()).strip("_")[:40].strip("_")
    attributes = {"called": name} if name and name != kind.replace("_", " ") else {}
    return NodeName(kind, attributes | ({"group": group} if group else {}))


def read_names(path: Path) -> Naming:
    """Read a table of names: CSV with the columns ``pattern``, ``name``, ``category`` and ``plural``.

    A pattern is a glob on the file's node names, case and all. ``name`` is what a person says; ``category`` its kind,
    made of the name where empty; ``plural`` is ``yes`` where the name is of many ("leaves"), or the words that make
    one thing of them ("a row of"), and may be left out, as may ``category``.
    """
    try:
        check_regular(path)
        raw = path.read_bytes()[: _MAX_BYTES + 1]
        text = raw.decode("utf-8-sig")
    except OSError as error:
        raise AssetError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise AssetError(f"{path}: is not UTF-8") from None
    if len(raw) > _MAX_BYTES:
        raise AssetError(f"{path}: larger than {_MAX_BYTES >> 20} MiB")
    reader = csv.DictReader(io.StringIO(text), restkey="", restval="")
    columns = tuple(reader.fieldnames or ())
    unknown = [name for name in columns if name not in _COLUMNS]
    if unknown or not {"pattern", "name"} <= set(columns):
        raise AssetError(f"{path}: line 1 must have the columns pattern, name and optionally category and plural")
    rows = []
    try:
        for row in reader:
            rows.append(_row(row))
    except (csv.Error, ValueError) as error:
        raise AssetError(f"{path}: line {reader.line_num}: {error}") from None
    return Naming(tuple(rows))


def _row(row: dict[str, str]) -> tuple[str, NodeName]:
    if row.get(""):
        raise ValueError("has more fields than columns")
    pattern, name, category, plural = ((row.get(key) or "").strip() for key in _COLUMNS)
    name, many = " ".join(name.split()), plural.lower()
    if not pattern:
        raise ValueError("has no pattern")
    if not re.fullmatch(r"[^\W\d_]+(?:[ '-][^\W\d_]+)*", name) or len(name) > 60:
        raise ValueError(f"name {name[:40]!r} must be letters, spaces and hyphens")
    if category and not re.fullmatch(r"[a-z]+(?:_[a-z]+)*", category):
        raise ValueError(f"category {category[:40]!r} must be lower-case words joined by _")
    if not category and not re.search(r"[A-Za-z]", name):
        raise ValueError(f"name {name[:40]!r} makes no category: give one")
    group = "" if many in ("", "no") else (group_of(name) or "a group of") if many == "yes" else plural
    if group and not re.fullmatch(r"an? [a-z ]+ of", group):
        raise ValueError(f"plural {plural[:40]!r} is neither yes nor words like 'a row of'")
    return pattern, _node_name(name.lower() if name.isascii() else name, category, group)
