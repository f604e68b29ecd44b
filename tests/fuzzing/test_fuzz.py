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

EACH = 20


@pytest.fixture(scope="module")
def outcomes():
    inputs = [(name, folder) for name in targets.TARGETS for folder in campaign.corpus(name)]
    assert len(inputs) > 20
    return campaign.run({name: range(campaign.number_for(name, EACH)) for name in targets.TARGETS}, inputs)


@pytest.mark.parametrize("name", targets.TARGETS)
def test_mutants_and_inputs_that_once_broke_a_parser_end_well_or_in_an_error_of_ours(outcomes, name):
    assert outcomes[name].ran == campaign.number_for(name, EACH) + len(campaign.corpus(name))
    assert outcomes[name].faults == []


def test_mutants_are_a_function_of_their_number(tmp_path):
    first, again, other = (
        [case for _, case in worker.mutants(name, seed, 0, 30)]
        for name, seed in (("journal", 0), ("journal", 0), ("journal", 1))
    )
    assert first == again
    assert first[1:] != other[1:]
    (valid, *_), [(_, late)] = first, list(worker.mutants("journal", 0, 29, 30))
    assert valid in targets.TARGETS["journal"].cases()
    assert late == first[29]


def _target(run, name="x.json"):
    return targets.Target(lambda: [{name: b"{}"}], run)


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
    fault = worker.fault_of(_target(run), tmp_path)
    assert (fault and fault["kind"]) == kind


# Without the real targets, whose imports take seconds.
DEATHS = """
import os, sys, types
from fuzzing.cases import Target
targets = sys.modules["fuzzing.targets"] = types.ModuleType("fuzzing.targets")
targets.TARGETS = {}
from fuzzing import worker
def hang(folder):
    while True:
        pass
def die(folder):
    os.abort()
def eat(folder):
    bytearray(3 << 30)
def run(folder):
    k = int((folder / "x.bin").read_bytes()[:1] or b"9")
    [lambda f: None, hang, die, eat][k](folder) if k < 4 else None
targets.TARGETS["deaths"] = Target(lambda: [{"x.bin": b"0"}], run)
worker.HANG_S = 1.0
worker.main()
"""


def test_a_hang_a_death_and_a_glutton_are_laid_to_their_inputs(tmp_path, monkeypatch):
    script = tmp_path / "deaths.py"
    script.write_text(DEATHS)
    folders = []
    for k, what in enumerate("012030"):
        folder = tmp_path / str(k)
        folder.mkdir()
        (folder / "x.bin").write_text(what)
        folders.append(("deaths", folder))
    monkeypatch.setattr(campaign, "COMMAND", [str(script)])
    outcome = campaign.run({}, folders)["deaths"]
    assert outcome.ran == 6
    assert [(f["index"], f["kind"]) for f in outcome.faults] == [
        (str(folders[1][1]), "hang"),
        (str(folders[2][1]), f"died of {-signal.SIGABRT}"),
        (str(folders[4][1]), "MemoryError"),
    ]


def test_mutants_of_structure_are_often_still_well_formed():
    raw = json.dumps({"a": [1, 2, {"b": "text"}], "c": 1.5}).encode()
    read = 0
    for k in range(200):
        with contextlib.suppress(ValueError, RecursionError):
            json.loads(mutant("x.json", raw, generator(0, "test", k)))
            read += 1
    assert read > 60
