"""Tables, figures and the page of an evaluation."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import cv2
import numpy as np
import pytest
from support.command_line import called
from support.run_logs import made_run, write_run
from typer.testing import CliRunner

from aerialdojo_gen.base import table_formats
from aerialdojo_gen.base.errors import AerialDojoError, StoreError
from aerialdojo_gen.base.paper_figures import results
from aerialdojo_gen.base.text_table import BEST, SECOND, Column, TextTable
from aerialdojo_gen.benchmark import figures, registry, score_rows, tables
from aerialdojo_gen.benchmark.metrics import PROFILES, Profile, summarize
from aerialdojo_gen.benchmark.report import html, write_report
from aerialdojo_gen.benchmark.runs import Run, load_runs
from aerialdojo_gen.benchmark.tables import outcome_cells
from aerialdojo_gen.cli import app as cli

pytestmark = pytest.mark.slow

AT_3, AT_5 = PROFILES["aerialdojo"], PROFILES["aerialdojo-5m"]
NASTY = "</script><script>alert(1)</script> & <b>$x_1$ | ä"
TURNED = "\u202e"


AGENTS = ("oracle", "random", "explorer")
# Two scenes of every family, one a mall.
FEW = ("U_Mall_0", "U_Park_1", "N_Coast_1", "N_Desert_0", "I_Harbor_0", "I_Bridge_1", "D_Flood_0", "D_Flood_1")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of a few scenes, written."""
    data = tmp_path_factory.mktemp("runs")
    for agent in AGENTS:
        write_run(data, agent, agent, FEW)
    return data


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    """Runs of all scenes."""
    return [made_run(agent) for agent in AGENTS]


@pytest.fixture(scope="module")
def few_runs() -> list[Run]:
    return [made_run(agent, scenes=FEW) for agent in AGENTS]


@pytest.fixture(scope="module")
def made_tables(runs: list[Run]) -> list[TextTable]:
    return all_tables(runs, AT_3, AT_5)


def test_runs_are_found_named_and_told_apart(log: Path, tmp_path: Path) -> None:
    assert [run.label for run in load_runs(log)] == ["explorer", "oracle", "random"]
    write_run(tmp_path, "a", "random", ["U_Mall_0"], 1)
    write_run(tmp_path, "b", "random", ["N_Coast_1"], 1)
    assert [run.label for run in load_runs(tmp_path)] == ["random (a)", "random (b)"]
    assert [run.name for run in load_runs(tmp_path, ["b", "a", "b"])] == ["b", "a"]
    with pytest.raises(StoreError, match=r"there is no run 'c': there are a, b"):
        load_runs(tmp_path, ["c"])
    with pytest.raises(StoreError, match=r"no runs in .*: run aerialdojo-gen evaluate"):
        load_runs(tmp_path / "nothing")


def wanted(runs: list[Run], *profiles: Profile) -> tables.ReportRequest:
    return tables.ReportRequest(Path("no-release"), runs, list(profiles))


def all_tables(runs: list[Run], *profiles: Profile) -> list[TextTable]:
    return registry.report_tables(wanted(runs, *profiles), ["all"])


def table(name: str, runs: list[Run], *profiles: Profile) -> TextTable:
    (made,) = registry.report_tables(wanted(runs, *profiles), [name])
    return made


def test_every_table_says_what_the_metrics_say(runs: list[Run]) -> None:
    main = table("overall", runs, AT_3, AT_5)
    names = ("family", "setting", "modality", "conduct", "scene")
    family, setting, modality, went, scenes = (table(name, runs, AT_3) for name in names)
    explorer = runs[2]
    at_3, at_5 = (summarize(explorer.episodes, p) for p in (AT_3, AT_5))
    cells, elsewhere = (row for label, row in main.rows if label == "explorer")
    assert cells[:2] == ("252", "none")
    assert cells[2] == f"{100 * at_3.overall.sr:.2f} ± {100 * at_3.deviation.sr:.2f}"
    assert cells[5] == f"{at_3.overall.dts_m:.2f} ± {at_3.deviation.dts_m:.2f}"
    assert cells[7] == f"{100 * at_5.overall.sr:.2f} ± {100 * at_5.deviation.sr:.2f}"
    # The release is not there, so that nothing is known of held-out objects.
    assert list(main.sections.values())[-1] == "without the two malls (5 % of the episodes)"
    outside = summarize(explorer.episodes.where(~np.isin(explorer.episodes.scene, ["U_Mall_0", "U_Mall_1"])), AT_3)
    assert elsewhere[:3] == ("240", "none", f"{100 * outside.overall.sr:.2f} ± {100 * outside.deviation.sr:.2f}")
    assert main.groups[2] == ("5 m", ("SR ↑", "OSR ↑", "SPL ↑"))
    assert [group for group, _ in family.groups] == ["Urban", "Natural", "Infrastructure", "Disaster"]
    assert dict(family.rows)["explorer"][5] == f"{100 * at_3.families['Natural'].sr:.2f}"
    assert [group for group, _ in setting.groups] == ["Base", "Standard", "Long-Horizon"]
    image = summarize(explorer.episodes.where(explorer.episodes.modality == "image"), AT_3)
    assert dict(modality.rows)["explorer"][5:] == tuple(
        f"{v:.2f}" for v in (100 * image.overall.sr, 100 * image.overall.osr, 100 * image.overall.spl,
                             image.overall.dts_m, 100 * image.overall.cr)
    )  # fmt: skip
    assert dict(went.rows)["explorer"][6:] == ("10,080", "13,104,000", "478,800", "52.92")
    assert dict(went.rows)["oracle"][6:] == ("–",) * 4
    assert len(scenes.rows) == 42
    assert dict(scenes.rows)["U_Mall_0"][10] == f"{100 * at_3.scenes['U_Mall_0'].sr:.2f}"


