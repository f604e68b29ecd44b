"""The start page's data: scenes and tasks of a release, by filters and words, and their pictures."""

from urllib.request import urlopen

import cv2
import numpy as np
import pytest
from starlette.testclient import TestClient
from support.viewing import YARD

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.dataset.release import open_release
from aerialdojo_gen.studio.view.server import view_app
from aerialdojo_gen.studio.view.tasks import TaskList


@pytest.fixture(scope="module")
def client(smoke):
    return TestClient(view_app(smoke), base_url="http://127.0.0.1")


@pytest.fixture(scope="module")
def release(smoke):
    return open_release(smoke)


def asked(client, **query):
    answer = client.get("/api/tasks", params=query)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_the_scenes_are_the_releases(client, release):
    told = client.get("/api/release").json()
    assert [scene["scene"] for scene in told["scenes"]] == release.scenes
    assert len(release.scenes) >= 2
    for scene in told["scenes"]:
        name = scene["scene"]
        assert scene["n_routes"] == release.routes(scene=name).num_rows
        assert scene["n_objects"] == release.objects(scene=name).num_rows
        page = client.get(f"/scenes/{name}/")
        assert page.headers["content-type"].startswith("text/html")
        assert client.get(f"/scenes/{name}/api/index").json()["scene"]["scene"] == name


def test_tasks_are_found_by_filters(client, release):
    routes = release.routes().to_pylist()
    every = asked(client, most=200)
    assert every["total"] == len(routes)
    pages = [asked(client, offset=at, most=200)["tasks"] for at in range(0, len(routes), 200)]
    assert sorted(task["nav_id"] for page in pages for task in page) == sorted(route["nav_id"] for route in routes)
    objects = {(row["scene"], row["object_id"]): row for row in release.objects().to_pylist()}
    by_id = {route["nav_id"]: route for route in routes}
    for task in every["tasks"]:
        route = by_id[task["nav_id"]]
        target = objects[route["scene"], route["target_object_id"]]
        assert {task[key] for key in ("name", "description", "direction")} == {
            target[key] for key in ("name", "description", "direction")
        }
        assert (task["scene"], task["setting"], task["split"]) == (route["scene"], route["setting"], route["split"])
        assert task["length_m"] == pytest.approx(route["length_m"], abs=1e-3)
    for choice in (
        {"split": "id_test"},
        {"setting": "standard"},
        {"scene": YARD},
        {"scene": YARD, "setting": "base"},
    ):
        wanted = [r for r in routes if all(r[key] == value for key, value in choice.items())]
        assert 0 < len(wanted) <= len(routes)
        assert asked(client, **choice)["total"] == len(wanted), choice
    lengths = [task["length_m"] for task in asked(client, order="length_m", descending=True, most=200)["tasks"]]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] == pytest.approx(max(r["length_m"] for r in routes), abs=1e-3)


def test_tasks_are_found_by_words_in_any_order_and_by_id(client, release):
    routes = release.routes(scene=YARD).to_pylist()
    objects = {row["object_id"]: row for row in release.objects(scene=YARD).to_pylist()}
    target = objects[routes[0]["target_object_id"]]
    words = target["name"].upper().split()
    found = asked(client, scene=YARD, words=" ".join(reversed(words)), most=200)
    assert found["total"] >= sum(r["target_object_id"] == target["object_id"] for r in routes) > 0
    for task in found["tasks"]:
        text = " ".join(str(task[key]) for key in ("name", "category", "description", "landmark")).lower()
        assert all(word.lower() in text.replace("_", " ") for word in words)
    assert asked(client, words="no such thing anywhere")["total"] == 0
    for suffix in ("", "-s", "-i"):
        one = asked(client, words=routes[0]["nav_id"] + suffix)
        assert [task["nav_id"] for task in one["tasks"]] == [routes[0]["nav_id"]]


def test_pictures_are_those_of_the_release(view_url, client, release):
    row = release.objects(scene=YARD).to_pylist()[0]
    whole = cv2.imdecode(np.frombuffer(row["reference_image"], np.uint8), cv2.IMREAD_COLOR)
    answer = client.get(f"/scenes/{YARD}/api/objects/{row['object_id']}/thumb")
    small = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
    assert max(small.shape) <= 224
    assert len(answer.content) < len(row["reference_image"]) / 2
    wanted = cv2.resize(whole, small.shape[1::-1], interpolation=cv2.INTER_AREA).astype(float)
    assert np.abs(small - wanted).mean() < 6
    # By a process of its own: a renderer of this one would outlive the test, in a thread of the server.
    pictures = [urlopen(f"{view_url}scenes/{name}/picture").read() for name in release.scenes[:2]]
    assert all(
        len(np.unique(cv2.imdecode(np.frombuffer(p, np.uint8), 1).reshape(-1, 3), axis=0)) > 500 for p in pictures
    )
    assert pictures[0] != pictures[1]


def test_what_is_not_there_is_refused(client, smoke):
    for path in ("/scenes/U_Nowhere_0/", "/scenes/U_Nowhere_0/picture", f"/scenes/{YARD}/api/objects/9999/thumb"):
        answer = client.get(path)
        assert answer.status_code == 404
        assert "U_Nowhere_0" in answer.json()["error"] or "9999" in answer.json()["error"]
    assert client.get("/api/tasks", params={"order": "x"}).status_code == 404
    assert client.get("/api/tasks", params={"scene": "U_Nowhere_0"}).status_code == 404
    assert client.get("/api/tasks", params={"offset": -1}).status_code == 422
    # Of several scenes those alone that are shown.
    one = TestClient(view_app(smoke, YARD), base_url="http://127.0.0.1")
    assert [scene["scene"] for scene in one.get("/api/release").json()["scenes"]] == [YARD]
    assert {task["scene"] for task in asked(one, most=200)["tasks"]} == {YARD}
    other = next(name for name in open_release(smoke).scenes if name != YARD)
    assert one.get(f"/scenes/{other}/api/index").status_code == 404
    with pytest.raises(UsageError, match="tasks are ordered by nav_id, length_m"):
        TaskList(open_release(smoke), [YARD]).find([], order="x")
