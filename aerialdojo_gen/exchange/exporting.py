"""Export the release to other benchmarks' formats, and the shape of scenes: whole or not at all."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.names import check_known, choose_scenes
from aerialdojo_gen.dataset.contents import scenes_in_release
from aerialdojo_gen.exchange import aerialdojo_writer, habitat_writer, shape_export
from aerialdojo_gen.exchange.folder import MARKER, whole_folder, write_marker
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.scenes.stored import read_scene_mesh
from aerialdojo_gen.store.layout import is_plain
from aerialdojo_gen.store.root import DataRoot, Where, open_root
from aerialdojo_gen.store.schemas import ACTION_NAMES, SUBSETS

# A file takes whole blocks of a disk.
_BLOCK = 4096


@dataclass(frozen=True)
class Format:
    """A format of others: what its module in this folder does."""

    frame: str
    lost: Mapping[str, Sequence[str]]  # Columns that it has no field for, by table
    shared_files: int  # Written once, the marker among them
    # Files and bytes of a scene, by the edge of its pictures in pixels
    scene_size: Callable[[DataRoot, str, int], tuple[int, float]]
    # Writes what scenes share, and returns what writes one; of scenes, folder, edge of pictures, whether as archives
    begin: Callable[[DataRoot, Sequence[str], Path, int, bool], Callable[[str], dict[str, int]]]
    actions: Mapping[int, str] | None = None  # Names of its actions, where its files have none


FORMATS = {
    "aerialdojo": Format(
        "north, east, down, metres; quaternions xyzw; forward +x", aerialdojo_writer.LOST, 1,
        aerialdojo_writer.scene_size, aerialdojo_writer.begin,
    ),
    "habitat": Format(
        "east, up, south, metres; quaternions xyzw; forward -z", habitat_writer.LOST, 1 + len(SUBSETS),
        habitat_writer.scene_size, habitat_writer.begin, dict(enumerate(ACTION_NAMES)),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Size:
    """What an export will be."""

    files: int  # Exact
    bytes: int  # To some tenths
    on_disk: int  # The same in whole blocks

    def __str__(self) -> str:
        megabytes = self.bytes / 1e6
        return f"{self.files:,} files, about {megabytes:,.{0 if megabytes >= 10 else 1}f} MB"


def estimate_size(format_name: str, data: DataRoot, scenes: Sequence[str], picture_px: int) -> Size:
    """Reckon what an export of scenes will be."""
    form = FORMATS[format_name]
    sizes = [(form.shared_files, 0.0), *(form.scene_size(data, scene, picture_px) for scene in scenes)]
    files, size = (sum(column) for column in zip(*sizes, strict=True))
    return Size(int(files), round(size), round(size + files * _BLOCK / 2))


def check_room(target: Path, needed: int) -> None:
    """Refuse what the disk has no room for, before it is begun."""
    folder = next(above for above in (target.absolute(), *target.absolute().parents) if above.exists())
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise StoreError(
            f"{target}: about {needed / 1e6:,.0f} MB are needed, {free / 1e6:,.0f} MB are free: name another disk by "
            "--out, or fewer scenes with --scene"
        )


PICTURE_PX = 640
# So many that file systems, copies and hubs become slow.
_MANY_FILES = 10_000


def export_release(
    format_name: str,
    data: Where,
    out: Path,
    scenes: Sequence[str] | None = None,
    *,
    force: bool = False,
    picture_px: int | None = None,
    shards: bool = False,
    reporter: Reporter | None = None,
) -> dict[str, int]:
    """Write the release in a format of others."""
    check_known("no format", [format_name], FORMATS)
    if picture_px is not None and (format_name != "aerialdojo" or not (picture_px == 0 or 16 <= picture_px <= 4096)):
        raise UsageError("--picture-size is for --format aerialdojo: 16 to 4096 pixels, or 0 for the release's own")
    if shards and format_name != "aerialdojo":
        raise UsageError(f"--shards is for --format aerialdojo: {format_name} has a file a scene as it is")
    root, form, reporter = open_root(data), FORMATS[format_name], reporter or Reporter(quiet=True)
    chosen = scenes_in_release(root, scenes)
    size_px = PICTURE_PX if picture_px is None else picture_px
    with whole_folder(out, MARKER, force=force) as folder:
        size = estimate_size(format_name, root, chosen, size_px)
        many = f"; --shards writes {len(chosen) + 1} files in their place" if size.files > _MANY_FILES else ""
        instead = f", as {len(chosen)} archives" if shards else many
        reporter.line(f"export: {size}{instead}, into {out}")
        check_room(out, size.bytes if shards else size.on_disk)
        counts = _write_scenes(chosen, form.begin(root, chosen, folder, size_px, shards), reporter)
        write_marker(
            folder, format_name, form.frame, scenes=chosen, counts=counts, actions=form.actions, lost=form.lost
        )
    return counts


SHAPES = ("pointcloud", "occupancy")
POINTS_PER_M2, VOXEL_M = 20.0, 0.5
_MIN_VOXEL_M, _LARGEST_VOXEL_M = 0.05, 5.0


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
    check_known("no format", [format_name], SHAPES)
    if not points_per_m2 > 0.0 or not np.isfinite(points_per_m2):
        raise UsageError(f"--points-per-m2 is above 0, not {points_per_m2:g}")
    if not _MIN_VOXEL_M <= voxel_m <= _LARGEST_VOXEL_M:
        raise UsageError(f"--voxel-m is {_MIN_VOXEL_M:g} to {_LARGEST_VOXEL_M:g} metres, not {voxel_m:g}")
    root = open_root(data)
    names = sorted(filter(is_plain, (PurePosixPath(path).stem for path in root.list("meshes", "*.glb"))))
    if not names:
        raise StoreError(
            f"there is no mesh in {root.at('meshes')}: name another folder with --data, or make meshes with "
            f"{command('build-scenes')}"
        )
    chosen = choose_scenes(scenes, names)
    meshes = {name: root.digest(f"meshes/{name}.glb") for name in chosen}
    with whole_folder(out, MARKER, force=force) as folder:

        def write(name: str) -> dict[str, int]:
            scene = read_scene_mesh(root, f"meshes/{name}.glb", meshes[name])
            if format_name == "pointcloud":
                return shape_export.write_points(scene, folder / name, points_per_m2)
            return shape_export.write_occupancy(scene, folder / name, voxel_m)

        counts = _write_scenes(chosen, write, reporter)
        own = {"points_per_m2": points_per_m2} if format_name == "pointcloud" else {"voxel_m": voxel_m}
        frame = "east, north, up, metres"
        write_marker(folder, format_name, frame, **own, scenes=chosen, mesh_sha256=meshes, counts=counts)
    return counts


def _write_scenes(
    scenes: Sequence[str], write: Callable[[str], dict[str, int]], reporter: Reporter | None
) -> dict[str, int]:
    """Write scene after scene; say how much of everything there is."""
    counts: Counter[str] = Counter(scenes=len(scenes))
    with (reporter or Reporter(quiet=True)).bar("export", len(scenes), "scenes") as bar:
        for scene in scenes:
            counts.update(write(scene))
            bar.advance()
    return dict(counts)
