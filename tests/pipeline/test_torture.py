"""A little of `make torture`: commands killed at a call or a time, repeated, and every byte compared."""

from __future__ import annotations

import random  # noqa: TID251 - which kills, not what is generated

import pytest
import torture

pytestmark = pytest.mark.kill


@pytest.fixture(scope="module")
def bench(smoke, tmp_path_factory):
    bench = torture.Bench(tmp_path_factory.mktemp("torture"), smoke)
    yield bench
    bench.close()


@pytest.mark.parametrize("name", ["export", "import"])
def test_a_killed_command_that_is_repeated_leaves_what_an_undisturbed_one_does(bench, name):
    assert bench.case(name, random.Random(name), aimed=True) == "killed"
    assert bench.case(name, random.Random(name), aimed=False) in ("killed", "finished")


def test_a_file_that_is_left_over_is_noticed(bench, monkeypatch):
    kind = torture.KINDS["export"]
    bench.undisturbed("export")

    def litter(data, rng):
        kind.prepare(data, rng)
        (data / "exports").mkdir(exist_ok=True)
        (data / "exports" / f"{rng.random()}").write_text("half")

    monkeypatch.setitem(torture.KINDS, "export", torture.Kind(kind.arguments, litter))
    with pytest.raises(AssertionError, match=r"export, killed .*: exports/0\."):
        bench.case("export", random.Random(0), aimed=True)
