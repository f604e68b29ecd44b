"""How much of a target the four views of a start pose show."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.constants import VIEWS
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.arrays import Flags, Floats, Int32s, Ints
from aerialdojo_gen.geometry.rays import TriangleRayCaster
from aerialdojo_gen.geometry.triangles import morton_codes

Codes = NDArray[np.int8]

# So many rays a pose find triangles that hide the target; most of the others meet one of these too.
_PROBES = 16
# Points are tested together: all, then a quarter of them, and so on down to so many neighbours.
_BALL, _PARTS = 16, 4
# Rays cost less than a triangle that covers a smaller share of the target.
_LEAST_SHARE = 0.02
# Rays end that much before the point (`TriangleRayCaster.unobstructed`). A ray must miss a triangle's edges, and meet
# its plane before that, by the margin: float32 then decides no other way. Flatter and nearer triangles are left out.
_TOLERANCE_M, _MARGIN_M, _LEAST_COSINE, _NEAR_M = 5e-3, 2e-3, 0.01, 0.05
_FRONT, _LEFT, _RIGHT, _DOWN = (VIEWS.index(view) for view in ("front", "left", "right", "down"))


@njit(cache=True)
def view_towards(x: float, y: float, z: float, cos: float, sin: float) -> int:
    """Index into `VIEWS` of the first 90° view that holds a direction (world) at a yaw; -1 behind and above."""
    forward, left = cos * x + sin * y, cos * y - sin * x
    ahead, across, up = abs(forward), abs(left), abs(z)
    if forward > 0 and across <= ahead and up <= ahead:
        return _FRONT
    if left > 0 and ahead <= across and up <= across:
        return _LEFT
    if left < 0 and ahead <= across and up <= across:
        return _RIGHT
    if z < 0 and ahead <= up and across <= up:
        return _DOWN
    return -1


@njit(cache=True)
def _shadow(corners: Floats, normal: Floats, eye: Floats, planes: Floats) -> bool:
    """Write the cone of the rays from an eye that surely meet a triangle (3, 3) into planes (4, 4); False for none.

    Its points v, seen from the eye, have planes[a, :3] · v >= planes[a, 3] |v| for the edges a; the last plane is the
    triangle's own, with its distance.
    """
    height = 0.0
    for a in range(3):
        height += normal[a] * (corners[0, a] - eye[a])
    side = 1.0 if height > 0.0 else -1.0
    planes[3, 3] = side * height
    if planes[3, 3] < _NEAR_M:
        return False
    for a in range(3):
        planes[3, a] = side * normal[a]
    for a in range(3):
        p, q = corners[a], corners[(a + 1) % 3]
        px, py, pz = p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]
        qx, qy, qz = q[0] - eye[0], q[1] - eye[1], q[2] - eye[2]
        x, y, z = side * (py * qz - pz * qy), side * (pz * qx - px * qz), side * (px * qy - py * qx)
        area = np.sqrt(x * x + y * y + z * z)
        edge = np.sqrt((qx - px) * (qx - px) + (qy - py) * (qy - py) + (qz - pz) * (qz - pz))
        if not area > _NEAR_M * edge:
            return False
        planes[a, 0], planes[a, 1], planes[a, 2] = x / area, y / area, z / area
        planes[a, 3] = 2.0 * _MARGIN_M * edge / area
    return True


@njit(cache=True)
def _is_smaller(corners: Floats, normal: Floats, eye: Floats, least: float) -> bool:
    """Whether an eye sees a triangle under a solid angle of less than about so many steradians."""
    height = twice = square = 0.0
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        height += normal[a] * (corners[0, a] - eye[a])
        twice += normal[a] * (
            (corners[1, b] - corners[0, b]) * (corners[2, c] - corners[0, c])
            - (corners[1, c] - corners[0, c]) * (corners[2, b] - corners[0, b])
        )
        middle = (corners[0, a] + corners[1, a] + corners[2, a]) / 3.0 - eye[a]
        square += middle * middle
    return abs(height * twice) < 2.0 * least * square * np.sqrt(square)


@njit(cache=True)
def _hidden(planes: Floats, x: float, y: float, z: float, radius: float, length: float) -> int:
    """Whether a ball, seen from the eye, lies in a triangle's shadow (`_shadow`): 1 for all of it, -1 for nothing."""
    inside = planes[3, 0] * x + planes[3, 1] * y + planes[3, 2] * z
    if inside + radius < planes[3, 3]:
        return -1
    least, most = inside - radius, length + radius
    whole = least >= planes[3, 3] + _TOLERANCE_M + _MARGIN_M and least >= _LEAST_COSINE * most
    for a in range(3):
        inside = planes[a, 0] * x + planes[a, 1] * y + planes[a, 2] * z
        if inside + radius < 0.0:
            return -1
        whole = whole and inside - radius >= planes[a, 3] * most
    return 1 if whole else 0


