"""A small release to plant faults in: rows are changed in the Parquet files, as careless hands would change them."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from support.foreign import changed_glb

from aerialdojo_gen.base.config.pipeline import load_pipeline
from aerialdojo_gen.dataset.contents import part_name
from aerialdojo_gen.dataset.validate import ValidationOptions, validate
from aerialdojo_gen.dataset.validate.parts import read_tables, release_of
from aerialdojo_gen.dataset.validate.registry import Outcome, run_checks
from aerialdojo_gen.dataset.validate.report import Report
from aerialdojo_gen.dataset.validate.rows import SceneData
from aerialdojo_gen.dataset.validate.run import SCENE_CHECKS
from aerialdojo_gen.geometry.frames import wrap_turned_rad
from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.footers import decode, encode
from aerialdojo_gen.store.schemas import APPROACH, VIEWPOINTS
from aerialdojo_gen.store.tables import column_digests, content_digest, from_rows

SMOKE = Path(__file__).resolve().parents[2] / "pipelines" / "smoke.toml"
LISTS = ("x_m", "y_m", "z_m", "yaw_rad", "action")
Row = dict[str, object]


class Planted:
    """A release's folder and one of its scenes."""

    def __init__(self, data: Path, scene: str) -> None:
        self.data, self.scene, self.release = data, scene, data / "release"

    def path(self, key: str) -> Path:
        return self.release / part_name(key, self.scene, "")

    def rows(self, key: str) -> list[Row]:
        return pq.read_table(self.path(key), partitioning=None).to_pylist()

    def write(self, key: str, rows: list[Row], *, sort: bool = True, schema: pa.Schema | None = None) -> None:
        """Write rows as a part whose footer tells of these rows; nulls and doubles are let through."""
        spec = store.LAYOUT[key].spec
        if sort:
            rows = sorted(
                rows, key=lambda row: tuple(row[k] if isinstance(row[k], int) else str(row[k]) for k in spec.order)
            )
        loose = schema or pa.schema([f.with_nullable(True) for f in spec.schema])
        table = pa.Table.from_pylist(rows, schema=loose)
        self.write_table(key, table)

    def write_table(self, key: str, table: pa.Table, **footer: object) -> None:
        """Write a table as a part whose footer tells of it, but for what is given of the footer."""
        info = decode(pq.read_metadata(self.path(key)).metadata[store.META])
        told = {"content": content_digest(table), "columns": column_digests(table), "rows": table.num_rows} | footer
        meta = encode(dataclasses.replace(info, **told))
        pq.write_table(table.replace_schema_metadata({store.META: meta}), self.path(key))

    def edit(self, key: str, change: Callable[[Row], None], wanted: Callable[[Row], bool] = lambda _: True) -> Row:
        """Change the first row that is wanted; returns it as it then is."""
        rows = self.rows(key)
        row = next(row for row in rows if wanted(row))
        change(row)
        self.write(key, rows)
        return row

    def edit_all(self, key: str, change: Callable[[Row], None], wanted: Callable[[Row], bool]) -> list[Row]:
        rows = self.rows(key)
        changed = [row for row in rows if wanted(row)]
        for row in changed:
            change(row)
        self.write(key, rows)
        return changed


class PlantedFault(NamedTuple):
    """What is done to a row, and the check that names it."""

    found_by: str
    key: str  # Of the table in `store.LAYOUT`
    change: Callable[[Row], None]
    wanted: Callable[[Row], bool] = lambda _: True


def plant(planted: Planted, faults: Iterable[PlantedFault]) -> dict[str, list[str]]:
    """Plant each fault in a row of its own, of another navigation task; gives the rows that checks should name."""
    expected: dict[str, list[str]] = {}
    used = set()
    for fault in faults:

        def free(row: Row, fault: PlantedFault = fault) -> bool:
            return _of_itself(fault.key, row) not in used and fault.wanted(row)

        row = planted.edit(fault.key, fault.change, free)
        used.add(_of_itself(fault.key, row))
        expected.setdefault(fault.found_by, []).append(named(fault.key, row))
    return {name: sorted(keys) for name, keys in expected.items()}


def _of_itself(key: str, row: Row) -> object:
    return row["nav_id"] if "nav_id" in row else (key, *(row[name] for name in store.LAYOUT[key].spec.key))


def named(key: str, row: Row) -> str:
    """A row as reports name it."""
    spec = store.LAYOUT[key].spec
    names = {"tasks": ("task_id",), "scenes": ("scene",)}.get(spec.name, tuple(k for k in spec.key if k != "scene"))
    return " ".join(f"{name}={row[name]}" for name in names)


