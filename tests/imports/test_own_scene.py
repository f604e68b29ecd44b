"""A scene of one's own by the commands alone: what each of them advises can be pasted and works."""

from __future__ import annotations

import json
import re
import shlex

import pytest
import trimesh
from support import foreign
from support.command_line import said


def pasted(text: str, begin: str) -> list[str]:
    """The arguments of the command that a line advises."""
    (line,) = [line for line in text.splitlines() if begin in line]
    program, *arguments = shlex.split(line.partition(begin)[2].strip())
    assert program == "aerialdojo-gen"
    return arguments


def yard(*bodies: tuple[str, trimesh.Trimesh, tuple[float, float, float]]) -> trimesh.Scene:
    scene = trimesh.Scene()
    for name, body, place in bodies:
        body.apply_translation(place)
        scene.add_geometry(body, node_name=name)
    return scene


def box(*size: float) -> trimesh.Trimesh:
    return trimesh.creation.box(size)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """An empty working directory whose name has to be quoted."""
    folder = tmp_path / "my place"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.delenv("AERIALDOJO_DATA", raising=False)
    return folder


def added(capsys, scene: trimesh.Scene, name: str, *options: str) -> str:
    scene.export(f"{name}.glb")
    code, out, err = said(capsys, "add-scene", name, f"{name}.glb", "--up", "z", "--project", "our scenes", *options)
    assert code == 0, err
    return out


@pytest.mark.pipeline
def test_from_a_mesh_to_tasks_by_what_the_commands_advise_past_a_scene_without_annotations(place, capsys):
    out = added(capsys, foreign.village(), "Village")
    code, drafted, err = said(capsys, *pasted(out, "next: "))
    assert code == 0, err
    assert drafted.strip() == "our scenes/annotations/Village.json"
    assert "up to 7 objects by 2 landmarks" in err  # eight houses and a tower
    draft = json.loads((place / "our scenes/annotations/Village.json").read_text())
    assert len(draft["landmarks"]) == 2
    assert 2 <= len(draft["objects"]) <= 7
    run = pasted(added(capsys, foreign.village(), "Hamlet"), "then: ")
    code, _, err = said(capsys, *run, "--workers", "1", "--quiet")
    assert code == 0, err
    left_out = [line for line in err.splitlines() if "left out" in line]
    assert len(left_out) == 1
    assert left_out[0].startswith("left out: Hamlet has no annotations")
    released = sorted(p.name for p in (place / "our scenes/data/release/tasks").rglob("*.parquet"))
    assert released
    assert all("Village" in name for name in released)
    # Asked for by its full name it is owed; the one that is there is finished all the same.
    code, _, err = said(capsys, *run, "--workers", "1", "--scene", "Hamlet", "--scene", "Village")
    assert code == 1
    assert "the other scenes are finished" in err
    code, _, err = said(capsys, "plan", "--pipeline", run[1], "--data", run[3], "--scene", "Hamlet")
    assert code == 1
    assert "build-scenes" not in err  # nothing is begun that cannot be finished
    advice = err.partition("draft them: ")[2].partition(" or make them by hand: ")
    assert shlex.split(advice[0]) == ["aerialdojo-gen", "annotate-draft", "Hamlet", "--pipeline", run[1]]
    by_hand = ["aerialdojo-gen", "annotate", "--scene", "Hamlet", "--pipeline", run[1], "--data", run[3]]
    assert shlex.split(advice[2]) == by_hand


def test_what_cannot_be_drafted_says_why_and_what_to_do(place, capsys):
    # A barn in a shed: nothing of it can be looked at. Flat things without a name that is a word are slabs.
    bodies = yard(
        ("Shed", box(12, 10, 9), (0, 0, 4.5)), ("Barn", box(8, 6, 5), (1, 0, 2.5)), ("Mesh_012", box(40, 40, 0.1), (0, 0, 0))
    )  # fmt: skip
    code, _, err = said(capsys, *pasted(added(capsys, bodies, "Inside"), "next: "))
    assert code == 1
    why = r"not taken: 1 without 3 viewpoints at 1 m \((shut in, or below ground|too close to something else)\), 1 of ground"
    assert re.search(why, err), err
    assert "aerialdojo-gen annotate --scene Inside --pipeline 'our scenes/pipeline.toml'" in err
    assert not re.search(r"ask for|--objects", err)
    assert not list((place / "our scenes/annotations").iterdir())


def test_one_thing_beside_a_landmark_is_taken_with_a_warning(place, capsys):
    out = added(capsys, yard(("Barn", box(8, 6, 5), (0, 0, 2.5)), ("Well", box(2, 2, 2), (15, 3, 1))), "Farm")
    code, _, err = said(capsys, *pasted(out, "next: "))
    assert code == 0, err
    assert "one object makes no task" in err
    assert "aerialdojo-gen annotate --scene Farm --pipeline 'our scenes/pipeline.toml'" in err
    draft = json.loads((place / "our scenes/annotations/Farm.json").read_text())
    assert {draft["landmarks"][0]["name"], draft["objects"][0]["name"].split()[-1]} == {"barn", "well"}


def test_a_single_thing_is_no_scene_to_search(place, capsys):
    out = added(capsys, yard(("Barn", box(8, 6, 5), (0, 0, 2.5))), "Alone")
    code, _, err = said(capsys, *pasted(out, "next: "))
    assert code == 1
    print(err)
    assert "nothing in it can be drafted" in err
    assert "ask for" not in err
    assert not list((place / "our scenes/annotations").iterdir())


def test_numbers_that_cannot_be_had_are_the_most(place, capsys):
    added(capsys, foreign.village(), "Village")
    draft = ["annotate-draft", "Village", "--pipeline", "our scenes/pipeline.toml"]
    code, _, err = said(capsys, *draft, "--objects", "1")
    assert code == 2
    assert "'1' is neither auto nor a number from 2 on" in err
    code, _, err = said(capsys, *draft, "--objects", "30", "--landmarks", "1", "--quiet")
    assert code == 0, err
    assert len(json.loads((place / "our scenes/annotations/Village.json").read_text())["objects"]) >= 2
