"""`show`: the picture and the page of a task tell what the release holds, and nothing in them calls outside."""

import dataclasses
import html as markup
import re
import shutil

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from support.browser import errors
from support.command_line import called

from aerialdojo_gen.base.errors import AssetError, StoreError, UsageError
from aerialdojo_gen.dataset.lookup import ReleasedScene, find_task
from aerialdojo_gen.geometry.motion import sampled
from aerialdojo_gen.scenes.context import release_scenes
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.studio.show.figure import render_page, write_png
from aerialdojo_gen.studio.show.pictured import picture_task

YARD = "U_Courtyard_0"


def test_samples_lie_on_the_way_closer_than_the_step():
    way = np.array([[0.0, 0, 0], [5, 0, 0], [5, 0, 2], [5, 0.3, 2]])
    points, segment = sampled(way, 0.5)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps.max() <= 0.5 + 1e-9
    assert steps.sum() == pytest.approx(7.3)
    for corner in way:
        assert np.abs(points - corner).sum(axis=1).min() < 1e-9
    assert segment.tolist() == [0] * 10 + [1] * 4 + [2, 2]
    assert sampled(way[:1])[0].tolist() == [[0, 0, 0]]


# ---- a task ----


@pytest.fixture(scope="module")
def ids(smoke):
    return ReleasedScene(smoke, YARD).routes["nav_id"].to_pylist()


@pytest.fixture(scope="module")
def pictured(smoke, ids):
    return picture_task(find_task(smoke, ids[0]), frames=2)


def test_a_picture_tells_the_release(smoke, ids, pictured):
    route = ReleasedScene(smoke, YARD).route(ids[0])
    facts = dict(pictured.facts)
    assert facts["length L"] == f"{route['length_m']:.2f} m"
    assert facts["detour κ = L / d_E"] == f"{route['detour_ratio']:.3f}"
    assert facts["actions"] == f"{len(route['action'])} of 90"
    assert sum(times for _, times in pictured.actions) == route["n_actions"]
    assert pictured.along_m[-1] == pytest.approx(route["length_m"], abs=1e-6)
    # FCL's certificate is the least over the whole way; samples every half metre miss at most a quarter of one.
    least = min(5.0, pictured.clearance_m.min())
    assert route["min_clearance_m"] - 2e-3 <= least <= route["min_clearance_m"] + 0.25
    # What lies below is never above the route, and never nearer than its clearance.
    drop = pictured.way[:, 2] - pictured.below_m
    assert (drop[np.isfinite(drop)] >= pictured.clearance_m[np.isfinite(drop)] - 1e-3).all()
    assert len(pictured.frames) == 2
    assert [frame.step for frame in pictured.frames] == [0, len(route["action"]) - 1]


def test_semantic_and_image_goals_read_as_the_agent_reads_them(smoke, ids, pictured):
    image = picture_task(find_task(smoke, f"{ids[0]}-i"), "image", frames=0)
    assert pictured.instance["task_id"] == f"{ids[0]}-s"
    assert image.instance["task_id"] == f"{ids[0]}-i"
    assert pictured.instance["description"] in pictured.goal
    assert pictured.instance["description"] not in image.goal
    assert "picture shows the target" in image.goal
    assert image.frames == []
    for shown in (pictured, image):
        assert shown.instance["landmark"] in shown.goal


@pytest.fixture
def copied(smoke, tmp_path):
    for folder in ("release", "meshes"):
        shutil.copytree(smoke / folder, tmp_path / folder)
    return tmp_path


def test_a_recording_is_shown_where_there_is_one(smoke, copied):
    recorded = store.read_scene(smoke, "recordings", YARD)["nav_id"].to_pylist()[0]
    from_file = picture_task(find_task(smoke, recorded), frames=3).frames
    assert [frame.recorded for frame in from_file] == [True] * 3
    rendered = picture_task(find_task(copied, recorded), frames=3).frames
    assert [frame.recorded for frame in rendered] == [False] * 3
    for a, b in zip(from_file, rendered, strict=True):
        assert (a.step, a.action) == (b.step, b.action)
        assert a.rgb.shape == b.rgb.shape == (320, 320, 3)
        assert np.abs(a.rgb.astype(int) - b.rgb).mean() < 6.0  # H.264, and half the resolution


def test_the_png_decodes_is_deterministic_and_knows_no_mathematics(pictured, tmp_path):
    # Another task: no frames, and a dollar.
    other = named(pictured, r"price board, $5 or $\frac{1}")
    paths = [write_png(task, tmp_path / f"{k}.png") for k, task in enumerate((pictured, pictured, other))]
    first, _, third = (cv2.imread(str(path)) for path in paths)
    assert first.shape[1] == third.shape[1] == 1680
    assert first.shape[0] > third.shape[0]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with pytest.raises(UsageError, match=r"a\.jpg: the output must be a PNG file, for example a\.png"):
        write_png(pictured, tmp_path / "a.jpg")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0.png", "1.png", "2.png"]


# ---- the page ----


@pytest.fixture(scope="module")
def page(pictured):
    return render_page(pictured)


def test_the_page_needs_nothing_from_outside(pictured, page):
    words = re.sub(r"data:image/(png|jpeg);base64,[A-Za-z0-9+/=]+", "", page)
    assert len(words) < 30_000
    assert not re.search(r"https?:|//|<script|<link|<iframe|@import|url\(", words, re.IGNORECASE)
    sources = re.findall(r'\b(?:src|href)="([^"]{0,40})', page)
    assert len(sources) == 3 + 1 + 2
    assert all(source.startswith(("data:image/png;base64,", "data:image/jpeg;base64,")) for source in sources)
    assert pictured.instance["description"] in markup.unescape(page)
    for k in range(len(pictured.poses)):
        assert f"<td>{k}</td>" in page


