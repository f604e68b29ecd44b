"""Stage ``build-scenes``: a recipe becomes a GLB file and a row of the `scenes` table."""

from __future__ import annotations

import hashlib
import re

import pyarrow as pa

from aerialdojo_gen.base.config.sections import BuildScenesConfig
from aerialdojo_gen.pipeline.stage import Job, Output
from aerialdojo_gen.scenes.build import build_scene
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.context import cache_scene
from aerialdojo_gen.scenes.glb import write_glb
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.store.layout import check_scene_name
from aerialdojo_gen.store.layout import partition as store_partition
from aerialdojo_gen.store.schemas import FAMILIES, SCENES

_NAME = re.compile(r"([UNID])_([A-Za-z0-9]+)(?:_[01]|-h?\d+)")


def run(job: Job, config: BuildScenesConfig) -> Output:
    """Build one scene (paper, section on scene preparation)."""
    plan = job.roots.recipes / f"{job.scene}.toml"
    scene = job.built or build_scene(plan, load_catalogue(job.roots.scene_assets))
    relative = f"meshes/{job.scene}.glb"
    with job.output_file(relative) as path:
        write_glb(scene, path)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if not scene.imported:
        # The next stage mostly follows in this process.
        cache_scene(scene, digest)
    table = pa.Table.from_pylist([scene_row(scene, relative, digest)], schema=SCENES.schema)
    return Output(tables={"scenes": table}, rows_in=1, rows_out=1, counts={"triangles": scene.n_triangles})


def scene_row(scene: Scene, mesh_path: str, mesh_sha256: str) -> dict[str, object]:
    """Make a scene's row of the `scenes` table."""
    family, scene_type, partition = parse_name(scene.name)
    bounds = {
        f"{e}_{a}_m": float(scene.bounds[i, k]) for i, e in enumerate(("min", "max")) for k, a in enumerate("xyz")
    }
    return {
        "scene": scene.name,
        "family": family,
        "scene_type": scene_type,
        "partition": partition,
        "mesh_path": mesh_path,
        "mesh_sha256": mesh_sha256,
        **bounds,
        "ceiling_m": scene.ceiling_m,
        "n_triangles": scene.n_triangles,
        "n_instances": len(scene.instances),
        "n_categories": len({i.category for i in scene.instances}),
        "attribution": scene.attribution or None,
    }


def parse_name(scene: str) -> tuple[str, str, str]:
    """Split a scene's name into family, type and partition.

    ``U_Mall_0`` and the world ``U_Mall-1000`` are ``("Urban", "Mall", "ID")``; a name of another form is of the
    family Custom, and in the ID partition unless it ends in ``_1``.
    """
    match, side = _NAME.fullmatch(scene), store_partition(scene).upper()
    if match is None:
        return "Custom", re.sub(r"_[01]$", "", check_scene_name(scene)), side
    return FAMILIES[match[1]], match[2], side