@njit(cache=True)
def _uncovered(
    points: Floats, balls: Floats, ranges: Int32s, poses: Floats, faces: Int32s, triangles: Floats, normals: Floats
) -> Flags:
    """Points that no triangle among the pose's faces (n, p) surely hides: (n, m) bool."""
    n, m = len(poses), len(points)
    out = np.ones((n, m), np.bool_)
    at, planes = np.empty((len(balls), 4)), np.empty((4, 4))
    for i in range(n):
        ex, ey, ez = poses[i, 0], poses[i, 1], poses[i, 2]
        total, placed = m, False
        x, y, z = balls[0, 0] - ex, balls[0, 1] - ey, balls[0, 2] - ez
        # At least `_NEAR_M`: the eye may be at the ball's centre.
        away = max(x * x + y * y + z * z, _NEAR_M * _NEAR_M)
        least = _LEAST_SHARE * np.pi * balls[0, 3] * balls[0, 3] / away
        for j in range(faces.shape[1]):
            f = faces[i, j]
            fresh = f >= 0
            for earlier in range(j):
                fresh = fresh and faces[i, earlier] != f
            if not fresh or _is_smaller(triangles[f], normals[f], poses[i], least):
                continue
            if not _shadow(triangles[f], normals[f], poses[i], planes):
                continue
            if not placed:
                placed = True
                for b in range(len(balls)):
                    x, y, z = balls[b, 0] - ex, balls[b, 1] - ey, balls[b, 2] - ez
                    at[b, 0], at[b, 1], at[b, 2], at[b, 3] = x, y, z, np.sqrt(x * x + y * y + z * z)
            # Into the balls on the shadow's border, past those within it and outside.
            b = 0
            while b < len(balls):
                part = _hidden(planes, at[b, 0], at[b, 1], at[b, 2], balls[b, 3], at[b, 3])
                if part == 0 and ranges[b, 2] > b + 1:
                    b += 1
                    continue
                if part >= 0:
                    for k in range(ranges[b, 0], ranges[b, 1]):
                        if out[i, k]:
                            x, y, z = points[k, 0] - ex, points[k, 1] - ey, points[k, 2] - ez
                            if part > 0 or _hidden(planes, x, y, z, 0.0, np.sqrt(x * x + y * y + z * z)) > 0:
                                out[i, k] = False
                                total -= 1
                b = ranges[b, 2]
            if total == 0:
                break
    return out


@njit(cache=True)
def _in_view(points: Floats, poses: Floats, uncovered: Flags) -> tuple[Int32s, Int32s, Codes]:
    """Poses and points of a mask (n, m) that a view holds, and by which view."""
    n, m = uncovered.shape
    row, column, view, count = np.empty(n * m, np.int32), np.empty(n * m, np.int32), np.empty(n * m, np.int8), 0
    for i in range(n):
        x, y, z = poses[i, 0], poses[i, 1], poses[i, 2]
        cos, sin = np.cos(poses[i, 3]), np.sin(poses[i, 3])
        for k in range(m):
            if uncovered[i, k]:
                seen_by = view_towards(points[k, 0] - x, points[k, 1] - y, points[k, 2] - z, cos, sin)
                if seen_by >= 0:
                    row[count], column[count], view[count] = i, k, seen_by
                    count += 1
    return row[:count], column[:count], view[:count]


