"""`stats`: our figures beside the paper's in three forms, and figures that show what the release holds."""

import csv
import io
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import replace

import cv2
import numpy as np
import pandas as pd
import pytest
from support.command_line import called

from aerialdojo_gen.base.paper_figures import inventory, splits
from aerialdojo_gen.dataset.contents import check_release
from aerialdojo_gen.dataset.stats.comparison import as_csv, as_markdown
from aerialdojo_gen.dataset.stats.figures import _round_length
from aerialdojo_gen.dataset.stats.figures.charts import SETTING_COLOURS, _ranking, composition, save
from aerialdojo_gen.dataset.stats.measures import difficulty_tables, goal_tables, read_goals, read_tasks
from aerialdojo_gen.dataset.stats.tables import Made, benchmark_table, in_paper_order, made_of, tables
from aerialdojo_gen.dataset.stats.variety import measure, read_variety, self_bleu, variety_table, words_of
from aerialdojo_gen.pipeline.stages.work.candidate_policy import train_quotas
from aerialdojo_gen.store import schemas


def as_the_paper(name, **changes):
    """A scene that holds just what the paper's has."""
    paper = inventory()[name]
    trains = train_quotas(name, inventory(), splits())
    tasks = {("train", s): n for s, n in trains.items()}
    tasks |= {("test", s): paper.tasks[s] - n for s, n in trains.items()}
    made = {
        "scene": name, "family": schemas.FAMILIES[name[0]], "scene_type": name.split("_")[1],
        "landmarks": paper.landmarks, "objects": paper.objects, "categories": frozenset({"van"}), "tasks": tasks,
        "path_m": paper.path_m, "paper_scene": paper, "anchors": paper.objects,
    }  # fmt: skip
    return Made(**(made | changes))


@pytest.fixture(scope="module")
def papers():
    return in_paper_order([as_the_paper(name) for name in sorted(inventory())])


def test_the_tables_of_42_scenes_fit_a_terminal(papers):
    for table in tables(papers):
        lines = table.terminal()
        # The paper's Table 2 is the widest.
        assert max(map(len, lines)) <= (115 if table.key == "family" else 100)
        assert max(map(len, table.terminal(80))) <= 80
    scenes = tables(papers)[2].terminal()
    assert len(scenes) == 3 + 42 + 1 + 1
    assert [line.split()[0] for line in scenes[3:45]] == list(inventory())
    # Numbers stand flush right below their headings.
    ends = {line.rstrip().rfind(line.split()[-1]) + len(line.split()[-1]) for line in scenes[1:2] + scenes[3:46]}
    assert len(ends) == 1


def test_a_release_of_the_papers_counts_has_its_totals_splits_shares_and_lengths(papers):
    whole, families, _, split, share, length = made = tables(papers)
    for table in made[1:4]:
        assert table.unlike == 0
        assert table.terminal()[-1] == f"All {table.compared} counts are the paper's."
    assert [table.compared for table in made] == [0, 5 * 9, 43 * 6, 5 * 4, 0, 0]
    total = {row.name: row.ours[0] for row in whole.rows}
    counts = {"scenes": 42, "scene types": 21, "landmarks": 109, "objects": 2099, "instances": 205_732,
              "navigation tasks": 102_866}  # fmt: skip
    assert {name: total[name] for name in counts} == counts
    assert total["routes in all, km"] == pytest.approx(4_115.313, abs=0.5)
    assert sum(total[f"instances, {s}"] for s in ("base", "standard", "long-horizon")) == 205_732
    by_split = {row.name: row.ours[-1] for row in split.rows}
    splits = {"ID train": 113_642, "ID test": 28_452, "OOD train": 12_712, "OOD test": 50_926, "all": 205_732}
    assert by_split == splits
    shares = {row.name: (row.ours[0], row.theirs[0]) for row in share.rows}
    assert len(shares) == 12
    # The paper prints two digits; a release of its counts has its shares to half of the last one.
    for name, (ours, paper) in shares.items():
        assert ours == pytest.approx(paper, abs=0.0051), name
    assert shares["malls"][1] == 28.82
    lengths = {row.name: row.ours[0] for row in length.rows}
    # Table 2: 2,607.253 km of 125,064 instances, two a route.
    assert lengths["Urban"] == pytest.approx(2_607_253 / 62_532)
    assert list(lengths) == ["Urban", "Natural", "Infrastructure", "Disaster", "all"]
    urban = {column.name: ours for column, ours in zip(families.columns, families.rows[0].ours, strict=True)}
    assert (urban["types"], urban["scenes"], urban["anchors"]) == (9, 18, 1030)
    some = tables([m for m in papers if m.scene != "U_Mall_0"])[1]
    assert (some.rows[0].theirs[0], some.rows[1].theirs[0]) == (None, 6)


