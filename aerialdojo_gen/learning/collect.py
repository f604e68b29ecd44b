"""Collects training data in worker processes: references, flights of a policy, extra views of a scene."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.dataset.contents import part_name, release_fingerprint
from aerialdojo_gen.learning.index import Index
from aerialdojo_gen.learning.parts import Exploration, Part, collect_views, references
from aerialdojo_gen.learning.steps import Steps, is_written, read_steps
from aerialdojo_gen.learning.trajectories import sampling_key
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.pipeline.executors import Executor
from aerialdojo_gen.pipeline.executors.channels import WorkerChannel
from aerialdojo_gen.pipeline.progress import Reporter

# Trajectories per part: seconds of work, so that parts finish at about the same time.
_PART = 64
_VIEWS_PER_PART = 2000
_MEMORY_MB = 1500


def parts_of(common: Part, index: Index, seed: int) -> list[Part]:
    """Split trajectories into parts, each in a folder of the common one, named by all that its content depends on."""
    # References do not depend on the network that flies later.
    flown = common.dagger_round
    facts = [*_facts(common, *(["flights"] if flown else [])),
             flown and [flown.sha256, flown.seed, flown.round, flown.teacher_share]]  # fmt: skip
    parts = []
    for number, scene in enumerate(index.scenes):
        rows = np.flatnonzero(index.scene == number)
        # Goal images come from another stage: the same trajectories may have others.
        shown = common.data.digest(part_name("release/objects", scene))
        if flown is None:
            # In sampling order: with another limit all parts but the last stay the same.
            rows = rows[np.argsort([sampling_key(seed, index.nav_id[k]) for k in rows], kind="stable")]
            shares = [rows[k : k + _PART] for k in range(0, len(rows), _PART)]
        else:
            # Sorted by goal: its cost-to-go is computed once.
            rows = rows[np.lexsort((rows, *index.goal[rows].T))]
            shares = np.array_split(rows, -(-len(rows) // _PART))
        for own in shares:
            piece = index.take(own)
            parts.append(_part(common, scene, [facts, piece.digest, shown], nav_ids=tuple(piece.nav_id)))
    return parts


def view_parts(common: Part, scenes: Sequence[str], looks: int, seed: int, target_split: str | None) -> list[Part]:
    """Make parts of extra views."""
    common = replace(common, settings=())
    facts, parts = [*_facts(common), release_fingerprint(common.data), common.splits], []
    for scene in scenes:
        for number, begin in enumerate(range(0, looks, _VIEWS_PER_PART)):
            own = Exploration(min(_VIEWS_PER_PART, looks - begin), seed, number, target_split)
            parts.append(_part(common, scene, [facts, asdict(own)], exploration=own))
    return parts


def _facts(common: Part, *modules: str) -> list[Any]:
    s, names = common.sensors, ("rendering.gl", *(f"learning.{name}" for name in ("parts", *modules)))
    code = [code_of(f"aerialdojo_gen.{name}").digest for name in names]
    return [s.views, s.width, s.height, s.fov_deg, s.max_depth_m, common.renderer, code]


def _part(common: Part, scene: str, facts: list[Any], **own: Any) -> Part:
    text = json.dumps([facts, mesh_of(common.data, scene)[1]], sort_keys=True)
    name = f"{scene}-{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    return replace(common, scene=scene, folder=common.folder / name, **own)


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
        steps = collect_views(part, part.exploration)
    elif part.dagger_round is None:
        steps = references(part)
    else:
        from aerialdojo_gen.learning.flights import flights

        steps = flights(part, part.dagger_round)
    steps.write(part.folder)
    return len(part)
