"""How much an export will be, from the release's tables, before anything is written."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow.compute as pc

from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import SETTINGS, SUBSETS

# Measured on the paper's scenes: bytes of text a pose and a task, by format; bytes of a picture grow with this power
# of its edge.
_POSE, _TASK = {"aerialdojo": 178.0, "habitat": 21.5}, {"aerialdojo": 2009.0, "habitat": 0.0}
_GROWTH, _OWN_PX = 0.8, 320
_KINDS = 2
# A file takes whole blocks of a disk.
_BLOCK = 4096


@dataclass(frozen=True)
class Size:
    """What an export will be."""

    files: int  # Exact
    bytes: int  # To some tenths
    on_disk: int  # The same in whole blocks

    def __str__(self) -> str:
        """In words."""
        megabytes = self.bytes / 1e6
        return (
            f"{self.files:,} files, about {megabytes:,.0f} MB"
            if megabytes >= 10
            else (f"{self.files:,} files, about {megabytes:.1f} MB")
        )


def size_of(format_name: str, data: DataRoot, scenes: Sequence[str], picture_px: int) -> Size:
    """Reckon what an export of scenes will be."""
    files, size = 1, 0.0
    for scene in scenes:
        for subset in ("train", "test"):
            routes = store.read_scene(data, f"routes/{subset}", scene, ("nav_id", "n_actions"))
            # A pose before every action, and the last one.
            poses = (pc.sum(routes["n_actions"]).as_py() or 0) + routes.num_rows
            size += poses * _POSE[format_name] + routes.num_rows * _TASK[format_name]
            if format_name == "habitat":
                files += bool(routes.num_rows)
            else:
                tasks = store.read_scene(data, f"tasks/{subset}", scene, ("setting", "reference_image_id"))
                shown = tasks.filter(pc.is_valid(tasks["reference_image_id"]))
                pictures = shown.group_by(["setting", "reference_image_id"]).aggregate([]).num_rows
                files += routes.num_rows + _KINDS * len(SETTINGS) + pictures
        if format_name == "aerialdojo":
            size += _pictures(data, scene, picture_px)
    if format_name == "habitat":
        files += len(SUBSETS)
    return Size(files, round(size), round(size + files * _BLOCK / 2))


def _pictures(data: DataRoot, scene: str, picture_px: int) -> float:
    """Bytes of a scene's pictures, each once: those of several settings are links."""
    objects = store.read_scene(data, "release/objects", scene, ("reference_image",))
    stored = sum(len(picture) for picture in objects["reference_image"].to_pylist() if picture)
    return float(stored * ((picture_px / _OWN_PX) ** _GROWTH if picture_px else 1.0))


def check_room(target: Path, needed: int) -> None:
    """Refuse what the disk has no room for, before it is begun."""
    folder = next(above for above in (target.absolute(), *target.absolute().parents) if above.exists())
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise StoreError(
            f"{target}: about {needed / 1e6:,.0f} MB are needed, {free / 1e6:,.0f} MB are free: name another disk by "
            "--out, or fewer scenes with --scene"
        )
