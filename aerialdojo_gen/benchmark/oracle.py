"""The self-test of the dataset: every reference trajectory, flown as an agent would, ends in success."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pyarrow.compute as pc

from aerialdojo_gen.benchmark.episode import Episode
from aerialdojo_gen.benchmark.flight import SUCCESS_RADIUS_M
from aerialdojo_gen.benchmark.motion import flight_space
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of, read_tasks, reference_actions, select
from aerialdojo_gen.config import Embodiment
from aerialdojo_gen.schemas import APPROACH


@dataclass(frozen=True)
class SelfTest:
    """What the references of a scene achieve.

    Attributes
    ----------
    episodes, actions : int
        Navigation tasks, one episode each, and actions flown.
    unsuccessful : tuple of str
        Navigation tasks whose reference does not end in success: it collides, leaves the flight volume, stops too
        far away, or exceeds the budget.
    spl_sum : float
        Sum of the episodes' success weighted by path length; at most `episodes`.
    """

    episodes: int
    actions: int
    unsuccessful: tuple[str, ...]
    spl_sum: float


def self_test(
    data: Path, scene: str, radius_m: float = SUCCESS_RADIUS_M, embodiment: Embodiment | None = None
) -> SelfTest:
    """Fly a scene's reference trajectories without Approach, by the motion and collision of the environment.

    Parameters
    ----------
    data : Path
        The data directory, with release and meshes.
    scene : str
    radius_m : float
        How near to the goal a Stop must be.
    embodiment : Embodiment, optional

    Returns
    -------
    SelfTest
    """
    rows = select(data, Selection(scenes=(scene,)))
    # Both instances of a navigation task share everything but the goal's representation: one episode tells.
    rows = rows.filter(pc.equal(rows["modality"], "semantic"))
    actions = reference_actions(data, scene, rows["subset"].unique().to_pylist())
    space = flight_space(*mesh_of(data, scene), (embodiment or Embodiment()).radius_m)
    flown, spl, unsuccessful = 0, 0.0, []
    for task in read_tasks(data, rows):
        episode = Episode(space, task.start, task.goal, task.row["action_budget"])
        for action in actions[task.row["nav_id"]]:
            if episode.termination is None and action != APPROACH:
                episode.step(action)
        flown += episode.n_actions
        if episode.success(radius_m) and not episode.n_refused:
            spl += task.length_m / max(task.length_m, episode.path_length_m)
        else:
            unsuccessful.append(task.row["nav_id"])
    return SelfTest(rows.num_rows, flown, tuple(unsuccessful), spl)
