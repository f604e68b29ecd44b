"""Digests of the code that makes something: what a module imports of this package, and the libraries' versions.

A module counts as a whole, with everything that it imports, however far away. Comments, docstrings and the layout of
the source do not. What merely carries rows about (`PLUMBING`) ends the search, except for the definitions in it that
decide what is written: those are listed, and count with what they refer to.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.pipeline.code_facts import Definition, Edge, Facts, module_facts
from aerialdojo_gen.pipeline.stage import work_module

# Modules of which only the named definitions count. A configuration counts by its values, not its classes.
PLUMBING: dict[str, tuple[str, ...]] = {
    "aerialdojo_gen": (),
    "aerialdojo_gen.benchmark": (),
    "aerialdojo_gen.base": (),
    "aerialdojo_gen.base.cli_context": (),
    "aerialdojo_gen.base.errors": (),
    "aerialdojo_gen.base.constants": ("*",),
    "aerialdojo_gen.base.explain": (),
    "aerialdojo_gen.base.names": (),
    "aerialdojo_gen.base.secrets": (),
    "aerialdojo_gen.base.text_table": (),
    "aerialdojo_gen.base.environment_errors": (),
    "aerialdojo_gen.base.version": (),
    "aerialdojo_gen.base.config": (),
    "aerialdojo_gen.base.config.agreement": (),
    "aerialdojo_gen.base.config.pipeline": (),
    "aerialdojo_gen.base.config.sections": (),
    "aerialdojo_gen.learning": (),
    "aerialdojo_gen.pipeline": (),
    "aerialdojo_gen.pipeline.chain": (),
    "aerialdojo_gen.pipeline.code_digest": (),
    "aerialdojo_gen.pipeline.code_facts": (),
    "aerialdojo_gen.pipeline.executors": (),
    "aerialdojo_gen.pipeline.executors.base": (),
    "aerialdojo_gen.pipeline.executors.bundled": (),
    "aerialdojo_gen.pipeline.executors.link": (),
    "aerialdojo_gen.pipeline.executors.local": (),
    "aerialdojo_gen.pipeline.executors.ray": (),
    "aerialdojo_gen.pipeline.executors.ray_worker": (),
    "aerialdojo_gen.pipeline.expectation": (),
    "aerialdojo_gen.pipeline.fingerprint": (),
    "aerialdojo_gen.pipeline.freshness": (),
    "aerialdojo_gen.pipeline.interrupt": (),
    "aerialdojo_gen.pipeline.progress": (),
    "aerialdojo_gen.pipeline.registry": (),
    "aerialdojo_gen.pipeline.runner": (),
    "aerialdojo_gen.pipeline.stage": ("Job",),
    "aerialdojo_gen.pipeline.summary": (),
    "aerialdojo_gen.pipeline.stages": (),
    "aerialdojo_gen.pipeline.stages.work": (),
    "aerialdojo_gen.pipeline.task": (),
    "aerialdojo_gen.store": (),
    "aerialdojo_gen.store.atomic": (),
    "aerialdojo_gen.store.bucket": (),
    "aerialdojo_gen.store.cache": (),
    "aerialdojo_gen.store.cloud_errors": (),
    "aerialdojo_gen.store.files": (),
    "aerialdojo_gen.store.footers": (),
    "aerialdojo_gen.store.object_root": (),
    "aerialdojo_gen.store.footer_cache": (),
    "aerialdojo_gen.store.layout": ("partition", "check_scene_name"),
    "aerialdojo_gen.store.lease": (),
    "aerialdojo_gen.store.object_folders": (),
    "aerialdojo_gen.store.object_state": (),
    "aerialdojo_gen.store.parquet_files": ("write_clustered",),
    "aerialdojo_gen.store.schemas": ("*",),
    "aerialdojo_gen.store.root": (),
    "aerialdojo_gen.store.schemas.benchmark": ("*",),
    "aerialdojo_gen.store.schemas.columns": ("*",),
    "aerialdojo_gen.store.schemas.staged": ("*",),
    "aerialdojo_gen.store.schemas.release": ("*",),
    "aerialdojo_gen.store.shards": (),
    "aerialdojo_gen.store.staging": (),
}
# Writes every stage's rows.
_WRITERS = (Edge("aerialdojo_gen.store.parquet_files", "write_clustered"), Edge("aerialdojo_gen.store.tables"))

# Modules that import what their caller names; the configuration determines it.
DYNAMIC = frozenset({"aerialdojo_gen.base.llm_client.service", "aerialdojo_gen.benchmark.agents.load"})

# Files that modules read, relative to the package. Files outside it are sources of stages.
DATA_FILES = {
    "aerialdojo_gen.annotations.phrases": "annotations/phrases/*.toml",
    "aerialdojo_gen.annotations.places": "annotations/places/*.toml",
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
class Choice:
    """Which modules of a package are imported dynamically, if a recipe determines it."""

    package: str  # Absolute name; without a choice all of its modules count
    modules: tuple[str, ...]  # Absolute names; they count with their imports


@dataclass(frozen=True)
class Code:
    """The code that a module depends on."""

    parts: dict[str, str]  # Digests by module, or by ``module:definition`` where the module is plumbing, or by file
    libraries: dict[str, str]  # Versions of imported third-party packages; empty if not installed

    @cached_property
    def digest(self) -> str:
        """SHA-256 of parts and libraries, hexadecimal."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()


