"""What a stage is, and what its work receives and returns.

`aerialdojo_gen.pipeline.registry` is the table of stages; the work of one is a plain function
``run(job, config) -> Output``. Nothing heavy is imported here: the command line reads the table.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerialdojo_gen.store.root import DataRoot, open_root

if TYPE_CHECKING:
    import pyarrow as pa

    from aerialdojo_gen.base.config.shared import Embodiment
    from aerialdojo_gen.scenes.model import Scene


# Those of `ProjectPaths` that stages only read; the recipes may lie in the assets, and are looked at first.
SOURCE_FOLDERS = ("recipes", "scene_assets", "annotations")


@dataclass(frozen=True)
class ProjectPaths:
    """The folders of a run."""

    data: DataRoot  # Every table and file that stages write; a path or URL is opened
    scene_assets: Path  # Props and materials
    recipes: Path  # Recipes, one TOML file per scene
    annotations: Path  # Annotation files

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", open_root(self.data))


@dataclass(frozen=True)
class Output:
    """What a stage's function returns for one shard."""

    tables: dict[str, pa.Table]  # Every table that the stage writes, empty ones included; rows sorted by the key
    rows_in: int  # For the summary line
    rows_out: int
    counts: dict[str, int] = field(default_factory=dict)  # Outcomes and reasons of rejection, in stable words


@dataclass(frozen=True)
class Job:
    """One shard's work: stage, scene, part, folders and seed."""

    stage: str
    scene: str
    part: int  # Number of the scene's part, and of parts
    parts: int
    seed: int  # Of the pipeline, for `aerialdojo_gen.base.rng.generator`
    embodiment: Embodiment
    roots: ProjectPaths
    # Files that the shard owns, relative to the data directory; the stage adds them. Digests of those in `digested`
    # are in the shard's footer, those of the others in its rows.
    files: list[str] = field(default_factory=list, compare=False)
    digested: list[str] = field(default_factory=list, compare=False)
    deadline: float | None = None  # Seconds since the epoch after which long shards raise BudgetSpent, if any
    force: bool = False  # Whether the stage recomputes its finished files
    code: str = ""  # Digest of the stage's code, for stages that check finished files themselves
    verify: bool = False  # Whether the digests of finished files are compared
    built: Scene | None = field(default=None, compare=False)  # What `build-scenes` would build, if somebody did so

    def read(self, table: str) -> pa.Table:
        """Read all of this scene's rows of a table; StoreError names a missing or damaged shard."""
        from aerialdojo_gen.store import shards

        return shards.read_scene(self.roots.data, table, self.scene)

    def scene_model(self, keep: int = 1) -> Scene:
        """Read the scene's mesh, which the process keeps between jobs (`keep` as in `open_scene`)."""
        from aerialdojo_gen.scenes.context import open_scene
        from aerialdojo_gen.scenes.stored import mesh_file

        row = self.read("scenes").to_pylist()[0]
        return open_scene(mesh_file(self.roots.data, row["mesh_path"]), row["mesh_sha256"], keep).scene

    def output_file(self, relative: str) -> AbstractContextManager[Path]:
        """Yield a temporary path of the same suffix, which becomes the file if the block ends without an error."""
        self.files.append(relative)
        self.digested.append(relative)
        return self.roots.data.commit(relative)


def work_module(stage: str) -> str:
    """Name the module with a stage's work."""
    return f"aerialdojo_gen.pipeline.stages.work.{stage.replace('-', '_')}"


@dataclass(frozen=True)
class Stage:
    """A stage of the pipeline; its hooks, the callables, stand in `aerialdojo_gen.pipeline.registry`."""

    name: str  # The command's name, e.g. "anchor-sample"
    help: str  # One line for the command line
    reads: tuple[str, ...]  # Tables (keys of `aerialdojo_gen.store.shards.LAYOUT`), one scene of each
    writes: tuple[str, ...]
    # Of data, scene and config: the number of shards of a scene, if it can have several; may read upstream tables.
    parts: Callable[[DataRoot, str, Any], int] | None = None
    # The scene's input files outside the store; their bytes are fingerprinted.
    sources: Callable[[ProjectPaths, str], list[Path]] = lambda _roots, _scene: []
    # Why a scene is left out of this stage and those downstream because its author has not made an input, in a line
    # that says how to make it; empty if nothing is missing.
    missing_input: Callable[[ProjectPaths, str], str] = lambda _roots, _scene: ""
    # Imported modules and libraries that the work does not use with a configuration. They do not count, so that
    # installing an extra makes nothing stale.
    idle: Callable[[Any], tuple[str, ...]] = lambda _config: ()
    # Raises an `AerialDojoError` if the inputs of all scenes together are insufficient, before anything is written.
    check: Callable[[DataRoot, Sequence[str], Any], None] = lambda _data, _scenes, _config: None
    # Decides what the configuration leaves to the machine, and reports it in a line; it is part of the fingerprint.
    resolve_config: Callable[[Any, Callable[[str], None]], Any] = lambda config, _say: config
    # Possible results of `resolve_config`, if it is slow. If all shards are fresh under one, it is not called.
    choices: Callable[[Any], list[Any]] = lambda _config: []
    # Whether the stage waits until all scenes have passed the stages before, as one with a `check` must. Otherwise
    # scenes advance independently.
    barrier: bool = False
    # Time per scene, and per object, on one core: orders the scenes, and estimates the time left until there are
    # measurements.
    seconds: tuple[float, float] = (1.0, 0.0)
    # Peak memory of a process, with a margin for larger scenes; limits the processes per node of a cluster.
    memory_mb: int = 1000

    def run(self, job: Job, config: Any) -> Output:
        """Compute a shard: `run` of the module of the stage's work, which is imported now."""
        module = importlib.import_module(work_module(self.name))
        output: Output = module.run(job, config)
        return output

    def count_parts(self, data: DataRoot, scene: str, config: Any) -> int:
        """Count a scene's shards."""
        return self.parts(data, scene, config) if self.parts else 1
