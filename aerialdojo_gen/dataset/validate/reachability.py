"""Checks of where a body can be: above the ground, and with a free way to the open sky.

Both are looked at by rays alone; the generator knows them by its clearance grid. A surface without an underside stops
no body that comes round its rim, so that a way below terrain touches nothing: a place is below ground where one ray
straight up meets ground and one straight down meets none. What is ground is found anew as well, by trimesh and
Embree, a little more strictly than the generator does: what is doubtful is no fault. What the scene's file calls
ground is ground whatever its form.

Of anchors, starts and goals a way to the open sky is looked for in ways that grow longer: straight up; aside and then
up; along the routes, which are certified to be free; and last over a lattice of places that see one another. That it
does not come up through the ground from below is the business of the first checks.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Ints, Mask, Rows, SceneData, place_text
from aerialdojo_gen.geometry.rays import RayCaster, TriangleRayCaster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.scenes.model import Instance, Scene

if TYPE_CHECKING:
    import trimesh

_FAR_M = 10_000.0
_UP, _DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
# Of a body's columns: those that meet one layer of it, those that meet nothing below it, and of its area the part in
# plan; of the columns of the scene: those that meet ground.
_ONE_LAYER, _UNDERMOST, _LEVEL, _COVER = 0.75, 0.55, 0.55, 0.55
_PROBE_M = 1.0
_MIN_PROBES = 6
_THIN_M = 0.01
# Lattices of surveys are round numbers: rays stand between them.
_ODD_M = (0.3183, 0.2718)
_SAMPLE_M = 0.5
# Of ways aside: how far, where on the ray, and in which directions.
_ASIDE_M = 25.0
_SHARES = (0.25, 0.5, 0.75, 0.97)
_AZIMUTHS, _RISES_DEG = 24, (-15.0, 5.0, 25.0, 50.0)
_SAME_M = 1e-6
_STEP_M = 0.5
_MAX_NODES = 1_000_000


@check("anchors")
def anchor_below_ground(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """An anchor is above the ground."""
    yield from _buried(data, rows.floats("x_m", "y_m", "z_m"))


@check("routes")
def goal_below_ground(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """A goal is above the ground."""
    yield from _buried(data, rows.floats("goal_x_m", "goal_y_m", "goal_z_m"))


@check("routes", after=("list_lengths_differ", "out_of_bounds"))
def route_below_ground(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """A route stays above the ground, between its poses too."""
    ground = _ground(data)
    if ground is None:
        return
    paths = data.paths
    points, pose = _along(paths.xyz, paths.first)
    buried = _below(ground, points)
    route = paths.route_of(pose[buried])
    for row, first in zip(*np.unique(route, return_index=True), strict=True):
        at = int(np.flatnonzero(buried)[first])
        position = f"below ground at {place_text(points[at])}, after pose {pose[at] - paths.first[row]}"
        yield Finding(int(row), f"{position}, {int((route == row).sum())} samples of the way", "above ground")


def _buried(data: SceneData, places: Floats) -> Iterator[Finding]:
    ground = _ground(data)
    if ground is None:
        return
    fit = np.flatnonzero((np.abs(places) < _FAR_M).all(axis=1))
    for row in fit[_below(ground, places[fit])]:
        yield Finding(int(row), f"below ground at {place_text(places[row])}", "above ground")


def _along(xyz: Floats, first: np.ndarray) -> tuple[Floats, np.ndarray]:
    """Points of polylines no further apart than the sample, and the pose that each comes after."""
    # Poses that are no places are other checks' business.
    xyz = np.where(np.abs(xyz) < _FAR_M, xyz, np.nan)
    step = np.zeros_like(xyz)
    step[:-1] = np.diff(xyz, axis=0)
    step[first[1:] - 1] = 0.0
    length = np.nan_to_num(np.linalg.norm(step, axis=1))
    n = np.maximum(1, np.ceil(length / _SAMPLE_M)).astype(np.int64)
    pose = np.repeat(np.arange(len(xyz)), n)
    share = (np.arange(len(pose)) - np.repeat(np.cumsum(n) - n, n)) / n[pose]
    points = xyz[pose] + share[:, None] * step[pose]
    finite = np.isfinite(points).all(axis=1)
    return points[finite], pose[finite]


def _below(ground: TriangleRayCaster, points: Floats) -> Mask:
    found = ~open_above(ground, points)
    found[found] = np.isinf(ground.first_hit(points[found], np.tile(_DOWN, (found.sum(), 1)))[0])
    return found


def _ground(data: SceneData) -> TriangleRayCaster | None:
    return data.cached("ground", lambda: open_ground(data.mesh))


def open_ground(scene: Scene) -> TriangleRayCaster | None:
    """Find the sheets that a scene has for its ground, to cast rays at; None where it has none."""
    low, high = scene.bounds
    # What ends below the flight volume (level ground that was laid under an import) leaves no room between.
    standing = tuple(i for i in scene.instances if i.bounds[1, 2] >= low[2] - _THIN_M / 10)
    if not standing:
        return None
    x, y = (np.arange(a + odd, b, _PROBE_M) for a, b, odd in zip(low[:2], high[:2], _ODD_M, strict=True))
    plan = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    if not len(plan):
        return None
    under = np.column_stack([plan, np.full(len(plan), min(i.bounds[0, 2] for i in standing) - 1.0)])
    over = np.column_stack([plan, np.full(len(plan), max(i.bounds[1, 2] for i in standing) + 1.0)])
    upwards, downwards = np.tile(_UP, (len(plan), 1)), np.tile(_DOWN, (len(plan), 1))
    up, owner = RayCaster(Scene(scene.name, standing, {}, scene.bounds)).first_hit(under, upwards)
    met = np.isfinite(up)
    stored: list[trimesh.Trimesh] = []
    sheets, covered = [], np.zeros(len(plan), dtype=np.bool_)
    for k in np.flatnonzero(np.bincount(owner[met], minlength=len(standing)) >= _MIN_PROBES):
        for body in _open_bodies(standing[k]):
            box = body.bounds
            near = np.flatnonzero(((plan >= box[0, :2]) & (plan <= box[1, :2])).all(axis=1))
            if len(near) < _MIN_PROBES:
                continue
            alone = TriangleRayCaster(np.asarray(body.vertices), np.asarray(body.faces, dtype=np.int32))
            bottom, _ = alone.first_hit(under[near], upwards[near])
            top, _ = alone.first_hit(over[near], downwards[near])
            own = np.isfinite(bottom) & np.isfinite(top)
            thickness = (over[near, 2] - top) - (under[near, 2] + bottom)
            if own.sum() < _MIN_PROBES:
                continue
            normal = body.triangles_cross
            level = np.abs(normal[:, 2]).sum() >= _LEVEL * np.linalg.norm(normal, axis=1).sum()
            one_layer = (thickness[own] <= _THIN_M).mean() >= _ONE_LAYER
            undermost = (bottom[own] <= up[near][own] + _THIN_M).mean() >= _UNDERMOST
            if standing[k].surface == "ground":
                stored.append(body)
            elif one_layer and undermost and (level or own.sum() >= _COVER * met.sum()):
                sheets.append(body)
                covered[near[own]] = True
    if covered.sum() < _COVER * met.sum():
        sheets = []
    return TriangleRayCaster(*soup([*stored, *sheets])) if stored or sheets else None


def _open_bodies(instance: Instance) -> list[trimesh.Trimesh]:
    """Connected bodies of an instance that have a rim; a surface that is there from both sides counts once."""
    import trimesh

    mesh = trimesh.Trimesh(instance.vertices, instance.faces, process=False)
    mesh.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=3)
    mesh.update_faces(mesh.unique_faces() & mesh.nondegenerate_faces())
    if not len(mesh.faces):
        return []
    _, same, count = np.unique(mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True)
    rim = (count[same.reshape(-1)] == 1).reshape(-1, 3).any(axis=1)
    if not rim.any():
        return []
    label = trimesh.graph.connected_component_labels(mesh.edges, len(mesh.vertices))  # type: ignore[no-untyped-call]
    of_face = label[mesh.faces[:, 0]]
    return [trimesh.Trimesh(mesh.vertices, mesh.faces[of_face == k], process=False) for k in np.unique(of_face[rim])]


# Positions in a wall or below ground are reported by other checks.
@check("anchors", after=("anchor_surface", "anchor_clearance", "anchor_below_ground"))
def anchor_shut_in(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """From an anchor there is a free way to the open sky."""
    yield from _shut_in(data, rows.floats("x_m", "y_m", "z_m"))


@check(
    "routes",
    after=("list_lengths_differ", "out_of_bounds", "start_anchor", "route_collision", "route_below_ground"),
)
def route_shut_in(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """From a route's start, and so from all of it, there is a free way to the open sky."""
    yield from _shut_in(data, data.paths.starts[:, :3])


