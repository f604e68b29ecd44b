"""Logs of made-up runs over all 42 scenes, in memory or written as the runner writes them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.paper_figures import inventory
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.tables import from_rows

# Stop called, collision, typical distance at the end: a good agent, a middling one, a bad one, a hopeless one.
AGENTS = {
    "oracle": (1.0, 0.0, 0.5), "explorer": (0.55, 0.15, 9.0), "random": (0.35, 0.4, 22.0), "weak": (0.04, 0.4, 15.0)
}  # fmt: skip


def episode(run: str, agent: str, scene: str, k: int, draws: np.random.Generator) -> dict[str, Any]:
    stop, crash, spread_m = AGENTS[agent]
    reference_m = float(draws.uniform(5, 100))
    setting = schemas.SETTINGS[int(np.searchsorted([30, 60], reference_m, side="right"))]
    budget = {"base": 90, "standard": 180, "long_horizon": 300}[setting]
    collision = bool(draws.random() < crash)
    stopped = not collision and bool(draws.random() < stop)
    final_m = float(spread_m * draws.weibull(1.2))
    least_m = final_m * float(draws.uniform(0.3, 1.0))
    split = f"{store.partition(scene)}_test"
    modality = ("semantic", "image")[k % 2]
    asks = agent == "explorer"
    return {
        "run_id": run, "agent": agent, "agent_options": "{}", "task_id": f"{scene}_{k:04d}{modality[0]}",
        "nav_id": f"{scene}_{k:04d}", "scene": scene, "family": schemas.FAMILIES[scene[0]],
        "scene_type": scene.split("_")[1], "partition": store.partition(scene).upper(), "subset": "test",
        "split": split, "setting": setting, "modality": modality, "action_budget": budget,
        "start_x_m": 0.0, "start_y_m": 0.0, "start_z_m": 2.0, "start_yaw_rad": 0.0,
        "success": stopped and final_m <= 3.0, "oracle_success": least_m <= 3.0, "collision": collision,
        "stop_called": stopped, "termination": "collision" if collision else "stop" if stopped else "budget",
        "final_distance_m": final_m, "min_distance_m": least_m, "final_horizontal_distance_m": 0.8 * final_m,
        "min_horizontal_distance_m": 0.8 * least_m, "path_length_m": reference_m * float(draws.uniform(0.9, 2.5)),
        "reference_length_m": reference_m, "euclidean_m": 0.8 * reference_m,
        "n_actions": int(draws.integers(1, budget)) if stopped or collision else budget,
        "n_refused": int(draws.integers(0, 3)), "n_invalid": int(draws.integers(0, 2)) if asks else 0,
        "n_requests": 40 if asks else None, "input_tokens": 52_000 if asks else None,
        "output_tokens": 1_900 if asks else None, "cost_usd": 0.21 if asks else None,
        "success_view": None, "viewpoint_distance_m": None, "target_in_sight": None, "told": "",
    }  # fmt: skip


def episodes_in(scene: str, run: str, agent: str, per_scene: int) -> pa.Table:
    """Make a scene's rows of `episodes`."""
    draws = rng.generator(0, "made-up-run", agent, scene)
    return from_rows(schemas.EPISODES, [episode(run, agent, scene, k, draws) for k in range(per_scene)])


def made_run(agent: str, per_scene: int = 6, scenes: Sequence[str] = ()) -> Run:
    """Make a run as it is read from a log, without its steps."""
    table = pa.concat_tables([episodes_in(scene, agent, agent, per_scene) for scene in scenes or sorted(inventory())])
    return Run(agent, agent, agent, "{}", table)


def write_run(data: Path, run: str, agent: str, scenes: Sequence[str], per_scene: int = 6, failed: int = 0) -> None:
    """Write the episodes of a made-up run, and so many failures a scene."""
    for scene in scenes:
        store.write_shard(data, "episodes", scene, 0, episodes_in(scene, run, agent, per_scene), run=run)
        lost = [
            {
                "run_id": run, "task_id": f"{scene}_{per_scene + k:04d}s", "scene": scene, "attempts": 5,
                "kind": "server error", "reason": "HTTP 503", "n_requests": 5, "input_tokens": None,
                "output_tokens": None, "cost_usd": 0.0,
            }
            for k in range(failed)
        ]  # fmt: skip
        store.write_shard(data, "failures", scene, 0, from_rows(schemas.FAILURES, lost), run=run)
