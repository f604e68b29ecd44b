"""An explorer that learns nothing: it avoids walls by depth, visits frontiers, and stops where an image goal fits."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.agents.base import AgentBase, Odometer
from aerialdojo_gen.benchmark.agents.depth_map import DepthMap, free_ahead_m
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Sensors
from aerialdojo_gen.geometry.motion import TURN_RAD
from aerialdojo_gen.store.schemas import ACTION_NAMES, MOVE_UP_1, STOP, TURN_LEFT, TURN_RIGHT

_FORWARD = [(ACTION_NAMES.index(f"MoveForward{m}"), float(m)) for m in (5, 3, 1)]
# How many points of a way ahead the explorer heads for, and how many ways it considers before a move.
_LOOK_ON, _REPLANS = 6, 8
# Edge of the thumbnails that are compared with the goal's picture, pixels.
_THUMB_PX = 24


class ExplorerAgent(AgentBase):
    """Frontier exploration in the plane, by depth alone (Yamauchi 1997), in a frame reckoned from its own actions."""

    sensors = Sensors(views=("front", "left", "right"), width=96, height=96)

    # Correlation, -1 to 1, at which an image goal counts as found; free depth that is left ahead after a move.
    def __init__(self, likeness: float = 0.75, clearance_m: float = 0.8) -> None:
        if not -1.0 <= likeness <= 1.0:
            raise ValueError(f"likeness is a correlation, -1 to 1, not {likeness}")
        self._likeness, self._clearance_m = likeness, clearance_m

    def reset(self, goal: Goal) -> None:
        """Begin an episode."""
        self._sensors = goal.rules.sensors
        if not {"front", "left", "right"} <= set(self._sensors.views) or not self._sensors.depth:
            raise UsageError("the explorer needs depth of the front, left and right views")
        self._wanted = None if goal.image is None else thumbnail(goal.image)
        self._radius_m = goal.rules.radius_m
        self._map = DepthMap(self._sensors)
        self._body = Odometer()
        self._before = STOP
        self._way: list[tuple[float, float]] = []

    @property
    def _xy_m(self) -> tuple[float, float]:
        x, y, _ = self._body.place.tolist()
        return x, y

    def act(self, observation: Observation) -> int:
        """Observe, update the map, choose."""
        if observation.refused:
            # A fence that no camera sees: taken to stand across the way.
            (x, y), (dx, dy, _) = self._xy_m, self._body.displacement(self._before).tolist()
            for aside in np.arange(-8.0, 8.5, 0.5) / math.hypot(dx, dy):
                self._map.bar(x + dx - aside * dy, y + dy + aside * dx)
        elif self._before == MOVE_UP_1:
            self._map.clear()
        self._body.add(self._before, observation.refused)
        if observation.remaining_actions == 1 or self._is_goal(observation):
            return STOP
        for view in ("front", "left", "right"):
            self._map.add(view, observation.depth_m[view], *self._xy_m, self._body.yaw_rad)
        self._before = self._choose(observation.depth_m["front"])
        return self._before

    def _is_goal(self, observation: Observation) -> bool:
        if self._wanted is None or "front" not in observation.rgb:
            return False
        return float((thumbnail(observation.rgb["front"]) * self._wanted).mean()) >= self._likeness

    def _choose(self, depth_m: NDArray[np.float32]) -> int:
        here = self._xy_m
        for _ in range(_REPLANS):
            way = self._way = self._way or self._map.way_to_frontier(*here)
            if not way:
                break
            x, y = way[min(_LOOK_ON, len(way) - 1)]
            bearing = math.atan2(y - here[1], x - here[0]) - self._body.yaw_rad
            turns = round(math.remainder(bearing, 2.0 * math.pi) / TURN_RAD)
            if turns:
                return TURN_LEFT if turns > 0 else TURN_RIGHT
            # Until here the way stays what it was: the nearest frontier may change sides with every look.
            self._way = []
            free, straight = free_ahead_m(depth_m, self._sensors, self._radius_m), self._straight_m(way)
            for action, metres in _FORWARD:
                if metres + self._clearance_m <= free and (metres <= straight or metres == 1.0):
                    return action
            # Too narrow after all: look for another way.
            for x, y in way[2 : _LOOK_ON + 1]:
                self._map.bar(x, y)
        return MOVE_UP_1

    def _straight_m(self, way: list[tuple[float, float]]) -> float:
        """How far the way goes straight ahead."""
        cos, sin = math.cos(self._body.yaw_rad), math.sin(self._body.yaw_rad)
        farthest = 0.0
        for dx, dy in (np.array(way) - self._xy_m).tolist():
            if abs(-sin * dx + cos * dy) > 1.0:
                break
            farthest = max(farthest, cos * dx + sin * dy)
        return farthest


def thumbnail(rgb: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Shrink a picture, (H, W, 3) uint8, to a thumbnail of mean 0 and variance 1 a channel, for correlations."""
    small = cv2.resize(rgb, (_THUMB_PX, _THUMB_PX), interpolation=cv2.INTER_AREA).astype(np.float64)
    small -= small.mean(axis=(0, 1))
    return np.asarray(small / (small.std(axis=(0, 1)) + 1e-9))
