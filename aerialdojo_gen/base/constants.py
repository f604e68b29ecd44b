"""Words and numbers that tables, planner, cameras and agents share: actions, outcomes, settings, views."""

from __future__ import annotations

# The action set (paper, section on the action space); `APPROACH` stands in reference trajectories only.
ACTION_NAMES = (
    "Stop",
    "MoveForward1", "MoveForward3", "MoveForward5",
    "MoveLeft1", "MoveLeft3", "MoveLeft5",
    "MoveRight1", "MoveRight3", "MoveRight5",
    "MoveUp1", "MoveUp2", "MoveDown1", "MoveDown2",
    "TurnLeft15", "TurnRight15",
    "Approach",
)  # fmt: skip
STOP, MOVE_UP_1, MOVE_DOWN_1, TURN_LEFT, TURN_RIGHT, APPROACH = 0, 10, 12, 14, 15, 16

OUTCOMES = (
    "SOLVED", "START_IN_COLLISION", "GOAL_IN_COLLISION", "NO_PATH", "NEAR_STRAIGHT", "BUDGET_EXHAUSTED", "NOT_NEEDED",
)  # fmt: skip
SETTINGS = ("base", "standard", "long_horizon")
MODALITIES = ("semantic", "image")
SUBSETS = ("id_train", "id_test", "ood_train", "ood_test")
DIRECTIONS = ("east", "northeast", "north", "northwest", "west", "southwest", "south", "southeast")
VIEWS = ("front", "left", "right", "down")
# From here on obstacles cost a route something: its `plan_detour`, length over the shortest without obstacles.
DETOUR = 1.05
# The drone's body, and its cameras' horizontal field of view.
RADIUS_M = WHEELBASE_M = 0.25
FOV_DEG = 90.0
# The paper's; other radii are computed from the log of distances.
SUCCESS_RADIUS_M = 3.0
# How far from its goal an agent may be that has flown all of a route's actions, which are without the Approach.
NEAR_GOAL_M = 1.0
# What ends an episode (benchmark): an agent's Stop, a collision, or the last action of the budget.
TERMINATIONS = ("stop", "collision", "budget")
FAMILIES = {"U": "Urban", "N": "Natural", "I": "Infrastructure", "D": "Disaster"}
