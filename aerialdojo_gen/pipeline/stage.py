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


@dataclass(frozen=True)
class ProjectPaths:
    """The folders of a run.

    Attributes
    ----------
    data : DataRoot
        Every table and file that stages write; a path or URL is opened.
    scene_assets : Path
        Props and materials.
    recipes : Path
        Recipes, one TOML file per scene.
    annotations : Path
        Annotation files.
    """

    data: DataRoot
    scene_assets: Path
    recipes: Path
    annotations: Path

    def __post_init__(self) -> None:
        object.__setattr__(self, "data", open_root(self.data))


@dataclass(frozen=True)
class Output:
    """What a stage's function returns for one shard.

    Attributes
    ----------
    tables : dict of str to pyarrow.Table
        Every table that the stage writes, empty ones included; rows sorted by the table's key.
    rows_in, rows_out : int
        For the summary line.
    counts : dict of str to int
        Outcomes and reasons of rejection (stable words), for the summary line.
    """

    tables: dict[str, pa.Table]
    rows_in: int
    rows_out: int
    counts: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Job:
    """One shard's work: stage, scene, part, folders and seed.

    Attributes
    ----------
    stage, scene : str
        Name of the stage and of the scene.
    part, parts : int
        Number of the scene's part, and of parts.
    seed : int
        Seed of the pipeline, for `aerialdojo_gen.base.rng.generator`.
    embodiment : Embodiment
        The drone's body.
    roots : ProjectPaths
        The folders.
    files : list of str
        Files that the shard owns, relative to the data directory; the stage adds them.
    digested : list of str
        Those of them whose digests are in the shard's footer; the digests of the others are in its rows.
    deadline : float, optional
        Seconds since the epoch after which a stage with long shards starts nothing new and raises BudgetSpent.
    force : bool
        Whether the stage recomputes its finished files.
    code : str
        Digest of the stage's code, for stages that check finished files themselves.
    verify : bool
        Whether the digests of finished files are compared.
    """

    stage: str
    scene: str
    part: int
    parts: int
    seed: int
    embodiment: Embodiment
    roots: ProjectPaths
    files: list[str] = field(default_factory=list, compare=False)
    digested: list[str] = field(default_factory=list, compare=False)
    deadline: float | None = None
    force: bool = False
    code: str = ""
    verify: bool = False

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
        """Open a file output: a temporary path, renamed if the block ends without an error.

        Parameters
        ----------
        relative : str
            Path relative to the data directory; it must stay inside it.

        Returns
        -------
        context manager of Path
            The temporary path to write to, with the same suffix.
        """
        self.files.append(relative)
        self.digested.append(relative)
        return self.roots.data.commit(relative)


def work_module(stage: str) -> str:
    """Name the module with a stage's work."""
    return f"aerialdojo_gen.pipeline.stages.work.{stage.replace('-', '_')}"


def _one_part(_data: DataRoot, _scene: str, _config: Any) -> int:
    return 1


def _no_check(_data: DataRoot, _scenes: Sequence[str], _config: Any) -> None:
    pass


def _unchanged(config: Any, _say: Callable[[str], None]) -> Any:
    return config


def _no_choices(_config: Any) -> list[Any]:
    return []


def _no_sources(_roots: ProjectPaths, _scene: str) -> list[Path]:
    return []


def _no_missing_input(_roots: ProjectPaths, _scene: str) -> str:
    return ""


def _no_idle_modules(_config: Any) -> tuple[str, ...]:
    return ()


@dataclass(frozen=True)
class Stage:
    """A stage of the pipeline.

    Attributes
    ----------
    name : str
        The command's name, e.g. ``"anchor-sample"``.
    help : str
        One line for the command line.
    reads, writes : tuple of str
        Tables (keys of `aerialdojo_gen.store.shards.LAYOUT`), one scene of each.
    parts : callable
        ``(data, scene, config) -> int``: number of shards of a scene; may read upstream tables.
    sources : callable
        ``(roots, scene) -> list of Path``: the scene's input files outside the store; their bytes are fingerprinted.
    missing_input : callable
        ``(roots, scene) -> str``: why a scene is left out of this stage and those downstream because its author has
        not made an input, in a line that says how to make it; empty if nothing is missing.
    idle : callable
        ``(config) -> tuple of str``: imported modules and libraries that the work does not use with this
        configuration. They do not count, so that installing an extra makes nothing stale.
    check : callable
        ``(data, scenes, config)``: raises an `AerialDojoError` if the inputs of all scenes together are insufficient,
        before anything is written.
    resolve_config : callable
        ``(config, say) -> config``: decides what the configuration leaves to the machine, and reports it in a line;
        the decision is part of the fingerprint.
    choices : callable
        ``config -> list of config``: possible results of `resolve_config`, if it is slow. If all shards are fresh
        under one of them, it is not called.
    digests : (str, str, str), optional
        A table that the stage writes and its columns with the path and the SHA-256 of a file (or folder).
    barrier : bool
        Whether the stage waits until all scenes have passed the stages before; a `check` implies it. Otherwise
        scenes advance independently.
    seconds : (float, float)
        Time per scene, and per object, on one core. It orders the scenes, and estimates the time left until there
        are measurements.
    memory_mb : int
        Peak memory of a process, with a margin for larger scenes; limits the processes per node of a cluster.
    """

    name: str
    help: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    parts: Callable[[DataRoot, str, Any], int] = _one_part
    sources: Callable[[ProjectPaths, str], list[Path]] = _no_sources
    missing_input: Callable[[ProjectPaths, str], str] = _no_missing_input
    idle: Callable[[Any], tuple[str, ...]] = _no_idle_modules
    check: Callable[[DataRoot, Sequence[str], Any], None] = _no_check
    resolve_config: Callable[[Any, Callable[[str], None]], Any] = _unchanged
    choices: Callable[[Any], list[Any]] = _no_choices
    digests: tuple[str, str, str] | None = None
    barrier: bool = False
    seconds: tuple[float, float] = (1.0, 0.0)
    memory_mb: int = 1000

    def run(self, job: Job, config: Any) -> Output:
        """Compute a shard: `run` of the module of the stage's work, which is imported now."""
        module = importlib.import_module(work_module(self.name))
        output: Output = module.run(job, config)
        return output

    @property
    def in_parts(self) -> bool:
        """Whether a scene can have several shards."""
        return self.parts is not _one_part

    @property
    def waits(self) -> bool:
        """Whether all scenes must have passed the stages before."""
        return self.barrier or self.check is not _no_check