@cache
def code_of(module: str, chosen: Choice | None = None, idle: tuple[str, ...] = ()) -> Code:
    """Return the code that a module of the running package depends on, as of the first call in this process."""
    return _running().of(module, chosen, idle)


@cache
def _running() -> Package:
    return Package(Path(__file__).parents[1])


def stage_code(stage: str, chosen: Choice | None = None, idle: tuple[str, ...] = ()) -> Code:
    """Return the code of a stage, by the stage's name.

    That is the code of its work. `parts` and `sources` count by what they return: the number of shards and the files'
    digests are compared themselves. `resolve_config` and `check` shape no bytes that the configuration does not.
    """
    return code_of(work_module(stage), chosen, idle)


def counted(module: str) -> tuple[str, ...] | None:
    """Return which of a module's definitions count, ``("*",)`` for all that are used; None if all of it counts."""
    return PLUMBING.get(module)


class Package:
    """The sources of a copy of this package."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._name = folder, folder.name
        self._cache = _Cache(folder / "__pycache__" / "code-facts.json")
        self._facts: dict[str, Facts] = {}
        self._searches: dict[tuple[str, str, frozenset[str]], _Search] = {}
        self._paths = {_module_name(path.relative_to(folder.parent)): path for path in sorted(folder.rglob("*.py"))}

    def of(self, module: str, chosen: Choice | None = None, idle: tuple[str, ...] = ()) -> Code:
        """Return the code that a module depends on."""
        search = self._search(module, chosen.package if chosen else "", frozenset(idle))
        if chosen and chosen.package in search.dynamic:
            # The order of following does not matter: all modules of the package are reached the same way.
            search = search.copy()
            for name in chosen.modules:
                search.follow(Edge(name))
        self._cache.save()
        return Code(dict(sorted(search.parts.items())), {name: _version(name) for name in sorted(search.libraries)})

    def _search(self, module: str, excluded: str, idle: frozenset[str]) -> _Search:
        """Follow a module's imports, without the dynamic imports of one package."""
        key = module, excluded, idle
        if key not in self._searches:
            search = self._searches[key] = _Search(self, excluded, idle)
            for edge in (Edge(module), *_WRITERS):
                search.follow(edge)
        return self._searches[key]

    def contains(self, module: str) -> bool:
        """Whether the package has a module of this absolute name."""
        return module in self._paths

    def belongs(self, module: str) -> bool:
        """Whether a name is below the package, existing or not."""
        return module.split(".")[0] == self._name

    def modules_in(self, package: str) -> list[str]:
        """Names of all modules below a package."""
        return [module for module in self._paths if module.startswith(f"{package}.")]

    def facts(self, module: str) -> Facts:
        """Read a module; AssetError if its source is missing."""
        if module not in self._facts:
            path = self._paths.get(module)
            if path is None:
                raise AssetError(f"the source of {module} is missing from {self._folder}: install the package again")
            source = path.read_bytes()
            self._facts[module] = self._cache.facts(source, module, path.stem == "__init__")
        return self._facts[module]

    def data_files(self, module: str) -> Iterator[tuple[str, str]]:
        """Yield name and SHA-256 of the package's files that a module reads."""
        for path in sorted(self._folder.glob(DATA_FILES[module])) if module in DATA_FILES else ():
            yield path.relative_to(self._folder).as_posix(), hashlib.sha256(path.read_bytes()).hexdigest()


def _module_name(path: Path) -> str:
    return ".".join((path.parent if path.stem == "__init__" else path.with_suffix("")).parts)


