"""Progress on a terminal, and where there is none."""

import fcntl
import io
import os
import struct
import termios

from aerialdojo_gen.pipeline.progress import Overview, Reporter, duration


def test_a_bar_has_no_speed_before_there_is_one():
    ours, terminal = os.openpty()
    with open(terminal, "w", encoding="utf-8") as stream:
        with Reporter(stream=stream).bar("plan", 3) as bar:
            bar.advance()
            bar.advance(2)
        stream.flush()
        said = os.read(ours, 1 << 16).decode()
    os.close(ours)
    assert "plan:   0%" in said
    assert "? shards/s" not in said
    assert "0/3 [00:00]" in said


def test_elsewhere_there_is_no_bar():
    stream = io.StringIO()
    reporter = Reporter(stream=stream)
    with reporter.bar("plan", 3) as bar:
        bar.advance(3)
    reporter.line("plan: done")
    assert stream.getvalue() == "plan: done\n"


def overviews():
    names = [
        "U_ConstructionSite_1 plan 3/8",
        "N_Forest_0 anchor-sample",
        "D_Flood_1 build-scenes",
        "U_Mall_0 plan 1/16",
    ]
    yield Overview(0.0, 400.0, 0, 42, [])
    yield Overview(100.0, 300.0, 9, 42, names[:2], 2)
    yield Overview(400.0, 0.0, 42, 42, names, 4)


def test_how_far_a_run_is_fits_a_terminal():
    ours, terminal = os.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    seen = list(overviews())
    with open(terminal, "w", encoding="utf-8") as stream:
        with Reporter(stream=stream).overall(lambda: seen[0]) as bar:
            for _ in range(2):
                seen.pop(0)
                bar.refresh()
        stream.flush()
        said = os.read(ours, 1 << 16).decode()
    os.close(ours)
    lines = [line.strip("\n\x1b[A") for line in said.split("\r") if line.strip()]
    assert max(map(len, lines)) <= 80, lines
    assert " 25%|" in said
    assert "9 of 42 scenes, about 2 min 30 s left: U_ConstructionSite_1" in said


def test_how_far_a_run_is_in_words():
    start, half, end = overviews()
    assert [one.share for one in (start, half, end)] == [0.0, 0.25, 1.0]
    # Two processes share what is left; of the last scene's there is none to share.
    assert str(half) == (
        "9 of 42 scenes, about 2 min 30 s left: U_ConstructionSite_1 plan 3/8, N_Forest_0 anchor-sample"
    )
    assert str(end).endswith("D_Flood_1 build-scenes and 1 more")
    assert [duration(s) for s in (0.4, 59.6, 200.0, 7800.0)] == ["0 s", "1 min 0 s", "3 min 20 s", "2 h 10 min"]


def test_quiet_says_nothing_of_how_far_it_is():
    stream = io.StringIO()
    with Reporter(quiet=True, stream=stream).overall(lambda: next(overviews())) as bar:
        bar.refresh()
        bar.advance()
    assert stream.getvalue() == ""
