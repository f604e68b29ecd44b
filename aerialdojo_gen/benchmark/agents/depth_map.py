"""A map that an agent draws for itself from depth, in a frame of its own: where it began, x ahead, y to the left."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.benchmark.agents.goal import Sensors

_UNKNOWN, _FREE, _OCCUPIED = 0, 1, 2
# Directions of the level views in the body's frame, radians, counter-clockwise.
_BEARINGS = {"front": 0.0, "left": math.pi / 2, "right": -math.pi / 2}
_CELL_M = 0.5
_MIDDLE = round(100.0 / _CELL_M)  # The map reaches 100 m to every side
_REACH_M = 15.0  # Depth beyond this is not believed
_BAND_M = 0.8  # What is so far above or below the body is in its way
_MARGIN_M = 0.75  # Kept between the body's centre and what is in the way
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
_MARGIN = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * math.ceil(_MARGIN_M / _CELL_M) + 1,) * 2)


class DepthMap:
    """What is free and what is not at the height that the body flies at, from level views with depth."""

    def __init__(self, sensors: Sensors) -> None:
        rays = sensors.camera.rays()
        self._slope_left, self._slope_down = -rays[0, :, 0], rays[:, 0, 1]
        self.clear()

    def clear(self) -> None:
        """Forget everything: another height has another map."""
        n = 2 * _MIDDLE + 1
        self._cells = np.zeros((n, n), np.uint8)
        # Known by experience, not by depth: stays when the map is drawn over.
        self._barred = np.zeros((n, n), np.uint8)

    def cell(self, x_m: Any, y_m: Any) -> tuple[Any, Any]:
        """Cells of points, of numbers or arrays, kept inside the map."""
        i, j = (np.clip(np.rint(v / _CELL_M).astype(np.int64) + _MIDDLE, 0, 2 * _MIDDLE) for v in (x_m, y_m))
        return i, j

    def point(self, cell: tuple[int, int]) -> tuple[float, float]:
        """Centre of a cell, metres."""
        return (cell[0] - _MIDDLE) * _CELL_M, (cell[1] - _MIDDLE) * _CELL_M

    def add(self, view: str, depth_m: NDArray[np.float32], x_m: float, y_m: float, yaw_rad: float) -> None:
        """Draw in the planar depth that a level view shows from a pose in the map; 0 for nothing within range."""
        depth = np.where(depth_m > 0.0, depth_m, np.inf)
        in_way = np.abs(self._slope_down)[:, None] * depth <= _BAND_M
        nearest = np.where(in_way, depth, np.inf).min(axis=0)
        heading = yaw_rad + _BEARINGS[view]
        ahead = np.arange(0.0, _REACH_M, 0.5 * _CELL_M)
        seen = ahead[:, None] < np.minimum(nearest, _REACH_M)[None] - 0.5 * _CELL_M
        self._mark(ahead[:, None] * np.ones_like(nearest), seen, heading, x_m, y_m, _FREE)
        self._mark(nearest[None], (nearest < _REACH_M)[None], heading, x_m, y_m, _OCCUPIED)

    def _mark(
        self, ahead: NDArray[np.float64], where: NDArray[np.bool_], heading: float, x_m: float, y_m: float, what: int
    ) -> None:
        ahead, left = ahead[where], (np.where(where, ahead, 0.0) * self._slope_left)[where]
        x = x_m + math.cos(heading) * ahead - math.sin(heading) * left
        y = y_m + math.sin(heading) * ahead + math.cos(heading) * left
        i, j = self.cell(x, y)
        if what == _FREE:
            kept = self._cells[i, j] != _OCCUPIED
            i, j = i[kept], j[kept]
        self._cells[i, j] = what

    def bar(self, x_m: float, y_m: float) -> None:
        """Never lead to this place again."""
        i, j = self.cell(x_m, y_m)
        self._barred[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] = 1

    def way_to_frontier(self, x_m: float, y_m: float) -> list[tuple[float, float]]:
        """Find the way, points or none, to the nearest place, 3 m off or more, where known free space ends."""
        near = cv2.dilate((self._cells == _OCCUPIED).astype(np.uint8), _MARGIN)
        open_ = ((self._cells == _FREE) & (near == 0) & (self._barred == 0)).astype(np.uint8)
        start = self.cell(x_m, y_m)
        unknown = cv2.dilate((self._cells == _UNKNOWN).astype(np.uint8), _CROSS)
        frontier = (open_ & unknown).astype(bool)
        steps = np.full(open_.shape, -1, np.int32)
        wave = np.zeros_like(open_)
        # The body may be nearer to something than the margin: it starts from where it is all the same.
        wave[max(start[0] - 1, 0) : start[0] + 2, max(start[1] - 1, 0) : start[1] + 2] = 1
        steps[wave > 0] = 1
        wave[start], steps[start] = 1, 0
        least, k = 3.0 / _CELL_M, 1
        while True:
            grown = cv2.dilate(wave, _CROSS) & (open_ | wave)
            fresh = (grown > wave) & (steps < 0)
            if not fresh.any():
                return []
            k += 1
            steps[fresh] = k
            wave = grown
            if k >= least and (fresh & frontier).any():
                found = np.argwhere(fresh & frontier)[0]
                return self._back(steps, (int(found[0]), int(found[1])))

    def _back(self, steps: NDArray[np.int32], cell: tuple[int, int]) -> list[tuple[float, float]]:
        way = [cell]
        while steps[cell] > 0:
            i, j = cell
            around = [(i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]
            cell = min((c for c in around if steps[c] >= 0), key=lambda c: int(steps[c]))
            way.append(cell)
        return [self.point(c) for c in reversed(way)]


def free_ahead_m(depth_m: NDArray[np.float32], sensors: Sensors, radius_m: float) -> float:
    """Depth of the nearest thing in the corridor that the body would fly through, along the view's axis, metres."""
    depth = np.where(depth_m > 0.0, depth_m, np.inf)
    corridor = _off_axis(sensors) * np.where(np.isfinite(depth), depth, 0.0) <= 2.0 * radius_m
    return float(np.where(corridor, depth, np.inf).min())


@lru_cache(maxsize=4)
def _off_axis(sensors: Sensors) -> NDArray[np.float64]:
    """How far from a view's axis its pixels look, per metre of depth, (H, W)."""
    return np.asarray(np.abs(sensors.camera.rays()[..., :2]).max(axis=-1))
