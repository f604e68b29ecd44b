"""Convert the nodes of a mesh file to a scene: axes, units, repair, instances, ground, ceiling."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import trimesh
from numpy.typing import NDArray

from aerialdojo_gen.annotations.vocabulary import NON_OBJECTS, UNKNOWN
from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.imports.cutting import Region, clip_node, connected_bodies, unique_rows
from aerialdojo_gen.imports.forms import colour_of, form_of, grown, is_unnamed, material_shares, size_words
from aerialdojo_gen.imports.material_builder import LIGHTS, MaterialBuilder, is_photographic
from aerialdojo_gen.imports.naming import Naming, word_list
from aerialdojo_gen.imports.pictures import TEXTURE_PX
from aerialdojo_gen.imports.raw import RawNode, bounds_of, merge_nodes, sort_by_position
from aerialdojo_gen.imports.split_components import split_components
from aerialdojo_gen.imports.surfaces import (
    SKY,
    classify_surfaces,
    describe_surfaces,
    find_domes,
    ground_cover,
    ground_plane,
)
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene

Floats = NDArray[np.float64]

LARGEST_M = 2000.0
SMALLEST_M = 5.0
# Limit on half-metre planning cells, a few bytes each.
_MAX_CELLS = 150e6
_MARGIN_M = 5.0
_HEADROOM_M = 6.0
_LOWEST_CEILING_M = 12.0
_GROUND_COVER = 0.97
_CLUTTER_M = 0.5
_MAX_INSTANCES = 3000
_MIN_AREA_M2 = 1e-9
_LEVEL_SHARE = 0.7
_WELD_M = 1e-4
_MAX_NOTES = 8


@dataclass
class Repairs:
    """Repairs of a mesh, as lines for the user."""

    lines: list[str] = field(default_factory=list)
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)  # (x, y, z)

    def add(self, n: int, text: str) -> None:
        """Record a repair of n elements, if n > 0."""
        if n:
            self.lines.append(f"{n:,} {text}")


@dataclass(frozen=True)
class MeshOptions:
    """How a mesh becomes a scene; makes a `UsageError` of values that make no sense, before any mesh is read."""

    up: str = "z"  # The mesh's axis that points up
    scale: float = 1.0  # Metres per unit of the mesh
    crop_m: tuple[float, float, float] | None = None  # Circle to keep: x, y, radius
    box_m: tuple[float, float, float, float] | None = None  # Rectangle to keep: x0, y0, x1, y1
    ceiling_m: float | None = None  # Where absent a little above the highest point
    light: str = "auto"  # Of `LIGHTS`
    naming: Naming = field(default_factory=Naming)
    texture_px: int = TEXTURE_PX  # Maximum side of textures

    def __post_init__(self) -> None:
        """Check the values."""
        check_axes(self.up, self.scale)
        if self.light not in LIGHTS:
            raise UsageError(f"--light {self.light[:20]!r}: must be {', '.join(LIGHTS[:-1])} or {LIGHTS[-1]}")
        _ = self.region

    @property
    def region(self) -> Region | None:
        """The region to keep; None for all."""
        crop_m, box_m = self.crop_m, self.box_m
        if crop_m is not None and box_m is not None:
            raise UsageError("--crop and --box are mutually exclusive")
        if not all(math.isfinite(v) and abs(v) < 1e7 for v in crop_m or box_m or ()):
            raise UsageError("--crop and --box take finite numbers of metres")
        if crop_m is not None and crop_m[2] <= 0:
            raise UsageError(f"--crop {crop_m[0]:g} {crop_m[1]:g} {crop_m[2]:g}: the radius must be above 0")
        if box_m is not None and (box_m[0] == box_m[2] or box_m[1] == box_m[3]):
            raise UsageError("--box X0 Y0 X1 Y1: the two corners must differ in x and in y")
        return Region.circle(*crop_m) if crop_m else Region.box(*box_m) if box_m else None


@dataclass(frozen=True, eq=False)
class SourceMesh:
    """A repaired foreign mesh in metres, z up, before clipping."""

    bodies: list[RawNode]  # Bodies and sky domes, sorted by position
    domes: list[RawNode]
    repairs: Repairs  # Repairs so far

    @classmethod
    def of(cls, nodes: Sequence[RawNode], options: MeshOptions) -> SourceMesh:
        """Reorient, scale and repair the nodes of a file."""
        repairs = Repairs()
        bodies = [b for node in nodes for b in [_repair(_reorient(node, options), repairs)] if len(b.faces)]
        if not bodies:
            raise AssetError("no triangles are left after repair: the mesh is empty or degenerate")
        # The repair lines must not depend on the reader's order of nodes.
        repairs.lines.sort()
        labels = {label for b in bodies for label in (b.name, *(s.name for s in b.surfaces))}
        repairs.lines += options.naming.unused(labels)
        bodies = sort_by_position(bodies)
        domes = find_domes(bodies, [options.naming.from_table(b.name, material_shares(b)).category for b in bodies])
        rest = [b for k, b in enumerate(bodies) if k not in domes]
        return cls(rest, [bodies[k] for k in domes], repairs)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corner of the bodies, (3,) float64 each, metres."""
        return bounds_of(self.bodies)

    def within(self, region: Region) -> SourceMesh:
        """Clip to a region; AssetError if nothing is left."""
        cut = [_repair(clip_node(b, region), Repairs()) for b in self.bodies]
        kept = [b for b in cut if len(b.faces)]
        if not kept:
            raise AssetError(f"{region.option}: contains no part of the mesh: {describe_extent(self.bodies)}")
        return SourceMesh(kept, self.domes, self.repairs)


