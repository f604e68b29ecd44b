"""The twin of ``vary``: worlds of a scene type as plans, drafted annotations and a pipeline, in a project folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pyarrow as pa
import pyarrow.csv

from aerialdojo_gen.annotations.draft import DraftOptions
from aerialdojo_gen.base.config.pipeline import load_pipeline
from aerialdojo_gen.base.errors import AerialDojoError, AssetError, UsageError
from aerialdojo_gen.base.names import choose_scenes
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.base.shipped import home
from aerialdojo_gen.imports.drafting import draft_scene
from aerialdojo_gen.imports.project import PIPELINE, make_project
from aerialdojo_gen.pipeline.code_digest import stage_code
from aerialdojo_gen.pipeline.executors.base import SharedPaths, make_executor
from aerialdojo_gen.pipeline.freshness import scene_fingerprint
from aerialdojo_gen.pipeline.interrupt import Interrupts
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.pipeline.stage import Job, ProjectPaths
from aerialdojo_gen.pipeline.task import Task, compute
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.worlds.kinds import type_names
from aerialdojo_gen.scenes.worlds.make import make_world
from aerialdojo_gen.scenes.worlds.world import MAX_SEED, World
from aerialdojo_gen.store.atomic import atomic_file, atomic_write
from aerialdojo_gen.store.root import open_root

DATA = "data"
DRAWS = "draws.csv"
_BUILD = BY_NAME["build-scenes"]
_MAX_WORLDS = 100_000
_MEMORY_MB = 1500
_COLUMNS = ("world", "draw", "reason", "what")


@dataclass(frozen=True)
class VariedWorld:
    """A world that was written, or that stood there already."""

    name: str
    made: bool  # False where its plan and annotations were there
    refused: tuple[tuple[str, str], ...] = ()  # Reason and what it was about, one a refused draw


@dataclass(frozen=True)
class VaryOptions:
    """What all worlds of a call have in common."""

    knobs: Mapping[str, float]
    held_out: bool = False
    n_objects: int = 40  # Most annotated objects of a world


def vary(
    types: Sequence[str], seeds: range, project: Path, options: VaryOptions | None = None, *,
    workers: int | None = 1, executor: str = "local", address: str | None = None,
    on_done: Callable[[VariedWorld], object] = lambda done: None,
) -> list[VariedWorld]:  # fmt: skip
    """Write the worlds of some types (names or globs) and seeds; those that are there already stay.

    `project` gets ``scenes/``, ``annotations/``, ``pipeline.toml``, ``draws.csv``, the table of refused draws, and in
    ``data/`` the meshes, as `build-scenes` writes them. Its path is shared by all machines of a Ray cluster.
    """
    options = options or VaryOptions({})
    names = choose_scenes(list(types), type_names(home() / "scene_assets"), "type")
    if (n := count(names, seeds)) > _MAX_WORLDS:
        raise UsageError(f"{n:,} worlds are asked for, at most {_MAX_WORLDS:,} are made at once")
    worlds = [World(name, seed, options.knobs, options.held_out) for name in names for seed in seeds]
    names_of = {world.name: k for k, world in enumerate(worlds)}
    make_project(project)
    project = project.resolve()
    done: list[VariedWorld] = []
    work = [_Work(world, project, options) for world in worlds]
    try:
        pool_of_run = make_executor(executor, workers, address, SharedPaths(shared=(project,), written=(project,)))
        with open_root(project / DATA).lock(), Interrupts() as interrupts, pool_of_run as pool:
            # A process stays with a type, whose things it has measured.
            for one in pool.map(_write_world, work, lambda one: one.world.type, memory_mb=_MEMORY_MB):
                interrupts.check()
                if isinstance(one, AerialDojoError):
                    raise one
                done.append(one)
                on_done(one)
    finally:
        _write_draws(project, done)
    return sorted(done, key=lambda one: names_of[one.name])


def count(types: Sequence[str], seeds: range) -> int:
    """Count the worlds of some types and seeds."""
    if not seeds or seeds[0] < 0 or seeds[-1] > MAX_SEED:
        raise UsageError(f"--seeds: expected FIRST:END from 0 to {MAX_SEED:,}, END not included, such as 1000:1010")
    return len(seeds) * len(choose_scenes(list(types), type_names(home() / "scene_assets"), "type"))


@dataclass(frozen=True)
class _Work:
    """A world to make."""

    world: World
    project: Path
    options: VaryOptions

    @property
    def label(self) -> str:
        """Its name in messages."""
        return self.world.name


def _write_world(work: _Work) -> VariedWorld:
    world, project, options = work.world, work.project, work.options
    plan, annotations = project / "scenes" / f"{world.name}.toml", project / "annotations" / f"{world.name}.json"
    if plan.exists() and annotations.exists():
        _check_same(world, plan)
        return VariedWorld(world.name, made=False)
    # Digest the code now, as loaded: edits while the world is made make its mesh stale.
    stage_code(_BUILD.name)
    made = make_world(world, home() / "scene_assets", _catalogue())
    atomic_write(project, f"scenes/{world.name}.toml", made.text)
    pipeline = _pipeline(project / PIPELINE)
    folders = (home() / "scene_assets", project / "scenes", project / "annotations")
    paths = ProjectPaths(open_root(project / DATA), *folders)
    # The work of `build-scenes` on a scene that is built: a run finds it fresh while the plan stays as it is.
    job = Job(_BUILD.name, world.name, 0, 1, pipeline.seed, pipeline.embodiment, paths, built=made.scene)
    compute(Task(job, pipeline.section(_BUILD.name), scene_fingerprint(_BUILD, pipeline, paths, world.name)))
    draft = DraftOptions(n_objects=options.n_objects, seed=world.seed)
    draft_scene(world.name, pipeline, paths, draft, force=True, scene=made.scene)
    return VariedWorld(world.name, made=True, refused=made.refused)


def _check_same(world: World, plan: Path) -> None:
    """Raise a `UsageError` if a plan that is there was made from something else."""
    made_of = read_toml(plan, AssetError).get("world", {})
    drawn = made_of.get("knobs", {})
    other = [f"{name} = {drawn.get(name)}" for name, value in world.knobs.items() if drawn.get(name) != value]
    other += [] if made_of.get("version") == world.version else [f"generator version {made_of.get('version')}"]
    if other:
        raise UsageError(f"{plan} is there with {other[0]}: take another folder for --out, or delete it")


_catalogue = cache(lambda: load_catalogue(home() / "scene_assets"))
_pipeline = cache(load_pipeline)


def _write_draws(project: Path, done: Sequence[VariedWorld]) -> None:
    """Add the refused draws of new worlds to those of earlier calls."""
    path, made = project / DRAWS, {one.name for one in done if one.made}
    earlier = pyarrow.csv.read_csv(path).to_pylist() if path.exists() else []
    rows = [row for row in earlier if row["world"] not in made]
    rows += [
        {"world": one.name, "draw": draw, "reason": reason, "what": what}
        for one in done for draw, (reason, what) in enumerate(one.refused)
    ]  # fmt: skip
    schema = pa.schema([(name, pa.int32() if name == "draw" else pa.string()) for name in _COLUMNS])
    with atomic_file(project, DRAWS) as out:
        pyarrow.csv.write_csv(pa.Table.from_pylist(rows, schema=schema), out)
