"""From a world to its plan: drawn again until the built scene keeps to what every scene keeps to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import tomli

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.checks import faults
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.plans.build import build_tables
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.kinds import load_type
from aerialdojo_gen.scenes.worlds.world import World, version_of

MAX_DRAWS = 12
MAX_BYTES = 50_000


@dataclass(frozen=True)
class MadeWorld:
    """A world's plan, the scene that it builds, and the draws that were refused before it."""

    world: World
    text: str
    scene: Scene
    topology: str
    refused: tuple[tuple[str, str], ...]  # Reason and what it was about, one a refused draw


def generator_of(name: str) -> Callable[[Draft], None]:
    """Look up the generator of a type, ``U_ParkingLot``: `write` of the module ``u_parkinglot``."""
    write: Callable[[Draft], None] = import_module(f"aerialdojo_gen.scenes.worlds.types.{name.lower()}").write
    return write


def make_world(world: World, scene_assets: Path, catalogue: Catalogue) -> MadeWorld:
    """Write the plan of a world, and build it; the same for the same world on every run.

    Raises
    ------
    AssetError
        The type, a knob or the version of the generator is unknown, or no draw makes a sound scene.
    """
    if world.version != (today := version_of(world.type)):
        raise AssetError(f"{world.name}: generator version {world.version} is not this one's, which is {today}")
    kind = load_type(world.type, scene_assets, catalogue)
    refused: list[tuple[str, str]] = []
    for trial in range(MAX_DRAWS):
        draft = Draft(world, kind, catalogue, trial)
        try:
            generator_of(world.type)(draft)
            if not draft.landmarks:
                raise NoRoomError("no room for a landmark")
            draft.add_life()
        except NoRoomError as error:
            refused.append((str(error), ""))
            continue
        text = draft.text()
        if len(text) > MAX_BYTES:
            refused.append(("plan is too long", f"{len(text):,} bytes"))
            continue
        try:
            scene = build_tables(world.name, tomli.loads(text), catalogue)
        except AssetError as error:
            refused.append(("does not build", str(error)))
            continue
        wrong = next(faults(scene, catalogue), None)
        if wrong is None:
            return MadeWorld(world, text, scene, draft.topology, tuple(refused))
        refused.append(wrong)
    reasons = "; ".join(f"{reason}: {what}" if what else reason for reason, what in sorted(set(refused))[:3])
    raise AssetError(f"{world.name}: none of {MAX_DRAWS} draws makes a sound scene ({reasons}): take another seed")
