"""A scene under construction, on which builders place things, and the footprints of what was placed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal, overload

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.base.rng import generator, rank
from aerialdojo_gen.scenes.catalogue import Catalogue, Overrides, placed
from aerialdojo_gen.scenes.ground import Surface, ground_meshes, rectangle
from aerialdojo_gen.scenes.horizon.build import make_horizon
from aerialdojo_gen.scenes.materials import parse_colour
from aerialdojo_gen.scenes.mesh import Mesh, by_material, to_part
from aerialdojo_gen.scenes.model import Instance, Part, Scene, turned
from aerialdojo_gen.scenes.placement import (
    CONTACT_M,
    DRAWN,
    Fit,
    Footprints,
    Placement,
    disc,
    footprint,
    hull,
    rest_on_ground,
)
from aerialdojo_gen.scenes.prop import of_side
from aerialdojo_gen.scenes.recipe import Move, SceneHead
from aerialdojo_gen.scenes.terrain import Terrain, flat_terrain

# The largest scene of the dataset has 479.
MAX_NODES = 5_000
# What is kept free is so from here up, metres.
_BELOW_M = 100.0


class Site:
    """What builders build on; the origin lies in the middle, x east, y north, z up, metres."""

    def __init__(self, name: str, head: SceneHead, catalogue: Catalogue, folder: Path | None = None) -> None:
        self.name = name
        self.folder = folder  # Of the scene's file, and of a table of heights beside it
        self.head = head
        self.catalogue = catalogue
        x, y = head.size_m
        self.extent = rectangle(-x / 2, -y / 2, x / 2, y / 2)
        self.instances: list[Instance] = []
        # Outlines and middles of things that the ground is to be levelled under.
        self.footings: list[tuple[BaseGeometry, Point]] = []
        # Middle lines of lanes in the direction of driving, with their widths, and middles of crossings.
        self.lanes: list[tuple[LineString, float]] = []
        self.crossings: list[Point] = []
        self._counts: dict[str, int] = {}
        self._nodes: set[str] = set()
        self._moved_nodes: set[str] = set()
        self._on_ground: list[int] = []  # Indices of the things that stand on the ground
        self._footprints = Footprints()
        self.terrain = flat_terrain(head.size_m)  # Heights of the ground
        self._base = "grass"
        self._surfaces: list[Surface] = []
        self._areas = np.empty(0, dtype=object)
        self._boxes = np.empty((4, 0))  # Least x and y, greatest x and y of each
        self._outlines: dict[tuple[str, str | None], BaseGeometry] = {}

    def rng_for(self, *key: object) -> np.random.Generator:
        """Make the generator of one thing in this scene: adding another thing does not change its draws."""
        return generator(self.head.seed, "build-scenes", self.name, *key)

    def material(self, role: str, default: str) -> str:
        """Material of a role in the recipe's palette, or the default."""
        spec = self.head.palette.get(role, default)
        self.catalogue.materials.check(spec, f"{self.name}: palette {role}")
        return spec

    def node(self, category: str) -> str:
        """Give the next free node name of a category: ``category_000``, then ``category_001``."""
        while True:
            k = self._counts.get(category, 0)
            self._counts[category] = k + 1
            name = f"{category}_{k:03d}"
            if name not in self._nodes:
                return name

    # Ground

    def set_ground(self, terrain: Terrain | None = None, material: str = "grass") -> None:
        """Choose the heights (level at z = 0 by default) and what shows where nothing is painted; do it first."""
        self.terrain = flat_terrain(self.head.size_m) if terrain is None else terrain
        for level in self.head.level:
            spot = Point(level.at)
            area = spot.buffer(level.radius_m) if level.radius_m else spot
            self.terrain = self.terrain.flattened(area, level.z_m, level.blend_m)
        self._base = material

    def paint(self, area: BaseGeometry, material: str, rise_m: float = 0.0, edge: str = "concrete") -> None:
        """Paint an area of the ground over what was painted before; see `Surface`."""
        shapely.prepare(area)
        self._surfaces.append(Surface(area, material, rise_m, edge))
        self._boxes = np.column_stack([self._boxes, area.bounds])
        self._areas = np.append(self._areas, area)

    def ground_z(self, x: float, y: float) -> float:
        """Height of the painted ground at a point, metres."""
        surface = self._surface(x, y)
        return self.terrain.at(x, y) + (0.0 if surface is None else surface.rise_m)

    def ground_material(self, x: float, y: float) -> str:
        """Material of the painted ground at a point."""
        surface = self._surface(x, y)
        return self._base if surface is None else surface.material

    def _surface(self, x: float, y: float) -> Surface | None:
        # Hundreds of lane marks are painted: test their boxes first.
        x0, y0, x1, y1 = self._boxes
        near = ((x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1)).nonzero()[0]
        holds = near[shapely.contains_xy(self._areas[near], x, y)] if len(near) else near
        return self._surfaces[holds[-1]] if len(holds) else None

    @overload
    def place(self, thing: Placement, fit: Literal["as_is", "must"] = ...) -> Instance: ...

    @overload
    def place(self, thing: Placement, fit: Fit) -> Instance | None: ...

    def place(self, thing: Placement, fit: Fit = "as_is") -> Instance | None:
        """Place a prop of the catalogue.

        Without room on the site for its footprint, ``"as_is"`` places it all the same, ``"skip"`` leaves it out and
        returns None, ``"must"`` raises an `AssetError`.
        """
        z, at = thing.z, (thing.x, thing.y)
        if z is None and thing.settle_m is not None:
            z = self.foot_z(*at, thing.settle_m)
        base = self.ground_z(*at) if z is None else z
        before = dict(self._counts)
        name = thing.node or self.node(thing.category)
        variant = self.next_variant(thing.category) if thing.variant is None else thing.variant

        def made(at: tuple[float, float, float], yaw_deg: float, place: str) -> Instance:
            words = {**thing.attributes, **({"place": place} if place else {})}
            return self.catalogue.instantiate(
                thing.category, name, self.rng_for("prop", name), at, yaw_deg, None if variant == DRAWN else variant,
                thing.scale, thing.design or self.design(thing.category, name),
                Overrides(thing.params, thing.roles, words or None, thing.stretch),
            )  # fmt: skip

        instance = made((*at, base), thing.yaw_deg, thing.place)
        area = footprint(instance, base) if thing.solid or fit != "as_is" else None
        high = float(instance.bounds[1, 2])
        if area is not None and fit != "as_is" and not self._has_room(area, base, high):
            self._counts = before
            if fit == "must":
                raise AssetError(f"no room for {thing.category} at ({thing.x:g}, {thing.y:g})")
            return None
        self._reserve_node(name)
        if thing.solid and area is not None:
            self._footprints.add(area, base, high)
        standing, move = instance, self.head.moves.get(name)
        if move is not None:
            # Its original footprint stays occupied, so that everything placed later keeps its place.
            self._moved_nodes.add(name)
            place = thing.place if move.place is None else move.place
            standing = made(self._moved_to(move, (*at, base)), thing.yaw_deg + move.turn_deg, place)
        if thing.z is None:
            self._on_ground.append(len(self.instances))
        self.instances.append(standing)
        self._reserve(thing, instance)
        return instance

    def _has_room(self, area: BaseGeometry, low: float, high: float) -> bool:
        return bool(self.extent.contains(area)) and self._footprints.is_free(area, low, high)

    def _reserve(self, thing: Placement, instance: Instance) -> None:
        low, high = instance.bounds[:, 2]
        if thing.clear_m:
            self.occupy(disc(thing.x, thing.y, thing.clear_m))
        if thing.margin_m:
            around = rectangle(*instance.bounds[:, :2].ravel()).buffer(thing.margin_m, quad_segs=2)
            self.occupy(around, -_BELOW_M, float(high) + 8.0)
        if thing.room_m:
            variant = instance.variant or None
            outline = self.outline_of(thing.category, variant, (thing.x, thing.y), thing.yaw_deg)
            self.occupy(outline.buffer(thing.room_m, quad_segs=2), float(low) - 1.0, float(high) + 6.0)

    def design(self, category: str, node: str) -> str:
        """Draw the design of a node among those of the scene's side."""
        designs = of_side(self.catalogue[category].designs, self.head.designs)
        return designs[rank(self.head.seed, "design", self.name, node) % len(designs)].name

    def next_variant(self, category: str) -> str | None:
        """Name the variant of a category used least so far; None where it has none."""
        names = [variant.name for variant in self.catalogue[category].variants]
        used = Counter(i.variant for i in self.instances if i.category == category)
        return min(names, key=lambda name: (used[name], names.index(name)), default=None)

    def foot_z(self, x: float, y: float, radius_m: float = 0.5) -> float:
        """Give the height at which a prop of that radius neither floats nor is buried on a slope, metres."""
        angles = np.arange(6) * np.pi / 3
        ring = [self.ground_z(x + radius_m * float(np.cos(a)), y + radius_m * float(np.sin(a))) for a in angles]
        return (self.ground_z(x, y) + min(ring)) / 2.0

    def outline_of(self, category: str, variant: str | None, at: tuple[float, float], yaw_deg: float) -> BaseGeometry:
        """Outline of a thing on the ground, grown by 0.1 m, world frame."""
        key = category, variant
        if key not in self._outlines:
            trial = self.catalogue.instantiate(category, "outline", self.rng_for("outline", *key), variant=variant)
            self._outlines[key] = hull(trial.vertices[:, :2]).buffer(0.1, quad_segs=2)
        return translate(rotate(self._outlines[key], yaw_deg, origin=(0, 0)), *at)

    def _moved_to(self, move: Move, at: tuple[float, float, float]) -> tuple[float, float, float]:
        """Where a thing goes that the recipe moves; on the ground it keeps its height above it."""
        x, y, z = at
        target = (x + move.by_m[0], y + move.by_m[1])
        above = z - self.ground_z(x, y)
        if above < 0.0:
            # Sunk into a slope: only as deep as the new slope requires.
            ring = [
                self.ground_z(target[0] + u, target[1] + v) for u, v in ((0.5, 0), (0, 0.5), (-0.5, 0), (0, -0.5))
            ]
            above = max(above, min((min(ring) - self.ground_z(*target)) / 2.0, 0.0))
        base = self.ground_z(*target) + above
        return (*target, base + move.up_m)

    def add(
        self,
        node: str | None,
        category: str,
        parts: Iterable[tuple[str, Mesh]],
        attributes: Mapping[str, str] | None = None,
        *,
        footprint: BaseGeometry | None = None,
    ) -> Instance:
        """Add structure made by the layout: parts in world metres, attributes for descriptions, footprint."""
        name = self._reserve_node(node or self.node(category))
        shape = [replace(part, material=self.laid_out(part.material, name)) for part in self._as_parts(parts)]
        instance = Instance(name, category, "", dict(attributes or {}), placed(shape, (0, 0, 0)))
        if not any(part.faces.size for part in instance.parts):
            raise AssetError(f"{self.name}: {name} has no body: it is too small, or lies off the site")
        self.instances.append(instance)
        if footprint is not None:
            low, high = instance.bounds[:, 2]
            self._footprints.add(footprint, float(low), float(high))
        return instance

    def laid_out(self, material: str, node: str, flush: bool = False) -> str:
        """Draw the layout of a node's façades, or one without balconies; the next in number has another."""
        row = node.rstrip("0123456789")
        first = rank(self.head.seed, "facade", self.name, row, material.partition(":")[0])
        return self.catalogue.materials.laid_out(material, first + int(node[len(row) :] or 0), flush)

    # Room

    def occupy(self, area: BaseGeometry, z0_m: float = -100.0, z1_m: float = 1000.0) -> None:
        """Occupy an area, over all heights by default."""
        self._footprints.add(area, z0_m, z1_m)

    def occupy_about(self, points: Iterable[tuple[float, float]], half_m: float, z0_m: float, z1_m: float) -> None:
        """Occupy squares about points, such as the feet of columns, between two heights."""
        for x, y in points:
            self.occupy(rectangle(x - half_m, y - half_m, x + half_m, y + half_m), z0_m, z1_m)

    def is_free(self, x: float, y: float, radius_m: float, z: float | None = None, height_m: float = 2.0) -> bool:
        """Whether a disc of ground inside the site is free up to `height_m` above the ground (or above `z`)."""
        base = self.ground_z(x, y) if z is None else z
        return self._has_room(disc(x, y, radius_m), base, base + height_m)

    def scene(self) -> Scene:
        """Finish: cut the ground, check that everything has its material, and make the scene."""
        missing = next((node for node in self.head.moves if node not in self._moved_nodes), None)
        if missing is not None:
            raise AssetError(f"{self.name}: moves: no prop {missing!r} is placed{nearest(missing, self._nodes)}")
        self._bring_into_contact()
        ground = self._ground()
        instances = (ground, *self.instances)
        x, y = self.head.size_m
        floor = float(ground.bounds[0, 2])
        bounds = np.array([[-x / 2, -y / 2, floor], [x / 2, y / 2, self.head.ceiling_m]])
        beyond = make_horizon(self.name, self.head.horizon, ground, self.instances, bounds, self.catalogue.materials)
        specs = sorted({p.material for i in (*instances, *beyond) for p in i.parts})
        materials = {s: self.catalogue.materials[s] for s in specs}
        sky, sun = parse_colour(self.head.sky), self.head.sun_direction
        scene = Scene(
            self.name, instances, materials, bounds, sky, sun, self.head.light.weather, backdrop=beyond,
            attribution=self.head.attribution,
        )  # fmt: skip
        return turned(scene, self.head.turn_deg)

    def _bring_into_contact(self) -> None:
        """Let what stands on a slope lean with it, sink in, or stand on a plinth."""

        def heights(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.array([self.ground_z(*at) for at in zip(x.tolist(), y.tolist(), strict=True)])

        for k in self._on_ground:
            thing = self.instances[k]
            (x0, y0, _), (x1, y1, _) = thing.bounds
            under = self.terrain.z([x0, x1, x1, x0], [y0, y0, y1, y1])
            if np.ptp(under) <= CONTACT_M / 2.0:
                continue
            self.instances[k], plinth = rest_on_ground(thing, self.catalogue[thing.category].kind, heights)
            if plinth is not None:
                self.add(f"plinth_{thing.node}", "plinth", [(self.material("plinth", "concrete"), plinth)])

    def _ground(self) -> Instance:
        meshes = ground_meshes(self.terrain, self.extent, self._base, self._surfaces)
        parts = placed(self._as_parts(meshes), (0, 0, 0))
        return Instance(self._reserve_node("ground"), "ground", "", {}, parts)

    def _as_parts(self, parts: Iterable[tuple[str, Mesh]]) -> list[Part]:
        """Give meshes in world coordinates their materials; the pattern of one runs on from its neighbours'."""
        tile_m = self.catalogue.materials.tile_m
        return [to_part(body, material, tile_m(material)) for material, body in by_material(parts)]

    def _reserve_node(self, node: str) -> str:
        if node in self._nodes:
            raise AssetError(f"{self.name}: node {node!r} exists already; choose another name")
        if len(self._nodes) >= MAX_NODES:
            raise AssetError(f"{self.name}: more than {MAX_NODES:,} instances in the scene")
        self._nodes.add(node)
        return node
