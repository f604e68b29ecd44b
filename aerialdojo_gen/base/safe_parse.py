r"""TOML and JSON from outside, parsed within bounds: how large, how deep, how many digits, which characters.

The standard library's parsers take what they are given: ten kilobytes of brackets end in a RecursionError, a dotted
key of 50,000 parts in gigabytes, an integer of 5,000 digits in a ValueError that names no place, and ``"\ud800"``
becomes a string that no file can be written with. Every file, message and answer that this package has not written in
the same process comes through here.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import tomli

from aerialdojo_gen.base.errors import AerialDojoError, BeyondBounds, Malformed, StoreError, check_regular

JsonPath = tuple[str | int, ...]

MAX_DEPTH = 64
MAX_INTEGER = 2**63 - 1
MAX_TOML_BYTES = 4 << 20
MAX_TOML_TEXT = 2000
MAX_JSON_BYTES = 64 << 20
# Integers within MAX_INTEGER have 19, and a float has no more than its precision, its exponent and some zeros.
_MAX_DIGITS = 400

# Of TOML: strings, comments, and what opens, closes or parts; a string without an end is an error for the parser.
_TOML_TOKEN = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*+"{3,5}|'
    r"'''(?:[^']|'(?!''))*+'{3,5}|"
    r'"(?:[^"\\\n]|\\.)*+"|'
    r"'[^'\n]*+'|"
    r"#[^\n]*+|"
    r"(?P<number>[0-9][0-9_]*+)|"
    r"(?P<mark>[\[\]{}.,=\n])|"
    r"""(?P<open>["'])""",
    re.DOTALL,
)
_TOML_TEXT = re.compile(r'"(?:[^"\\\n]|\\.)*+"|' r"'[^'\n]*+'|#[^\n]*+")
_LONG_NUMBER = re.compile(rf"[0-9][0-9_]{{{_MAX_DIGITS}}}")
_NO_BRACKETS = re.compile(r"[^\[\]{}]++")
_JSON_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*+"|(?P<number>[0-9]++)|(?P<mark>[\[\]{}])|(?P<open>")', re.DOTALL)


def read_toml(path: Path, error: type[AerialDojoError] = StoreError, *, finite: bool = True) -> dict[str, Any]:
    """Read a TOML file."""
    text = _text(path, MAX_TOML_BYTES, error)
    try:
        return loads_toml(text, finite=finite)
    except Malformed as fault:
        raise error(f"{path}: {fault}") from None


def loads_toml(text: str, *, finite: bool = True) -> dict[str, Any]:
    """Parse TOML as `read_toml` does; `Malformed` names the place."""
    if not _plain_toml(text):
        _scan(text, _TOML_TOKEN)
    try:
        value = tomli.loads(text)
    except tomli.TOMLDecodeError as error:
        raise Malformed(str(error)) from None
    except (ValueError, OverflowError, RecursionError) as error:
        raise Malformed(f"is no TOML ({error})") from None
    check_value(value, finite=finite, longest=MAX_TOML_TEXT)
    return value


def read_json(path: Path, error: type[AerialDojoError] = StoreError, limit: int = MAX_JSON_BYTES) -> Any:
    """Read a JSON file."""
    text = _text(path, limit, error)
    try:
        return loads_json(text)
    except Malformed as fault:
        raise error(f"{path}: {fault}") from None


def loads_json(text: str | bytes, *, finite: bool = True) -> Any:
    """Parse JSON within bounds."""
    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise Malformed(f"is not UTF-8 (byte {error.start})") from None
    try:
        value = json.loads(text, parse_constant=_no_number if finite else None)
    except json.JSONDecodeError as error:
        raise Malformed(f"line {error.lineno}, column {error.colno}: is not JSON: {error.msg}") from None
    except Malformed:
        raise
    except (RecursionError, ValueError) as error:
        scan_json(text)
        raise Malformed(f"is no JSON that can be read ({error})") from None
    check_value(value, finite=finite)
    return value


def _plain_toml(text: str) -> bool:
    """Whether TOML shows, in a third of `_scan`'s time, that it is within its bounds; False says nothing."""
    if any(mark in text for mark in ('"""', "'''", "\\\n")):
        return False
    bare = _TOML_TEXT.sub("", text)
    if '"' in bare or "'" in bare or _LONG_NUMBER.search(bare):
        return False
    if max(line.count(".") for line in bare.split("\n")) > MAX_DEPTH:
        return False
    # Brackets in pairs go, the innermost first, level by level.
    left = _NO_BRACKETS.sub("", bare)
    for _ in range(MAX_DEPTH - 1):
        before = len(left)
        left = left.replace("[]", "").replace("{}", "")
        if not left or len(left) == before:
            break
    return not left


def scan_json(text: str) -> None:
    """Refuse a text whose brackets or digits are beyond the bounds, without parsing it: `BeyondBounds`."""
    _scan(text, _JSON_TOKEN)


def check_value(value: Any, *, finite: bool = True, longest: int = MAX_JSON_BYTES) -> None:
    """Hold a parsed value against the bounds; `BeyondBounds` names the path of a value that breaks one."""
    found = None if _sound(value, finite, longest) else find_violation(value, finite=finite, longest=longest)
    if found is not None:
        path, why = found
        raise BeyondBounds(f"{_dotted(path)}: {why}" if path else why)


