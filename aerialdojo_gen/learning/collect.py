"""Collects training data in worker processes: references, flights of a policy, extra views of a scene.

A policy flies training tasks while the planner labels its steps: DAgger (Ross, Gordon, Bagnell 2011).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.constants import RADIUS_M, SUCCESS_RADIUS_M
from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.dataset.contents import part_name, release_fingerprint
from aerialdojo_gen.dataset.episode import Episode
from aerialdojo_gen.learning import parts as part_data
from aerialdojo_gen.learning.encoding import DeadReckoning
from aerialdojo_gen.learning.index import Index
from aerialdojo_gen.learning.labels import blocked_at, scatter_rows, to_body_frame
from aerialdojo_gen.learning.loader import torch_package
from aerialdojo_gen.learning.parts import DaggerRound, Exploration, Part
from aerialdojo_gen.learning.policy import read_network
from aerialdojo_gen.learning.steps import Steps, is_written, read_steps
from aerialdojo_gen.learning.words import Vocabulary
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.pipeline.executors.base import Executor
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.planning.difficulty import agent_actions
from aerialdojo_gen.planning.flight_space import FlightSpace
from aerialdojo_gen.planning.planner import Planner
from aerialdojo_gen.scenes.context import SEVERAL, open_scene
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.schemas import STOP

# Goals' cost-to-go that are kept: those of the episodes that are flown side by side.
_FIELDS_MB = 400.0, 0.0


class Teacher:
    """Says what the reference would do at a pose: the first action of the route that a release has from there."""

    def __init__(self, scene: Scene, radius_m: float = RADIUS_M) -> None:
        # Who has strayed may be nearer than any task begins, or straight before the goal.
        self._planner = Planner(scene, PlanConfig().model_copy(update={"min_detour_ratio": 0.0}), radius_m)

    def plan(self, goals: Sequence[ArrayLike], poses: Sequence[ArrayLike]) -> list[NDArray[np.int8]]:
        """Plan to goals from poses (metres, radians, world): the actions of each route, Stop at its end, or none."""
        out = [np.zeros(0, np.int8)] * len(poses)
        keys = [np.asarray(goal, np.float64).tobytes() for goal in goals]
        for key in dict.fromkeys(keys):
            rows = [k for k, own in enumerate(keys) if own == key]
            starts = np.array([np.asarray(poses[k], np.float64) for k in rows])
            for k, route in zip(rows, self._planner.plan_target(goals[rows[0]], starts), strict=True):
                if route.outcome == "SOLVED":
                    out[k] = agent_actions(route.actions)
        return out

    def cache_fields(self) -> AbstractContextManager[None]:
        """Keep goals' cost-to-go until the block ends."""
        return self._planner.keeping_fields(*_FIELDS_MB)


# Episodes that are flown side by side.
_PARALLEL_EPISODES = 32
# An episode is over after so many times the reference's actions, and some more: who is lost learns little more.
_TIMES, _MORE = 1.5, 12


class FlownEpisode:
    """One episode under way, and what was written down of it."""

    def __init__(
        self, space: FlightSpace, start: NDArray[np.float64], goal: NDArray[np.float64], budget: int, most: int,
        draw: np.random.Generator,
    ) -> None:  # fmt: skip
        x, y, z, yaw = start.tolist()
        self.space, self.goal, self.draw, self._most = space, goal, draw, most
        self.episode = Episode(space, (x, y, z, yaw), (goal[0], goal[1], goal[2]), budget)
        self.reckoning = DeadReckoning()
        # What the teacher would do from here on; empty where that is not known.
        self.route = np.zeros(0, np.int8)
        # Of every step, what arrays of `Steps` will hold, by their names.
        self.steps: list[dict[str, Any]] = []

    @property
    def pose(self) -> NDArray[np.float64]:
        """x, y, z in metres and yaw in radians, world frame."""
        return np.array([*self.episode.position, self.episode.yaw_rad])

    def note(self, frame: NDArray[np.uint8]) -> None:
        """Write down a step before it is flown."""
        self.steps.append({
            "label": int(self.route[0]), "odometry": self.reckoning.odometry, "pose": self.pose,
            "blocked": blocked_at(self.space, self.pose)[0], "frames": frame,
        })  # fmt: skip

    def fly(self, chosen: int) -> bool:
        """Fly the policy's action, or the teacher's where that ends it or moves nothing; False when it is over."""
        if chosen == STOP and self.episode.distance_m <= SUCCESS_RADIUS_M:
            return False
        label = self.steps[-1]["label"]
        if chosen == STOP or self.steps[-1]["blocked"][chosen]:
            if label == STOP:
                return False
            chosen = label
        self.episode.step(chosen)
        # Who does what a route says is still on it; a new search from there would find its rest, or one as good.
        self.route = self.route[1:] if chosen == self.route[0] and not self.episode.refused else self.route[:0]
        self.reckoning.add(chosen, self.episode.refused)
        return self.episode.termination is None and len(self.steps) < self._most


