"""How much of a target the four views of a start pose show."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerialdojo_gen.base.constants import VIEWS
from aerialdojo_gen.base.kernels import njit
from aerialdojo_gen.geometry.rays import TriangleRayCaster

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Codes = NDArray[np.int8]

# So many rays a pose find triangles that hide the target; most of the others meet one of these too.
_PROBES = 16
# Rays end that much before the point (`TriangleRayCaster.unobstructed`). A ray must miss a triangle's edges, and meet
# its plane before that, by the margin: float32 then decides no other way. Flatter and nearer triangles are left out.
_TOLERANCE_M, _MARGIN_M, _LEAST_COSINE, _NEAR_M = 5e-3, 2e-3, 0.01, 0.05
_FRONT, _LEFT, _RIGHT, _DOWN = (VIEWS.index(view) for view in ("front", "left", "right", "down"))


@njit(cache=True)
def view_towards(x: float, y: float, z: float, cos: float, sin: float) -> int:
    """Index into `VIEWS` of the 90° view that holds a direction, world frame, at a yaw with this cosine and sine.

    The first one where two meet; -1 behind and above.
    """
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
def _hidden(planes: Floats, x: float, y: float, z: float) -> bool:
    """Whether a point, seen from the eye, lies in the shadow of a triangle (`_shadow`)."""
    length = np.sqrt(x * x + y * y + z * z)
    behind = planes[3, 0] * x + planes[3, 1] * y + planes[3, 2] * z
    if behind < planes[3, 3] + _TOLERANCE_M + _MARGIN_M or behind < _LEAST_COSINE * length:
        return False
    inside = True
    for a in range(3):
        inside = inside and planes[a, 0] * x + planes[a, 1] * y + planes[a, 2] * z >= planes[a, 3] * length
    return inside


@njit(cache=True)
def _undecided(
    points: Floats, box: Floats, poses: Floats, faces: Ints, triangles: Floats, normals: Floats
) -> tuple[Ints, Ints, Codes]:
    """Poses and points in a view that no triangle among the pose's faces (n, p) surely parts, with their views."""
    n, m = len(poses), len(points)
    row, column, view, count = np.empty(n * m, np.int32), np.empty(n * m, np.int32), np.empty(n * m, np.int8), 0
    left, planes = np.empty(m, np.int32), np.empty((4, 4))
    for i in range(n):
        eye = poses[i]
        cos, sin = np.cos(eye[3]), np.sin(eye[3])
        many = m
        for k in range(m):
            left[k] = k
        for j in range(faces.shape[1]):
            f = faces[i, j]
            fresh = f >= 0
            for earlier in range(j):
                fresh = fresh and faces[i, earlier] != f
            if not fresh or not _shadow(triangles[f], normals[f], eye, planes):
                continue
            # A shadow is convex: where the corners of the points' box lie in it, all points do.
            corner = 0
            while corner < 8 and _hidden(
                planes,
                box[corner & 1, 0] - eye[0],
                box[corner >> 1 & 1, 1] - eye[1],
                box[corner >> 2, 2] - eye[2],
            ):
                corner += 1
            if corner == 8:
                many = 0
                break
            kept = 0
            for n_left in range(many):
                k = left[n_left]
                if not _hidden(planes, points[k, 0] - eye[0], points[k, 1] - eye[1], points[k, 2] - eye[2]):
                    left[kept] = k
                    kept += 1
            many = kept
        for n_left in range(many):
            k = left[n_left]
            seen_by = view_towards(points[k, 0] - eye[0], points[k, 1] - eye[1], points[k, 2] - eye[2], cos, sin)
            if seen_by >= 0:
                row[count], column[count], view[count] = i, k, seen_by
                count += 1
    return row[:count], column[:count], view[:count]


def start_visibility(
    scene: TriangleRayCaster, own: TriangleRayCaster, points: ArrayLike, poses: ArrayLike
) -> tuple[Floats, NDArray[np.int64]]:
    """Share of an object's points (m, 3) seen from each pose (n, 4).

    And the view that sees most of them (-1 for none).
    """
    p, q = np.asarray(points, dtype=np.float64), np.asarray(poses, dtype=np.float64)
    pose, point, view = _left_to_cast(scene, p, q)
    free = scene.unobstructed(q[pose, :3], p[point])
    pose, point, view = pose[free], point[free], view[free]
    votes = np.bincount(pose * len(VIEWS) + view, minlength=len(q) * len(VIEWS)).reshape(len(q), -1)
    some = np.flatnonzero(votes.any(axis=1))
    share = np.zeros(len(q))
    # What the target itself hides matters only where something is seen.
    facing = np.zeros((len(q), len(p)), dtype=np.bool_)
    facing[pose, point] = True
    rest, hidden = np.nonzero(~facing[some])
    facing[some[rest], hidden] = own.unobstructed(q[some[rest], :3], p[hidden])
    share[some] = votes[some].sum(axis=1) / facing[some].sum(axis=1)
    return share, np.where(votes.any(axis=1), votes.argmax(axis=1), -1)


def _left_to_cast(scene: TriangleRayCaster, points: Floats, poses: Floats) -> tuple[Ints, Ints, Codes]:
    """Poses, points and views of the rays to cast: a few rays a pose tell which triangles hide most of the points."""
    probes = points[:: max(1, len(points) // _PROBES)]
    origins = np.repeat(poses[:, :3], len(probes), axis=0)
    _, faces = scene.first_hit(origins, np.tile(probes, (len(poses), 1)) - origins)
    box = np.stack([points.min(axis=0), points.max(axis=0)])
    return _undecided(points, box, poses, faces.reshape(len(poses), len(probes)), *scene.triangles)
