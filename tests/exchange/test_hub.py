"""push-to-hub and pull, against a server at 127.0.0.1 that answers what huggingface_hub asks of the Hub."""

import shutil
from functools import partial

import pytest
from huggingface_hub import constants
from support.command_line import said
from support.hub_server import READER, TOKEN, Repo, hub_server, is_large
from support.releases import files_of

from aerialdojo_gen.exchange.hub import scene_of
from aerialdojo_gen.store import shards

NAME = "me/yards"


@pytest.fixture
def hub(monkeypatch):
    """The server, which the commands are told of by the environment."""
    # Its own storage protocol is another service's; the server here takes files by git-lfs, as older ones do.
    monkeypatch.setattr(constants, "HF_HUB_DISABLE_XET", True)
    with hub_server() as server:
        monkeypatch.setenv("HF_ENDPOINT", server.url)
        monkeypatch.setenv("HF_TOKEN", TOKEN)
        yield server


@pytest.fixture
def call(capsys):
    """Call a command; returns the exit code, standard output and standard error."""
    return partial(said, capsys)


@pytest.fixture
def files(smoke, hub):
    """The files of a data set that holds the small release."""
    hub.repos[NAME] = Repo(files=files_of(smoke / "release"))
    return hub.repos[NAME].files


def fails(answer, code, *words):
    """The command ended with a code and a last line that has these words."""
    got, _, said = answer
    last = said.splitlines()[-1]
    assert (got, last.startswith("error: "), [word for word in words if word not in last]) == (code, True, []), answer


def test_what_was_sent_comes_back_to_the_byte_and_nothing_else_does(smoke, hub, call, tmp_path):
    # Scenes that the release has no more are taken away there, strangers' files stay.
    hub.repos[NAME] = Repo(files={"tasks/id_train/part-U_Gone_0.parquet": b"x", "notes.txt": b"mine"})
    code, said, _ = call("push-to-hub", NAME, "--data", smoke, "--quiet")
    assert code == 0
    assert f"{hub.url}/datasets/{NAME}: 2 scenes" in said
    released = files_of(smoke / "release")
    assert hub.repos[NAME].files == released | {"notes.txt": b"mine"}, "the card is README.md, at the top"
    strangers = ("tasks/../../evil.parquet", "run.py", "/etc/x", "../../meshes/U_Courtyard_0.glb")
    hub.repos[NAME].files |= dict.fromkeys((*strangers, "tasks/id_train/part-..parquet"), b"x")
    code, said, _ = call("pull", NAME, "--data", tmp_path / "mine")
    assert code == 0
    assert "left there: " in said
    assert "notes.txt" in said
    assert f"next: aerialdojo-gen validate --no-meshes --data {tmp_path / 'mine'}" in said
    assert files_of(tmp_path / "mine" / "release") == released
    assert {path.name for path in (tmp_path / "mine").iterdir()} == {"release", ".lock"}
    assert {path.name for path in tmp_path.iterdir()} == {"mine"}


def test_meshes_travel_where_they_are_asked_for(smoke, hub, call, tmp_path):
    assert call("push-to-hub", NAME, "--data", smoke, "--meshes", "--private")[0] == 0
    assert hub.repos[NAME].private
    assert call("pull", NAME, "--data", tmp_path / "all")[0] == 0
    assert files_of(tmp_path / "all" / "meshes") == files_of(smoke / "meshes")
    assert call("pull", NAME, "--data", tmp_path / "few", "--no-meshes")[0] == 0
    assert not (tmp_path / "few" / "meshes").exists()
    # A mesh of another making has a digest of its own, which the release knows nothing of.
    hub.repos[NAME].files["meshes/U_Courtyard_1.glb"] = hub.repos[NAME].files["meshes/U_Courtyard_0.glb"]
    fails(call("pull", NAME, "--data", tmp_path / "other"), 1, "U_Courtyard_1.glb is not the mesh")
    assert not (tmp_path / "other" / "release").exists()


