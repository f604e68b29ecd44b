"""From a recipe to a scene."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import numpy as np

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.scenes import layouts
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.cuts import cut_out
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.plans.build import build_plan, check_inventory, is_plan
from aerialdojo_gen.scenes.recipe import Imported, Recipe, load_imported, load_recipe, validated
from aerialdojo_gen.scenes.site import Site

# Layouts of versions before 0.2.0, and the commands that make plans instead.
_NOW_PLANS = {"town": "add-map", "relief": "add-terrain"}


def build_scene(recipe_path: Path, catalogue: Catalogue) -> Scene:
    """Build the scene of a recipe.

    Parameters
    ----------
    recipe_path : Path
        ``scene_assets/scenes/<scene>.toml``; the file's stem names the scene.
    catalogue : Catalogue
        Props and materials.

    Returns
    -------
    Scene
        Exact in float32, and the same for the same files on every run.

    Raises
    ------
    AssetError
        The recipe, its layout's parameters or its palette are wrong, the layout asks for something that the catalogue
        lacks, or the built scene has fewer instances of a category than `inventory` asks for.
    """
    imported = load_imported(recipe_path)
    if imported is not None:
        return _imported(recipe_path, imported)
    if is_plan(recipe_path):
        return build_plan(recipe_path, catalogue)
    recipe = load_recipe(recipe_path)
    layout = _layout(recipe, recipe_path)
    _check_names(recipe, recipe_path, catalogue)
    model = getattr(layout, "Parameters", None)
    parameters = None
    if model is not None:
        parameters = validated(model, recipe.parameters, f"{recipe_path}: parameters")
    elif recipe.parameters:
        key = next(iter(recipe.parameters))
        raise AssetError(
            f"{recipe_path}: parameters: unknown key {key!r}: layout {recipe.layout!r} has no parameters"
        )
    site = Site(recipe_path.stem, recipe, catalogue, parameters)
    try:
        layout.build(site)
    except AssetError as error:
        raise AssetError(f"{recipe_path}: layout {recipe.layout!r}: {error}") from error
    scene = site.scene()
    check_inventory(scene, recipe, recipe_path)
    return scene


def _imported(recipe_path: Path, imported: Imported) -> Scene:
    """Read the mesh that ``add-scene`` put beside the recipe; ceiling, sky, sun and boxes are the recipe's."""
    path = recipe_path.with_suffix(".glb")
    scene = read_glb(path)
    bounds = scene.bounds.copy()
    bounds[1, 2] = imported.ceiling_m
    sun = np.asarray(imported.sun) / np.linalg.norm(imported.sun)
    red, green, blue = (int(imported.sky[k : k + 2], 16) for k in (1, 3, 5))
    whole = Scene(
        recipe_path.stem, scene.instances, scene.materials, bounds, (red, green, blue),
        (float(sun[0]), float(sun[1]), float(sun[2])), imported=True, backdrop=scene.backdrop,
    )  # fmt: skip
    return cut_out(whole, imported.cuts) if imported.cuts else whole


def _layout(recipe: Recipe, path: Path) -> ModuleType:
    known = layouts.layout_modules()
    if recipe.layout in _NOW_PLANS:
        again = f"run {_NOW_PLANS[recipe.layout]} again, with --force"
        raise AssetError(f"{path}: scenes of real places are plans since version 0.2.0: {again}")
    if recipe.layout not in known:
        raise AssetError(f"{path}: unknown layout {recipe.layout!r}{nearest(recipe.layout, known)}")
    return importlib.import_module(f"{layouts.__name__}.{known[recipe.layout]}")


def _check_names(recipe: Recipe, path: Path, catalogue: Catalogue) -> None:
    for role, spec in recipe.palette.items():
        catalogue.materials.check(spec, f"{path}: palette {role}")
    for category in recipe.inventory:
        if category not in catalogue:
            raise AssetError(f"{path}: inventory: unknown category {category!r}{nearest(category, catalogue)}")
