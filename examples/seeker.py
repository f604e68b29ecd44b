"""A worked agent: it flies towards what has the colour that the goal names, and stops in front of it."""

import re

import numpy as np

from aerialdojo_gen.agents import AgentBase, Sensors

STOP, AHEAD, UP, LEFT, RIGHT = 0, 2, 10, 14, 15  # ids of docs/agent.md; AHEAD is 3 m
COLOURS = {"red": (200, 40, 40), "orange": (230, 130, 40), "yellow": (220, 200, 60), "green": (60, 140, 60),
           "blue": (50, 90, 180), "white": (235, 235, 235), "black": (30, 30, 30)}  # fmt: skip


class Seeker(AgentBase):
    """Turns on the spot until the wanted colour is ahead, flies to it, and stops in front of it."""

    sensors = Sensors(views=("front",), width=96, height=96)

    def __init__(self, stop_m: float = 2.0) -> None:
        self.stop_m = stop_m

    def reset(self, goal):
        """Begin an episode: read the colour off the description, or off the middle of the picture."""
        words = re.findall(r"[a-z]+", f"{goal.target_name} {goal.description or ''}".lower())
        named = [COLOURS[word] for word in words if word in COLOURS]
        middle = None if goal.image is None else np.median(goal.image[120:200, 120:200].reshape(-1, 3), axis=0)
        self.colour = np.array(named[0] if named else COLOURS["white"] if middle is None else middle, float)
        self.turns = 0

    def act(self, observation):
        """Look, choose: the id of an action, 0 to 15."""
        rgb, depth = observation.rgb["front"].astype(float), observation.depth_m["front"]
        far = np.where(depth == 0, np.inf, depth)  # 0 says that nothing is in range
        fits = (np.abs(rgb - self.colour).max(axis=2) < 50) & np.isfinite(far)
        if observation.remaining_actions == 1:
            return STOP
        if fits.mean() < 0.004:  # not in view: a full turn is 24 of 15 degrees, then on
            self.turns += 1
            return LEFT if self.turns % 24 or far[32:64, 32:64].min() < 4.0 else AHEAD
        column = np.nonzero(fits)[1].mean()
        if abs(column - 47.5) > 14:
            return RIGHT if column > 47.5 else LEFT
        if np.median(far[fits]) < self.stop_m:
            return STOP
        return UP if far[24:72, 24:72].min() < 3.6 else AHEAD