@lru_cache(maxsize=4)
def _ranges(n: int) -> Int32s:
    """First and end of each part of n points that is tested together, and the next range outside it; (k, 3)."""
    rows: list[list[int]] = []

    def add(begin: int, end: int, size: int) -> None:
        row = [begin, end, 0]
        rows.append(row)
        size //= _PARTS
        if size >= _BALL:
            for k in range(begin, end, size):
                add(k, min(k + size, end), size)
        row[2] = len(rows)

    size = _BALL
    while size < n:
        size *= _PARTS
    add(0, n, size)
    return np.array(rows, dtype=np.int32)


@njit(cache=True)
def _balls(points: Floats, ranges: Int32s) -> Floats:
    """Centre and radius of a ball around each range of points, (k, 4)."""
    out = np.zeros((len(ranges), 4))
    for b in range(len(ranges)):
        group = points[ranges[b, 0] : ranges[b, 1]]
        for a in range(3):
            out[b, a] = (group[:, a].min() + group[:, a].max()) / 2.0
        for k in range(len(group)):
            x, y, z = group[k, 0] - out[b, 0], group[k, 1] - out[b, 1], group[k, 2] - out[b, 2]
            out[b, 3] = max(out[b, 3], np.sqrt(x * x + y * y + z * z))
    return out


def start_visibility(
    scene: TriangleRayCaster, own: TriangleRayCaster, points: ArrayLike, poses: ArrayLike
) -> tuple[Floats, Ints]:
    """Share of an object's points (m, 3) seen from each pose (n, 4), and the view that sees most (-1 for none)."""
    p, q = np.asarray(points, dtype=np.float64), np.asarray(poses, dtype=np.float64)
    p = p[np.argsort(morton_codes(p, 10), kind="stable")]
    pose, point, view = _in_view(p, q, _left_to_cast(scene, p, q))
    free = scene.unobstructed(q[:, :3], p, ends=(pose, point))
    pose, point, view = pose[free], point[free], view[free]
    votes = np.bincount(pose * len(VIEWS) + view, minlength=len(q) * len(VIEWS)).reshape(len(q), -1)
    some = np.flatnonzero(votes.any(axis=1))
    share = np.zeros(len(q))
    # What the target itself hides matters only where something is seen.
    unseen = np.ones((len(q), len(p)), dtype=np.bool_)
    unseen[pose, point] = False
    rest, hidden = (k.astype(np.int32) for k in np.nonzero(unseen[some] & _left_to_cast(own, p, q[some])))
    facing = own.unobstructed(q[some, :3], p, ends=(rest, hidden))
    seen = votes[some].sum(axis=1)
    share[some] = seen / (seen + np.bincount(rest[facing], minlength=len(some)))
    return share, np.where(votes.any(axis=1), votes.argmax(axis=1), -1)


def _left_to_cast(caster: TriangleRayCaster, points: Floats, poses: Floats) -> Flags:
    """Points (n, m) to cast rays to: a few rays a pose tell which triangles hide most of them."""
    probes = points[:: max(1, len(points) // _PROBES)]
    origins = np.repeat(poses[:, :3], len(probes), axis=0)
    _, faces = caster.first_hit(origins, np.tile(probes, (len(poses), 1)) - origins)
    ranges = _ranges(len(points))
    faces = faces.reshape(len(poses), len(probes))
    return _uncovered(points, _balls(points, ranges), ranges, poses, faces, *caster.triangles)
