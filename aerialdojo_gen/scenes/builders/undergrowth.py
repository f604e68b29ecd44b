"""Shrubs, ferns, reeds, mushrooms and rocks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aerialdojo_gen.scenes.builders import builder
from aerialdojo_gen.scenes.builders.growth import blade, clump, limb, split_by_slope, stone, vec
from aerialdojo_gen.scenes.mesh import Parts, translated
from aerialdojo_gen.scenes.shapes import lathe, sphere


@builder
def bush(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Bush of three clumps with berries or blossoms on its outside."""
    height, berries = params["height"], round(params["berries"])
    out: Parts = []
    for k in range(3):
        angle = k * 2.1 + rng.uniform(-0.4, 0.4)
        r = height * rng.uniform(0.42, 0.55)
        p = np.array([np.cos(angle) * r * 0.65, np.sin(angle) * r * 0.65, height * 0.42])
        out.append(("leaves", clump(rng, p, (r, r, height * rng.uniform(0.4, 0.52)), 0.3, 1.0)))
        out.append(("stem", limb([vec(0.0, 0.0, -0.2), p], [0.05, 0.02], 5)))
    skin = np.concatenate([body.vertices for role, body in out if role == "leaves"])
    skin = skin[skin[:, 2] > 0.2 * height]
    for p in skin[rng.permutation(len(skin))[:berries]]:
        out.append(("berry", translated(sphere(radius=0.055, subdivisions=0), p)))
    return out


@builder
def fern(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Fern: a funnel of arching fronds."""
    spread = params["spread"]
    fronds = 11
    out: Parts = []
    for k in range(fronds):
        angle = (k + rng.uniform(-0.25, 0.25)) * 2 * np.pi / fronds
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        reach = spread * rng.uniform(0.8, 1.1)
        up = np.array([0.0, 0.0, 1.0])
        bend = way * reach * 0.5 + up * spread * rng.uniform(0.55, 0.75)
        tip = way * reach + up * spread * rng.uniform(0.25, 0.45)
        out.append(("frond", blade(way * 0.04 - up * 0.05, bend, tip, spread * 0.3)))
    return out


@builder
def reeds(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Clump of reeds, some with brown heads."""
    height = params["height"]
    out: Parts = []
    for k in range(14):
        x, y = rng.normal(scale=0.3, size=2)
        lean = rng.normal(scale=0.12, size=2)
        h = height * rng.uniform(0.7, 1.1)
        top = (x + lean[0] * h, y + lean[1] * h, h)
        if k % 3 == 0:
            out.append(("blade", limb([(x, y, -0.2), top], [0.018, 0.012], 4)))
            head = (top[0] + lean[0] * 0.2, top[1] + lean[1] * 0.2, h + 0.22)
            out.append(("head", limb([top, head], [0.04, 0.035], 6)))
        else:
            bend = (x + lean[0] * h * 0.4, y + lean[1] * h * 0.4, h * 0.6)
            out.append(("blade", blade((x, y, -0.1), bend, top, 0.09)))
    return out


@builder
def mushrooms(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Cluster of large mushrooms with spotted caps."""
    size, count = params["size"], round(params["count"])
    out: Parts = []
    for k in range(count):
        s = size * (1.0 if k == 0 else rng.uniform(0.4, 0.8))
        angle, far = k * 2.4, 0.0 if k == 0 else size * rng.uniform(0.55, 0.9)
        at = np.array([np.cos(angle) * far, np.sin(angle) * far, -0.05])
        stem = lathe(points=[(0.17 * s, 0.0), (0.12 * s, 0.5 * s), (0.13 * s, 0.82 * s)], segments=6)
        cap = [(0.0, 0.74 * s), (0.44 * s, 0.7 * s), (0.5 * s, 0.78 * s), (0.36 * s, 0.98 * s), (0.0, 1.08 * s)]
        out.append(("stem", translated(stem, at)))
        out.append(("cap", translated(lathe(points=cap, segments=8), at)))
        for j in range(5 if k == 0 else 2):
            turn, far = j * 2.4 + k, 0.28 * s if j else 0.0
            p = at + vec(np.cos(turn) * far, np.sin(turn) * far, (1.0 if j else 1.06) * s)
            out.append(("spot", translated(sphere(radii=(0.07 * s, 0.07 * s, 0.05 * s), subdivisions=0), p)))
    return out


@builder
def flowers(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Patch of tall flowers over a tuft of leaves."""
    spread, height = params["spread"], params["height"]
    out: Parts = []
    for k in range(12):
        angle, far = k * 2.4, spread * float(np.sqrt((k + 0.5) / 12))
        x, y = np.cos(angle) * far, np.sin(angle) * far
        h = height * rng.uniform(0.75, 1.15)
        out.append(("leaf", blade((x, y, -0.05), (x + 0.1, y + 0.05, h * 0.4), (x + 0.22, y + 0.1, h * 0.3), 0.1)))
        out.append(("leaf", limb([(x, y, -0.1), (x, y, h)], [0.014, 0.01], 3)))
        out.append(("flower", translated(sphere(radii=(0.085, 0.085, 0.06), subdivisions=0), (x, y, h))))
    return out


@builder
def boulder(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Boulder; what faces up is the role `top` (moss, or the stone itself)."""
    size, flat = params["size"], params["flat"]
    radii = (size * rng.uniform(0.85, 1.1), size * rng.uniform(0.7, 0.95), size * flat)
    top, sides = split_by_slope(stone(rng, radii, 26, 0.28), 0.5)
    return [("top", top), ("rock", sides)]


@builder
def rock_pile(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Heap of angular rocks: six below, three above, one on top."""
    size = params["size"]
    out: Parts = []
    for count, far, z, s in ((6, 0.58, 0.0, 0.46), (3, 0.28, 0.24, 0.42), (1, 0.0, 0.5, 0.36)):
        for k in range(count):
            angle = k * 2 * np.pi / count + z + rng.uniform(-0.2, 0.2)
            r = size * s * rng.uniform(0.85, 1.15)
            body = stone(rng, (r, r * rng.uniform(0.75, 1.0), r * rng.uniform(0.6, 0.8)), 14, 0.2)
            at = (np.cos(angle) * size * far, np.sin(angle) * size * far, z * size)
            out.append(("rock" if k % 2 else "rock_dark", translated(body, at)))
    return out