def test_a_mesh_of_ones_own_is_not_lost(smoke, files, call, tmp_path):
    files |= {f"meshes/{name}": mesh for name, mesh in files_of(smoke / "meshes").items()}
    own = tmp_path / "meshes" / "U_Courtyard_1.glb"
    own.parent.mkdir()
    own.write_bytes(b"drawn by hand")
    shutil.copyfile(smoke / "meshes" / "U_Courtyard_0.glb", own.with_name("U_Courtyard_0.glb"))
    fails(call("pull", NAME, "--data", tmp_path), 2, str(own), "--no-meshes", "--replace")
    assert files_of(tmp_path).keys() == {"meshes/U_Courtyard_0.glb", "meshes/U_Courtyard_1.glb"}
    assert own.read_bytes() == b"drawn by hand"
    assert call("pull", NAME, "--data", tmp_path, "--replace")[0] == 0
    assert files_of(tmp_path / "meshes") == files_of(smoke / "meshes")


def test_weights_of_a_policy_travel_with_the_release(smoke, hub, call, tmp_path):
    data, name = tmp_path / "sent", "policies/imitation/policy.safetensors"
    shutil.copytree(smoke / "release", data / "release")
    missing = call("push-to-hub", NAME, "--data", data, "--policy", "imitation")
    fails(missing, 2, "there are no weights", name)
    fails(call("push-to-hub", NAME, "--data", data, "--policy", "../x"), 2, "there are no weights")
    (data / name).parent.mkdir(parents=True)
    (data / name).write_bytes(b"weights")
    (data / name).with_name("checkpoint.safetensors").write_bytes(b"stays here")
    assert call("push-to-hub", NAME, "--data", data, "--policy", "imitation")[0] == 0
    assert hub.repos[NAME].files == {**files_of(data / "release"), name: b"weights"}
    hub.repos[NAME].files |= dict.fromkeys(("policies/../policy.safetensors", "policies/a/run.safetensors"), b"x")
    assert call("pull", NAME, "--data", tmp_path / "mine")[0] == 0
    assert files_of(tmp_path / "mine" / "policies") == {"imitation/policy.safetensors": b"weights"}
    own = tmp_path / "own" / name
    own.parent.mkdir(parents=True)
    own.write_bytes(b"trained here")
    fails(call("pull", NAME, "--data", tmp_path / "own"), 2, str(own), "or add --replace")
    assert own.read_bytes() == b"trained here"


@pytest.mark.parametrize("address", ["http://hub.example", "http://10.0.0.7:8080/hf", "http://127.0.0.1.example"])
def test_a_token_goes_to_no_other_machine_unencrypted(hub, call, tmp_path, monkeypatch, address):
    monkeypatch.setenv("HF_ENDPOINT", address)
    answer = call("pull", NAME, "--data", tmp_path)
    fails(answer, 2, f"HF_TOKEN would go to {address} unencrypted", "https://")
    assert TOKEN not in "".join(answer[1:])


def test_both_go_on_where_they_were_cut_off(smoke, hub, call, tmp_path):
    large = {path: content for path, content in files_of(smoke / "release").items() if is_large(path)}
    hub.gives_up_after = 5
    assert call("push-to-hub", NAME, "--data", smoke)[0] == 1
    assert not hub.repos[NAME].files, "one commit, whole or not at all"
    there, hub.gives_up_after = len(hub.objects), None
    assert 0 < there < len(large)
    hub.calls.clear()
    assert call("push-to-hub", NAME, "--data", smoke)[0] == 0
    assert hub.calls["sent"] == len(set(large.values())) - there

    hub.calls.clear()
    hub.gives_up_after = 5
    assert call("pull", NAME, "--data", tmp_path)[0] == 1
    assert not (tmp_path / "release").exists()
    hub.gives_up_after = None
    there = sum(1 for path in tmp_path.rglob("part-*.parquet"))
    assert there > 0
    hub.calls.clear()
    # What another revision has left half fetched is no part of this one.
    left = tmp_path / f".pull-{NAME.replace('/', '--')}" / "release" / "objects" / "part-U_Gone_0.parquet"
    left.write_bytes(b"of a scene that this revision does not have")
    assert call("pull", NAME, "--data", tmp_path)[0] == 0
    assert hub.calls["fetched"] <= len(files_of(smoke / "release")) - there
    assert files_of(tmp_path / "release") == files_of(smoke / "release")


