"""Viewpoints around an object: where they may be, what they see, and how well they show it (paper: anchors)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.angles import wrap_angle_rad
from aerialdojo_gen.geometry.rays import RayCaster, TriangleRayCaster
from aerialdojo_gen.geometry.surface import Surface

Floats = NDArray[np.float64]
_T = TypeVar("_T", bound=np.generic)

_LEAST_POINTS = 3
_FULL_SIZE = 0.5
# Elevations at which most things are recognised, rather from above than from below, and marks for them.
_ELEVATIONS_DEG, _LEVEL_MARKS = (-30.0, -5.0, 20.0, 50.0), (0.0, 1.0, 1.0, 0.0)
# What is nearer to the picture's edge than that, of half of it, is nearly cut off.
_ROOM = 0.95
WEIGHTS = {"visible": 0.30, "shown": 0.30, "size": 0.10, "centred": 0.10, "level": 0.10, "clear": 0.10}


def around(
    surface: Surface,
    box: Floats,
    standoff_m: float,
    azimuths: int,
    elevations_deg: Sequence[float],
    level_heights: Sequence[float],
) -> Floats:
    """Place candidates at a distance from an object's surface, on all sides of it.

    Every candidate is where a line that comes from far towards the object's centroid gets as near to its surface as
    the standoff: one line an azimuth and elevation. A line that passes the object by (an arch has its centroid in its
    opening) leads to the surface point nearest to the centroid instead. An object taller than what a level camera of
    90° sees from the standoff gets lines to other heights of its vertical axis as well.

    Parameters
    ----------
    surface : Surface
        The object's, world frame.
    box : (2, 3) float64
        Its axis-aligned box, metres, world frame; the centroid is the box's centre.
    standoff_m : float
        Distance from the surface.
    azimuths : int
        Number of directions in the plane, the first one east.
    elevations_deg : sequence of float
        Elevations of the lines to the centroid, seen from it.
    level_heights : sequence of float
        Heights in the box, from 0 (bottom) to 1 (top), of more level lines to a tall object.

    Returns
    -------
    (n, 3) float64
        Metres, world frame, within 0.1 mm of the standoff; n is azimuths × (elevations + heights that apply). NaN
        where a line comes nowhere near the surface.
    """
    centroid = box.mean(axis=0)
    rows = [(centroid[2], e) for e in elevations_deg]
    if box[1, 2] - box[0, 2] > 2.0 * standoff_m:
        rows += [(box[0, 2] + h * (box[1, 2] - box[0, 2]), 0.0) for h in level_heights]
    turn = np.arange(azimuths) * (2.0 * math.pi / azimuths)
    aims, directions = [], []
    for height, elevation in rows:
        up = math.radians(elevation)
        aims.append(np.tile([centroid[0], centroid[1], height], (azimuths, 1)))
        directions.append(
            np.column_stack(
                [math.cos(up) * np.cos(turn), math.cos(up) * np.sin(turn), np.full(azimuths, math.sin(up))]
            )
        )
    aim, direction = np.concatenate(aims), np.concatenate(directions)
    positions = surface.standoff(aim, direction, standoff_m)
    missed = np.isnan(positions[:, 0])
    if missed.any():
        nearest = surface.nearest_point(centroid)
        positions[missed] = surface.standoff(nearest, direction[missed], standoff_m)
    return positions


@dataclass(frozen=True)
class Views:
    """What n viewpoints see of an object's m sample points.

    Attributes
    ----------
    visible_fraction : (n,) float64
        Of the sample points in the picture that the object itself does not hide (its far side, say), the share that
        nothing else hides either. 0 where fewer than three points are in the picture.
    framed : (n,) float64
        Share of the sample points that lie within the picture with a little room, whatever hides them.
    shown : (n,) float64
        Sample points seen, over those that at least one of the n viewpoints would see if the object stood alone: how
        much of the object one picture tells.
    box_fraction : (n,) float64
        Area of the seen points' box in the picture, over the picture's.
    off_centre : (n,) float64
        Distance of the seen points' mean from the picture's centre, in half edges of the picture.
    """

    visible_fraction: Floats
    framed: Floats
    shown: Floats
    box_fraction: Floats
    off_centre: Floats


@dataclass(frozen=True, eq=False)
class Sight:
    """Which of an object's m sample points n viewpoints see, and where in their pictures.

    The camera is the front one: square picture, at the body's centre, level, looking along the yaw.

    Attributes
    ----------
    u, v : (n, m) float64
        Where the points are in the picture: -1 to 1 from edge to edge; meaningless behind the camera.
    roomy : (n, m) bool
        Points within the picture with a little room, whatever hides them.
    facing : (n, m) bool
        Points in the picture that the object itself does not hide.
    seen : (n, m) bool
        Those of them that nothing else hides either.
    """

    u: Floats
    v: Floats
    roomy: NDArray[np.bool_]
    facing: NDArray[np.bool_]
    seen: NDArray[np.bool_]

    @classmethod
    def of(
        cls, positions: Floats, yaw_rad: Floats, points: Floats, alone: TriangleRayCaster, scene: RayCaster,
        own_instance: int, fov_deg: float,
    ) -> Sight:  # fmt: skip
        """Look at an object from viewpoints, by ray casts from the body's centre to sample points.

        Parameters
        ----------
        positions : (n, 3) float64
            Metres, world frame.
        yaw_rad : (n,) float64
            Radians, counter-clockwise from +x.
        points : (m, 3) float64
            On the object's surface, metres, world frame.
        alone : TriangleRayCaster
            The object by itself.
        scene : RayCaster
            Everything, the object included.
        own_instance : int
            The object's index in the scene.
        fov_deg : float
            Field of view of the camera, horizontal and vertical.
        """
        ray = points[None] - positions[:, None]
        cos, sin = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
        ahead = ray[..., 0] * cos + ray[..., 1] * sin
        half = math.tan(math.radians(fov_deg) / 2.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (ray[..., 0] * sin - ray[..., 1] * cos) / (ahead * half)
            v = -ray[..., 2] / (ahead * half)
        before = np.asarray(ahead > 0.0)
        facing = before & (np.abs(u) <= 1.0) & (np.abs(v) <= 1.0)
        who, what = np.nonzero(facing)
        facing[who, what] = alone.unobstructed(positions[who], points[what])
        who, what = np.nonzero(facing)
        seen = np.zeros_like(facing)
        seen[who, what] = scene.visible(positions[who], points[what], own_instance)
        return cls(u, v, before & (np.abs(u) <= _ROOM) & (np.abs(v) <= _ROOM), facing, seen)

    def with_rows(self, rows: NDArray[np.int64], where: NDArray[np.int64], others: Sight) -> Sight:
        """Take some viewpoints, (k,), and put others in the place of those of them that `where` says."""

        def mixed(mine: NDArray[_T], theirs: NDArray[_T]) -> NDArray[_T]:
            taken = mine[rows]
            taken[where] = theirs
            return taken

        return Sight(
            mixed(self.u, others.u),
            mixed(self.v, others.v),
            mixed(self.roomy, others.roomy),
            mixed(self.facing, others.facing),
            mixed(self.seen, others.seen),
        )

    def views(self) -> Views:
        """Sum up what each of the viewpoints sees, and compare them."""
        could, does = self.facing.sum(axis=1), self.seen.sum(axis=1)
        enough = (could >= _LEAST_POINTS) & (does > 0)
        ever = int(self.facing.any(axis=0).sum())
        n = len(could)
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
            visible_fraction=np.where(enough, does / np.maximum(could, 1), 0.0),
            framed=np.asarray(self.roomy.mean(axis=1)),
            shown=np.where(enough, does / max(ever, 1), 0.0),
            box_fraction=box,
            off_centre=off,
        )


def look(
    positions: Floats,
    yaw_rad: Floats,
    points: Floats,
    alone: TriangleRayCaster,
    scene: RayCaster,
    own_instance: int,
    fov_deg: float,
) -> Views:
    """Look at an object from viewpoints: the `Views` of their `Sight`, whose parameters these are."""
    return Sight.of(positions, yaw_rad, points, alone, scene, own_instance, fov_deg).views()


def informativeness(
    views: Views, elevation_deg: Floats, clearance_m: Floats, radius_m: float, ample_m: float
) -> Floats:
    """Score how well viewpoints show their object: the paper's "visual informativeness", made explicit.

    A weighted mean (`WEIGHTS`) of six terms in [0, 1]: *visible*, the visible fraction; *shown*, the share of the
    object that the picture tells, a stand-in for the correspondence of image and name; *size*, the edge of its box in
    the picture, full marks from half of the picture's edge; *centred*, how near it is to the picture's centre;
    *level*, `level_marks`; *clear*, room around the body, full
    marks at the ample clearance.

    Parameters
    ----------
    views : Views
        What n viewpoints see.
    elevation_deg : (n,) float64
        Elevation of the viewpoint seen from the centroid.
    clearance_m : (n,) float64
        Distance to the nearest surface of the scene.
    radius_m : float
        The body's radius: no room at all.
    ample_m : float
        Clearance beyond which more is no better.

    Returns
    -------
    (n,) float64
        In [0, 1], higher is better.
    """
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
    """Mark the elevation of viewpoints, seen from the centroid: full from 5° below to 20° above, 0 at -30° and 50°.

    Parameters
    ----------
    elevation_deg : (n,) float64 or float

    Returns
    -------
    (n,) or () float64
        In [0, 1].
    """
    return np.asarray(np.interp(elevation_deg, _ELEVATIONS_DEG, _LEVEL_MARKS))


def shortlist(
    score: Floats, azimuth_rad: Floats, count: int, separation_rad: float, wanted: NDArray[np.bool_] | None = None
) -> NDArray[np.int64]:
    """Choose the best viewpoints that look from different sides.

    Greedy: the best score first; then the best among those at least the separation away in azimuth from all that are
    chosen; where there is none, the best score less the share of the separation that it lacks.

    Parameters
    ----------
    score : (n,) float64
        In [0, 1], higher is better.
    azimuth_rad : (n,) float64
        Direction of each viewpoint seen from the centroid.
    count : int
        How many to choose; fewer where n is smaller.
    separation_rad : float
        Wanted angle between any two.
    wanted : (n,) bool, optional
        One of these is chosen at least, if there is any: the best of them, in the place of the last one.

    Returns
    -------
    (min(n, count),) int64
        Indices, the highest score first; equal scores in the order of the index.
    """
    chosen: list[int] = []
    apart = np.full(len(score), math.inf)
    for _ in range(min(count, len(score))):
        worth = score - np.clip(1.0 - apart / separation_rad, 0.0, 1.0)
        # A multiple of the azimuth step must count as being that far apart, whatever the last bit says.
        far = apart >= separation_rad - 1e-6
        far[chosen] = False
        if far.any():
            worth = np.where(far, worth, -math.inf)
        worth[chosen] = -math.inf
        chosen.append(int(np.argmax(worth)))
        apart = np.minimum(apart, np.abs(wrap_angle_rad(azimuth_rad - azimuth_rad[chosen[-1]])))
    if wanted is not None and wanted.any() and not wanted[chosen].any():
        chosen[-1] = int(np.argmax(np.where(wanted, score, -math.inf)))
    return np.array(sorted(chosen, key=lambda k: (-score[k], k)), dtype=np.int64)