def test_tables_and_figures_of_part_of_the_scenes_say_so() -> None:
    run = made_run("oracle", 2, ["U_Mall_0"])
    main, family = table("overall", [run], AT_3), table("family", [run], AT_3)
    assert (
        main.notes[1]
        == "oracle: no episodes of Natural, Infrastructure, Disaster; overall is the mean of the others."
    )
    assert "±" not in main.rows[0][1][1]
    assert dict(family.rows)["oracle"][5:] == ("–",) * 15
    # Gaps, no zeros.
    two = made_run("oracle", 2, ["U_Mall_0", "D_Flood_0"])
    values = figures.metric_radars([two], AT_3).axes[0].lines[0].get_ydata()
    assert [math.isnan(v) for v in values] == [False, True, True, False, False]


def test_what_a_comparison_lacks_is_said_under_the_table(tmp_path: Path) -> None:
    for name, agent, episodes, failed in (("a", "oracle", 2, 0), ("b", "random", 3, 4), ("c", "random", 0, 2)):
        write_run(tmp_path, name, agent, ["U_Mall_0"], episodes, failed)
    found = load_runs(tmp_path)
    assert [(run.name, run.failed) for run in found] == [("a", 0), ("b", 4)]
    notes = table("overall", found, AT_3).notes
    assert "random: 4 more episodes failed for reasons outside the agent." in notes
    assert notes[-1] == "The runs flew different tasks: their scores are no comparison of agents."
    assert not any("different" in note for note in table("overall", found[:1], AT_3).notes)
    with pytest.raises(
        StoreError, match=r"run 'c' has no finished episode, and 2 that failed: .* --run c --rerun-failed"
    ):
        load_runs(tmp_path, ["a", "c"])


def test_conduct_counts_ends_and_does_not_add_what_is_not_known(runs: list[Run]) -> None:
    for run in runs:
        cells = outcome_cells(run, AT_3)
        assert sum(map(float, cells[:3])) == pytest.approx(100.0, abs=0.15)
        assert float(cells[1]) == pytest.approx(100.0 * run.episodes.collision.mean(), abs=0.05)
        assert (cells[-1] == "–") == (run.agent != "explorer")


@pytest.mark.parametrize("width", [80, 120])
def test_a_terminal_of_any_width_has_every_cell_once(made_tables: list[TextTable], width: int) -> None:
    for table in made_tables:
        text = table_formats.as_text(dataclasses.replace(table, marks={}), width)
        assert max(map(len, text.splitlines()[1:])) <= width, table.title
        body = text.replace("\n\n", "\n").splitlines()
        for i, (label, cells) in enumerate(table.rows):
            if not label or [row[0] for row in table.rows].count(label) > 1 or table.sections.get(i) == label:
                continue
            found = [re.split(r" {2,}", line.strip()) for line in body if line.strip().startswith(f"{label}  ")]
            assert [cell for parts in found for cell in parts[1:]] == list(cells), table.title


