"""The catalogue: `scene_assets/{props,landmarks,scenery}/*.toml`, and how a category becomes an instance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.common.names import nearest
from aerialdojo_gen.errors import AssetError, ShapeError
from aerialdojo_gen.scenes.builders import builders
from aerialdojo_gen.scenes.catalogue_files import TARGETS, catalogue_files
from aerialdojo_gen.scenes.materials import MaterialLibrary, load_materials, read_toml, refuse_unknown
from aerialdojo_gen.scenes.mesh import Mesh, areas, merge, rotation, to_part
from aerialdojo_gen.scenes.model import Instance, Part
from aerialdojo_gen.scenes.prop import Category, Variant, parse_category
from aerialdojo_gen.scenes.vocabulary import MAX_TRIANGLES, part_mesh

_MATERIALS = "materials.toml"
_CACHE_SIZE = 2000
_CROWN_SHAPES = 6


class Catalogue:
    """All categories by name.

    Parameters
    ----------
    categories : mapping of str to Category
        By key.
    materials : MaterialLibrary
        What their roles may name.
    """

    def __init__(self, categories: Mapping[str, Category], materials: MaterialLibrary) -> None:
        self._categories = dict(categories)
        self.materials = materials
        self._parts: dict[tuple[object, ...], tuple[Part, ...]] = {}

    def __len__(self) -> int:
        return len(self._categories)

    def __iter__(self) -> Iterator[str]:
        return iter(self._categories)

    def __contains__(self, category: object) -> bool:
        return category in self._categories

    @property
    def targets(self) -> tuple[str, ...]:
        """Categories that tasks may ask for: the semantic categories of the dataset."""
        return tuple(name for name, category in self._categories.items() if category.target)

    def __getitem__(self, category: str) -> Category:
        """Look a category up; an `AssetError` names the nearest one."""
        if category not in self._categories:
            raise AssetError(f"unknown category {category!r}{nearest(category, self._categories)}")
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
        params: Mapping[str, float] | None = None,
        roles: Mapping[str, str] | None = None,
        attributes: Mapping[str, str] | None = None,
    ) -> Instance:
        """Make an instance of a category.

        Parameters
        ----------
        category : str
            Key of the catalogue.
        node : str
            Node name, unique in the scene.
        rng : numpy.random.Generator
            Draws the variant by weight, then every parameter in file order, then what a builder draws.
        position : (x, y, z)
            Where the prop's origin goes, metres, world frame.
        yaw_deg : float
            Direction of its front, degrees, counter-clockwise from +x.
        variant : str, optional
            Name of a variant, in place of a drawn one.
        scale : float
            Factor on all lengths; patterns keep their size.
        params : mapping, optional
            Fixed values in place of drawn ones.
        roles : mapping, optional
            Materials in place of the variant's.
        attributes : mapping, optional
            Added to the variant's; they also fill ``{…}`` in a sign's text.

        Returns
        -------
        Instance
            World coordinates, exact in float32.

        Raises
        ------
        AssetError
            Unknown category, variant, parameter, role or material, or sizes that make no body.
        """
        prop = self[category]
        look = self._draw_variant(prop, variant, rng)
        sizes = self._draw_params(prop, look, params or {}, rng)
        shape_seed = int(rng.integers(_CROWN_SHAPES))
        surfaces = dict(prop.roles) | dict(look.roles) | dict(roles or {})
        refuse_unknown(roles or {}, prop.roles, f"{prop.source} roles")
        words = dict(look.attributes) | dict(attributes or {})
        if prop.builder is not None:
            parts = self._built(prop, prop.builder, sizes, surfaces, rng)
        else:
            signs = tuple(words.items()) if any(p["shape"] == "text" for p in prop.parts) else ()
            key = (category, look.name, tuple(sizes.items()), tuple(surfaces.items()), signs, shape_seed)
            if key not in self._parts:
                if len(self._parts) >= _CACHE_SIZE:
                    self._parts.clear()
                self._parts[key] = self._assembled(prop, look, sizes, surfaces, words, shape_seed)
            parts = self._parts[key]
        there = placed(parts, position, yaw_deg, scale)
        if not there:
            raise AssetError(f"{prop.source}: no triangle of variant {look.name!r} has an area")
        return Instance(node, category, look.name, words, there)

    def _draw_variant(self, prop: Category, name: str | None, rng: np.random.Generator) -> Variant:
        weights = np.array([v.weight for v in prop.variants])
        drawn = int(np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random(), side="right"))
        return prop.variants[min(drawn, len(prop.variants) - 1)] if name is None else prop.variant(name)

    @staticmethod
    def _draw_params(
        prop: Category, look: Variant, fixed: Mapping[str, float], rng: np.random.Generator
    ) -> dict[str, float]:
        refuse_unknown(fixed, prop.params, f"{prop.source} params")
        out = {}
        for name, ends in prop.params.items():
            low, high = look.params.get(name, ends)
            drawn = float(rng.uniform(low, high)) if low < high else low
            # Centimetres: no eye sees less, and equal sizes share their geometry.
            out[name] = float(fixed[name]) if name in fixed else round(drawn, 2) if low < high else low
        return out

    def _assembled(
        self,
        prop: Category,
        look: Variant,
        sizes: Mapping[str, float],
        surfaces: Mapping[str, str],
        words: Mapping[str, str],
        shape_seed: int,
    ) -> tuple[Part, ...]:
        meshes: list[tuple[str, Mesh]] = []
        for k, part in enumerate(prop.parts):
            if part.get("tag") in look.without:
                continue
            own = part
            if part["shape"] == "crown" and "seed" not in part:
                own = {**part, "seed": shape_seed + k * _CROWN_SHAPES}
            try:
                meshes.append((part["role"], part_mesh(own, sizes, words)))
            except ShapeError as error:
                raise AssetError(f"{prop.source} parts[{k}] ({part['shape']}): {error}") from error
        total = sum(len(body.faces) for _, body in meshes)
        if total > MAX_TRIANGLES:
            raise AssetError(f"{prop.source} has {total:,} triangles, {MAX_TRIANGLES:,} are the most")
        return self._textured(prop, meshes, surfaces)

    def _built(
        self,
        prop: Category,
        builder: str,
        sizes: Mapping[str, float],
        surfaces: Mapping[str, str],
        rng: np.random.Generator,
    ) -> tuple[Part, ...]:
        try:
            meshes = list(builders()[builder](rng, sizes))
        except (ValueError, KeyError) as error:
            raise AssetError(f"{prop.source} builder {builder!r}: {error}") from error
        return self._textured(prop, meshes, surfaces)

    def _textured(
        self, prop: Category, meshes: Sequence[tuple[str, Mesh]], surfaces: Mapping[str, str]
    ) -> tuple[Part, ...]:
        by_material: dict[str, list[Mesh]] = {}
        for role, body in meshes:
            by_material.setdefault(surfaces.get(role, role), []).append(body)
        for spec in by_material:
            self.materials.check(spec, prop.source)
        return tuple(to_part(merge(m), spec, self.materials.tile_m(spec)) for spec, m in by_material.items())


def placed(
    parts: Sequence[Part], position: Sequence[float], yaw_deg: float = 0.0, scale: float = 1.0
) -> tuple[Part, ...]:
    """Scale, turn and move parts into the world, rounded to what float32 holds."""
    turn = rotation(0.0, 0.0, yaw_deg).T
    offset = np.asarray(position, dtype=np.float64)
    out = []
    for p in parts:
        vertices = single(p.vertices * scale @ turn + offset)
        # Far from the origin float32 may flatten a sliver to nothing.
        faces = p.faces[areas(vertices, p.faces) > 0.0]
        if len(faces):
            out.append(Part(vertices, faces, p.uv * np.float32(scale), p.material))
    return tuple(out)


def single(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round coordinates to float32, kept as float64: a scene file holds float32 and must come back the same."""
    return vertices.astype(np.float32).astype(np.float64)


def load_catalogue(folder: Path) -> Catalogue:
    """Read a `scene_assets` folder: `materials.toml` and the files of `catalogue_files`.

    A process reads it once, as long as no file changes.

    Raises
    ------
    AssetError
        The first thing that is wrong: file, category, part or variant, key, and what was probably meant.
    """
    return _load(folder, tuple(_state(path) for path in (folder / _MATERIALS, *catalogue_files(folder))))


def _state(path: Path) -> tuple[str, int, int, int]:
    try:
        status = path.stat()
    except OSError:
        return path.name, 0, 0, 0  # who reads it says what is wrong
    return path.name, status.st_ino, status.st_size, status.st_mtime_ns


@lru_cache(maxsize=2)
def _load(folder: Path, files: tuple[tuple[str, int, int, int], ...]) -> Catalogue:
    materials = load_materials(folder / _MATERIALS)
    categories: dict[str, Category] = {}
    for path in catalogue_files(folder):
        for name, body in read_toml(path).items():
            if name in categories:
                raise AssetError(f"{path}: [{name}] stands already in {categories[name].source.partition(':')[0]}")
            categories[name] = parse_category(path, name, body, materials, path.parent.name == TARGETS)
    return Catalogue(categories, materials)
