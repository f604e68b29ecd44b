"""The registry of a report's tables: how each groups episodes, what it averages, what it says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from aerialdojo_gen.base.constants import MODALITIES
from aerialdojo_gen.base.names import check_known
from aerialdojo_gen.base.text_table import TextTable
from aerialdojo_gen.benchmark import tables
from aerialdojo_gen.benchmark.difficulty import DIFFICULTY, SEEN
from aerialdojo_gen.benchmark.metrics import METRICS, at_radius
from aerialdojo_gen.benchmark.runs import ADAPTED, GROUP_OF, UPPER_BOUND, Run
from aerialdojo_gen.benchmark.tables import Cell, Cut, ReportRequest, Row, make_table, profile_head
from aerialdojo_gen.store.schemas import FAMILIES, SETTINGS

PARTITIONS = ("ID", "OOD", ADAPTED)
NAMES_OF = {
    "base": "Base", "standard": "Standard", "long_horizon": "Long-Horizon", "semantic": "Semantic", "image": "Image",
}  # fmt: skip
_ORDER = {"family": tuple(FAMILIES.values()), "setting": SETTINGS, "modality": MODALITIES, "partition": PARTITIONS}
_RATES = ("sr", "sr_view", "osr", "spl")
# At every radius but the first, as in the paper.
_FURTHER = ("sr", "sr_view", "osr")
_PAPER_TABLES = {"base": " (the form of the paper's Table 4)", "standard": " (the form of the paper's Table 5)"}
# Reversals that a note lists.
_MAX_REVERSALS = 6
_MEANS = "Mean of the {0}families, each the mean of its scenes; ± is the standard deviation over scenes."


def run_rows(
    request: ReportRequest, section: str | None = None, where: tuple[tuple[str, str], ...] = ()
) -> list[Row]:
    """Make a row a run that has such episodes, under a section's heading or its group's."""
    rows = []
    for k, run in enumerate(request.runs):
        cut = Cut(k, where=where)
        if n := int(request.mask(cut).sum()):
            leading = {"episodes": f"{n:,}", "hints": run.hints or "none"}
            heading = run.group if section is None else section
            is_oracle = GROUP_OF.get(run.agent) == UPPER_BOUND  # It is not ranked
            rows.append(Row(run.label, cut, heading, None if is_oracle else section or "", leading))
    return rows


def _headline_rows(request: ReportRequest) -> list[Row]:
    """Make the rows of all episodes, of those with a held-out object, and of those outside the two malls."""
    rows = run_rows(request)
    share = float(np.mean(request.column("malls") == "malls"))
    for section, column, value in (
        ("target or start object held out (target_split = test)", "target_split", "test"),
        (f"without the two malls ({100 * share:.0f} % of the episodes)", "malls", "other scenes"),
    ):
        if column in ("malls", *request.breakdowns.found) and len(request.values(column, Cut())) > 1:
            rows += run_rows(request, section, ((column, value),))
    return rows


def _setting_rows(request: ReportRequest) -> list[Row]:
    return [row for name in SETTINGS for row in run_rows(request, NAMES_OF[name], (("setting", name),))]


def _scene_rows(request: ReportRequest) -> list[Row]:
    return [Row(n, Cut(where=(("scene", n),)), rank_group=None) for n in request.values("scene", Cut())]


def _type_rows(request: ReportRequest) -> list[Row]:
    order = list(FAMILIES.values())
    family_of = dict(zip(request.column("scene_type").tolist(), request.column("family").tolist(), strict=True))
    types = sorted(family_of, key=lambda t: (order.index(f) if (f := family_of[t]) in order else len(order), t))
    return [Row(name, Cut(where=(("scene_type", name),)), family_of[name], None) for name in types]


def _cells(parts: Mapping[str, Cut], measures: Sequence[str]) -> list[Cell]:
    return [Cell(head, name, cut) for head, cut in parts.items() for name in measures]


def _by(request: ReportRequest, column: str, heads: Sequence[str] = (), *, gap: str = "") -> list[Cell]:
    """Make columns a value of a column; and the differences of the rates of its first two values."""
    values = _ORDER[column]
    named = heads or [NAMES_OF.get(value, value) for value in values]
    cuts = [Cut(where=((column, value),)) for value in values]
    parts = dict(zip(named, cuts, strict=True))
    if ADAPTED not in request.values("partition", Cut()):
        parts.pop(ADAPTED, None)
    rates = {"sr": "SR", "osr": "OSR"} if gap else {}
    gaps = [Cell(gap, name, cuts[1], head, (name, cuts[0])) for name, head in rates.items()]
    return _cells(parts, request.shown()) + gaps


def _by_run(request: ReportRequest) -> list[Cell]:
    return [Cell(run.label, name, Cut(k)) for k, run in enumerate(request.runs) for name in request.shown()]


def _by_profile(request: ReportRequest, metrics: Sequence[str]) -> list[Cell]:
    """Make columns a success rule: all measures of the first, some of the others."""
    first = request.profiles[0]
    return [
        Cell(profile_head(profile), name, Cut(profile=profile))
        for k, profile in enumerate(request.profiles)
        # Another radius changes neither the distance at the end nor the collisions.
        for name in request.shown(
            metrics if k and (metrics is _FURTHER or profile.planar == first.planar) else METRICS, profile
        )
    ]


def _along_way(request: ReportRequest) -> bool:
    # The heights of the goal are not in the log: only the distance in space is known along the way.
    known = all(run.path_clearance_to_goal_m is not None for run in request.runs)
    return not request.profiles[0].planar and known


def _by_radius(request: ReportRequest) -> list[Cell]:
    radii = sorted(set(request.radii_m))
    at = {r: Cut(profile=at_radius(request.profiles[0], r)) for r in radii}
    rates = [("SR ↑", "sr", Cut()), ("OSR, at poses ↑", "osr", Cut())]
    rates += [("OSR, along the way ↑", "osr", Cut(along_way=True))] if _along_way(request) else []
    cells = [Cell(head, name, at[r] | how, f"{r:g} m") for head, name, how in rates for r in radii]
    cells += [
        Cell("SR gain, points", "sr", at[far], f"{near:g}→{far:g} m", ("sr", at[near]))
        for near, far in pairwise(radii)
    ]
    return cells + [Cell("OSR − SR, points", "osr", at[r], f"{r:g} m", ("sr", at[r])) for r in radii]


def _radius_notes(request: ReportRequest) -> list[str]:
    notes = ["OSR at poses is the paper's: the distance is taken after every action."]
    if _along_way(request):
        notes[0] += " Along the way it is taken on every segment flown: a move may pass the goal and end beyond it."
    rows = _setting_rows(request)
    for section in dict.fromkeys(row.section for row in rows):
        for near, far in pairwise(sorted(set(request.radii_m))):
            at = [Cut(profile=at_radius(request.profiles[0], radius)) for radius in (near, far)]
            own = [row for row in rows if row.section == section]
            rates = [(row.label, request.score(at[0] | row.cut).sr, request.score(at[1] | row.cut).sr) for row in own]
            # Differences in the last digits are sums in another order.
            turned = [
                f"{up} overtakes {down}"
                for up, a, a_far in rates
                for down, b, b_far in rates
                if a < b - 1e-9 and a_far > b_far + 1e-9
            ]
            if turned:
                more = f", and {len(turned) - _MAX_REVERSALS} more" if len(turned) > _MAX_REVERSALS else ""
                listed = ", ".join(turned[:_MAX_REVERSALS])
                notes.append(f"{section}, from {near:g} to {far:g} m: {listed}{more}.")
    return notes


def _adapted_notes(runs: Sequence[Run]) -> list[str]:
    """Name the runs whose agents were trained on OOD scenes."""
    scenes = {run.label: len(set(run.episodes["scene"][run.episodes["partition"] == ADAPTED])) for run in runs}
    listed = "; ".join(f"{label}, {n} scene{'s' * (n > 1)}" for label, n in scenes.items() if n)
    return [f"{ADAPTED}: OOD scenes whose training tasks the agent was trained on: {listed}."] if listed else []


def caveats(runs: Sequence[Run]) -> list[str]:
    """Notes on what a comparison of runs lacks: families, episodes, SR-view, common tasks."""
    lacking: dict[tuple[str, ...], list[str]] = {}
    for run in runs:
        if missing := tuple(f for f in FAMILIES.values() if not (run.episodes["family"] == f).any()):
            lacking.setdefault(missing, []).append(run.label)
    notes = [
        f"{', '.join(labels)}: no episodes of {', '.join(missing)}; overall is the mean of the others."
        for missing, labels in lacking.items()
    ]
    notes += [
        f"{run.label}: {run.failed:,} more episodes failed for reasons outside the agent."
        for run in runs
        if run.failed
    ]
    blind = [run.label for run in runs if np.isnan(run.episodes["view_distance_m"]).any()]
    if len(blind) < len(runs):
        notes.append("SR-view: stopped that near to any valid viewpoint of the target, with the target in sight.")
    if blind:
        notes.append(
            f"No SR-view of {', '.join(blind)}: flown by an older version or on a release without viewpoints/. "
            "Flown again on a release that has them they have one."
        )
    notes.append(
        "Goals name a compass direction, and agents have no compass: only the hint heading tells them which way they "
        "face at the start."
    )
    notes += _adapted_notes(runs)
    if len({frozenset(run.table["task_id"].to_pylist()) for run in runs}) > 1:
        notes.append("The runs flew different tasks: their scores are no comparison of agents.")
    return notes


def sample_notes(request: ReportRequest, runs: Sequence[Run]) -> list[str]:
    """Say what the paper's protocol flies and what runs lack of it; nothing where the report is of all tasks."""
    if request.sample is None:
        return []
    maps = sorted({scene for run in runs for scene in run.episodes["scene"].tolist()})
    spread = "; ± is the sample standard deviation over these maps" if len(maps) > 1 else ""
    notes = [f"Tasks of the paper's protocol alone, on {', '.join(maps)}{spread}."]
    for run in runs:
        settings, flown = set(run.episodes["setting"].tolist()), len(run.episodes)
        whole = sum(len(own.get(setting, ())) for own in request.sample.tasks.values() for setting in settings)
        if flown < whole:
            notes.append(f"{run.label}: {flown:,} of the sample's {whole:,} tasks.")
    return notes


