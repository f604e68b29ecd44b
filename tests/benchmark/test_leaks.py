"""What an agent is handed holds nothing that only the evaluator may know."""

import gc
import types

import numpy as np
import pytest

from aerialdojo_gen.base.secrets import Secrets as Redactor
from aerialdojo_gen.benchmark import AerialDojoEnv
from aerialdojo_gen.benchmark.agents import AgentBase
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.flight import Flight
from aerialdojo_gen.benchmark.runner import Evaluation
from aerialdojo_gen.benchmark.tasks import Selection, read_tasks, select
from aerialdojo_gen.benchmark.worker import RetryPolicy, Worker, WorkUnit
from aerialdojo_gen.store import shards as store

SENSORS = Sensors(("front", "down"), width=24, height=16)
# What belongs to the program, not to what was handed out.
_PROGRAM = (type, types.ModuleType, types.FunctionType, types.BuiltinFunctionType, types.CodeType, types.FrameType)


def reachable(*roots):
    """Every object that the roots lead to: attributes, items, cells, bases of arrays; the program's own left out."""
    seen, queue = {}, list(roots)
    while queue:
        thing = queue.pop()
        if id(thing) in seen or (isinstance(thing, _PROGRAM) and not getattr(thing, "__closure__", None)):
            continue
        seen[id(thing)] = thing
        if isinstance(thing, types.FunctionType):
            queue += [cell.cell_contents for cell in thing.__closure__]
            continue
        if isinstance(thing, np.ndarray) and thing.base is not None:
            queue.append(thing.base)
        queue += gc.get_referents(thing)
    return list(seen.values())


class Secrets:
    """What only the evaluator may know of a task."""

    def __init__(self, data, task):
        row = task.row
        routes, objects = (
            store.read_scene(data, table, row["scene"]).to_pylist()
            for table in (f"routes/{row['subset']}", "release/objects")
        )
        route = next(r for r in routes if r["nav_id"] == row["nav_id"])
        target = next(o for o in objects if o["object_id"] == route["target_object_id"])
        goal = np.array([route["goal_x_m"], route["goal_y_m"], route["goal_z_m"]])
        path = np.array([route["x_m"], route["y_m"], route["z_m"]]).T
        known = np.concatenate([
            goal, path.ravel(), np.linalg.norm(path - goal, axis=1), route["yaw_rad"], [route["goal_yaw_rad"]],
            [route["euclidean_m"], route["length_m"], route["detour_ratio"], route["min_clearance_m"]],
            [target[k] for k in ("x_m", "y_m", "z_m", "size_x_m", "size_y_m", "size_z_m")],
        ])  # fmt: skip
        # Round numbers (0 m, 1 m, a right angle) tell nothing, and stand everywhere.
        self.numbers = known[np.abs(known * 1000 - np.rint(known * 1000)) > 1e-6]
        self.words = [
            row["task_id"], row["nav_id"], row["scene"], target["mesh_node"], target["reference_image_id"], str(data),
            "/meshes", ".glb", ".parquet",
        ]  # fmt: skip

    def found(self, *roots):
        """What of it the roots lead to; depth, which is float32, is seen."""
        hits = []
        for thing in reachable(*roots):
            if isinstance(thing, str | bytes):
                text = thing if isinstance(thing, str) else thing.decode("latin-1")
                hits += [word for word in self.words if word in text]
            elif isinstance(thing, float) or (isinstance(thing, np.ndarray) and thing.dtype == np.float64):
                values = np.ravel(thing)
                hits += values[(np.abs(values[:, None] - self.numbers) < 1e-5).any(axis=1)].tolist()
        return hits


class Spy(AgentBase):
    """Keeps all that it is handed."""

    sensors = SENSORS

    def __init__(self):
        self.handed = []

    def reset(self, goal):
        self.handed.append(goal)

    def act(self, observation):
        self.handed.append(observation)
        return [1, 14, 10, 4, 0][min(observation.step, 4)]


def tasks_of(data, modality, n=2):
    return read_tasks(data, select(data, Selection(modalities=(modality,), limit=n)))


@pytest.mark.parametrize("modality", ["semantic", "image"])
def test_an_agent_gets_nothing_of_the_evaluators(smoke, tmp_path, modality):
    rows = select(smoke, Selection(modalities=(modality,), limit=1))
    task = read_tasks(smoke, rows)[0]
    spy = Spy()
    flight = Flight(smoke, SENSORS)
    Worker(spy, flight, smoke, Evaluation().identity(), RetryPolicy(1, 0.0), Redactor()).fly(
        WorkUnit(task.row["scene"], rows, tmp_path / "j.jsonl"), lambda _: None, lambda: False
    )
    assert len(spy.handed) >= 3
    secrets = Secrets(smoke, task)
    assert len(secrets.numbers) > 20
    assert secrets.found(spy) == []
    kinds = {type(thing).__name__ for thing in reachable(spy)}
    assert not kinds & {"Flight", "Episode", "FlightSpace", "Scene", "Task", "Instance", "CollisionWorld", "Table"}
    # The walk would have seen it: it does in what the evaluator keeps.
    kept = secrets.found(flight)
    assert any(isinstance(hit, float) for hit in kept)
    assert any(isinstance(hit, str) for hit in kept)


@pytest.mark.parametrize("hidden", ["attribute", "closure", "array", "slot", "text"])
def test_the_walk_finds_what_is_hidden(smoke, hidden):
    task = tasks_of(smoke, "semantic", 1)[0]
    secrets, spy = Secrets(smoke, task), Spy()
    x = task.goal[0] if abs(task.goal[0] * 1000 % 1) > 1e-3 else task.euclidean_m
    assert secrets.found(spy) == []

    class Slotted:
        __slots__ = ("x",)

    slotted = Slotted()
    slotted.x = x
    spy.handed = {
        "attribute": [types.SimpleNamespace(deep={"er": (x,)})],
        "closure": [lambda: x],
        "array": [np.array([[1.0, x]])[:, :1]],
        "slot": [slotted],
        "text": [b"id=" + task.row["nav_id"].encode()],
    }[hidden]
    assert secrets.found(spy), hidden


@pytest.mark.parametrize("modality", ["semantic", "image"])
def test_observations_and_infos_of_the_environment_hold_nothing_either(smoke, modality):
    env = AerialDojoEnv(smoke, sensors=SENSORS, modality=modality)
    for task in tasks_of(smoke, modality):
        secrets = Secrets(smoke, task)
        handed = [*env.reset(options={"task_id": task.row["task_id"]})]
        for action in (1, 15, 10, 3, 0):
            handed += [*env.step(action)]
            if handed[-1]["reason"]:
                break
        last, infos = handed.pop(), [info for info in handed if isinstance(info, dict) and "reason" in info]
        assert last["reason"], "the episode is over"
        assert len(infos) >= 2
        assert secrets.found(handed, env.action_space) == []
        assert all(info == {"reason": ""} for info in infos)
        assert set(last) == {"reason", "task_id", "success", "distance_m"}
