"""Which renderer a stage's section settles for; by itself, so that who only asks for that loads no renderer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def settle_renderer(config: Any, say: Callable[[str], None]) -> Any:
    """Put what draws right on this machine in the place of ``auto``, and say why."""
    from aerialdojo_gen.rendering.backend import choose_renderer

    choice = choose_renderer(config.renderer)
    say(choice.why)
    return config.model_copy(update={"renderer": choice.name})


def renderer_choices(config: Any) -> list[Any]:
    """Return what `settle_renderer` may make of a section, the fastest renderer first."""
    from aerialdojo_gen.base.config.sections import RENDERERS

    names = RENDERERS if config.renderer == "auto" else (config.renderer,)
    return [config.model_copy(update={"renderer": name}) for name in names]


def idle_renderers(config: Any) -> tuple[str, ...]:
    """Name what the other renderer draws with; nothing before a section has settled for one."""
    drawers = {
        "gl": ("aerialdojo_gen.rendering.gl", "moderngl"),
        "pybullet": ("aerialdojo_gen.rendering.world", "pybullet"),
    }
    return () if config.renderer == "auto" else sum((v for k, v in drawers.items() if k != config.renderer), ())