def flights(part: Part, dagger_round: DaggerRound) -> Steps:
    """Fly a part's tasks.

    The policy's actions are flown, now and then the teacher's; where the policy would stop too early, collide or
    leave the flight volume the teacher's are, so that an episode goes on. Every step is labelled with what the
    teacher does there: a route's first action, the next where that was done.
    """
    torch = torch_package()
    torch.set_num_threads(1)
    index, space, radius_m = part.index(), part.space, Embodiment().radius_m
    context = open_scene(*mesh_of(part.data, part.scene), SEVERAL)
    teacher = context.part("teacher", lambda: Teacher(context.scene, radius_m), radius_m)
    network, about = read_network(dagger_round.weights)
    network.eval()
    goals, columns = part_data.goal_poses(part, index), part_data.goals_of(part, index)
    order = np.lexsort((np.arange(len(index)), *index.goal.T))
    flown: dict[int, FlownEpisode] = {}
    with torch.inference_mode(), teacher.cache_fields():
        for k in range(0, len(order), _PARALLEL_EPISODES):
            rows = order[k : k + _PARALLEL_EPISODES]
            own = [
                FlownEpisode(
                    space, index.start[r], goals[r], int(index.budget[r]), int(_TIMES * index.steps[r]) + _MORE,
                    rng.generator(dagger_round.seed, "dagger", dagger_round.round, index.nav_id[r]),
                )
                for r in rows
            ]  # fmt: skip
            shown = np.array([bool(one.draw.random() < 0.5) for one in own]) & (columns["image"][rows] >= 0)
            goal = _encoded_goal(torch, network, about.vocabulary, columns, rows, shown)
            _fly(torch, network, part, teacher, own, dagger_round.teacher_share, goal)
            flown |= dict(zip(rows.tolist(), own, strict=True))
    return _steps([flown[r] for r in range(len(index))], columns, part)


def _encoded_goal(
    torch: Any, network: Any, vocabulary: Vocabulary, columns: dict[str, Any], rows: NDArray[np.int64],
    shown: NDArray[np.bool_],
) -> Any:  # fmt: skip
    shown = shown | ~columns["semantic"][rows]
    images = scatter_rows(columns["images"][columns["image"][rows[shown]]], shown)
    texts = columns["text"][rows, 1 - shown.astype(np.int64)].tolist()
    tokens = np.array([vocabulary.encode(text) for text in texts])
    return network.encode_goal(torch.from_numpy(tokens), torch.from_numpy(images), torch.from_numpy(shown))


def _fly(
    torch: Any, network: Any, part: Part, teacher: Teacher, flown: list[FlownEpisode], teacher_share: float, goal: Any
) -> None:
    going = list(range(len(flown)))
    memory = network.blank(len(flown))
    while going:
        unplanned = [flown[k] for k in going if not len(flown[k].route)]
        routes = teacher.plan([f.goal for f in unplanned], [f.pose for f in unplanned])
        for one, route in zip(unplanned, routes, strict=True):
            one.route = route
        going = [k for k in going if len(flown[k].route)]
        if not going:
            return
        own = [flown[k] for k in going]
        frames = part_data.pictures(part, np.array([f.pose for f in own]))
        for one, frame in zip(own, frames, strict=True):
            one.note(frame)
        output, memory[going] = network(
            torch.from_numpy(frames) if part.sensors.views else None,
            goal[going],
            torch.from_numpy(np.stack([f.reckoning.odometry for f in own])[:, None]),
            torch.ones((len(going), 1), dtype=torch.bool),
            memory[going],
        )
        back = torch.from_numpy(np.stack([f.reckoning.back for f in own])[:, None])
        chosen = output.actions(back)[:, 0].tolist()
        by_teacher = [one.draw.random() < teacher_share for one in own]
        actions = [one.steps[-1]["label"] if by else a for one, by, a in zip(own, by_teacher, chosen, strict=True)]
        going = [k for k, action in zip(going, actions, strict=True) if flown[k].fly(action)]


def _steps(flown: list[FlownEpisode], columns: dict[str, Any], part: Part) -> Steps:
    def noted(name: str, kind: Any, *shape: int) -> NDArray[Any]:
        return np.array([step[name] for f in flown for step in f.steps], kind).reshape(sum(counts), *shape)

    counts = [len(f.steps) for f in flown]
    poses = noted("pose", np.float64, 4)
    goals = np.repeat(np.array([f.goal[:3] for f in flown]).reshape(-1, 3), counts, axis=0)
    return Steps(
        frames=noted("frames", np.uint8, len(part.sensors.views), *part.image_shape),
        first=np.cumsum([0, *counts], dtype=np.int64), label=noted("label", np.int64),
        odometry=noted("odometry", np.float32, 4), offset=to_body_frame(poses, goals).astype(np.float32),
        pose=poses.astype(np.float32), blocked=noted("blocked", np.bool_, N_ACTIONS), **columns,
    )  # fmt: skip


# Trajectories per part: seconds of work, so that parts finish at about the same time.
_PART = 64
_VIEWS_PER_PART = 2000
_MEMORY_MB = 1500


def parts_of(common: Part, index: Index, seed: int) -> list[Part]:
    """Split trajectories into parts, each in a folder of the common one, named by all that its content depends on."""
    flown = common.dagger_round
    facts = [*_facts(common), flown and [flown.sha256, flown.seed, flown.round, flown.teacher_share]]
    parts = []
    for number, scene in enumerate(index.scenes):
        rows = np.flatnonzero(index.scene == number)
        # Goal images come from another stage: the same trajectories may have others.
        shown = common.data.digest(part_name("release/objects", scene))
        if flown is None:
            # In the order of `sample_evenly`: with another limit all parts but the last stay the same.
            rows = rows[np.argsort([rng.rank(seed, "learning", index.nav_id[k]) for k in rows], kind="stable")]
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


def _facts(common: Part) -> list[Any]:
    s, modules = common.sensors, ["rendering.gl", "learning.parts"]
    # References do not depend on the network that flies later.
    if common.dagger_round:
        modules.append("learning.collect")
    code = [code_of(f"aerialdojo_gen.{name}").digest for name in modules]
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


def make_part(part: Part) -> int:
    """Make one part and write it; return how many trajectories it has."""
    if part.exploration is not None:
        steps = part_data.collect_views(part, part.exploration)
    else:
        steps = flights(part, part.dagger_round) if part.dagger_round else part_data.references(part)
    steps.write(part.folder)
    return len(part)
