"""Submissions: written by real runs, replayed, scored, refused where they do not tell the truth, shown on a page."""

import gzip
import hashlib
import json
import math
import os
import shutil

import pytest
from support.browser import errors
from support.command_line import said

from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.benchmark import tables
from aerialdojo_gen.benchmark.agents import AgentBase, InvalidAnswer
from aerialdojo_gen.benchmark.agents.goal import BLIND
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.leaderboard import write_leaderboard
from aerialdojo_gen.benchmark.metrics import METRICS, PROFILES
from aerialdojo_gen.benchmark.registry import NAMES_OF
from aerialdojo_gen.benchmark.runner import Evaluation, evaluate
from aerialdojo_gen.benchmark.runs import load_runs
from aerialdojo_gen.benchmark.scoring import ScoreCard, score, scored_runs
from aerialdojo_gen.benchmark.submission import SubmissionRefused, read_submission, write_submission
from aerialdojo_gen.benchmark.tables import ReportRequest
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.store.schemas import SCENES

CHOSEN = Selection(("test",), limit=24)
OPTIONS = ("--split", "test", "--limit", "24", "--workers", "1", "--quiet")


class Wavering(AgentBase):
    """Flies about, answers now and then what is no action, and never stops by itself."""

    sensors = BLIND

    def reset(self, goal):
        self._semantic = goal.modality == "semantic"

    def act(self, observation):
        if observation.step % 7 == 3:
            raise InvalidAnswer("hm")
        if observation.step == 40:
            return 0
        return (1, 14, 10, 2, 15, 4)[observation.step % 6] if self._semantic else 14


@pytest.fixture(scope="module")
def log(smoke, tmp_path_factory):
    """The log and the submissions of two runs."""
    out = tmp_path_factory.mktemp("log")
    for name, agent in (("oracle", "oracle"), ("wavering", f"{__name__}:Wavering")):
        evaluate(smoke, Evaluation(name, agent, selection=CHOSEN), out=out)
        write_submission(smoke, out, name, out / f"{name}.json.gz")
    return out


@pytest.fixture(scope="module")
def mine(log):
    return log / "wavering.json.gz"


@pytest.fixture(scope="module")
def scored(smoke, log, tmp_path_factory):
    """A folder with both runs."""
    folder = tmp_path_factory.mktemp("scored")
    for name in ("oracle", "wavering"):
        score(smoke, log / f"{name}.json.gz", folder, selection=CHOSEN, adapted=name == "oracle")
    return folder


def changed(source, target, change):
    """Write a submission that says something else, as one who knows the format would; returns its path."""
    content = json.loads(gzip.decompress(source.read_bytes()))
    change(content)
    flown = content["episodes"]
    lines = "".join(f"{t} {a}\n" for t, a in zip(flown["task_id"], flown["actions"], strict=False))
    content["actions_sha256"] = hashlib.sha256(lines.encode()).hexdigest()
    target.write_bytes(gzip.compress(json.dumps(content).encode()))
    return target


def test_a_run_is_submitted_scored_and_shown_by_commands(smoke, tmp_path, capsys):
    file, folder = tmp_path / "random.json.gz", tmp_path / "scored"
    flown = ("evaluate", "--agent", "random", "--data", smoke, "--out", tmp_path / "log", *OPTIONS)
    assert said(capsys, *flown, "--submission", file) == (0, "", "")
    first = file.read_bytes()
    assert len(first) < 5_000
    assert said(capsys, *flown, "--submission", file)[0] == 0, "a finished run is written again"
    assert file.read_bytes() == first
    assert said(capsys, "score", file, "--data", smoke, "--into", folder, *OPTIONS) == (0, "", "")
    written = f"{folder / 'leaderboard.html'}: 1 scored run\n"
    assert said(capsys, "leaderboard", folder) == (0, "", written)
    again = said(capsys, "score", file, "--data", smoke, "--into", folder, *OPTIONS)
    assert again[0] == 2, "the run is there already"
    code, _, err = said(capsys, "score", file, "--data", smoke, "--into", folder, *OPTIONS[4:], "--replace")
    assert code == 1
    assert err.startswith(f"error: {file} is refused: it lacks ")
    assert "it says that it flew --split id_test --split ood_test --limit 24 --seed 0" in err
    assert err.count("\n") == 1


