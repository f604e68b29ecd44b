"""Mutants of valid inputs: of their bytes, and of the values that stand in them.

A mutant is a pure function of the input and a generator, so that a campaign's number names it.
"""

from __future__ import annotations

import io
import json
import math
import re
import struct
import tomllib
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

Rng = np.random.Generator


class Raw(str):
    """Text that stands in the file as it is."""


NUMBERS: tuple[Any, ...] = (
    0, -1, 1, 2, 3, 7, 1.5, -0.0, 1e-9, -1e-300, 5e-324, 0.999999, 360, 1000, 65535, 65536, 2_000_000, 100_000_000,
    -(10**9), 2**31 - 1, 2**31, 2**32, 2**53 + 1, 2**63 - 1, 2**63, 2**64, -(2**63) - 1, 10**30, 10**300, 1e16,
    1e38,
    1e39, 1e200, 1.7976931348623157e308, math.nan, math.inf, -math.inf, Raw("1" * 5000), Raw("1e999"),
    Raw("-" + "9" * 400),
)  # fmt: skip
TEXTS: tuple[str, ...] = (
    "", " ", "\0", "a\0b", "\ud800", "x\udfff", "\U0001f600", "\u202e", "\n", "\x1b[31m", "a" * 10_000,
    "../../../etc/passwd",
    "/dev/zero", ".", "..", "nan", "inf", "1/0", "9*" * 200 + "9", "((((((" * 40, "-" * 3000 + "1",
    "1e308*1e308", "sqrt(-1)",
    "2**9999999", "round(1e400)", "min()", "max(1)", "round(1,2,3)", "1" * 5000, "1j", "height",
    "__import__('os')", "{}",
    "%s%n", "#12345", "#zzzzzz", "null", "x" * 200 + ":#ffffff", "0x10", "tan(90)", "floor(1e300)", "é" * 300,
)  # fmt: skip


def mutant(name: str, raw: bytes, rng: Rng) -> bytes:
    """Make a mutant of a valid file, whose suffix says what stands in it."""
    structured = _STRUCTURED.get(name.rpartition(".")[2])
    if structured is not None and rng.random() < 0.7:
        out = structured(raw, rng)
        return out if rng.random() < 0.9 else scrambled(out, rng)
    return scrambled(raw, rng)


def scrambled(raw: bytes, rng: Rng) -> bytes:
    """Flip, cut, double, move and overwrite bytes."""
    data = bytearray(raw)
    for _ in range(int(rng.integers(1, 7)) if rng.random() < 0.6 else 1):
        n = len(data)
        at = int(rng.integers(n + 1))
        size = int(min(n - at, 2 ** rng.integers(0, 12)))
        match int(rng.integers(9)):
            case 0 | 1 if n > at:
                data[at] ^= 1 << int(rng.integers(8))
            case 2 if n > at:
                data[at] = int(rng.integers(256))
            case 3:
                del data[at : at + size]
            case 4:
                data[at:at] = data[at : at + size] * int(rng.integers(1, 5))
            case 5:
                del data[at:]
            case 6:
                data[at : at + size] = bytes([int(rng.choice([0, 255, 32, 48, 91, 34]))]) * size
            case 7:
                data[at:at] = _SNIPPETS[int(rng.integers(len(_SNIPPETS)))]
            case _:
                data = bytearray(_number_replaced(bytes(data), rng))
    return bytes(data)


_SNIPPETS = (
    b"[" * 100_000, b"{" * 2000, b'{"a":' * 5000, b"a." * 50_000, b"\xff\xfe", b"\xef\xbb\xbf", b"\0", b'"',
    b"'''", b'"""', b"\\",
    b"\\ud800", b"9" * 5000, b"nan", b"-inf", b"1e999", b"]", b"}", b"\n", b"\r", b"#", b"=", b",", b"null",
    b"\xed\xa0\x80",
    b"-1", b"/", b"0" * 400, b"e" * 30, b"\x7f\xff\xff\xff", b"\xff\xff\xff\xff",
)  # fmt: skip
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def _number_replaced(raw: bytes, rng: Rng) -> bytes:
    found = list(_NUMBER.finditer(raw))
    if not found:
        return raw
    one = found[int(rng.integers(len(found)))]
    return raw[: one.start()] + _dumped(NUMBERS[int(rng.integers(len(NUMBERS)))]).encode() + raw[one.end() :]


def changed(value: Any, rng: Rng, nothing: bool = True) -> Any:
    """Change a parsed value in one to four places; `nothing` says whether there is a null."""
    box = [value]
    for _ in range(int(rng.choice([1, 1, 1, 2, 3, 4]))):
        places = list(_places(box))
        holder, key = places[int(rng.integers(len(places)))]
        old = holder[key]
        match int(rng.integers(14)):
            case 0 | 1 | 2:
                holder[key] = _other(old, rng, nothing)
            case 3 | 4:
                holder[key] = _pick(NUMBERS, rng)
            case 5 | 6:
                holder[key] = _pick(TEXTS, rng)
            case 7 if holder is not box:
                del holder[key]
            case 8 if isinstance(holder, dict):
                names = [_pick(TEXTS, rng), *holder, "name", "at", "x"]
                holder[names[int(rng.integers(len(names)))]] = holder.pop(key)
            case 9:
                other, place = places[int(rng.integers(len(places)))]
                holder[key] = json.loads(json.dumps(other[place], default=str)) if not _raw_in(other[place]) else 1
            case 10:
                depth = int(rng.choice([1, 2, 40, 63, 64, 70, 400, 50_000]))
                holder[key] = Raw("[" * depth + _dumped(1) + "]" * depth)
            case 11 if isinstance(old, list):
                old += old[: int(rng.integers(1, 30))] * int(rng.choice([1, 1, 2, 200])) if old else [1]
            case 12 if isinstance(old, int | float) and not isinstance(old, bool):
                holder[key] = old * _pick((-1, 10, 1000, 1e9, 1e-9), rng)
            case 13 if isinstance(old, str) and old:
                at = int(rng.integers(len(old)))
                holder[key] = old[:at] + _pick(TEXTS, rng) + old[at:]
            case _:
                holder[key] = _pick(
                    (True, False, [], {}, [[]], [{}], {"a": 1}, {"": []}, [1, 2], [1, 2, 3], "a"), rng
                )
    return box[0]