def in_setting(runs: Sequence[Run], setting: str) -> list[Run]:
    """Return the runs' episodes of a setting, without runs that have none."""
    masks = [run.episodes["setting"] == setting for run in runs]
    return [run.where(mask) for run, mask in zip(runs, masks, strict=True) if mask.any()]


def result_tables(request: ReportRequest) -> list[TextTable]:
    """Make a table per length setting that any run has flown, in the form of the paper's."""
    made = []
    for setting in SETTINGS:
        runs = in_setting(request.runs, setting)
        if not runs:
            continue
        results = [result for result in request.paper_results if result.setting == setting]
        theirs = [
            Row(r.model, Cut(), f"another simulator (Unreal Engine; {r.source}), {r.group}-source", "paper", result=r)
            for r in results
        ]
        own = replace(request, runs=runs)
        counts = {len(run.episodes) for run in runs}
        sizes = ", ".join(f"{run.label} {len(run.episodes):,}" for run in runs)
        each = f"{counts.pop():,} episodes each." if len(counts) == 1 else f"Episodes: {sizes}."
        notes = [_MEANS.format(""), each, *sample_notes(request, runs)]
        if results:
            notes.append(
                "The paper's agents flew in its own simulator (Unreal Engine), on other scenes and tasks; its ± fits "
                "the sample standard deviation over eight maps. Its rows are ranked among themselves."
            )
        table = make_table(
            own, NAMES_OF[setting] + _PAPER_TABLES.get(setting, ""), run_rows(own) + theirs,
            _by_profile(own, _FURTHER), leading=("hints",), spread=True, intervals=request.intervals,
        )  # fmt: skip
        if any(not label for label, _ in table.rows):
            notes[0] += " Below: 95 % bootstrap interval, scenes drawn anew within their family."
        made.append(replace(table, notes=[*notes, *caveats(runs)]))
    return made


