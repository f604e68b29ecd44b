"""What a viewpoint is worth for telling what an object is: its front, and the parts that make its name true."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TELLS_WEIGHT, FRONT_WEIGHT = 0.35, 0.3
_ANGLES_RAD, _MARKS = np.radians([0.0, 25.0, 60.0, 60.001, 120.0]), (1.0, 1.0, 0.5, 0.15, 0.0)


def telling(told: Floats) -> Floats:
    """Mark how well telling parts are seen: half the worst one, half their mean.

    Parameters
    ----------
    told : (n, t) float64
        In [0, 1], t at least 1.

    Returns
    -------
    (n,) float64
        In [0, 1].
    """
    return np.asarray((told.min(axis=1) + told.mean(axis=1)) / 2.0)


def fronting(off_front_rad: Floats | None) -> Floats | None:
    """Mark angles off the front: full up to 25°, half at 60°, little beyond; None for an object without a front."""
    return None if off_front_rad is None else np.asarray(np.interp(off_front_rad, _ANGLES_RAD, _MARKS))


def clarity(unoccluded: Floats, framed: Floats, foreground: Floats, level: Floats) -> Floats:
    """Tell what a picture of an object is worth for what hides it, cuts it off, stands nearer, or looks up or down.

    Whatever else a picture shows, a person does not recognise what a rail, a post or its edge takes away, nor most
    things from below: a factor, not a term that others outweigh.

    Parameters
    ----------
    unoccluded, framed : (n,) float64
        Shares of the object that nothing hides and that lie within the picture, in [0, 1].
    foreground : (n,) float64
        Share that what stands nearer takes of the picture or of the object's box in it, the larger one, in [0, 1].
    level : (n,) float64
        Marks of the elevation, in [0, 1] (`aerialdojo_gen.geometry.viewpoints.level_marks`).

    Returns
    -------
    (n,) float64
        In (0, 1].
    """
    return np.asarray(
        np.interp(unoccluded, (0.4, 0.95), (0.4, 1.0))
        * np.interp(framed, (0.5, 0.98), (0.6, 1.0))
        * np.interp(foreground, (0.05, 0.5), (1.0, 0.5))
        * np.interp(level, (0.0, 1.0), (0.7, 1.0))
    )


def knowing(score: Floats, tells: Floats | None, front: Floats | None) -> Floats:
    """Weigh what is known of an object with how well its silhouette shows.

    Parameters
    ----------
    score : (n,) float64
        Of the silhouette, in [0, 1].
    tells, front : (n,) float64 or None
        Marks of `telling` and `fronting`; None where the catalogue says nothing: their weight is the silhouette's.

    Returns
    -------
    (n,) float64
        In [0, 1].
    """
    known = [(weight, mark) for weight, mark in ((TELLS_WEIGHT, tells), (FRONT_WEIGHT, front)) if mark is not None]
    rest = 1.0 - sum(weight for weight, _ in known)
    return np.asarray(rest * score + sum(weight * mark for weight, mark in known))
