"""What a release's goals show and how its reference routes fly, by family and by setting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.dataset.stats.comparison import Column, Comparison, Figure, own_table, quantile
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURNS
from aerialdojo_gen.geometry.part_visibility import FRONT_RAD
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import Where, open_root
from aerialdojo_gen.store.schemas import FAMILIES, SETTINGS

Floats = NDArray[np.float64]

# Before the goal the camera should see it, whichever way the drone goes.
_ARRIVAL_M = 3.0
_NAMES = dict(zip(SETTINGS, ("base", "standard", "long-horizon"), strict=True))


@dataclass(frozen=True)
class Goals:
    """One entry per object; NaN if the release has no value."""

    family: NDArray[np.str_]  # (n,) array of str; of its scene
    off_front_rad: Floats  # (n,) float64; of the selected anchor; NaN for an object without a front
    tells_shown: Floats  # (n,) float64
    unoccluded: Floats  # Shares of the object that nothing hides in the picture, and that lie within its edges
    framed: Floats
    step_back_m: Floats  # (n,) float64; from the anchor to where the picture is taken


@dataclass(frozen=True)
class Flights:
    """One entry a reference route."""

    setting: NDArray[np.str_]  # (n,) array of str
    min_clearance_m: Floats  # (n,) float64
    n_actions: NDArray[np.int64]  # (n,) int64
    n_turns: NDArray[np.int64]
    ahead_m: Floats  # (n,) float64; flown before the last 3 m
    sideways_m: Floats


def read_goals(data: Where, scenes: Sequence[str]) -> Goals:
    """Read what the goals of a release's scenes show."""
    root = open_root(data)
    found: dict[str, list[Any]] = {name: [] for name in Goals.__dataclass_fields__}
    for scene in scenes:
        family = store.read_scene(root, "release/scenes", scene, ["family"])["family"][0].as_py()
        anchors = store.read_scene(
            root, "release/anchors", scene,
            ["object_id", "selected", "off_front_rad", "part_unoccluded", "part_framed"],
        )  # fmt: skip
        chosen = {row["object_id"]: row for row in anchors.to_pylist() if row["selected"]}
        for row in store.read_scene(
            root, "release/objects", scene, ["object_id", "tells_shown", "step_back_m"]
        ).to_pylist():
            anchor = chosen.get(row["object_id"], {})
            found["family"].append(family)
            found["off_front_rad"].append(anchor.get("off_front_rad"))
            found["unoccluded"].append(anchor.get("part_unoccluded"))
            found["framed"].append(anchor.get("part_framed"))
            found["tells_shown"].append(row["tells_shown"])
            found["step_back_m"].append(row["step_back_m"])
    families = np.array(found.pop("family"), dtype=np.str_)
    return Goals(families, **{name: np.array(values, dtype=np.float64) for name, values in found.items()})


def read_flights(data: Where, scenes: Sequence[str]) -> Flights:
    """Read how the reference routes of a release's scenes fly."""
    root = open_root(data)
    parts: list[Flights] = []
    for scene in scenes:
        for subset in ("train", "test"):
            routes = store.read_scene(root, f"routes/{subset}", scene, ["setting", "min_clearance_m", "action"])
            if routes.num_rows:
                parts.append(_flights(routes.combine_chunks()))
    if not parts:
        none = np.empty(0)
        return Flights(np.empty(0, np.str_), none, none.astype(np.int64), none.astype(np.int64), none, none)
    return Flights(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in Flights.__dataclass_fields__)
    )


def _flights(routes: pa.Table) -> Flights:
    lists = routes["action"].chunk(0)
    counts = np.diff(lists.offsets.to_numpy()).astype(np.int64)
    actions, first = lists.flatten().to_numpy(), np.cumsum(counts) - counts
    metres = np.abs(DISPLACEMENTS[actions])
    flown = np.cumsum(metres.sum(axis=1))
    ends = np.repeat(flown[first + counts - 1], counts)
    ahead, sideways = np.where((ends - flown >= _ARRIVAL_M)[:, None], metres[:, :2], 0.0).T
    return Flights(
        np.array(routes["setting"].to_pylist(), dtype=np.str_),
        routes["min_clearance_m"].to_numpy(),
        counts,
        np.add.reduceat((TURNS[actions] != 0).astype(np.int64), first),
        np.add.reduceat(ahead, first),
        np.add.reduceat(sideways, first),
    )


