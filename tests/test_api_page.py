"""docs/api.md: its blocks run, one after the other, on the smoke data; the package's names are there and cheap."""

import re
import shutil
import subprocess
import sys

import pytest
from support.plain_install import as_script, plain_site, run_plain

import aerialdojo_gen

HEAVY = ("cv2", "fcl", "gymnasium", "moderngl", "numba", "numpy", "pyarrow", "pybullet", "pydantic", "trimesh")


def blocks(project):
    text = (project / "docs/api.md").read_text(encoding="utf-8")
    return re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def test_the_blocks_of_the_page_run_as_they_stand(project, smoke, tmp_path):
    """In a process and a folder of their own, in which the data are, so that nothing is to be computed again."""
    shutil.copytree(smoke, tmp_path / "data-smoke")
    for name in ("pipelines", "scene_assets", "annotations"):
        (tmp_path / name).symlink_to(project / name)
    found = blocks(project)
    assert len(found) >= 9
    script = tmp_path / "page.py"
    # What the page only shows by its prints is held to something here.
    held = """
assert planned.outcome == "SOLVED"
assert abs(planned.length_m - route["length_m"]) < 1e-9
assert list(planned.actions) == route["action"]
assert (first.outcome, second.outcome) == ("SOLVED", "SOLVED") or second.outcome != ""
assert picture.shape[2] == 3 and shot.rgb.shape == (240, 320, 3)
assert set(tasks["split"]) == {"id_test"} and len(routes) > 100
assert summary.stage == "filter" and summary.computed == 0
assert len(recording) == recording.rgb["front"].__len__() > 1
assert observation["rgb"]["front"].shape == (64, 64, 3)
assert pipeline.filter.min_detour_ratio == 1.2
assert load_pipeline("mine.toml").filter == pipeline.filter
"""
    script.write_text(as_script("\n".join(found) + held))
    said = run_plain(plain_site(tmp_path / "packages"), script, tmp_path)
    assert "did you mean" in said or "the nearest is" in said


def test_the_page_names_all_that_is_public(project):
    text = (project / "docs/api.md").read_text(encoding="utf-8")
    for name in aerialdojo_gen.__all__:
        if name not in ("Release", "read_glb", "__version__"):
            assert f"`{name}`" in text or f"import {name}" in text, name


@pytest.mark.parametrize("name", [name for name in aerialdojo_gen.__all__ if name != "__version__"])
def test_public_names_are_loaded_when_asked_for(name):
    value = getattr(aerialdojo_gen, name)
    assert value.__name__ == name
    assert value.__doc__
    assert name in dir(aerialdojo_gen)


def test_there_is_no_other_name():
    with pytest.raises(AttributeError, match="no attribute 'open_relase'"):
        aerialdojo_gen.open_relase  # noqa: B018


def test_importing_the_package_and_asking_for_help_loads_nothing_heavy(project):
    code = "import sys, aerialdojo_gen, aerialdojo_gen.cli.app; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=project, capture_output=True, text=True, check=True)
    assert not {name.partition(".")[0] for name in done.stdout.split()} & set(HEAVY)
