"""What a stage is, and what its work is given and gives.

A stage is declared by its module in `aerialdojo_gen.pipeline.stages`; its work is a plain function
``run(job, config) -> Output``. Nothing heavy is imported here: the command line reads the declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerialdojo_gen.store.root import DataRoot, open_root

if TYPE_CHECKING:
    import pyarrow as pa

    from aerialdojo_gen.base.config.sections import Embodiment
    from aerialdojo_gen.pipeline.code_digest import Choice
    from aerialdojo_gen.scenes.model import Scene


@dataclass(frozen=True)
class ProjectPaths:
    """The folders that a run works with.

    Attributes
    ----------
    data : DataRoot
        Every table and file that stages write; made of a path or URL where one is given.
    scene_assets : Path
        Props and materials.
    recipes : Path
        Recipes, one TOML file a scene.
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
        Every table that the stage writes, also where it has no rows; rows sorted by the table's key.
    rows_in, rows_out : int
        For the summary line.
    counts : dict of str to int
        Why rows were rejected, or what became of them: stable words, for the summary line.
    """

    tables: dict[str, pa.Table]
    rows_in: int
    rows_out: int
    counts: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Job:
    """One shard's work: where it reads, what it is a part of, and the pipeline's seed.

    Attributes
    ----------
    stage, scene : str
        Name of the stage and of the scene.
    part, parts : int
        Which part of the scene's work this is, and how many there are.
    seed : int
        Seed of the pipeline, for `aerialdojo_gen.base.rng.generator`.
    embodiment : Embodiment
        The drone's body.
    roots : Roots
        The folders.
    files : list of str
        Files that the shard owns, relative to the data directory; the stage adds them.
    digested : list of str
        Those of them whose digests the shard's footer keeps, to be fresh by; the others' stand in its rows.
    deadline : float, optional
        Seconds since the epoch after which a stage of long shards begins nothing new, and raises BudgetSpent.
    force : bool
        Whether the stage makes anew what it finds finished.
    code : str
        Digest of the stage's code, for what a stage itself finds finished.
    verify : bool
        Whether it compares the digests of the files that it finds finished.
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
        """Read the scene's mesh; it is kept between the jobs of a process, as `keep` of `open_scene` says."""
        from aerialdojo_gen.scenes.context import open_scene
        from aerialdojo_gen.scenes.stored import mesh_file

        row = self.read("scenes").to_pylist()[0]
        return open_scene(mesh_file(self.roots.data, row["mesh_path"]), row["mesh_sha256"], keep).scene

    def output_file(self, relative: str) -> AbstractContextManager[Path]:
        """Open a file output: a temporary path that takes its name when the block ends without an error.

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


def _one_part(_data: DataRoot, _scene: str, _config: Any) -> int:
    return 1


def _no_check(_data: DataRoot, _scenes: Sequence[str], _config: Any) -> None:
    pass


def _as_it_is(config: Any, _say: Callable[[str], None]) -> Any:
    return config


def _no_choice(_config: Any) -> list[Any]:
    return []


def _no_sources(_roots: ProjectPaths, _scene: str) -> list[Path]:
    return []


def _no_want(_roots: ProjectPaths, _scene: str) -> str:
    return ""


def _any_module(_roots: ProjectPaths, _scene: str) -> Choice | None:
    return None


def _nothing_idle(_config: Any) -> tuple[str, ...]:
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
    run : callable
        ``(job, config) -> Output``: computes a shard. It imports what it needs when it is called.
    parts : callable
        ``(data, scene, config) -> int``: number of shards of a scene; may read upstream tables.
    sources : callable
        ``(roots, scene) -> list of Path``: files of the scene, outside the store, whose bytes the result depends on.
    wants : callable
        ``(roots, scene) -> str``: why a scene that is not finished by its author is left out of this stage and
        of those that build on it, in a line that names the mend; empty where nothing is wanting.
    imports : callable
        ``(roots, scene) -> Choice or None``: which modules the scene's work imports of a package by a name made
        at run time; the others' code makes nothing of the scene stale. None where that is not known: all count.
    idle : callable
        ``(config) -> tuple of str``: modules and libraries that the work does not use with such a configuration,
        although it has imports of them. They do not count: whoever installs an extra has nothing made again.
    check : callable
        ``(data, scenes, config)``: raises an `AerialDojoError` where the inputs of all scenes together will not do,
        before anything is written.
    settle : callable
        ``(config, say) -> config``: decides what the configuration leaves to the machine, so that the decision is
        part of the fingerprint, and says it in a line.
    choices : callable
        ``config -> list of config``: what `settle` may make of it, where deciding takes time. Where all shards are
        fresh by one of them nothing is decided anew.
    digests : (str, str, str), optional
        A table that the stage writes and its columns with the path of a file (or folder) and the SHA-256 of it.
    after_all : bool
        Whether a scene waits here until all of them have been through the stages before. A stage with a `check` does;
        through others a scene goes at its own pace, in one process where it can be.
    seconds : (float, float)
        What a scene takes, and each of its objects besides, on one ordinary core. It decides which scene is begun
        first, and the time that is said to be left until the run itself has told better.
    memory_mb : int
        What a process takes at its peak, megabytes, with room for larger scenes than were measured; a cluster starts
        no more of them on a node than fit.
    """

    name: str
    help: str
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    run: Callable[[Job, Any], Output]
    parts: Callable[[DataRoot, str, Any], int] = _one_part
    sources: Callable[[ProjectPaths, str], list[Path]] = _no_sources
    missing_input: Callable[[ProjectPaths, str], str] = _no_want
    imports: Callable[[ProjectPaths, str], Choice | None] = _any_module
    idle: Callable[[Any], tuple[str, ...]] = _nothing_idle
    check: Callable[[DataRoot, Sequence[str], Any], None] = _no_check
    resolve_config: Callable[[Any, Callable[[str], None]], Any] = _as_it_is
    choices: Callable[[Any], list[Any]] = _no_choice
    digests: tuple[str, str, str] | None = None
    barrier: bool = False
    seconds: tuple[float, float] = (1.0, 0.0)
    memory_mb: int = 1000

    @property
    def in_parts(self) -> bool:
        """Whether a scene can have several shards, which several processes may compute."""
        return self.parts is not _one_part

    @property
    def waits(self) -> bool:
        """Whether all scenes are to be through the stages before."""
        return self.barrier or self.check is not _no_check
