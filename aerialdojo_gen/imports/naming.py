"""Names of foreign things: from the words in names of nodes and materials, or the user's own table."""

from __future__ import annotations

import csv
import io
import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import tomli

from aerialdojo_gen.annotations.phrases import group_of
from aerialdojo_gen.base.errors import AssetError, Malformed, brief, check_regular
from aerialdojo_gen.base.safe_parse import loads_toml

_WORDS_FILE = Path(__file__).with_name("words.toml")
_MAX_WORDS = 4
_MAX_LETTERS = 20
_COLUMNS = ("pattern", "name", "category", "plural")
_MAX_BYTES = 4 << 20
# A material that covers this share of a thing says what it is made of.
_MOST = 0.5
# Things of which nobody says what they are made of.
_GROWN = frozenset({"tree", "bush", "hedge", "plant", "flower", "rock", "stone", "boulder", "leaves", "grass"})


@dataclass(frozen=True)
class NodeName:
    """Category and attributes that the name of a node says."""

    category: str  # E.g. ``"fire_engine"``; empty if unknown
    attributes: dict[str, str]


UNNAMED = NodeName("", {})


@dataclass(frozen=True)
class Row:
    """A row of a user's table."""

    pattern: str  # Glob on names of nodes and materials
    name: NodeName
    place: str = ""  # Where it stands: ``"names.csv: line 3"``


@dataclass(frozen=True)
class Naming:
    """A user's table of names."""

    rows: Sequence[Row] = ()

    def name_of(self, node: str, materials: Mapping[str, float] = MappingProxyType({})) -> NodeName:
        """Name a thing by the table, else by the words in the names of its node and its materials (with shares)."""
        entry = self.from_table(node, materials)
        if entry is not UNNAMED:
            return entry
        noun, said = _parse(words_in(node))
        noun = noun or _made_of(materials)
        if noun.rpartition(" ")[2] not in _GROWN:
            made_of = _parse(words_in(_main(materials)))[1]
            said = {key: value for key, value in made_of.items() if key != "size"} | said
        return _node_name(noun, "", "", said)

    def from_table(self, node: str, materials: Mapping[str, float]) -> NodeName:
        """Return the table's name for a node or its main material; `UNNAMED` if it has none."""
        labels = [label for label in (node, _main(materials)) if label]
        fitting = (row.name for row in self.rows if any(fnmatchcase(label, row.pattern) for label in labels))
        return next(fitting, UNNAMED)

    def unused(self, labels: Iterable[str]) -> list[str]:
        """List the rows that fit none of a file's names of nodes and materials, one line each."""
        names = list(labels)
        return [
            f"{row.place}: {brief(row.pattern, 40)!r} fits no node and no material of the file"
            for row in self.rows
            if not any(fnmatchcase(name, row.pattern) for name in names)
        ]


def _main(materials: Mapping[str, float]) -> str:
    """Return the material of most of a thing; empty if there is none."""
    return next((name for name, share in materials.items() if share >= _MOST), "")


@cache
def _lists() -> dict[str, Any]:
    return tomli.loads(_WORDS_FILE.read_text(encoding="utf-8"))


@cache
def word_list(key: str) -> frozenset[str]:
    """Return a list of words."""
    return frozenset(_lists()[key].split())


def words_in(node: str) -> list[str]:
    """List the meaningful words in a name: no numbers, ids, hexadecimal digits or exporter defaults."""
    split = re.sub(r"(?<=[^\W\d_A-Z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][^\W\d_A-Z])", " ", node)
    words = [word for word in map(_word, re.split(r"[\W_]+", split)) if word]
    # Mesh and node often have the same name: "building building".
    words = [word for k, word in enumerate(words) if word not in words[:k]]
    # A cone or a box alone is a primitive of the modeller, a traffic cone and a letter box are none.
    words = words if set(words) - word_list("primitives") else []
    return words[:_MAX_WORDS]


def _word(token: str) -> str:
    stem = re.fullmatch(r"([^\W\d_]{3,})\d{1,4}[A-Za-z]?", token)
    if stem and not re.fullmatch(r"[a-fA-F]+", stem.group(1)):
        token = stem.group(1)  # House03
    word = token.lower()
    plain = _ascii(word)
    if not word.isalpha() or word in word_list("noise") or not 2 <= len(plain) <= _MAX_LETTERS:
        return ""
    if word in word_list("short"):
        return word
    hexadecimal = re.fullmatch(r"[a-f]+", word)
    spoken = len(plain) > 2 and re.search(r"[aeiouy]", plain) and not re.search(r"[^aeiouy]{6}|([a-z])\1\1", plain)
    return word if spoken and not hexadecimal else ""


