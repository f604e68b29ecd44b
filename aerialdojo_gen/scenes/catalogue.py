"""The catalogue: `scene_assets/{props,landmarks,scenery}/*.toml`, and how a category becomes an instance."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import AssetError, ShapeError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.scenes.builders import builders
from aerialdojo_gen.scenes.catalogue_files import TARGETS, catalogue_files
from aerialdojo_gen.scenes.kernels import placed_vertices
from aerialdojo_gen.scenes.materials import MaterialLibrary, load_materials, read_toml, refuse_unknown
from aerialdojo_gen.scenes.mesh import Mesh, merge, rotation, to_part
from aerialdojo_gen.scenes.model import FRONTS, Anatomy, Instance, Part, Run, remap_runs
from aerialdojo_gen.scenes.prop import (
    Category,
    Design,
    DesignSets,
    Entry,
    Variant,
    load_sets,
    parse_category,
    parse_entry,
    words_of,
)
from aerialdojo_gen.scenes.vocabulary import MAX_TRIANGLES, copies_in, part_mesh

_MATERIALS = "materials.toml"
_DESIGNS = "designs.toml"
_CACHE_SIZE = 2000
_CROWN_SHAPES = 6
_SHAPE_DIGITS = 12


class Overrides(NamedTuple):
    """What an instance has in place of its category's values; the stretch multiplies its design's."""

    params: Mapping[str, float] | None = None
    roles: Mapping[str, str] | None = None
    attributes: Mapping[str, str] | None = None
    stretch: tuple[float, float, float] | None = None


_NONE = Overrides()


class Catalogue:
    """All categories by name. What is wrong with the parts of one is found when it is first looked up."""

    def __init__(self, entries: Mapping[str, Entry], materials: MaterialLibrary, sets: DesignSets) -> None:
        self._entries, self._sets = dict(entries), sets
        self._categories: dict[str, Category] = {}
        self.materials = materials
        self._bodies: dict[tuple[object, ...], _Body] = {}
        self._assemblies: dict[tuple[object, ...], _Assembly] = {}

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __contains__(self, category: object) -> bool:
        return category in self._entries

    @property
    def targets(self) -> tuple[str, ...]:
        """Categories that tasks may ask for: the semantic categories of the dataset."""
        return tuple(name for name, entry in self._entries.items() if entry.target)

    @property
    def names(self) -> dict[str, str]:
        """Common noun of every category."""
        return {category: entry.name for category, entry in self._entries.items()}

    @property
    def kinds(self) -> dict[str, str]:
        """Kind of every category."""
        return {category: entry.kind for category, entry in self._entries.items()}

    def __getitem__(self, category: str) -> Category:
        """Look a category up and check its table; an `AssetError` names the nearest one, or the fault."""
        if category not in self._categories:
            if category not in self._entries:
                raise AssetError(f"unknown category {category!r}{nearest(category, self._entries)}")
            self._categories[category] = parse_category(self._entries[category], self.materials, self._sets)
        return self._categories[category]

    def instantiate(
        self,
        category: str,
        node: str,
        rng: np.random.Generator,
        position: Sequence[float] = (0.0, 0.0, 0.0),
        yaw_deg: float = 0.0,
        variant: str | None = None,
        scale: float = 1.0,
        design: str | None = None,
        own: Overrides = _NONE,
    ) -> Instance:
        """Make an instance at a position (world metres); variant, parameters and builder draw from `rng` in order.

        Its design is the first of its category where none is given. `scale` multiplies the category's own.
        """
        prop = self[category]
        kind = self._draw_variant(prop, variant, rng)
        form = prop.designs[0] if design is None else prop.design(design)
        if own.stretch is not None:
            x, y, z = (mine * factor for mine, factor in zip(form.stretch, own.stretch, strict=True))
            form = form.model_copy(update={"stretch": (x, y, z)})
        sizes = self._draw_params(prop, kind, {**form.params, **(own.params or {})}, rng)
        shape_seed = int(rng.integers(_CROWN_SHAPES))
        surfaces = dict(prop.roles) | dict(kind.roles) | dict(own.roles or {})
        refuse_unknown(own.roles or {}, prop.roles, f"{prop.source} roles")
        words = dict(kind.attributes) | dict(own.attributes or {})
        if prop.builder is not None:
            try:
                pieces = [_Piece(role, body) for role, body in builders()[prop.builder](rng, sizes)]
            except (ValueError, KeyError) as error:
                raise AssetError(f"{prop.source} builder {prop.builder!r}: {error}") from error
            assembly = self._textured(prop, _Body(pieces), surfaces)
        else:
            # Most variants of a category differ in their surfaces alone.
            signs = tuple(words.items()) if any(p["shape"] == "text" for p in prop.parts) else ()
            seed = shape_seed if any(map(_is_drawn_crown, prop.parts)) else 0
            shape = (category, kind.without, form.name, form.stretch, tuple(sizes.items()), signs, seed)
            body = _kept(self._bodies, shape, lambda: self._body(prop, kind, form, sizes, words, seed))
            key = (*shape, tuple(surfaces.items()))
            assembly = _kept(self._assemblies, key, lambda: self._textured(prop, body, surfaces))
        scale = scale * prop.scale
        placed_parts, kept_faces = _placed(assembly.parts, position, yaw_deg, scale)
        if not placed_parts:
            raise AssetError(f"{prop.source}: no triangle of variant {kind.name!r} has an area")
        anatomy = None
        if prop.front:
            yaw = math.radians(yaw_deg)
            fronts = tuple(float(wrap_angle_rad(yaw + math.radians(side))) for side in FRONTS[prop.front])
            identifying = tuple(dict.fromkeys((*prop.identifying_parts, *kind.identifying_parts)))
            anatomy = Anatomy(float(wrap_angle_rad(yaw)), fronts, identifying, remap_runs(assembly.runs, kept_faces))
        digest = sha256(assembly.shape + str(round(scale, 3)).encode()).hexdigest()[:_SHAPE_DIGITS]
        return Instance(node, category, kind.name, words, placed_parts, anatomy, shape=digest, held_out=form.held_out)

    def _draw_variant(self, prop: Category, name: str | None, rng: np.random.Generator) -> Variant:
        weights = np.array([v.weight for v in prop.variants])
        drawn = int(np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random(), side="right"))
        return prop.variants[min(drawn, len(prop.variants) - 1)] if name is None else prop.variant(name)

    @staticmethod
    def _draw_params(
        prop: Category, kind: Variant, fixed: Mapping[str, float], rng: np.random.Generator
    ) -> dict[str, float]:
        refuse_unknown(fixed, prop.params, f"{prop.source} params")
        out = {}
        for name, ends in prop.params.items():
            low, high = kind.params.get(name, ends)
            drawn = float(rng.uniform(low, high)) if low < high else low
            # Rounded to centimetres, so that equal sizes share their geometry.
            out[name] = float(fixed[name]) if name in fixed else round(drawn, 2) if low < high else low
        return out

    @staticmethod
    def _body(
        prop: Category,
        kind: Variant,
        form: Design,
        sizes: Mapping[str, float],
        words: Mapping[str, str],
        seed: int,
    ) -> _Body:
        meshes: list[_Piece] = []
        for k, part in enumerate(prop.parts):
            only = words_of(part, "design")
            if (kind.without | form.without).intersection(words_of(part, "tag")) or (only and form.name not in only):
                continue
            own = part
            if _is_drawn_crown(part):
                own = {**part, "seed": seed + k * _CROWN_SHAPES}
            try:
                body, copies = part_mesh(own, sizes, words, form.stretch), copies_in(own, sizes)
            except ShapeError as error:
                raise AssetError(f"{prop.source} parts[{k}] ({part['shape']}): {error}") from error
            meshes.append(_Piece(part["role"], body, words_of(part, "tag"), copies))
        total = sum(len(piece.body.faces) for piece in meshes)
        if total > MAX_TRIANGLES:
            raise AssetError(f"{prop.source} has {total:,} triangles, the maximum is {MAX_TRIANGLES:,}")
        return _Body(meshes)

    def _textured(self, prop: Category, body: _Body, surfaces: Mapping[str, str]) -> _Assembly:
        by_material: dict[str, list[_Piece]] = {}
        for piece in body.pieces:
            by_material.setdefault(surfaces.get(piece.role, piece.role), []).append(piece)
        runs: dict[str, list[Run]] = {}
        parts = []
        for k, (spec, members) in enumerate(by_material.items()):
            self.materials.check(spec, prop.source)
            parts.append(to_part(merge([piece.body for piece in members]), spec, self.materials.tile_m(spec)))
            first = 0
            for piece in members:
                faces = len(piece.body.faces)
                run = Run(k, first, faces // piece.copies, piece.copies)
                for name in dict.fromkeys((*piece.tags, piece.role)):
                    runs.setdefault(name, []).extend([run] if faces else [])
                first += faces
        named = {name: tuple(members) for name, members in sorted(runs.items())}
        return _Assembly(tuple(parts), named, body.shape)


T = TypeVar("T")


def _kept(cache: dict[tuple[object, ...], T], key: tuple[object, ...], make: Callable[[], T]) -> T:
    """Return what a cache has at a key, which is made where it has nothing."""
    if key not in cache:
        if len(cache) >= _CACHE_SIZE:
            cache.clear()
        cache[key] = make()
    return cache[key]


def _is_drawn_crown(part: Mapping[str, Any]) -> bool:
    return part["shape"] == "crown" and "seed" not in part


@dataclass(frozen=True, eq=False)
class _Piece:
    """A part of a prop without its material: copies of a shape."""

    role: str
    body: Mesh
    tags: tuple[str, ...] = ()
    copies: int = 1


@dataclass(frozen=True, eq=False)
class _Body:
    """A prop in its own frame, whatever its materials."""

    pieces: Sequence[_Piece]

    @cached_property
    def shape(self) -> bytes:
        """Digest of the geometry."""
        digest = sha256()
        for body in (piece.body for piece in self.pieces):
            digest.update(
                np.rint(body.vertices * 1000.0).astype("<i4").tobytes() + body.faces.astype("<i4").tobytes()
            )
        return digest.digest()


@dataclass(frozen=True, eq=False)
class _Assembly:
    """A prop in its own frame, with its named parts."""

    parts: tuple[Part, ...]
    runs: Mapping[str, tuple[Run, ...]]
    shape: bytes  # Digest of its geometry


def placed(
    parts: Sequence[Part], position: Sequence[float], yaw_deg: float = 0.0, scale: float = 1.0
) -> tuple[Part, ...]:
    """Scale, turn and move parts into the world, rounded to float32."""
    return _placed(parts, position, yaw_deg, scale)[0]


def _placed(
    parts: Sequence[Part], position: Sequence[float], yaw_deg: float, scale: float
) -> tuple[tuple[Part, ...], list[NDArray[np.bool_]]]:
    """The placed parts, and which faces of each original part are kept."""
    turn = np.ascontiguousarray(rotation(0.0, 0.0, yaw_deg).T)
    offset = np.asarray(position, dtype=np.float64)
    out, kept_faces = [], []
    for p in parts:
        # Far from the origin float32 may flatten a sliver to nothing.
        vertices, solid, count = placed_vertices(p.vertices, p.faces, float(scale), turn, offset)
        kept_faces.append(solid)
        if count:
            faces = p.faces if count == len(solid) else p.faces[solid]
            out.append(Part(vertices, faces, p.uv * np.float32(scale), p.material))
    return tuple(out), kept_faces


def single(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round coordinates to float32, kept as float64: a scene file holds float32 and must come back the same."""
    return vertices.astype(np.float32).astype(np.float64)


