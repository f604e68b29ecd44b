"""The prompts of a language model: the role, the body, the actions, the rules, and a report before every action.

After the paper's Appendix A: front-facing RGB-D with its encoding, the action list with magnitudes, embodiment,
termination, remaining budget, and one action as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Sensors
from aerialdojo_gen.benchmark.llm.answer import SIXTEEN, ActionSet
from aerialdojo_gen.benchmark.llm.options import Options

_VIEW_DIRECTIONS = {"front": "ahead", "left": "to the left", "right": "to the right", "down": "straight down"}


@dataclass(frozen=True)
class Turn:
    """An earlier step, as it is repeated in a prompt."""

    step: int  # Its number, from 0
    action: str | None  # Name of the action; None where the answer could not be read
    thought: str = ""  # What the model said of it


def system_prompt(goal: Goal, options: Options, form: str = "text") -> str:
    """Write what holds for the whole episode (paper, Appendix A)."""
    rules, actions = goal.rules, options.action_set
    hint = ", but you are told which way the drone faces at the start" if goal.heading is not None else ""
    return f"""\
You pilot a small drone that searches for one target object in a large outdoor scene. You know the scene only from \
the drone's cameras; there is no map, no GPS and no compass{hint}. Find the target, fly up to it, and stop in front \
of it.

BODY
The drone is a quadrotor with a wheelbase of {rules.wheelbase_m:g} m. It collides with whatever comes within \
{rules.radius_m:g} m of its centre, also while it moves from one place to the next. It always hovers level.

SENSORS
{_cameras(options, rules.sensors)}

ACTIONS
{actions.describe()}
Every action is carried out exactly, unless something stands in the way. A move that would leave the flight area is \
refused: it is spent, and the drone stays where it is.

THE EPISODE ENDS
- when you choose Stop: a success if the drone is then within {rules.success_radius_m:g} m of the viewpoint in front \
of the target (about 1 m from its surface), and a failure anywhere else;
- when the drone hits anything: a failure;
- when the budget of {rules.action_budget} actions is spent without Stop: a failure. Every action counts, and so \
does an answer that cannot be read.

ANSWER
{_form(actions, form)}"""


def _cameras(options: Options, sensors: Sensors) -> str:
    cameras = ", ".join(f"{view} (looks {_VIEW_DIRECTIONS[view]})" for view in options.views)
    scale = min(1.0, options.image_size_px / max(sensors.width, sensors.height))
    text = (
        f"Before every action you see a colour picture from each of these cameras: {cameras}. Each picture has "
        f"{round(sensors.width * scale)} x {round(sensors.height * scale)} pixels and a horizontal field of view of "
        f"{sensors.fov_deg:g}°."
    )
    if options.depth:
        text += (
            " With each comes a depth map of the same view and size, in grey: the value of a pixel is its distance"
            f" along the optical axis, linear from black at 0 m to white at {options.max_depth_m:g} m; what is"
            f" farther, or open sky, is white. A pixel of value v is v / 255 x {options.max_depth_m:g} m away."
        )
    if options.history_images:
        steps = "the step before" if options.history_images == 1 else f"up to {options.history_images} earlier steps"
        text += f" The {options.views[0]} camera's colour picture of {steps} is shown again."
    return text


def _form(actions: ActionSet, form: str) -> str:
    if form == "tool":
        return 'Call the tool "act" once, with one name from the list above as its action.'
    return (
        "Answer with one JSON object and nothing else, no text around it. Its JSON schema:\n"
        f"{json.dumps(actions.schema())}\n"
        "That is:\n"
        '{"thought": "<one or two sentences: what you see, where you go>", '
        '"action": "<one name from the list above>"}'
    )


def goal_text(goal: Goal) -> str:
    """Write what is to be found; for an image goal its picture follows."""
    where = f"TARGET: {goal.target_name}. It lies {goal.direction} of the landmark nearest to it: {goal.landmark}."
    if goal.heading is not None:
        where += (
            f"\nAt the start the drone faces {goal.heading.direction}: a compass would show "
            f"{goal.heading.heading_deg}° (0° is north, 90° east). Turning right adds, turning left takes away."
        )
    if goal.image is not None:
        return f"{where}\nThis picture shows the target {_camera_text(goal.image_distance_m)}:"
    return f"{where}\nDescription: {goal.description}"


def _camera_text(distance_m: float | None) -> str:
    if distance_m is None:
        return "from the goal viewpoint in front of it, or from behind that viewpoint"
    if distance_m == 0.0:
        return "from the goal viewpoint in front of it"
    return (
        f"from {distance_m:g} m behind the goal viewpoint in front of it, so that all of it is in the picture; "
        f"the goal viewpoint is {distance_m:g} m ahead of that camera"
    )


def step_text(observation: Observation, turns: Sequence[Turn]) -> str:
    """Write the report before an action; the pictures follow."""
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


def repair_text(why: str, actions: ActionSet = SIXTEEN) -> str:
    """Ask for a readable answer, once."""
    return (
        f"This answer cannot be read: {why}. Answer again, with the JSON object alone: "
        '{"thought": "...", "action": "<one of ' + ", ".join(actions.names) + '>"}'
    )
