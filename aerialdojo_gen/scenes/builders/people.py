"""People, riders and animals: bodies on joints, in a posture, in clothes or a coat; riders face towards +x."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from aerialdojo_gen.scenes.builders import builder
from aerialdojo_gen.scenes.builders.growth import limb, vec
from aerialdojo_gen.scenes.mesh import Floats, Mesh, Parts, merge, posed, rotated, rotation, stretched, translated
from aerialdojo_gen.scenes.shapes import box, cone, cylinder, lathe, profile, sphere, sweep, torus

# Joints of a body of 1.75 m that stands, metres above its soles.
_BODY_M = 1.75
_HIP, _KNEE, _ANKLE = 0.93, 0.5, 0.08
_SHOULDER = 1.43
_UPPER_ARM, _FOREARM, _THIGH, _SHIN = 0.29, 0.25, 0.43, 0.42
_STAND, _WALK, _SIT, _WORK, _CALL, _ON_SEAT, RIDE = range(7)
_SEATED = frozenset({_SIT, _ON_SEAT, RIDE})
_ABOVE_SEAT_M = 0.09  # the hips' middle over what bears them


@builder
def person(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Person who stands, walks, sits, works bent, calls or rides, in what the parameters dress them in."""
    posture = round(params["posture"])
    lean_deg = {_WORK: 38.0, _WALK: 4.0, _SIT: -6.0, _ON_SEAT: -3.0, RIDE: params.get("lean", 0.0)}.get(posture, 0.0)
    hip_m = {_SIT: 0.11, _WORK: _HIP - 0.09, _WALK: _HIP - 0.015}.get(posture, _HIP)
    if posture in (_ON_SEAT, RIDE):
        hip_m = params["seat"] * _BODY_M / params["height"] + _ABOVE_SEAT_M
    upper = _upper(rng, params, posture, lean_deg)
    out = [(role, posed(body, rotation(0.0, lean_deg, 0.0), vec(0.0, 0.0, hip_m))) for role, body in upper]
    out += _legs(rng, params, posture, hip_m)
    grown = params["height"] / _BODY_M
    return [(role, stretched(body, np.full(3, grown))) for role, body in out]


def _upper(rng: np.random.Generator, params: Mapping[str, float], posture: int, lean_deg: float) -> Parts:
    """All above the hips, in a frame whose origin lies between them and whose z runs up the back."""
    stout, bust = params["stout"], params["bust"]
    up, neck = _SHOULDER - _HIP, 0.55
    girth = np.array([0.72, 1.0, 1.0])
    trunk = limb(
        [(0, 0, -0.09), (0, 0, 0.03), (0, 0, 0.16), (0, 0, 0.34), (0, 0, up - 0.02), (0, 0, up + 0.05)],
        [0.155 * stout, 0.165 * stout, 0.145 * stout, 0.175, 0.155, 0.06], 9,
    )  # fmt: skip
    out: Parts = [
        ("top", stretched(trunk, girth)),
        ("skin", limb([(0, 0, up), (0.015, 0, neck + 0.06)], [0.058, 0.052], 6)),
    ]
    if bust:
        out.append(("top", translated(sphere(radii=(0.075, 0.13, 0.085)), vec(0.075, 0.0, 0.33))))
    if params["coat"] and posture not in _SEATED:
        flare = limb([(0, 0, -0.34), (0, 0, -0.05), (0, 0, 0.1)], [0.215 * stout, 0.175 * stout, 0.155 * stout], 10)
        out.append(("top", stretched(flare, np.array([0.8, 1.0, 1.0]))))
    out += _head(params, neck + 0.06)
    grips = _grips(params, up, lean_deg) if posture == RIDE else _hanging(rng, posture, up, lean_deg)
    out += _arms(params, grips)
    if params["vest"]:
        for z, r in ((0.2, 0.163), (0.32, 0.181)):
            band = limb([(0, 0, z - 0.022), (0, 0, z + 0.022)], [r, r], 10)
            out.append(("band", stretched(band, np.array([0.75, 1.0, 1.0]))))
    if params["bag"]:
        pack = box(size=(0.2, 0.3, 0.44), taper=(0.75, 0.85))
        out.append(("bag", translated(pack, vec(-0.21, 0.0, 0.06))))
        straps = [
            limb([(-0.1, s * 0.11, up + 0.03), (0.1, s * 0.12, up), (0.13, s * 0.11, 0.3)], [0.03] * 3, 5)
            for s in (-1, 1)
        ]
        out.append(("bag", merge(straps)))
    return out