def test_neither_a_strangers_names_nor_a_password_reach_the_terminal(hub, files, call, tmp_path, monkeypatch):
    files["\x1b]0;owned\x07\nnext: rm -rf"] = b"x"
    code, said, _ = call("pull", NAME, "--data", tmp_path)
    assert code == 0
    assert r"left there: \u001b]0;owned\u0007\nnext: rm -rf" + "\n" in said
    monkeypatch.setenv("HF_ENDPOINT", hub.url.replace("://", "://me:hunter2@") + "9")
    answer = call("pull", NAME, "--data", tmp_path / "new")
    fails(answer, 1, "cannot reach")
    assert "hunter2" not in "".join(answer[1:])


def test_what_comes_damaged_or_lacks_a_part_makes_no_release_and_one_that_is_there_stays(
    smoke, hub, files, call, tmp_path
):
    part = "objects/part-U_Courtyard_0.parquet"
    whole = files[part]
    hub.spoilt[part] = whole[:100] + bytes([whole[100] ^ 1]) + whole[101:]
    fails(call("pull", NAME, "--data", tmp_path), 1, part, "was damaged in transfer")
    hub.spoilt.clear()
    del files[part]
    fails(call("pull", NAME, "--data", tmp_path), 1, part, "is missing")
    files[part] = whole[: len(whole) // 2]
    fails(call("pull", NAME, "--data", tmp_path), 1, part)
    assert not (tmp_path / "release").exists()
    files[part] = whole
    assert call("pull", NAME, "--data", tmp_path)[0] == 0
    assert shards.read_scene(tmp_path, "release/objects", "U_Courtyard_0").num_rows > 0
    # A release that is there stays unless it is to be replaced.
    card = tmp_path / "release" / "README.md"
    card.write_text("mine")
    fails(call("pull", NAME, "--data", tmp_path), 2, "--replace")
    assert card.read_text() == "mine"
    assert call("pull", NAME, "--data", tmp_path, "--replace")[0] == 0
    assert files_of(tmp_path / "release") == files_of(smoke / "release")


def test_what_goes_wrong_is_a_line_that_names_the_mend(smoke, hub, call, tmp_path, monkeypatch):
    push = ("push-to-hub", NAME, "--data", smoke)
    pull = ("pull", NAME, "--data", tmp_path / "new")
    fails(call(*pull), 2, f"there is no data set {NAME} at {hub.url}")
    hub.repos[NAME] = Repo(files={"README.md": b"a model", "data.csv": b"1"})
    fails(call(*pull), 2, "holds no release")
    fails(call(*pull, "--revision", "v9"), 2, "no such revision")
    monkeypatch.setenv("HF_TOKEN", READER)
    fails(call(*push), 1, "refuses to make or write to", "HF_TOKEN")
    monkeypatch.setenv("HF_TOKEN", "hf_aWrongTokenOfNoAccount12345678")
    for command in (push, pull):
        answer = call(*command)
        fails(answer, 1, "does not know the token in HF_TOKEN")
        assert "hf_aWrong" not in answer[2]
    monkeypatch.delenv("HF_TOKEN")
    hub.repos[NAME].private = True
    fails(call(*pull), 2, "HF_TOKEN is not set")
    fails(call(*push), 1, "export HF_TOKEN=", "/settings/tokens")
    fails(call("pull", "yards", "--data", tmp_path), 2, "write USER/NAME")
    fails(call("push-to-hub", NAME, "--data", tmp_path / "none"), 1, "there is no release in")
    monkeypatch.setenv("HF_ENDPOINT", "http://127.0.0.1:9")
    fails(call(*pull), 1, "cannot reach http://127.0.0.1:9")
    monkeypatch.setenv("HF_ENDPOINT", "nowhere")
    fails(call(*pull), 2, "HF_ENDPOINT")
    assert not (tmp_path / "new").exists()


def test_only_names_of_a_release_are_taken():
    for name in ("tasks/id_train/part-U_Mall_0.parquet", "objects/part-U_Mall_0.parquet", "meshes/U_Mall_0.glb"):
        assert scene_of(name) == "U_Mall_0"
    for name in (
        "tasks/ood_train/part-U_Mall_0.parquet", "tasks/part-U_Mall_0.parquet", "meshes/../U_Mall_0.glb",
        "/objects/part-U_Mall_0.parquet", "objects/part-U_Mall_0.parquet.py", "objects\\part-U_Mall_0.parquet",
        "objects/part-.parquet", "objects/part-a/b.parquet",
    ):  # fmt: skip
        assert scene_of(name) == "", name
