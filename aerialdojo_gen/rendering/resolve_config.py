"""The renderer of a stage's section; a module of its own, so that declaring a stage loads no renderer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def resolve_renderer(config: Any, report: Callable[[str], None]) -> Any:
    """Replace ``auto`` by the renderer that works on this machine, and report why."""
    from aerialdojo_gen.rendering.backend import choose_renderer

    choice = choose_renderer(config.renderer)
    report(choice.why)
    return config.model_copy(update={"renderer": choice.name})


def renderer_choices(config: Any) -> list[Any]:
    """Return the possible results of `resolve_renderer`, the fastest renderer first."""
    from aerialdojo_gen.base.config.sections import RENDERERS

    names = RENDERERS if config.renderer == "auto" else (config.renderer,)
    return [config.model_copy(update={"renderer": name}) for name in names]


def unused_renderers(config: Any) -> tuple[str, ...]:
    """Name the modules of the other renderers; none while the section says ``auto``."""
    modules = {
        "gl": ("aerialdojo_gen.rendering.gl", "moderngl"),
        "pybullet": ("aerialdojo_gen.rendering.world", "pybullet"),
    }
    return () if config.renderer == "auto" else sum((v for k, v in modules.items() if k != config.renderer), ())
