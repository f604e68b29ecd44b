"""Fingerprints: a hash of everything a shard depends on. Which shards are fresh, and which must be computed.

A shard is fresh if all its tables and files exist undamaged and its fingerprint (code, inputs, configuration)
matches.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from aerialdojo_gen.base import paper_figures
from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.config.shared import Section
from aerialdojo_gen.base.environment_errors import check_memory
from aerialdojo_gen.base.errors import AerialDojoError, AssetError, DamagedFile
from aerialdojo_gen.pipeline.code_digest import stage_code
from aerialdojo_gen.pipeline.options import RunLimits
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.pipeline.stage import SOURCE_FOLDERS, Job, ProjectPaths, Stage
from aerialdojo_gen.pipeline.task import Task
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.files import file_digest
from aerialdojo_gen.store.root import DataRoot


@dataclass(frozen=True)
class Shards:
    """A stage's shards under one configuration."""

    tasks: list[Task]  # To compute
    fresh: list[dict[str, Any]]  # Summaries of fresh shards
    errors: dict[str, AerialDojoError]  # Missing or damaged inputs, by scene


@dataclass
class ShardFinder:
    """Finds the shards that a run must compute, under one resolved configuration a stage."""

    pipeline: Pipeline
    roots: ProjectPaths
    scenes: Sequence[str]
    reporter: Reporter
    force: Collection[str] = ()
    limits: RunLimits = field(default_factory=RunLimits)
    configs: dict[str, Section] = field(default_factory=dict)
    dry: bool = False  # Whether surplus shards stay

    def find(self, stage: Stage, scenes: Sequence[str]) -> Shards:
        """Find the stale shards of some scenes; raises the stage's `check` of all scenes if there are any."""
        if stage.name not in self.configs:
            section = self.pipeline.section(stage.name)
            # Resolving takes time: skip it while everything is fresh under one of the possible results.
            try_choices = stage.name not in self.force and len(scenes) == len(self.scenes)
            for choice in stage.choices(section) if try_choices else ():
                found = self.shards(stage, choice, scenes, Reporter(quiet=True))
                if not found.tasks and not found.errors:
                    self.configs[stage.name] = choice
                    return found
            self.configs[stage.name] = stage.resolve_config(section, self.reporter.line)
        config = self.configs[stage.name]
        found = self.shards(stage, config, scenes, self.reporter)
        if found.tasks:
            check_memory(stage.name)
            stage.check(self.roots.data, self.scenes, config)
        return found

    def shards(self, stage: Stage, config: Section, scenes: Sequence[str], reporter: Reporter) -> Shards:
        """Find which of a stage's shards are fresh under a configuration, and remove surplus shards."""
        roots, limits, force = self.roots, self.limits, stage.name in self.force
        pipeline = self.pipeline.model_copy(update={stage.name.replace("-", "_"): config})
        found = Shards([], [], {})
        number, shares = limits.share
        shard = -1
        for scene in scenes:
            try:
                fingerprint = scene_fingerprint(stage, pipeline, roots, scene)
                parts = stage.count_parts(roots.data, scene, config)
            except AerialDojoError as error:
                found.errors[scene] = error
                continue
            for table in () if self.dry else stage.writes:
                store.prune(roots.data, table, scene, parts)
            for part in range(parts):
                shard += 1
                if shard % shares != number:
                    continue
                summary = None if force else _fresh(stage, roots.data, scene, part, parts, fingerprint, reporter)
                if summary is not None and (not limits.verify or _verified(stage, roots.data, scene, part, reporter)):
                    found.fresh.append(summary)
                    continue
                code = stage_code(stage.name, stage.idle(config)).digest
                job = Job(
                    stage.name, scene, part, parts, pipeline.seed, pipeline.embodiment, roots,
                    deadline=limits.deadline, force=force, verify=limits.verify, code=code,
                )  # fmt: skip
                found.tasks.append(Task(job, config, fingerprint))
        return found


def is_fresh(stage: Stage, config: Section, scene: str, pipeline: Pipeline, roots: ProjectPaths) -> bool:
    """Whether all shards of a scene are fresh under a stage's section; nothing is written."""
    finder = ShardFinder(pipeline, roots, [scene], Reporter(quiet=True), dry=True)
    found = finder.shards(stage, config, [scene], finder.reporter)
    return not found.tasks and not found.errors


