"""The pictures that candidates are scored by: from where they are, and from where the reference picture is taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.config.sections import AnchorSampleConfig
from aerialdojo_gen.scoring.base import AnchorView
from aerialdojo_gen.stages.work.anchor_world import Candidates
from aerialdojo_gen.stages.work.step_back import step_back_m, telling_m


def pictured_from(
    found: Candidates, which: NDArray[np.int64], size_px: int, radius_m: float, config: AnchorSampleConfig
) -> tuple[list[AnchorView], list[float]]:
    """Picture candidates.

    Parameters
    ----------
    found : Candidates
        Of one object.
    which : (k,) int64
        Those to be pictured.
    size_px : int
        Edge of the pictures.
    radius_m : float
        The body's.
    config : AnchorSampleConfig

    Returns
    -------
    views : list of AnchorView
        From the candidates; what they show of the object and of its telling parts is the mean of that and of what
        the picture from further back shows, where there is one.
    step_back_m : list of float
        How far back that is.
    """
    views = [found.picture(int(k), size_px, config.fov_deg) for k in which]
    backs = []
    for k in which:
        place, yaw = found.positions_m[k], float(found.yaw_rad[k])
        most = min(config.step_back_m, telling_m(found.patches, found.seen[k], place, yaw, config.fov_deg))
        backs.append(step_back_m(found.world, found.instance, found.points, place, yaw, config.fov_deg, most))
    far = [n for n, back in enumerate(backs) if back > 0.0]
    if far:
        yaws = found.yaw_rad[which[far]]
        away = np.column_stack([np.cos(yaws), np.sin(yaws), np.zeros(len(yaws))]) * np.array(backs)[far, None]
        behind = Candidates.of(
            found.world, found.instance, found.points, found.positions_m[which[far]] - away, yaws, radius_m, config
        )
        for k, n in enumerate(far):
            back = behind.picture(k, size_px, config.fov_deg)
            told = _mean(views[n].told, back.told)
            views[n] = replace(views[n], shown=(views[n].shown + back.shown) / 2.0, told=told)
    return views, backs


def _mean(here: Sequence[float], there: Sequence[float]) -> tuple[float, ...]:
    return tuple((a + b) / 2.0 for a, b in zip(here, there, strict=True))
