"""Find an agent by its name and make it."""

from __future__ import annotations

import importlib
import inspect
import os
import sys
import sysconfig
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import (
    AerialDojoError,
    BeyondBounds,
    Malformed,
    MissingPackage,
    UsageError,
    first_line,
    no_package,
)
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.base.secrets import Secrets
from aerialdojo_gen.benchmark.agents.base import Agent

_HERE = "aerialdojo_gen.benchmark.agents"
# Where the agents of this project are; nothing is imported before one is asked for.
BUILT_IN = {
    "oracle": f"{_HERE}.simple:OracleAgent",
    "random": f"{_HERE}.simple:RandomAgent",
    "stop": f"{_HERE}.simple:StopAgent",
    "constant": f"{_HERE}.simple:ConstantAgent",
    "explorer": f"{_HERE}.explorer:ExplorerAgent",
    "clip": f"{_HERE}.clip_heuristic:ClipHeuristicAgent",
    "openai": "aerialdojo_gen.benchmark.llm.protocols:OpenAIAgent",
    "anthropic": "aerialdojo_gen.benchmark.llm.protocols:AnthropicAgent",
    "policy": "aerialdojo_gen.learning.policy:Policy",
}
_BOOLEANS = {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}
# Where code is that is no agent of a user's.
_LIBRARIES = (
    "<frozen", os.path.join(Path(__file__).parent.parent, ""),
    *(os.path.join(sysconfig.get_path(kind), "") for kind in ("stdlib", "platstdlib", "purelib", "platlib")),
)  # fmt: skip
# The extra whose packages an agent imports.
_EXTRAS = {"openai": "llm", "anthropic": "llm", "policy": "train"}


def agent_class(name: str) -> Callable[..., Any]:
    """Find an agent's class: of `BUILT_IN`, or ``package.module:Class``, installed or in the working directory."""
    where = BUILT_IN.get(name, name)
    module_name, colon, class_name = where.partition(":")
    if not colon or not module_name or not class_name:
        raise UsageError(unknown("no agent", name, BUILT_IN, besides=("or package.module:Class",)))
    if name not in BUILT_IN:
        add_working_directory()
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        if name in _EXTRAS:
            raise MissingPackage(no_package(f"agent {name!r}", error.name, _EXTRAS[name])) from None
        raise UsageError(f"cannot load agent {name!r}: {first_line(error)}") from None
    except AerialDojoError:
        raise
    except Exception as error:
        raise add_traceback(UsageError(f"cannot load agent {name!r}: {error_location(error)}"), error) from error
    cls = getattr(module, class_name, None)
    if cls is None:
        raise UsageError(f"cannot load agent {name!r}: module {module_name} has no {class_name}")
    if not callable(cls):
        raise UsageError(f"cannot load agent {name!r}: {class_name} is no class")
    made: Callable[..., Any] = cls
    return made


def load_agent(name: str, **options: Any) -> Agent:
    """Make an agent by its name, as `agent_class` finds it, with keyword arguments of its class."""
    cls = agent_class(name)
    try:
        inspect.signature(cls).bind(**options)
    except TypeError as error:
        known = ", ".join(inspect.signature(cls).parameters) or "none"
        raise UsageError(f"agent {name!r}: {error}; its options: {known}") from None
    try:
        agent = cls(**options)
    except AerialDojoError:
        raise
    except (TypeError, ValueError) as error:
        raise add_traceback(UsageError(f"agent {name!r}: {first_line(error)}"), error) from error
    except Exception as error:
        raise add_traceback(UsageError(f"agent {name!r} cannot be made: {error_location(error)}"), error) from error
    if not isinstance(agent, Agent):
        raise UsageError(f"{name!r} is no agent: it needs reset(goal) and act(observation)")
    return agent


def read_options(name: str, given: Mapping[str, str]) -> dict[str, Any]:
    """Convert an agent's options from text to the types of their defaults."""
    parameters = inspect.signature(agent_class(name)).parameters
    defaults = {key: parameters[key].default for key in given if key in parameters}
    return {key: _converted(name, key, text, defaults.get(key)) for key, text in given.items()}


def _converted(name: str, option: str, text: str, default: Any) -> Any:
    kinds = ((bool, "true or false"), (int, "a whole number"), (float, "a number"))
    for kind, what in kinds:
        if isinstance(default, kind):
            try:
                return _BOOLEANS[text.strip().lower()] if kind is bool else kind(text)
            except (KeyError, ValueError):
                shown = Secrets().text(text)[:60]
                raise UsageError(
                    f"--option {option}={shown}: agent {name!r} takes {what} here, its default is {default!r}"
                ) from None
    try:
        value: Any = None if text.strip() == "None" else loads_json(text)
    except BeyondBounds as error:
        raise UsageError(f"--option {option}: {error}") from None
    except Malformed:
        return text
    # A name like 007 stays one; a list may be written as JSON, or as the agent reads it.
    fits = str if isinstance(default, str) else str | list if isinstance(default, tuple | list) else object
    return value if isinstance(value, fits) else text


def add_working_directory() -> None:
    """Let modules of the working directory be imported, the last of all, as ``python -m`` does."""
    if "" not in sys.path and os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())


def error_location(error: BaseException) -> str:
    """Say in one line what was raised, and where in the agent's own code: ``KeyError at mine.py:12: 'map'``."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not frame.filename.startswith(_LIBRARIES)] or frames
    where = f" at {Path(own[-1].filename).name}:{own[-1].lineno}" if own else ""
    return f"{type(error).__name__}{where}: {first_line(error)}"


def add_traceback(error: AerialDojoError, cause: BaseException) -> AerialDojoError:
    """Set an agent's own traceback on the error that is made of it: unlike a cause, it is pickled with it."""
    at = cause.__traceback__
    while at is not None and at.tb_frame.f_code.co_filename.startswith(_LIBRARIES):
        at = at.tb_next
    lines = traceback.format_exception(type(cause), cause, at or cause.__traceback__)
    error.traceback = Secrets().text("".join(lines).rstrip())
    return error
