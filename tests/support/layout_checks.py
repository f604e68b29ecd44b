"""What the tests of layouts share: scenes by name, and looks at them from close by."""

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes import checks
from aerialdojo_gen.scenes.catalogue import Catalogue, load_catalogue
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.scenes.recipe import SceneHead
from aerialdojo_gen.scenes.site import Site

ASSETS = Path(__file__).parents[2] / "scene_assets"
# Scenes that `make test` builds, and one that it builds as on another processor, by turns from day to day; `make
# nightly` builds all 42.
DAILY, ELSEWHERE = (
    ({"D_Flood_0", "D_Flood_1", "N_Mountain_0"}, ""), ({"I_Harbor_0", "U_Mall_0"}, ""),
    ({"U_Stadium_0"}, "N_Mountain_0"), ({"I_Bridge_1", "N_Forest_0"}, "U_Mall_0"),
)[int(os.environ["SAMPLE_SEED"]) % 4]  # fmt: skip


def nightly_unless(daily: bool, value: str) -> object:
    """Make a parameter of a test, with the mark `nightly` unless it is for every day."""
    return pytest.param(value, marks=[] if daily else pytest.mark.nightly)


def drawn(values: Collection[str], n: int) -> list[object]:
    """Make parameters of a test: `n` for a day, drawn by `SAMPLE_SEED`, and all others nightly."""
    daily = generator(int(os.environ["SAMPLE_SEED"]), "sample").permutation(len(values))[:n]
    return [nightly_unless(k in daily, value) for k, value in enumerate(values)]


def each_scene(names: Iterable[str]) -> pytest.MarkDecorator:
    """Parametrize a test by `name` with scenes, those not in `DAILY` nightly."""
    return pytest.mark.parametrize("name", [nightly_unless(name in DAILY, name) for name in names])


def built_elsewhere(name: str, folder: Path, environment: Mapping[str, str]) -> bytes:
    """Build a scene in a process of its own, and return its GLB's bytes."""
    code = (
        "import sys; from pathlib import Path\n"
        "from aerialdojo_gen.scenes.build import build_scene\n"
        "from aerialdojo_gen.scenes.catalogue import load_catalogue\n"
        "from aerialdojo_gen.scenes.glb import write_glb\n"
        "assets, name, out = Path(sys.argv[1]), *sys.argv[2:]\n"
        "write_glb(build_scene(assets / 'scenes' / f'{name}.toml', load_catalogue(assets)), Path(out))\n"
    )
    path = folder / f"{name}.glb"
    subprocess.run([sys.executable, "-c", code, ASSETS, name, path], env=os.environ | environment, check=True)
    return path.read_bytes()


@cache
def catalogue() -> Catalogue:
    return load_catalogue(ASSETS)


def blank_site(name: str, size_m: float = 60.0, ceiling_m: float = 20.0, seed: int = 0) -> Site:
    """A square site on level ground, with the catalogue that ships."""
    return Site(name, SceneHead(seed=seed, size_m=(size_m, size_m), ceiling_m=ceiling_m), catalogue())


def distances(scene: Scene, origins: ArrayLike, way: ArrayLike) -> NDArray[np.float64]:
    """How far rays from points fly in one direction before they hit something; infinite where they do not."""
    points = np.asarray(origins, dtype=np.float64)
    return RayCaster(scene).first_hit(points, np.tile(np.asarray(way, dtype=np.float64), (len(points), 1)))[0]


def is_seamless(image: NDArray[np.generic]) -> bool:
    """Whether the step over a texture's border is no larger than the largest inside it, along both axes."""
    grey = image.astype(float).mean(axis=2)
    steps = [np.abs(np.roll(grey, -1, axis=axis) - grey).mean(axis=1 - axis) for axis in (0, 1)]
    return all(along[-1] <= along[:-1].max() * 1.05 + 1.0 for along in steps)


def recipe_of(name: str) -> Path:
    """A recipe waits among the drafts until its scene is annotated."""
    return next(p for folder in ("scenes", "drafts") if (p := ASSETS / folder / f"{name}.toml").exists())


def props_of(scene: Scene) -> list[Instance]:
    return checks.props_of(scene, catalogue())


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
    return checks.floating(scene, catalogue(), hung, reach_m, bearers)


def clashes(scene: Scene, share: float = 0.2, bearers: Collection[str] = ()) -> list[tuple[str, str]]:
    return checks.clashes(scene, catalogue(), share, bearers)


def touching(things: Iterable[Instance]) -> set[tuple[str, str]]:
    """Pairs of things whose meshes run into one another."""
    manager = trimesh.collision.CollisionManager()
    for thing in things:
        manager.add_object(thing.node, trimesh.Trimesh(thing.vertices, thing.faces, process=False))
    return set(manager.in_collision_internal(return_names=True)[1])


def walled_in(scene: Scene, structure: Collection[str]) -> list[str]:
    """List the props whose top lies inside closed structure of these categories: an odd number of faces above it."""
    solids = [trimesh.Trimesh(i.vertices, i.faces, process=False) for i in scene.instances if i.category in structure]
    props = [i for i in checks.props_of(scene, catalogue()) if catalogue()[i.category].kind != "building"]
    above = np.array([[*p.centroid[:2], p.bounds[1, 2] + 0.05] for p in props])
    out: list[str] = []
    for solid in solids:
        low, high = solid.bounds
        for k in np.flatnonzero(((above > low) & (above < high)).all(axis=1)):
            hits = solid.ray.intersects_location([above[k]], [[0.0, 0.0, 1.0]], multiple_hits=True)[0]
            if len(hits) % 2:
                out.append(props[int(k)].node)
    return out
