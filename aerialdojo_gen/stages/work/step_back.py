"""How far the camera of a reference picture steps back from the anchor, until the object fits the picture."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.telling import Patch, in_picture
from aerialdojo_gen.stages.work.anchor_world import World

Floats = NDArray[np.float64]

# Of the half picture that the object may take: a little room around it.
_FILLED = 0.94
# The camera's own room, and what it must keep to what it backs up to.
_CAMERA_M, _KEPT_M = 0.15, 0.3
# What comes between counts this much against what comes into the picture: a rail hides little, and spoils it.
_HIDDEN = 2.0
_TRIED = (1.0, 0.85, 0.7, 0.55, 0.4, 0.25)
_WORTH_M = 0.25
# Of the picture, what a telling part keeps if it had it: 12 x 12 pixels of 320 x 320; and what it needs to be told.
_TOLD, _BARELY_TOLD = 0.0014, 0.0007


def fitting_m(vertices: Floats, position_m: Floats, yaw_rad: float, fov_deg: float) -> float:
    """How far back a level camera must go for an object to fit its square picture.

    Parameters
    ----------
    vertices : (n, 3) float64
        The object's, metres, world frame.
    position_m : (3,) float64
        Where the camera is.
    yaw_rad : float
        Its yaw; it goes back along its own axis.
    fov_deg : float

    Returns
    -------
    float
        Metres; 0 where it fits already.
    """
    away = vertices - position_m
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    ahead = away[:, 0] * cos + away[:, 1] * sin
    across = np.abs(away[:, 0] * sin - away[:, 1] * cos)
    wide = np.maximum(across, np.abs(away[:, 2])) / (_FILLED * math.tan(math.radians(fov_deg) / 2.0))
    return max(0.0, float((wide - ahead).max()))


def telling_m(patches: Sequence[Patch], seen: Floats, position_m: Floats, yaw_rad: float, fov_deg: float) -> float:
    """How far back a camera may go before a part that tells what the object is gets too small to be told.

    Parameters
    ----------
    patches : sequence of Patch
        Points of the parts.
    seen : (len(patches),) float64
        Share of each that is seen from the anchor.
    position_m : (3,) float64
        The anchor.
    yaw_rad : float
        Its yaw.
    fov_deg : float

    Returns
    -------
    float
        Metres; infinite where none of the parts is seen from the anchor.
    """
    most = math.inf
    ahead = np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
    for patch, share in zip(patches, seen.tolist(), strict=True):
        away = max(float(((patch.points - position_m) @ ahead).mean()), 0.1)
        taken = patch.area_m2 * share / (2.0 * away * math.tan(math.radians(fov_deg) / 2.0)) ** 2
        if taken > 0.0:
            floor = min(_TOLD, max(_BARELY_TOLD, taken / 2.0))
            most = min(most, max(0.0, away * (math.sqrt(taken / floor) - 1.0)))
    return most


def step_back_m(
    world: World, instance: int, points: Floats, position_m: Floats, yaw_rad: float, fov_deg: float, most_m: float
) -> float:
    """How far to step back: as far as the object needs and the way is free, to where most of it is in sight.

    Parameters
    ----------
    world : World
    instance : int
        The object's index in the scene.
    points : (m, 3) float64
        On its surface, metres, world frame.
    position_m : (3,) float64
        The anchor.
    yaw_rad : float
        Its yaw.
    fov_deg : float
    most_m : float
        As far as it may go.

    Returns
    -------
    float
        Metres, in centimetres; 0 where the picture is taken from the anchor.
    """
    wanted = min(fitting_m(world.scene.instances[instance].vertices, position_m, yaw_rad, fov_deg), most_m)
    if wanted < _WORTH_M:
        return 0.0
    back = -np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
    free = float(world.rays.first_hit(position_m, back[None])[0][0]) - _KEPT_M
    low, high = world.scene.bounds
    edges = [
        (bound - at) / b for at, b, bound in zip(position_m, back, np.where(back > 0, high, low), strict=True) if b
    ]
    wanted = min(wanted, free, *(edge - _CAMERA_M for edge in edges))
    if wanted < _WORTH_M:
        return 0.0
    tries = [0.0, *(math.floor(100.0 * share * wanted) / 100.0 for share in _TRIED)]
    places = np.array([position_m + s * back for s in tries])
    yaws = np.full(len(places), yaw_rad)
    framed = in_picture(places, yaws, points, fov_deg)
    who, what = np.nonzero(framed)
    # What the object itself hides is hidden from every distance: its own surface counts wherever it is met.
    seen = np.bincount(who, world.rays.visible(places[who], points[what], instance), minlength=len(places))
    worth = seen - _HIDDEN * (np.bincount(who, minlength=len(places)) - seen)
    worth[1:][[world.collisions.sphere_in_collision(place, _CAMERA_M) for place in places[1:]]] = -np.inf
    # Of equals the farthest, which leaves room around it; none where the anchor's own place is the better one.
    best = 1 + int(worth[1:].argmax())
    return tries[best] if worth[best] >= worth[0] else 0.0
