"""Files of a release that are missing, cut, changed or foreign; counts of the whole; the command and its reports."""

import json
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.command_line import called
from support.layout_checks import drawn
from support.planting import SMOKE, check, definitions, put

from aerialdojo_gen.base.config.pipeline import Pipeline
from aerialdojo_gen.base.config.sections import SplitConfig
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.paper_figures import PaperScene
from aerialdojo_gen.dataset.validate import ValidationOptions, counts, validate, write_report
from aerialdojo_gen.dataset.validate.registry import Fault
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.schemas import SETTINGS


def relative(planted, key):
    return planted.path(key).relative_to(planted.release).as_posix()


@pytest.mark.parametrize("key", drawn(["tasks/test", "routes/train", "release/objects", "release/scenes"], 1))
def test_a_part_that_is_missing(planted, key):
    planted.path(key).unlink()
    assert check(planted) == {"part_missing": [relative(planted, key)]}


def flip_a_bit(path):
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 3] ^= 16
    path.write_bytes(raw)


def read(path):
    return pq.read_table(path, partitioning=None)


def test_parts_that_are_damaged(planted):
    damages = {
        "tasks/train": lambda path: path.write_bytes(path.read_bytes()[:-9000]),
        "routes/train": flip_a_bit,
        "routes/test": lambda path: path.write_bytes(path.read_bytes()[:-9]),
        "release/anchors": lambda path: pq.write_table(read(path).replace_schema_metadata(None), path),
        "tasks/test": lambda path: pq.write_table(read(path)[:-2], path),
    }
    for key, damage in damages.items():
        damage(planted.path(key))
    assert check(planted) == {"part_damaged": sorted(relative(planted, key) for key in damages)}
    for key in ("tasks/train", "release/anchors"):
        with pytest.raises(StoreError, match="damaged"):
            store.read_scene(planted.data, key, planted.scene)


def test_columns_that_are_missing_or_in_another_unit_or_tell_the_goal(planted):
    table = read(planted.path("release/landmarks"))
    planted.write_table("release/landmarks", table.drop_columns(["mesh_node"]))
    anchors = read(planted.path("release/anchors"))
    at = anchors.schema.get_field_index("x_m")
    field = anchors.schema.field(at).with_metadata({"unit": "cm"})
    pq.write_table(anchors.set_column(at, field, anchors["x_m"]), planted.path("release/anchors"))
    table = read(planted.path("tasks/train"))
    planted.write_table("tasks/train", table.append_column("goal_x_m", pa.array([1.5] * table.num_rows)))
    assert check(planted) == {
        "part_schema": [relative(planted, "release/anchors"), relative(planted, "release/landmarks")],
        "leaking_column": [relative(planted, "tasks/train")],
    }


def test_rows_that_are_not_those_of_the_footer(planted):
    path = planted.path("tasks/train")
    table = read(path)
    name = table.schema.names.index("target_name")
    pq.write_table(table.set_column(name, table.schema.field(name), pa.array(["a lamp"] * table.num_rows)), path)
    assert check(planted, use_meshes=False)["part_content"] == [relative(planted, "tasks/train")]


def test_files_that_do_not_belong(planted):
    strange = ["notes.txt", "tasks/part-U_Courtyard_0.parquet", "routes/ood_train/part-U_Courtyard_0.parquet"]
    strange += ["objects/.part-U_Courtyard_0.parquet.4242.tmp.parquet"]
    for name in strange:
        (planted.release / name).parent.mkdir(exist_ok=True)
        (planted.release / name).write_bytes(b"x")
    assert check(planted, use_meshes=False) == {"foreign_file": sorted(strange)}


def test_a_scene_that_the_card_counts_and_nobody_has(planted):
    for key, place in store.LAYOUT.items():
        if place.template.startswith("release/"):
            planted.path(key).unlink()
    assert set(check(planted, whole=True, use_meshes=False)) == {"card_counts"}


@pytest.mark.parametrize("tables", drawn([["landmarks"], ["anchors", "objects"], ["scenes"]], 1))
def test_tables_without_rows(planted, tables):
    keys = [f"release/{table}" for table in tables]
    for key in keys:
        planted.write(key, [])
    assert check(planted) == {"part_rows": [relative(planted, key) for key in keys]}


