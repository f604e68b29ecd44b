"""A worked agent: it flies towards what has the colour that the goal names, and stops in front of it."""

import re

import cv2
import numpy as np

from aerialdojo_gen.benchmark.agents import AgentBase, Sensors

STOP, SLOW, AHEAD, UP, LEFT, RIGHT = 0, 1, 2, 10, 14, 15  # ids of docs/agent.md; SLOW is 1 m, AHEAD 3 m
HUES = {"red": 0, "orange": 12, "yellow": 28, "green": 60, "teal": 90, "blue": 110, "purple": 140}  # of 180


class Seeker(AgentBase):
    """Turns on the spot until the wanted colour is ahead, flies to it, and stops in front of it."""

    sensors = Sensors(views=("front",), width=96, height=96)

    def __init__(self, stop_m: float = 2.5) -> None:
        self.stop_m = stop_m

    def reset(self, goal):
        """Begin an episode: read the colour off the goal's words; a model would look at `goal.image`, too."""
        words = re.findall(r"[a-z]+", f"{goal.target_name} {goal.description or ''}".lower())
        self.hue, self.turns = next((HUES[word] for word in words if word in HUES), 0), 0

    def act(self, observation):
        """Look, choose: the id of an action, 0 to 15."""
        hsv = cv2.cvtColor(observation.rgb["front"], cv2.COLOR_RGB2HSV).astype(int)
        far = np.where(observation.depth_m["front"] == 0, np.inf, observation.depth_m["front"])  # 0: out of range
        off = np.abs((hsv[..., 0] - self.hue + 90) % 180 - 90)  # hues are a circle
        fits = (off < 8) & (hsv[..., 1] > 110) & (hsv[..., 2] > 40) & np.isfinite(far)
        room_m = far[30:66, 30:66].min()
        if observation.remaining_actions == 1:
            return STOP
        if fits.mean() < 0.002:  # not in view: 24 turns of 15 degrees are a full one, then on
            self.turns += 1
            return LEFT if self.turns % 24 or room_m < 4 else AHEAD
        column = np.median(np.nonzero(fits)[1])
        if abs(column - 47.5) > 14:
            return RIGHT if column > 47.5 else LEFT
        if np.median(far[fits]) < self.stop_m:
            return STOP
        return UP if room_m < 1.6 else SLOW if room_m < 4 else AHEAD
