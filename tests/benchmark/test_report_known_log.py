"""The report of a log written by hand: two agents and a baseline, four families, both partitions; figures by hand."""

import csv
import io
import math
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from support.run_logs import episode

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.paper_figures import results
from aerialdojo_gen.base.table_formats import as_text
from aerialdojo_gen.base.text_table import BEST, SECOND
from aerialdojo_gen.benchmark import paired, registry, tables
from aerialdojo_gen.benchmark.metrics import PROFILES, bootstrap, summarize
from aerialdojo_gen.benchmark.runs import group_runs, load_runs, mark_adapted, with_baselines
from aerialdojo_gen.benchmark.tables import ReportRequest
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.tables import from_rows

AT_3, AT_5 = PROFILES["aerialdojo"], PROFILES["aerialdojo-5m"]

# How an episode may end: distance at the end, smallest distance, termination.
ENDS = {
    "S": (2.0, 2.0, "stop"),  # a success
    "F": (4.0, 4.0, "stop"),  # a success at 5 m only
    "M": (10.0, 10.0, "stop"),  # a miss
    "T": (6.0, 2.5, "stop"),  # was there, stopped too far
    "C": (8.0, 2.9, "collision"),  # was there, collided
    "R": (7.0, 1.0, "budget"),  # was there, ran out elsewhere
    "N": (2.0, 2.0, "budget"),  # is there, never stopped
    "P": (10.0, math.hypot(2.0, 2.8), "stop"),  # flew past at 2.8 m, between two poses
    "0": (9.0, 9.0, "stop"),  # did nothing
}
# Scene by scene; episodes in turn have a semantic and an image goal.
LOG = {
    "alpha": ["SFMM", "MC", "ST", "PM", "RN", "SS", "CC", "FF"],
    "beta": ["FFFF", "FF", "SM", "SM", "MM", "FM", "MM", "MM"],
    "stop": ["0000", "00", "00", "00", "00", "00", "00", "00"],
}
SCENES = ["U_Mall_0", "U_Mall_1", "N_Coast_0", "N_Coast_1", "I_Harbor_0", "I_Harbor_1", "D_Flood_0", "D_Flood_1"]


def write(data, run, agent, ends, more=""):
    for scene, codes in zip(SCENES, ends, strict=True):
        euclidean_m, rows, steps = 8.0 if scene.endswith("_0") else 9.0, [], []
        for k, code in enumerate(codes + more):
            final_m, least_m, how = ENDS[code]
            row = episode(run, "random", scene, k, rng.generator(0, "known-log")) | {
                "agent": agent, "setting": "base", "action_budget": 90, "stop_called": how == "stop",
                "collision": how == "collision", "termination": how, "final_distance_m": final_m,
                "min_distance_m": least_m, "final_horizontal_distance_m": final_m,
                "min_horizontal_distance_m": least_m, "path_length_m": 12.5, "reference_length_m": 10.0,
                "euclidean_m": euclidean_m, "n_actions": 90 if how == "budget" else 7,
                "success": how == "stop" and final_m <= 3.0, "oracle_success": least_m <= 3.0,
                "start_x_m": 0.0, "start_y_m": 0.0, "start_z_m": euclidean_m,
            }  # fmt: skip
            rows.append(row)
            # The goal is at the origin: from (−2, 2.8) to (2, 2.8), then away to (10, 0).
            past = [(-2.0, 2.8, 0.0), (2.0, 2.8, 0.0), (10.0, 0.0, 0.0)]
            own = {"run_id": run, "task_id": row["task_id"], "scene": scene, "action": 1, "refused": False}
            own |= {"yaw_rad": 0.0, "answer": None}
            steps += [
                own | {"step": n, "x_m": x, "y_m": y, "z_m": z, "distance_m": math.hypot(x, y, z)}
                for n, (x, y, z) in enumerate(past if code == "P" else [(0.0, 0.0, euclidean_m)])
            ]
        for spec, written in ((schemas.EPISODES, rows), (schemas.STEPS, steps), (schemas.FAILURES, [])):
            store.write_shard(data, spec.name, scene, 0, from_rows(spec, written), run=run)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    data = tmp_path_factory.mktemp("known")
    write(data, "alpha", "package:Alpha", LOG["alpha"])
    write(data, "beta", "package:Beta", LOG["beta"])
    # The baseline has flown more than these tasks.
    write(data, "base", "stop", LOG["stop"], more="S")
    return data


@pytest.fixture(scope="module")
def runs(log):
    return group_runs(with_baselines(log, load_runs(log, ["alpha", "beta"])))


def made(name, runs, data=Path("no-release"), **options):
    (table,) = registry.report_tables(ReportRequest(open_root(data), runs, [AT_3], **options), [name])
    return table


def cells(table, label):
    return next(row for name, row in table.rows if name == label)