def radius_tables(request: ReportRequest) -> list[TextTable]:
    """SR and OSR at several radii; notes name the agents whose order changes between radii."""
    profile = request.profiles[0]
    title = f"Success radius{'' if profile.own else f', {profile.name}'}"
    notes = _radius_notes(request)
    return [make_table(request, title, _setting_rows(request), _by_radius(request), notes=notes)]


def breakdown_tables(request: ReportRequest, kind: str) -> list[TextTable]:
    """Make a table per breakdown of a kind that has at least two parts with episodes."""
    made = []
    for name, found in request.breakdowns.found.items():
        if found.kind != kind or len(found.parts) < 2:
            continue
        counts = [[int((own == part).sum()) for own in found.labels] for part in found.parts]
        alike = all(len(set(count)) == 1 for count in counts)
        sizes = "; ".join(f"{part}: {n[0]:,}" for part, n in zip(found.parts, counts, strict=True))
        note = " ".join(filter(None, (found.note, f"Episodes – {sizes}." if alike else "")))
        cells = _cells({part: Cut(where=((name, part),)) for part in found.parts}, request.shown(_RATES))
        made += _by_first_rule(request, found.title, run_rows(request), cells, notes=[note] if note else [])
    return made


def _by_first_rule(
    request: ReportRequest, title: str, rows: Sequence[Row], columns: Sequence[Cell], **how: Any
) -> list[TextTable]:
    return [make_table(request, f"{title}, {profile_head(request.profiles[0])}", rows, columns, **how)]