def test_what_is_not_the_papers_is_shown_with_the_papers_below(papers):
    wrong = as_the_paper("U_Park_0")
    wrong = as_the_paper("U_Park_0", objects=13, tasks=wrong.tasks | {("test", "base"): 0})
    table = tables(in_paper_order([wrong]))[2]
    lines = table.terminal()
    assert lines[3].split()[:3] == ["U_Park_0", "2", "13"]
    assert lines[4].split() == ["in", "the", "paper", "14", "346", "442"]
    assert lines[4].rfind("442") == lines[3].rfind(f"{wrong.instances}")
    assert lines[-1] == "6 of 12 counts are not the paper's."
    assert "| 13 (paper: 14) |" in as_markdown([table])


def test_the_release_stands_below_the_benchmarks_of_table_1(papers):
    table = benchmark_table(papers)
    assert [row[0] for row in table.rows] == [
        "AerialVLN", "CityNav", "OpenUAV", "OpenFly", "UAV-ON", "CityAVOS", "AerialDojo-200K", "this release"
    ]  # fmt: skip
    ours = ("this release", "", "OGS", "4", "instance", "semantic or image", "205,732", "U N I D", "42")
    assert table.rows[-1] == ours
    lines = table.terminal()
    assert max(map(len, lines)) <= 100
    assert table.markdown()[4] == "| AerialVLN | 2023 | VLN | 4 | location | movement instruction | 25.3K | U | 25 |"
    assert len(table.records()) == 8 * 8


def test_csv_has_every_figure_once_and_to_the_last_digit_and_markdown_is_regular(papers):
    made = tables(papers)
    records = list(csv.DictReader(io.StringIO(as_csv(made))))
    assert len(records) == sum(len(t.rows) * len(t.columns) for t in made)
    keys = {(r["table"], r["row"], r["column"]) for r in records}
    assert len(keys) == len(records)
    ours = {(r["table"].split()[0], r["row"], r["column"]): r["ours"] for r in records}
    for name, paper in inventory().items():
        assert int(ours["Scenes", name, "instances"]) == 2 * sum(paper.tasks.values())
        assert float(ours["Scenes", name, "km"]) == paper.path_m / 1000
    for block in as_markdown(made).split("### ")[1:]:
        assert len({line.count("|") for line in block.splitlines() if line.startswith("|")}) == 1


def test_a_release_of_other_scenes_or_numbers_is_not_held_to_the_papers(smoke, papers):
    made = [made_of(smoke, name) for name in check_release(smoke)]
    for scenes in (made, [replace(m, paper_scene=None) for m in papers]):
        for table in tables(scenes):
            assert table.compared == 0
            assert not any("paper" in line for line in [*table.terminal(), *table.markdown()])
    assert [row.name for row in tables(made)[1].rows] == ["Urban", "all"]
    total = {row.name: row.ours[0] for row in tables(made)[0].rows}
    assert total["instances"] == sum(m.instances for m in made) > 0


@pytest.fixture(scope="module")
def frame(smoke):
    """Routes beside their tasks, by pandas alone."""
    routes, tasks = (pd.concat(pd.read_parquet(p) for p in sorted((smoke / "release" / t).glob("*/*.parquet")))
                     for t in ("routes", "tasks"))  # fmt: skip
    return routes.merge(tasks[tasks["modality"] == "image"], on=["nav_id", "scene", "setting"])


@pytest.fixture(scope="module")
def measured(smoke):
    """Tasks, and the tables of goals and of difficulty, rows by name."""
    names = check_release(smoke)
    tasks = read_tasks(smoke, names)
    shown = (goal_tables(read_goals(smoke, names), tasks), difficulty_tables(tasks))
    return tasks, *([{row.name: row.ours for row in table.rows} for table in made] for made in shown)


def test_difficulty_is_what_pandas_makes_of_the_tables(measured, frame):
    by_setting, by_scene, *_ = measured[2]
    for scene in by_scene:
        own = frame if scene == "all" else frame[frame["scene"] == scene]
        assert by_scene[scene] == pytest.approx((
            len(own), own["plan_detour"].median(), own["plan_detour"].quantile(0.9),
            100 * (own["plan_detour"] < 1.05).mean(), 100 * own["straight_line_free"].mean(),
            100 * (own["target_visible_at_start"] > 0).mean(), own["climb_m"].median(),
        ))  # fmt: skip
    assert by_scene.keys() == {"all", *frame["scene"]}
    assert by_setting["base"][0] == (frame["setting"] == "base").sum()


