"""Ground and buildings of winter: slopes with groomed pistes, huts on stilts, lift stations, cables, a rink."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Annotated

import numpy as np
import shapely
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import gaussian_filter1d
from shapely.affinity import rotate
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.layouts.natural.parts.groups import Deck
from aerialdojo_gen.scenes.mesh import Mesh, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes import box, crown, cylinder
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain
from aerialdojo_gen.scenes.values import At, Degrees

_STILT_M = 1.3
_Side = Annotated[float, Field(ge=2, le=100)]
# Its corners are rounded by 3 m.
_RinkSide = Annotated[float, Field(ge=6.5, le=200)]
_RAIL_M = 1.0


class Hut(BaseModel):
    """A hut on stilts, or a building with a snowy gable, as a recipe gives it; groups stand on a hut's roof or porch.

    Attributes
    ----------
    name : str
        Its own among the scene's huts; its porch is ``"<name> porch"``.
    kind : str
        ``"stilts"`` or ``"gable"``.
    at : (float, float)
        Middle, world frame, metres.
    size_m : (float, float, float)
        Depth, width and height, metres; it faces along its yaw.
    wall : str
        Material.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    kind: Annotated[str, Field(pattern="^(stilts|gable)$")] = "stilts"
    at: At
    size_m: tuple[_Side, _Side, _Side] = (4.2, 9.0, 2.8)
    yaw_deg: Degrees = 0.0
    wall: str = "sheet_metal:#c8502e"

    def plan(self, ahead_m: float = 0.0) -> Polygon:
        """Plan with so much porch before the front, world frame, metres."""
        u, v = self.size_m[0] / 2, self.size_m[1] / 2
        frame = Frame(*self.at, self.yaw_deg)
        return Polygon([frame.at(a, b) for a, b in ((-u, -v), (u + ahead_m, -v), (u + ahead_m, v), (-u, v))])

    def decks(self) -> dict[str, Polygon]:
        """Plans of what carries things: a flat roof, and a porch."""
        if self.kind == "gable":
            return {}
        porch = self.plan(2.4).difference(self.plan(0.3))
        return {self.name: self.plan().buffer(-0.2), f"{self.name} porch": porch}