def describe_extent(bodies: Sequence[RawNode]) -> str:
    """Describe the x and y ranges of bodies, and where most triangles are."""
    low, high = bounds_of(bodies)
    middles = np.concatenate([b.vertices[b.faces].mean(axis=1)[:, :2] for b in bodies])
    cell = max(float((high - low)[:2].max()) / 10, 1e-9)
    places, n = np.unique(np.floor((middles - low[:2]) / cell).astype(np.int64), axis=0, return_counts=True)
    x, y = low[:2] + (places[np.argmax(n)] + 0.5) * cell
    return (
        f"x is {low[0]:.7g} to {high[0]:.7g}, y {low[1]:.7g} to {high[1]:.7g} m, densest about x {x:.0f}, y {y:.0f} "
        f"({int(n.max()):,} of {len(middles):,} triangles)"
    )


def size_text(size: Floats) -> str:
    """Format lengths in metres, small ones with three digits: ``"1,250 by 84.5 by 12 m"``."""
    return f"{' by '.join(f'{s:,.0f}' if s >= 99.95 else f'{s:.3g}' for s in size.tolist())} m"


def check_axes(up: str | None, scale: float | None) -> None:
    """Raise a `UsageError` for an invalid axis or scale."""
    if up not in (None, "y", "z"):
        raise UsageError(f"--up {up[:20]!r}: must be z or y, the mesh's axis that points up")
    if scale is not None and not (math.isfinite(scale) and scale > 0):
        raise UsageError(f"--scale {scale}: must be a number above 0")


def import_mesh(name: str, nodes: Sequence[RawNode], options: MeshOptions | None = None) -> tuple[Scene, Repairs]:
    """Make a scene of a foreign mesh, with its origin at the centre on the ground; returns the scene and repairs."""
    options = options or MeshOptions()
    return make_scene(name, SourceMesh.of(nodes, options), options, options.region)


def make_scene(
    name: str, source: SourceMesh, options: MeshOptions, region: Region | None, origin_m: Floats | None = None
) -> tuple[Scene, Repairs]:
    """Make a scene of a mesh, or of the part in `region`; returns the scene and repairs."""
    repairs = Repairs(list(source.repairs.lines))
    part = source if region is None else source.within(region)
    low, high = part.bounds
    _check_extent(high - low, part.bodies)
    bodies, split_stats = split_components(part.bodies)
    repairs.lines += split_stats.lines()
    shift = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]) if origin_m is None else origin_m
    repairs.origin_m = (float(shift[0]), float(shift[1]), float(shift[2]))
    bodies = _merged_clutter(_translate(sort_by_position(bodies), -shift))
    domes = _translate(part.domes, -shift)
    builder = MaterialBuilder(options.light == "baked" or (options.light == "auto" and is_photographic(bodies)))
    builder.measure_texture_scales([*bodies, *domes])
    parts = builder.materials
    built = [(b, made) for b in bodies for made in [_parts(b, builder, repairs)] if made]
    instances = _make_instances(built, options.naming, parts)
    if not instances:
        raise AssetError("no triangles are left after repair: the mesh is empty or degenerate")
    source_names = {instance.node: body.name for instance, (body, _) in zip(instances, built, strict=True)}
    backdrop = tuple(
        Instance(f"{SKY}_{k:04d}", SKY, "", {}, _parts(dome, builder, Repairs()), surface="dome")
        for k, dome in enumerate(domes)
    )
    _report_textures([*bodies, *domes], builder, options.light, repairs)
    low, high = low - shift, high - shift
    cover = ground_cover(instances, low, high)
    if cover < _GROUND_COVER:
        instances.insert(0, ground_plane(low, high, 4 * _MARGIN_M, parts))
        repairs.lines.append(f"ground plane added (the mesh covers {cover:.0%} of its extent)")
    top = options.ceiling_m
    if top is None:
        top = max(float(high[2]) + _HEADROOM_M, float(low[2]) + _LOWEST_CEILING_M)
    bounds = np.array([[*(low[:2] - _MARGIN_M), low[2]], [*(high[:2] + _MARGIN_M), top]])
    if region is not None:
        # Bodies cut open at the border are closed by the end of the flight volume.
        bounds[0, :2] = np.maximum(bounds[0, :2], region.low - shift[:2])
        bounds[1, :2] = np.minimum(bounds[1, :2], region.high - shift[:2])
    scene = Scene(name, tuple(instances), parts, bounds, imported=True, backdrop=backdrop)
    scene = classify_surfaces(scene, source_names)
    repairs.lines += describe_surfaces(scene)
    things = [i for i in scene.instances if i.category not in NON_OBJECTS]
    if things and all(is_unnamed(i.node, i.category) for i in things):
        repairs.lines.append(
            "no thing has a name, all are identified by colour and form: name them by a table of patterns of nodes "
            "or materials (--names names.csv), or on the page of annotate"
        )
    return replace(scene, imported=False), repairs


