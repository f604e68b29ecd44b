"""Classify the surfaces of a foreign mesh: closed, open, ground, or sky dome."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.ground import Ground
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.imports.naming import word_list, words_in
from aerialdojo_gen.imports.raw import RawNode
from aerialdojo_gen.scenes.catalogue import single
from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene

Floats = NDArray[np.float64]

# Category by which a naming table marks a sky dome.
SKY = "sky"
# Minimum ratio of a dome's size to its content: if named a sky, and if unnamed.
_WIDER_CALLED, _WIDER = 1.05, 1.5
_LARGE_M = 100.0
# A shell: this share of triangles keeps this relative distance from the centre of its box.
_HOLLOW, _SHELL = 0.4, 0.95
# Share of columns over the content that a dome must cover.
_ROOFED = 0.9
_GROUND = (122, 132, 108)


def find_domes(bodies: Sequence[RawNode], table_names: Sequence[str]) -> list[int]:
    """Find sky domes, largest first: large hollow shells that enclose everything else."""
    domes: list[int] = []
    low = np.array([b.vertices.min(axis=0) for b in bodies])
    high = np.array([b.vertices.max(axis=0) for b in bodies])
    for k in np.argsort(-np.prod(high - low, axis=1), kind="stable").tolist():
        rest = [j for j in range(len(bodies)) if j != k and j not in domes]
        if not rest:
            break
        words = [word for word in words_in(bodies[k].name) if word not in word_list("sky_perhaps")]
        sky = table_names[k] == SKY or (not table_names[k] and bool(word_list("sky") & set(words)))
        if (table_names[k] or words) and not sky:
            break
        inner_low, inner_high = low[rest].min(axis=0), high[rest].max(axis=0)
        wider = _WIDER_CALLED if sky else _WIDER
        size, inner = high[k] - low[k], inner_high - inner_low
        encloses = (low[k, :2] <= inner_low[:2] + 1e-6).all() and (high[k] >= inner_high - 1e-6).all()
        large = (size[:2] >= wider * inner[:2]).all() and (sky or size[:2].min() >= _LARGE_M)
        if not (encloses and large and _is_hollow(bodies[k])):
            break
        caster = TriangleRayCaster(bodies[k].vertices, bodies[k].faces.astype(np.int32))
        if _vertical_hits(caster, inner_low, inner_high, inner_high[2] - 1e-6, 1.0, 12) < _ROOFED:
            break
        domes.append(k)
    return domes


def _is_hollow(body: RawNode) -> bool:
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    centres = body.vertices[body.faces].mean(axis=1)
    middle, reach = (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
    # A hemisphere's centre is at its rim.
    foot, height = np.array([*middle[:2], low[2]]), np.array([*reach[:2], high[2] - low[2]])
    shares = [(np.abs((centres - m) / r).max(axis=1) >= _HOLLOW).mean() for m, r in ((middle, reach), (foot, height))]
    return bool(max(shares) > _SHELL)


def _vertical_hits(caster: TriangleRayCaster, low: Floats, high: Floats, z: float, way: float, n: int) -> float:
    """Share of n by n rays from a height, upwards or downwards, that hit something."""
    shares = (np.arange(n) + 0.5) / n
    x, y = np.meshgrid(*(low[:2, None] + (high - low)[:2, None] * shares), indexing="ij")
    origins = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z)])
    hit, _ = caster.first_hit(origins, np.tile([0.0, 0.0, way], (len(origins), 1)))
    return float(np.isfinite(hit).mean())


def classify_surfaces(scene: Scene, source_names: dict[str, str]) -> Scene:
    """Classify each open surface of an imported scene as ground or sheet."""
    unknown = replace(scene, instances=tuple(replace(i, surface="") for i in scene.instances))
    ground = Ground.of(unknown)
    nodes = frozenset() if ground is None else ground.nodes
    extent = np.ptp(scene.bounds, axis=0)[:2]

    def surface(instance: Instance) -> str:
        if instance.surface != "sheet":
            return instance.surface
        wide = bool((np.ptp(instance.bounds, axis=0)[:2] >= 0.2 * extent).all())
        named = wide and bool(word_list("ground") & set(words_in(source_names.get(instance.node, ""))))
        return "ground" if instance.node in nodes or named else "sheet"

    return replace(scene, instances=tuple(replace(i, surface=surface(i)) for i in scene.instances))


def describe_surfaces(scene: Scene) -> list[str]:
    """Describe the classification, one line each."""
    n = Counter(i.surface for i in scene.instances)
    lines = [
        f"surfaces: {n['solid']:,} closed, {n['sheet']:,} open (there from both sides), {n['ground']:,} open ground"
    ]
    if n["ground"]:
        names = [i.node for i in scene.instances if i.surface == "ground"]
        more = f" and {len(names) - 3:,} more" if len(names) > 3 else ""
        lines.append(f"closed to flight below the open ground: {', '.join(names[:3])}{more}")
    if scene.backdrop:
        names = [i.node for i in scene.backdrop]
        lines.append(f"{', '.join(names)}: drawn as the sky, without collisions, never a target")
    return lines


def ground_cover(instances: Sequence[Instance], low: Floats, high: Floats) -> float:
    """Share of a grid of vertical rays that hit the mesh."""
    return _vertical_hits(TriangleRayCaster(*soup(instances)), low, high, high[2] + 1.0, -1.0, 24)


def ground_plane(low: Floats, high: Floats, margin_m: float, materials: dict[str, Material]) -> Instance:
    """Make a level ground plane just below a box, with a margin around it."""
    (x0, y0), (x1, y1) = low[:2] - margin_m, high[:2] + margin_m
    spec = "#{:02x}{:02x}{:02x}".format(*_GROUND)
    materials.setdefault(spec, Material(spec, _GROUND))
    # Just below the lowest point, where the mesh may have a floor.
    z = low[2] - 0.02
    vertices = single(np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]))
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    part = Part(vertices, faces, np.zeros((4, 2), dtype=np.float32), spec)
    return Instance("ground", "ground", "", {}, (part,), surface="sheet")