def _head(params: Mapping[str, float], z: float) -> Parts:
    """Head with hair, and what is worn on it; children have larger ones."""
    size = 1.0 + max(0.0, 1.5 - params["height"]) * 0.5
    centre = vec(0.02, 0.0, z + 0.085 * size)
    parts: Parts = [
        ("skin", sphere(radii=(0.101, 0.08, 0.121))),
        ("skin", translated(sphere(radii=(0.02, 0.013, 0.02), subdivisions=0), vec(0.1, 0.0, -0.012))),
    ]
    hair = round(params["hair"])
    if hair:
        cap = sphere(radii=(0.105, 0.088, 0.122), half=True, subdivisions=0)
        parts.append(("hair", posed(cap, rotation(0.0, -24.0, 0.0), vec(-0.013, 0.0, 0.008))))
        back = sphere(radii=(0.062, 0.082, 0.1 if hair == 1 else 0.185))
        parts.append(("hair", translated(back, vec(-0.055, 0.0, -0.01 if hair == 1 else -0.1))))
        if hair == 3:
            parts.append(("hair", translated(sphere(radius=0.05), vec(-0.09, 0.0, 0.1))))
    hat = round(params["hat"])
    if hat:
        crown = sphere(radii=(0.122, 0.104, 0.125), half=True, subdivisions=0)
        parts.append(("hat", translated(crown, vec(-0.004, 0.0, 0.028))))
        if hat == 1:
            peak = lathe(points=[(0.0, 0.0), (0.115, -0.005), (0.115, 0.012), (0.0, 0.02)], segments=10)
            parts.append(("hat", translated(peak, vec(0.075, 0.0, 0.03))))
        elif hat == 2:
            brim = lathe(points=[(0.0, 0.0), (0.2, -0.012), (0.2, 0.004), (0.0, 0.02)], segments=12)
            parts.append(("hat", translated(brim, vec(0.0, 0.0, 0.03))))
        else:
            parts.append(("hat", translated(sphere(radius=0.035, subdivisions=0), vec(0.0, 0.0, 0.16))))
    return [(role, translated(stretched(body, np.full(3, size)), centre)) for role, body in parts]


def _hanging(rng: np.random.Generator, posture: int, up: float, lean_deg: float) -> list[list[Floats]]:
    """Find shoulder, elbow and wrist of both arms; they hang straight down even where the back leans."""
    out = []
    swing = float(rng.uniform(18.0, 28.0))
    for side in (-1.0, 1.0):
        # Degrees forward of the upper arm and of the forearm, seen from the side, and outward.
        upper, fore, out_deg = float(rng.uniform(-6.0, 6.0)), float(rng.uniform(4.0, 22.0)), 7.0
        if posture == _WALK:
            upper, fore = side * swing, side * swing + 22.0
        elif posture in (_SIT, _ON_SEAT):
            upper, fore = 28.0, 62.0
        elif posture == _WORK:
            upper, fore, out_deg = 34.0 + side * 12.0, 52.0 + side * 12.0, 4.0
        elif posture == _CALL and side > 0:
            upper, fore, out_deg = 38.0, 158.0, 16.0
        upper, fore = upper + lean_deg, fore + lean_deg
        shoulder = vec(0.0, side * 0.185, up - 0.035)
        elbow = shoulder + _UPPER_ARM * _way(upper, side * out_deg)
        wrist = elbow + _FOREARM * _way(fore, side * (out_deg - (12.0 if fore > 60.0 else 4.0)))
        out.append([shoulder, elbow, wrist, 0.04 * _way(fore, 0.0)])
    return out


