"""`build-scenes --watch`: the page follows the plan's file."""

import json
import os
import urllib.request

import pytest
from selenium.webdriver import ActionChains
from support.browser import errors, until
from support.pages import serving

PLAN = """\
plan = 1
size_m = [30, 30]
ceiling_m = 12

[[site]]
paint = [-4, -4, 4, 4]
material = "gravel"

[[site]]
place = [["bench", 0, 0, 90], ["tractor", 8, 8]]
"""


@pytest.fixture(scope="module")
def watched(tmp_path_factory):
    """The command's address, and the plan that it watches."""
    plan = tmp_path_factory.mktemp("watched") / "U_Yard_0.toml"
    plan.write_text(PLAN)
    with serving("build-scenes", "--watch", plan) as page:
        yield page.url, plan


def read(url):
    with urllib.request.urlopen(url, timeout=60) as answer:
        return answer.read()


def save(plan, text):
    """As editors do: another file takes its place."""
    other = plan.with_suffix(".new")
    other.write_text(text)
    os.replace(other, plan)


def test_a_saved_plan_is_built_again_and_a_broken_one_keeps_the_last_scene(watched):
    url, plan = watched
    save(plan, PLAN)
    first = json.loads(read(f"{url}api/state"))
    assert (first["error"], first["n_instances"], first["name"]) == ("", 3, "U_Yard_0")
    assert first["entries"] == {node: {"entry": "site[1]", "line": 9} for node in ("bench_000", "tractor_000")}
    payload = read(f"{url}api/scene")
    assert json.loads(read(f"{url}api/state")) == first
    save(plan, PLAN.replace("bench", "bensh"))
    broken = json.loads(read(f"{url}api/state"))
    assert "site[1] (place): unknown category 'bensh': did you mean 'bench'?" in broken["error"]
    assert broken["n_instances"] == 3
    assert read(f"{url}api/scene") == payload
    save(plan, PLAN + '[[site]]\nentries = [\n  { place = [["mailbox", -8, 8]] },\n]\n')
    mended = json.loads(read(f"{url}api/state"))
    assert (mended["error"], mended["n_instances"]) == ("", 4)
    assert mended["entries"]["mailbox_000"] == {"entry": "site[2].entries[0]", "line": 13}
    assert read(f"{url}api/scene") != payload
    plan.unlink()
    assert "U_Yard_0.toml" in json.loads(read(f"{url}api/state"))["error"]


def test_the_page_shows_the_scene_again_with_the_same_camera(browser, watched):
    (url, plan), driver = watched, browser
    save(plan, PLAN)
    driver.get(url)

    def version():
        return driver.execute_script("return document.body.dataset.version")

    first = int(until("the scene is there", version))
    driver.execute_script("view.controls.lookFrom([3, -9, 4], [0, 0, 1])")
    save(plan, PLAN.replace("bench", "bensh"))
    until("the error is shown", lambda: "bensh" in driver.find_element("id", "error").text)
    save(plan, PLAN + '[[site]]\nplace = [["mailbox", 0, -3]]\n')
    until("the scene is there again", lambda: version() == str(first + 2))
    assert not driver.find_element("id", "error").is_displayed()
    assert driver.execute_script("return view.camera.position.toArray()") == pytest.approx([3, -9, 4], abs=1e-6)
    assert driver.execute_script("return view.index.has('mailbox_000')")
    driver.execute_script("view.controls.lookFrom([8, 3, 2], [8, 8, 0.8])")
    canvas = driver.find_element("css selector", "canvas")
    ActionChains(driver).move_to_element(canvas).click().perform()
    until("the tractor's entry is shown", lambda: "site[1], line 9" in driver.find_element("id", "picked").text)
    assert errors(driver) == []
