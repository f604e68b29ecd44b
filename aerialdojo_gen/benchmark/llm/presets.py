"""Language models by name: options of an agent, as a table."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import unknown


class Preset(BaseModel):
    """A language model, and how it is asked."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str  # What people call it
    paper: bool = False  # Whether it is one of the paper's nine
    served: str  # By whom: vLLM, Ollama, or a vendor
    serve: str | None = None  # A command that serves it on this machine
    agent: Literal["openai", "anthropic"] = "openai"  # ``openai`` or ``anthropic``: the protocol
    options: dict[str, Any]  # Of the agent


@cache
def presets() -> dict[str, Preset]:
    """Return all presets by name, in their order."""
    text = files("aerialdojo_gen.benchmark.llm").joinpath("presets.toml").read_text(encoding="utf-8")
    return {name: Preset.model_validate(value) for name, value in tomllib.loads(text).items()}


def preset(name: str) -> Preset:
    """Find a preset."""
    known = presets()
    if name not in known:
        raise UsageError(unknown("no preset", name, known))
    return known[name]
