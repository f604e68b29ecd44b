"""Export the shape of scenes, from their meshes alone: point clouds and occupancy grids, a file a scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import numpy as np

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.names import choose_scenes, unknown
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.exchange.folder import whole_folder, write_json
from aerialdojo_gen.exchange.point_cloud import ply_bytes, sample_surface
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.planning.occupancy import Occupancy
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.stored import read_scene_mesh
from aerialdojo_gen.store.layout import is_plain
from aerialdojo_gen.store.root import DataRoot, Where, open_root

MARKER = "export.json"
SHAPES = ("pointcloud", "occupancy")
POINTS_PER_M2, VOXEL_M = 20.0, 0.5
_LEAST_VOXEL_M, _LARGEST_VOXEL_M = 0.05, 5.0
# A cell takes up to some 25 bytes while they are computed.
_MOST_CELLS = 100_000_000


def export_shapes(
    format_name: str,
    data: Where,
    out: Path,
    scenes: Sequence[str] | None = None,
    *,
    points_per_m2: float = POINTS_PER_M2,
    voxel_m: float = VOXEL_M,
    force: bool = False,
    reporter: Reporter | None = None,
) -> dict[str, int]:
    """Write a point cloud or an occupancy grid of each scene with a mesh; no release is needed."""
    if format_name not in SHAPES:
        raise UsageError(unknown("no format", format_name, SHAPES))
    if not points_per_m2 > 0.0 or not np.isfinite(points_per_m2):
        raise UsageError(f"--points-per-m2 is above 0, not {points_per_m2:g}")
    if not _LEAST_VOXEL_M <= voxel_m <= _LARGEST_VOXEL_M:
        raise UsageError(f"--voxel-m is {_LEAST_VOXEL_M:g} to {_LARGEST_VOXEL_M:g} metres, not {voxel_m:g}")
    root = open_root(data)
    chosen = choose_scenes(scenes, _scenes_with_mesh(root))
    counts: Counter[str] = Counter(scenes=len(chosen))
    reporter = reporter or Reporter(quiet=True)
    with (
        whole_folder(out, MARKER, force=force) as folder,
        reporter.bar("export", len(chosen), "scenes") as bar,
    ):
        meshes = {}
        for name in chosen:
            mesh = f"meshes/{name}.glb"
            meshes[name] = root.digest(mesh)
            scene = read_scene_mesh(root, mesh, meshes[name])
            if format_name == "pointcloud":
                found = _write_points(scene, folder / name, points_per_m2)
            else:
                found = _write_occupancy(scene, folder / name, voxel_m)
            counts.update(found)
            bar.advance()
        own = {"points_per_m2": points_per_m2} if format_name == "pointcloud" else {"voxel_m": voxel_m}
        write_json(
            folder / MARKER,
            {
                "format": format_name,
                "written_by": f"aerialdojo-gen {__version__}",
                "frame": "east, north, up, metres",
                **own,
                "scenes": list(chosen),
                "mesh_sha256": meshes,
                "counts": counts,
            },
        )
    return dict(counts)


def _scenes_with_mesh(root: DataRoot) -> list[str]:
    names = sorted(filter(is_plain, (PurePosixPath(path).stem for path in root.list("meshes", "*.glb"))))
    if not names:
        raise StoreError(
            f"there is no mesh in {root.at('meshes')}: name another folder with --data, or make meshes with "
            f"{command('build-scenes')}"
        )
    return names


def _write_points(scene: Scene, stem: Path, points_per_m2: float) -> dict[str, int]:
    points = sample_surface(scene, points_per_m2)
    stem.with_name(f"{stem.name}.ply").write_bytes(
        ply_bytes(points, f"{scene.name}: x east, y north, z up, metres; instance k is node k - 1 of the mesh")
    )
    write_json(stem.with_name(f"{stem.name}.nodes.json"), {"nodes": [one.node for one in scene.instances]})
    return {"points": len(points)}


def _write_occupancy(scene: Scene, stem: Path, voxel_m: float) -> dict[str, int]:
    cells = int(np.prod(np.ceil((scene.bounds[1] - scene.bounds[0]) / voxel_m)))
    if cells > _MOST_CELLS:
        raise UsageError(f"{scene.name}: {cells:,} voxels are more than {_MOST_CELLS:,}: choose a larger --voxel-m")
    grid = Occupancy.of(scene, voxel_m)
    np.savez_compressed(
        stem.with_name(f"{stem.name}.npz"),
        occupied=grid.occupied,
        reachable=grid.reachable,
        origin_m=grid.origin_m,
        voxel_m=np.float64(grid.voxel_m),
    )
    return {"voxels": grid.occupied.size, "occupied": int(grid.occupied.sum())}
