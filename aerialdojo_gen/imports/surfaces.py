"""What the surfaces of a foreign mesh are: closed, open, the ground, or a sky that encloses everything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.ground import Ground
from aerialdojo_gen.imports.naming import words_in
from aerialdojo_gen.imports.raw import RawNode
from aerialdojo_gen.scenes.model import Instance, Scene

Floats = NDArray[np.float64]

# The category by which a table of names says of a node that it is a dome.
SKY = "sky"
_SKY_WORDS = frozenset({"sky", "skybox", "skydome", "skysphere", "hdri", "panorama", "backdrop", "horizon", "env"})
# What a sky may be called, and other things too: its form has to tell.
_SKY_PERHAPS = frozenset({"dome", "hemisphere", "background", "environment", "backside", "bg"})
_GROUND_WORDS = frozenset(
    {"terrain", "ground", "landscape", "relief", "dem", "dtm", "topography", "heightfield", "heightmap", "earth"}
)
# By so much a dome is larger in plan than what it encloses: one that is called a sky, and one that is called nothing.
_WIDER_CALLED, _WIDER = 1.05, 1.5
_LARGE_M = 100.0
# A shell: its triangles keep away from the middle of its box by this share of the way to its corners at the least.
_HOLLOW, _SHELL = 0.4, 0.95
# Columns over what it encloses of which a dome roofs so many.
_ROOFED = 0.9
_PROBES = 12


def find_domes(bodies: Sequence[RawNode], table_names: Sequence[str]) -> list[int]:
    """Find sky domes, the largest first: large hollow shells that enclose everything else and roof it over."""
    found: list[int] = []
    low = np.array([b.vertices.min(axis=0) for b in bodies])
    high = np.array([b.vertices.max(axis=0) for b in bodies])
    for k in np.argsort(-np.prod(high - low, axis=1), kind="stable").tolist():
        rest = [j for j in range(len(bodies)) if j != k and j not in found]
        if not rest:
            break
        words = [word for word in words_in(bodies[k].name) if word not in _SKY_PERHAPS]
        sky = table_names[k] == SKY or (not table_names[k] and bool(_SKY_WORDS & set(words)))
        if (table_names[k] or words) and not sky:
            break
        inner_low, inner_high = low[rest].min(axis=0), high[rest].max(axis=0)
        wider = _WIDER_CALLED if sky else _WIDER
        size, inner = high[k] - low[k], inner_high - inner_low
        encloses = (low[k, :2] <= inner_low[:2] + 1e-6).all() and (high[k] >= inner_high - 1e-6).all()
        large = (size[:2] >= wider * inner[:2]).all() and (sky or size[:2].min() >= _LARGE_M)
        if not (encloses and large and _is_hollow(bodies[k]) and _covers_above(bodies[k], inner_low, inner_high)):
            break
        found.append(k)
    return found


def _is_hollow(body: RawNode) -> bool:
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    centres = body.vertices[body.faces].mean(axis=1)
    middle, reach = (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
    # Half of a sphere has its middle at its rim.
    foot, height = np.array([*middle[:2], low[2]]), np.array([*reach[:2], high[2] - low[2]])
    shares = [(np.abs((centres - m) / r).max(axis=1) >= _HOLLOW).mean() for m, r in ((middle, reach), (foot, height))]
    return bool(max(shares) > _SHELL)


def _covers_above(body: RawNode, low: Floats, high: Floats) -> bool:
    """Whether columns over a box meet the body above the box's top."""
    from aerialdojo_gen.geometry.rays import TriangleRayCaster

    at = (np.arange(_PROBES) + 0.5) / _PROBES
    x, y = np.meshgrid(*(low[:2, None] + (high - low)[:2, None] * at), indexing="ij")
    origins = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, high[2] - 1e-6)])
    caster = TriangleRayCaster(body.vertices, body.faces.astype(np.int32))
    hit, _ = caster.first_hit(origins, np.tile([0.0, 0.0, 1.0], (len(origins), 1)))
    return bool(np.isfinite(hit).mean() >= _ROOFED)


def classify_surfaces(scene: Scene, source_names: dict[str, str]) -> Scene:
    """Say of every open surface of an imported scene whether it is the ground."""
    unknown = replace(scene, instances=tuple(replace(i, surface="") for i in scene.instances))
    ground = Ground.of(unknown)
    nodes = frozenset() if ground is None else ground.nodes
    extent = np.ptp(scene.bounds, axis=0)[:2]

    def surface(instance: Instance) -> str:
        if instance.surface != "sheet":
            return instance.surface
        wide = bool((np.ptp(instance.bounds, axis=0)[:2] >= 0.2 * extent).all())
        named = wide and bool(_GROUND_WORDS & set(words_in(source_names.get(instance.node, ""))))
        return "ground" if instance.node in nodes or named else "sheet"

    return replace(scene, instances=tuple(replace(i, surface=surface(i)) for i in scene.instances))


def describe_surfaces(scene: Scene) -> list[str]:
    """Say what was decided, a line each."""
    from collections import Counter

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