def test_splits_are_what_pandas_makes_of_the_tables(measured, frame):
    test = frame[frame["subset"] == "test"]
    new = [~test[f"{what}_seen_in_train"] for what in ("target", "start", "pair")]
    seen, held = measured[2][2:]
    assert seen["all"] == pytest.approx((
        len(test), new[0].sum(), 100 * new[0].mean(), new[1].sum(), 100 * new[1].mean(), (new[0] & new[1]).sum(),
        new[2].sum(), 100 * new[2].mean(),
    ))  # fmt: skip
    for partition in ("ID", "OOD"):
        for side in ("train", "test"):
            own = frame[(frame["partition"] == partition) & (frame["target_split"] == side)]
            assert held[f"{partition} {side}"][0] == len(own) > 0
            assert held[f"{partition} {side}"][4:6] == (own["target_held_out"].sum(), own["start_held_out"].sum())
            assert side == "test" or not own["target_held_out"].any()


def test_what_goals_show_is_what_pandas_makes_of_the_tables(smoke, measured):
    anchors, objects = (pd.concat(pd.read_parquet(p) for p in sorted((smoke / "release" / t).glob("*.parquet")))
                        for t in ("anchors", "objects"))  # fmt: skip
    goals = anchors[anchors["selected"]]
    fronts, told = goals["off_front_rad"].dropna(), objects["tells_shown"].dropna()
    *families, total = measured[1][0].values()
    assert total == pytest.approx((
        len(objects), len(fronts), 100 * (fronts <= np.radians(60.0)).mean(), 100 * (told == 1.0).mean(),
        100 * goals["part_unoccluded"].mean(), 100 * goals["part_framed"].mean(), objects["step_back_m"].median(),
    ))  # fmt: skip
    assert sum(ours[0] for ours in families) == len(objects)


def test_how_routes_fly_is_what_a_loop_over_their_actions_makes(measured, frame):
    turns = ahead = sideways = 0
    for actions in frame["action"]:
        names = [schemas.ACTION_NAMES[a] for a in actions]
        metres = [0 if n.startswith(("Turn", "Stop")) else 1.0 if n == "Approach" else float(n[-1]) for n in names]
        flown = [0.0 if name == "Approach" else m for name, m in zip(names, metres, strict=True)]
        for k, name in enumerate(names):
            turns += name.startswith("Turn")
            if sum(flown[k + 1 :]) >= 3.0:
                ahead += metres[k] * name.startswith("MoveForward")
                sideways += metres[k] * name.startswith(("MoveLeft", "MoveRight"))
    n_actions = frame["action"].map(len)
    assert [*measured[1][1].values()][-1] == pytest.approx((
        len(frame), frame["min_clearance_m"].median(), frame["min_clearance_m"].quantile(0.1), n_actions.median(),
        100 * turns / n_actions.sum(), 100 * sideways / (ahead + sideways),
    ))  # fmt: skip


def test_tables_of_goals_and_difficulty_fit_a_terminal_where_a_release_tells_of_it(smoke, measured):
    tasks = measured[0]
    many = pd.concat([tasks] * 3, ignore_index=True)
    many = many.assign(scene=np.resize([*inventory()], len(many)))
    hard = difficulty_tables(many)
    for table in (*hard, *goal_tables(read_goals(smoke, check_release(smoke)), tasks)):
        assert max(map(len, table.terminal())) <= 100
        assert max(map(len, table.terminal(80))) <= 80
    assert len(hard[1].terminal(80)) == 3 + 42 + 1
    assert difficulty_tables(tasks.assign(plan_detour=np.nan)) == []
    assert len(difficulty_tables(tasks.assign(target_split=""))) == 2


@pytest.fixture(scope="module")
def drawn(smoke, tmp_path_factory):
    """The figures of the small release, by way of the command, and what it printed."""
    out = tmp_path_factory.mktemp("figures")
    files = ["--figures", out / "drawn", "--markdown", out / "stats.md", "--csv", out / "stats.csv"]
    done = called("stats", "--data", smoke, *files)
    assert done.returncode == 0, done.stderr
    return out, done.stdout


FIGURES = ("composition", "shares", "lengths", "detours", "difficulty", "categories", "names", "maps")