def changed(name: str, new: Callable[[Any], object], at: float | None = None) -> Callable[[Row], None]:
    """The change of a value by a function of it; of a list, at a place: 0 first, 0.5 in the middle, 1 last."""

    def change(row: Row) -> None:
        into, key = (row, name) if at is None else (row[name], int(at * (len(row[name]) - 1)))
        into[key] = new(into[key])

    return change


def put(name: str, value: object, at: float | None = None) -> Callable[[Row], None]:
    """The change that gives a column a value."""
    return changed(name, lambda _: value, at)


def add(name: str, off: float, at: float | None = None) -> Callable[[Row], None]:
    """The change that adds to a number."""
    return changed(name, lambda value: value + off, at)


def of_nav(nav_id: object) -> Callable[[Row], bool]:
    """Whether a row is of a navigation task."""
    return lambda row: row["nav_id"] == nav_id


def poses(row: Row) -> np.ndarray:
    return np.column_stack([row[name] for name in LISTS[:4]])


def refly(row: Row, actions: list[int]) -> Row:
    """The route with other actions: flown anew, measured anew, ended on the goal by an Approach if it had one."""
    old = poses(row)
    flown = replay(old[0], actions[:-1])
    if APPROACH in actions:
        flown[-1, :3] = old[-1, :3]
    return measured(row, flown, actions)


def measured(row: Row, path: np.ndarray, actions: list[int]) -> Row:
    length = float(np.linalg.norm(np.diff(path[:, :3], axis=0), axis=1).sum())
    euclidean = float(np.linalg.norm(path[-1, :3] - path[0, :3]))
    return row | {
        **{name: path[:, k].tolist() for k, name in enumerate(LISTS[:4])},
        "action": list(actions), "n_actions": len(actions), "length_m": length, "euclidean_m": euclidean,
        "detour_ratio": length / euclidean, "plan_detour": max(1.0, length / row["free_length_m"]),
        "climb_m": float(np.maximum(np.diff(path[:, 2]), 0.0).sum()),
        "agent_action": [action for action in actions if action != APPROACH],
    }  # fmt: skip


def turned(yaw: float, degrees: float) -> float:
    return float(wrap_turned_rad(np.array([yaw + math.radians(degrees)]))[0])


def faults_of(report) -> dict[str, list[str]]:
    """What was found: keys of the rows at fault by check."""
    found: dict[str, list[str]] = {}
    for fault in report.faults:
        found.setdefault(fault.check, []).append(fault.key or fault.part)
    return {name: sorted(set(keys)) for name, keys in found.items()}


def scene_data(planted: Planted, **options: Any) -> SceneData:
    """The scene that was planted in, as checks get it."""
    release = release_of(planted.release)
    tables, _ = read_tables(release, planted.scene)
    return SceneData(planted.scene, release, definitions(), tables, **options)


def check_of(planted: Planted, *tables: str) -> dict[str, list[str]]:
    """Make the checks of some tables alone: of `scenes`, those of the mesh file."""
    checks = [one for one in SCENE_CHECKS if one.table in tables]
    return faults_of(Report((planted.scene,), tuple(run_checks(scene_data(planted, pictures=0), checks))))


def outcome_of(data: SceneData, name: str) -> Outcome:
    """Make one check alone."""
    (outcome,) = run_checks(data, [one for one in SCENE_CHECKS if one.name == name])
    return outcome


def definitions():
    """The smoke pipeline's, with the props whose names descriptions use."""
    return load_pipeline(SMOKE).model_copy(update={"scene_assets": SMOKE.parent.parent / "scene_assets"})


def edit_mesh(planted: Planted, change: Callable[[dict], None]) -> None:
    """Change the glTF document of the scene's mesh, and put the new digest into `scenes`, as a bad author would."""
    path = planted.data / "meshes" / f"{planted.scene}.glb"
    path.write_bytes(changed_glb(path.read_bytes(), change))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    planted.edit("release/scenes", lambda row: row.update(mesh_sha256=digest))


def retell(planted: Planted, object_id: int, **said: Any) -> None:
    """Say something else of an object, in `objects` and all its tasks; a description as one by a person."""
    named = {"target_name" if name == "name" else name: text for name, text in said.items()}
    if "description" in said:
        text = said["description"]
        written = {"level": "written", "text": text, "claims": [], "frame": text, "held_out": False}
        said = said | {"paraphrases": [written]}
        named |= {"frame_seen_in_train": True}
    planted.edit("release/objects", lambda row: row.update(said), lambda row: row["object_id"] == object_id)
    for side in ("train", "test"):
        asked = {r["nav_id"] for r in planted.rows(f"routes/{side}") if r["target_object_id"] == object_id}

        def change(task: Row) -> None:
            task.update({name: text for name, text in named.items() if task[name] is not None})

        planted.edit_all(f"tasks/{side}", change, lambda task, asked=asked: task["nav_id"] in asked)


