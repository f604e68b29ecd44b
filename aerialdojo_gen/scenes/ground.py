"""The ground of a scene: a terrain painted with surfaces that meet edge to edge.

Roads, pavements, lawns and lane marks are polygons painted one over the other; what is seen of each is cut out of the
terrain's own triangles. So a mark lies exactly in the road, nothing overlaps, and nothing flickers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import groupby

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import STRtree
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.geometry.portable import dot
from aerialdojo_gen.scenes.mesh import Floats, Mesh, merge, mesh
from aerialdojo_gen.scenes.shapes import triangulate, triangulate_all
from aerialdojo_gen.scenes.terrain import Terrain

# Polygons meet on this grid (metres), so that rounding cannot open slits between them.
_GRID_M = 1e-3
_MIN_AREA_M2 = 1e-4


@dataclass(frozen=True, eq=False)
class Surface:
    """A painted area."""

    area: BaseGeometry  # World frame, metres
    material: str
    rise_m: float = 0.0  # Height over the terrain, metres: a pavement's 0.12, say; its edge becomes a kerb
    edge: str = "concrete"  # Material of that kerb


def ground_meshes(
    terrain: Terrain, extent: Polygon, base: str, surfaces: Sequence[Surface]
) -> list[tuple[str, Mesh]]:
    """Cut the terrain into its painted surfaces, later ones covering earlier ones.

    Together they cover the extent once.
    """
    layers = visible_surfaces(extent, base, surfaces)
    flat = bool(np.ptp(terrain.heights_m) == 0.0)
    out: list[tuple[str, Mesh]] = []
    tiles = None if flat else _Tiles.of(terrain)
    for layer in layers:
        body = _flat_mesh(layer, terrain) if tiles is None else _draped_mesh(layer, tiles)
        if len(body.faces):
            out.append((layer.material, body))
        if layer.rise_m > 0.0:
            out.append((layer.edge, _kerb(layer, terrain)))
    return out


def visible_surfaces(extent: Polygon, base: str, surfaces: Sequence[Surface]) -> list[Surface]:
    """Compute the visible part of every surface: disjoint areas that cover the extent."""
    groups = [Surface(extent, base)]
    for (material, rise, edge), members in groupby(surfaces, lambda s: (s.material, s.rise_m, s.edge)):
        union = shapely.unary_union([_snapped(m.area) for m in members])
        groups.append(Surface(union, material, rise, edge))
    covered: BaseGeometry = Polygon()
    layers = []
    for layer in reversed(groups):
        visible = _areal(_snapped(layer.area).intersection(_snapped(extent)))
        visible = shapely.difference(visible, covered, grid_size=_GRID_M)
        covered = _areal(shapely.union(covered, _areal(visible), grid_size=_GRID_M))
        if visible.area > _MIN_AREA_M2:
            layers.append(Surface(visible, layer.material, layer.rise_m, layer.edge))
    return layers[::-1]


def polygons_of(area: BaseGeometry) -> list[Polygon]:
    """List the polygons of a geometry, without points, lines and slivers."""
    if isinstance(area, Polygon):
        return [area] if area.area > _MIN_AREA_M2 else []
    return [p for g in getattr(area, "geoms", ()) for p in polygons_of(g)]


def _areal(area: BaseGeometry) -> BaseGeometry:
    """Drop the lines and points where areas touch and do not overlap: overlays refuse what is mixed."""
    return MultiPolygon(polygons_of(area)) if area.geom_type == "GeometryCollection" else area


def _snapped(area: BaseGeometry) -> BaseGeometry:
    return shapely.set_precision(shapely.make_valid(area), _GRID_M)


def _flat_mesh(layer: Surface, terrain: Terrain) -> Mesh:
    z = float(terrain.heights_m[0, 0]) + layer.rise_m
    plans = map(triangulate, polygons_of(layer.area))
    return merge([_from_above(mesh(np.column_stack([xy, np.full(len(xy), z)]), faces)) for xy, faces in plans])


@dataclass(frozen=True, eq=False)
class _Tiles:
    """A terrain's triangles: as (n, 3) corners and (m, 3) faces, seen from above, and their (m, 3) normals."""

    corners: Floats
    faces: NDArray[np.int32]
    normals: Floats
    plans: STRtree

    @classmethod
    def of(cls, terrain: Terrain) -> _Tiles:
        corners, faces = terrain.corners(), terrain.triangles()
        a, b, c = (corners[faces[:, k]] for k in range(3))
        return cls(corners, faces, np.cross(b - a, c - a), STRtree(shapely.polygons(corners[faces][:, :, :2])))