def test_parts_of_two_runs(planted):
    planted.write_table("release/anchors", read(planted.path("release/anchors")), fingerprint="another")
    assert check(planted, use_meshes=False) == {"part_of_other_run": [relative(planted, "release/anchors")]}


def test_a_card_and_a_croissant_that_tell_other_numbers(planted):
    card, machine = planted.release / "README.md", planted.release / "croissant.json"
    rows = len(planted.rows("tasks/train"))
    assert f"| `id_train` | {rows} |" in card.read_text()
    card.write_text(card.read_text().replace(f"| `id_train` | {rows} |", "| `id_train` | 7,777 |"))
    text = machine.read_text()
    assert f"id_train ({rows} rows)" in text
    machine.write_text(text.replace(f"id_train ({rows} rows)", "id_train (7,777 rows)"))
    options = ValidationOptions(planted.release, pipeline=Pipeline(), use_meshes=False)
    assert [(f.check, f.part, f.table, f.found) for f in validate(options).faults] == [
        ("card_counts", "README.md", "tasks", "7,777 rows told"),
        ("card_counts", "croissant.json", "tasks", "7,777 rows told"),
    ]
    machine.write_text('{"recordSet": [{"name": "tasks", "description": 7}]}')
    assert "no record sets" in {fault.found for fault in validate(options).faults}
    machine.write_text("{")
    card.unlink()
    assert check(planted, whole=True, use_meshes=False) == {"card_counts": ["README.md"]}


def papers(planted, **changes):
    """The paper's table as it would be if it had this scene alone."""
    tasks = dict.fromkeys(SETTINGS, 0)
    path_m = 0.0
    for side in ("train", "test"):
        for row in planted.rows(f"routes/{side}"):
            tasks[row["setting"]] += 1
            path_m += row["length_m"]
    held = {"landmarks": len(planted.rows("release/landmarks")), "objects": len(planted.rows("release/objects"))}
    return {planted.scene: PaperScene(planted.scene, **(held | tasks | {"path_m": path_m} | changes))}


def test_counts_that_are_not_the_papers(planted, monkeypatch):
    asked = {"pipeline": Pipeline(split=SplitConfig(paper_counts=True)), "use_meshes": False}
    train = {s: sum(r["setting"] == s for r in planted.rows("routes/train")) for s in ("base", "standard")}
    both = papers(planted)[planted.scene].tasks
    splits = {("ID", "train"): train | {"long_horizon": 0}}
    splits["ID", "test"] = {s: n - splits["ID", "train"][s] for s, n in both.items()}
    monkeypatch.setattr(counts, "splits", lambda: splits)
    monkeypatch.setattr(counts, "inventory", lambda: papers(planted))
    assert check(planted, **asked) == {}
    monkeypatch.setattr(counts, "inventory", lambda: papers(planted, objects=99, base=both["base"] + 3))
    assert check(planted, **asked) == {"scene_counts": ["objects", "test base tasks"]}


def test_splits_and_path_of_the_whole(planted, monkeypatch):
    asked = {"pipeline": Pipeline(split=SplitConfig(paper_counts=True)), "use_meshes": False}
    other = type(planted)(planted.data, "U_Courtyard_1")
    whole = papers(planted) | papers(other)
    tally = {
        (side.upper(), subset): {s: sum(r["setting"] == s for r in one.rows(f"routes/{subset}")) for s in SETTINGS}
        for side, one in (("id", planted), ("ood", other))
        for subset in ("train", "test")
    }
    monkeypatch.setattr(counts, "splits", lambda: tally)
    monkeypatch.setattr(counts, "inventory", lambda: whole)
    assert check(planted, whole=True, **asked) == {}
    tally["OOD", "test"]["base"] += 1
    whole[planted.scene] = papers(planted, path_m=whole[planted.scene].path_m * 1.02)[planted.scene]
    found = check(planted, whole=True, **asked)
    assert found == {"split_counts": ["base tasks"], "path_total": [""]}


def run(*args):
    return called("validate", *args, "--pipeline", SMOKE, COLUMNS="120")