def _translate(bodies: Sequence[RawNode], by_m: Floats) -> list[RawNode]:
    return [b.with_vertices(b.vertices + by_m) for b in bodies]


def _reorient(node: RawNode, options: MeshOptions) -> RawNode:
    v = node.vertices * options.scale
    return node.with_vertices(np.column_stack([v[:, 0], -v[:, 2], v[:, 1]]) if options.up == "y" else v)


def _repair(node: RawNode, repairs: Repairs) -> RawNode:
    """Drop invalid and degenerate faces; weld vertices."""
    faces = node.faces
    inside = ((faces >= 0) & (faces < len(node.vertices))).all(axis=1)
    finite = np.asarray(np.isfinite(node.vertices).all(axis=1) & (np.abs(node.vertices) < 1e7).all(axis=1))
    ok = np.array(inside)
    ok[inside] = finite[faces[inside]].all(axis=1)
    repairs.add(int((~ok).sum()), f"triangles of {node.name or 'the mesh'} with no place (NaN, infinite) dropped")
    node = node.select_faces(ok)
    used, faces = np.unique(node.faces, return_inverse=True)
    vertices = node.vertices[used]
    if len(vertices):
        first, same, _ = unique_rows(*np.round(vertices / _WELD_M).T)
        vertices, faces = vertices[first], same[faces.reshape(-1)]
    faces = faces.reshape(-1, 3).astype(np.int64)
    solid = areas(vertices, faces.astype(np.int32)) > _MIN_AREA_M2 if len(faces) else np.zeros(0, dtype=bool)
    repairs.add(int((~solid).sum()), f"triangles of {node.name or 'the mesh'} without area dropped")
    return node.with_vertices(vertices, faces).select_faces(solid)


def _check_extent(size: Floats, bodies: Sequence[RawNode]) -> None:
    wide = float(max(size[0], size[1]))
    text = f"the mesh is {size_text(size)}"
    if wide > LARGEST_M or math.prod(2 * (s + 2 * _MARGIN_M) for s in size) > _MAX_CELLS:
        raise AssetError(
            f"{text}, too large to plan in: --scale 0.01 if it is in centimetres, --crop X Y RADIUS or "
            f"--box X0 Y0 X1 Y1 for a part, --tiles 200 for all of it in parts; {describe_extent(bodies)}"
        )
    if wide < SMALLEST_M:
        larger = 10 ** math.ceil(math.log10(SMALLEST_M / max(wide, 1e-9)))
        raise AssetError(
            f"{text}, too small to fly in: give --scale a value {larger:,} times as large, or larger still"
        )


def _merged_clutter(bodies: list[RawNode]) -> list[RawNode]:
    """Merge bodies that are too small to be separate things."""
    size = np.array([np.linalg.norm(b.vertices.max(axis=0) - b.vertices.min(axis=0)) for b in bodies])
    small = (size < _CLUTTER_M) & np.array([not b.name for b in bodies])
    if len(bodies) - small.sum() > _MAX_INSTANCES:
        small |= size < np.sort(size)[-_MAX_INSTANCES]
    if small.sum() < 2:
        return bodies
    scraps = [b for b, s in zip(bodies, small, strict=True) if s]
    return [*(b for b, s in zip(bodies, small, strict=True) if not s), merge_nodes("clutter", scraps)]


