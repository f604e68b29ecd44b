"""Segment unstructured meshes: by connectivity, by material, and by what rises from the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import chain, product

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from aerialdojo_gen.geometry.columns import Plan, lowest_of
from aerialdojo_gen.imports.cutting import connected_bodies
from aerialdojo_gen.imports.raw import RawNode, bounds_of, extract_faces, merge_nodes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Cells = frozenset[tuple[int, int]]

_TOUCH_M = 0.3
# Wide nodes in many pieces are soups; a single thing this wide may be several.
_WIDE_M, _SPREAD_M = 60.0, 100.0
_MAX_PIECE_SHARE = 0.6
# Open bodies at least this share of the extent wide are ground.
_GROUND_SHARE = 0.25
_CELL_M = 1.0
_MAX_CELLS = 4_000_000
# Windows, in cells, of progressive morphological openings (Zhang et al. 2003).
_WINDOWS = (3, 5, 9, 17, 33, 65)
_SLOPE, _STEP_M, _HIGHEST_STEP_M, _HOUSE_M = 0.35, 0.4, 3.0, 35.0
_ABOVE_M = 0.4
# Minimum height, area and share of walls of a thing that rises from the ground.
_THING_M, _THING_M2, _WALLS, _STEEP = 1.2, 2.0, 0.2, 0.6
_MAP_M = 0.5
_MAX_MAPPED = 20_000


@dataclass
class SplitStats:
    """Statistics of a segmentation."""

    pieces: int = 0  # Connected pieces of soups, and the things made of them
    things: int = 0
    materials: int = 0  # Pieces of one material from wide connected bodies
    attached: int = 0  # Things that were connected to the ground
    soups: list[str] = field(default_factory=list)

    def lines(self) -> list[str]:
        """Format the statistics, one line each."""
        if not self.soups:
            return []
        of = "the only node" if self.soups == [""] else f"{len(self.soups):,} node{'s' * (len(self.soups) > 1)}"
        out = [f"segmented {of}: {self.pieces:,} connected pieces into {self.things:,} things"]
        if self.materials:
            out.append(f"{self.materials:,} pieces are of wide bodies that were segmented by material")
        if self.attached:
            were = "thing was" if self.attached == 1 else "things were"
            out.append(f"{self.attached:,} {were} one surface with the ground, now separated from it")
        return out


def split_components(bodies: Sequence[RawNode]) -> tuple[list[RawNode], SplitStats]:
    """Segment unstructured meshes (z up, metres) into things; nodes that are single things stay whole."""
    stats = SplitStats()
    low, high = bounds_of(bodies)
    out: list[RawNode] = []
    for body in bodies:
        pieces = _connected(body)
        if len(bodies) > 1 and not _is_soup(body, pieces):
            out.append(body)
            continue
        stats.soups.append(body.name if len(bodies) > 1 else "")
        if len(bodies) == 1 and len(pieces) > 1:
            # The name of a file's only node does not name the things in it.
            pieces = [replace(piece, name="") for piece in pieces]
        stats.pieces += len(pieces)
        ground_bodies, things = [], []
        for piece in pieces:
            if _is_ground_surface(piece, low, high):
                ground, attached = _ground_and_things(piece)
                attached = [replace(thing, name="") for thing in attached]
                stats.attached += len(attached)
                ground_bodies += [ground] if len(ground.faces) else []
                things += attached
            elif (np.ptp(piece.vertices[:, :2], axis=0) > _WIDE_M).any() and ((kind := _materials(piece)) > 0).any():
                same = (extract_faces(piece, np.flatnonzero(kind == k)) for k in np.unique(kind))
                parts = [part for one in same for part in _connected(one)]
                stats.materials += len(parts)
                things += parts
            else:
                things.append(piece)
        gathered = _group_pieces(things)
        stats.things += len(ground_bodies) + len(gathered)
        out += [*ground_bodies, *gathered]
    return out, stats


def _connected(body: RawNode) -> list[RawNode]:
    """Split a body into its connected pieces, in the order of their first faces."""
    label, _ = connected_bodies(body.faces, len(body.vertices))
    order = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    groups = sorted((np.sort(rows) for rows in np.split(order, cuts) if len(rows)), key=lambda rows: int(rows[0]))
    return [extract_faces(body, rows) for rows in groups]


def _is_soup(body: RawNode, pieces: Sequence[RawNode]) -> bool:
    size = np.ptp(body.vertices[:, :2], axis=0)
    if len(pieces) < 2 or (size < _SPREAD_M).any():
        return False
    return all((np.ptp(p.vertices[:, :2], axis=0) < _MAX_PIECE_SHARE * size).all() for p in pieces)


def _materials(body: RawNode) -> Ints:
    """Label faces by colour and material, from 0; (m,) int64."""
    surface = np.full(len(body.faces), -1) if body.surface is None else body.surface
    _, kind = np.unique(np.column_stack([body.colours // 16, surface]), axis=0, return_inverse=True)
    return np.asarray(kind.reshape(-1), dtype=np.int64)


def _is_ground_surface(body: RawNode, low: Floats, high: Floats) -> bool:
    """Whether a body is wide, open and level enough to be ground."""
    size = np.ptp(body.vertices[:, :2], axis=0)
    if (size < _GROUND_SHARE * (high - low)[:2]).any() or (size < 10.0).any():
        return False
    _, closed = connected_bodies(body.faces, len(body.vertices))
    normal = body.normals
    level = np.abs(normal[:, 2]).sum() >= 0.3 * np.linalg.norm(normal, axis=1).sum()
    return bool(not closed.all() and level)


def _ground_and_things(body: RawNode) -> tuple[RawNode, list[RawNode]]:
    """Separate what rises from a surface; the ground gets a hole there."""
    floor, plan = _floor(body)
    middle = body.vertices[body.faces].mean(axis=1)
    cell = np.clip(((middle[:, :2] - plan.low) / plan.step_m).astype(np.int64), 0, np.array(plan.shape) - 1)
    raised = middle[:, 2] - floor[cell[:, 0], cell[:, 1]] > _ABOVE_M
    if not raised.any():
        return body, []
    label, _ = connected_bodies(body.faces[raised], len(body.vertices))
    rows = np.flatnonzero(raised)
    things = [own for k in range(int(label.max()) + 1) if _is_thing(body, own := rows[label == k])]
    rest = np.ones(len(body.faces), dtype=np.bool_)
    rest[np.concatenate([np.zeros(0, np.int64), *things])] = False
    return extract_faces(body, np.flatnonzero(rest)), [extract_faces(body, own) for own in things]


def _floor(body: RawNode) -> tuple[Floats, Plan]:
    """Bare ground heights on a lattice: openings remove what is narrow and high."""
    low, high = (corner[:2] for corner in bounds_of([body]))
    step = max(_CELL_M, float(np.sqrt(np.prod(high - low) / _MAX_CELLS)))
    plan = Plan.over(low, high, step)
    surface = lowest_of(body.vertices[body.faces].reshape(-1, 9), plan)
    empty = np.isnan(surface)
    if empty.all():
        return np.full(plan.shape, float(body.vertices[:, 2].min())), plan
    nearest = scipy.ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
    surface = surface[tuple(nearest)]
    before = 1
    for window in _WINDOWS:
        if window > min(plan.shape):
            break
        opened = scipy.ndimage.grey_opening(surface, size=(window, window), mode="nearest")
        step_m = _STEP_M + _SLOPE * (window - before) * step
        # A one-storey house is not a hill; anything wider may be one.
        step_m = min(step_m, _HIGHEST_STEP_M) if window * step < _HOUSE_M else step_m
        surface = np.where(surface - opened > step_m, opened, surface)
        before = window
    return surface, plan


def _is_thing(body: RawNode, rows: Ints) -> bool:
    size = np.ptp(body.vertices[body.faces[rows]].reshape(-1, 3), axis=0)
    normal = body.select_faces(rows).normals
    area = np.linalg.norm(normal, axis=1)
    steep = area[np.abs(normal[:, 2]) < _STEEP * area].sum() / max(float(area.sum()), 1e-12)
    covers = np.abs(normal[:, 2]).sum() / 2 >= _THING_M2
    return bool(size[2] >= _THING_M and covers and steep >= _WALLS and (size[:2] <= _WIDE_M).all())


def _group_pieces(pieces: Sequence[RawNode]) -> list[RawNode]:
    """Assign pieces to the smallest larger one around them, and what carries a wider one to it: a trunk, walls."""
    if not pieces:
        return []
    low = np.array([p.vertices.min(axis=0) for p in pieces])
    high = np.array([p.vertices.max(axis=0) for p in pieces])
    size = np.linalg.norm(high - low, axis=1)
    order = np.argsort(size, kind="stable")
    owner = np.arange(len(pieces))
    cells = cache(lambda k: _cells(pieces[k]))
    for rank, k in enumerate(order):
        larger = order[rank + 1 :]
        encloses = (low[larger] <= low[k] + _TOUCH_M).all(axis=1) & (high[larger] >= high[k] - _TOUCH_M).all(axis=1)
        encloses &= size[larger] > 1.5 * size[k]
        for j in larger[encloses]:
            if _lies_over(cells(int(j)), cells(int(k))):
                owner[k] = j
                break
    flat_low, flat_high = low[:, :2] - _TOUCH_M, high[:, :2] + _TOUCH_M
    for k in order:
        wider = (flat_low <= low[k, :2]).all(axis=1) & (flat_high >= high[k, :2]).all(axis=1)
        top = high[k, 2]
        above = (low[:, 2] > low[k, 2]) & (low[:, 2] <= top + _TOUCH_M) & (high[:, 2] >= top - _TOUCH_M)
        carried = np.flatnonzero(wider & above & (np.arange(len(pieces)) != k)).tolist()
        # Of several, the lowest: the beam of a roof before the roof.
        j = min(carried, key=lambda j: (float(low[j, 2]), j), default=k)
        if j != k and owner[k] == k and _lies_over(cells(j), cells(int(k))):
            owner[k] = j
    for _ in range(len(pieces)):
        if (owner == owner[owner]).all():
            break
        owner = owner[owner]
    groups: dict[int, list[RawNode]] = {}
    for k, piece in enumerate(pieces):
        groups.setdefault(int(owner[k]), []).append(piece)
    return [merge_nodes(pieces[k].name, members) for k, members in sorted(groups.items())]


def _lies_over(larger: Cells | None, smaller: Cells | None) -> bool:
    """Whether half of a piece's plan lies over or next to another's: a fence does not contain the house inside."""
    return larger is None or smaller is None or 2 * len(smaller & larger) >= len(smaller)


def _cells(body: RawNode) -> Cells | None:
    """Grid cells under a body's triangles and around them; None if there are too many."""
    corners = body.vertices[body.faces][:, :, :2]
    first = np.floor((corners.min(axis=1) - _TOUCH_M) / _MAP_M).astype(np.int64)
    last = np.floor((corners.max(axis=1) + _TOUCH_M) / _MAP_M).astype(np.int64)
    spans = np.unique(np.column_stack([first, last]), axis=0)
    if ((spans[:, 2] - spans[:, 0] + 1) * (spans[:, 3] - spans[:, 1] + 1)).sum() > _MAX_MAPPED:
        return None
    blocks = (product(range(x0, x1 + 1), range(y0, y1 + 1)) for x0, y0, x1, y1 in spans.tolist())
    return frozenset(chain.from_iterable(blocks))