def test_the_command_passes_a_clean_release_and_says_what_it_did_not_check(planted):
    done = run("--data", planted.data, "--scene", "U_*_0", "--workers", 1, "--verbose", "--pictures", 0)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "no fault" in done.stdout
    routes = [
        sum(len(read(p)) for p in planted.release.glob(f"routes/*/part-{name}.parquet")) for name in ("*_0", "*")
    ]
    lines = [line.split() for line in done.stdout.splitlines()]
    assert all([name, "routes", str(routes[0]), "0"] in lines for name in ("route_collision", "oracle_fails"))
    bare = run("--release", planted.release, "--no-meshes", "--workers", 1, "--verbose")
    assert bare.returncode == 0
    (line,) = [line.split() for line in bare.stdout.splitlines() if line.startswith("oracle_fails ")]
    assert line == ["oracle_fails", "routes", "0", "0", *["--no-meshes", "was", "given", "(2", "times)"]]
    brief = run("--release", planted.release, "--no-meshes", "--workers", 1)
    assert brief.returncode == 0
    assert brief.stdout.splitlines()[-1] == bare.stdout.splitlines()[-1]
    lines = [line.split() for line in brief.stdout.splitlines() if not line.startswith(" ")]
    assert len(lines) < 30, "a line per table"
    checks = {table: int(n) for table, n, *_ in lines[2:-1] if table != "every"}
    assert checks["routes"] == sum(line.split()[1:2] == ["routes"] for line in bare.stdout.splitlines())
    (line,) = [line for line in lines if line[0] == "routes"]
    assert line[2:4] == [str(routes[1]), "0"]
    assert "--no-meshes" in line, "what was not checked is said here too"


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.nightly)])
def test_the_command_names_every_row_at_fault_in_the_same_order_by_any_number_of_workers(planted, tmp_path, workers):
    rows = planted.rows("tasks/train")
    for row in rows[:3]:
        row["action_budget"] = 7
    planted.write("tasks/train", rows)
    other = type(planted)(planted.data, "U_Courtyard_1").edit("tasks/test", put("action_budget", 7))
    report = tmp_path / "faults.csv"
    done = run("--data", planted.data, "--no-meshes", "--workers", workers, "--report", report, "--max-faults", 1)
    assert done.returncode == 1
    assert "task_budget: 4 at fault" in done.stdout
    assert "and 3 more" in done.stdout
    faults = pd.read_csv(report)
    assert list(faults.columns) == list(Fault._fields)
    assert faults["key"].tolist() == [f"task_id={row['task_id']}" for row in (*rows[:3], other)]
    assert set(faults["check"]) == {"task_budget"}
    assert set(faults["found"]) == {7}
    found = validate(ValidationOptions(planted.release, pipeline=definitions(), use_meshes=False))
    assert "\n".join(found.table_lines(120)) in done.stdout


@pytest.mark.parametrize(
    ("args", "code", "word"),
    [
        (["{data}"], 2, "name another release with --release {data}"),
        (["--data", "{data}", "--scene", "U_Mall_0"], 2, "no scene 'U_Mall_0'"),
        (["--data", "{data}", "--report", "faults.xlsx"], 2, ".jsonl"),
    ],
)
def test_what_a_user_can_get_wrong_is_one_line(planted, args, code, word):
    done = run(*(a.format(data=planted.data) for a in args))
    assert (done.returncode, done.stderr.count("\n")) == (code, 1), done.stderr
    assert word.format(data=planted.data) in done.stderr


def test_reports_hold_the_same_faults_in_every_format(tmp_path):
    faults = [Fault("a", "S", "tasks", "p", f"k={i}", 'found "x", ü', "y\nz") for i in range(3)]
    paths = {s: write_report(faults, tmp_path / f"r.{s}") for s in ("jsonl", "json", "csv", "parquet")}
    rows = [fault._asdict() for fault in faults]
    assert [json.loads(line) for line in paths["jsonl"].read_text().splitlines()] == rows
    assert paths["json"].read_bytes() == paths["jsonl"].read_bytes()
    assert pd.read_csv(paths["csv"]).to_dict("records") == rows
    assert pd.read_parquet(paths["parquet"]).to_dict("records") == rows
    with pytest.raises(UsageError, match="one of"):
        write_report(faults, Path("r.txt"))