def _draped_mesh(layer: Surface, tiles: _Tiles) -> Mesh:
    corners, faces = tiles.corners, tiles.faces
    shapely.prepare(layer.area)
    touched = np.sort(tiles.plans.query(layer.area, predicate="intersects"))
    inside = shapely.covers(layer.area, tiles.plans.geometries[touched])
    pieces = [Mesh(corners, faces[touched[inside]])] if inside.any() else []
    cut = touched[~inside]
    parts = _cut(layer.area, tiles.plans.geometries[cut])
    visible = [polygons_of(part) for part in parts.tolist()]
    if any(visible):
        flat, whose, cut_faces = triangulate_all([piece for some in visible for piece in some])
        tile = np.repeat(cut, [len(some) for some in visible])
        z = np.empty(len(flat))
        for k, some in zip(
            tile.tolist(), np.split(np.arange(len(flat)), np.flatnonzero(np.diff(whose)) + 1), strict=True
        ):
            a, normal = corners[faces[k, 0]], tiles.normals[k]
            z[some] = a[2] - dot(flat[some] - a[:2], normal[:2]) / normal[2]
        pieces.append(Mesh(np.column_stack([flat, z]), cut_faces))
    if not pieces:
        return mesh([], [])
    whole = merge(pieces)
    used, index = np.unique(whole.faces, return_inverse=True)
    return _from_above(mesh(whole.vertices[used] + np.array([0.0, 0.0, layer.rise_m]), index.reshape(-1, 3)))


def _cut(area: BaseGeometry, plans: NDArray[np.object_]) -> NDArray[np.object_]:
    """Intersect an area with triangles: with that piece of it alone where a triangle touches no other."""
    pieces = shapely.get_parts(area)
    whole = np.full(len(plans), area, dtype=object)
    if len(pieces) > 1 and len(plans):
        piece, plan = STRtree(plans).query(pieces)
        alone = np.bincount(plan, minlength=len(plans))[plan] == 1
        whole[plan[alone]] = pieces[piece[alone]]
    return np.asarray(shapely.intersection(whole, plans))


def _kerb(layer: Surface, terrain: Terrain) -> Mesh:
    def heights(xy: Floats) -> tuple[Floats, Floats]:
        z = terrain.z(*xy.T)
        return z - 0.02, z + layer.rise_m

    # Walls follow the ground: no stretch is longer than a cell of the terrain.
    return merge([w for piece in polygons_of(layer.area) for w in outer_walls(piece, terrain.cell_m, heights)])


def outer_walls(plan: Polygon, longest_m: float, heights: Callable[[Floats], tuple[Floats, Floats]]) -> list[Mesh]:
    """Make the walls of a plan's rings between lower and upper heights, (n,) each, that its points (n, 2) have."""
    walls = []
    for k, ring in enumerate((plan.exterior, *plan.interiors)):
        xy = np.array(shapely.segmentize(ring, longest_m).coords)[:, :2]
        corners = np.concatenate([np.column_stack([xy, z]) for z in heights(xy)])
        n = len(xy)
        a = np.arange(n - 1)
        faces = np.concatenate([np.column_stack([a, a + 1, a + 1 + n]), np.column_stack([a, a + 1 + n, a + n])])
        # Shapely leaves the sense of rings open; the filled side must lie behind the wall.
        walls.append(mesh(corners, faces if ring.is_ccw == (k == 0) else faces[:, ::-1]))
    return walls


def _from_above(m: Mesh) -> Mesh:
    """Lay the texture on from above, continuous over all pieces and slopes."""
    return Mesh(m.vertices, m.faces, m.vertices[m.faces][:, :, :2].copy())


def disc(x: float, y: float, radius_m: float, corners: int = 24) -> Polygon:
    """Make a round area, metres, world frame."""
    angles = np.arange(corners) * 2 * np.pi / corners
    return Polygon(np.column_stack([x + radius_m * np.cos(angles), y + radius_m * np.sin(angles)]))


def without(area: BaseGeometry, holes: Iterable[BaseGeometry]) -> BaseGeometry:
    """Cut holes out of an area, one after the other."""
    return reduce(shapely.difference, holes, area)


def edge_strip(plan: BaseGeometry, in_m: float, out_m: float = 0.0) -> BaseGeometry:
    """Make the strip along a plan's outline that reaches so far in and out of it, metres: a parapet, a kerb."""
    outer = plan.buffer(out_m, join_style="mitre") if out_m else plan
    return outer.difference(plan.buffer(-in_m, join_style="mitre"))


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    """Make an axis-aligned rectangle, metres, world frame."""
    return Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def ribbon(path: Sequence[Sequence[float]], width_m: float, round_ends: bool = False) -> BaseGeometry:
    """Make the area within `width_m` / 2 of a path's middle line."""
    cap = "round" if round_ends else "flat"
    area = shapely.LineString(path).buffer(width_m / 2, cap_style=cap, join_style="round", quad_segs=4)
    return area if isinstance(area, Polygon | MultiPolygon) else Polygon()
