"""The check that nothing hovers: what a scene holds touches the rest of it, and things rest on what is below them.

It is measured on the mesh alone, on its triangles and by FCL. A thing rests where its points that have something
within 5 cm below them, or are sunk into something, surround its middle: that of its feet, or that of its surface. One
that does not rest may hang, as signs do on walls: then it touches the rest, and has half a metre of air below.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import MESH_CHECKS, Floats, Ints, Rows, SceneData, place_text
from aerialdojo_gen.geometry.columns import ColumnIndex
from aerialdojo_gen.scenes.model import Instance, Scene

_AIR_M = 0.05  # a gap that the eye does not see
_FOOT_M = 0.03  # feet are so near to the lowest point
_HANGS_M = 0.5  # with less air below, a thing was meant to stand
_ASIDE_M = 0.1  # so far aside of what it rests on may its middle be


@check("scenes", needs=("mesh",), after=MESH_CHECKS)
def thing_hovers(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """Nothing hovers: all that is in a scene touches the rest of it, and its things rest on something or hang."""
    scene = data.mesh
    if scene.imported:
        return  # Its pieces are as its author cut them.
    apart, air = _apart(data), _Air(scene)
    for k, thing in enumerate(scene.instances):
        at = f"{thing.node} at {place_text(thing.centroid)}"
        if apart[k]:
            yield Finding(0, f"{at} touches nothing that stands", "contact within 0.05 m")
        elif thing.shape and (gap := air.under(k, thing)) > _AIR_M:
            yield Finding(0, f"{at} has {gap:.2f} m of air below", "support under its middle within 0.05 m")


def _apart(data: SceneData) -> list[bool]:
    """Whether each instance has no way from contact to contact to the widest one, which is the ground."""
    boxes = np.array([i.bounds for i in data.mesh.instances])
    low, high = boxes[:, 0] - _AIR_M, boxes[:, 1]
    close = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    group, world = np.arange(len(boxes)), data.world
    for a, b in zip(*np.nonzero(np.triu(close, 1)), strict=True):
        if group[a] != group[b] and world.within(int(a), int(b), _AIR_M):
            group[group == group[b]] = group[a]
    widest = int(np.argmax(np.prod(np.ptp(boxes[:, :, :2], axis=1), axis=1)))
    return [bool(own != group[widest]) for own in group]


class _Air:
    """Gaps below the things of a scene."""

    def __init__(self, scene: Scene) -> None:
        corners = np.concatenate([i.vertices[i.faces] for i in scene.instances])
        self._index = ColumnIndex.of(corners.reshape(-1, 9))
        counts = [len(i.faces) for i in scene.instances]
        self._owner = np.repeat(np.arange(len(counts)), counts)

    def under(self, k: int, thing: Instance) -> float:
        """Air below the side of a thing that nothing bears, metres; 0 where it rests or hangs."""
        triangles = thing.vertices[thing.faces]
        size = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
        middle = (triangles.mean(axis=1) * size[:, None]).sum(axis=0) / size.sum()
        feet = thing.vertices[_feet(thing.vertices)]
        middles = shapely.multipoints([feet[:, :2].mean(axis=0), middle[:2]])
        gaps = self._gaps(k, thing, feet, _HANGS_M)
        if _surround(feet[gaps <= _AIR_M], middles) or gaps.min() > _HANGS_M:
            return 0.0
        every = np.concatenate([np.unique(thing.vertices, axis=0), triangles.mean(axis=1)])
        if _surround(every[self._gaps(k, thing, every, float(np.ptp(thing.bounds[:, 2]))) <= _AIR_M], middles):
            return 0.0
        return float(gaps[np.isfinite(gaps)].max())

    def _gaps(self, k: int, thing: Instance, points: Floats, deep_m: float) -> Floats:
        # A hair inwards: points on the edge of what bears them have it below.
        inwards = points + (thing.centroid - points) * np.array([1e-3, 1e-3, 0.0])
        return self._index.gaps_m(inwards, k, self._owner, deep_m)


def _surround(points: Floats, middles: shapely.MultiPoint) -> bool:
    """Whether points seen from above surround one of two middles, or nearly so."""
    return len(points) > 0 and shapely.multipoints(points[:, :2]).convex_hull.distance(middles) <= _ASIDE_M


def _feet(vertices: Floats) -> Ints:
    """Indices of the outermost of a thing's lowest vertices, in sixteen directions."""
    low = np.flatnonzero(vertices[:, 2] <= vertices[:, 2].min() + _FOOT_M)
    turns = np.arange(16) * (math.pi / 8.0)
    reach = vertices[low, :1] * np.cos(turns) + vertices[low, 1:2] * np.sin(turns)
    return np.unique(low[np.argmax(reach, axis=0)])
