"""What sections of a pipeline say that must fit together, so that no stage undoes another's work."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.pipeline import Pipeline


def disagreements(pipeline: Pipeline) -> list[str]:
    """Find what contradicts another section."""
    anchor, plan, kept, radius = pipeline.anchor_sample, pipeline.plan, pipeline.filter, pipeline.embodiment.radius_m
    extra = min(rung.extra_radius_m for rung in plan.ladder)
    thickest = radius + plan.margin_m + max(rung.extra_radius_m for rung in plan.ladder)
    rules = (
        (
            anchor.standoff_m > radius + anchor.margin_m,
            f"[anchor-sample] standoff_m = {anchor.standoff_m:g} must be more than [embodiment] radius_m + "
            f"[anchor-sample] margin_m = {radius + anchor.margin_m:g}: every anchor would touch its object",
        ),
        (
            plan.margin_m + extra <= anchor.margin_m,
            f"[anchor-sample] margin_m = {anchor.margin_m:g} must be at least [plan] margin_m plus the smallest "
            f"extra_radius_m of its ladder = {plan.margin_m + extra:g}: routes could not leave their anchors",
        ),
        (
            plan.clearance_cap_m > thickest,
            f"[plan] clearance_cap_m = {plan.clearance_cap_m:g} must be more than [embodiment] radius_m + [plan] "
            f"margin_m + the largest extra_radius_m of its ladder = {thickest:g}: nothing would be free",
        ),
        (
            plan.min_detour_ratio <= kept.min_detour_ratio,
            f"[plan] min_detour_ratio = {plan.min_detour_ratio:g} must be at most [filter] min_detour_ratio = "
            f"{kept.min_detour_ratio:g}: routes that filter would keep are never searched",
        ),
        (
            plan.search == "all" or pipeline.split.paper_counts,
            '[plan] search = "released" needs [split] paper_counts = true: without them all that is kept is '
            'released; leave it out, or set search = "all"',
        ),
    )
    return [text for holds, text in rules if not holds]