def load_catalogue(folder: Path) -> Catalogue:
    """Read a `scene_assets` folder: materials, designs and `catalogue_files`; cached while no file changes."""
    return _load(
        folder,
        tuple(_file_state(path) for path in (folder / _MATERIALS, folder / _DESIGNS, *catalogue_files(folder))),
    )


def _file_state(path: Path) -> tuple[str, int, int, int]:
    try:
        status = path.stat()
    except OSError:
        return path.name, 0, 0, 0  # reading it raises the error
    return path.name, status.st_ino, status.st_size, status.st_mtime_ns


@lru_cache(maxsize=2)
def _load(folder: Path, files: tuple[tuple[str, int, int, int], ...]) -> Catalogue:
    materials = load_materials(folder / _MATERIALS)
    sets = load_sets(folder / _DESIGNS)
    entries: dict[str, Entry] = {}
    with _uncollected():
        for path in catalogue_files(folder):
            for name, body in read_toml(path).items():
                if name in entries:
                    raise AssetError(f"{path}: [{name}] is already in {entries[name].source.partition(':')[0]}")
                entries[name] = parse_entry(path, name, body, path.parent.name == TARGETS)
    return Catalogue(entries, materials, sets)


@contextmanager
def _uncollected() -> Iterator[None]:
    """Look for no garbage: there is none in what is read, and looking takes two fifths of the time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