def _share(mask: NDArray[np.bool_], known: NDArray[np.bool_]) -> Figure:
    return 100.0 * float(mask[known].mean()) if known.any() else None


def _mean(values: Floats) -> Figure:
    known = values[np.isfinite(values)]
    return 100.0 * float(known.mean()) if len(known) else None


def goal_table(goals: Goals) -> Comparison:
    """Table of the quality of goals by family."""
    columns = (
        Column("objects", exact=False), Column("fronts", exact=False), Column("front %", "%", exact=False),
        Column("parts %", "%", exact=False), Column("unhidden %", "%", exact=False),
        Column("framed %", "%", exact=False), Column("back m", "m", exact=False, digits=2),
    )  # fmt: skip

    def figures(own: NDArray[np.bool_]) -> tuple[Figure, ...]:
        off, parts_shown = goals.off_front_rad[own], goals.tells_shown[own]
        return (
            int(own.sum()),
            int(np.isfinite(off).sum()),
            _share(off <= FRONT_RAD, np.isfinite(off)),
            _share(parts_shown == 1.0, np.isfinite(parts_shown)),
            _mean(goals.unoccluded[own]),
            _mean(goals.framed[own]),
            quantile(goals.step_back_m[own], 0.5),
        )

    there = sorted(set(goals.family.tolist()), key=lambda name: ([*FAMILIES.values(), name].index(name), name))
    rows = [(name, figures(goals.family == name)) for name in there]
    rows.append(("all", figures(np.ones(len(goals.family), dtype=np.bool_))))
    notes = (
        "fronts: objects with a front; front: of those, seen from within 60° of it.",
        "parts: of the objects that parts tell, those whose reference picture shows",
        "all of these. unhidden, framed: share of the object that nothing hides there,",
        "and that is within the picture, mean. back: how far behind the anchor it is",
        "taken, median.",
    )
    return own_table("What goals show", "family", columns, rows, notes)


def flight_table(flights: Flights) -> Comparison:
    """Say by length setting how reference routes fly."""
    columns = (
        Column("routes", exact=False), Column("clear m", "m", exact=False, digits=3),
        Column("clear p10", "m", exact=False, digits=3), Column("actions", exact=False),
        Column("turns %", "%", exact=False), Column("sideways %", "%", exact=False),
    )  # fmt: skip

    def figures(own: NDArray[np.bool_]) -> tuple[Figure, ...]:
        level = float(flights.ahead_m[own].sum() + flights.sideways_m[own].sum())
        actions = int(flights.n_actions[own].sum())
        return (
            int(own.sum()),
            quantile(flights.min_clearance_m[own], 0.5),
            quantile(flights.min_clearance_m[own], 0.1),
            quantile(flights.n_actions[own].astype(np.float64), 0.5),
            100.0 * float(flights.n_turns[own].sum()) / actions if actions else None,
            100.0 * float(flights.sideways_m[own].sum()) / level if level else None,
        )

    rows = [(_NAMES[setting], figures(flights.setting == setting)) for setting in SETTINGS]
    rows.append(("all", figures(np.ones(len(flights.setting), dtype=np.bool_))))
    notes = (
        "clear: smallest distance to a surface on a route, median and 10th percentile.",
        "actions: median. turns: of all actions. sideways: of the horizontal metres,",
        "but for the last three, where the camera should see the goal.",
    )
    return own_table("How reference routes fly", "setting", columns, rows, notes)


def worth_tables(data: Where, scenes: Sequence[str]) -> list[Comparison]:
    """Make both tables."""
    return [goal_table(read_goals(data, scenes)), flight_table(read_flights(data, scenes))]
