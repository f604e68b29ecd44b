"""What a scorer sees of a viewpoint, and what it says of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.common.pictures import SCORED_JPEG, encode_jpeg


@dataclass(frozen=True, eq=False)
class AnchorView:
    """The front view of a candidate anchor.

    Attributes
    ----------
    rgb : (H, W, 3) uint8
        sRGB.
    visible : (H, W) bool
        Pixels that show the object.
    alone : (H, W) bool
        Pixels that would show it if nothing else were there; a superset of `visible`.
    sky : (H, W) bool
        Pixels that show no surface at all.
    shown : float
        Share of the object that the picture tells, in [0, 1] (`aerialdojo_gen.geometry.viewpoints.Views`).
    elevation_deg : float
        Of the viewpoint, seen from the object's centroid.
    clearance_m : float
        From the viewpoint to the nearest surface.
    told : tuple of float
        How well the picture shows each of the object's telling parts, in [0, 1]; empty where the whole body tells.
    off_front_rad : float or None
        Angle between where the viewpoint is and the nearest of the object's fronts; None where it has none.
    framed : float
        Share of the object's surface that lies within the picture with a little room, whatever hides it.
    nearer : (H, W) bool or None
        Pixels that show what stands nearer than the object: no floor or ground, which is no hindrance. None where
        that was not looked for.
    behind : AnchorView or None
        From further back along the viewing axis, where the reference picture is taken; None where it is taken here.
    """

    rgb: NDArray[np.uint8]
    visible: NDArray[np.bool_]
    alone: NDArray[np.bool_]
    sky: NDArray[np.bool_]
    shown: float
    elevation_deg: float
    clearance_m: float
    told: tuple[float, ...] = ()
    off_front_rad: float | None = None
    framed: float = 1.0
    nearer: NDArray[np.bool_] | None = None
    behind: AnchorView | None = None

    def jpeg(self) -> bytes:
        """The picture as a JPEG file."""
        return encode_jpeg(self.rgb, SCORED_JPEG)


@dataclass(frozen=True)
class Known:
    """What is known of a candidate anchor before it is pictured.

    Attributes
    ----------
    shown, elevation_deg, clearance_m, off_front_rad
        See `AnchorView`.
    told : tuple of float
        By ray casts: at least what the picture's would be.
    framed, framed_behind : float
        See `AnchorView`: from here, and from behind, None where there is no picture from there.
    """

    shown: float
    elevation_deg: float
    clearance_m: float
    told: tuple[float, ...]
    off_front_rad: float | None
    framed: float
    framed_behind: float | None


class Scorer(Protocol):
    """Scores the candidates of one object against each other."""

    @property
    def name(self) -> str:
        """One of ``geometric``, ``clip``, ``vlm``; its column is ``score_<name>``."""
        ...

    def score(self, name: str, views: Sequence[AnchorView]) -> Sequence[float | None]:
        """Score how well views show an object.

        Parameters
        ----------
        name : str
            What a person would call the object.
        views : sequence of AnchorView
            Of its candidates, at least one.

        Returns
        -------
        sequence of float or None
            One a view, in [0, 1], higher is better; None where there is no opinion.

        Raises
        ------
        AerialDojoError
            What the scorer needs is not there: a file, a package, a service.
        """
        ...
