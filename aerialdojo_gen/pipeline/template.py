"""A pipeline file to begin with: every key with its meaning, unit, bounds and default as comments."""

from __future__ import annotations

import json
import re
import textwrap
from itertools import groupby
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from aerialdojo_gen.base.config.keys import Key, config_keys, plain, section_meanings
from aerialdojo_gen.base.config.pipeline import Pipeline, load_pipeline
from aerialdojo_gen.base.errors import ConfigError, UsageError
from aerialdojo_gen.base.explain import explain
from aerialdojo_gen.base.shipped import written_path
from aerialdojo_gen.base.text_table import wrapped
from aerialdojo_gen.store.atomic import atomic_write

_WIDTH = 100
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_HEAD = """\
# A pipeline of aerialdojo-gen. A key behind a # has its default: take the # away to set another value.
# In brackets: the unit, what the value must be, and what stands there if nothing is said.
"""


def init_config(path: str | Path, pipeline: str | Path | Pipeline | None = None, *, force: bool = False) -> Path:
    """Write a pipeline file with every key, its unit and its default; the twin of ``aerialdojo-gen config init``.

    Parameters
    ----------
    path : str or Path
        The file, ``NAME.toml``; the pipeline is called by its stem.
    pipeline : str, Path or Pipeline, optional
        A pipeline whose values are taken over; the defaults where absent.
    force : bool
        Whether an existing file is overwritten.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    UsageError
        The file exists, or its name is none that a pipeline may have.
    ConfigError
        `pipeline` is missing or wrong.
    StoreError
        The file cannot be written.
    """
    path = Path(path)
    if path.suffix != ".toml":
        raise UsageError(f"{path}: a pipeline file is called NAME.toml")
    if path.exists() and not force:
        raise UsageError(f"{path} exists: --force overwrites it")
    if not isinstance(pipeline, Pipeline):
        pipeline = Pipeline() if pipeline is None else load_pipeline(pipeline)
    try:
        named = Pipeline.model_validate(pipeline.model_dump(by_alias=True) | {"name": path.stem})
    except ValidationError as error:
        raise ConfigError("; ".join(f"{path}: {line}" for line in explain(error, Pipeline))) from None
    folder = path.absolute().parent
    atomic_write(folder, path.name, pipeline_text(named, folder))
    return path


def pipeline_text(pipeline: Pipeline, folder: Path | None = None) -> str:
    """Write a pipeline as a commented TOML file, from which `load_pipeline` reads an equal one.

    What differs from the defaults is set; every other key is a comment that shows its default, and may lose its #.
    Paths are written relative to `folder`, where the file will lie; absolute where it is not given.
    """
    meanings = section_meanings()
    out = [_HEAD.rstrip("\n")]
    for section, every in groupby(config_keys(pipeline), key=lambda key: key.section.partition(".")[0]):
        keys = list(every)
        if section:
            out += ["", *_comment(meanings[section]), f"[{section}]"]
        for key in keys:
            if key.section == section:
                # A table in a table is written in one line; what its keys mean stands above it.
                within = [inner for inner in keys if inner.section.rstrip("[]") == f"{section}.{key.name}"]
                out += [
                    "",
                    *_comment(_describe(key)),
                    *(line for inner in within for line in _comment(_describe(inner), True)),
                ]
                out += _written(key, folder)
    return "\n".join(out) + "\n"


def _describe(key: Key) -> str:
    """Say what a key means, its unit and what its value must be."""
    words = key.kind if " or " in key.kind else ""
    nothing = "not set" if key.default is None and not key.required else ""
    brackets = "; ".join(filter(None, (key.unit, key.bounds, words, nothing)))
    name = f"{key.name}: " if "." in key.section else ""
    return f"{name}{key.meaning}" + (f" [{brackets}]" if brackets else "")


def _written(key: Key, folder: Path | None) -> list[str]:
    """Write a key, behind a # where it has its default."""
    if key.value is None:
        return [f"#{key.name} ="]
    value = plain(key.value)
    if folder is not None and key.kind == "path":
        value = written_path(value, folder)
    lines = f"{key.name} = {_toml(value)}".split("\n")
    return lines if key.changed or key.name == "name" else [f"#{line}" for line in lines]


def _comment(text: str, within: bool = False) -> list[str]:
    first, next_ = ("#   ", "#     ") if within else ("# ", "# ")
    return textwrap.wrap(text, _WIDTH, initial_indent=first, subsequent_indent=next_)


def _toml(value: Any) -> str:
    """Write a plain value as TOML, tables in one line."""
    if isinstance(value, dict):
        inner = ", ".join(f"{_key_text(key)} = {_toml(one)}" for key, one in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, list):
        many = [_toml(one) for one in value]
        if any(isinstance(one, dict) for one in value):
            return "[\n" + "".join(f"  {one},\n" for one in many) + "]"
        return f"[{', '.join(many)}]"
    # What JSON writes is TOML, but for DEL.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key_text(key: str) -> str:
    return key if _BARE.fullmatch(key) else json.dumps(key)


def key_lines(keys: list[Key], width: int | None = None) -> list[str]:
    """Write keys and their meanings for a terminal of so many columns; a star where the default is another."""
    meanings = section_meanings()
    lines: list[str] = []
    for section, every in groupby(keys, key=lambda key: key.section.partition(".")[0]):
        if section:
            lines += ["", *wrapped(f"[{section}]  {meanings[section]}", width)]
        for key in every:
            lines += _key_lines(key, width)
    if any(line.startswith("*") for line in lines):
        lines += ["", "* another value than the default"]
    return lines[1:] if lines and not lines[0] else lines


def _key_lines(key: Key, width: int | None) -> list[str]:
    inner = "." in key.section
    table = key.kind == "table" and key.value is not None
    # What has no table to stand in has no value either: its default is written.
    value = key.default if inner and key.value is None else key.value
    changed = key.changed and not table and value is key.value
    begin = f"{'*' if changed else ' '} {'  ' if inner else ''}"
    text = begin + key.name
    if not table and not (key.required and value is None):
        text += f" = {_shown(value)}" + (f" {key.unit}" if key.unit and value is not None else "")
    if changed and not (key.required and key.default is None):
        text += f"  (default: {_shown(key.default)})"
    notes = "; ".join(filter(None, (key.bounds, key.kind if " or " in key.kind else "")))
    over = " " * (len(begin) + 4)
    meaning = f"{over}{key.meaning}" + (f" [{notes}]" if notes else "")
    return [*wrapped(text, width, over), *wrapped(meaning, width, over)]


def _shown(value: object) -> str:
    return "not set" if value is None else " ".join(_toml(plain(value)).split())
