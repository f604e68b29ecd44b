"""The pictures that candidates are scored by: from where they are, and from where the reference picture is taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.config.sections import AnchorSampleConfig
from aerialdojo_gen.geometry.viewpoints import level_marks
from aerialdojo_gen.scoring.base import AnchorView
from aerialdojo_gen.scoring.knowing import clarity
from aerialdojo_gen.stages.work.anchor_world import Candidates
from aerialdojo_gen.stages.work.step_back import steps_back_m, telling_m

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Looked:
    """Candidates of an object, each with the place behind it that its reference picture is taken from.

    Attributes
    ----------
    found : Candidates
        All of the object.
    which : (k,) int64
        Those that are meant.
    step_back_m : (k,) float64
        How far behind each the picture is taken.
    behind : Candidates
        From there.
    rank : (k,) float64
        Score of the ray casts from both places.
    """

    found: Candidates
    which: NDArray[np.int64]
    step_back_m: Floats
    behind: Candidates
    rank: Floats

    @classmethod
    def of(cls, found: Candidates, which: NDArray[np.int64], radius_m: float, config: AnchorSampleConfig) -> Looked:
        """Look from behind candidates.

        Parameters
        ----------
        found : Candidates
            Of one object.
        which : (k,) int64
            Those to be looked from.
        radius_m : float
            The body's.
        config : AnchorSampleConfig
        """
        places, yaws = found.positions_m[which], found.yaw_rad[which]
        telling = [
            telling_m(found.patches, found.seen[k], places[n], float(yaws[n]), config.fov_deg)
            for n, k in enumerate(which)
        ]
        most = np.minimum(config.step_back_m, telling)
        backs = steps_back_m(found.world, found.instance, found.points, places, yaws, config.fov_deg, most)
        away = np.column_stack([np.cos(yaws), np.sin(yaws), np.zeros(len(yaws))]) * backs[:, None]
        behind = found.moved(which, places - away, radius_m, config)
        views, elevation = behind.views, found.elevation_deg[which]
        clear = clarity(views.visible_fraction, views.framed, np.zeros(len(which)), level_marks(elevation))
        rank = (found.rank[which] + behind.rank) / 2.0 * clear
        return cls(found, which, backs, behind, rank)

    def pictures(self, few: NDArray[np.int64], size_px: int, fov_deg: float) -> list[AnchorView]:
        """Picture candidates.

        Parameters
        ----------
        few : (m,) int64
            Numbers among `which`.
        size_px : int
            Edge of the pictures.
        fov_deg : float

        Returns
        -------
        list of AnchorView
            From the candidates, with the one from behind where there is one; what is shown of the object and of its
            telling parts is the mean of both.
        """
        views = []
        for n in few.tolist():
            view = self.found.picture(int(self.which[n]), size_px, fov_deg)
            if self.step_back_m[n] > 0.0:
                back = self.behind.picture(n, size_px, fov_deg)
                told = _mean(view.told, back.told)
                view = replace(view, shown=(view.shown + back.shown) / 2.0, told=told, behind=back)
            views.append(view)
        return views


def _mean(here: Sequence[float], there: Sequence[float]) -> tuple[float, ...]:
    return tuple((a + b) / 2.0 for a, b in zip(here, there, strict=True))