def _fresh(
    stage: Stage, data: DataRoot, scene: str, part: int, parts: int, fingerprint: str, reporter: Reporter
) -> dict[str, Any] | None:
    """Return the shard's stored summary if all its tables and files exist and are up to date."""
    summary = None
    for table in stage.writes:
        name = store.shard_name(table, scene, part)
        if not data.exists(name):
            return None
        try:
            info = store.read_info(data, name)
        except DamagedFile as error:
            reporter.line(f"{str(error).split(': delete')[0]}: computed again")
            return None
        if info.fingerprint != fingerprint or info.parts != parts:
            return None
        for relative, written in info.files.items():
            if not data.is_whole(relative, written.size, written.sha256):
                reporter.line(f"{data.at(relative)} is missing or damaged: computed again")
                return None
        summary = info.summary
    return summary


def _verified(stage: Stage, data: DataRoot, scene: str, part: int, reporter: Reporter) -> bool:
    """Whether the files of a fresh shard have the digests that the rows of `recordings` say."""
    if "recordings" not in stage.writes:
        return True
    from aerialdojo_gen.store.tables import read_file

    try:
        name = store.shard_name("recordings", scene, part)
        rows = read_file(data.local_copy(name), ["path", "sha256", "bytes"], data.at(name)).to_pylist()
    except DamagedFile as error:
        reporter.line(f"{error}: computed again")
        return False
    for row in rows:
        if not data.is_whole(row["path"], row["bytes"], row["sha256"], reread=True):
            reporter.line(f"{data.at(row['path'])} has other content than was written: computed again")
            return False
    return True


def scene_fingerprint(stage: Stage, pipeline: Pipeline, roots: ProjectPaths, scene: str) -> str:
    """Hash all that a scene's shards depend on: code, configuration, and inputs by their content."""
    # Not by the inputs' fingerprints: where an earlier stage writes the same rows again, nothing after it is stale.
    code = stage_code(stage.name, stage.idle(pipeline.section(stage.name)))
    # The paper's figures are next to the package in a checkout, inside it in a wheel.
    figures = paper_figures.files() if "aerialdojo_gen.base.paper_figures" in code.parts else []
    sources = [*stage.sources(roots, scene), *figures]
    facts = {
        "stage": stage.name,
        "code": code.digest,
        "scene": scene,
        "seed": pipeline.seed,
        "embodiment": pipeline.embodiment.model_dump(mode="json"),
        "config": _values(pipeline.section(stage.name)),
        "inputs": {table: store.content(roots.data, table, scene) for table in stage.reads},
        "assets": [[_short(path, roots), _digest(path)] for path in sources],
    }
    texts = {name: json.dumps(value, sort_keys=True) for name, value in facts.items()}
    texts["schemas"] = _schemas((*stage.writes, *stage.reads))
    # As json.dumps would write it; the schemas are long, and the same for all scenes.
    whole = ", ".join(f'"{name}": {texts[name]}' for name in sorted(texts))
    return hashlib.sha256(f"{{{whole}}}".encode()).hexdigest()


@lru_cache(maxsize=4096)
def _short(path: Path, roots: ProjectPaths) -> str:
    """Return a file's path relative to its source folder: the same in every checkout and in a wheel."""
    for name in SOURCE_FOLDERS:
        folder = getattr(roots, name)
        if path.is_relative_to(folder):
            return f"{name}/{path.relative_to(folder).as_posix()}"
    return path.name


def _digest(path: Path) -> str:
    try:
        return file_digest(path)
    except OSError as error:
        raise AssetError(f"cannot read {path}: {error.strerror}") from None


def _values(section: Section) -> dict[str, Any]:
    """Values of a section, without paths: files count by their bytes."""

    def without_paths(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: without_paths(inner) for key, inner in value.items() if not isinstance(inner, Path)}
        return value

    values: dict[str, Any] = without_paths(section.model_dump())
    return values


@cache
def _schemas(tables: tuple[str, ...]) -> str:
    return json.dumps({name: _described(name) for name in tables}, sort_keys=True)


def _described(table: str) -> list[Any]:
    spec = store.LAYOUT[table].spec
    fields = [
        [str(field), sorted((k.decode(), v.decode()) for k, v in (field.metadata or {}).items())]
        for field in spec.schema
    ]
    return [fields, spec.key, spec.clusters, spec.plain]
