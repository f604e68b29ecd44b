"""The horizon of a scene: one node of few triangles, which is drawn behind the scene and never touched."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.rng import generator, rank
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes.catalogue import placed, single
from aerialdojo_gen.scenes.horizon.border import border_of
from aerialdojo_gen.scenes.horizon.kinds import kind_of
from aerialdojo_gen.scenes.horizon.land import Land, Noise, make_land
from aerialdojo_gen.scenes.horizon.scenery import SceneryItem, scatter_scenery
from aerialdojo_gen.scenes.materials import MaterialLibrary
from aerialdojo_gen.scenes.mesh import to_part
from aerialdojo_gen.scenes.model import HORIZON, Instance, Part
from aerialdojo_gen.scenes.recipe import HorizonHead

MAX_TRIANGLES = 15_000
_PLAIN = "#8a8f7c"
# How much higher than the flight volume the land's end is, metres.
_ABOVE_M = 15.0


def make_horizon(
    scene: str, head: HorizonHead, ground: Instance, above: Iterable[Instance], bounds: NDArray[np.float64],
    materials: MaterialLibrary,
) -> tuple[Instance, ...]:  # fmt: skip
    """Build the horizon of a scene from the edge of its ground and water; empty where the plan wants none."""
    kind = kind_of(scene, head)
    border = border_of(ground, bounds, above)
    if kind is None or not border:
        return ()
    noise, rng = Noise(head.seed, scene), generator(head.seed, "horizon-things", scene)
    land = make_land(border, kind, float(bounds[1, 2]) + _ABOVE_M, noise)
    scenery = scatter_scenery(land, kind, bounds, noise, rng, MAX_TRIANGLES - len(land.faces))
    parts = _merged([*_land_parts(land, materials), *_scenery_parts(scene, scenery, materials)])
    return (Instance(HORIZON, HORIZON, "", {}, parts, surface=HORIZON),)


def _land_parts(land: Land, materials: MaterialLibrary) -> Iterable[Part]:
    names = np.array([_resolve_material(name, materials) for name in land.material])
    for name in sorted(set(names.tolist())):
        used, faces = np.unique(land.faces[names == name], return_inverse=True)
        vertices = single(land.vertices[used])
        uv = (vertices[:, :2] / materials.tile_m(name)).astype(np.float32)
        yield Part(vertices, faces.reshape(-1, 3).astype(np.int32), uv, name)


def _scenery_parts(scene: str, scenery: Iterable[SceneryItem], materials: MaterialLibrary) -> Iterable[Part]:
    for k, (bodies, at, turn) in enumerate(scenery):
        # Two layouts of each façade: what is far away is worth no more pictures.
        draw = rank(0, "horizon-facade", scene, k % 2)
        named = [(materials.laid_out(_resolve_material(name, materials), draw), body) for name, body in bodies]
        parts = [to_part(body, name, materials.tile_m(name)) for name, body in named]
        yield from placed(parts, tuple(at), float(np.degrees(turn)))


def _resolve_material(spec: str, materials: MaterialLibrary) -> str:
    """Give a material, or its colour alone where the catalogue has no such surface."""
    name, _, colour = spec.partition(":")
    return spec if spec.startswith("#") or name in materials.names else colour or _PLAIN


def _merged(parts: Sequence[Part]) -> tuple[Part, ...]:
    """Join the parts of each material."""
    by_material: dict[str, list[Part]] = {}
    for part in parts:
        by_material.setdefault(part.material, []).append(part)
    return tuple(
        Part(*soup(some), np.concatenate([p.uv for p in some]), material) for material, some in by_material.items()
    )
