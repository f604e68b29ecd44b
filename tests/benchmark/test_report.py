"""Tables, figures and the page of an evaluation."""

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
from aerialdojo_gen.benchmark import figures, registry, tables
from aerialdojo_gen.benchmark.metrics import PROFILES, summarize
from aerialdojo_gen.benchmark.report import html, write_report
from aerialdojo_gen.benchmark.runs import Run, load_runs
from aerialdojo_gen.cli import app as cli
from aerialdojo_gen.dataset.protocol import Sample

pytestmark = pytest.mark.slow

AT_3, AT_5 = PROFILES["aerialdojo"], PROFILES["aerialdojo-5m"]
NASTY = "</script><script>alert(1)</script> & <b>$x_1$ | ä"
AGENTS = ("oracle", "random", "explorer")
# Two scenes of every family; one, whose scores have no interval, which take long.
FEW = ("U_Mall_0", "U_Park_1", "N_Coast_1", "N_Desert_0", "I_Harbor_0", "I_Bridge_1", "D_Flood_0", "D_Flood_1")
ONE_EACH = FEW[::2]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Runs of a few scenes, written."""
    data = tmp_path_factory.mktemp("runs")
    for agent in AGENTS:
        write_run(data, agent, agent, ONE_EACH)
    return data


@pytest.fixture(scope="module")
def few_runs():
    return [made_run(agent, scenes=FEW) for agent in AGENTS]


def wanted(runs, *profiles):
    return tables.ReportRequest(Path("no-release"), runs, list(profiles))


def table(name, runs, *profiles):
    (made,) = registry.report_tables(wanted(runs, *profiles), [name])
    return made


def test_conduct_counts_ends_and_does_not_add_what_is_not_known():
    for run in map(made_run, AGENTS):
        cells = tables.outcome_cells(run, AT_3)
        assert sum(map(float, cells[:3])) == pytest.approx(100.0, abs=0.15)
        assert float(cells[1]) == pytest.approx(100.0 * run.episodes["collision"].mean(), abs=0.05)
        asks = ("10,080", "13,104,000", "478,800", "52.92")
        assert cells[6:] == (asks if run.agent == "explorer" else ("–",) * 4)


def test_tables_and_figures_of_part_of_the_scenes_say_so():
    run = made_run("oracle", 2, ["U_Mall_0"])
    main, family = table("overall", [run], AT_3), table("family", [run], AT_3)
    lacking = "oracle: no episodes of Natural, Infrastructure, Disaster; overall is the mean of the others."
    assert main.notes[1] == lacking
    assert "±" not in main.rows[0][1][1]
    assert dict(family.rows)["oracle"][5:] == ("–",) * 15
    # Gaps, no zeros.
    two = made_run("oracle", 2, ["U_Mall_0", "D_Flood_0"])
    values = figures.metric_radars([two], AT_3).axes[0].lines[0].get_ydata()
    assert [math.isnan(v) for v in values] == [False, True, True, False, False]


def test_runs_are_told_apart_and_what_a_comparison_lacks_is_said(tmp_path):
    for name, agent, scene, episodes, failed in (
        ("a", "oracle", "U_Mall_0", 2, 0), ("b", "random", "U_Mall_0", 3, 4), ("c", "random", "U_Mall_0", 0, 2),
        ("d", "random", "N_Coast_1", 1, 0),
    ):  # fmt: skip
        write_run(tmp_path, name, agent, [scene], episodes, failed)
    found = load_runs(tmp_path)
    assert [(run.label, run.failed) for run in found] == [("oracle", 0), ("random (b)", 4), ("random (d)", 0)]
    notes = table("overall", found, AT_3).notes
    assert "random (b): 4 more episodes failed for reasons outside the agent." in notes
    assert notes[-1] == "The runs flew different tasks: their scores are no comparison of agents."
    assert not any("different" in note for note in table("overall", found[:1], AT_3).notes)
    assert [run.name for run in load_runs(tmp_path, ["b", "a", "b"])] == ["b", "a"]
    for folder, names, said in (
        (tmp_path, ["a", "c"], r"run 'c' has no .*, and 2 that failed: .* --run c --rerun-failed"),
        (tmp_path, ["e"], "there is no run 'e': there are a, b, c, d"),
        (tmp_path / "nothing", [], "no runs in .*: run aerialdojo-gen evaluate"),
    ):
        with pytest.raises(StoreError, match=said):
            load_runs(folder, names)


def test_the_best_and_the_second_are_marked_in_every_format():
    rows = (("a", ("3.20 ± 1.00", "7")), ("", ("2.00–4.00", "")), ("b", ("2.00 ± 1.00", "7")), ("c", ("1.00", "7")))
    table = TextTable("agent", [Column("SR"), Column("n")], rows, "T_1", ["N & M"], sections={0: "open", 3: "closed"},
                      marks={(0, 0): BEST, (2, 0): SECOND})  # fmt: skip
    assert table_formats.as_text(table).splitlines()[1:-1] == [
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
    assert r"\caption{T\_1. N \& M Bold: best; underlined: second.}" in latex
    nasty = dataclasses.replace(
        table, columns=[Column("n"), Column("a ↑", "50 %")], rows=[(NASTY, ("1", "–"))], marks={}
    )
    assert table_formats.as_markdown(nasty).splitlines()[2] == "| agent | n | 50 %: a ↑ |"
    escaped = table_formats.as_markdown(nasty) + table_formats.as_latex(nasty)
    assert all(part in escaped for part in (r"\<script\>", r"\| ä", r"\cmidrule(lr){3-3}", r"\$x\_1\$", r"1 & -- \\"))


def test_latex_parses_and_markdown_has_every_column(few_runs):
    labelled = [dataclasses.replace(run, label=f"{NASTY} 50% #{k} ~^[{{}}]") for k, run in enumerate(few_runs)]
    made = dataclasses.replace(
        wanted(labelled, AT_3, AT_5), radii_m=(1, 3, 5, 10), paper_results=results(), intervals=False
    )
    tables = registry.report_tables(made, ["all"])
    for table in tables:
        bars = {line.replace(r"\|", "").count("|") for line in table_formats.as_markdown(table).splitlines()}
        assert bars - {0} == {len(table.columns) + 2}
    text = "\n\n".join(map(table_formats.as_latex, tables))
    # What TeX would stumble over: signs that it has no glyph for, braces, environments, columns.
    assert {c for c in text if ord(c) > 126} <= set("ä")
    bare = re.sub(r"\\[\\{}&%$#_]", "", text)
    depth = np.cumsum([(sign == "{") - (sign == "}") for sign in bare])
    assert (depth.min(), depth[-1]) == (0, 0)
    assert not {"%", "#"} & set(bare)
    assert bare.count("$") % 2 == 0
    order = [("begin", "table"), ("begin", "tabular"), ("end", "tabular"), ("end", "table")]
    assert re.findall(r"\\(begin|end)\{(\w+)\}", text) == order * len(tables)
    for columns, block in re.findall(r"\\begin\{tabular\}\{(\w+)\}(.*?)\\end\{tabular\}", text, re.DOTALL):
        for row in re.findall(r"^(.*) \\\\$", block, re.MULTILINE):
            spanned = sum(int(n) - 1 for n in re.findall(r"\\multicolumn\{(\d+)\}", row))
            assert len(re.findall(r"(?<!\\)&", row)) + spanned == len(columns) - 1, row


def test_a_radar_of_agents_that_hardly_solve_anything_is_no_dot():
    runs = [made_run("weak", 20), made_run("oracle", 1)]
    weak = summarize(runs[0].episodes, AT_3)
    assert 0.0 < weak.overall.sr < 0.01
    by_metric = figures.metric_radars(runs, AT_3).axes
    for axes in (by_metric, figures.family_radars(runs, AT_3).axes):
        assert [line.get_label() for line in axes[0].lines] == ["weak"]
        reached = np.concatenate([line.get_ydata() for ax in axes for line in ax.lines])
        # The best family's value lies in the outer half of some axis, and none beyond its end.
        assert np.nanmin(reached) >= 0.0
        assert 0.5 < np.nanmax(reached) <= 1.0
    sr = by_metric[0].lines[0].get_ydata()[:4]
    ends = figures.axis_end(100.0 * max(s.sr for s in weak.families.values()))
    assert list(sr) == pytest.approx([100.0 * s.sr / ends for s in weak.families.values()])
    # Few metres are better than many: outwards.
    dts = by_metric[3].lines[0].get_ydata()[:4]
    order = [s.dts_m for s in weak.families.values()]
    assert np.argsort(dts).tolist() == np.argsort(order)[::-1].tolist()


def test_the_papers_axes_are_fixed_and_nothing_leaves_them():
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
def test_axes_end_at_round_numbers(largest, end):
    assert figures.axis_end(largest, 100.0) == pytest.approx(end)


def test_the_csv_holds_every_score_unrounded(few_runs):
    rows = list(csv.DictReader(io.StringIO(tables.as_csv(wanted(few_runs[1:2], AT_3, AT_5)))))
    found = {tuple(row[k] for k in ("profile", "setting", "modality", "scope", "name")): row for row in rows}
    assert len(found) == len(rows)
    # Two profiles, all and three settings by all and two modalities: all scopes have a row where flown.
    scopes = {"overall": 1, "task_weighted": 1, "family": 4, "partition": 2, "scene_type": 7, "malls": 2, "scene": 8}
    for scope, parts in scopes.items():
        assert 2 * parts <= sum(row["scope"] == scope for row in rows) <= 2 * 12 * parts
    summary = summarize(few_runs[1].episodes, AT_5)
    row = found["aerialdojo-5m", "all", "all", "overall", "overall"]
    assert (float(row["spl"]), float(row["spl_sd"])) == (summary.overall.spl, summary.deviation.spl)
    row = found["aerialdojo-5m", "all", "all", "scene", "N_Coast_1"]
    assert (float(row["dts_m"]), row["dts_m_sd"]) == (summary.scenes["N_Coast_1"].dts_m, "")
    assert not any("nan" in value for row in rows for value in row.values())


def test_the_folder_of_a_report_is_whole_and_its_figures_are_always_the_same(tmp_path):
    made = wanted([made_run(agent, scenes=ONE_EACH) for agent in AGENTS], AT_3, AT_5)
    written = write_report(tmp_path / "out", made, [])
    assert sorted(written) == sorted((tmp_path / "out").iterdir())
    page = (tmp_path / "out" / "report.html").read_text()
    assert all(f'<th scope="row">{agent}</th>' in page for agent in AGENTS)
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
    curve = figures.radius_curve(made.runs, AT_3)
    for kind in ("svg", "png"):
        again = figures.encode_figure(curve, kind)
        assert (tmp_path / "out" / f"radius.{kind}").read_bytes() == again, "the same bytes each time"


def test_a_page_loads_nothing_and_escapes_everything(few_runs):
    run = few_runs[1]
    nasty = Run(NASTY, NASTY + "\u202e", NASTY + "\u202e", '{"x": "' + NASTY + '"}', run.table)
    made = dataclasses.replace(wanted([nasty], AT_3), sample=Sample({}))
    figures = dict.fromkeys(("families", "radar", "radius"), b"<svg/>")
    page = html(made, [], figures, registry.named_tables(made, ["all"]))
    assert "alert(1)</script>" not in page
    assert page.count("<script") == page.count("</script>") == 1
    assert not re.search(r'(?:src|href)="(?!data:)', page)
    assert "url(" not in page
    assert "default-src 'none'" in page
    assert "the axes of the paper&#39;s Fig. 5" in page, "as of the paper's protocol alone"
    assert "\u202e" not in page.partition("<body")[2].partition("<script")[0], "text that would turn what follows"


def invoke(*arguments):
    done = CliRunner().invoke(cli.app, ["report", *arguments])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.stdout


def test_the_command_prints_what_is_asked_for(log):
    data = ("--data", str(log))
    brief = invoke(*data)
    assert brief.startswith("Overall\n")
    told = " ".join(brief.partition("\nMore with --table: ")[2].split())
    assert told == ", ".join(name for name in (*registry.NAMES, "all") if name not in ("overall", "results")) + "."
    plain = invoke(*data, *(part for name in registry.NAMES if name != "scene" for part in ("--table", name)))
    assert plain.startswith("Overall\n")
    assert plain.index("explorer") < plain.index("oracle") < plain.index("random")
    for part in ("Base (the form of the paper's Table 4)", "ID and OOD scenes, 3 m", "Where visits are lost, 3 m"):
        assert f"\n{part}\n" in plain
    assert max(map(len, plain.splitlines())) <= 120
    assert not {"U_Mall_0", "Claude Opus 5"} & {line.strip().partition("  ")[0] for line in plain.splitlines()}
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


def test_the_command_says_in_one_line_what_is_wrong(log, tmp_path):
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
