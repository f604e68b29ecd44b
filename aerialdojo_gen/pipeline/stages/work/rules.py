"""The filter rules, and the reasons of rejection (paper: filtering)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.config.sections import FilterConfig
from aerialdojo_gen.base.config.shared import Setting
from aerialdojo_gen.base.constants import SETTINGS

KEPT = "kept"


def settings_of(config: FilterConfig) -> tuple[Setting, Setting, Setting]:
    """Return the length settings in the order of `aerialdojo_gen.store.schemas.SETTINGS`."""
    return config.base, config.standard, config.long_horizon


def judge(
    outcome: NDArray[np.str_],
    euclidean_m: NDArray[np.float64],
    length_m: NDArray[np.float64],
    n_actions: NDArray[np.int32],
    config: FilterConfig,
    plan_detour: NDArray[np.float64] | None = None,
    visible_at_start: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.str_], NDArray[np.str_]]:
    """Judge candidates (paper: filtering): (n,) reasons, ``"kept"`` or the first rule that fails, and settings."""
    solved = outcome == "SOLVED"
    # Fixed widths: numpy would cut a longer word to the width of the first ones.
    setting = np.full(len(outcome), "", dtype="U24")
    over = np.zeros(len(outcome), dtype=bool)
    for name, rule in zip(SETTINGS, settings_of(config), strict=True):
        inside = solved & (length_m >= rule.min_length_m) & (length_m < rule.max_length_m)
        setting[inside] = name
        over |= inside & (n_actions > rule.action_budget)
    # A product instead of a ratio: d_E may be zero.
    near_straight = length_m < config.min_detour_ratio * euclidean_m
    none = np.full(len(outcome), np.nan)
    small = ~((none if plan_detour is None else plan_detour) >= config.min_plan_detour)
    in_view = ~((none if visible_at_start is None else visible_at_start) <= config.max_visible_at_start)
    rules = [
        ("too_close", euclidean_m <= config.min_euclidean_m),
        ("too_short", length_m < config.base.min_length_m),
        ("too_long", length_m >= config.long_horizon.max_length_m),
        ("near_straight", near_straight),
        ("over_budget", over),
        ("small_plan_detour", small & (config.min_plan_detour > 1.0)),
        ("target_in_view", in_view & (config.max_visible_at_start < 1.0)),
    ]
    reason = np.full(len(outcome), KEPT, dtype="U24")
    for word, fails in reversed(rules):
        reason[fails] = word
    reason[~solved] = np.char.lower(outcome[~solved])
    return reason, setting