def _grips(params: Mapping[str, float], up: float, lean_deg: float) -> list[list[Floats]]:
    """Find shoulder, elbow and wrist of both arms of one who holds handlebars."""
    lean = math.radians(lean_deg)
    x, z = params["grip_x"], params["grip_z"] - params["seat"] - _ABOVE_SEAT_M
    ahead, above = math.cos(lean) * x - math.sin(lean) * z, math.sin(lean) * x + math.cos(lean) * z
    out = []
    for side in (-1.0, 1.0):
        shoulder = vec(0.0, side * 0.185, up - 0.035)
        wrist = vec(ahead - 0.03, side * params["grip_y"], above + 0.03)
        out.append([shoulder, _joint(shoulder, wrist, _UPPER_ARM, _FOREARM, -1.0), wrist, vec(0.03, 0.0, 0.0)])
    return out


def _arms(params: Mapping[str, float], joints: list[list[Floats]]) -> Parts:
    """Both arms through their joints, with hands."""
    out: Parts = []
    for shoulder, elbow, wrist, to_hand in joints:
        thick = 1.15 if params["coat"] or params["vest"] else 1.0
        sleeve = "top" if params["sleeves"] else "skin"
        out += [
            ("top", translated(sphere(radii=(0.074 * thick, 0.067 * thick, 0.076), subdivisions=0), shoulder)),
            ("top", limb([shoulder, (shoulder + elbow) / 2], [0.06 * thick, 0.054 * thick], 6)),
            (sleeve, limb([(shoulder + elbow) / 2, elbow, wrist], [0.053 * thick, 0.046 * thick, 0.034 * thick], 6)),
            ("skin", translated(sphere(radii=(0.044, 0.036, 0.056), subdivisions=0), wrist + to_hand)),
        ]
    return out


def _joint(start: Floats, end: Floats, upper_m: float, lower_m: float, side: float) -> Floats:
    """Where a limb bends between its ends, seen from the side: forward, or back where `side` is negative."""
    dx, dz = float(end[0] - start[0]), float(end[2] - start[2])
    away = max(math.sqrt(dx * dx + dz * dz), 1e-6)
    along = min((upper_m * upper_m - lower_m * lower_m + away * away) / (2.0 * away), upper_m)
    out = side * math.sqrt(max(upper_m * upper_m - along * along, 0.0))
    x, z = (along * dx - out * dz) / away, (along * dz + out * dx) / away
    return np.round(vec(start[0] + x, (start[1] + end[1]) / 2, start[2] + z), 9)


