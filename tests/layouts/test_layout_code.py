"""Layouts are found by their folders, and a scene is as fresh as the code of its own layout."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import aerialdojo_gen
from aerialdojo_gen.pipeline import fingerprint
from aerialdojo_gen.pipeline.code_digest import _is_cut, stage_code
from aerialdojo_gen.pipeline.registry import BY_NAME
from aerialdojo_gen.pipeline.stage import ProjectPaths
from aerialdojo_gen.scenes import layouts
from aerialdojo_gen.scenes.plans.build import is_plan
from aerialdojo_gen.scenes.recipe import load_recipe

SOURCES = Path(aerialdojo_gen.__file__).parent
PROJECT = SOURCES.parent
ASSETS = PROJECT / "scene_assets"
FILES = sorted([*ASSETS.glob("scenes/*.toml"), *ASSETS.glob("smoke/*.toml")])
RECIPES = [path for path in FILES if not is_plan(path)]
BUILD = BY_NAME["build-scenes"]
# It calls the layouts, and belongs to none.
ENGINE = "aerialdojo_gen.scenes.layouts.build"


def roots_of(recipe):
    return ProjectPaths(PROJECT / "data", ASSETS, recipe.parent, PROJECT / "annotations")


def chosen(recipe):
    return BUILD.imports(roots_of(recipe), recipe.stem)


def test_every_type_is_found_and_used_and_every_module_belongs_to_one():
    found = layouts.layout_modules()
    assert set(found) == {load_recipe(recipe).layout for recipe in RECIPES}
    for module in found.values():
        assert callable(importlib.import_module(f"aerialdojo_gen.scenes.layouts.{module}").build)


def test_what_one_type_alone_uses_lies_in_its_folder_and_what_several_share_in_parts():
    users: dict[str, set[str]] = {}
    for recipe in RECIPES:
        home = chosen(recipe)[0].removesuffix(".layout")
        for part in fingerprint.scene_code(BUILD, roots_of(recipe), recipe.stem).parts:
            path = SOURCES.joinpath(*part.split(".")[1:]).with_suffix(".py")
            if part.startswith("aerialdojo_gen.scenes.layouts.") and part != ENGINE and path.is_file():
                users.setdefault(part, set()).add(home)
    for module, homes in users.items():
        families = {home.rpartition(".")[0] for home in homes}
        place = "aerialdojo_gen.scenes.kit" if len(families) > 1 else f"{min(families)}.parts"
        assert module.rpartition(".")[0] == (min(homes) if len(homes) == 1 else place), (module, sorted(homes))


def test_a_name_that_stands_twice_is_refused(tmp_path, monkeypatch):
    for family in ("elsewhere", "places"):
        one = tmp_path / family / "town" / "layout.py"
        one.parent.mkdir(parents=True)
        one.write_text("")
    monkeypatch.setattr(layouts, "__path__", [*layouts.__path__, str(tmp_path)])
    with pytest.raises(RuntimeError, match="'town' stands twice: "):
        layouts.layout_modules()


def test_what_a_process_imports_to_build_a_type_is_what_counts():
    """Seen from outside: what is loaded of this package, against what the digest says is."""
    one_a_type = {load_recipe(recipe).layout: recipe for recipe in RECIPES}
    script = (
        "import sys\n"
        "from pathlib import Path\n"
        "from aerialdojo_gen.scenes.layouts.build import _layout\n"
        "from aerialdojo_gen.scenes.recipe import load_recipe\n"
        "before = set(sys.modules)\n"
        "for path in map(Path, sys.argv[1:]):\n"
        "    for name in [name for name in set(sys.modules) - before if name.startswith('aerialdojo_gen.')]:\n"
        "        del sys.modules[name]\n"
        "    _layout(load_recipe(path), path)\n"
        "    print(*(name for name in sys.modules if name.startswith('aerialdojo_gen')))\n"
    )
    command = [sys.executable, "-c", script, *map(str, one_a_type.values())]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    lines = run.stdout.splitlines()
    for (layout, recipe), line in zip(one_a_type.items(), lines, strict=True):
        loaded = {name for name in line.split() if not _is_cut(name)}
        parts = set(fingerprint.scene_code(BUILD, roots_of(recipe), recipe.stem).parts)
        assert f"aerialdojo_gen.scenes.layouts.{layouts.layout_modules()[layout]}" in loaded
        counted = {name for name in parts if ".layouts" in name}
        assert {name for name in loaded if ".layouts" in name} - {ENGINE} == counted - {ENGINE}
        assert loaded <= parts


def test_a_recipe_that_is_wrong_counts_all_layouts_and_an_imported_scene_none(tmp_path):
    roots = ProjectPaths(tmp_path, ASSETS, tmp_path, tmp_path)

    def parts(text):
        (tmp_path / "Place.toml").write_text(text)
        found = fingerprint.scene_code(BUILD, roots, "Place").parts
        return {name for name in found if name.startswith("aerialdojo_gen.scenes.layouts.")}

    whole = {name for name in stage_code("build-scenes").parts if name.startswith("aerialdojo_gen.scenes.layouts.")}
    assert len(whole) > len(layouts.layout_modules())
    for text in ('layout = "mal"', "layout = [1]", "layout = ", "seed = 3"):
        assert parts(text) == whole
    assert parts('[imported]\nsource = "x.glb"') == {ENGINE}
    assert BUILD.imports(roots, "Nowhere") is None
