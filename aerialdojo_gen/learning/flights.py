"""A policy flies training tasks while the planner labels its steps: DAgger (Ross, Gordon, Bagnell 2011)."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.constants import RADIUS_M, SUCCESS_RADIUS_M
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.dataset.episode import Episode
from aerialdojo_gen.learning import checkpoints
from aerialdojo_gen.learning.encoding import DeadReckoning
from aerialdojo_gen.learning.geodesic import blocked_actions
from aerialdojo_gen.learning.labels import scatter_rows
from aerialdojo_gen.learning.loader import torch_package
from aerialdojo_gen.learning.parts import DaggerRound, Part, goal_poses, goals_of, offsets, pictures
from aerialdojo_gen.learning.policy import network_of
from aerialdojo_gen.learning.steps import Steps
from aerialdojo_gen.learning.words import Vocabulary
from aerialdojo_gen.planning.difficulty import agent_actions
from aerialdojo_gen.planning.flight_space import FlightSpace, flight_space
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

    def ways(self, goals: Sequence[ArrayLike], poses: Sequence[ArrayLike]) -> list[NDArray[np.int8]]:
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
        self, space: FlightSpace, start: NDArray[np.float64], goal: NDArray[np.float64], budget: int
    ) -> None:
        x, y, z, yaw = start.tolist()
        self.space, self.goal = space, goal
        self.episode = Episode(space, (x, y, z, yaw), (goal[0], goal[1], goal[2]), budget)
        self.reckoning = DeadReckoning()
        # What the teacher would do from here on; empty where that is not known.
        self.way = np.zeros(0, np.int8)
        self.labels: list[int] = []
        self.odometry: list[NDArray[np.float32]] = []
        self.poses: list[NDArray[np.float64]] = []
        self.blocked: list[NDArray[np.bool_]] = []
        self.frames: list[NDArray[np.uint8]] = []

    @property
    def pose(self) -> NDArray[np.float64]:
        """x, y, z in metres and yaw in radians, world frame."""
        return np.array([*self.episode.position, self.episode.yaw_rad])

    def note(self, label: int, frame: NDArray[np.uint8], pose: NDArray[np.float64]) -> None:
        """Write down a step before it is flown."""
        self.labels.append(label)
        self.odometry.append(self.reckoning.odometry)
        self.poses.append(pose)
        collides, refused, _ = blocked_actions(self.space, pose)
        self.blocked.append((collides | refused)[0])
        self.frames.append(frame)

    def fly(self, chosen: int, label: int) -> bool:
        """Fly the policy's action, or the teacher's where that ends it or moves nothing; False when it is over."""
        if chosen == STOP and self.arrived:
            return False
        if chosen == STOP or self.blocked[-1][chosen]:
            if label == STOP:
                return False
            chosen = label
        self.episode.step(chosen)
        # Who does what a route says is still on it; a new search from there would find its rest, or one as good.
        self.way = self.way[1:] if chosen == self.way[0] and not self.episode.refused else self.way[:0]
        self.reckoning.add(chosen, self.episode.refused)
        return self.episode.termination is None

    @property
    def arrived(self) -> bool:
        """Whether a Stop here is a success."""
        return self.episode.distance_m <= SUCCESS_RADIUS_M


def flights(part: Part, dagger_round: DaggerRound) -> Steps:
    """Fly a part's tasks.

    The policy's actions are flown, now and then the teacher's; where the policy would stop too early, collide or
    leave the flight volume the teacher's are, so that an episode goes on. Every step is labelled with what the
    teacher does there: a route's first action, the next where that was done.
    """
    torch = torch_package()
    torch.set_num_threads(1)
    index = part.index()
    body = Embodiment()
    mesh = mesh_of(part.data, part.scene)
    space = flight_space(*mesh, body.radius_m)
    context = open_scene(*mesh, SEVERAL)
    teacher = context.part("teacher", lambda: Teacher(context.scene, body.radius_m), body.radius_m)
    tensors, about, _ = checkpoints.read(dagger_round.weights)
    network = network_of(about, tensors, str(dagger_round.weights)).eval()
    goals, columns = goal_poses(part, index), goals_of(part, index)
    order = np.lexsort((np.arange(len(index)), *index.goal.T))
    flown: dict[int, FlownEpisode] = {}
    with torch.inference_mode(), teacher.cache_fields():
        for k in range(0, len(order), _PARALLEL_EPISODES):
            rows = order[k : k + _PARALLEL_EPISODES]
            own = [FlownEpisode(space, index.start[r], goals[r], int(index.budget[r])) for r in rows]
            most = [int(_TIMES * index.steps[r]) + _MORE for r in rows]
            draws = [rng.generator(dagger_round.seed, "dagger", dagger_round.round, index.nav_id[r]) for r in rows]
            shown = np.array([bool(d.random() < 0.5) for d in draws]) & (columns["image"][rows] >= 0)
            goal = _encoded_goal(torch, network, about.vocabulary, columns, rows, shown)
            _fly(torch, network, part, teacher, own, most, draws, dagger_round.teacher_share, goal)
            flown |= dict(zip(rows.tolist(), own, strict=True))
    return _steps([flown[r] for r in range(len(index))], columns, part)


def _encoded_goal(
    torch: Any, network: Any, vocabulary: Vocabulary, columns: dict[str, Any], rows: NDArray[np.int64],
    shown: NDArray[np.bool_],
) -> Any:  # fmt: skip
    shown = shown | ~columns["semantic"][rows]
    images = scatter_rows(columns["images"][columns["image"][rows[shown]]], shown)
    tokens = np.array(
        [vocabulary.encode(text) for text in columns["text"][rows, 1 - shown.astype(np.int64)].tolist()]
    )
    return network.encode_goal(torch.from_numpy(tokens), torch.from_numpy(images), torch.from_numpy(shown))


def _fly(
    torch: Any, network: Any, part: Part, teacher: Teacher, flown: list[FlownEpisode], most: list[int],
    draws: list[np.random.Generator], teacher_share: float, goal: Any,
) -> None:  # fmt: skip
    going = list(range(len(flown)))
    memory = network.blank(len(flown))
    while going:
        lost = [flown[k] for k in going if not len(flown[k].way)]
        for one, way in zip(lost, teacher.ways([f.goal for f in lost], [f.pose for f in lost]), strict=True):
            one.way = way
        going = [k for k in going if len(flown[k].way)]
        if not going:
            return
        poses, labels = [flown[k].pose for k in going], [int(flown[k].way[0]) for k in going]
        frames = pictures(part, np.array(poses))
        for i, k in enumerate(going):
            flown[k].note(labels[i], frames[i], poses[i])
        last = [flown[k] for k in going]
        thought, memory[going] = network(
            torch.from_numpy(frames) if part.sensors.views else None,
            goal[going],
            torch.from_numpy(np.stack([f.odometry[-1] for f in last])[:, None]),
            torch.ones((len(going), 1), dtype=torch.bool),
            memory[going],
        )
        back = torch.from_numpy(np.stack([f.reckoning.back for f in last])[:, None])
        chosen = thought.actions(back)[:, 0].tolist()
        left = []
        for i, k in enumerate(going):
            action = labels[i] if draws[k].random() < teacher_share else chosen[i]
            if flown[k].fly(action, labels[i]) and len(flown[k].labels) < most[k]:
                left.append(k)
        going = left


def _steps(flown: list[FlownEpisode], columns: dict[str, Any], part: Part) -> Steps:
    counts = [len(f.labels) for f in flown]
    poses = np.array([pose for f in flown for pose in f.poses]).reshape(-1, 4)
    goals = np.repeat(np.array([f.goal[:3] for f in flown]).reshape(-1, 3), counts, axis=0)
    shape = (len(part.sensors.views), part.size_px, part.size_px, 4)
    return Steps(
        frames=np.array([frame for f in flown for frame in f.frames], np.uint8).reshape(-1, *shape),
        first=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        label=np.array([label for f in flown for label in f.labels], np.int64),
        odometry=np.array([o for f in flown for o in f.odometry], np.float32).reshape(-1, 4),
        offset=offsets(poses, goals), pose=poses.astype(np.float32),
        blocked=np.array([one for f in flown for one in f.blocked], np.bool_).reshape(-1, N_ACTIONS), **columns,
    )  # fmt: skip