def test_scores_are_those_of_the_report(smoke, log, scored):
    for card in scored_runs(scored):
        profiles = [PROFILES["aerialdojo"], PROFILES["aerialdojo-5m"]]
        request = ReportRequest(smoke, load_runs(log, [card.name]), profiles)
        rows = {
            (row["setting"], "all" if row["scope"] == "overall" else row["name"], row["radius_m"]): row
            for row in json.loads(tables.as_json(request))
            if row["modality"] == "all" and row["scope"] in ("overall", "partition")
        }
        assert len(card.rows) == len(rows) >= 2 * 2 * 3
        for own in card.rows:
            row = rows[own.setting, own.partition, own.radius_m]
            assert own.mean == {metric: row[metric] for metric in METRICS}
            assert own.episodes == row["episodes"]
            if own.partition == "all":
                assert own.low == {metric: row[f"{metric}_low95"] for metric in METRICS}
        assert read_run(scored / card.name, card.name).equals(read_run(log, card.name))
    assert {card.name: card.adapted for card in scored_runs(scored)} == {"oracle": True, "wavering": False}
    assert any("-" in actions for actions in read_submission(scored / "wavering/submission.json.gz").episodes.actions)
    left = {path.relative_to(scored / "oracle").parts[0] for path in (scored / "oracle").rglob("*")}
    assert left == {"episodes", "steps", "timings", "failures", "score.json", "submission.json.gz"}


def edit(column, k, value):
    def change(content):
        content["episodes"][column][k] = value(content["episodes"][column][k])

    return change


def another_turn(actions):
    """The last turn or move is another one."""
    k = max(k for k, action in enumerate(actions[:-1]) if action in "124ae")
    return f"{actions[:k]}f{actions[k + 1 :]}"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (edit("actions", -1, another_turn), "1 of 24 episodes do not replay; task "),
        (edit("actions", 3, lambda a: a + "0"), "it ends by "),
        (edit("actions", 3, lambda a: a[:-1]), "actions do not end it"),
        (edit("termination", 7, lambda t: "stop" if t != "stop" else "budget"), ", not by "),
        (edit("x_m", 23, lambda x: x + 0.001), "it ends with x_m = "),
        (edit("yaw_rad", 5, lambda yaw: yaw + 0.1), "it ends with yaw_rad = "),
        (edit("path_length_m", 5, lambda m: m + 1.0), "it ends with path_length_m = "),
        (lambda content: content["metrics"].update(sr=0.5), "it claims sr = 50.00, and its actions give "),
        (lambda content: content["metrics"].update(dts_m=None), "it claims dts_m = –"),
        (lambda content: [c.pop(0) for c in content["episodes"].values()], "it lacks 1 of the 24 tasks"),
        (edit("task_id", 0, lambda t: t.replace("-", "-0")), "it has 1 tasks of another selection or release "),
        (lambda content: content["run"]["embodiment"].update(radius_m=0.1), "it was flown with the body "),
        (lambda content: content["scenes"]["U_Courtyard_1"].update(tasks=["0" * 64]), "the tasks of U_Courtyard_1"),
    ],
)  # fmt: skip
def test_what_does_not_replay_is_refused(smoke, mine, tmp_path, change, message):
    file = changed(mine, tmp_path / "mine.json.gz", change)
    with pytest.raises(SubmissionRefused, match=r"mine\.json\.gz is refused") as refused:
        score(smoke, file, tmp_path / "scored", selection=CHOSEN)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert not list(tmp_path.glob("scored/*"))


def test_half_a_turn_has_two_names(smoke, mine, scored, tmp_path):
    """A yaw just above -π may come out just below π on another machine."""
    file = changed(mine, tmp_path / "f", edit("yaw_rad", 5, lambda yaw: yaw - math.copysign(math.tau, yaw)))
    card = score(smoke, file, tmp_path / "scored", selection=CHOSEN)
    assert card.rows == next(other.rows for other in scored_runs(scored) if other.name == card.name)


def nested(content):
    content["run"]["name"] = []
    for _ in range(100):
        content["run"]["name"] = [content["run"]["name"]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (edit("x_m", 0, lambda _: math.nan), "NaN"),
        (edit("x_m", 0, lambda _: "1.0"), "x_m.0 = '1.0'"),
        (edit("actions", 0, lambda _: "0g"), "actions.0 = '0g'"),
        (edit("actions", 0, lambda _: "1" * 20_000), "actions.0 = "),
        (edit("task_id", 1, lambda _: 5), "task_id.1 = 5"),
        (lambda content: content["episodes"]["y_m"].pop(), "differ in length"),
        (lambda content: [c.append(c[0]) for c in content["episodes"].values()], "stands in episodes twice"),
        (lambda content: content.update(code="import os"), "unknown key 'code'"),
        (lambda content: content.update(version=2), "version = 2"),
        (lambda content: content["run"].update(agent="a" * 1000), "agent = 'aaa"),
        (nested, "name"),
    ],
)  # fmt: skip
def test_content_of_another_form_is_refused(mine, tmp_path, change, message):
    with pytest.raises(SubmissionRefused, match="is no submission") as refused:
        read_submission(changed(mine, tmp_path / "f", change))
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 600


