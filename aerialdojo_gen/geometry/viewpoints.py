"""Viewpoints around an object: where they may be, what they see, and how well they show it (paper: anchors)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from aerialdojo_gen.geometry.arrays import Flags, Floats, Ints
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.rays import RayCaster, TriangleRayCaster
from aerialdojo_gen.geometry.surface import Surface

_LEAST_POINTS = 3
_FULL_SIZE = 0.5
# Elevations at which most things are recognised, rather from above than from below, and marks for them.
_ELEVATIONS_DEG, _LEVEL_MARKS = (-30.0, -5.0, 20.0, 50.0), (0.0, 1.0, 1.0, 0.0)
# What is nearer to the picture's edge than that, of half of it, is nearly cut off.
_ROOM = 0.95
WEIGHTS = {"visible": 0.30, "shown": 0.30, "size": 0.10, "centred": 0.10, "level": 0.10, "clear": 0.10}


def ring(
    surface: Surface, box: Floats, standoff_m: float, azimuths: int, elevations_deg: Sequence[float],
    level_heights: Sequence[float],
) -> Floats:  # fmt: skip
    """Candidates (n, 3), world metres, at the standoff on lines towards the centroid from all sides; NaN for none."""
    centroid = box.mean(axis=0)
    rows = [(centroid[2], e) for e in elevations_deg]
    if box[1, 2] - box[0, 2] > 2.0 * standoff_m:
        rows += [(box[0, 2] + h * (box[1, 2] - box[0, 2]), 0.0) for h in level_heights]
    turn = np.arange(azimuths) * (2.0 * math.pi / azimuths)
    height, up = np.repeat([(height, math.radians(elevation)) for height, elevation in rows], azimuths, axis=0).T
    turn = np.tile(turn, len(rows))
    aim = np.column_stack([np.tile(centroid[:2], (len(turn), 1)), height])
    direction = np.column_stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
    positions = surface.standoff(aim, direction, standoff_m)
    missed = np.isnan(positions[:, 0])
    if missed.any():
        nearest = surface.nearest_point(centroid)
        positions[missed] = surface.standoff(nearest, direction[missed], standoff_m)
    return positions


@dataclass(frozen=True)
class Views:
    """What n viewpoints see of an object's m sample points."""

    visible_fraction: Floats  # (n,) float64
    framed: Floats  # Share of the sample points that lie within the picture with a little room, whatever hides them
    shown: Floats  # (n,) float64
    box_fraction: Floats  # (n,) float64; area of the seen points' box in the picture, over the picture's
    off_centre: Floats  # Distance of the seen points' mean from the picture's centre, in half edges of the picture


