"""A small campaign of `make fuzz` over every parser, and every input that once broke one."""

import contextlib
import json
import signal

import pytest
from fuzzing import campaign, targets, worker
from fuzzing.mutate import mutant

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.rng import generator

pytestmark = pytest.mark.slow

EACH = 10


def todo(name):
    return campaign.mutants(name, EACH) + campaign.corpus(name)


@pytest.fixture(scope="module")
def outcomes():
    return campaign.run([one for name in targets.TARGETS for one in todo(name)])


@pytest.mark.parametrize("name", targets.TARGETS)
def test_mutants_and_inputs_that_once_broke_a_parser_end_well_or_in_an_error_of_ours(outcomes, name):
    assert outcomes[name].ran == len(todo(name))
    assert outcomes[name].faults == []


def test_mutants_are_a_function_of_their_number_and_all_inputs_that_broke_something_are_tried():
    first = [worker.case_at("journal", 0, k) for k in range(30)]
    assert [worker.case_at("journal", 0, k) for k in reversed(range(30))] == first[::-1]
    assert [worker.case_at("journal", 1, k) for k in range(1, 30)] != first[1:]
    assert first[0] in targets.TARGETS["journal"].cases()
    assert len([at for name in targets.TARGETS for _, at in campaign.corpus(name)]) > 20


def _raising(error):
    def run(folder):
        raise error

    return run


@pytest.mark.parametrize(
    ("run", "kind"),
    [
        (lambda folder: None, None),
        (lambda folder: _raising(AssetError(f"{folder}/x: wrong"))(folder), None),
        (_raising(AssetError("wrong")), "message"),
        (_raising(AssetError("\ud800")), "message"),
        (_raising(KeyError("x")), "KeyError"),
        (_raising(MemoryError()), "MemoryError"),
    ],
)
def test_what_counts_as_a_fault(tmp_path, run, kind):
    fault = worker.fault_of(targets.Target(list, run), tmp_path)
    assert (fault and fault["kind"]) == kind


# Without the real targets, whose imports take seconds.
DEATHS = """
import os, sys, time, types
from fuzzing.cases import Target
targets = sys.modules["fuzzing.targets"] = types.ModuleType("fuzzing.targets")
targets.TARGETS = {}
from fuzzing import worker
def hang(folder):
    while True:
        pass
def run(folder):
    k = int((folder / "x.bin").read_bytes()[:1] or b"9")
    does = [lambda f: None, hang, lambda f: os.abort(), lambda f: bytearray(3 << 30), lambda f: time.sleep(60)]
    does[k](folder) if k < len(does) else None
targets.TARGETS["deaths"] = Target(lambda: [{"x.bin": b"0"}], run)
worker.HANG_S, worker.STUCK_S = 0.5, 5.0
worker.main()
"""


def test_a_hang_a_death_a_glutton_and_a_wait_are_laid_to_their_inputs(tmp_path, monkeypatch):
    (tmp_path / "deaths.py").write_text(DEATHS)
    for k, what in enumerate("0120304"):
        (tmp_path / str(k)).mkdir()
        (tmp_path / str(k) / "x.bin").write_text(what)
    monkeypatch.setattr(campaign, "COMMAND", [str(tmp_path / "deaths.py")])
    outcome = campaign.run([("deaths", str(tmp_path / str(k))) for k in range(7)])["deaths"]
    assert outcome.ran == 7
    assert [(f["index"], f["kind"]) for f in outcome.faults] == [
        (str(tmp_path / k), kind)
        for k, kind in (("1", "hang"), ("2", f"died of {-signal.SIGABRT}"), ("4", "MemoryError"), ("6", "stuck"))
    ]


def test_mutants_of_structure_are_often_still_well_formed():
    raw = json.dumps({"a": [1, 2, {"b": "text"}], "c": 1.5}).encode()
    read = 0
    for k in range(200):
        with contextlib.suppress(ValueError, RecursionError):
            json.loads(mutant("x.json", raw, generator(0, "test", k)))
            read += 1
    assert read > 60
