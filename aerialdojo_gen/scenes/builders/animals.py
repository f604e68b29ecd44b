"""Animals that stand about: four-legged ones and birds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.scenes.builders import builder
from aerialdojo_gen.scenes.builders.growth import limb, vec
from aerialdojo_gen.scenes.mesh import Parts, posed, rotated, rotation, stretched, translated
from aerialdojo_gen.scenes.shapes import cone, sphere


@builder
def quadruped(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Animal on four legs, `height` metres at its back; it looks ahead, or grazes in `graze` of all cases."""
    height, long, girth = params["height"], params["length"], params["girth"]
    grazes = float(rng.uniform()) < params["graze"]
    leg_m = height - 1.5 * girth
    back = height - girth
    line = [(-0.52, 0.0), (-0.42, 0.0), (0.0, -0.04 * height), (0.36, 0.0), (0.5, 0.0)]
    around = [0.55 * girth, girth, 1.04 * girth, 1.02 * girth, 0.6 * girth]
    trunk = limb([(x * long, 0.0, back + dz) for x, dz in line], around, 8)
    out: Parts = [("coat", stretched(trunk, np.array([1.0, 0.8, 1.0])))]

    def add(role: str, line: ArrayLike, radii: Sequence[float], sides: int = 5) -> None:
        out.append((role, limb(line, radii, sides)))

    shoulder = vec(0.44 * long, 0.0, back + 0.25 * girth)
    reach, head = params["neck"], params["head"]
    rise = -0.72 if grazes else params["rise"]
    poll = shoulder + reach * vec(float(np.sqrt(1.0 - rise * rise)), 0.0, rise)
    nape = [shoulder - vec(0.16 * long, 0, 0.1 * girth), shoulder, poll]
    add("coat", nape, [0.9 * girth, 0.66 * girth, 0.36 * head], 7)
    muzzle = poll + head * vec(0.92, 0.0, -0.75 if grazes else -0.35)
    face = [poll - 0.2 * (muzzle - poll), poll + 0.3 * (muzzle - poll), muzzle]
    add("face", face, [0.3 * head, 0.36 * head, 0.2 * head], 6)
    out.append(("dark", translated(sphere(radii=(0.12 * head, 0.17 * head, 0.15 * head), subdivisions=0), muzzle)))
    horn, thick = params["horn"], params["leg"]
    for side in (-1.0, 1.0):
        ear = poll + head * vec(-0.1, side * 0.3, 0.28)
        tip = ear + head * params["ear"] * vec(-0.15, side * 0.6, 0.35 if params["ear"] < 0.6 else -0.4)
        add("face", [ear, tip], [0.13 * head, 0.03 * head])
        if horn:
            root = poll + head * vec(-0.05, side * 0.2, 0.3)
            bow = [root, root + horn * vec(0, side * 0.7, 0.3), root + horn * vec(0.2, side * 0.8, 0.9)]
            add("horn", bow, [0.09 * head, 0.07 * head, 0.0])
        for at, bend in ((0.38, 0.04), (-0.4, -0.07)):
            top = vec(at * long, side * 0.42 * girth, leg_m + 0.35 * girth)
            knee = vec(at * long + bend * height * 0.5, side * 0.44 * girth, 0.48 * leg_m)
            foot = vec(at * long, side * 0.44 * girth, 0.0)
            leg = [top, knee, foot + vec(0, 0, 0.12 * leg_m), foot]
            add("legs", leg, [2.0 * thick, thick, 0.8 * thick, thick])
    rump, tail, curl = vec(-0.5 * long, 0.0, back + 0.35 * girth), params["tail"], params["tail_up"]
    whip = [rump, rump + tail * vec(-0.5, 0.0, 0.5 * curl - 0.3), rump + tail * vec(-0.6, 0.0, curl - 0.6)]
    add("coat", whip, [0.22 * girth, 0.12 * girth, 0.1 * girth])
    for k in range(round(params["patches"])):
        turn, along = 1.9 * k + float(rng.uniform(0.0, 0.6)), float(rng.uniform(-0.36, 0.34))
        where = vec(along * long, 0.5 * girth * float(np.cos(turn)), back + 0.62 * girth * float(np.sin(turn)))
        out.append(("patch", translated(sphere(radii=(1.0 * girth, 0.5 * girth, 0.62 * girth)), where)))
    return out


@builder
def bird(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Bird that stands on two legs, or picks something up from the ground in a third of all cases."""
    long, leg = params["length"], params["leg"]
    pitch = 28.0 if float(rng.uniform()) < 0.35 else float(rng.uniform(-34.0, -22.0))
    body = stretched(sphere(radii=(0.5, 0.2, 0.21)), np.full(3, long))
    wing = stretched(sphere(radii=(0.44, 0.035, 0.14), subdivisions=0), np.full(3, long))
    beak = rotated(cone(radius=0.045 * long, height=0.2 * long, segments=5), rotation(0.0, 96.0, 0.0))
    parts: Parts = [
        ("body", body),
        *(("wing", translated(wing, vec(-0.08 * long, side * long, 0.03 * long))) for side in (0.19, -0.19)),
        ("wing", limb([(-0.4 * long, 0, 0.0), (-0.72 * long, 0, -0.03 * long)], [0.09 * long, 0.06 * long], 5)),
        ("head", limb([(0.3 * long, 0, 0.08 * long), (0.46 * long, 0, 0.26 * long)], [0.15 * long, 0.1 * long], 7)),
        ("head", translated(sphere(radius=0.14 * long, subdivisions=0), vec(0.47 * long, 0.0, 0.3 * long))),
        ("beak", translated(beak, vec(0.56 * long, 0.0, 0.29 * long))),
    ]
    high = leg + 0.16 * long
    out = [(role, posed(one, rotation(0.0, pitch, 0.0), vec(0.0, 0.0, high))) for role, one in parts]
    for side in (-1.0, 1.0):
        foot = vec(0.03 * long, side * 0.07 * long, 0.0)
        out.append(("legs", limb([foot, foot + vec(-0.03 * long, 0.0, high)], [0.022 * long, 0.03 * long], 4)))
        claw = [foot + vec(-0.03 * long, 0, 0.012 * long), foot + vec(0.11 * long, 0, 0.008 * long)]
        out.append(("legs", limb(claw, [0.02 * long, 0.012 * long], 4)))
    return out
