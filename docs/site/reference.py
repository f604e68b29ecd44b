"""Pages of reference, written from the program itself: commands, keys of a pipeline file, tables, Python."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import pyarrow as pa
import typer.main

import aerialdojo_gen
from aerialdojo_gen.base.config.keys import Key, config_keys, plain, section_meanings
from aerialdojo_gen.cli.app import app
from aerialdojo_gen.scenes.kit import kit
from aerialdojo_gen.store.layout import LAYOUT

_DOCS = Path(__file__).resolve().parents[1]


def pages() -> dict[str, str]:
    """Return every page as Markdown, by its path below docs/."""
    return {
        "reference/cli.md": cli_page(),
        "reference/config.md": config_page(),
        "reference/tables.md": tables_page(),
        "reference/python.md": python_page(),
        "reference/kit.md": kit_page(),
    }


def cli_page() -> str:
    """Describe every command with its arguments and options."""
    out = [
        "# Commands",
        "",
        "Generated from the commands; `aerialdojo-gen COMMAND --help` prints the same. Data are written to",
        "`--data`, else to `AERIALDOJO_DATA`, else to `data/`. [Exit",
        "codes](../errors.md).",
    ]
    group = typer.main.get_command(app)
    for name, command in _commands(group, ()):
        # What a command says of itself with --help, whatever version of Typer writes it.
        context = command.make_context(f"aerialdojo-gen {name}", [], resilient_parsing=True)
        said = (one.get_help_record(context) for one in command.get_params(context))
        usage = command.get_usage(context).removeprefix("Usage: ")
        out += ["", f"## {name}", "", _prose(command.help or ""), "", "```text", _prose(usage), "```"]
        out += [
            "",
            "| | what it is |",
            "|---|---|",
            *(f"| {_code(left)} | {_cell(right)} |" for left, right in filter(None, said)),
        ]
    return "\n".join(out) + "\n"


def _commands(group: Any, before: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, (*before, name))
        else:
            yield " ".join((*before, name)), command


def config_page() -> str:
    """Describe every key of a pipeline file."""
    meanings = section_meanings()
    out = [
        "# The pipeline file",
        "",
        "One TOML file with one section per stage; a key that does not exist is an error. `aerialdojo-gen",
        "config init NAME.toml` writes a file with all of this as comments, `aerialdojo-gen config show",
        "[STAGE]` prints it with the values of a pipeline. Paths are relative to the file. Contradictions between",
        "sections are errors that name both keys.",
    ]
    # A section's own keys together, then those of the tables in it.
    order = list(dict.fromkeys(key.section for key in config_keys()))
    for section, keys in groupby(
        sorted(config_keys(), key=lambda key: order.index(key.section)), lambda key: key.section
    ):
        depth = section.count(".")
        title = f"`[{section}]`" if section else "The file's own keys"
        out += ["", f"{'##' + '#' * depth} {title}", ""]
        out += [f"{meanings[section]}", ""] if section in meanings else []
        out += ["| key | unit | default | takes | meaning |", "|---|---|---|---|---|"]
        out += [_key(key) for key in keys]
    return "\n".join(out) + "\n"


def _key(key: Key) -> str:
    takes = ", ".join(filter(None, (key.kind, key.bounds)))
    if key.default is None:
        default = "required" if key.required else "not set"
    else:
        default = "see below" if key.kind == "table" or "table" in key.kind.split() else f"`{plain(key.default)!r}`"
    return f"| `{key.name}` | {key.unit} | {_cell(default)} | {_cell(takes)} | {_cell(key.meaning)} |"


def tables_page() -> str:
    """Describe every table with its columns."""
    out = [
        "# Tables",
        "",
        "Every table is a folder of Parquet files. Units and meanings of columns are in the fields'",
        "metadata; this page is generated from them. World: x east, y north, z up, metres; yaw in radians,",
        "counter-clockwise from +x. [The format](../release-format.md) describes the release's tables; the",
        "others are intermediate tables of the stages.",
    ]
    for name, place in LAYOUT.items():
        if name.endswith("/test"):
            continue
        spec = place.spec
        title = name.removesuffix("/train")
        out += [
            "",
            f"## {title}",
            "",
            f"`{place.template}`, by `{place.command}`; key: {', '.join(f'`{k}`' for k in spec.key)}.",
            "",
        ]
        out += ["| column | type | unit | meaning |", "|---|---|---|---|", *map(_column, spec.schema)]
    return "\n".join(out) + "\n"


def _column(field: pa.Field) -> str:
    meta = {k.decode(): v.decode() for k, v in (field.metadata or {}).items()}
    null = ", or null" if field.nullable else ""
    kind = f"list of {field.type.value_type}" if pa.types.is_list(field.type) else str(field.type)
    return f"| `{field.name}` | {kind}{null} | {meta.get('unit', '')} | {_cell(meta.get('meaning', ''))} |"


def python_page() -> str:
    """List the public names, for mkdocstrings to fill in."""
    out = [
        "# Python API",
        "",
        "The names of `aerialdojo_gen.__all__`, and the classes of agents. [In Python](../api.md) has",
        "examples.",
    ]
    homes = {
        **aerialdojo_gen._HOMES,
        "Agent": "aerialdojo_gen.benchmark.agents.base",
        "AgentBase": "aerialdojo_gen.benchmark.agents.base",
    }
    homes |= dict.fromkeys(("Goal", "Rules", "Sensors", "Observation"), "aerialdojo_gen.benchmark.agents.goal")
    homes |= {"read_recording": "aerialdojo_gen.rendering.reader", "Recording": "aerialdojo_gen.rendering.reader"}
    for name, module in homes.items():
        out += ["", f"## {name}", "", f"::: {module}.{name}"]
    return "\n".join(out) + "\n"


def kit_page() -> str:
    """Describe every builder of the kit with its arguments."""
    out = [
        "# The kit",
        "",
        "The builders that [plans](../plans.md) call by name, grouped by what they build. Ground builders are steps",
        "of `[ground]`, part builders stand in `parts`, all others are entries of their own.",
    ]
    found = sorted(kit().values(), key=lambda one: (one.function.__module__, one.name))
    for module, builders in groupby(found, lambda one: one.function.__module__.rpartition(".")[2]):
        pictures = sorted((_DOCS / "gallery").glob(f"kit-{module.replace('_', '-')}*.jpg"))
        out += ["", f"## {module.replace('_', ' ').capitalize()}"]
        for picture in pictures:
            out += ["", f"![Builders with three settings each](../gallery/{picture.name})"]
        for one in builders:
            kind = {"site": "", "ground": " (ground)", "parts": " (parts)"}[one.kind]
            out += ["", f"### {one.name}{kind}", "", _prose(one.summary)]
            out += ["", "| argument | takes | default |", "|---|---|---|"]
            out += [_argument(name, field) for name, field in inspect.signature(one.function).parameters.items()
                    if name in one.arguments.model_fields]  # fmt: skip
    return "\n".join(out) + "\n"


def _argument(name: str, parameter: inspect.Parameter) -> str:
    kind = re.sub(r"Annotated\[([^,]+),.*\]$", r"\1", str(parameter.annotation))
    default = "required" if parameter.default is parameter.empty else f"`{parameter.default!r}`"
    return f"| `{name}` | {_cell(kind)} | {_cell(default)} |"


def _prose(text: str) -> str:
    return " ".join(text.split())


def _code(text: str) -> str:
    return f"`{_prose(text)}`"


def _cell(text: str) -> str:
    """Keep what Markdown would take for its own as it is said; a code span is one already."""
    told = _prose(text)
    if "`" in told:
        return told
    return re.sub(r"([*\[\]|])", r"\\\1", told.replace("<", "&lt;"))
