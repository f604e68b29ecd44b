"""Where there is no release every command says the same line: which place, what it lacks, what to do."""

from __future__ import annotations

import pytest
from support.command_line import said

TASK = "U_Courtyard_0-0123456789ab"
COMMANDS = {
    "stats": ["stats"],
    "stats --csv": ["stats", "--csv", "figures.csv"],
    "stats --pool": ["stats", "--pool"],
    "report": ["report"],
    "report of a run": ["report", "mine", "--out", "told"],
    "gallery --references": ["gallery", "--references", "--out", "pictured"],
    "render --estimate": ["render", "--estimate"],
    "validate": ["validate"],
    "show": ["show", TASK],
    "view": ["view", "--scene", "U_Courtyard_0", "--no-browser"],
    "export": ["export", "--format", "habitat", "--out", "exported"],
    "evaluate": ["evaluate", "--agent", "stop"],
    "fly": ["fly", "--name", "pilot-1"],
    "evaluate --estimate": ["evaluate", "--agent", "openai", "--option", "model=m", "--estimate"],
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_every_command_says_the_same_line(command, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = "name its folder with --data, or make one with make dataset\n"
    where = f"error: there is no release in {tmp_path}/data: "
    asked = (*command, "--data", "data")
    code, _, err = said(capsys, *asked)
    assert (code, err) == (1, f"{where}the folder does not exist; {told}")
    (tmp_path / "data" / "meshes").mkdir(parents=True)
    lack = "it has no folder release" + (
        ", nor tasks, routes, objects, landmarks, anchors, viewpoints or scenes" if command[0] == "validate" else ""
    )
    assert said(capsys, *asked)[2] == f"{where}{lack}; {told}"
    (tmp_path / "data" / "release" / "tasks").mkdir(parents=True)
    lack = "tasks without a file part-<scene>.parquet"
    assert said(capsys, *asked)[2] == f"{where}{lack}; {told}"
    assert {path.name for path in tmp_path.iterdir()} == {"data"}
