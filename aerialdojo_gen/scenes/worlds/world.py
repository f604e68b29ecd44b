"""A world: generator version, type, seed and knobs, and the side of the splits that its seed is on."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from aerialdojo_gen.base.errors import AssetError

# A generator's version is raised when it gives another plan for a seed: plans of older versions are refused by name.
# Those of the other types are at version 2.
VERSIONS = {
    "D_Earthquake": 3, "D_Explosion": 3, "D_Flood": 3, "I_Bridge": 3, "I_RailCorridor": 3, "N_Island": 4,
    "N_Mountain": 3, "N_Snowfield": 3, "U_Alley": 3, "U_Community": 5, "U_ConstructionSite": 3, "U_Factory": 4,
    "U_Mall": 4, "U_ParkingLot": 5,
}  # fmt: skip
# Seeds of the test and of the validation worlds; all that follow are for training.
TEST_SEEDS, VALIDATION_SEEDS = range(200), range(200, 1000)
MAX_SEED = 2**31 - 1
_NAME = re.compile(r"(?P<type>[UNID]_[A-Za-z]+)-(?P<held>h?)(?P<seed>\d{1,10})")


@dataclass(frozen=True)
class World:
    """What a world is made from."""

    type: str  # ``"U_Mall"``
    seed: int
    knobs: Mapping[str, float] = field(default_factory=dict)  # Those that a user set; the others are drawn
    held_out: bool = False  # Topologies, palettes and props that no other world has
    version: int = 0  # Of its generator: today's where none is given

    def __post_init__(self) -> None:
        """Resolve the version."""
        object.__setattr__(self, "version", self.version or version_of(self.type))

    @property
    def name(self) -> str:
        """Name of its scene: ``U_Mall-1000``, or ``U_Mall-h1000`` of one that is held out."""
        return f"{self.type}-{'h' if self.held_out else ''}{self.seed}"

    @property
    def side(self) -> Literal["test", "validation", "train"]:
        """Side of the splits, by the seed alone."""
        return "test" if self.seed in TEST_SEEDS else "validation" if self.seed in VALIDATION_SEEDS else "train"


def version_of(kind: str) -> int:
    """Today's version of a type's generator."""
    return VERSIONS.get(kind, 2)


def is_world(name: str) -> bool:
    """Whether a scene's name is a world's."""
    return _NAME.fullmatch(name) is not None


def world_of(name: str) -> World:
    """Read a world's name."""
    match = _NAME.fullmatch(name)
    if match is None or int(match["seed"]) > MAX_SEED:
        raise AssetError(f"{name!r} names no world: the form is U_Mall-1000, or U_Mall-h1000 of one that is held out")
    return World(match["type"], int(match["seed"]), held_out=bool(match["held"]))
