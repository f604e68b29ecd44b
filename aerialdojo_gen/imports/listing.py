"""Describe a mesh file before importing it: bodies, ranges, guesses of axis and scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.text_table import Column, TextTable
from aerialdojo_gen.imports.cutting import connected_bodies
from aerialdojo_gen.imports.forms import material_shares
from aerialdojo_gen.imports.import_mesh import LARGEST_M, MeshOptions, SourceMesh, describe_extent, size_text
from aerialdojo_gen.imports.naming import Naming
from aerialdojo_gen.imports.raw import RawNode
from aerialdojo_gen.scenes.mesh import areas

Floats = NDArray[np.float64]

# Metres per unit, likeliest first.
_UNITS = ((1.0, "metres"), (0.01, "centimetres"), (0.001, "millimetres"), (0.3048, "feet"), (0.0254, "inches"))
# Plausible width and height of a scene.
_WIDE_M, _HIGH_M = (15.0, 5000.0), (1.5, 400.0)
_SURE = 1.3
_SHOWN = 12


@dataclass(frozen=True)
class FileAxes:
    """Axis and units that a file's shape suggests."""

    up: str  # The axis along which more surface is level
    up_sure: bool  # Whether the difference is large
    units: tuple[tuple[float, str], ...]  # Metres per unit, and its name; likeliest first


def infer_axes(nodes: Sequence[RawNode]) -> FileAxes:
    """Guess the up axis and the unit of a mesh."""
    level = np.zeros(3)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for node in nodes:
        finite = node.select_faces(np.asarray(np.isfinite(node.vertices[node.faces]).all(axis=(1, 2))))
        if not len(finite.faces):
            continue
        corners, normal = finite.vertices[finite.faces], np.abs(finite.normals)
        # Hills are only partly level: use the projected area.
        steep = normal < 0.3 * np.linalg.norm(normal, axis=1, keepdims=True)
        level += np.where(steep, 0.0, normal).sum(axis=0)
        low, high = np.minimum(low, corners.min(axis=(0, 1))), np.maximum(high, corners.max(axis=(0, 1)))
    size = np.where(np.isfinite(high - low), high - low, 0.0)
    # Scenes are wider than high: prefer the shorter axis.
    weight = [level[k] / max(float(size[k]), 1e-9) ** 0.5 for k in (1, 2)]
    up = "y" if weight[0] > weight[1] else "z"
    sure = max(weight) >= _SURE * min(weight)
    other, tall = (size[2], size[1]) if up == "y" else (size[1], size[2])
    wide = max(size[0], other)
    fit = tuple(
        (scale, unit)
        for scale, unit in _UNITS
        if _WIDE_M[0] <= wide * scale <= _WIDE_M[1] and _HIGH_M[0] <= tall * scale <= _HIGH_M[1]
    )
    return FileAxes(up, sure, fit or _UNITS[:1])


def _infer_within_domes(nodes: Sequence[RawNode], scale: float | None, naming: Naming) -> FileAxes:
    """Guess without sky domes, whose shape hides axis and scale."""
    inferred = infer_axes(nodes)
    for up in (inferred.up, "z" if inferred.up == "y" else "y"):
        taken = scale or inferred.units[0][0]
        source = SourceMesh.of(nodes, MeshOptions(up, taken, naming=naming))
        if source.domes:
            # Convert back to the file's axes and unit.
            v = [b.vertices / taken for b in source.bodies]
            own = [x if up == "z" else np.column_stack([x[:, 0], x[:, 2], -x[:, 1]]) for x in v]
            return infer_axes([b.with_vertices(x) for b, x in zip(source.bodies, own, strict=True)])
    return inferred


def describe_mesh(
    nodes: Sequence[RawNode], up: str | None, scale: float | None, naming: Naming, width: int | None
) -> list[str]:
    """Describe the content of a file, in lines for a terminal."""
    inferred = _infer_within_domes(nodes, scale, naming)
    taken_up, taken_scale = up or inferred.up, scale or inferred.units[0][0]
    source = SourceMesh.of(nodes, MeshOptions(taken_up, taken_scale, naming=naming))
    triangles = sum(len(b.faces) for b in (*source.bodies, *source.domes))
    bodies = [(b, *connected_bodies(b.faces, len(b.vertices))) for b in source.bodies]
    pieces = sum(int(label.max()) + 1 for _, label, _ in bodies)
    colours = len(np.unique(np.concatenate([b.colours for b in source.bodies]) // 16, axis=0))
    low, high = source.bounds
    sure = "" if inferred.up_sure else ", not by much: look at it in a viewer"
    lines = [
        f"{len(nodes):,} node{'s' * (len(nodes) != 1)} with {triangles:,} triangle{'s' * (triangles != 1)} in "
        f"{pieces:,} connected piece{'s' * (pieces != 1)}, {colours:,} colour{'s' * (colours != 1)}",
        f"up: {taken_up} {'as given' if up else f'by its form{sure}'} (--up {inferred.up} is the guess)",
        f"scale: {taken_scale:g} {'as given' if scale else f'if its unit is {inferred.units[0][1]}'}: "
        f"{size_text(high - low)} (x, y, z)",
        *(
            f"   or: {other:g} if its unit is {unit}: {size_text((high - low) * other / taken_scale)}"
            for other, unit in inferred.units
            if other != taken_scale
        ),
        f"there: {describe_extent(source.bodies)}",
        f"heights: z is {low[2]:.7g} to {high[2]:.7g} m",
    ]
    if max(high - low) > LARGEST_M:
        parts = "--tiles 200 makes scenes of its parts, --crop or --box one of a part"
        lines.append(f"wider than {LARGEST_M:g} m: {parts}")
    lines += [f"dome: {d.name or 'a node without a name'}, {len(d.faces):,} triangles" for d in source.domes]
    lines += [f"note: {line}" for line in source.repairs.lines]
    largest = sorted(bodies, key=lambda row: -float(areas(row[0].vertices, row[0].faces.astype(np.int32)).sum()))
    rows = []
    for body, label, closed in largest[:_SHOWN]:
        name = naming.name_of(body.name, material_shares(body)).category.replace("_", " ")
        west, east = body.vertices.min(axis=0) + 0.0, body.vertices.max(axis=0) + 0.0  # no minus before a zero
        ranges = [f"{a:.1f} to {b:.1f}" for a, b in zip(west, east, strict=True)]
        cells = [name[:20] or "-", f"{len(body.faces):,}", f"{int(label.max()) + 1:,}", f"{closed.mean():.0%}"]
        rows.append((body.name[:24] or "-", [*cells, *ranges]))
    heads = [Column("called", words=True), *map(Column, ("triangles", "pieces", "closed", "x, m", "y, m", "z, m"))]
    lines += ["", *TextTable("node", heads, rows).lines(width)]
    rest = len(largest) - _SHOWN
    return lines + ([f"and {rest:,} smaller node{'s' if rest > 1 else ''}"] if rest > 0 else [])