def _sound(value: Any, finite: bool, longest: int) -> bool:
    """Whether nothing is beyond the bounds, faster than to find what is; False says nothing."""
    inner, texts = [value], [""]
    for _ in range(MAX_DEPTH):
        kinds = [type(item) for item in inner]
        held = {kind: [item for item, own in zip(inner, kinds, strict=True) if own is kind] for kind in set(kinds)}
        if any(abs(item) > MAX_INTEGER for item in held.get(int, ())):
            return False
        if finite and not all(map(math.isfinite, held.get(float, ()))):
            return False
        texts += held.get(str, ())
        tables, lists = held.get(dict, []), held.get(list, [])
        texts += [key for table in tables for key in table if type(key) is str]
        inner = [item for table in tables for item in table.values()] + [item for one in lists for item in one]
        if not inner:
            break
    whole = "".join(texts)
    return not inner and max(map(len, texts)) <= longest and whole.isascii() and "\0" not in whole


def find_violation(
    value: Any, *, finite: bool = True, integers: bool = True, longest: int = MAX_JSON_BYTES
) -> tuple[JsonPath, str] | None:
    """Find a value that is beyond the bounds."""
    # Paths are linked backwards: most are never written out.
    stack: list[tuple[Any, Any, int]] = [(value, None, 0)]
    while stack:
        item, path, depth = stack.pop()
        kind, why = type(item), ""
        if kind is str:
            why = _wrong_text(item, longest)
        elif kind is int and integers and not -MAX_INTEGER - 1 <= item <= MAX_INTEGER:
            why = "is an integer beyond 64 bits"
        elif kind is float and finite and not math.isfinite(item):
            why = f"is {item}, no finite number"
        elif kind in (dict, list) and depth >= MAX_DEPTH:
            why = f"is nested more than {MAX_DEPTH} deep"
        elif kind is list:
            stack += [(inner, (path, k), depth + 1) for k, inner in enumerate(item)]
        elif kind is dict:
            stack += [(inner, (path, key), depth + 1) for key, inner in item.items()]
            why = next((f"has a key that {wrong}" for key in item if (wrong := _wrong_text(key, longest))), "")
        if why:
            keys = []
            while path is not None:
                path, key = path
                keys.append(key)
            return tuple(reversed(keys)), why
    return None


def exceeds_depth(value: Any) -> bool:
    """Whether a parsed value is nested more than `MAX_DEPTH` deep; by levels, so that it costs little."""
    level = [value]
    for _ in range(MAX_DEPTH):
        level = [
            inner
            for item in level
            if type(item) in (dict, list)
            for inner in (item.values() if type(item) is dict else item)
            if type(inner) in (dict, list)
        ]
        if not level:
            return False
    return True


def _text(path: Path, limit: int, error: type[AerialDojoError]) -> str:
    try:
        check_regular(path)
        with path.open("rb") as file:
            raw = file.read(limit + 1)
    except FileNotFoundError:
        raise
    except OSError as fault:
        raise error(f"{path}: cannot be read ({fault.strerror})") from None
    if len(raw) > limit:
        raise error(f"{path}: is larger than {limit >> 10:,} KiB")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = raw.count(b"\n", 0, fault.start) + 1
        raise error(f"{path}: line {line}: is not UTF-8: save it in that encoding") from None


def _scan(text: str, token: re.Pattern[str]) -> None:
    """Refuse brackets, dotted keys and numbers beyond the bounds before a parser spends time and memory on them."""
    depth = dots = 0
    for found in token.finditer(text):
        mark = found["mark"]
        why = ""
        if mark is None:
            if found["open"]:
                return  # a string that does not end: the parser says so
            if found["number"] and len(found["number"]) > _MAX_DIGITS:
                why = f"a number of {len(found['number']):,} digits"
        elif mark == ".":
            dots += 1
            why = f"a key of more than {MAX_DEPTH} parts" if dots > MAX_DEPTH else ""
        else:
            dots = 0
            depth += (mark in "[{") - (mark in "]}")
            why = f"nested more than {MAX_DEPTH} deep" if depth > MAX_DEPTH else ""
        if why:
            line = text.count("\n", 0, found.start()) + 1
            column = found.start() - text.rfind("\n", 0, found.start())
            raise BeyondBounds(f"line {line}, column {column}: {why}")


def _no_number(name: str) -> Any:
    raise Malformed(f"is not JSON: {name} is no finite number")


def _wrong_text(text: str, longest: int) -> str:
    if len(text) > longest:
        return f"has {len(text):,} characters, the most is {longest:,}"
    try:
        text.encode()
    except UnicodeEncodeError:
        return "has half a Unicode character (a lone surrogate)"
    return "has a NUL character" if "\0" in text else ""


def _dotted(path: JsonPath) -> str:
    shown = [f"[{k}]" if isinstance(k, int) else f".{k[:40] if k.isprintable() else ascii(k[:40])}" for k in path]
    return "".join(shown if len(shown) <= 12 else [*shown[:10], "..."]).removeprefix(".")