def test_baselines_that_flew_the_same_tasks_are_added_and_cut_down(log, runs):
    assert [(run.name, run.group, len(run.episodes)) for run in runs] == [
        ("alpha", "agents", 18), ("beta", "agents", 18), ("base", "baselines", 18)
    ]  # fmt: skip
    # Of the baseline's own tasks, alpha has flown a part: no baseline is added to it.
    alone = with_baselines(log, load_runs(log, ["base"]))
    assert [run.name for run in alone] == ["base"]
    other = log.parent / "other"
    write(other, "alpha", "package:Alpha", LOG["alpha"], more="M")
    write(other, "base", "stop", LOG["stop"])
    assert [run.name for run in with_baselines(other, load_runs(other, ["alpha"]))] == ["alpha"]
    groups = {"open": ["alpha"], "closed": ["package:Beta"]}
    assert [run.group for run in group_runs(runs, groups)] == ["open", "closed", "baselines"]
    with pytest.raises(UsageError, match="group 'open': no run 'gamma': there are alpha, beta, base"):
        group_runs(runs, {"open": ["gamma"]})


def test_tables_4_and_5_with_the_papers_rows(runs):
    request = ReportRequest(open_root("no-release"), runs, [AT_3, AT_5], paper_results=results())
    overall, table = registry.report_tables(request)
    assert overall.title == "Overall"
    assert table.title.startswith("Base")
    assert [head for head, _ in table.groups] == ["", "3 m", "5 m"]
    assert cells(table, "package:Alpha")[0] == "none"
    # alpha at 3 m: Urban (¼ + 0)/2, Natural (½ + 0)/2, Infrastructure (0 + 1)/2, Disaster 0: 21.875 % in the mean.
    # OSR: Urban (¼ + ½)/2, Natural (1 + 0)/2, Infrastructure (1 + 1)/2, Disaster (1 + 0)/2: 59.375 %.
    # SPL is 0.8 a success. DTS: Urban (6.5 + 9)/2, Natural (4 + 10)/2, (4.5 + 2)/2, (8 + 4)/2: 6 m.
    # CR: Urban (0 + ½)/2, Disaster (1 + 0)/2: 18.75 %. At 5 m: SR ¼, ¼, ½, ½; OSR ½, ¾, 1, 1.
    means = [cell.split(" ± ")[0] for cell in cells(table, "package:Alpha")[1:]]
    assert means == ["21.88", "59.38", "17.50", "6.00", "18.75", "37.50", "81.25"]
    # Scenes' SR: ¼, 0, ½, 0, 0, 1, 0, 0; squares 1.3125, less 8 · 0.21875², by 7: the square of 0.36443.
    assert cells(table, "package:Alpha")[1] == "21.88 ± 36.44"
    means = [cell.split(" ± ")[0] for cell in cells(table, "package:Beta")[1:]]
    # DTS: Urban 4, Natural 6, Infrastructure (10 + 7)/2, Disaster 10.
    assert means == ["12.50", "12.50", "10.00", "7.12", "0.00", "43.75", "43.75"]
    assert cells(table, "stop")[4] == "9.00 ± 0.00"
    rows = [label for label, _ in table.rows]
    order = [rows.index(name) for name in ("package:Alpha", "package:Beta", "stop")]
    assert table.sections[order[0]] == "agents"
    assert table.sections[order[2]] == "baselines"
    marks = [[table.marks.get((row, k)) for k in range(1, 8)] for row in order]
    assert marks[0] == [BEST, BEST, BEST, BEST, None, SECOND, BEST]
    assert marks[1] == [SECOND, SECOND, SECOND, SECOND, BEST, BEST, SECOND]
    assert marks[2] == [None, None, None, None, BEST, None, None]
    # Below ours, the paper's: ranked among themselves, named as another simulator's.
    opus = rows.index("Claude Opus 5")
    assert table.rows[opus][1][:2] == ("–", "3.20 ± 2.04")
    assert table.marks[opus, 1] == BEST
    assert "Unreal Engine" in table.sections[rows.index("Qwen3-VL-4B")]
    assert any("ranked among themselves" in note for note in table.notes)
    # One line more each has the intervals, but for the paper's.
    assert [rows[row + 1] for row in order] == ["", "", ""]
    assert table.rows[order[2] + 1][1][:2] == ("", "0.00–0.00")
    assert made("results", runs, intervals=False).rows[1][0] == "package:Beta"
    assert max(map(len, as_text(table, 120).splitlines())) <= 120
    # As CSV.
    found = list(csv.DictReader(io.StringIO(tables.as_csv(request))))
    keys = ("agent", "radius_m", "setting", "scope", "name")
    by_key = {tuple(row[key] for key in keys): row for row in found if row["modality"] == "all"}
    opus = by_key["Claude Opus 5", "3.0", "base", "overall", "overall"]
    assert (opus["run"], opus["osr"], opus["dts_m_sd"]) == ("paper", "0.0784", "5.97")
    assert sum(row["run"] == "paper" for row in found) == 22
    assert by_key["package:Alpha", "3.0", "all", "partition", "OOD"]["sr"] == "0.25"


