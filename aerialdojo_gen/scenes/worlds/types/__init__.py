"""The generators, one module a type: each has a function `write` that writes a world's plan into a draft."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from aerialdojo_gen.scenes.worlds.draft import Draft


def generator_of(name: str) -> Callable[[Draft], None]:
    """Look up the generator of a type, ``U_ParkingLot``: `write` of the module ``u_parkinglot``."""
    write: Callable[[Draft], None] = import_module(f"{__name__}.{name.lower()}").write
    return write