def named(pictured, name):
    """The task where everything has another name, without frames."""
    names = dict.fromkeys(("task_id", "target_name", "description", "landmark"), name)
    return dataclasses.replace(
        pictured, instance=pictured.instance | names, target=pictured.target | {"name": name, "category": name},
        landmark=pictured.landmark | {"name": name}, start_object=pictured.start_object | {"name": name}, frames=[],
    )  # fmt: skip


def test_names_in_the_page_are_escaped(pictured):
    evil = "</p><script>alert('x')</script>\"'><img src=x onerror=alert(1)> $\\frac{1}{0$\u202e"
    page = render_page(named(pictured, evil))
    assert "<script" not in page
    assert "\u202e" not in page
    assert "<img src=x" not in page
    assert page.count("&lt;script&gt;alert(&#39;x&#39;)&lt;/script&gt;") >= 5
    # The quote cannot end an attribute either.
    assert not re.search(r'alt="[^"]*"\'', page)


def test_the_page_opens_in_a_browser_without_a_network(browser, pictured, page, tmp_path):
    path = tmp_path / "task.html"
    path.write_text(page, encoding="utf-8")
    limits = {"latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
    browser.execute_cdp_cmd("Network.enable", {})
    try:
        browser.execute_cdp_cmd("Network.emulateNetworkConditions", {"offline": True, **limits})
        browser.get(path.as_uri())
    finally:
        browser.execute_cdp_cmd("Network.emulateNetworkConditions", {"offline": False, **limits})
    assert browser.title == f"{pictured.instance['task_id']}: {pictured.title}"
    images = browser.execute_script("return [...document.images].map((i) => [i.complete, i.naturalWidth, i.alt])")
    assert len(images) == 6
    assert all(complete and width >= 300 and alt for complete, width, alt in images)
    assert browser.execute_script("return document.querySelector('.goal').textContent") == pictured.goal
    # Nothing sticks out to the side.
    assert browser.execute_script("return document.documentElement.scrollWidth - innerWidth") <= 0
    assert errors(browser) == []


# ---- the command, and what can be wrong ----


def test_the_command_writes_what_it_is_asked_for(smoke, ids, tmp_path):
    done = called("show", ids[1], "--data", smoke, "--html", "a/task.html", "--frames", 0, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "a/task.html"
    assert "TARGET: " in done.stdout
    assert [str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()] == ["a/task.html"]


def test_an_unknown_id_gives_the_nearest(smoke, ids, tmp_path):
    wrong = ids[3][:-1] + ("0" if ids[3][-1] != "0" else "1")
    for task_id, why in (
        (f"{wrong}-s", f"no task '{wrong}-s' in the release of {YARD}: the nearest is {ids[3]}; tasks are listed by"),
        ("nonsense", rf"'nonsense' is no task id.*e\.g\. {min(ids)}-s.*read_parquet"),
        ("U_Courtyard_7-0123456789ab", "has no scene 'U_Courtyard_7': did you mean 'U_Courtyard_"),
        ("../../etc/passwd", "is no task id"),
    ):
        with pytest.raises(UsageError, match=why):
            find_task(smoke, task_id)
    with pytest.raises(StoreError, match=r"there is no release in .*: it has no folder release; name its"):
        find_task(tmp_path, ids[0])
    done = called("show", wrong, "--data", smoke, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith(f"error: no task '{wrong}'")
    assert list(tmp_path.iterdir()) == []


def test_a_route_without_an_instance_is_named(copied, ids):
    for side in ("train", "test"):
        tasks = store.read_scene(copied, f"tasks/{side}", YARD)
        kept = tasks.filter(pc.not_equal(tasks["nav_id"], ids[0]))
        store.write_shard(copied, f"tasks/{side}", YARD, 0, kept)
    with pytest.raises(StoreError, match=f"release/tasks has no instance of {ids[0]}"):
        find_task(copied, ids[0])
    find_task(copied, ids[1])


def test_another_mesh_or_none_is_refused(copied, ids):
    mesh = copied / "meshes" / f"{YARD}.glb"
    shutil.copy(copied / "meshes" / "U_Courtyard_1.glb", mesh)
    release_scenes()  # this process may still have the right one
    with pytest.raises(AssetError, match="is not the mesh that the tables were made from"):
        picture_task(find_task(copied, ids[0]), frames=0)
    mesh.unlink()
    release_scenes()
    with pytest.raises(AssetError, match=f"{YARD}.glb is missing: run aerialdojo-gen build-scenes --scene {YARD}"):
        picture_task(find_task(copied, ids[0]), frames=0)


def test_a_mesh_path_does_not_leave_the_data_directory(copied, ids, tmp_path_factory):
    outside = tmp_path_factory.mktemp("elsewhere")
    shutil.copy(copied / "meshes" / f"{YARD}.glb", outside / "outside.glb")
    (copied / "link").symlink_to(outside)
    for path in ("../outside.glb", "/etc/passwd", "meshes/../../outside.glb", "link/outside.glb"):
        table = store.read_scene(copied, "release/scenes", YARD)
        column = table.schema.get_field_index("mesh_path")
        store.write_shard(copied, "release/scenes", YARD, 0, table.set_column(column, "mesh_path", pa.array([path])))
        with pytest.raises(AssetError, match="points outside"):
            picture_task(find_task(copied, ids[0]), frames=0)