def test_the_best_and_the_second_are_marked_in_every_format() -> None:
    rows = (("a", ("3.20 ± 1.00", "7")), ("", ("2.00–4.00", "")), ("b", ("2.00 ± 1.00", "7")), ("c", ("1.00", "7")))
    table = TextTable("agent", [Column("SR"), Column("n")], rows, "T", sections={0: "open", 3: "closed"},
                      marks={(0, 0): BEST, (2, 0): SECOND})  # fmt: skip
    assert table_formats.as_text(table).splitlines()[1:] == [
        "agent            SR  n",
        "----------------------",
        "open",
        "  a     3.20¹± 1.00  7",
        "          2.00–4.00",
        "  b     2.00²± 1.00  7",
        "closed",
        "  c            1.00  7",
    ]
    assert table_formats.as_markdown(table).splitlines()[4:7] == [
        "| *open* |  |  |", "| a | **3.20 ± 1.00** | 7 |", "|  | 2.00–4.00 |  |"
    ]  # fmt: skip
    assert "<ins>2.00 ± 1.00</ins>" in table_formats.as_markdown(table)
    latex = table_formats.as_latex(table)
    assert r"a & \textbf{3.20 $\pm$ 1.00} & 7 \\" in latex
    assert r"b & \underline{2.00 $\pm$ 1.00} & 7 \\" in latex
    assert "\\midrule\n\\multicolumn{3}{l}{\\emph{closed}} \\\\\n" in latex


def test_markdown_and_latex_have_every_cell_and_escape_the_rest(made_tables: list[TextTable]) -> None:
    columns = [Column("n"), Column("a ↑", "50 %"), Column("b", "50 %")]
    table = TextTable("agent", columns, [(NASTY, ("1", "2 ± 3", "–"))], "T_1", ["N & M"])
    markdown = table_formats.as_markdown(table).splitlines()
    assert markdown[2] == "| agent | n | 50 %: a ↑ | 50 %: b |"
    assert markdown[3] == "| --- | ---: | ---: | ---: |"
    assert r"\<script\>" in markdown[4]
    assert r"\| ä" in markdown[4]
    latex = table_formats.as_latex(table)
    assert r"\begin{tabular}{lrrr}" in latex
    assert r"\multicolumn{2}{c}{50 \%}" in latex
    assert r"\cmidrule(lr){3-4}" in latex
    assert r"\$x\_1\$" in latex
    assert r"1 & 2 $\pm$ 3 & -- \\" in latex
    assert r"\caption{T\_1. N \& M}" in latex
    for real in made_tables:
        columns = 1 + sum(len(names) for _, names in real.groups)
        assert {line.count("|") for line in table_formats.as_markdown(real).splitlines() if "|" in line} == {
            columns + 1
        }


def test_latex_parses(few_runs: list[Run]) -> None:
    labelled = [dataclasses.replace(run, label=f"{NASTY} 50% #{k} ~^[{{}}]") for k, run in enumerate(few_runs)]
    made = dataclasses.replace(wanted(labelled, AT_3, AT_5), radii_m=(1, 3, 5, 10), paper_results=results())
    text = "\n\n".join(map(table_formats.as_latex, registry.report_tables(made, ["all"])))
    # What TeX would stumble over: signs that it has no glyph for, braces, environments, columns.
    assert {c for c in text if ord(c) > 126} <= set("ä")
    bare = re.sub(r"\\[\\{}&%$#_]", "", text)
    depth = 0
    for sign in bare:
        depth += (sign == "{") - (sign == "}")
        assert depth >= 0
    assert depth == 0
    assert "%" not in bare
    assert "#" not in bare
    assert bare.count("$") % 2 == 0
    assert re.findall(r"\\(begin|end)\{(\w+)\}", text) == [
        ("begin", "table"), ("begin", "tabular"), ("end", "tabular"), ("end", "table")
    ] * text.count(r"\toprule")  # fmt: skip
    for block in re.findall(r"\\begin\{tabular\}.*?\\end\{tabular\}", text, re.DOTALL):
        columns = len(re.match(r"\\begin\{tabular\}\{(\w+)\}", block)[1])  # type: ignore[index]
        for row in re.findall(r"^(.*) \\\\$", block, re.MULTILINE):
            spanned = sum(int(n) - 1 for n in re.findall(r"\\multicolumn\{(\d+)\}", row))
            assert len(re.findall(r"(?<!\\)&", row)) + spanned == columns - 1, row


