"""Results by success radius: gains, rank reversals, visits that end as failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from aerialdojo_gen.benchmark.grid import Measure, Row, Table, score_table, section_heads
from aerialdojo_gen.benchmark.metrics import Floats, Profile, outcomes, success_curve
from aerialdojo_gen.benchmark.runs import Run
from aerialdojo_gen.benchmark.tables import by_setting, run_row

DEFAULT_RADII_M = (3.0, 5.0)
# Reversals that a note lists.
_MOST_REVERSALS = 6


def at_radius(profile: Profile, radius_m: float) -> Profile:
    """Return a success rule with another radius, named by it."""
    if radius_m == profile.radius_m:
        return profile
    name = "aerialdojo" if profile.name.startswith("aerialdojo") else profile.name
    about = f"{profile.name} at {radius_m:g} m"
    return replace(profile, name=f"{name}-{radius_m:g}m", radius_m=radius_m, about=about)


def radius_table(runs: Sequence[Run], profile: Profile, radii_m: Sequence[float] = DEFAULT_RADII_M) -> Table:
    """SR and OSR at several radii, metres; notes name the agents whose order changes between radii."""
    radii = sorted(set(radii_m))
    segments = not profile.planar and all(run.path_clearance_to_goal_m is not None for run in runs)
    lines: list[Row] = []
    rates: dict[str, list[tuple[str, Floats]]] = {}
    for section, run in by_setting(runs):
        sr, osr = success_curve(run.episodes, profile, np.array(radii))
        values = [*sr, *osr]
        if segments and run.path_clearance_to_goal_m is not None:
            # The heights of the goal are not in the log: only the distance in space is known along the way.
            passed = replace(run.episodes, min_distance_m=run.path_clearance_to_goal_m)
            values += [*success_curve(passed, profile, np.array(radii))[1]]
        values += [*np.diff(sr), *(osr - sr)]
        lines.append(run_row(run, tuple(float(v) for v in values), rank_group=section, section=section))
        rates.setdefault(section, []).append((run.label, sr))
    heads = [f"{radius:g} m" for radius in radii]
    gains = [Measure(f"{near:g}→{far:g} m", "sr", signed=True) for near, far in pairwise(radii)]
    groups = [
        ("SR ↑", [Measure(h, "sr") for h in heads]),
        ("OSR, at poses ↑", [Measure(h, "osr") for h in heads]),
        *([("OSR, along the way ↑", [Measure(h, "osr") for h in heads])] if segments else []),
        *([("SR gain, points", gains)] if gains else []),
        ("OSR − SR, points", [Measure(h, "sr", True) for h in heads]),
    ]
    notes = ["OSR at poses is the paper's: the distance is taken after every action."]
    if segments:
        notes[0] += " Along the way it is taken on every segment flown: a move may pass the goal and end beyond it."
    notes += [note for section, ranked in rates.items() for note in _reversals(section, radii, ranked)]
    rule = "" if profile.name.startswith("aerialdojo") else f", {profile.name}"
    return score_table(f"Success radius{rule}", "agent", groups, lines, notes)


def _reversals(section: str, radii: Sequence[float], ranked: Sequence[tuple[str, Floats]]) -> list[str]:
    notes = []
    for k, (near, far) in enumerate(pairwise(radii)):
        turned = [
            f"{up} overtakes {down}"
            for up, a in ranked
            for down, b in ranked
            # Differences in the last digits are sums in another order.
            if a[k] < b[k] - 1e-9 and a[k + 1] > b[k + 1] + 1e-9
        ]
        if turned:
            more = f", and {len(turned) - _MOST_REVERSALS} more" if len(turned) > _MOST_REVERSALS else ""
            notes.append(f"{section}, from {near:g} to {far:g} m: {', '.join(turned[:_MOST_REVERSALS])}{more}.")
    return notes


def visit_table(runs: Sequence[Run], profile: Profile) -> Table:
    """Episodes that were within the radius and are no success, by how they ended."""
    flown = list(by_setting(runs))
    rows = tuple((run.label, _visits(run, profile)) for _, run in flown)
    sections = section_heads([section for section, _ in flown])
    groups = (
        ("episodes", ("flown", "visited", "solved", "lost")),
        ("lost: how they ended, %", ("too far", "collided", "ran out", "no Stop")),
    )
    notes = (
        f"Visited: within {profile.radius_m:g} m at some pose. Lost: visited and no success. Too far: "
        "stopped outside; ran out: of actions, outside; no Stop: ran out of actions within the radius. Episodes are "
        "counted, families not averaged.",
    )
    return Table(f"Where visits are lost, {profile.radius_m:g} m", "agent", groups, rows, notes, sections)


def _visits(run: Run, profile: Profile) -> tuple[str, ...]:
    e = run.episodes
    judged = outcomes(e, profile)
    lost = judged.oracle_success & ~judged.success
    within = judged.distance_m <= profile.radius_m
    late = e.n_actions > e.action_budget
    stopped = e.stop_called & ~e.collision & ~late
    shares = (
        stopped,
        e.collision,
        ~stopped & ~e.collision & ~within,
        ~stopped & ~e.collision & within,
    )
    n = int(lost.sum())
    counts = (len(e), int(judged.oracle_success.sum()), int(judged.success.sum()), n)
    return (
        *(f"{count:,}" for count in counts),
        *(f"{100.0 * int((lost & share).sum()) / n:.1f}" if n else "–" for share in shares),
    )
