"""Options of an agent that asks a language model, and presets of models by name."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any, Literal

import tomli
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from aerialdojo_gen.base.names import check_known
from aerialdojo_gen.benchmark.llm.answer import SIXTEEN, ActionSet, eight

View = Literal["front", "left", "right", "down"]
Form = Literal["auto", "json", "tool", "text"]


class Options(BaseModel):
    """Options of a language-model agent; none of them is a secret, keys come from the environment."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, hide_input_in_errors=True)

    model: str = Field(min_length=1)  # Name of the model at the service
    base_url: str | None = None  # Where the service is; the provider's own where absent
    key_env: str | None = Field(default=None, pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")
    temperature: float | None = Field(default=None, ge=0.0, le=2.0)
    max_tokens: int = Field(default=1024, ge=16)  # Most tokens of an answer
    timeout_s: float = Field(default=60.0, gt=0.0)
    request_retries: int = Field(default=3, ge=0, le=10)
    answer: Form = "auto"
    actions: Literal["sixteen", "eight"] = "sixteen"
    move_m: Literal[1, 3, 5] = 1
    climb_m: Literal[1, 2] = 1
    views: tuple[View, ...] = Field(default=("front",), min_length=1)
    depth: bool = True  # Whether their depth is sent too
    image_size_px: int = Field(default=640, ge=32, le=2048)  # Width and height of the pictures
    max_depth_m: float = Field(default=50.0, gt=0.0)  # Depth that is drawn white
    history: int = Field(default=8, ge=0)
    history_images: int = Field(default=1, ge=0, le=20)
    max_pictures: int | None = Field(default=None, ge=2)
    system_role: Literal["system", "developer", "user"] = "system"
    extra_body: dict[str, Any] = {}  # Anything else that the service takes, e.g. ``{"seed": 1}``
    input_usd_per_million: float | None = Field(default=None, ge=0.0)
    output_usd_per_million: float | None = Field(default=None, ge=0.0)
    tokens_per_picture: int | None = Field(default=None, ge=1)

    @field_validator("base_url")
    @classmethod
    def _plain_url(cls, url: str | None) -> str | None:
        if url is not None:
            # What it needs is an extra, and prompts are shown without it.
            from aerialdojo_gen.base.llm_client import check_url

            check_url(url)
        return url

    @field_validator("views", mode="before")
    @classmethod
    def _several(cls, views: Any) -> Any:
        return views.split(",") if isinstance(views, str) else views

    @model_validator(mode="after")
    def _few_pictures(self) -> Options:
        n = self.pictures
        if self.max_pictures is not None and n > self.max_pictures:
            raise ValueError(
                f"a request of an image goal has {n} pictures, more than max_pictures = {self.max_pictures}: "
                "fewer views or history_images, or depth = false"
            )
        return self

    @property
    def pictures(self) -> int:
        """Pictures of a request, at most: the goal's, past ones, and what is seen now."""
        return 1 + self.history_images + len(self.views) * (2 if self.depth else 1)

    @property
    def action_set(self) -> ActionSet:
        """What the model may choose from."""
        return SIXTEEN if self.actions == "sixteen" else eight(self.move_m, self.climb_m)

    @property
    def priced(self) -> bool:
        """Whether both prices are known."""
        return self.input_usd_per_million is not None and self.output_usd_per_million is not None

    def cost_usd(self, input_tokens: float | None, output_tokens: float | None) -> float | None:
        """Return what tokens cost, US dollars; None where counts or prices are not known."""
        prices = self.input_usd_per_million, self.output_usd_per_million
        if input_tokens is None or output_tokens is None or prices[0] is None or prices[1] is None:
            return None
        return (input_tokens * prices[0] + output_tokens * prices[1]) / 1e6


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
    return {name: Preset.model_validate(value) for name, value in tomli.loads(text).items()}


def preset(name: str) -> Preset:
    """Find a preset."""
    check_known("no preset", [name], presets())
    return presets()[name]
