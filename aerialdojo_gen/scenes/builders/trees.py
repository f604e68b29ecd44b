"""Trees, each species by its own habit of growth.

All take ``height`` (m) and ``girth`` (the trunk's radius at the ground, m) and stand on z = 0, rooted a little
below it so that no slope shows a gap.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from aerialdojo_gen.geometry.portable import norm, power
from aerialdojo_gen.scenes.builders import builder
from aerialdojo_gen.scenes.builders.growth import clump, limb, split_by_slope, vec, whorl
from aerialdojo_gen.scenes.mesh import Floats, Mesh, Parts

_ROOT_M = 0.5


def _stem(rng: np.random.Generator, height: float, lean: float, points: int = 5) -> Floats:
    """Middle line of a trunk from below the ground to `height`, wandering sideways by about `lean` metres."""
    t = np.linspace(0.0, 1.0, points)
    drift = rng.uniform(-1.0, 1.0, size=(2, 2)) * lean
    xy = power(t[:, None], 1.5) * drift[0] + np.sin(t * np.pi)[:, None] * drift[1] * 0.5
    line = np.column_stack([xy, t * height])
    return np.concatenate([[[0.0, 0.0, -_ROOT_M]], line])


def _at(line: Floats, z: float) -> Floats:
    """Point of a stem at a height, (3,)."""
    return np.array([np.interp(z, line[:, 2], line[:, 0]), np.interp(z, line[:, 2], line[:, 1]), z])


def _trunk(line: Floats, girth: float, top: float, sides: int = 7) -> Mesh:
    t = np.clip(line[:, 2] / line[-1, 2], 0.0, 1.0)
    radii = girth * power(1.0 - t, 0.8) + top
    radii[0] = radii[1] = girth * 1.35
    if len(radii) > 2:
        radii[2] = max(float(radii[2]), girth * 0.8)
    return limb(line, radii.tolist(), sides)


def _branch(rng: np.random.Generator, start: Floats, end: Floats, radius: float, sag: float = 0.0) -> Mesh:
    middle = (start + end) / 2 + rng.uniform(-0.12, 0.12, size=3) * float(norm(end - start))
    middle[2] -= sag
    return limb([start, middle, end], [radius, radius * 0.7, radius * 0.3], 4)


@builder
def spruce(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Spruce: a straight stem hidden by drooping whorls that narrow to a spire."""
    height, girth, spread = params["height"], params["girth"], params["spread"]
    clear = params["clear"]
    line = _stem(rng, height * 0.93, 0.02 * height)
    tiers = int(np.clip(round((height - clear) / 1.15), 5, 11))
    out: Parts = [("bark", _trunk(line, girth, 0.02, 6))]
    for k in range(tiers):
        t = k / (tiers - 1)
        z = clear + (height * 0.94 - clear) * math.pow(t, 0.9)
        reach = spread * math.pow(1.0 - t, 0.85) + 0.28
        if k == 0:
            reach *= 0.85
        core = _at(line, min(z, height * 0.92))
        out.append(("needles", whorl(rng, z, reach, reach * 0.42, reach * 0.3 + 0.55, 8 if t < 0.6 else 6, core[:2])))
    return out


