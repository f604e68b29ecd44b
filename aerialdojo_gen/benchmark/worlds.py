"""Worlds on demand: releases of worlds from seeds, made in the background and kept in the cache."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import AerialDojoError, UsageError, first_line
from aerialdojo_gen.base.names import as_names, choose_scenes
from aerialdojo_gen.base.shipped import home
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.scenes.worlds.kinds import type_names
from aerialdojo_gen.scenes.worlds.world import MAX_SEED, World
from aerialdojo_gen.store.cache import Cache


class WorldMaker:
    """Makes releases of worlds in the cache, each once; parameters as of `WorldsEnv`, where `folder` is ``cache``."""

    def __init__(
        self, types: str | Sequence[str], start_seed: int = 1000, num_worlds: int = 1, *,
        knobs: Mapping[str, float] | None = None, held_out: bool = False, n_objects: int = 40,
        folder: Path | None = None,
    ) -> None:  # fmt: skip
        if num_worlds < 1 or start_seed < 0 or start_seed + num_worlds - 1 > MAX_SEED:
            raise UsageError(
                f"start_seed and num_worlds: seeds from 0 to {MAX_SEED:,}, and at least 1 world, "
                f"not {num_worlds} from {start_seed}"
            )
        names = choose_scenes(as_names(types), type_names(home() / "scene_assets"), "type")
        seeds = range(start_seed, start_seed + num_worlds)
        self.worlds = [World(name, seed, dict(knobs or {}), held_out) for seed in seeds for name in names]
        self._n_objects = n_objects
        self._cache = Cache(folder)
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="worlds")
        self._coming: dict[str, Future[Path]] = {}
        self._lock = threading.Lock()
        self._waiting = 0  # worlds that are not there yet
        self._child: subprocess.Popen[str] | None = None
        self._closed = False

    def root(self, world: World) -> Path:
        """Return the data directory of a world; it is made where it is not there."""
        self.prepare(world)
        return self._coming.pop(world.name).result()

    def prepare(self, world: World) -> None:
        """Begin to make a world in the background, after those that wait already and in the same process."""
        if self._closed:
            raise RuntimeError("the worlds are closed")
        if world.name not in self._coming:
            with self._lock:
                self._waiting += 1
            self._coming[world.name] = self._pool.submit(self._find_or_make, world)

    def close(self) -> None:
        """Stop what is being made; a second call does nothing."""
        with self._lock:
            self._closed = True
            if self._child is not None:
                self._child.kill()
        self._pool.shutdown(cancel_futures=True)

    def _find_or_make(self, world: World) -> Path:
        made_of = (__version__, world.version, world.name, sorted(world.knobs.items()), self._n_objects)
        name = hashlib.blake2b(repr(made_of).encode(), digest_size=16, person=b"world").hexdigest()
        try:
            return self._cache.make(name, lambda folder: self._make(world, folder)) / "data"
        finally:
            with self._lock:
                self._waiting -= 1
                done, self._child = (None, self._child) if self._waiting else (self._child, None)
            if done is not None:  # an idle process would keep its memory
                done.communicate()

    def _make(self, world: World, folder: Path) -> None:
        """Let the process write a world's plan and its release into a folder; it starts where there is none."""
        with self._lock:
            if self._closed:
                raise AerialDojoError(f"{world.name}: the worlds were closed while it was made")
            child = self._child = self._child or subprocess.Popen(
                [sys.executable, "-m", __name__],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            )  # fmt: skip
        assert child.stdin is not None
        assert child.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            print(json.dumps([asdict(world), self._n_objects, str(folder)]), file=child.stdin, flush=True)
        if said := child.stdout.readline():
            failure = json.loads(said)
        else:
            child.communicate()
            self._child, failure = None, f"its process ended with {child.returncode}"
        if failure:
            raise AerialDojoError(f"{world.name} could not be made: {failure}")


def make_worlds(types: str | Sequence[str], **options: Any) -> list[Path]:
    """Return the data directories of worlds, made where they are not there; this process keeps them in the cache."""
    maker = WorldMaker(types, **options)
    try:
        for world in maker.worlds:
            maker.prepare(world)
        return [maker.root(world) for world in maker.worlds]
    finally:
        maker.close()


def _write_release(world: World, n_objects: int, folder: Path) -> None:
    """Write a world's plan and its release; the stages find what drafting has built on the scene."""
    from aerialdojo_gen.dataset.build import run_pipeline
    from aerialdojo_gen.imports.worlds import VaryOptions, vary

    options = VaryOptions(world.knobs, world.held_out, n_objects)
    vary([world.type], range(world.seed, world.seed + 1), folder, options)
    run_pipeline(folder / "pipeline.toml", data=folder / "data", workers=1)


def _serve() -> None:
    """Make the worlds that lines of the standard input ask for, and answer each with what went wrong, or nothing."""
    # What stages and libraries print is no answer.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        made_of, n_objects, into = json.loads(line)
        failure = ""
        try:
            _write_release(World(**made_of), n_objects, Path(into))
        except AerialDojoError as error:
            failure = str(error)
        except Exception as error:
            failure = f"{type(error).__name__}: {first_line(error)}"
        print(json.dumps(failure), file=answers, flush=True)


if __name__ == "__main__":
    _serve()