def _pick(choices: tuple[Any, ...], rng: Rng) -> Any:
    return choices[int(rng.integers(len(choices)))]


def _other(old: Any, rng: Rng, nothing: bool) -> Any:
    """The same thing as another type."""
    forms: list[Any] = [[old], {"a": old}, str(old)[:200], not old, *([None] if nothing else [])]
    if isinstance(old, list):
        forms += [{str(k): v for k, v in enumerate(old)}, old[0] if old else 0, old[::-1], old[:-1]]
    if isinstance(old, dict):
        forms += [[*old.values()], [*old]]
    if isinstance(old, int | float) and math.isfinite(old):
        forms += [int(old), float(old), -old, old + 0.5]
    return forms[int(rng.integers(len(forms)))]


def _places(value: Any) -> Any:
    stack = [value]
    while stack:
        holder = stack.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        for key in keys:
            yield holder, key
            if isinstance(holder[key], dict | list):
                stack.append(holder[key])


def _raw_in(value: Any) -> bool:
    return any(isinstance(holder[key], Raw) for holder, key in _places([value]))


def _dumped(value: Any, equals: str = ": ") -> str:
    """JSON, or a value of TOML, whose keys are followed by " = "; also with what these have not."""
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(str(k))}{equals}{_dumped(v, equals)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_dumped(v, equals) for v in value) + "]"
    if equals == " = " and (value is None or (isinstance(value, float) and not math.isfinite(value))):
        return '"None"' if value is None else str(value)
    return json.dumps(value) if isinstance(value, str | int | float | None) else json.dumps(str(value))


def toml_dumped(value: Any) -> str:
    """TOML, all tables below the first two levels inline."""
    if not isinstance(value, dict):
        return _dumped(value, " = ")

    def lines(table: dict[Any, Any]) -> list[str]:
        return [f"{json.dumps(str(k))} = {_dumped(v, ' = ')}" for k, v in table.items()]

    tables = {k: v for k, v in value.items() if isinstance(v, dict)}
    plain = lines({k: v for k, v in value.items() if k not in tables})
    return "\n".join([*plain, *("\n".join([f"[{json.dumps(str(k))}]", *lines(v)]) for k, v in tables.items())]) + "\n"


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


def _json(raw: bytes, rng: Rng) -> bytes:
    return _encoded(_dumped(changed(json.loads(raw), rng)))


def _jsonl(raw: bytes, rng: Rng) -> bytes:
    lines = raw.splitlines(keepends=True)
    k = int(rng.integers(len(lines)))
    lines[k] = _json(lines[k], rng) + b"\n"
    return b"".join(lines)


def _toml(raw: bytes, rng: Rng) -> bytes:
    return _encoded(toml_dumped(changed(tomllib.loads(raw.decode()), rng, nothing=False)))


def _glb(raw: bytes, rng: Rng) -> bytes:
    (length,) = struct.unpack_from("<I", raw, 12)
    head, body = raw[20 : 20 + length], raw[20 + length :]
    if rng.random() < 0.8:
        head = _json(head, rng)
    else:
        body = body[:8] + scrambled(body[8:], rng)
        body = struct.pack("<I", len(body) - 8) + body[4:] if len(body) > 8 else body
    head += b" " * (-len(head) % 4)
    return raw[:8] + struct.pack("<III", 20 + len(head) + len(body), len(head), 0x4E4F534A) + head + body


def _parquet(raw: bytes, rng: Rng) -> bytes:
    """Another table under the same name, or the same with another footer."""
    table = pq.read_table(io.BytesIO(raw))
    meta = dict(table.schema.metadata or {})
    k = int(rng.integers(table.num_columns))
    name = table.column_names[k]
    match int(rng.integers(6)):
        case 0 | 1 | 2 if b"aerialdojo" in meta:
            meta[b"aerialdojo"] = _json(meta[b"aerialdojo"], rng)
        case 3:
            table = table.drop_columns([name])
        case 4:
            table = table.set_column(k, name, pa.nulls(table.num_rows, table.schema.types[k]))
        case _:
            strange = pa.array([["x"], None] * table.num_rows)[: table.num_rows]
            table = table.set_column(k, _pick((name, "other", name * 500), rng), strange)
    sink = io.BytesIO()
    pq.write_table(table.replace_schema_metadata(meta), sink, write_page_checksum=True)
    return sink.getvalue()


_STRUCTURED: dict[str, Callable[[bytes, Rng], bytes]] = {
    "json": _json, "jsonl": _jsonl, "toml": _toml, "glb": _glb, "parquet": _parquet,
}  # fmt: skip
