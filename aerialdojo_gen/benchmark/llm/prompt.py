"""What a language model is told: the role, the body, the actions, the rules, and a report before every action.

After the paper's Appendix A: front-facing RGB-D with its encoding, the action list with magnitudes, embodiment,
termination, remaining budget, and one action as JSON.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from aerialdojo_gen.benchmark.goal import Goal, Observation
from aerialdojo_gen.schemas import ACTION_NAMES, APPROACH

CHOICES = ACTION_NAMES[:APPROACH]

_EFFECTS = {
    "Stop": "end the episode; choose it when the target is right in front of you, within a few metres",
    "MoveForward": "fly {} m forward, the way the front camera looks",
    "MoveLeft": "fly {} m to the left without turning",
    "MoveRight": "fly {} m to the right without turning",
    "MoveUp": "climb {} m",
    "MoveDown": "sink {} m",
    "TurnLeft": "turn {}° to the left on the spot",
    "TurnRight": "turn {}° to the right on the spot",
}
_LOOKS = {"front": "ahead", "left": "to the left", "right": "to the right", "down": "straight down"}


@dataclass(frozen=True)
class Turn:
    """An earlier step, as it is told again.

    Attributes
    ----------
    step : int
        Its number, from 0.
    action : str or None
        Name of the action; None where the answer could not be read.
    thought : str
        What the model said of it.
    """

    step: int
    action: str | None
    thought: str = ""


def system_prompt(goal: Goal, views: Sequence[str], depth: bool, max_depth_m: float, fov_deg: float) -> str:
    """Write what holds for the whole episode.

    Parameters
    ----------
    goal : Goal
        Its rules are told; the object itself stands in `goal_text`.
    views : sequence of str
        Cameras whose pictures are sent.
    depth : bool
        Whether depth pictures go with them.
    max_depth_m, fov_deg : float
        Depth that is drawn white; horizontal field of view.

    Returns
    -------
    str
    """
    rules = goal.rules
    cameras = ", ".join(f"{view} (looks {_LOOKS[view]})" for view in views)
    sensors = f"Before every action you see a colour picture from each of these cameras: {cameras}. " if views else ""
    sensors += f"Each camera has a field of view of {fov_deg:g}°." if views else "You see nothing."
    if views and depth:
        sensors += (
            " With each comes a depth picture of the same view, in grey: the value of a pixel is its distance along"
            f" the optical axis, linear from black at 0 m to white at {max_depth_m:g} m; what is farther, or open"
            f" sky, is white. A pixel of value v is v / 255 x {max_depth_m:g} m away."
        )
    return f"""\
You pilot a small drone that searches for one target object in a large outdoor scene. You know the scene only from \
the drone's cameras; there is no map, no GPS and no compass. Find the target, fly up to it, and stop in front of it.

BODY
The drone is a quadrotor with a wheelbase of {rules.wheelbase_m:g} m. It collides with whatever comes within \
{rules.radius_m:g} m of its centre, also while it moves from one place to the next. It always hovers level.

SENSORS
{sensors}

ACTIONS
{_action_list()}
Every action is carried out exactly, unless something stands in the way. A move that would leave the flight area is \
refused: it is spent, and the drone stays where it is.

THE EPISODE ENDS
- when you choose Stop: a success if the drone is then within {rules.success_radius_m:g} m of the viewpoint in front \
of the target (about 1 m from its surface), and a failure anywhere else;
- when the drone hits anything: a failure;
- when the budget of {rules.action_budget} actions is spent without Stop: a failure. Every action counts, and so \
does an answer that cannot be read.

ANSWER
Answer with one JSON object and nothing else, no text around it:
{{"thought": "<one or two sentences: what you see, where you go>", "action": "<one name from the list above>"}}"""


def _action_list() -> str:
    lines = []
    for name in CHOICES:
        kind = name.rstrip("0123456789")
        lines.append(f"- {name}: {_EFFECTS[kind].format(name.removeprefix(kind))}")
    return "\n".join(lines)


def goal_text(goal: Goal) -> str:
    """Write what is to be found; for an image goal its picture follows."""
    where = f"TARGET: {goal.target_name}. It lies {goal.direction} of the landmark nearest to it: {goal.landmark}."
    if goal.image is not None:
        return f"{where}\nThis picture shows the target from the viewpoint in front of it:"
    return f"{where}\nDescription: {goal.description}"


def step_text(observation: Observation, turns: Sequence[Turn]) -> str:
    """Write the report before an action; the pictures follow.

    Parameters
    ----------
    observation : Observation
        The present one.
    turns : sequence of Turn
        Earlier steps that are told again, oldest first.

    Returns
    -------
    str
    """
    lines = []
    if turns:
        lines.append("YOUR LAST ACTIONS")
        for turn in turns:
            done = turn.action or "none (the answer could not be read)"
            lines.append(f"- step {turn.step}: {done}" + (f". {turn.thought}" if turn.thought else ""))
    if observation.refused:
        lines.append("The last move was refused: it would have left the flight area.")
    lines.append(
        f"NOW: step {observation.step}; {observation.remaining_actions} actions left, Stop included. The drone sees:"
    )
    return "\n".join(lines)


def repair_text(why: str) -> str:
    """Ask for a readable answer, once."""
    return (
        f"This answer cannot be read: {why}. Answer again, with the JSON object alone: "
        '{"thought": "...", "action": "<one of ' + ", ".join(CHOICES) + '>"}'
    )