@builder
def pine(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Scots pine: a tall bare stem, orange above, that carries flat cushions of needles near the top."""
    height, girth, spread = params["height"], params["girth"], params["spread"]
    line = _stem(rng, height * 0.9, 0.06 * height, 6)
    split = 0.45 * height
    low = np.concatenate([line[line[:, 2] < split], [_at(line, split)]])
    high = np.concatenate([[_at(line, split)], line[line[:, 2] > split]])
    middle = girth * 0.72
    out: Parts = [
        ("bark", limb(low, np.interp(low[:, 2], [0.0, split], [girth * 1.2, middle]).tolist(), 7)),
        ("upper_bark", limb(high, np.linspace(middle, girth * 0.3, len(high)).tolist(), 7)),
    ]  # fmt: skip
    cushions = 6
    turn = rng.uniform(0, 2 * np.pi)
    for k in range(cushions):
        t = k / (cushions - 1)
        angle = turn + k * 2.4
        out_m = spread * (0.75 - 0.6 * t) * rng.uniform(0.8, 1.2)
        start = _at(line, height * (0.58 + 0.28 * t))
        end = start + vec(out_m * np.cos(angle), out_m * np.sin(angle), height * 0.06)
        r = spread * rng.uniform(0.42, 0.55)
        out.append(("upper_bark", _branch(rng, start, end, girth * 0.3)))
        radii = (r, r * rng.uniform(0.8, 1.1), r * 0.42)
        out.append(("needles", clump(rng, end + vec(0.0, 0.0, 0.25), radii, 0.32, 0.45)))
    return out


@builder
def birch(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Birch: a slender white stem or two, and a light crown whose clumps hang."""
    height, girth, spread = params["height"], params["girth"], params["spread"]
    out: Parts = []
    stems = 2 if rng.random() < 0.35 else 1
    for s in range(stems):
        h = height * (1.0 if s == 0 else 0.82)
        line = _stem(rng, h * 0.92, 0.09 * h if stems == 2 else 0.04 * h)
        line[1:, :2] += (s * 1.6 * girth, s * 0.9 * girth)
        out.append(("bark", _trunk(line, girth, 0.02, 6)))
        lobes = 5 if stems == 1 else 3
        turn = rng.uniform(0, 2 * np.pi)
        for k in range(lobes):
            t = k / (lobes - 1)
            angle = turn + k * 2.4
            reach = spread * (0.55 - 0.5 * t)
            start = _at(line, h * (0.4 + 0.45 * t))
            end = start + vec(reach * np.cos(angle), reach * np.sin(angle), h * 0.1)
            if t < 0.9:
                out.append(("twigs", _branch(rng, start, end, girth * 0.28)))
            r = spread * (0.55 - 0.2 * t) * rng.uniform(0.85, 1.1)
            out.append(("leaves", clump(rng, end, (r, r, r * 1.15), 0.36, 1.15)))
    return out


@builder
def oak(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Oak: a stout trunk that divides into crooked boughs under a broad crown of many lobes."""
    height, girth, spread = params["height"], params["girth"], params["spread"]
    fork = height * rng.uniform(0.3, 0.38)
    line = _stem(rng, fork, 0.25)
    radii = [girth * 1.6, girth * 1.3, *np.linspace(girth, girth * 0.8, len(line) - 2)]
    out: Parts = [("bark", limb(line, radii, 8))]
    top = line[-1]
    boughs = 5
    turn = rng.uniform(0, 2 * np.pi)
    for k in range(boughs):
        angle = turn + k * 2 * np.pi / boughs + rng.uniform(-0.3, 0.3)
        reach = spread * rng.uniform(0.55, 0.7)
        rise = height * rng.uniform(0.2, 0.42)
        end = top + vec(reach * np.cos(angle), reach * np.sin(angle), rise)
        out.append(("bark", _branch(rng, top - vec(0.0, 0.0, 0.25), end, girth * 0.5, sag=-0.3)))
        r = spread * rng.uniform(0.42, 0.52)
        out.append(("leaves", clump(rng, end, (r, r, r * 0.75), 0.27, 0.6)))
    end = top + vec(0.0, 0.0, height * 0.42)
    out.append(("bark", _branch(rng, top, end, girth * 0.5)))
    out.append(("leaves", clump(rng, end, (spread * 0.6, spread * 0.6, spread * 0.5), 0.27, 0.6)))
    return out


@builder
def dead_tree(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Dead tree: a broken stem with bare forked branches."""
    height, girth = params["height"], params["girth"]
    line = _stem(rng, height, 0.08 * height)
    out: Parts = [("bark", _trunk(line, girth, girth * 0.22, 7))]
    for k in range(7):
        t = 0.35 + 0.6 * k / 6
        angle = k * 2.4 + rng.uniform(-0.4, 0.4)
        length = height * (0.32 - 0.16 * t) * rng.uniform(0.8, 1.25)
        start = _at(line, height * t)
        way = np.array([np.cos(angle), np.sin(angle), rng.uniform(0.25, 0.9)])
        elbow = start + way * length * 0.55
        radius = girth * (0.42 - 0.25 * t)
        bough = [start, elbow, elbow + way * length * 0.5]
        out.append(("bark", limb(bough, [radius, radius * 0.7, 0.0], 5)))
        for side in (-0.8, 0.7):
            c, s = np.cos(angle + side), np.sin(angle + side)
            end = elbow + np.array([c, s, rng.uniform(0.2, 0.8)]) * length * 0.45
            out.append(("bark", limb([elbow, end], [radius * 0.55, 0.0], 4)))
    return out


@builder
def sapling(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Young broadleaf: a thin stem with three small tufts."""
    height, girth = params["height"], params["girth"]
    line = _stem(rng, height * 0.85, 0.06 * height, 4)
    out: Parts = [("bark", _trunk(line, girth, 0.01, 5))]
    for t, r in ((0.5, 0.2), (0.7, 0.24), (0.92, 0.18)):
        angle = rng.uniform(0, 2 * np.pi)
        p = _at(line, height * t * 0.9) + vec(np.cos(angle) * height * 0.1, np.sin(angle) * height * 0.1, 0.0)
        out.append(("leaves", clump(rng, p, (r * height, r * height, r * height * 0.85), 0.38, 0.8)))
    return out


@builder
def young_spruce(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Young spruce: dense whorls down to the ground."""
    height = params["height"]
    out: Parts = [("bark", limb([(0, 0, -0.3), (0, 0, height * 0.5)], [0.06, 0.03], 5))]
    for k in range(5):
        t = k / 4
        reach = height * (0.36 * (1 - t) + 0.06)
        out.append(("needles", whorl(rng, height * (0.14 + 0.7 * t), reach, reach * 0.35, height * 0.2, 6)))
    return out


@builder
def fallen_log(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Fallen trunk along y with torn root plate, stubs of branches and cut face."""
    length, girth = params["length"], params["girth"]
    bend = rng.uniform(-0.04, 0.04) * length
    middle = [(0.0, -length / 2, 0.0), (bend, -length / 6, 0.0), (bend, length / 6, 0.0), (0.0, length / 2, 0.0)]
    line = np.array(middle) + vec(0.0, 0.0, girth * 0.8)
    radii = np.linspace(girth, girth * 0.72, len(line))
    out: Parts = [("bark", limb(line, radii.tolist(), 9))]
    y = length / 2
    out.append(("cut", limb([(0, y - 0.01, girth * 0.8), (0, y + 0.03, girth * 0.8)], [girth * 0.62] * 2, 9)))
    for _ in range(4):
        s = rng.uniform(-0.35, 0.42) * length
        angle = rng.uniform(0.1, 0.9) * np.pi
        way = np.array([np.cos(angle), rng.uniform(-0.3, 0.3), np.sin(angle)])
        start = np.array([0.0, s, girth * 0.8])
        out.append(("bark", limb([start, (start + way * girth * rng.uniform(1.8, 3.4))], [0.07, 0.025], 5)))
    for k in range(7):
        angle = k * 2 * np.pi / 7 + rng.uniform(-0.2, 0.2)
        start = np.array([0.0, -length / 2 + 0.1, girth * 0.8])
        way = np.array([np.cos(angle), rng.uniform(-0.7, -0.3), np.sin(angle)]) * girth * rng.uniform(1.5, 2.3)
        end = start + way
        end[2] = max(float(end[2]), -0.25)
        out.append(("bark", limb([start, end], [girth * 0.4, 0.0], 5)))
    ends = line[1] + 0.5 * (line[0] - line[1]), line[2] + 0.7 * (line[3] - line[2])
    covered = np.array([ends[0], line[1], line[2], ends[1]]) + vec(0.0, 0.0, girth * 0.24)
    out.append(("moss", limb(covered, np.linspace(girth * 0.8, girth * 0.66, len(covered)).tolist(), 9)))
    return out


@builder
def stump(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Sawn stump with spreading roots and a pale cut face."""
    height, girth = params["height"], params["girth"]
    line = [(0, 0, -0.4), (0, 0, 0.0), (0, 0, 0.22), (0, 0, height)]
    out: Parts = [("bark", limb(line, [girth * 1.3, girth * 1.25, girth, girth * 0.95], 10))]
    out.append(("cut", limb([(0, 0, height - 0.01), (0, 0, height + 0.02)], [girth * 0.84] * 2, 10)))
    for k in range(5):
        angle = k * 2 * np.pi / 5 + rng.uniform(-0.3, 0.3)
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        far = way * girth * rng.uniform(1.8, 2.4)
        root = [way * girth * 0.6 + vec(0, 0, 0.22), far * 0.8 + vec(0, 0, 0.02), far + vec(0, 0, -0.3)]
        out.append(("bark", limb(root, [girth * 0.34, girth * 0.24, 0.0], 5)))
    return out


# Cosine of the steepest twigs that still hold snow.
_HOLDS = 0.5


@builder
def snowy_spruce(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Spruce whose upper sides carry snow; `load` is the share of its tiers that are white, from the top down."""
    grown = spruce(rng, params)
    tiers = [k for k, (role, _) in enumerate(grown) if role == "needles"]
    out: Parts = []
    for k, (role, body) in enumerate(grown):
        if role != "needles" or tiers.index(k) < len(tiers) * (1.0 - params["load"]):
            out.append((role, body))
            continue
        white, green = split_by_slope(body, _HOLDS)
        out += [("snow", white), ("needles", green)]
    return [(role, body) for role, body in out if len(body.faces)]