def _parts(body: RawNode, builder: MaterialBuilder, repairs: Repairs) -> tuple[Part, ...]:
    """Make parts by material; closed bodies face outwards, open ones are double-sided."""
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    closed = mesh.is_watertight and mesh.is_winding_consistent
    if closed and mesh.volume < 0:
        corners = None if body.corners is None else body.corners[:, ::-1]
        body = replace(body, faces=body.faces[:, ::-1], corners=corners)
        repairs.lines.append(f"{body.name or 'a component'} was inside out")
    return builder.parts(body, double_sided=not closed)


def _report_textures(bodies: Sequence[RawNode], builder: MaterialBuilder, light: str, repairs: Repairs) -> None:
    """Report how textures are used."""
    shown = [m for m in builder.materials.values() if m.texture is not None]
    if shown:
        sizes = {m.name.split(",")[0]: m.texture.shape[:2] for m in shown if m.texture is not None}
        most = max(sizes.values(), key=lambda size: size[0] * size[1])
        unlit = sum(m.unlit for m in shown)
        how = "drawn as they are, with the light that is in them" if unlit else "lit by the scene's sun"
        other = "" if light != "auto" else f" (--light {'sun' if unlit else 'baked'} for the other)"
        repairs.add(len(sizes), f"textures, the largest {most[1]} x {most[0]} pixels, {how}{other}")
    notes = {note: None for b in bodies for s in b.surfaces for note in s.notes}
    repairs.lines += [*notes][:_MAX_NOTES]
    repairs.add(max(len(notes) - _MAX_NOTES, 0), "more notes on textures")


def _make_instances(
    bodies: Sequence[tuple[RawNode, tuple[Part, ...]]], naming: Naming, materials: dict[str, Material]
) -> list[Instance]:
    """Give each body a node name, a category, and attributes of colour, size and material."""
    if not bodies:
        return []
    least, most = bounds_of([body for body, _ in bodies])
    names = [naming.name_of(body.name, material_shares(body)) for body, _ in bodies]
    colours = [
        colour_of(parts, materials, name.attributes.get("colour", ""))
        for (_, parts), name in zip(bodies, names, strict=True)
    ]
    sizes = [np.ptp(body.vertices, axis=0) for body, _ in bodies]
    categories = []
    for (body, _), name, colour, size in zip(bodies, names, colours, sizes, strict=True):
        ground = len(bodies) > 1 and body.name != "clutter" and _is_terrain(body, most - least)
        own = name.category or ("terrain" if ground else _category(body))
        categories.append(own if name.category else grown(own, colour, float(size[2])))
    words = [""] * len(bodies)
    for category in {*categories} - {UNKNOWN}:
        rows = [k for k, own in enumerate(categories) if own == category]
        for k, word in zip(rows, size_words([sizes[k] for k in rows]), strict=True):
            words[k] = word
    counts: dict[str, int] = {}
    out = []
    for (body, parts), name, category, colour, word in zip(bodies, names, categories, colours, words, strict=True):
        # A thing without a name has its form for a category, and no number of its own.
        stem = category if name.category or category not in word_list("forms") else UNKNOWN
        k = counts[stem] = counts.get(stem, -1) + 1
        attributes = {"size": word, **name.attributes, "colour": colour}
        attributes = {key: value for key, value in attributes.items() if value}
        surface = "solid" if _is_closed(body) else "sheet"
        out.append(Instance(f"{stem}_{k:04d}", category, "", attributes, parts, surface=surface))
    return out


def _is_closed(body: RawNode) -> bool:
    return bool(connected_bodies(body.faces, len(body.vertices))[1].all())


def _is_terrain(body: RawNode, extent: Floats) -> bool:
    """Whether a body is terrain: as wide as half the mesh, uneven, and more level than steep."""
    size = np.ptp(body.vertices, axis=0)
    if (size[:2] < 0.5 * extent[:2]).any() or not 0.05 * size[:2].max() <= size[2] < 0.25 * size[:2].min():
        return False
    normal = body.normals
    level = np.abs(normal[:, 2]).sum() >= _LEVEL_SHARE * np.linalg.norm(normal, axis=1).sum()
    return bool(level) and not _is_closed(body)


def _category(body: RawNode) -> str:
    """Category of a body without a meaningful name: flat and wide ones are never targets."""
    size = np.ptp(body.vertices, axis=0)
    flat = size[2] < 0.05 * max(size[0], size[1]) or (size[2] < 1.0 and max(size[:2]) > 10.0)
    return "clutter" if body.name == "clutter" else "slab" if flat else form_of(body.vertices)