def _legs(rng: np.random.Generator, params: Mapping[str, float], posture: int, hip_m: float) -> Parts:
    """Both legs from the hips to the ground; a skirt hides their upper part."""
    out: Parts = []
    stout = params["stout"]
    bare = "skin" if params["skirt"] or params["shorts"] else "legs"
    for side in (-1.0, 1.0):
        hip = vec(0.0, side * 0.092, hip_m)
        if posture == _SIT:
            spread = float(rng.uniform(0.0, 0.06))
            knee, ankle = vec(0.33, side * (0.14 + spread), 0.43), vec(0.56, side * (0.13 + spread), _ANKLE)
        elif posture == _ON_SEAT:
            spread = float(rng.uniform(0.0, 0.05))
            knee, ankle = vec(_THIGH, side * (0.1 + spread), hip_m - 0.01), vec(0, side * (0.1 + spread), _ANKLE)
            down = float(knee[2]) - _ANKLE
            ankle[0] = knee[0] + min(math.sqrt(max(_SHIN * _SHIN - down * down, 0.0)), 0.2)
        elif posture == RIDE:
            foot_m = params["foot_z"] + side * params["foot_dz"]
            ankle = vec(params["foot_x"], side * params["foot_y"], foot_m + _ANKLE)
            knee = _joint(hip, ankle, _THIGH, _SHIN, 1.0)
        elif posture == _WALK:
            ahead = -side * 24.0
            knee = hip + _THIGH * _way(ahead, 0.0)
            ankle = knee + _SHIN * _way(ahead - (6.0 if ahead > 0 else 14.0), 0.0)
            ankle[2] = _ANKLE + (0.0 if ahead > 0 else 0.05)
        else:
            apart = 0.15 if posture == _WORK else 0.105
            bend = 0.09 if posture == _WORK else 0.012
            knee, ankle = vec(bend, side * (apart + 0.01), _KNEE), vec(-0.01 + bend / 2, side * apart, _ANKLE)
        thigh = [hip + vec(0.0, 0.0, 0.03), hip, (hip + knee) / 2]
        shin = [(hip + knee) / 2, knee, (knee + ankle) / 2, ankle]
        out += [
            ("legs", limb(thigh, [0.08, 0.094 * stout, 0.08 * stout], 7)),
            (bare, limb(shin, [0.078 * stout, 0.061, 0.056, 0.042], 6)),
            (bare, translated(sphere(radii=(0.063, 0.061, 0.063), subdivisions=0), knee)),
        ]
        toe = 24.0 if posture == _WALK and side > 0 else 0.0
        shoe = merge([
            translated(sphere(radii=(0.135, 0.05, 0.085), half=True, subdivisions=0), vec(0.055, 0, 0)),
            limb([(-0.01, 0, 0.02), (-0.01, 0, 0.11)], [0.052, 0.05], 5),
        ])  # fmt: skip
        out.append(("shoes", posed(shoe, rotation(0.0, toe, 0.0), ankle - vec(0.0, 0.0, _ANKLE))))
    if params["skirt"] and posture not in _SEATED:
        skirt = limb(
            [(0, 0, _KNEE + 0.02), (0, 0, hip_m - 0.02), (0, 0, hip_m + 0.12)], [0.26, 0.185 * stout, 0.15], 12
        )
        out.append(("legs", stretched(skirt, np.array([0.85, 1.0, 1.0]))))
    if posture == _SIT:
        # They sit on the ground: the trunk's end is round.
        out.append(("legs", translated(sphere(radii=(0.15, 0.19 * stout, 0.13)), vec(0.02, 0.0, hip_m))))
    return out


def _way(forward_deg: float, outward_deg: float) -> Floats:
    """Unit vector of a limb that hangs down, turned forward and to the left."""
    forward, outward = math.radians(forward_deg), math.radians(outward_deg)
    down = math.cos(outward)
    return np.round(vec(math.sin(forward) * down, math.sin(outward), -math.cos(forward) * down), 9)


_UPRIGHT = rotation(90.0, 0.0, 0.0)
# Where a rider's hips are on the saddle, and from there the grips and the feet, metres.
_SADDLE_X_M = {0: -0.22, 1: -0.3}
_RIDES: dict[int, dict[str, float]] = {
    0: {"seat": 0.955, "lean": 24.0, "grip_x": 0.44, "grip_y": 0.26, "grip_z": 0.99,
        "foot_x": 0.15, "foot_y": 0.13, "foot_z": 0.32, "foot_dz": 0.13},
    1: {"seat": 0.82, "lean": 16.0, "grip_x": 0.56, "grip_y": 0.35, "grip_z": 1.06,
        "foot_x": 0.22, "foot_y": 0.22, "foot_z": 0.3, "foot_dz": 0.0},
}  # fmt: skip


