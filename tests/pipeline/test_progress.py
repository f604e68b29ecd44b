"""Progress on a terminal, and where there is none."""

import io
import os

from aerialdojo_gen.pipeline.progress import Reporter


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