def visit_tables(request: ReportRequest) -> list[TextTable]:
    """Count visits that end as failures."""
    radius = f"{request.profiles[0].radius_m:g} m"
    groups = {
        "episodes": ("flown", "visited", "solved", "lost"),
        "lost: how they ended, %": ("too far", "collided", "ran out", "no Stop"),
    }
    note = (
        f"Visited: within {radius} at some pose. Lost: visited and no success. Too far: stopped outside; ran out: of "
        "actions, outside; no Stop: ran out of actions within the radius. Episodes are counted, families not "
        "averaged."
    )
    title, rows = f"Where visits are lost, {radius}", _setting_rows(request)
    return [tables.count_table(request, title, rows, groups, tables.visit_cells, [note])]


_CONDUCT = {
    "ended by, %": ("Stop", "collision", "budget"), "actions": ("mean", "refused", "unreadable"),
    "service": ("requests", "tokens in", "tokens out", "USD"),
}  # fmt: skip


_TABLES: dict[str, Callable[[ReportRequest], list[TextTable]]] = {
    "overall": lambda r: [make_table(
        r, "Overall", _headline_rows(r), _by_profile(r, _RATES), spread=True, leading=("episodes", "hints"),
        notes=[_MEANS.format("four "), *sample_notes(r, r.runs), *caveats(r.runs)],
    )],
    "results": result_tables,
    "partition": lambda r: _by_first_rule(
        r, "ID and OOD scenes", _setting_rows(r), _by(r, "partition", gap="OOD − ID, points"),
        notes=_adapted_notes(r.runs),
    ),
    "family": lambda r: _by_first_rule(r, "By family", run_rows(r), _by(r, "family")),
    "averages": lambda r: _by_first_rule(r, "Two averages", _headline_rows(r), _cells(
        {"mean of the families": Cut(), "mean of the tasks": Cut(weighted=True)}, r.shown()
    ), notes=[
        "A family counts a quarter on the left, as much as it has tasks on the right: two different populations."
    ]),
    "setting": lambda r: _by_first_rule(r, "By setting", run_rows(r), _by(r, "setting")),
    "goal": lambda r: _by_first_rule(
        r, "Goal type", _setting_rows(r),
        _by(r, "modality", ("Semantic goal", "Image goal"), gap="image − semantic, points"),
    ),
    "modality": lambda r: _by_first_rule(r, "By modality", run_rows(r), _by(r, "modality")),
    "radius": radius_tables,
    "visits": visit_tables,
    "difficulty": partial(breakdown_tables, kind=DIFFICULTY),
    "seen": partial(breakdown_tables, kind=SEEN),
    "conduct": lambda r: [tables.count_table(r, "How episodes went", run_rows(r), _CONDUCT, tables.outcome_cells)],
    "type": lambda r: _by_first_rule(r, "By scene type", _type_rows(r), _by_run(r), stub="scene type"),
    "scene": lambda r: _by_first_rule(r, "By scene", _scene_rows(r), _by_run(r), stub="scene"),
}  # fmt: skip
NAMES = tuple(_TABLES)
# What the paper's split leaves out, and the paper's tables; the others are optional.
DEFAULT = ("overall", "results")


def missing_note(request: ReportRequest, names: Sequence[str] = DEFAULT) -> str:
    """Name the requested breakdowns that are missing, and why, in one line; empty if none is."""
    needed = {"all", "difficulty", "seen"} & set(names)
    return request.breakdowns.missing_note if needed else ""


def check_names(names: Sequence[str]) -> Sequence[str]:
    """Return the names; UsageError for an unknown one."""
    check_known("no table", names, NAMES, besides=("all",))
    return names


def named_tables(request: ReportRequest, names: Sequence[str]) -> dict[str, list[TextTable]]:
    """Make tables by name."""
    check_names(names)
    return {name: _TABLES[name](request) for name in NAMES if "all" in names or name in names}


def report_tables(request: ReportRequest, names: Sequence[str] = DEFAULT) -> list[TextTable]:
    """Make tables."""
    return [table for made in named_tables(request, names).values() for table in made]
