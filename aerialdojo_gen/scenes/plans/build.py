"""From a plan to a scene: reads the TOML, resolves its names, and builds entry by entry."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from shapely.errors import GEOSException
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.errors import AssetError, ShapeError, brief
from aerialdojo_gen.base.explain import explain
from aerialdojo_gen.base.names import nearest, unknown
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.expressions import evaluate
from aerialdojo_gen.scenes.grammar import Frame, Pose, along, poisson_disc
from aerialdojo_gen.scenes.ground import disc
from aerialdojo_gen.scenes.kit import kit
from aerialdojo_gen.scenes.materials import refuse_unknown, validated
from aerialdojo_gen.scenes.mesh import Parts
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.plans.model import Ground, Paint, Pattern, Place, PlanHead, Structure, Thing
from aerialdojo_gen.scenes.plans.values import PlanNames
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import flat_terrain
from aerialdojo_gen.scenes.vocabulary import SHAPES, part_mesh


def poses_of(site: Site, pattern: Pattern) -> Iterator[Pose]:
    """Yield the poses of a pattern."""
    if pattern.along is not None:
        yield from along(
            pattern.along, pattern.spacing_m, pattern.offset_m, pattern.start_m, pattern.end_m, pattern.turn_deg
        )
    elif pattern.grid is not None:
        for x in pattern.grid[0]:
            for y in pattern.grid[1]:
                yaw = pattern.yaw
                yield Pose(x, y, evaluate(yaw, {"x": x, "y": y}) if isinstance(yaw, str) else float(yaw))
    elif pattern.ring is not None:
        x, y, radius_m, count, start_deg = pattern.ring
        for k in range(count):
            a = math.radians(start_deg + 360.0 / count * k)
            yield Pose(x + radius_m * math.cos(a), y + radius_m * math.sin(a), math.degrees(a) + pattern.turn_deg)
    elif pattern.scatter is not None:
        stream = site.rng_for(*(pattern.stream or "scatter").split("/"))
        yield from poisson_disc(pattern.scatter, pattern.spacing_m, stream, limit=pattern.limit)
    else:
        yield from (Pose(*pose) for pose in pattern.poses)


Model = TypeVar("Model", bound=BaseModel)


def build_plan(path: Path, catalogue: Catalogue, entries: dict[str, str] | None = None) -> Scene:
    """Build the scene of a plan, and fill in the entry of each node; an `AssetError` names file, entry and key."""
    return build_tables(path.stem, read_toml(path, AssetError), catalogue, entries, str(path), path.parent)


def build_tables(
    name: str, tables: Mapping[str, Any], catalogue: Catalogue, entries: dict[str, str] | None = None,
    where: str = "", folder: Path | None = None,
) -> Scene:  # fmt: skip
    """Build the scene of a plan's tables; errors name it by `where`, its name by default."""
    site, made = build_site(name, tables, catalogue, where or name, folder)
    if entries is not None:
        entries.update(made)
    scene = site.scene()
    _check_inventory(scene, site, where or name)
    return scene


def build_site(
    name: str, tables: Mapping[str, Any], catalogue: Catalogue, where: str, folder: Path | None
) -> tuple[Site, dict[str, str]]:
    """Build all that a plan says on a site, where more may be placed, and list the entry of each node."""
    head = validated(PlanHead, dict(tables), where)
    site = Site(name, head, catalogue, folder)
    return site, _Building(site, _names(head, catalogue, where), where).build(head)


def _check_inventory(scene: Scene, site: Site, where: str) -> None:
    """Raise an `AssetError` if a scene has fewer instances of a category than its plan asks for."""
    there, inventory = Counter(instance.category for instance in scene.instances), site.head.inventory
    for category in inventory:
        if category not in site.catalogue and not there[category]:
            raise AssetError(f"{where}: inventory: unknown category {category!r}{nearest(category, site.catalogue)}")
    short = [f"{c} (needs {n}, has {there[c]})" for c, n in inventory.items() if there[c] < n]
    if short:
        raise AssetError(f"{where}: inventory: the scene has too few of {', '.join(short)}")


def _names(head: PlanHead, catalogue: Catalogue, where: str) -> PlanNames:
    names = PlanNames(catalogue.materials, head.palette, fields=head.fields)
    for role, spec in head.palette.items():
        catalogue.materials.check(spec, f"{where}: palette {role}")
    tables: list[tuple[str, Mapping[str, Any], dict[str, Any], Callable[[Any], Any]]] = [
        ("floor_m", head.floor_m, names.heights, names.number),
        ("lines", head.lines, names.lines, names.line),
        ("areas", head.areas, names.areas, names.area),
    ]
    for table, given, known, resolve in tables:
        for name, value in given.items():
            try:
                known[name] = resolve(value)
            except ValueError as error:
                raise AssetError(f"{where}: [{table}] {brief(name)}: {error}") from None
    return names


