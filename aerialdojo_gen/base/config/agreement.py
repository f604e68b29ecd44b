"""What several sections of a pipeline say of one thing, and in what way it must agree.

Every stage is given its own section alone. Lengths that stages share stand in each of theirs: were they to differ,
one stage would leave out what the next one is to keep, without a word.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.pipeline import Pipeline

# The paper's; other radii are computed from the log of distances.
SUCCESS_RADIUS_M = 3.0
# How far from its goal an agent may be that has flown all of a route's actions, which are without the Approach.
NEAR_GOAL_M = 1.0


def disagreements(pipeline: Pipeline) -> list[str]:
    """Find what sections say differently of one and the same thing, so that no stage undoes another's work."""
    body, anchor, reference = pipeline.embodiment, pipeline.anchor_sample, pipeline.reference_images
    pair, plan, kept, render = pipeline.pair_objects, pipeline.plan, pipeline.filter, pipeline.render
    radius = body.radius_m
    extra = min(rung.extra_radius_m for rung in plan.ladder)
    thickest = radius + plan.margin_m + max(rung.extra_radius_m for rung in plan.ladder)
    longest = kept.long_horizon.max_length_m
    rules = (
        (
            body.wheelbase_m <= 2 * radius,
            f"[embodiment] wheelbase_m = {body.wheelbase_m:g} must be at most twice radius_m = {radius:g}: the "
            "rotors stick out of the collision sphere",
        ),
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
            pair.min_euclidean_m <= kept.min_euclidean_m,
            f"[pair-objects] min_euclidean_m = {pair.min_euclidean_m:g} must be at most [filter] min_euclidean_m = "
            f"{kept.min_euclidean_m:g}: pairs that filter would keep are never planned",
        ),
        (
            pair.max_length_m >= longest,
            f"[pair-objects] max_length_m = {pair.max_length_m:g} must be at least [filter] "
            f"long_horizon.max_length_m = {longest:g}: pairs that filter would keep are never planned",
        ),
        (
            plan.max_length_m >= longest,
            f"[plan] max_length_m = {plan.max_length_m:g} must be at least [filter] long_horizon.max_length_m = "
            f"{longest:g}: routes that filter would keep are never searched",
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
        (
            plan.max_approach_m <= pair.max_approach_m,
            f"[plan] max_approach_m = {plan.max_approach_m:g} must be at most [pair-objects] max_approach_m = "
            f"{pair.max_approach_m:g}: pairs are left out by a bound that routes could beat",
        ),
        (
            plan.max_approach_m <= NEAR_GOAL_M,
            f"[plan] max_approach_m = {plan.max_approach_m:g} must be at most {NEAR_GOAL_M:g}: agents cannot fly the "
            "Approach, and would stop too far from the goal",
        ),
        (
            kept.min_euclidean_m >= SUCCESS_RADIUS_M,
            f"[filter] min_euclidean_m = {kept.min_euclidean_m:g} must be at least the success radius, "
            f"{SUCCESS_RADIUS_M:g}: a Stop at the start would succeed",
        ),
        (
            anchor.fov_deg == reference.fov_deg == render.fov_deg,
            f"fov_deg differs: [anchor-sample] {anchor.fov_deg:g}, [reference-images] {reference.fov_deg:g}, "
            f"[render] {render.fov_deg:g}: it is one camera, set all three",
        ),
    )  # fmt: skip
    return [text for holds, text in rules if not holds]