class _Search:
    """Follows imports, and collects what counts."""

    def __init__(self, package: Package, excluded: str, idle: frozenset[str]) -> None:
        self._package, self._excluded, self._idle = package, excluded, idle
        self.parts: dict[str, str] = {}
        self.libraries: set[str] = set()
        # Packages of which modules are imported dynamically.
        self.dynamic: set[str] = set()
        self._seen: set[Edge] = set()

    def copy(self) -> _Search:
        """Return an independent copy."""
        other = _Search(self._package, self._excluded, self._idle)
        other.parts, other.libraries = dict(self.parts), set(self.libraries)
        other.dynamic, other._seen = set(self.dynamic), set(self._seen)
        return other

    def follow(self, first: Edge) -> None:
        """Count an import and, recursively, its imports."""
        waiting = [first]
        while waiting:
            edge = waiting.pop()
            if edge in self._seen:
                continue
            self._seen.add(edge)
            if edge.module in self._idle or f"{edge.module}.{edge.name}" in self._idle:
                continue
            if not self._package.belongs(edge.module):
                if edge.module not in sys.stdlib_module_names and edge.module not in _SHAPELESS:
                    self.libraries.add(edge.module)
            elif edge.name == "**":
                self.dynamic.add(edge.module)
                if edge.module != self._excluded:
                    waiting += [Edge(module) for module in self._package.modules_in(edge.module)]
            elif edge.name and self._package.contains(f"{edge.module}.{edge.name}"):
                waiting += [Edge(edge.module, "", ()), Edge(f"{edge.module}.{edge.name}", "", edge.uses)]
            else:
                names = (edge.name,) if edge.name else edge.uses
                waiting += self._enter(edge.module, names)

    def _enter(self, module: str, names: tuple[str, ...]) -> Iterator[Edge]:
        above = module.rpartition(".")[0]
        if above:
            # Its ``__init__`` runs; of plumbing that uses nothing.
            yield Edge(above, "", ())
        if counted(module) is not None:
            yield from self._definitions(module, names)
        elif module not in self.parts:
            facts = self._package.facts(module)
            if facts.unknown and module not in DYNAMIC:
                raise RuntimeError(f"{module} imports {', '.join(facts.unknown)}: its source does not tell what")
            self.parts[module] = facts.digest
            self.parts.update(self._package.data_files(module))
            yield from facts.edges

    def _definitions(self, module: str, names: tuple[str, ...]) -> Iterator[Edge]:
        listed = counted(module)
        if not listed:
            return
        facts = self._package.facts(module)
        known = facts.definitions
        allowed = {*known, *facts.reexports} if listed == ("*",) else set(listed)
        waiting = sorted(allowed if "*" in names else allowed & set(names))
        for name in waiting:
            yield from facts.reexports.get(name, ())
        while waiting:
            name = waiting.pop()
            if name in known and f"{module}:{name}" not in self.parts:
                self.parts[f"{module}:{name}"] = known[name].digest
                waiting += known[name].names
                yield from known[name].edges


class _Cache:
    """A file with the facts of sources; a damaged or unwritable file is ignored."""

    def __init__(self, path: Path) -> None:
        self._path = path
        # Facts depend on the version of the reader.
        self._reader = hashlib.sha256(Path(__file__).with_name("code_facts.py").read_bytes()).digest()
        self._entries: dict[str, Any] = {}
        self._changed = False
        with contextlib.suppress(OSError, ValueError):
            checksum, text = path.read_bytes().split(b"\n", 1)
            if checksum == self._checksum(text):
                self._entries = json.loads(text)

    def facts(self, source: bytes, module: str, is_package: bool) -> Facts:
        """Return a source's facts."""
        digest = hashlib.sha256(source).hexdigest()
        by_definition = bool(counted(module))
        key = [digest, by_definition]
        entry = self._entries.get(module)
        if entry is None or entry["key"] != key:
            facts = module_facts(source, module, is_package, by_definition)
            self._entries[module] = {"key": key, "facts": asdict(facts)}
            self._changed = True
            return facts
        return _facts(entry["facts"])

    def save(self) -> None:
        """Write the file if there is anything new."""
        if not self._changed:
            return
        self._changed = False
        text = json.dumps(self._entries).encode()
        temporary = self._path.with_name(f".{self._path.name}.{os.getpid()}.tmp")
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(exist_ok=True)
            temporary.write_bytes(self._checksum(text) + b"\n" + text)
            temporary.replace(self._path)

    def _checksum(self, text: bytes) -> bytes:
        return hashlib.sha256(self._reader + text).hexdigest().encode()


def _facts(raw: dict[str, Any]) -> Facts:
    return Facts(
        raw["digest"],
        _edges(raw["edges"]),
        {
            name: Definition(d["digest"], tuple(d["names"]), _edges(d["edges"]))
            for name, d in raw["definitions"].items()
        },
        tuple(raw["unknown"]),
        {name: _edges(edges) for name, edges in raw["reexports"].items()},
    )


def _edges(raw: list[dict[str, Any]]) -> tuple[Edge, ...]:
    return tuple(Edge(edge["module"], edge["name"], tuple(edge["uses"])) for edge in raw)


@cache
def _version(library: str) -> str:
    """Version of a library by its import name; empty if it is not installed."""
    found = []
    for name in _DISTRIBUTIONS.get(library, (library,)):
        with contextlib.suppress(metadata.PackageNotFoundError):
            found.append(f"{name} {metadata.version(name)}")
    return ", ".join(found)