def _entries(site: Sequence[dict[str, Any]]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield all entries, those in a list of short ones too, with their names."""
    for number, entry in enumerate(site):
        if "entries" not in entry:
            yield f"site[{number}]", entry
            continue
        for inner, one in enumerate(entry["entries"]):
            yield f"site[{number}].entries[{inner}]", one


class _Building:
    """Builds the entries of one plan."""

    def __init__(self, site: Site, names: PlanNames, where: str) -> None:
        self._site, self._names, self._where = site, names, where
        names.make_parts = self._all_parts
        self._placing: Mapping[str, Any] = {}

    def build(self, head: PlanHead) -> dict[str, str]:
        """Make the ground and then every entry, in order; returns the name of each node's entry, as in `site[3]`."""
        self._placing = head.placing
        entries = list(_entries(head.site))
        self._footings(entries)
        self._ground(head.ground)
        made: dict[str, str] = {}
        kinds: dict[str, Callable[[dict[str, Any], str], None]] = {
            "paint": self._paint, "make": self._make, "parts": self._structure, "place": self._place,
            "pattern": self._place,
        }  # fmt: skip
        for name, entry in entries:
            kind = next((kind for kind in kinds if kind in entry), None)
            where = f"{self._where}: {name}"
            if kind is None:
                raise AssetError(f"{where}: an entry has one of paint, make, parts, place, pattern")
            try:
                kinds[kind](entry, f"{where} ({kind})")
            except ShapeError as error:
                raise AssetError(f"{where} ({kind}): {error}") from error
            made |= {instance.node: name for instance in self._site.instances[len(made) :]}
        return made

    def _read(self, model: type[Model], body: Mapping[str, Any], where: str) -> Model:
        try:
            return model.model_validate(dict(body), context=self._names)
        except ValidationError as error:
            raise AssetError(f"{where}: {'; '.join(explain(error, model))}") from None

    def _call(self, kind: str, body: Mapping[str, Any], where: str, *fixed: Any) -> Any:
        """Call the builder that ``make`` names with the other keys of a table."""
        name = body["make"]
        builders = {name: one for name, one in kit().items() if one.kind == kind}
        if not isinstance(name, str) or name not in builders:
            raise AssetError(f"{where}: {unknown(f'no {kind} builder', str(name), builders)}")
        builder = builders[name]
        arguments = self._read(builder.arguments, {k: v for k, v in body.items() if k != "make"}, f"{where} {name!r}")
        try:
            return builder.function(
                *fixed, **{key: getattr(arguments, key) for key in builder.arguments.model_fields}
            )
        except (AssetError, ValueError, ArithmeticError, GEOSException) as error:
            # Numbers that are each within bounds and make no body together.
            raise AssetError(f"{where} {name!r}: {error}") from error

    def _footings(self, entries: Sequence[tuple[str, Mapping[str, Any]]]) -> None:
        """Outline the things that the ground is to be levelled under, before it is made."""
        for name, body in entries:
            if not body.get("level"):
                continue
            where = f"{self._where}: {name} (place)"
            # Heights that builders return are not known yet.
            entry = self._read(Place, {key: body[key] for key in ("place", "frame") if key in body}, where)
            for raw in entry.place:
                for thing in self._row(raw[:4] if isinstance(raw, list) else {**raw, "on": None}, where):
                    category, variant, pose = self._pose(thing, entry, where)
                    outline = self._site.outline_of(category, variant, pose[:2], pose[2])
                    self._site.footings.append((outline, Point(pose[:2])))

    def _ground(self, body: Mapping[str, Any]) -> None:
        ground = self._read(Ground, body, f"{self._where}: [ground]")
        terrain = flat_terrain(self._site.head.size_m)
        for number, step in enumerate(ground.steps):
            where = f"{self._where}: [ground] steps[{number}]"
            if "make" not in step:
                raise AssetError(f"{where}: key 'make' is missing")
            terrain = self._call("ground", step, where, self._site, terrain)
        self._site.set_ground(terrain, ground.material)

    def _paint(self, body: dict[str, Any], where: str) -> None:
        entry = self._read(Paint, body, where)
        for area in entry.paint:
            self._site.paint(area, entry.material, entry.rise_m, entry.edge)

    def _make(self, body: dict[str, Any], where: str) -> None:
        """Call a builder; ``as`` names the height that it returns, e.g. of a roof, the heights, or the area."""
        made = self._call("site", {k: v for k, v in body.items() if k != "as"}, where, self._site)
        if "as" in body:
            names = body["as"] if isinstance(body["as"], list) else [body["as"]]
            if isinstance(made, BaseGeometry) and isinstance(body["as"], str):
                self._names.areas[body["as"]] = made
                return
            heights = made if isinstance(made, list) else [made]
            if len(names) != len(heights) or not all(isinstance(height, float) for height in heights):
                raise AssetError(f"{where}: {body['make']!r} returns no height for each name of 'as'")
            self._names.heights.update(zip(map(str, names), heights, strict=True))

    def _structure(self, body: dict[str, Any], where: str) -> None:
        entry = self._read(Structure, body, where)
        parts = self._all_parts(entry.parts, f"{where} ")
        if entry.at != (0.0, 0.0) or entry.yaw_deg or entry.on:
            parts = Frame(*entry.at, entry.yaw_deg).parts(parts, entry.on)
        self._site.add(
            entry.node, entry.category or str(entry.node), parts, entry.attributes or None, footprint=entry.footprint
        )
        for x, y, radius in entry.keep_clear:
            self._site.occupy(disc(x, y, radius, 8))

    def _all_parts(self, parts: Sequence[Mapping[str, Any]], where: str = "") -> Parts:
        return [one for number, part in enumerate(parts) for one in self._parts(part, f"{where}parts[{number}]")]

    def _parts(self, part: Mapping[str, Any], where: str) -> Parts:
        if "make" in part:
            made: Parts = self._call("parts", part, where)
            return made
        shape, role = part.get("shape"), part.get("role")
        refuse_unknown([shape], SHAPES, where, "shape")
        try:
            material = self._names.material(role)
            return [(material, part_mesh(part, self._names.heights, {}))]
        except (ValueError, TypeError) as error:
            raise AssetError(f"{where} ({shape}): {error}") from None

    def _place(self, body: dict[str, Any], where: str) -> None:
        entry = self._read(Place, {**self._placing, **body}, where)
        for number, raw in enumerate(entry.place):
            for thing in self._row(raw, f"{where}[{number}]"):
                self._place_one(thing, entry, where)
        if entry.pattern is not None:
            placed = 0
            for pose in poses_of(self._site, entry.pattern):
                what = entry.pattern.of[placed % len(entry.pattern.of)]
                placed += self._place_one(self._thing([what, *pose], where), entry, where)

    def _row(self, raw: Any, where: str) -> list[Thing]:
        """Read a thing, or a straight row of them."""
        thing = self._thing(raw, where)
        (x, y), (dx, dy) = thing.at, thing.step
        return [thing.model_copy(update={"at": (x + k * dx, y + k * dy)}) for k in range(thing.count)]

    def _thing(self, raw: Any, where: str) -> Thing:
        if isinstance(raw, list):
            if len(raw) not in (3, 4, 5):
                raise AssetError(f"{where}: a thing is [category, x, y], or with yaw and height too, got {raw!r}")
            keys: Sequence[tuple[str, Any]] = [*zip(("yaw_deg", "on"), raw[3:], strict=False)]
            what, _, phrase = str(raw[0]).partition(" | ")
            raw = {"what": what, "phrase": phrase, "at": raw[1:3], **dict(keys)}
        if not isinstance(raw, dict):
            raise AssetError(f"{where}: a thing is a list or a table, got {raw!r}")
        return self._read(Thing, raw, where)

    def _pose(self, thing: Thing, entry: Place, where: str) -> tuple[str, str | None, tuple[float, float, float]]:
        """Category, variant and world pose of a thing."""
        category, _, variant = thing.what.partition(":")
        refuse_unknown([category], self._site.catalogue, where, "category")
        frame = Frame(*entry.frame)
        pose = frame.pose(*thing.at, thing.yaw_deg) if any(entry.frame) else (*thing.at, thing.yaw_deg)
        return category, variant or None, pose

    def _place_one(self, thing: Thing, entry: Place, where: str) -> bool:
        category, variant, (x, y, yaw_deg) = self._pose(thing, entry, where)
        z, above_m = thing.on if thing.on is not None else entry.on, thing.above_ground_m or entry.above_ground_m
        settles = z is None and entry.settle_m is not None and not above_m and entry.sunk is None
        if z is None and entry.settle_m is not None and not settles:
            z = self._site.foot_z(x, y, entry.settle_m) + above_m
        elif z is None and above_m:
            z = self._site.ground_z(x, y) + above_m
        if entry.sunk is not None:
            share, most_m = entry.sunk
            look = variant if variant is not None else self._site.next_variant(category)
            trial = self._site.catalogue.instantiate(
                category, "trial", self._site.rng_for("trial"), (x, y, 0.0), variant=look
            )
            z = (z or 0.0) - min(share * float(trial.bounds[1, 2]), most_m)
        own = {key: getattr(thing, key) for key in ("design", "scale", "roles", "params", "attributes")}
        own = {key: value for key, value in own.items() if value}
        one = Placement(
            category, x, y, yaw_deg, variant, z, thing.phrase or entry.phrase, thing.node, solid=thing.solid,
            settle_m=entry.settle_m if settles else None, clear_m=entry.clear_m, margin_m=entry.margin_m,
            room_m=entry.room_m, **own,
        )  # fmt: skip
        try:
            placed = self._site.place(one, entry.fit) is not None
        except AssetError as error:
            raise AssetError(f"{where}: {error}") from error
        if placed and entry.spots:
            others = self._names.areas.get(entry.spots, Point())
            self._names.areas[entry.spots] = others.union(Point(x, y))
        return placed
