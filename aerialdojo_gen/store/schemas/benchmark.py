"""The tables of the benchmark: what an agent did. All of it is the evaluator's: an agent sees none of them."""

from __future__ import annotations

import pyarrow as pa

from aerialdojo_gen.store.schemas.release import TASKS
from aerialdojo_gen.store.schemas.staged import EUCLIDEAN, SCENE, column, table, xyz

RUN = column("run_id", pa.string(), "name of the evaluation run")
TASK_ID = column("task_id", pa.string(), "the task instance")

EPISODES = table(
    "episodes", ["run_id", "task_id"],
    RUN,
    column("agent", pa.string(), "name of the agent, or package.module:Class"),
    column("agent_options", pa.string(), "the agent's options, JSON with sorted keys"),
    TASK_ID,
    column("nav_id", pa.string(), "the navigation task, shared by its two instances"),
    SCENE,
    *[TASKS.schema.field(name) for name in ("family", "scene_type", "partition", "subset")],
    column("split", pa.string(), "id_train, id_test, ood_train or ood_test"),
    *[TASKS.schema.field(name) for name in ("setting", "modality", "action_budget")],
    *xyz("start position of the body's centre", "start_"),
    column("start_yaw_rad", pa.float64(), "yaw at the start", "rad"),
    column("success", pa.bool_(), "Stop within 3 m of the goal, without collision, within the budget"),
    column("oracle_success", pa.bool_(), "min_distance_m is at most 3 m, whatever happens later"),
    column("collision", pa.bool_(), "the episode ended in a collision"),
    column("stop_called", pa.bool_(), "the agent chose Stop"),
    column("termination", pa.string(), "stop, collision or budget"),
    column("final_distance_m", pa.float64(), "distance to the goal where the episode ended", "m"),
    column("min_distance_m", pa.float64(),
           "smallest distance to the goal at the start, after any action, or where the episode ended", "m"),
    column("final_horizontal_distance_m", pa.float64(), "final_distance_m in the plane", "m"),
    column("min_horizontal_distance_m", pa.float64(), "smallest such distance at the same poses, in the plane", "m"),
    column("path_length_m", pa.float64(), "metres flown, up to the contact in a collision", "m"),
    column("reference_length_m", pa.float64(), "length of the reference route, L", "m"),
    EUCLIDEAN,
    column("n_actions", pa.int32(), "actions spent, Stop included, refused and unreadable ones too"),
    column("n_refused", pa.int32(), "moves that would have left the flight volume: spent, nothing moved"),
    column("n_invalid", pa.int32(), "answers that named no action: spent, nothing moved"),
    column("n_requests", pa.int32(), "calls of an outside service; null for agents without one", nullable=True),
    column("input_tokens", pa.int64(), "tokens sent, where the service says", nullable=True),
    column("output_tokens", pa.int64(), "tokens received, where the service says", nullable=True),
    column("cost_usd", pa.float64(), "US dollars, where prices are known", nullable=True),
    # An older version's log has none of the columns below: there they are null.
    column("success_view", pa.bool_(),
           "Stop within 3 m of any valid viewpoint of the target, the target in sight, without collision, within the "
           "budget; null where the release has no viewpoints", nullable=True),
    column("viewpoint_distance_m", pa.float64(),
           "distance to the nearest valid viewpoint of the target where the episode ended; null without viewpoints",
           "m", nullable=True),
    column("target_in_sight", pa.bool_(),
           "from where the episode ended a straight line reaches the target unobstructed; null without viewpoints",
           nullable=True),
    column("told", pa.string(), "what the agent was told beside the goal (heading), empty for nothing",
           nullable=True),
)  # fmt: skip

STEPS = table(
    "steps", ["run_id", "task_id", "step"],
    RUN,
    TASK_ID,
    SCENE,
    column("step", pa.int32(), "number of the action in its episode, from 0"),
    column("action", pa.int8(), "the action; null for an answer that named none", nullable=True),
    column("refused", pa.bool_(), "the move would have left the flight volume: nothing moved"),
    *xyz("position of the body's centre after the action"),
    column("yaw_rad", pa.float64(), "yaw after the action", "rad"),
    column("distance_m", pa.float64(), "distance to the goal after the action", "m"),
    column("answer", pa.string(), "what the agent said, word for word, where it says anything", nullable=True),
)  # fmt: skip

# Apart from the two above, which are the same bytes for a deterministic agent, run after run.
TIMINGS = table(
    "timings", ["run_id", "task_id"],
    RUN,
    TASK_ID,
    SCENE,
    column("wall_s", pa.float64(), "wall time of the episode", "s"),
    column("agent_s", pa.float64(), "wall time inside the agent", "s"),
    column("attempts", pa.int32(), "how often the episode was begun, infrastructure failures and all"),
    column("request_s", pa.float64(), "time of all requests to an outside service; null without one", "s",
           nullable=True),
    column("longest_request_s", pa.float64(), "time of the longest of them", "s", nullable=True),
)  # fmt: skip

FAILURES = table(
    "failures", ["run_id", "task_id"],
    RUN,
    TASK_ID,
    SCENE,
    column("attempts", pa.int32(), "how often the episode was tried"),
    column("kind", pa.string(),
           "what failed: rate limit, server error, time-out, connection lost, malformed answer, content filter, "
           "context too long, bad request, not found, renderer, agent error, unavailable"),
    column("reason", pa.string(), "in words: of a service's answer its first line"),
    column("n_requests", pa.int32(), "calls of an outside service all the same", nullable=True),
    column("input_tokens", pa.int64(), "tokens sent all the same, where the service says", nullable=True),
    column("output_tokens", pa.int64(), "tokens received all the same, where the service says", nullable=True),
    column("cost_usd", pa.float64(), "US dollars spent all the same, where prices are known", nullable=True),
)  # fmt: skip
