"""What counts as success: the benchmark's own rule, and those of its relatives, over one and the same episode log."""

from __future__ import annotations

from dataclasses import dataclass

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import unknown


@dataclass(frozen=True)
class Profile:
    """A rule of success.

    Distances are always measured to the goal anchor, which lies 1 m from the target's surface. Benchmarks that
    measure to the target itself judge by up to that metre and half the target's size differently.
    """

    name: str  # What ``--profile`` takes
    radius_m: float  # Distance to the goal, metres, that still counts as there; the boundary is inside
    needs_stop: bool = True  # Whether the agent must have called Stop
    fails_on_collision: bool = True  # Whether a collision rules success out
    planar: bool = False  # Whether distances are taken in the plane, height left out
    straight_reference: bool = False
    about: str = ""  # Where the rule comes from, one line


PROFILES = {
    profile.name: profile
    for profile in (
        Profile(
            "aerialdojo", 3.0, about="an explicit Stop within 3 m of the anchor, without collision, within budget"
        ),
        Profile("aerialdojo-5m", 5.0, about="the same at 5 m, reported beside it"),
        Profile("uav-on", 20.0, about="UAV-ON: Stop within 20 m, a collision ends the episode"),
        Profile("aerialvln", 20.0, planar=True, about="AerialVLN: Stop within 20 m in the plane"),
        Profile(
            "openfly",
            20.0,
            needs_stop=False,
            fails_on_collision=False,
            straight_reference=True,
            about="OpenFly: the episode ends within 20 m, however it ends; SPL against the straight distance",
        ),
    )
}
DEFAULT_PROFILES = ("aerialdojo", "aerialdojo-5m")


def profile_named(name: str) -> Profile:
    """Return a profile by its name."""
    if name not in PROFILES:
        raise UsageError(unknown("no profile", name, PROFILES))
    return PROFILES[name]