@dataclass(frozen=True, eq=False)
class PointVisibility:
    """Which of an object's m sample points n viewpoints see, and where in their pictures.

    The camera is the front one: square picture, at the body's centre, level, looking along the yaw.
    """

    u: Floats  # Where the points are in the picture: -1 to 1 from edge to edge; meaningless behind the camera
    v: Floats
    roomy: Flags  # (n, m) bool; points within the picture with a little room, whatever hides them
    facing: Flags  # (n, m) bool; points in the picture that the object itself does not hide
    seen: Flags  # (n, m) bool; those of them that nothing else hides either

    @classmethod
    def of(
        cls, positions: Floats, yaw_rad: Floats, points: Floats, alone: TriangleRayCaster, scene: RayCaster,
        own_instance: int, fov_deg: float,
    ) -> PointVisibility:  # fmt: skip
        """Cast rays from viewpoints (n, 3) with yaws to an object's points (m, 3)."""
        ray = points[None] - positions[:, None]
        cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
        ahead = ray[..., 0] * cos + ray[..., 1] * sin
        half = math.tan(math.radians(fov_deg) / 2.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (ray[..., 0] * sin - ray[..., 1] * cos) / (ahead * half)
            v = -ray[..., 2] / (ahead * half)
        in_front = np.asarray(ahead > 0.0)
        facing = in_front & (np.abs(u) <= 1.0) & (np.abs(v) <= 1.0)
        pose, point = np.nonzero(facing)
        facing[pose, point] = alone.unobstructed(positions[pose], points[point])
        pose, point = np.nonzero(facing)
        seen = np.zeros_like(facing)
        seen[pose, point] = scene.visible(positions[pose], points[point], own_instance)
        return cls(u, v, in_front & (np.abs(u) <= _ROOM) & (np.abs(v) <= _ROOM), facing, seen)

    def with_rows(self, rows: Ints, where: Ints, others: PointVisibility) -> PointVisibility:
        """Take some viewpoints, (k,), and put others in the place of those of them that `where` says."""
        taken = {field.name: getattr(self, field.name)[rows] for field in fields(self)}
        for name, values in taken.items():
            values[where] = getattr(others, name)
        return PointVisibility(**taken)

    def views(self) -> Views:
        """Sum up what each of the viewpoints sees, and compare them."""
        facing_count, seen_count = self.facing.sum(axis=1), self.seen.sum(axis=1)
        enough = (facing_count >= _LEAST_POINTS) & (seen_count > 0)
        ever = int(self.facing.any(axis=0).sum())
        n = len(facing_count)
        box, off = np.zeros(n), np.ones(n)
        rows = np.flatnonzero(enough)
        if len(rows):
            seen = self.seen[rows]
            us, vs = np.where(seen, self.u[rows], np.nan), np.where(seen, self.v[rows], np.nan)
            wide = np.nanmax(us, axis=1) - np.nanmin(us, axis=1)
            high = np.nanmax(vs, axis=1) - np.nanmin(vs, axis=1)
            box[rows] = wide * high / 4.0
            off[rows] = np.hypot(np.nanmean(us, axis=1), np.nanmean(vs, axis=1))
        return Views(
            visible_fraction=np.where(enough, seen_count / np.maximum(facing_count, 1), 0.0),
            framed=np.asarray(self.roomy.mean(axis=1)),
            shown=np.where(enough, seen_count / max(ever, 1), 0.0),
            box_fraction=box,
            off_centre=off,
        )


def informativeness(
    views: Views, elevation_deg: Floats, clearance_m: Floats, radius_m: float, ample_m: float
) -> Floats:
    """Visual informativeness (paper) in [0, 1], (n,): a weighted mean of the terms in `WEIGHTS`."""
    terms = {
        "visible": views.visible_fraction,
        "shown": views.shown,
        "size": np.minimum(np.sqrt(views.box_fraction) / _FULL_SIZE, 1.0),
        "centred": 1.0 - np.minimum(views.off_centre, 1.0),
        "level": level_marks(elevation_deg),
        "clear": np.clip((clearance_m - radius_m) / (ample_m - radius_m), 0.0, 1.0),
    }
    score = np.zeros(len(elevation_deg))
    for name, weight in WEIGHTS.items():
        score += weight * terms[name]
    return score


def level_marks(elevation_deg: Floats | float) -> Floats:
    """Score the elevation in degrees: 1 from -5 to 20, 0 at -30 and 50; (n,) in [0, 1]."""
    return np.asarray(np.interp(elevation_deg, _ELEVATIONS_DEG, _LEVEL_MARKS))


def shortlist(
    score: Floats, azimuth_rad: Floats, count: int, separation_rad: float, required: Flags | None = None
) -> Ints:
    """Choose greedily the best scores at least `separation_rad` apart in azimuth: indices, highest score first."""
    chosen: list[int] = []
    separation = np.full(len(score), math.inf)
    for _ in range(min(count, len(score))):
        value = score - np.clip(1.0 - separation / separation_rad, 0.0, 1.0)
        # A multiple of the azimuth step must count as being that far apart, whatever the last bit says.
        far = separation >= separation_rad - 1e-6
        far[chosen] = False
        if far.any():
            value = np.where(far, value, -math.inf)
        value[chosen] = -math.inf
        chosen.append(int(np.argmax(value)))
        separation = np.minimum(separation, np.abs(wrap_angle_rad(azimuth_rad - azimuth_rad[chosen[-1]])))
    if required is not None and required.any() and not required[chosen].any():
        chosen[-1] = int(np.argmax(np.where(required, score, -math.inf)))
    return np.array(sorted(chosen, key=lambda k: (-score[k], k)), dtype=np.int64)