def test_files_that_are_none_are_refused(mine, tmp_path):
    whole = mine.read_bytes()
    by_hand = json.loads(gzip.decompress(whole))
    edit("actions", 2, another_turn)(by_hand)
    files = {
        "edited": (gzip.compress(json.dumps(by_hand).encode()), "its actions were changed after it was written"),
        "bomb": (gzip.compress(bytes(65 << 20), 1), "more than 64 MiB of text"),
        "cut": (whole[: len(whole) // 2], "is damaged"),
        "longer": (whole + b"PK", "is damaged"),
        "pickle": (b"\x80\x04}\x94.", "not gzipped JSON"),
        "plain": (gzip.decompress(whole), "not gzipped JSON"),
        "empty": (b"", "is damaged"),
        "list": (gzip.compress(b"[1]"), "no submission"),
        "text": (gzip.compress(b"\xff"), "is not UTF-8"),
    }
    for name, (data, message) in files.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(SubmissionRefused, match=f"{name} .*{message}"):
            read_submission(tmp_path / name)
    os.mkfifo(tmp_path / "fifo")
    for name in ("fifo", "missing", "."):
        with pytest.raises(SubmissionRefused, match="cannot be read"):
            read_submission(tmp_path / name)


def test_names_and_folders_stay_as_they_are(smoke, mine, scored, tmp_path):
    before = {path: path.read_bytes() for path in scored.rglob("*") if path.is_file()}
    out = changed(mine, tmp_path / "out.json.gz", lambda content: content["run"].update(name="../out"))
    with pytest.raises(UsageError, match="is no name of a run"):
        score(smoke, out, scored, selection=CHOSEN)
    with pytest.raises(UsageError, match="has a scored run 'wavering'"):
        score(smoke, mine, scored, selection=CHOSEN)
    fewer = Selection(("test",), limit=12)
    evaluate(smoke, Evaluation("fewer", "stop", selection=fewer), out=tmp_path)
    write_submission(smoke, tmp_path, "fewer", tmp_path / "fewer.json.gz")
    with pytest.raises(UsageError, match=r"has 'oracle', scored on other \w+ tasks: "):
        score(smoke, tmp_path / "fewer.json.gz", scored, selection=fewer)
    assert {path: path.read_bytes() for path in scored.rglob("*") if path.is_file()} == before


def test_an_unfinished_run_is_not_written(smoke, log, tmp_path):
    for name in ("runs", "episodes", "steps"):
        shutil.copytree(log / name / "oracle", tmp_path / name / "oracle")
        (tmp_path / name / "oracle/part-U_Courtyard_1.parquet").unlink(missing_ok=True)
    with pytest.raises(SubmissionRefused, match="run 'oracle' lacks 12 of the 24 tasks, such as U_Courtyard_1-"):
        write_submission(smoke, tmp_path, "oracle", tmp_path / "f")
    assert not (tmp_path / "f").exists()


def test_a_submission_on_another_mesh_is_refused(mine, planted, tmp_path):
    (row,) = planted.rows("release/scenes")
    mesh = planted.data / row["mesh_path"]
    mesh.write_bytes(mesh.read_bytes().replace(b'"asset"', b'"Asset"', 1))
    digest = hashlib.sha256(mesh.read_bytes()).hexdigest()
    assert row["mesh_sha256"] != digest
    planted.write("release/scenes", [row | {"mesh_sha256": digest}], schema=SCENES.schema)
    with pytest.raises(SubmissionRefused, match=rf"U_Courtyard_0 was flown on another mesh \(.* here {digest[:12]}"):
        score(planted.data, mine, tmp_path / "scored", selection=CHOSEN)
    assert not (tmp_path / "scored").exists()


def test_a_run_without_goals_is_scored_by_who_has_them(smoke, log, mine, scored, planted, tmp_path, capsys):
    """A published copy has neither routes nor viewpoints; only `score` knows how well the agent does."""
    for folder in ("routes/id_test", "routes/ood_test", "anchors", "viewpoints"):
        shutil.rmtree(planted.release / folder)
    agent = ("--agent", f"{__name__}:Wavering", "--run", "wavering")
    flown = ("evaluate", *agent, "--data", planted.data, *OPTIONS[:-1])
    code, _, err = said(capsys, *flown)
    assert code == 1
    assert "error: routes/test of U_Courtyard_0 is missing" in err
    code, _, err = said(capsys, *flown, "--submission", tmp_path / "f")
    assert code == 0
    assert "24 of 24 episodes finished; 24 flown now" in err, "no success rate"
    assert err.endswith("; the goals are withheld: score it with the whole release\n")
    blind, seeing = read_submission(tmp_path / "f"), read_submission(mine)
    assert (blind.metrics, blind.episodes) == (None, seeing.episodes)
    code, _, err = said(capsys, "report", "wavering", "--data", planted.data)
    assert (code, err.count("\n")) == (1, 1)
    assert "the release withholds the goals" in err
    rows = {card.name: card.rows for card in scored_runs(scored)}
    assert score(smoke, tmp_path / "f", tmp_path / "scored", selection=CHOSEN).rows == rows["wavering"]
    with pytest.raises(StoreError, match="routes/test of U_Courtyard_0 is missing"):
        score(planted.data, mine, tmp_path / "elsewhere", selection=CHOSEN)


def test_the_page_sorts_in_a_browser_and_asks_for_nothing(scored, tmp_path, browser):
    folder = tmp_path / "scored"
    shutil.copytree(scored, folder)
    hostile = json.loads((folder / "wavering/score.json").read_text())
    hostile |= {"name": "hostile", "agent": "</script><img src=x onerror='document.title=1'>", "told": "heading"}
    (folder / "hostile").mkdir()
    (folder / "hostile/score.json").write_text(ScoreCard.model_validate(hostile).model_dump_json())
    page = folder / "leaderboard.html"
    assert write_leaderboard(folder, page) == 3
    browser.get(page.as_uri())
    asked = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    urls = [m["params"]["request"]["url"] for m in asked if m["method"] == "Network.requestWillBeSent"]
    assert [u for u in urls if not u.startswith(("data:", "chrome"))] == [page.as_uri()]
    titles = [title.text for title in browser.find_elements("css selector", "h2")]
    own = [title for name, title in NAMES_OF.items() if name in hostile["tasks"]]
    assert titles == [*own, "All settings", "How it was scored"]
    board = browser.find_element("css selector", ".board")

    def names():
        return [th.text.split("\n")[0] for th in board.find_elements("css selector", "tbody th") if th.text]

    def column(k):
        cells = board.find_elements("css selector", f"tbody tr > :nth-child({k + 1})")
        return [float(cell.get_attribute("data-value") or "nan") for cell in cells if cell.is_displayed()]

    heads = [th.text for th in board.find_elements("css selector", "thead tr:last-child th")]
    assert heads[:8] == ["run", "episodes", "SR ↑", "SR-view ↑", "OSR ↑", "SPL ↑", "DTS ↓", "CR ↓"]
    assert names()[0] == "oracle"
    assert len(names()) == 3 + 9
    assert "Claude Opus 5" in names()
    assert column(2) == sorted(column(2), reverse=True)
    assert "</script><img src=x onerror" in board.text

    buttons = board.find_elements("css selector", "thead button")
    dts = heads.index("DTS ↓")
    for order in ("ascending", "descending"):
        buttons[dts].click()
        assert column(dts) == sorted(column(dts), reverse=order == "descending")
        assert board.find_element("css selector", "[aria-sort]").get_attribute("aria-sort") == order
    buttons[0].click()
    assert names() == sorted(names(), key=str.casefold)
    buttons[1].click()
    assert [math.isnan(n) for n in column(1)] == [False] * 3 + [True] * 9, "the paper tells no number: last"

    browser.find_element("css selector", "#paper").click()
    assert set(names()) == {"oracle", "wavering", "hostile + heading"}
    assert browser.title == "Leaderboard"
    assert errors(browser) == []
    groups = [th.text for th in board.find_elements("css selector", "[scope=colgroup]")]
    assert groups == ["all scenes, 3 m", "5 m", "ID", "OOD", "OOD, adapted"]
    oracle = next(row for row in board.find_elements("css selector", "tbody tr") if row.text.startswith("oracle"))
    last = [cell.text.split("\n")[0] for cell in oracle.find_elements("css selector", "td")[-4:]]
    assert last == ["–", "–", "100.00", "100.00"]


def test_a_folder_without_scored_runs_has_no_page(tmp_path, capsys):
    (tmp_path / "a/b").mkdir(parents=True)
    (tmp_path / "a/b/score.json").write_text('{"format": 1}')
    for folder, message in ((tmp_path, " has no scored run"), (tmp_path / "a", "/b/score.json: ")):
        code, _, err = said(capsys, "leaderboard", folder)
        assert (code, err.count("\n")) == (1, 1)
        assert err.startswith(f"error: {folder}{message}")