def test_the_command_writes_what_it_prints(smoke, drawn):
    out, printed = drawn
    scenes = in_paper_order([made_of(smoke, name) for name in check_release(smoke)])
    names = [m.scene for m in scenes]
    tasks = read_tasks(smoke, names)
    measured = [*goal_tables(read_goals(smoke, names), tasks), *difficulty_tables(tasks)]
    made = [*tables(scenes), *measured, benchmark_table(scenes)]
    assert (out / "stats.md").read_text() == as_markdown(made)
    assert (out / "stats.csv").read_text() == as_csv(made)
    assert "\n\n".join("\n".join(table.terminal(80)) for table in made) in printed
    paths = [str(out / "drawn" / f"{name}{suffix}") for name in FIGURES for suffix in (".png", ".svg")]
    assert printed.splitlines()[-len(paths) :] == paths
    assert sorted(str(p) for p in (out / "drawn").iterdir()) == sorted(paths)


def test_figures_are_pictures_without_a_date_and_the_same_again(smoke, drawn, tmp_path):
    for path in (drawn[0] / "drawn").iterdir():
        if path.suffix == ".png":
            picture = cv2.imread(str(path))
            # Something is drawn, and nothing runs over the edge.
            assert 0.02 < (picture != 255).any(axis=2).mean() < 0.95
            edge = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
            assert (edge == 255).all(), path.name
        else:
            root = ET.fromstring(path.read_text())
            assert root.tag.endswith("svg")
            assert "<dc:date>" not in path.read_text()
            assert not [e for e in root.iter() if e.tag.endswith("}text")], "letters are outlines"
    for path in save(composition(read_tasks(smoke, check_release(smoke))), tmp_path, "composition"):
        assert path.read_bytes() == (drawn[0] / "drawn" / path.name).read_bytes()


def test_bars_are_as_long_as_the_counts_and_words_ranked_from_the_top_down(smoke):
    names = check_release(smoke)
    axes = composition(read_tasks(smoke, names)).axes[0]
    instances = sum(made_of(smoke, name).instances for name in names)
    assert sum(bar.get_width() for bar in axes.patches) == instances
    assert {t.get_text() for t in axes.texts} == {f"{instances:,}"}
    assert len(SETTING_COLOURS) == len(set(SETTING_COLOURS.values())) == len(axes.containers)
    counts = {f"w{k}": Counter({"Urban": k, "Natural": 2}) for k in range(1, 72)}
    figure = _ranking(counts, "tasks", "names")
    drawn = [(label.get_text(), bar.get_width()) for axes in figure.axes
             for label, bar in zip(axes.get_yticklabels(), axes.patches, strict=True)]  # fmt: skip
    assert drawn == [(f"w{k}", k + 2) for k in range(71, 11, -1)]
    assert figure.get_suptitle() == "60 of 71 names"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["Urban"]


@pytest.mark.parametrize(("most", "length"), [(47.0, 20.0), (50.0, 50.0), (9.9, 5.0), (0.3, 0.2), (199, 100)])
def test_scale_bars_are_round(most, length):
    assert _round_length(most) == pytest.approx(length)


TEXTS = ("A red van stands by the hut.", "A red van stands by the gate.", "Look for the blue tent. It has a door.")


def test_counts():
    found = measure(TEXTS, [1, 2, 3], ["x", "x", "y"])
    assert (found["texts"], found["words"], found["vocabulary"]) == ("3", "23", "15")
    assert found["fewest, median, most words"] == "7, 7, 9"
    assert (found["frames"], found["most common frame"]) == ("2", "66.67%")
    assert found["first four words shared"] == "66.7%"
    # Two texts of one object may begin alike.
    assert measure(TEXTS, [1, 1, 3], "xyz")["first four words shared"] == "0.0%"
    share = (4 + 1 + 6) / (4 + 4 + 6)
    assert found["distinct 1-, 2-, 3- and 4-grams"].endswith(f", {share:.3f}")


def test_self_bleu_is_one_of_copies_and_little_of_strangers():
    copies, strangers = [words_of(TEXTS[0])] * 3, [words_of(text) for text in ("a b c d e", "f g h i j")]
    assert self_bleu(copies, [1, 2, 3]) == pytest.approx(1.0)
    assert self_bleu(strangers, [1, 2]) < 0.2


@pytest.mark.pipeline
def test_a_release_is_measured_by_level(smoke):
    found = read_variety(smoke, ["U_Courtyard_0", "U_Courtyard_1"])
    assert set(found) == {"all", "one an object", "terse", "normal", "detailed", "vague"}
    assert int(found["all"]["texts"]) > int(found["one an object"]["texts"]) > 0
    assert "self-BLEU-4" in "\n".join(variety_table(found).markdown())