def test_tables_of_parts(runs, log):
    # Episodes outside the malls: Natural ¼, Infrastructure ½, Disaster 0.
    overall = made("overall", runs)
    assert "without the two malls (33 % of the episodes)" in overall.sections.values()
    outside = [row for name, row in overall.rows if name == "package:Alpha"][-1]
    assert (outside[:2], outside[2].split(" ± ")[0]) == (("12", "none"), "25.00")
    assert cells(made("family", runs), "package:Alpha")[::5] == ("12.50", "25.00", "50.00", "0.00")
    assert cells(made("scene", runs), "U_Mall_0")[0] == "25.00"
    setting, modality = (made(name, runs) for name in ("setting", "modality"))
    assert [head for head, _ in setting.groups] == ["Base", "Standard", "Long-Horizon"]
    assert cells(setting, "package:Alpha")[::5] == ("21.88", "–", "–")
    # ID scenes: ¼, ½, 0, 0; OOD scenes: 0, 0, 1, 0.
    partition = cells(made("partition", runs), "package:Alpha")
    assert (partition[0], partition[5], partition[10]) == ("18.75", "25.00", "+6.25")
    # OSR ¼, 1, 1, 1 and ½, 0, 1, 0.
    assert (partition[1], partition[6], partition[11]) == ("81.25", "37.50", "−43.75")
    # Of scenes that the agent was trained on, Coast_1 and Harbor_1 say 0 and 1: they are no longer OOD.
    options = '{"trained_on": ["N_Coast_1", "I_Harbor_1", "U_Mall_0"]}'
    trained = replace(runs[0], table=mark_adapted(runs[0].table, options))
    assert cells(made("partition", [trained]), "package:Alpha")[::5] == ("18.75", "0.00", "50.00", "−18.75")
    # Semantic goals: Mall_0 1 of 2, Coast_0 1, Harbor_1 1; image goals: Harbor_1 1.
    goal = cells(made("goal", runs), "package:Alpha")
    assert (goal[0], goal[5], goal[10]) == ("31.25", "12.50", "−18.75")
    assert cells(modality, "package:Alpha") == goal[:10]
    # 4 of 18 tasks, 10 of 18 visits.
    average = cells(made("averages", runs), "package:Alpha")
    assert (average[0], average[5], average[1], average[6]) == ("21.88", "22.22", "59.38", "55.56")
    types = made("type", runs)
    assert [label for label, _ in types.rows] == ["Mall", "Coast", "Harbor", "Flood"]
    assert list(types.sections.values()) == ["Urban", "Natural", "Infrastructure", "Disaster"]
    assert [row[0] for _, row in types.rows] == ["12.50", "25.00", "50.00", "0.00"]
    # L / d_E is 10 / 8 in ID scenes and 10 / 9 in the others.
    detour = made("difficulty", runs, log)
    assert [head for head, _ in detour.groups] == ["1.1 to 1.25", "1.25 to 1.5"]
    assert cells(detour, "package:Alpha")[::3] == ("25.00", "18.75")
    # A log or a release that has the column has the table.
    column = [[k % 2 == 0 for k in range(18)]]
    loaded = load_runs(log, ["alpha", "beta"])
    shown = [replace(run, table=run.table.append_column("target_seen_in_train", column)) for run in loaded]
    seen = made("seen", shown, log)
    assert [head for head, _ in seen.groups] == ["seen in training", "unseen"]
    # Every second task is one with a semantic goal.
    assert cells(seen, "package:Alpha")[0] == "31.25"


