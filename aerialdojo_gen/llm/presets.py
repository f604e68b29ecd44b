"""Language models by name: options of an agent, as a table."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.common.names import unknown
from aerialdojo_gen.errors import UsageError


class Preset(BaseModel):
    """A language model, and how it is asked.

    Attributes
    ----------
    title : str
        What people call it.
    paper : bool
        Whether it is one of the paper's nine.
    served : str
        By whom: vLLM, Ollama, or a vendor.
    serve : str or None
        A command that serves it on this machine.
    agent : str
        ``openai`` or ``anthropic``: the protocol.
    options : dict
        Of the agent.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str
    paper: bool = False
    served: str
    serve: str | None = None
    agent: Literal["openai", "anthropic"] = "openai"
    options: dict[str, Any]


@cache
def presets() -> dict[str, Preset]:
    """Return all presets by name, in their order."""
    text = files("aerialdojo_gen.llm").joinpath("presets.toml").read_text(encoding="utf-8")
    return {name: Preset.model_validate(value) for name, value in tomllib.loads(text).items()}


def preset(name: str) -> Preset:
    """Find a preset.

    Raises
    ------
    UsageError
        There is none of the name.
    """
    known = presets()
    if name not in known:
        raise UsageError(unknown("no preset", name, known))
    return known[name]
