"""Collects training data in worker processes: references, flights of a policy, extra views of a scene."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.dataset.contents import part_name, release_fingerprint
from aerialdojo_gen.learning.index import Index
from aerialdojo_gen.learning.parts import DaggerRound, Exploration, Part, references
from aerialdojo_gen.learning.steps import Steps, is_written, read_steps
from aerialdojo_gen.learning.trajectories import sampling_key
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.pipeline.executors.base import Executor, WorkerChannel
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.store.root import DataRoot

# Trajectories per part: seconds of work, so that parts finish at about the same time.
_PART = 64
_VIEWS_PER_PART = 2000
_MEMORY_MB = 1500


def parts_of(
    data: DataRoot, index: Index, folder: Path, selection: tuple[tuple[str, ...], tuple[str, ...]], sensors: Sensors,
    size_px: int, seed: int, renderer: str, dagger_round: DaggerRound | None = None,
) -> list[Part]:  # fmt: skip
    """Split trajectories into parts; a part's folder is named by a digest of all that its content depends on."""
    # References do not depend on the network that flies later.
    modules = ["rendering.gl", "learning.parts", *(["learning.flights"] if dagger_round is not None else [])]
    code, s, flown = [code_of(f"aerialdojo_gen.{name}").digest for name in modules], sensors, dagger_round
    facts = [s.views, s.width, s.height, s.fov_deg, s.max_depth_m, size_px, renderer, code,
             flown and [flown.sha256, flown.seed, flown.round, flown.teacher_share]]  # fmt: skip
    parts = []
    for number, scene in enumerate(index.scenes):
        rows = np.flatnonzero(index.scene == number)
        # Goal images come from another stage: the same trajectories may have others.
        shown = data.digest(part_name("release/objects", scene))
        if dagger_round is None:
            # In sampling order: with another limit all parts but the last stay the same.
            rows = rows[np.argsort([sampling_key(seed, index.nav_id[k]) for k in rows], kind="stable")]
            shares = [rows[k : k + _PART] for k in range(0, len(rows), _PART)]
        else:
            # Sorted by goal: its cost-to-go is computed once.
            rows = rows[np.lexsort((rows, *index.goal[rows].T))]
            shares = np.array_split(rows, -(-len(rows) // _PART))
        for own in shares:
            piece = index.take(own)
            name = _part_name(scene, [facts, piece.digest, mesh_of(data, scene)[1], shown])
            parts.append(Part(
                data, *selection, scene, tuple(piece.nav_id), sensors, size_px, renderer, folder / name, dagger_round,
            ))  # fmt: skip
    return parts


def view_parts(
    data: DataRoot, scenes: Sequence[str], folder: Path, split: str, target_split: str | None, looks: int, seed: int,
    like: Part,
) -> list[Part]:  # fmt: skip
    """Make parts of extra views; cameras and renderer are those of another part."""
    code = [code_of(f"aerialdojo_gen.{name}").digest for name in ("rendering.gl", "learning.exploration_views")]
    s, parts, release = like.sensors, [], release_fingerprint(data)
    for scene in scenes:
        for number, begin in enumerate(range(0, looks, _VIEWS_PER_PART)):
            own = Exploration(min(_VIEWS_PER_PART, looks - begin), seed, number, target_split)
            facts = [s.views, s.width, s.height, s.fov_deg, s.max_depth_m, like.renderer, code, release, split,
                     mesh_of(data, scene)[1], asdict(own)]  # fmt: skip
            parts.append(replace(
                like, splits=(split,), settings=(), scene=scene, nav_ids=(), folder=folder / _part_name(scene, facts),
                dagger_round=None, exploration=own,
            ))  # fmt: skip
    return parts


def _part_name(scene: str, facts: list[Any]) -> str:
    return f"{scene}-{hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:16]}"


def collect(parts: Sequence[Part], executor: Executor, reporter: Reporter, what: str) -> list[Steps]:
    """Compute the missing parts, and read all of them."""
    todo = [part for part in parts if not is_written(part.folder)]
    if todo:
        unit = "trajectories" if todo[0].exploration is None else "looks"
        with reporter.bar(what, sum(map(len, todo)), unit) as bar:
            for done in executor.map(make_part, todo, lambda part: part.scene, memory_mb=_MEMORY_MB):
                if isinstance(done, AerialDojoError):
                    raise done
                bar.advance(done)
    return [read_steps(part.folder) for part in parts]


def make_part(part: Part, link: WorkerChannel | None = None) -> int:
    """Make one part and write it; return how many trajectories it has."""
    del link
    if part.exploration is not None:
        from aerialdojo_gen.learning.exploration_views import collect_views

        steps = collect_views(part, part.exploration)
    elif part.dagger_round is None:
        steps = references(part)
    else:
        from aerialdojo_gen.learning.flights import flights

        steps = flights(part, part.dagger_round)
    steps.write(part.folder)
    return len(part)
