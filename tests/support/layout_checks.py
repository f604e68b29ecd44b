"""What the tests of layouts share: scenes by name, and looks at them from close by."""

from collections import Counter
from collections.abc import Collection, Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh

from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes.catalogue import Catalogue, load_catalogue
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.scenes.site import footprint

ASSETS = Path(__file__).parents[2] / "scene_assets"
# Scenes that `make test` builds, two of each family; `make nightly` builds all 42.
DAILY = {
    "D_Flood_0", "D_Flood_1", "I_Harbor_0", "I_Bridge_1", "N_Mountain_0", "N_Forest_0", "U_Mall_0", "U_Stadium_0",
}  # fmt: skip


def nightly_unless(daily: bool, value: str) -> object:
    """Make a parameter of a test, with the mark `nightly` unless it is for every day."""
    return pytest.param(value, marks=[] if daily else pytest.mark.nightly)


def each_scene(names: Iterable[str]) -> pytest.MarkDecorator:
    """Parametrize a test by `name` with scenes, those not in `DAILY` nightly."""
    return pytest.mark.parametrize("name", [nightly_unless(name in DAILY, name) for name in names])


@cache
def catalogue() -> Catalogue:
    return load_catalogue(ASSETS)


def recipe_of(name: str) -> Path:
    """A recipe waits among the drafts until its scene is annotated."""
    return next(p for folder in ("scenes", "drafts") if (p := ASSETS / folder / f"{name}.toml").exists())


def props_of(scene: Scene) -> list[Instance]:
    return [i for i in scene.instances if i.category in catalogue()]


def kinds_of(scene: Scene) -> Counter[str]:
    return Counter(catalogue()[i.category].kind for i in props_of(scene))


def looks_of(scene: Scene) -> set[tuple[str, str]]:
    """What drafts may tell apart: categories and variants of targets, plants left out."""
    known, targets = catalogue(), set(catalogue().targets)
    return {
        (i.category, i.variant)
        for i in props_of(scene)
        if i.category in targets and known[i.category].kind not in ("landmark", "vegetation")
    }


def floating(
    scene: Scene, hung: Collection[str] = (), reach_m: float = 0.9, bearers: Collection[str] = ()
) -> list[str]:
    """List the props that nothing bears: no surface of structure or ground under their feet.

    A prop may reach up to `reach_m` into what it stands on; those of the categories `hung` hang on walls, those of
    the categories `bearers` (ships, say) bear others.
    """
    structure = tuple(i for i in scene.instances if i.category not in catalogue() or i.category in bearers)
    cast = RayCaster(Scene(scene.name, structure, scene.materials, scene.bounds))
    out = []
    for prop in props_of(scene):
        if prop.category in hung:
            continue
        bottom = float(prop.bounds[0, 2])
        low = prop.vertices[prop.vertices[:, 2] < bottom + 0.25]
        feet = np.array([low[:, :2].mean(axis=0), *low[:: max(len(low) // 8, 1), :2]])
        heights = bottom + np.arange(0.05, reach_m, 0.15)
        origins = np.array([(x, y, z) for x, y in feet for z in heights])
        distance, _ = cast.first_hit(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)))
        if not (origins[:, 2] - distance > bottom - 0.12).any():
            out.append(prop.node)
    return out


def clashes(scene: Scene, share: float = 0.2, bearers: Collection[str] = ()) -> list[tuple[str, str]]:
    """List the pairs of props that stand in one another; those of `bearers` may have others on them."""
    props = props_of(scene)
    outlines = [footprint(p, float(p.bounds[0, 2])) for p in props]
    tree = shapely.STRtree(outlines)
    out = []
    for a, b in zip(*tree.query(outlines, predicate="intersects"), strict=True):
        low = max(props[a].bounds[0, 2], props[b].bounds[0, 2])
        high = min(props[a].bounds[1, 2], props[b].bounds[1, 2])
        if a < b and high - low > 0.2 and not {props[a].category, props[b].category} & set(bearers):
            shared = outlines[a].intersection(outlines[b]).area
            if shared > share * min(outlines[a].area, outlines[b].area):
                out.append((props[a].node, props[b].node))
    return out


def walled_in(scene: Scene, structure: Collection[str]) -> list[str]:
    """List the props whose top lies inside closed structure of these categories: an odd number of faces above it."""
    solids = [trimesh.Trimesh(i.vertices, i.faces, process=False) for i in scene.instances if i.category in structure]
    props = [i for i in props_of(scene) if catalogue()[i.category].kind != "building"]
    above = np.array([[*p.centroid[:2], p.bounds[1, 2] + 0.05] for p in props])
    out: list[str] = []
    for solid in solids:
        low, high = solid.bounds
        for k in np.flatnonzero(((above > low) & (above < high)).all(axis=1)):
            hits = solid.ray.intersects_location([above[k]], [[0.0, 0.0, 1.0]], multiple_hits=True)[0]
            if len(hits) % 2:
                out.append(props[int(k)].node)
    return out