@builder
def rider(rng: np.random.Generator, params: Mapping[str, float]) -> Parts:
    """Person on a bicycle, or with ``motor = 1`` on a motorcycle."""
    motor = round(params["motor"])
    own = person(rng, {**params, **_RIDES[motor], "posture": RIDE, "height": 1.75})
    x = _SADDLE_X_M[motor]
    return [*(_motorcycle() if motor else _bicycle()), *((role, translated(m, (x, 0.0, 0.0))) for role, m in own)]


def _wheels(reach_m: float, radius_m: float, tube_m: float, segments: int) -> Mesh:
    ring = posed(torus(radius=radius_m, tube=tube_m, segments=segments, sides=4), _UPRIGHT, (0.0, 0.0, 0.0))
    return merge([translated(ring, (x, 0.0, radius_m + tube_m)) for x in (-reach_m, reach_m)])


def _bicycle() -> Parts:
    frame = [
        [(-0.52, 0, 0.335), (-0.05, 0, 0.3), (0.38, 0, 0.74), (-0.16, 0, 0.74), (-0.05, 0, 0.3)],
        [(-0.52, 0, 0.335), (-0.16, 0, 0.74), (-0.2, 0, 0.9)],
        [(0.52, 0, 0.335), (0.36, 0, 0.95)],
    ]
    bars = [(0.2, -0.28, 0.98), (0.38, -0.1, 0.97), (0.38, 0.1, 0.97), (0.2, 0.28, 0.98)]
    pedals = [translated(box(size=(0.16, 0.1, 0.03)), (-0.05, s * 0.13, 0.29 + s * 0.13)) for s in (-1, 1)]
    return [
        ("tyre", _wheels(0.52, 0.31, 0.025, 14)),
        ("frame", merge([sweep(path=path, radius=0.022, sides=4) for path in frame])),
        ("metal", sweep(path=bars, radius=0.018, sides=4)),
        ("tyre", merge([translated(box(size=(0.28, 0.15, 0.07), taper=(0.8, 0.6)), (-0.22, 0.0, 0.89)), *pedals])),
    ]


def _motorcycle() -> Parts:
    tank = profile(points=[(-0.15, 0.7), (0.35, 0.66), (0.42, 0.9), (0.1, 0.98), (-0.15, 0.86)], width=0.3)
    saddle = profile(points=[(-0.85, 0.74), (-0.1, 0.66), (-0.1, 0.82), (-0.5, 0.84), (-0.9, 0.92)], width=0.28)
    guard = profile(points=[(0.5, 0.62), (0.95, 0.62), (0.85, 0.69), (0.6, 0.69)], width=0.16)
    forks = [sweep(path=[(0.72, s * 0.09, 0.33), (0.4, s * 0.09, 1.0)], radius=0.03, sides=4) for s in (-1, 1)]
    bars = [(0.25, -0.38, 1.06), (0.4, -0.15, 1.02), (0.4, 0.15, 1.02), (0.25, 0.38, 1.06)]
    pipe = sweep(path=[(0.1, -0.2, 0.3), (-0.4, -0.2, 0.28), (-0.95, -0.2, 0.4)], radius=0.05, sides=5)
    hub = posed(cylinder(radius=0.12, height=0.12, segments=8), _UPRIGHT, (0.0, 0.06, 0.33))
    hubs = [translated(hub, (x, 0.0, 0.0)) for x in (-0.72, 0.72)]
    engine = translated(box(size=(0.5, 0.3, 0.4)), (0.0, 0.0, 0.3))
    pegs = translated(box(size=(0.1, 0.6, 0.04)), (-0.08, 0.0, 0.26))
    return [
        ("tyre", _wheels(0.72, 0.26, 0.07, 12)),
        ("metal", merge([engine, pipe, *forks, *hubs, pegs])),
        ("frame", merge([tank, guard])),
        ("tyre", merge([saddle, sweep(path=bars, radius=0.025, sides=4)])),
        ("lamp", translated(sphere(radius=0.11, subdivisions=0), (0.55, 0.0, 0.92))),
    ]


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