def rename(planted: Planted, new: Callable[[Row], str]) -> list[str]:
    """Give routes other nav_ids, in `routes` and `tasks`; returns the keys of those that have one."""
    keys = []
    for side in ("train", "test"):
        routes = planted.rows(f"routes/{side}")
        names = {row["nav_id"]: new(row) for row in routes}
        tasks = planted.rows(f"tasks/{side}")
        for task in tasks:
            task["nav_id"] = names[task["nav_id"]]
            task["task_id"] = f"{task['nav_id']}-{task['modality'][0]}"
        keys += [f"nav_id={name}" for old, name in names.items() if old != name]
        planted.write(f"routes/{side}", [row | {"nav_id": names[row["nav_id"]]} for row in routes])
        planted.write(f"tasks/{side}", tasks)
    return sorted(keys)


def check(planted: Planted, **options) -> dict[str, list[str]]:
    """Validate the scene that was planted in, no picture drawn anew; the whole release with ``whole=True``."""
    scenes = () if options.pop("whole", False) else (planted.scene,)
    options = {"pipeline": definitions(), "pictures": 0} | options
    return faults_of(validate(ValidationOptions(planted.release, scenes=scenes, **options)))


def write_viewpoints(data: Path, scene: str, rows: list[dict[str, Any]]) -> None:
    """Write `release/viewpoints` of a scene: rows of object_id, x_m, y_m, z_m, yaw_rad."""
    kept = ("object_id", "x_m", "y_m", "z_m", "yaw_rad")
    content = [
        {"scene": scene, "viewpoint_id": k, **{name: row[name] for name in kept}} for k, row in enumerate(rows)
    ]
    store.write_shard(data, "release/viewpoints", scene, 0, from_rows(VIEWPOINTS, content))


def with_column(table: pa.Table, name: str, values: pa.Array) -> pa.Table:
    """Put a column into a table, in place of one of that name where there is one."""
    if name in table.column_names:
        at = table.column_names.index(name)
        return table.set_column(at, table.schema.field(at), values)
    return table.append_column(pa.field(name, values.type), values)


def set_columns(planted: Planted, key: str, **columns: pa.Array) -> None:
    """Set columns of a part of the release, whether this version's schema knows them or not."""
    table = pq.read_table(planted.path(key), partitioning=None)
    for name, values in columns.items():
        table = with_column(table, name, values)
    planted.write_table(key, table)


def set_difficulty(planted: Planted) -> None:
    """Give routes and tasks made-up columns of difficulty and of what training shows, by the order of their rows."""
    for side in ("train", "test"):
        routes, tasks = planted.rows(f"routes/{side}"), planted.rows(f"tasks/{side}")
        order = {row["nav_id"]: k for k, row in enumerate(routes)}
        n, k = np.arange(len(routes)), np.array([order[row["nav_id"]] for row in tasks], dtype=np.int64)
        shares = np.where(n % 4 == 0, 0.25, 0.0)
        set_columns(
            planted, f"routes/{side}", plan_detour=pa.array(1.0 + 0.07 * (n % 9)),
            straight_line_free=pa.array(n % 3 == 0), climb_m=pa.array(1.5 * (n % 6)),
            target_visible_at_start=pa.array(shares),
        )  # fmt: skip
        set_columns(
            planted, f"tasks/{side}", target_seen_in_train=pa.array(k % 2 == 0),
            start_seen_in_train=pa.array(k % 5 != 0), pair_seen_in_train=pa.array(k % 6 == 0),
            shape_seen_in_train=pa.array(k % 7 != 0),
            target_split=pa.array(np.where(k % 4 == 0, "test", "train")),
            target_held_out=pa.array(k % 4 == 0), start_held_out=pa.array(k % 8 == 0),
        )  # fmt: skip


def without_columns(path: Path, names: tuple[str, ...]) -> None:
    """Rewrite a shard as a version wrote it that did not know some columns."""
    table = pq.ParquetFile(path).read()
    info = decode(table.schema.metadata[store.META])
    table = table.drop_columns(list(names))
    told = dataclasses.replace(info, content=content_digest(table), columns=column_digests(table))
    pq.write_table(table.replace_schema_metadata({store.META: encode(told)}), path)