def test_a_radar_of_agents_that_hardly_solve_anything_is_no_dot() -> None:
    runs = [made_run("weak", 20), made_run("oracle", 1)]
    weak = summarize(runs[0].episodes, AT_3)
    assert 0.0 < weak.overall.sr < 0.01
    by_metric = figures.metric_radars(runs, AT_3).axes
    for axes in (by_metric, figures.family_radars(runs, AT_3).axes):
        assert [line.get_label() for line in axes[0].lines] == ["weak"]
        reached = [max(v for v in line.get_ydata() if not math.isnan(v)) for ax in axes for line in ax.lines]
        # The best family's value lies in the outer half of some axis, and none beyond its end.
        assert max(reached) > 0.5
        assert all(0.0 <= value <= 1.0 for value in reached)
    sr = by_metric[0].lines[0].get_ydata()[:4]
    ends = figures.axis_end(100.0 * max(s.sr for s in weak.families.values()))
    assert list(sr) == pytest.approx([100.0 * s.sr / ends for s in weak.families.values()])
    # Few metres are better than many: outwards.
    dts = by_metric[3].lines[0].get_ydata()[:4]
    order = [s.dts_m for s in weak.families.values()]
    assert np.argsort(dts).tolist() == np.argsort(order)[::-1].tolist()


def test_the_papers_axes_are_fixed_and_nothing_leaves_them() -> None:
    runs = [made_run("explorer", 20)]
    families = summarize(runs[0].episodes, AT_3).families
    assert min(family.osr for family in families.values()) > 0.15
    ends = {"sr": 5.0, "osr": 15.0, "spl": 5.0, "dts_m": 40.0, "cr": 100.0}
    for axes, family in zip(figures.family_radars(runs, AT_3, paper_axes=True).axes, families.values(), strict=True):
        sr, osr, spl, dts, cr = axes.lines[0].get_ydata()[:5]
        assert osr == 1.0
        assert [sr, spl] == pytest.approx([min(1.0, 100 * v / 5.0) for v in (family.sr, family.spl)])
        assert [dts, cr] == pytest.approx([1.0 - family.dts_m / 40.0, 1.0 - family.cr])
        shown = {text.get_text() for text in axes.texts}
        assert {"SR\n5 %", "OSR\n15 %", "SPL\n5 %", "DTS\n0 m", "CR\n0 %"} <= shown
    metrics = figures.metric_radars(runs, AT_3, paper_axes=True).axes
    centres = [next(t.get_text() for t in axes.texts if "centre" in t.get_text()) for axes in metrics[:5]]
    assert centres == [f"{ends[m] if m in ('dts_m', 'cr') else 0:g} at the centre" for m in ends]


@pytest.mark.parametrize(
    ("largest", "end"), [(0.0, 1.0), (0.53, 0.6), (0.6, 0.6), (3.2, 4.0), (7.84, 8.0), (58.96, 60.0), (96.0, 100.0)]
)
def test_axes_end_at_round_numbers(largest: float, end: float) -> None:
    assert figures.axis_end(largest, 100.0) == pytest.approx(end)


def test_the_csv_holds_every_score_unrounded(few_runs: list[Run]) -> None:
    rows = list(csv.DictReader(io.StringIO(score_rows.as_csv(wanted(few_runs[1:], AT_3, AT_5)))))
    keys = ["run", "profile", "setting", "modality", "scope", "name"]
    found = {tuple(row[k] for k in keys): row for row in rows}
    assert len(found) == len(rows)
    # Two runs, two profiles, all and three settings by all and two modalities: all scopes have a row where flown.
    scopes = {"overall": 1, "task_weighted": 1, "family": 4, "partition": 2, "scene_type": 7, "malls": 2, "scene": 8}
    for scope, parts in scopes.items():
        assert 2 * 2 * parts <= sum(row["scope"] == scope for row in rows) <= 2 * 2 * 12 * parts
    summary = summarize(few_runs[1].episodes, AT_5)
    row = found["random", "aerialdojo-5m", "all", "all", "overall", "overall"]
    assert (float(row["spl"]), float(row["spl_sd"])) == (summary.overall.spl, summary.deviation.spl)
    row = found["random", "aerialdojo-5m", "all", "all", "scene", "N_Coast_1"]
    assert (float(row["dts_m"]), row["dts_m_sd"]) == (summary.scenes["N_Coast_1"].dts_m, "")
    assert not any("nan" in value for row in rows for value in row.values())


