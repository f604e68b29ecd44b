"""From a scene's file to a scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.portable import unit
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.cuts import cut_out
from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.materials import read_toml
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.plans.build import build_tables
from aerialdojo_gen.scenes.recipe import Imported, imported_of

# Files of versions before 0.2.0, by what they gave as their layout, and the commands that make plans instead.
_NOW_PLANS = {"town": "add-map", "relief": "add-terrain"}


def build_scene(path: Path, catalogue: Catalogue) -> Scene:
    """Build the scene of a file: of a plan, or of a mesh that ``add-scene`` imported.

    Parameters
    ----------
    path : Path
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
        The file is wrong, names something that the catalogue or the kit lacks, or the built scene has fewer instances
        of a category than `inventory` asks for.
    """
    body = read_toml(path)
    imported = imported_of(path, body)
    if imported is not None:
        return _imported(path, imported)
    layout = body.get("layout")
    if layout is not None:
        rebuild = _NOW_PLANS.get(layout) if isinstance(layout, str) else None
        advice = f"run {rebuild} again, with --force" if rebuild else "docs/plans.md has the format"
        raise AssetError(f"{path}: scenes are plans since version 0.2.0, without 'layout': {advice}")
    return build_tables(path.stem, body, catalogue, where=str(path), folder=path.parent)


def _imported(path: Path, imported: Imported) -> Scene:
    """Read the mesh that ``add-scene`` put beside the file; ceiling, sky, sun and boxes are the file's."""
    scene = read_glb(path.with_suffix(".glb"))
    bounds = scene.bounds.copy()
    bounds[1, 2] = imported.ceiling_m
    sun = unit(np.array(imported.sun))
    red, green, blue = (int(imported.sky[k : k + 2], 16) for k in (1, 3, 5))
    whole = Scene(
        path.stem, scene.instances, scene.materials, bounds, (red, green, blue),
        (float(sun[0]), float(sun[1]), float(sun[2])), imported=True, backdrop=scene.backdrop,
    )  # fmt: skip
    return cut_out(whole, imported.cuts) if imported.cuts else whole
