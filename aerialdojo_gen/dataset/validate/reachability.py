"""Checks for reachability: anchors, starts and goals have a free way to the open sky.

The generator knows it by its clearance grid. Here it is looked for by rays alone, in ways that grow longer: straight
up; aside and then up; along the routes, which are certified to be free; and last over a lattice of places that see
one another. That the way out does not come up through the ground from below is the business of `underground`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aerialdojo_gen.dataset.validate.registry import Finding, check
from aerialdojo_gen.dataset.validate.rows import Floats, Ints, Mask, Rows, SceneData, place_text
from aerialdojo_gen.geometry.rays import RayCaster

_FAR_M = 10_000.0
_ASIDE_M = 25.0
_SHARES = (0.25, 0.5, 0.75, 0.97)
_AZIMUTHS, _RISES_DEG = 24, (-15.0, 5.0, 25.0, 50.0)
_SAME_M = 1e-6
_STEP_M = 0.5
_MAX_NODES = 1_000_000


# Positions in a wall or below ground are reported by other checks.
@check("anchors", needs=("mesh",), after=("anchor_surface", "anchor_clearance", "anchor_below_ground"))
def anchor_shut_in(data: SceneData, rows: Rows) -> Iterator[Finding]:
    """From an anchor there is a free way to the open sky."""
    yield from _shut_in(data, rows.floats("x_m", "y_m", "z_m"))


@check(
    "routes",
    needs=("mesh",),
    after=("list_lengths_differ", "out_of_bounds", "start_anchor", "route_collision", "route_below_ground"),
)
def route_shut_in(data: SceneData, _rows: Rows) -> Iterator[Finding]:
    """From a route's start, and so from all of it, there is a free way to the open sky."""
    yield from _shut_in(data, data.paths.starts[:, :3])


def _shut_in(data: SceneData, places: Floats) -> Iterator[Finding]:
    fit = np.flatnonzero((np.abs(places) < _FAR_M).all(axis=1))
    unique, which = np.unique(np.round(places[fit] / _SAME_M) * _SAME_M, axis=0, return_inverse=True)
    free = _have_a_way(data, unique)
    for row in fit[~free[which.reshape(-1)]]:
        yield Finding(int(row), f"shut in at {place_text(places[row])}", "a free way to the open sky")


def _have_a_way(data: SceneData, places: Floats) -> Mask:
    free = way_aside(data.rays, places)
    if not free.all():
        free[~free] = _by_routes(data, places[~free])
    if not free.all():
        free[~free] = over_lattice(data.rays, data.mesh.bounds, places[~free])
    return free


def open_above(rays: RayCaster, places: Floats) -> Mask:
    """Whether nothing is straight above places, (n, 3) float64 metres; (n,) bool."""
    if not len(places):
        return np.zeros(0, dtype=np.bool_)
    return np.isinf(rays.first_hit(places, np.tile([0.0, 0.0, 1.0], (len(places), 1)))[0])


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
    for ends in (paths.starts, paths.ends):
        for k, place in enumerate(places):
            for route in np.flatnonzero(np.abs(ends[:, :3] - place).max(axis=1) <= 1e-3)[:20]:
                found[k] = found[k] or bool(open_above(data.rays, paths.xyz[paths.of(int(route))]).any())
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