def test_the_folder_of_a_report_is_whole_and_the_same_bytes_each_time(few_runs: list[Run], tmp_path: Path) -> None:
    written = write_report(tmp_path / "out", wanted(few_runs, AT_3, AT_5), [])
    assert sorted(p.name for p in written) == sorted(p.name for p in (tmp_path / "out").iterdir())
    page = (tmp_path / "out" / "report.html").read_text()
    for run in few_runs:
        assert f'<th scope="row">{run.label}</th>' in page
    for name in ("families", "radar", "radius"):
        svg = (tmp_path / "out" / f"{name}.svg").read_bytes()
        assert b"dc:date" not in svg
        assert ET.fromstring(svg).tag == "{http://www.w3.org/2000/svg}svg"
        picture = cv2.imread(str(tmp_path / "out" / f"{name}.png"))
        assert min(picture.shape[:2]) > 600
        colours = {tuple(c) for c in picture.reshape(-1, 3)[::7].tolist()}
        # Every run's line is there, in its own colour (red, green; blue is the oracle's, of which no radar is drawn).
        oracle = [(178, 114, 0)] if name == "radius" else []
        assert {(0, 94, 213), (115, 158, 0), *oracle} <= colours
    again = write_report(tmp_path / "again", wanted(few_runs, AT_3, AT_5), [])
    assert [p.read_bytes() for p in written] == [p.read_bytes() for p in again]


def test_a_page_loads_nothing_and_escapes_everything(few_runs: list[Run]) -> None:
    run = few_runs[1]
    nasty = Run(NASTY, NASTY + TURNED, NASTY + TURNED, '{"x": "' + NASTY + '"}', run.table, run.episodes)
    made = wanted([nasty], AT_3)
    figures = dict.fromkeys(("families", "radar", "radius"), b"<svg/>")
    page = html(made, [], figures, registry.named_tables(made, ["all"]))
    assert "alert(1)</script>" not in page
    assert page.count("<script") == page.count("</script>") == 1
    assert not re.search(r'(?:src|href)="(?!data:)', page)
    assert "url(" not in page
    assert "default-src 'none'" in page
    assert "\u202e" not in page.partition("<body")[2].partition("<script")[0], "text that would turn what follows"


def invoke(*arguments: str) -> str:
    done = CliRunner().invoke(cli.app, ["report", *arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.stdout


def test_the_command_prints_what_is_asked_for(log: Path) -> None:
    data = ("--data", str(log))
    brief = invoke(*data)
    assert brief.startswith("Overall\n")
    assert "\nBase (the form of the paper's Table 4)\n" in brief
    told = " ".join(brief.partition("\nMore with --table: ")[2].split())
    assert told == ", ".join(name for name in (*registry.NAMES, "all") if name not in ("overall", "results")) + "."
    plain = invoke(*data, *(part for name in registry.NAMES if name != "scene" for part in ("--table", name)))
    assert plain.startswith("Overall\n")
    assert plain.index("explorer") < plain.index("oracle") < plain.index("random")
    assert "U_Mall_0" not in plain
    for part in ("Base (the form of the paper's Table 4)", "ID and OOD scenes, 3 m", "Where visits are lost, 3 m"):
        assert f"\n{part}\n" in plain
    assert max(map(len, plain.splitlines())) <= 120
    assert "Claude Opus 5" not in plain
    besides = invoke(*data, "--beside", "paper", "--group", "open-source=explorer,random")
    assert "Claude Opus 5" in besides
    assert "open-source\n  explorer" in besides
    radii = invoke("random", "explorer", *data, "--radius", "1", "3", "5", "10", "--table", "radius")
    assert re.search(r" {2}1 m +3 m +5 m +10 m", radii)
    assert "1→3 m" in radii
    rows = invoke("random", *data, "--radius", "10", "--format", "csv")
    assert rows.startswith("run,agent,profile")
    assert "10m" in rows
    assert invoke("random", "explorer", *data, "--paired").startswith("explorer against random, 3 m\n")
    rule = invoke("random", *data, "--profile", "uav-on", "--by-scene", "--format", "markdown")
    assert "uav-on, 20 m" in rule
    assert r"U\_Mall\_0" in rule
    assert invoke("random", *data, "--format", "latex").startswith(r"\begin{table}")


def test_the_command_says_in_one_line_what_is_wrong(log: Path, tmp_path: Path) -> None:
    for arguments, message in (
        (["--data", str(tmp_path)], "there is no release in"),
        (["--data", str(tmp_path), "--log", str(tmp_path)], "no runs in"),
        (["nobody", "--data", str(log)], "no run 'nobody'"),
        (["--data", str(log), "--profile", "uav"], "no profile 'uav'"),
        (["--data", str(log), "--group", "open"], "write heading=run,run"),
        (["--data", str(log), "--paired"], "compares two runs, not 3"),
    ):
        with pytest.raises(AerialDojoError, match=message) as failure:
            invoke(*arguments)
        assert "\n" not in str(failure.value)
    write_run(tmp_path, "random", "random", FEW[:1])
    shard = next((tmp_path / "episodes" / "random").glob("*.parquet"))
    shard.write_bytes(shard.read_bytes()[:100])
    done = called("report", "--data", tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "is damaged" in done.stderr
