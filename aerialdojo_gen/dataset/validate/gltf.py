"""Checks of the meshes' glTF by its own rules: what a viewer shows is what this program reads.

`aerialdojo_gen.scenes.glb` reads what `build-scenes` writes, and passes over what that never says: transforms of
nodes, a second account of the colours, data in other files. A careless hand, or another program, may have said it.
The file is parsed here by code of its own, on purpose: a reader in common would hide its own faults from this check.
"""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Iterator
from functools import wraps
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.dataset.validate.registry import Finding, Function, check
from aerialdojo_gen.dataset.validate.rows import MESH_CHECKS, Floats, Rows, SceneData, UncheckedError, place_text

_SAME = 1e-6
# glTF's y is up, the world's z is: what a node's own coordinates become, and nothing else.
_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
# A colour factor is linear and has six decimals; a texture's mean is rounded to whole steps of 255.
_FACTOR, _MEAN = 2e-6, 1.0
_MOVING = ("animations", "skins")


def _whole(function: Function) -> Function:
    """Make a fault of a document that a viewer stumbles over, and this program's reader does not."""

    @wraps(function)
    def run(data: SceneData, rows: Rows) -> Iterator[Finding]:
        try:
            yield from function(data, rows)
        except (KeyError, IndexError, TypeError, ValueError) as error:
            found = f"glTF that does not hold together ({type(error).__name__}: {error})"
            yield Finding(0, found, "a whole document")

    return run


@check("scenes", after=MESH_CHECKS)
@_whole
def mesh_moved(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """By glTF's rules every node stands where its vertices say: nothing above it moves, turns or scales it."""
    document = _document(data)
    moved = [key for key in _MOVING if document.get(key)]
    if moved:
        yield Finding(0, f"a mesh with {' and '.join(moved)}", "nodes that stand still")
    shown: Counter[str] = Counter()
    off = []
    for node, world in _placed(document):
        if "mesh" in node:
            shown[str(node.get("name"))] += 1
            if not np.abs(world - _UP).max() <= _SAME:
                off.append((str(node.get("name")), world))
    if off:
        name, world = off[0]
        others = f" and {len(off) - 1:,} more" if len(off) > 1 else ""
        found = f"node {name}{others} moved by {_describe(world)}"
        yield Finding(0, found, "z up turned into y up, and no other transform")
    expected = Counter(instance.node for instance in (*data.mesh.instances, *data.mesh.backdrop))
    if shown != expected:
        odd = sorted(((shown - expected) + (expected - shown)).elements())
        yield Finding(0, f"{len(odd):,} nodes that a viewer shows otherwise, {odd[0]} first", "each node once")


@check("scenes", after=MESH_CHECKS)
@_whole
def mesh_colours(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """A material's colour is the same by its name, by its extras, by its factor and by its texture."""
    by_name = data.mesh.materials
    for entry in _document(data)["materials"]:
        material, surface = by_name[entry["name"]], entry["pbrMetallicRoughness"]
        factor = np.array(surface.get("baseColorFactor", (1, 1, 1, 1)), dtype=np.float64)
        if material.texture is not None:
            seen = slice(None) if material.mask is None or not material.mask.any() else material.mask.ravel()
            mean = material.texture.reshape(-1, 3)[seen].mean(axis=0)
            same = np.abs(mean - material.colour).max() <= _MEAN and np.abs(factor - 1).max() <= _FACTOR
            expected = f"its texture's mean, {_rgb(mean)}, and no factor"
        else:
            linear = _linear(np.array(material.colour, dtype=np.float64))
            same = len(factor) == 4 and np.abs(factor - [*linear, 1.0]).max() <= _FACTOR
            expected = f"factor ({', '.join(f'{c:.6g}' for c in linear)}, 1)"
            named = entry["name"].partition("#")[2]
            if len(named) == 6 and not named.strip("0123456789abcdef"):
                same = same and bytes.fromhex(named) == bytes(material.colour)
                expected += f" and #{named}, as its name has it"
        if not same:
            found = f"material {entry['name']!r} with {_rgb(material.colour)} and factor {factor.tolist()}"
            yield Finding(0, found, expected)
            return


@check("scenes", after=MESH_CHECKS)
@_whole
def mesh_extent(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """Vertices are finite and lie within the bounds that the file tells of them; nothing of it lies elsewhere."""
    document = _document(data)
    for kind in ("buffers", "images"):
        elsewhere = [entry["uri"] for entry in document.get(kind, ()) if "uri" in entry]
        if elsewhere:
            yield Finding(0, f"{kind} in {elsewhere[0][:60]!r}", "all of the mesh in one file")
            return
    instances = {instance.node: instance for instance in data.mesh.instances}
    for node in document["nodes"]:
        if "mesh" not in node or node.get("name") not in instances:
            continue
        primitives = document["meshes"][node["mesh"]]["primitives"]
        for primitive, part in zip(primitives, instances[node["name"]].parts, strict=True):
            accessor = document["accessors"][primitive["attributes"]["POSITION"]]
            low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
            off = (np.abs(own - accessor.get(name, np.nan)).max() for own, name in ((low, "min"), (high, "max")))
            if not max(off) <= _SAME * max(1.0, float(np.abs([low, high]).max())):
                found = f"node {node['name']} from {place_text(low, 4)} to {place_text(high, 4)}"
                stated = (place_text(np.asarray(accessor.get(name, ())), 4) for name in ("min", "max"))
                yield Finding(0, found, f"{' to '.join(stated)}, as the file has it")
                return


def _document(data: SceneData) -> dict[str, Any]:
    """Return the glTF document, read once, of a mesh that can be read."""
    _ = data.mesh

    def parse() -> Any:
        raw = data.mesh_path().read_bytes()
        return json.loads(raw[20 : 20 + struct.unpack_from("<I", raw, 12)[0]])

    document = data.cached("gltf", parse)
    if not isinstance(document, dict):
        raise UncheckedError("no glTF document")
    return document


def _placed(document: dict[str, Any]) -> Iterator[tuple[dict[str, Any], Floats]]:
    """Every node that the file's scene shows, and what its coordinates are multiplied by, (4, 4)."""
    nodes = document["nodes"]
    waiting = [(k, np.eye(4)) for k in document["scenes"][document.get("scene", 0)]["nodes"]]
    # A node has one parent: more visits than nodes mean a loop.
    for _ in range(len(nodes) + 1):
        if not waiting:
            return
        k, parent = waiting.pop()
        world = parent @ _local(nodes[k])
        yield nodes[k], world
        waiting += [(child, world) for child in nodes[k].get("children", ())]


def _local(node: dict[str, Any]) -> Floats:
    """Transform of a node by itself, (4, 4), column vectors (glTF 2.0, section 3.5.2)."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    local = np.eye(4)
    local[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    local[:3, 3] = node.get("translation", (0, 0, 0))
    return local


def _describe(world: Floats) -> str:
    """Describe how a transform differs from the expected one, in the world frame."""
    rest = np.linalg.inv(_UP) @ world
    if np.abs(rest[:3, :3] - np.eye(3)).max() <= _SAME:
        return place_text(rest[:3, 3], 4)
    return f"a turn or a scale, {np.round(rest[:3, :3], 4).tolist()}"


def _linear(srgb: Floats) -> Floats:
    """Linear factors of sRGB channels, 0-255 (IEC 61966-2-1)."""
    c = srgb / 255.0
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def _rgb(colour: NDArray[Any] | tuple[int, int, int]) -> str:
    return "#" + "".join(f"{round(float(c)):02x}" for c in colour)