def test_radii_gains_reversals_and_what_lies_between_poses(runs):
    table = made("radius", runs, radii_m=(5.0, 3.0))
    heads = [f"{group} {name}" for group, names in table.groups for name in names]
    alpha, beta = (dict(zip(heads, cells(table, f"package:{name}"), strict=True)) for name in ("Alpha", "Beta"))
    assert (alpha["SR ↑ 3 m"], alpha["SR ↑ 5 m"], alpha["SR gain, points 3→5 m"]) == ("21.88", "37.50", "+15.62")
    assert beta["SR gain, points 3→5 m"] == "+31.25"
    assert (alpha["OSR − SR, points 3 m"], alpha["OSR − SR, points 5 m"]) == ("+37.50", "+43.75")
    # One flight more of Coast_1 passes at 2.8 m: Natural ¾ instead of ½.
    assert (alpha["OSR, at poses ↑ 3 m"], alpha["OSR, along the way ↑ 3 m"]) == ("59.38", "65.62")
    assert alpha["OSR, at poses ↑ 5 m"] == alpha["OSR, along the way ↑ 5 m"] == "81.25"
    assert "Base, from 3 to 5 m: package:Beta overtakes package:Alpha." in table.notes
    four = made("radius", runs, radii_m=(1.0, 3.0, 5.0, 10.0))
    at_10 = dict(zip([name for _, names in four.groups for name in names][:4], cells(four, "stop"), strict=False))
    assert at_10 == {"1 m": "0.00", "3 m": "0.00", "5 m": "0.00", "10 m": "100.00"}
    lost = cells(made("visits", runs), "package:Alpha")
    # T; C of Mall_1 and twice of Flood_0; R; N.
    assert lost == ("18", "10", "4", "6", "16.7", "50.0", "16.7", "16.7")
    assert cells(made("visits", runs), "stop") == ("18", "0", "0", "0", "–", "–", "–", "–")
    assert runs[0].path_clearance_to_goal_m is not None
    assert min(runs[0].path_clearance_to_goal_m[runs[0].episodes["scene"] == "N_Coast_1"]) == pytest.approx(2.8)


def test_a_log_without_steps_has_no_distances_along_the_way(log, tmp_path):
    write(tmp_path, "alpha", "package:Alpha", LOG["alpha"])
    (tmp_path / store.shard_name("steps", "U_Mall_1", run="alpha")).unlink()
    (run,) = load_runs(tmp_path)
    assert run.path_clearance_to_goal_m is None
    assert not any("along the way" in group for group, _ in made("radius", [run]).groups)


def test_a_paired_comparison_is_of_common_tasks_and_exact(log, runs):
    table = paired.paired_tables(runs[:2], [AT_3])[0]
    row = cells(table, "SR ↑")
    # Scene by scene beta solves ¼ less, ½ more and 1 less: of the eight signs of these, six make as much as 0.75.
    assert (*row[:3], row[4]) == ("21.88", "12.50", "−9.38", "0.750")
    # alpha alone solves three, beta alone one: 2 · (1 + 4) / 16.
    assert "alone: 3; by package:Beta alone: 1 (McNemar's exact p 0.625" in table.notes[1]
    assert table.notes[0].startswith("18 tasks of 8 scenes")
    # In the other order the same with the sign turned round.
    back = cells(paired.paired_tables(runs[1::-1], [AT_3])[0], "SR ↑")
    assert (back[2], back[4]) == ("+9.38", "0.750")
    whole = load_runs(log, ["base", "alpha"])
    assert paired.paired_tables(whole, [AT_3])[0].notes[0].startswith("18 tasks")
    with pytest.raises(UsageError, match="two runs, not 3"):
        paired.paired_tables(runs, [AT_3])
    apart = [
        runs[0].where(runs[0].episodes["scene"] == "U_Mall_0"),
        runs[1].where(runs[1].episodes["scene"] == "U_Mall_1"),
    ]
    with pytest.raises(UsageError, match="alpha and beta have no task in common"):
        paired.paired_tables(apart, [AT_3])


def test_intervals_are_the_exact_ones(runs):
    scored = summarize(runs[0].episodes, AT_3).scene_scores()
    found = bootstrap(scored)
    families = [part[:, 0].tolist() for part in scored]
    assert families == [[0.25, 0.0], [0.5, 0.0], [0.0, 1.0], [0.0, 0.0]]
    # Every draw of two scenes a family, all alike likely.
    draws = product(*(list(product(scenes, repeat=2)) for scenes in families))
    means = sorted(sum(sum(draw) / 2 for draw in drawn) / 4 for drawn in draws)
    low, high = found[:, 0]
    assert np.mean(np.array(means) < low - 1e-9) <= 0.03 <= 0.2
    assert low == pytest.approx(np.quantile(means, 0.025), abs=0.016)
    assert high == pytest.approx(np.quantile(means, 0.975), abs=0.016)
    np.testing.assert_equal(found, bootstrap(scored))
    # The log does not say SR-view: that has no interval, and the others have theirs.
    assert np.isnan(found).tolist() == [[False, True, False, False, False, False]] * 2
    # How far scenes differ is not known of a family with one of them.
    one = runs[0].episodes[runs[0].episodes["scene"] != "U_Mall_1"]
    assert np.isnan(bootstrap(summarize(one, AT_3).scene_scores())).all()


def test_tables_are_chosen_by_name(log, runs):
    wanted = ReportRequest(open_root(log), runs, [AT_3, AT_5])
    titles = [table.title for table in registry.report_tables(wanted, ["visits", "overall", "visits"])]
    assert titles == ["Overall", "Where visits are lost, 3 m"]
    assert len(registry.report_tables(wanted, ["all"])) == 14
    with pytest.raises(UsageError, match="no table 'visit': did you mean 'visits'"):
        registry.report_tables(wanted, ["visit"])
