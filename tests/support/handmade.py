"""Small scenes made by hand from trimesh's primitives, whose places tests know, and tables that tell of them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import trimesh
from numpy.typing import NDArray

from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.pipeline.stage import Job, ProjectPaths
from aerialdojo_gen.pipeline.stages.work.build_scenes import scene_row
from aerialdojo_gen.scenes.glb import write_glb
from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.schemas import TableSpec
from aerialdojo_gen.store.tables import from_rows


def part(mesh: trimesh.Trimesh, material: str = "grey", uv: NDArray[np.float64] | None = None) -> Part:
    v = np.asarray(mesh.vertices, dtype=np.float64)
    places = np.zeros((len(v), 2)) if uv is None else uv
    return Part(v, np.asarray(mesh.faces, dtype=np.int32), places.astype(np.float32), material)


def instance(node: str, *meshes: trimesh.Trimesh, category: str = "thing") -> Instance:
    return Instance(node, category, "", {}, tuple(map(part, meshes)))


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def ground(half: float) -> Instance:
    return instance("ground", box((-half, -half, -0.5), (half, half, 0.0)), category="ground")


def scene(*instances: Instance, half: float = 15.0, ceiling: float = 15.0, name: str = "U_Test_0") -> Scene:
    return Scene(
        name,
        (ground(half + 1), *instances),
        {"grey": Material("grey", (128, 128, 128))},
        np.array([[-half, -half, 0.0], [half, half, ceiling]]),
    )


def mesh_of(item: Instance) -> trimesh.Trimesh:
    return trimesh.Trimesh(item.vertices, item.faces, process=False)


def filled(spec: TableSpec, row: dict[str, Any]) -> dict[str, Any]:
    """A row with null, or a plain value, in every column that it does not name."""
    assert row.keys() <= set(spec.schema.names), (spec.name, row.keys())
    made = {}
    for field in spec.schema:
        kind = field.type
        plain: Any = [] if pa.types.is_list(kind) else "none" if pa.types.is_string(kind) else 0
        plain = False if pa.types.is_boolean(kind) else b"" if pa.types.is_binary(kind) else plain
        made[field.name] = row.get(field.name, None if field.nullable else plain)
    return made


def write_rows(data: Path, table: str, rows: Iterable[dict[str, Any]], scene: str = "U_Test_0") -> None:
    """Write a scene's shard of a table, of rows that name the columns that matter."""
    spec = store.LAYOUT[table].spec
    table_rows = from_rows(spec, [filled(spec, {"scene": scene} | row) for row in rows])
    store.write_shard(data, table, scene, 0, table_rows)


def write_scene(data: Path, place: Scene, table: str = "scenes") -> None:
    """Write a scene's mesh and its row."""
    mesh = data / "meshes" / f"{place.name}.glb"
    mesh.parent.mkdir(parents=True, exist_ok=True)
    write_glb(place, mesh)
    digest = hashlib.sha256(mesh.read_bytes()).hexdigest()
    write_rows(data, table, [scene_row(place, f"meshes/{mesh.name}", digest)], place.name)


def xyz(values: Iterable[float], name: str = "{}_m") -> dict[str, float]:
    """The columns of a position."""
    return {name.format(axis): float(value) for axis, value in zip("xyz", values, strict=True)}


def job_of(stage: str, data: Path, scene: str = "U_Test_0", part: int = 0, parts: int = 1, seed: int = 0) -> Job:
    """A part of a stage's work on a data directory, with the body that ships."""
    return Job(stage, scene, part, parts, seed, Embodiment(), ProjectPaths(data, data, data, data))