def _shut_in(data: SceneData, places: Floats) -> Iterator[Finding]:
    fit = np.flatnonzero((np.abs(places) < _FAR_M).all(axis=1))
    unique, which = np.unique(np.round(places[fit] / _SAME_M) * _SAME_M, axis=0, return_inverse=True)
    free = way_aside(data.rays, unique)
    if not free.all():
        free[~free] = _by_routes(data, unique[~free])
    if not free.all():
        free[~free] = over_lattice(data.rays, data.mesh.bounds, unique[~free])
    for row in fit[~free[which.reshape(-1)]]:
        yield Finding(int(row), f"shut in at {place_text(places[row])}", "a free way to the open sky")


def open_above(rays: RayCaster | TriangleRayCaster, places: Floats) -> Mask:
    """Whether nothing is straight above places, (n, 3) float64 metres; (n,) bool."""
    return np.isinf(rays.first_hit(places, np.tile(_UP, (len(places), 1)))[0])


def way_aside(rays: RayCaster, places: Floats) -> Mask:
    """Whether there is a way up, or one aside and then up, from places, (n, 3) float64 metres; (n,) bool."""
    free = open_above(rays, places)
    azimuth = 2 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS + 0.1
    rise = np.radians(_RISES_DEG)[:, None]
    aims = np.stack([np.cos(rise) * np.cos(azimuth), np.cos(rise) * np.sin(azimuth), np.sin(rise) + 0 * azimuth], -1)
    aims = aims.reshape(-1, 3)
    for k in np.flatnonzero(~free):
        far = np.minimum(rays.first_hit(np.tile(places[k], (len(aims), 1)), aims)[0], _ASIDE_M)
        ends = [places[k] + aims * (share * far)[:, None] for share in _SHARES]
        free[k] = open_above(rays, np.concatenate(ends)).any()
    return free