def _ascii(word: str) -> str:
    """Write a word without accents, and without letters that are not Latin."""
    parts = unicodedata.normalize("NFKD", word.replace("ß", "ss"))
    return "".join(letter for letter in parts if letter.isascii())


def _parse(words: Sequence[str]) -> tuple[str, dict[str, str]]:
    """Tell the noun of a name from its attributes."""
    spelling, materials = _lists()["spelling"], _lists()["materials"]
    kinds = {
        "colour": word_list("colours"), "size": word_list("sizes"), "material": materials,
        "state": word_list("states"),
    }  # fmt: skip
    said, rest = dict[str, str](), list[str]()
    for k, word in enumerate(words):
        spelt = spelling.get(word, word)
        key = next((key for key, vocabulary in kinds.items() if spelt in vocabulary), "")
        shade = [spelling.get(w, w) for w in words[k + 1 : k + 2]]
        if key == "state" and said.get(key) not in (None, "old"):
            continue
        if key:
            said[key] = spelt
        elif word not in ("light", "dark", "pale", "bright") or not word_list("colours").issuperset(shade or [""]):
            rest.append(word)
    noun = [word for word in rest[:-1] if word not in word_list("kinds")] + rest[-1:]
    if not noun and materials.get(said.get("material", "")):
        noun = [materials[said.pop("material")]]
    heads = _lists()["heads"]
    if len(noun) > 1 and noun[0] in heads and noun[-1] in heads[noun[0]].split():
        noun = [*noun[1:], noun[0]]
    return " ".join(noun), said


def _made_of(materials: Mapping[str, float]) -> str:
    """Name a thing by the words in the names of its materials; empty if they say nothing."""
    words = {word for name in materials for word in words_in(name)}
    words |= {a + b for name in materials for a, b in zip(words_in(name), words_in(name)[1:], strict=False)}
    fitting = (rule for rule in _lists()["made_of"] if all(words & set(each.split()) for each in rule["of"]))
    return str(next(fitting, {"noun": ""})["noun"])


def _node_name(name: str, category: str, group: str, attributes: Mapping[str, str]) -> NodeName:
    kind = category or re.sub(r"[^a-z]+", "_", _ascii(name.lower())).strip("_")[:40].strip("_")
    called = {"called": name} if kind and name != kind.replace("_", " ") else {}
    return NodeName(kind, {**attributes, **called, **({"group": group} if group else {})})


def read_names(path: Path) -> Naming:
    """Read a table of names: CSV with the columns ``pattern``, ``name``, ``category`` and ``plural``, or TOML."""
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
    rows = []
    for place, row in _toml_rows(text, path) if path.suffix.lower() == ".toml" else _csv_rows(text, path):
        try:
            rows.append(_row(row, place))
        except ValueError as error:
            raise AssetError(f"{place}: {error}") from None
    return Naming(tuple(rows))


def _csv_rows(text: str, path: Path) -> Iterable[tuple[str, Mapping[str, str]]]:
    reader = csv.DictReader(io.StringIO(text), restkey="", restval="")
    columns = tuple(reader.fieldnames or ())
    unknown = [name for name in columns if name not in _COLUMNS]
    if unknown or not {"pattern", "name"} <= set(columns):
        raise AssetError(f"{path}: line 1 must have the columns pattern, name and optionally category and plural")
    try:
        for row in reader:
            yield f"{path}: line {reader.line_num}", row
    except csv.Error as error:
        raise AssetError(f"{path}: line {reader.line_num}: {error}") from None


def _toml_rows(text: str, path: Path) -> Iterable[tuple[str, Mapping[str, str]]]:
    try:
        table = loads_toml(text)
    except Malformed as fault:
        raise AssetError(f"{path}: {fault}") from None
    for pattern, value in table.items():
        row = value if isinstance(value, dict) else {"name": value}
        if not all(isinstance(v, str) for v in row.values()) or not {"name"} <= row.keys() <= set(_COLUMNS[1:]):
            raise AssetError(
                f"{path}: {brief(pattern, 40)!r} must be a name, or a table of name, category and plural"
            )
        yield str(path), {"pattern": pattern, **row}


def _row(row: Mapping[str, str], place: str) -> Row:
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
    if not category and not _ascii(name):
        raise ValueError(f"name {name[:40]!r} makes no category: give one")
    group = "" if many in ("", "no") else (group_of(name) or "a group of") if many == "yes" else plural
    if group and not re.fullmatch(r"an? [a-z ]+ of", group):
        raise ValueError(f"plural {plural[:40]!r} is neither yes nor words like 'a row of'")
    name = name.lower() if name.isascii() else name
    noun, said = ("", {}) if category else _parse(name.split())
    return Row(pattern, _node_name(noun or name, category, group, said), place)
