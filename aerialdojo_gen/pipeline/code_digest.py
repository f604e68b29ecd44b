"""Digests of the code that makes something: the sources that a module imports, and the libraries' versions.

A module counts with every module of this package that it imports, however far away, byte by byte: a comment counts.
Rooms that only move rows (`CUT`) end the search. What a row says of them counts by itself: a fingerprint holds the
schemas of a stage's tables and the values of its configuration.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import sys
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path

import grimp

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.pipeline.stage import work_module

_NAME = __name__.partition(".")[0]
_FOLDER = Path(__file__).parents[1]

# Rooms and folders whose code moves rows, checks values or talks to the user, and changes no row.
CUT = (
    "base.cli_context", "base.config", "base.errors", "base.explain", "base.kernel_cache", "base.secrets",
    "base.version", "cli", "pipeline", "store",
)  # fmt: skip
# Parts of those that make rows, or write those of every stage.
_WRITER = "store.tables"
KEPT = ("pipeline.scoring", "pipeline.stage", "pipeline.stages.work", _WRITER)

# What modules import by a name made at run time: libraries, or a folder of this package with all its modules ("x.*").
# Empty: the configuration names it, or it imports what the module's callers import themselves.
BY_NAME: dict[str, tuple[str, ...]] = {
    "__init__": (),
    "base.llm_client": (),
    "benchmark.agents.load": (),
    "dataset.validate.run": ("dataset.validate.*",),
    "imports.assimp": ("assimp_py",),
    "imports.dem": ("rasterio",),
    "imports.osm": ("osmium",),
    "learning.loader": ("safetensors", "torch"),
    "learning.training": ("torch",),
    "pipeline.stage": (),
    "rendering.gl": ("moderngl",),
    "scenes.worlds.make": ("scenes.worlds.types.*",),
    "scenes.builders": ("scenes.builders.*",),
    "scenes.kit": ("scenes.kit.*",),
}

# Files that modules read, relative to the package. Files outside it are sources of stages.
DATA_FILES = {
    "annotations.language.locations": ("annotations/language/relations.toml",),
    "annotations.language.sentences": ("annotations/language/grammar.toml",),
    "annotations.phrases": ("annotations/phrases/*.toml", "annotations/words.toml"),
    "annotations.places": ("annotations/places/*.toml",),
    "scenes.colours": ("scenes/colour_names.toml",),
}

# Distributions that provide an import of another name.
_DISTRIBUTIONS = {
    "cv2": ("opencv-python-headless", "opencv-python", "opencv-contrib-python-headless", "opencv-contrib-python"),
    "fcl": ("python-fcl",),
    # llvmlite generates Numba's code, and so its rounding; PyBullet's and moderngl's drivers are columns of pictures.
    "numba": ("numba", "llvmlite"),
}
# They check values or show progress, and do not change rows.
_SHAPELESS = frozenset({"pydantic", "pydantic_core", "tqdm", "typer", "typing_extensions"})


@dataclass(frozen=True)
class Code:
    """The code that a module depends on."""

    parts: dict[str, str]  # SHA-256 by module, or by file relative to the package
    libraries: dict[str, str]  # Versions of imported third-party packages; empty if not installed

    @cached_property
    def digest(self) -> str:
        """SHA-256 of parts and libraries, hexadecimal."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()


def stage_code(stage: str, idle: tuple[str, ...] = ()) -> Code:
    """Return the code of a stage's work, by the stage's name; the table of stages and its hooks do not count."""
    return code_of(work_module(stage), idle)


@cache
def code_of(module: str, idle: tuple[str, ...] = ()) -> Code:
    """Return the code that a module depends on, but for `idle` imports, as of the first call in this process."""
    found: set[str] = set()
    libraries: set[str] = set()
    waiting = [module, f"{_NAME}.{_WRITER}"]
    while waiting:
        name = waiting.pop()
        if name in found or name in idle:
            continue
        if name.partition(".")[0] != _NAME:
            libraries |= {name} - _SHAPELESS - sys.stdlib_module_names
        elif name == module or not _is_cut(name):
            found.add(name)
            waiting += [*_graph().find_modules_directly_imported_by(name), *_by_name(name)]
    parts = {
        name: _source_digest(name) for name in sorted(found | {above for name in found for above in _above(name)})
    }
    for name, patterns in DATA_FILES.items():
        if f"{_NAME}.{name}" in found:
            for path in sorted(path for pattern in patterns for path in _FOLDER.glob(pattern)):
                parts[path.relative_to(_FOLDER).as_posix()] = hashlib.sha256(path.read_bytes()).hexdigest()
    return Code(parts, {name: _version(name) for name in sorted(libraries)})


@cache
def _graph() -> grimp.ImportGraph:
    return grimp.build_graph(
        _NAME, include_external_packages=True, exclude_type_checking_imports=True, cache_dir=None
    )


def _is_cut(module: str) -> bool:
    def below(names: tuple[str, ...]) -> bool:
        return any(f"{module}.".startswith(f"{_NAME}.{name}.") for name in names)

    return module == _NAME or (below(CUT) and not below(KEPT))


def _by_name(module: str) -> list[str]:
    names = BY_NAME.get(module.partition(".")[2], ())
    found = [name for name in names if not name.endswith("*")]
    for name in set(names) - set(found):
        found += _graph().find_descendants(f"{_NAME}.{name.removesuffix('.*')}")
    return found


def _above(module: str) -> list[str]:
    """Packages that a module lies in: their ``__init__`` runs, and what it imports counts where it is used."""
    names = module.split(".")
    return [".".join(names[:k]) for k in range(2, len(names))]


@cache
def _source_digest(module: str) -> str:
    path = _FOLDER.joinpath(*module.split(".")[1:])
    package = path / "__init__.py"
    path = package if package.is_file() else path.with_suffix(".py")
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        raise AssetError(f"the source of {module} is missing from {_FOLDER}: install the package again") from None


@cache
def _version(library: str) -> str:
    """Version of a library by its import name; empty if it is not installed."""
    found = []
    for name in _DISTRIBUTIONS.get(library, (library,)):
        with contextlib.suppress(metadata.PackageNotFoundError):
            found.append(f"{name} {metadata.version(name)}")
    return ", ".join(found)