class Rink(BaseModel):
    """An ice rink: middle, length and width, metres, and the direction of its length."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    at: At
    size_m: tuple[_RinkSide, _RinkSide] = (18.0, 11.0)
    yaw_deg: Degrees = 0.0

    def area(self) -> Polygon:
        """Plan with round corners, world frame, metres."""
        u, v = (s / 2 - 3.0 for s in self.size_m)
        x, y = self.at
        core = _rect(x - u, y - v, x + u, y + v).buffer(3.0, quad_segs=4)
        return rotate(core, self.yaw_deg, origin=(x, y))


def slope_ground(
    ground: Terrain, profile: Sequence[tuple[float, float]], lean: float, smooth_m: float = 4.0
) -> Terrain:
    """Raise the ground by a profile from south to north, (y, z) in metres, and by `lean` metres a metre eastwards."""
    corners = ground.corners()
    y = np.linspace(corners[:, 1].min(), corners[:, 1].max(), 600)
    z = np.interp(y, [p[0] for p in profile], [p[1] for p in profile])
    z = gaussian_filter1d(z, smooth_m / float(y[1] - y[0]), mode="nearest")
    rise = np.interp(corners[:, 1], y, z) + lean * corners[:, 0]
    return replace(ground, heights_m=ground.heights_m + rise.reshape(ground.heights_m.shape))


def banked(ground: Terrain, path: Sequence[tuple[float, float]], width_m: float, height_m: float) -> Terrain:
    """Pile snow along both sides of a path, where ploughs and groomers leave it."""
    d = shapely.distance(LineString(path), shapely.points(ground.corners()[:, :2]))
    bump = np.exp(-(((d - width_m / 2 - 1.4) / 1.1) ** 2))
    return replace(ground, heights_m=ground.heights_m + height_m * bump.reshape(ground.heights_m.shape))


def moguls(ground: Terrain, area: BaseGeometry, height_m: float, pitch_m: float) -> Terrain:
    """Cover an area with the bumps that turning skis leave."""
    x, y = ground.corners()[:, :2].T
    inside = shapely.distance(area.boundary, shapely.points(x, y)) * shapely.contains_xy(area, x, y)
    fade = np.clip(inside / 2.0, 0.0, 1.0)
    k = 2 * np.pi / pitch_m
    bump = 0.5 + 0.5 * np.sin(k * x + 0.8 * np.sin(k * y / 2)) * np.sin(k * y)
    return replace(ground, heights_m=ground.heights_m + (height_m * fade * bump).reshape(ground.heights_m.shape))


def build_hut(site: Site, hut: Hut) -> dict[str, Deck]:
    """Put up a hut; what carries things comes back by name."""
    depth, width, height = hut.size_m
    plan = hut.plan()
    if hut.kind == "gable":
        z = min(site.ground_z(float(x), float(y)) for x, y in shapely.get_coordinates(plan))
        frame = Frame(*hut.at, hut.yaw_deg)
        front = frame.parts(_front(depth, width, 0.0), z)
        building(site, plan, wall=hut.wall, roof="snow", storeys=1, storey_m=height, roof_kind="gable",
                 roof_m=0.32 * min(depth, width), overhang_m=0.7, z=z, category="hut", extra=front)  # fmt: skip
        return {}
    ground = max(site.ground_z(float(x), float(y)) for x, y in shapely.get_coordinates(hut.plan(2.4)))
    floor = ground + _STILT_M
    top = floor + height
    u, v = depth / 2, width / 2
    parts: list[tuple[str, Mesh]] = [
        (hut.wall, slab(_rect(-u, -v, u, v), 0.0, height)),
        ("snow", slab(_rect(-u - 0.15, -v - 0.15, u + 0.15, v + 0.15), height, height + 0.16)),
        ("steel", slab(_rect(-u, -v, u + 2.4, v), -0.16, 0.0)),
    ]
    for a in (-u + 0.3, 0.0, u - 0.3, u + 2.2):
        for b in np.linspace(-v + 0.4, v - 0.4, max(int(width // 3), 2)):
            parts.append(("steel", translated(cylinder(radius=0.1, height=_STILT_M + 0.8, segments=6),
                                              (a, float(b), -_STILT_M - 0.8))))  # fmt: skip
    rail = [(u, -v, _RAIL_M), (u + 2.35, -v, _RAIL_M), (u + 2.35, v - 1.4, _RAIL_M)]
    parts.append(("#e9b52a", sweep(path=rail, radius=0.04, sides=5)))
    for x, y, _ in (*rail, (u + 2.35, 0.0, 0.0), (u + 2.35, v, 0.0)):
        parts.append(("#e9b52a", translated(cylinder(radius=0.035, height=_RAIL_M, segments=5), (x, y, 0.0))))
    for k in range(5):
        at = (u + 2.55 + 0.28 * k, v - 0.7, -0.26 * (k + 1))
        parts.append(("steel", translated(box(size=(0.28, 1.2, 0.06)), at)))
    parts += _front(depth, width, 0.0)
    frame = Frame(*hut.at, hut.yaw_deg)
    site.add(None, "hut", frame.parts(parts, floor), footprint=hut.plan(4.2))
    names = hut.decks()
    return {hut.name: Deck(names[hut.name], top + 0.16), f"{hut.name} porch": Deck(names[f"{hut.name} porch"], floor)}


def _front(depth: float, width: float, z: float) -> list[tuple[str, Mesh]]:
    """Door and windows on the front, windows at the back."""
    u = depth / 2
    parts: list[tuple[str, Mesh]] = [("#3a4650", translated(box(size=(0.08, 1.0, 2.0)), (u, width * 0.28, z + 0.02)))]
    for v in np.arange(-width / 2 + 1.0, width * 0.28 - 1.0, 1.9):
        for side in (-1.0, 1.0):
            parts.append(("#e9e7de", translated(box(size=(0.08, 1.12, 0.92)), (side * u, float(v), z + 1.04))))
            parts.append(("window", translated(box(size=(0.12, 0.95, 0.75)), (side * u, float(v), z + 1.12))))
    return parts


def build_cables(site: Site, heads: Sequence[tuple[float, float, float]], gauge_m: float, cabins: int) -> None:
    """Hang two ropes with cabins between mast heads (x, y, z), metres; the first and the last are terminals."""
    parts: list[tuple[str, Mesh]] = []
    paints = ("#d8342c", "#2f5f9e", "#e9b52a", "#3f7d4e")
    hung = 0
    for a, b in pairwise(np.array(heads)):
        along = (b - a)[:2] / np.linalg.norm((b - a)[:2])
        side = np.array([-along[1], along[0], 0.0]) * gauge_m / 2
        length = float(np.linalg.norm((b - a)[:2]))
        t = np.linspace(0.0, 1.0, 9)
        sag = -0.045 * length * 4 * t * (1 - t)
        for way in (-1.0, 1.0):
            line = a + (b - a) * t[:, None] + side * way + np.column_stack([0 * t, 0 * t, sag])
            parts.append(("iron", sweep(path=[tuple(map(float, p)) for p in line], radius=0.045, sides=4)))
            count = max(int(length // 16), 1) if hung < cabins else 0
            for k in range(count):
                s = (k + 0.5 + 0.22 * way) / count
                p = a + (b - a) * s + side * way
                z = float(p[2] - 0.045 * length * 4 * s * (1 - s))
                yaw = float(np.degrees(np.arctan2(along[1], along[0])))
                parts += _cabin(float(p[0]), float(p[1]), z, yaw, paints[hung % 4])
                hung += 1
    for x, y, z in (heads[0], heads[-1]):
        foot = site.ground_z(x, y)
        wheel = cylinder(radius=gauge_m / 2, height=0.3, segments=20)
        parts.append(("#3f7d4e", translated(wheel, (x, y, z - 0.15))))
        shaft = cylinder(radius=0.4, height=z - foot + 0.6, segments=10)
        parts.append(("steel", translated(shaft, (x, y, foot - 0.5))))
        parts.append(("concrete", translated(box(size=(2.2, 2.2, 0.5)), (x, y, foot - 0.3))))
    site.add(None, "lift_ropes", parts)


def _cabin(x: float, y: float, z: float, yaw: float, paint: str) -> list[tuple[str, Mesh]]:
    body = [
        (paint, translated(box(size=(1.5, 1.3, 0.75), taper=(1.1, 1.1)), (0, 0, -3.1))),
        ("glass", translated(box(size=(1.6, 1.4, 0.75), taper=(0.94, 0.92)), (0, 0, -2.35))),
        (paint, translated(box(size=(1.55, 1.35, 0.18), taper=(0.8, 0.8)), (0, 0, -1.6))),
        ("steel", translated(cylinder(radius=0.05, height=1.45, segments=6), (0, 0, -1.42))),
    ]
    turn = rotation(0.0, 0.0, yaw)
    return [(m, translated(rotated(b, turn), (x, y, z))) for m, b in body]


def build_ridge(site: Site, path: Sequence[tuple[float, float]], height_m: float, material: str, key: int) -> None:
    """Push broken slabs of ice or snow up into a ridge along a path."""
    rng = site.rng_for("ridge", key)
    line = LineString(path)
    parts: list[tuple[str, Mesh]] = []
    for s in np.arange(0.4, line.length, 1.1):
        p = line.interpolate(float(s))
        h = height_m * float(rng.uniform(0.55, 1.0))
        z = site.ground_z(p.x, p.y)
        if rng.random() < 0.6:
            body = box(size=(float(rng.uniform(1.0, 1.8)), float(rng.uniform(0.4, 0.8)), h * 1.25))
            body = rotated(
                body, rotation(float(rng.uniform(-24, 24)), float(rng.uniform(-18, 18)), float(rng.uniform(0, 180)))
            )
        else:
            body = crown(radii=(0.9, 0.8, h * 0.7), noise=0.35, subdivisions=1, seed=int(rng.integers(1000)))
        wander = rng.uniform(-0.35, 0.35, size=2)
        parts.append((material, translated(body, (p.x + wander[0], p.y + wander[1], z - 0.35))))
    site.add(None, "ice_ridge", parts, footprint=line.buffer(1.0))


def build_boards(site: Site, rink: BaseGeometry, z: float) -> None:
    """Put boards round a rink, with a gap to step in by."""
    ring = shapely.get_coordinates(shapely.segmentize(rink.exterior, 3.0))
    gate = len(ring) // 8
    path = [(float(x), float(y), z + 0.45) for x, y in (*ring[gate + 1 :], *ring[1:gate])]
    cap = [(x, y, z + 0.96) for x, y, _ in path]
    parts = [("#eef2f6", sweep(path=path, section=(0.12, 1.0))), ("#2f5f9e", sweep(path=cap, section=(0.16, 0.08)))]
    site.add(None, "rink_boards", parts, footprint=rink.boundary.buffer(0.25))


def _rect(x0: float, y0: float, x1: float, y1: float) -> Polygon:
    return Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
