"""Export the release to other benchmarks' formats, and the shape of scenes: whole or not at all."""

from __future__ import annotations

import contextlib
import shutil
import tarfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
import pyarrow.compute as pc

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError, UsageError
from aerialdojo_gen.base.names import check_known, choose_scenes
from aerialdojo_gen.dataset.contents import scenes_in_release
from aerialdojo_gen.exchange import aerialdojo_layout, aerialdojo_writer, habitat_writer, shape_export
from aerialdojo_gen.exchange.folder import MARKER, whole_folder, write_marker
from aerialdojo_gen.pipeline.progress import Reporter
from aerialdojo_gen.scenes.stored import read_scene_mesh
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.layout import is_plain
from aerialdojo_gen.store.root import DataRoot, Where, open_root
from aerialdojo_gen.store.schemas import ACTION_NAMES, SETTINGS, SUBSETS

# Bytes of a picture grow with this power of its edge.
_GROWTH, _OWN_PX = 0.8, 320
# A file takes whole blocks of a disk.
_BLOCK = 4096


@dataclass(frozen=True)
class Format:
    """A format of others."""

    frame: str
    lost: Mapping[str, Sequence[str]]  # Columns that it has no field for, by table
    pose_bytes: float  # Of its text, measured on the paper's scenes
    task_bytes: float


FORMATS = {
    "aerialdojo": Format(
        "north, east, down, metres; quaternions xyzw; forward +x", aerialdojo_writer.LOST, 178.0, 2009.0
    ),
    "habitat": Format("east, up, south, metres; quaternions xyzw; forward -z", habitat_writer.LOST, 21.5, 0.0),
}


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
    form, habitat, size = FORMATS[format_name], format_name == "habitat", 0.0
    files = 1 + len(SUBSETS) if habitat else 1
    for scene in scenes:
        for subset in ("train", "test"):
            routes = store.read_scene(data, f"routes/{subset}", scene, ("nav_id", "n_actions"))
            # A pose before every action, and the last one.
            poses = (pc.sum(routes["n_actions"]).as_py() or 0) + routes.num_rows
            size += poses * form.pose_bytes + routes.num_rows * form.task_bytes
            if habitat:
                files += bool(routes.num_rows)
                continue
            tasks = store.read_scene(data, f"tasks/{subset}", scene, ("setting", "reference_image_id"))
            shown = tasks.filter(pc.is_valid(tasks["reference_image_id"]))
            pictures = shown.group_by(["setting", "reference_image_id"]).aggregate([]).num_rows
            files += routes.num_rows + len(aerialdojo_layout.KINDS) * len(SETTINGS) + pictures
        if not habitat:
            # Each picture once: those of several settings are links.
            objects = store.read_scene(data, "release/objects", scene, ("reference_image",))
            stored = pc.sum(pc.binary_length(objects["reference_image"])).as_py() or 0
            size += stored * ((picture_px / _OWN_PX) ** _GROWTH if picture_px else 1.0)
    return Size(files, round(size), round(size + files * _BLOCK / 2))


def check_room(target: Path, needed: int) -> None:
    """Refuse what the disk has no room for, before it is begun."""
    folder = next(above for above in (target.absolute(), *target.absolute().parents) if above.exists())
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise StoreError(
            f"{target}: about {needed / 1e6:,.0f} MB are needed, {free / 1e6:,.0f} MB are free: name another disk by "
            "--out, or fewer scenes with --scene"
        )


def pack_tar(folder: Path, archive: Path) -> None:
    """Move a folder's files into a tar archive that depends on names and contents alone; the folder goes."""
    with tarfile.open(archive, "w", format=tarfile.PAX_FORMAT) as tar:
        for path in sorted(folder.rglob("*")):
            entry = tar.gettarinfo(path, path.relative_to(folder).as_posix())
            entry.uid = entry.gid = entry.mtime = 0
            entry.uname = entry.gname = ""
            entry.mode = 0o755 if entry.isdir() else 0o644
            with path.open("rb") if entry.isreg() else contextlib.nullcontext() as file:
                tar.addfile(entry, file)
    shutil.rmtree(folder)


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
        write_scene = _writer_of_scenes(format_name, root, chosen, folder, size_px, shards)
        counts = _write_scenes(chosen, write_scene, reporter)
        actions = dict(enumerate(ACTION_NAMES)) if format_name == "habitat" else None
        write_marker(folder, format_name, form.frame, scenes=chosen, counts=counts, actions=actions, lost=form.lost)
    return counts


def _writer_of_scenes(
    format_name: str, root: DataRoot, scenes: Sequence[str], folder: Path, size_px: int, shards: bool
) -> Callable[[str], dict[str, int]]:
    """Return what writes a scene into the folder; Habitat's index, which all scenes share, is written at once."""
    if format_name == "habitat":
        categories = habitat_writer.categories_of(root, scenes)
        habitat_writer.write_index(folder, categories)
        return lambda scene: habitat_writer.write_scene(root, scene, folder, categories)

    def write(scene: str) -> dict[str, int]:
        if not shards:
            return aerialdojo_writer.write_scene(root, scene, folder, size_px)
        counts = aerialdojo_writer.write_scene(root, scene, folder / scene, size_px)
        pack_tar(folder / scene, folder / f"{scene}.tar")
        return counts

    return write


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