def _by_routes(data: SceneData, places: Floats) -> Mask:
    """Whether places lie on routes that somewhere come under the open sky."""
    paths = data.paths
    found = np.zeros(len(places), dtype=np.bool_)
    for k, place in enumerate(places):
        at = (np.abs(ends[:, :3] - place).max(axis=1) <= 1e-3 for ends in (paths.starts, paths.ends))
        routes = (int(route) for near in at for route in np.flatnonzero(near)[:20])
        found[k] = any(open_above(data.rays, paths.xyz[paths.of(route)]).any() for route in routes)
    return found


def over_lattice(rays: RayCaster, bounds: Floats, places: Floats) -> Mask:
    """Whether places (n, 3) see a lattice point that hangs together with one in the open."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = bounds[1] - bounds[0]
    step = max(_STEP_M, float(np.prod(size) / _MAX_NODES) ** (1 / 3))
    shape = np.maximum(1, (size / step).astype(np.int64))
    index = np.arange(int(np.prod(shape))).reshape(shape)
    points = (
        bounds[0] + (np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 3) + 0.5) * step
    )
    pairs: list[Ints] = []
    for axis in range(3):
        a = np.moveaxis(index, axis, 0)[:-1].reshape(-1)
        b = np.moveaxis(index, axis, 0)[1:].reshape(-1)
        hit, _ = rays.first_hit(points[a], np.tile(np.eye(3)[axis], (len(a), 1)))
        pairs.append(np.column_stack([a, b])[hit > step])
    linked = np.concatenate(pairs)
    graph = coo_array((np.ones(len(linked), np.int8), (linked[:, 0], linked[:, 1])), shape=(len(points),) * 2)
    _, label = connected_components(graph, directed=False)
    out = np.zeros(int(label.max()) + 1, dtype=np.bool_)
    top = index[:, :, -1].reshape(-1)
    out[label[top[open_above(rays, points[top])]]] = True
    found = np.zeros(len(places), dtype=np.bool_)
    for k, place in enumerate(places):
        near = np.flatnonzero(np.abs(points - place).max(axis=1) <= 1.5 * step)
        away = points[near] - place
        length = np.linalg.norm(away, axis=1)
        near, away, length = near[length > 1e-9], away[length > 1e-9], length[length > 1e-9]
        if len(near):
            hit, _ = rays.first_hit(np.tile(place, (len(near), 1)), away)
            found[k] = out[label[near[hit > length]]].any()
    return found
