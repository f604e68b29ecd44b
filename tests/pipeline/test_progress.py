"""Progress on a terminal, and where there is none."""

import contextlib
import fcntl
import io
import os
import re
import struct
import termios
import time

import pytest
from support import chores

from aerialdojo_gen.pipeline import progress
from aerialdojo_gen.pipeline.progress import Overview, Rate, Reporter, duration


def on_a_terminal(show, columns=None):
    """Return what `show` writes to a terminal, which is given a stream."""
    ours, terminal = os.openpty()
    if columns is not None:
        fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    with open(terminal, "w", encoding="utf-8") as stream:
        show(stream)
    said = b""
    # A pseudo-terminal hands over what was written in pieces; its end is an error.
    with contextlib.suppress(OSError):
        while piece := os.read(ours, 1 << 16):
            said += piece
    os.close(ours)
    return said.decode()


def paced(bar, starting_s, n, each_s, **more):
    """Do n things of each_s, after starting up."""
    time.sleep(starting_s)
    for _ in range(n):
        bar.advance(**more)
        time.sleep(each_s)


def test_a_rate_does_not_count_starting_up():
    rate = Rate()
    time.sleep(0.2)
    assert rate.per_s(1) is None, "one thing has no rate"
    assert rate.per_s(4) is None, "several processes finish their first things together"
    time.sleep(0.4)
    known = rate.per_s(5)
    assert known is not None
    # 4 in 0.4 s, or in as long as a busy machine sleeps; with the start 0.6 s.
    assert known <= 4 / 0.4


def test_a_time_left_is_said_when_it_is_known_and_does_not_count_starting_up(monkeypatch):
    monkeypatch.setattr(progress, "_PLAIN_EVERY_S", 0.0)
    stream, n = io.StringIO(), 200
    with Reporter(stream=stream).bar("evaluate", n, "episodes") as bar:
        began = time.monotonic()
        paced(bar, 0.3, 1, 0.0)
        first = time.monotonic() - began
        paced(bar, 0.0, 60, 0.01)
    lines = stream.getvalue().splitlines()
    assert lines[0] == f"evaluate: 1/{n} episodes"
    told = [match for line in lines if (match := re.search(r"(\d+)/200 .* ETA (\d+) s", line))]
    assert told, lines
    assert "ETA" not in lines[1]
    # By the first thing alone it would be 200 times the start.
    assert all(int(match[2]) < 0.5 * (n - int(match[1])) * first for match in told), lines


@pytest.mark.parametrize("frames", [0, 5])
def test_a_terminal_shows_no_time_left_before_it_is_known(frames):
    def show(stream):
        with Reporter(stream=stream).bar("plan", 300) as bar:
            paced(bar, 0.3, 13, 0.11, frames=frames)

    said = on_a_terminal(show)
    assert "? shards/s" not in said
    shown = [part for part in said.split("\r") if re.search(r" [1-9]\d*/300", part)]
    assert "shards/s" not in shown[0], shown
    left = re.findall(r"<(\d+):(\d+), +([\d.]+) shards/s", shown[-1])
    assert left, shown
    minutes, seconds, speed = left[0]
    n = int(re.search(r" (\d+)/300", shown[-1])[1])
    assert abs(60 * int(minutes) + int(seconds) - (300 - n) / float(speed)) < 2.0
    assert ("frames/s" in shown[-1]) == bool(frames)


def overviews():
    names = ["U_ConstructionSite_1 plan 3/8", "N_Forest_0 anchor-sample", "D_Flood_1 build-scenes", "U_Mall_0 plan"]
    yield Overview(0.0, 400.0, 0, 42, [])
    yield Overview(100.0, 300.0, 9, 42, names[:2], 2)
    yield Overview(400.0, 0.0, 42, 42, names, 4)


@pytest.mark.parametrize("width", [80, 120])
def test_a_terminal_breaks_no_word(width):
    words = " ".join(f"reason_{n} 1,{n:03}" for n in range(60))
    seen = list(overviews())[1]

    def show(stream):
        reporter = Reporter(stream=stream)
        reporter.line(f"plan: {words}")
        with reporter.overall(lambda: seen) as bar:
            bar.refresh()

    lines = on_a_terminal(show, columns=width).replace("\r", "\n").splitlines()
    assert max(map(len, lines)) < width, lines
    summary = [line for line in lines if "reason_" in line]
    assert len(summary) > 2
    assert " ".join(" ".join(summary).split()) == f"plan: {words}"
    bars = [line for line in lines if "25%|" in line]
    assert any("9/42 scenes, ~2 min 30 s left: U_ConstructionSite_1 plan 3/8" in bar for bar in bars), bars
    end = "U_ConstructionSite_1 plan 3/8 +1" if width == 80 else "N_Forest_0 anchor-sample"
    assert bars
    assert all(line.rstrip().endswith(end) for line in bars), bars


@pytest.mark.parametrize("kind", ["bar", "overall"])
def test_without_a_terminal_a_line_comes_now_and_then_while_nothing_is_finished(kind, monkeypatch):
    monkeypatch.setattr(progress, "_SILENT_S", 0.1)
    stream = io.StringIO()
    reporter = Reporter(stream=stream)
    expected = "plan: 0/3 shards" if kind == "bar" else f"25 %, {list(overviews())[1].text()}"
    with reporter.bar("plan", 3) if kind == "bar" else reporter.overall(lambda: list(overviews())[1]):
        chores.until(lambda: stream.getvalue().count("\n") >= 2)
    assert set(stream.getvalue().splitlines()) == {expected}


def test_how_far_a_run_is_in_words():
    start, half, end = overviews()
    assert [one.share for one in (start, half, end)] == [0.0, 0.25, 1.0]
    # Two processes share what is left; of the last scene's there is none to share.
    assert half.text() == ("9/42 scenes, ~2 min 30 s left: U_ConstructionSite_1 plan 3/8, N_Forest_0 anchor-sample")
    assert end.text().endswith("D_Flood_1 build-scenes +1")
    assert [duration(s) for s in (0.4, 59.6, 200.0, 7800.0)] == ["0 s", "1 min 0 s", "3 min 20 s", "2 h 10 min"]


def test_quiet_says_nothing_of_how_far_it_is():
    stream = io.StringIO()
    with Reporter(quiet=True, stream=stream).overall(lambda: next(overviews())) as bar:
        bar.refresh()
        bar.advance()
    assert stream.getvalue() == ""
