"""The release as a data set for training in others' formats: LeRobotDataset v3, WebDataset."""

from __future__ import annotations

import dataclasses
import json
import shutil
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import AerialDojoError, UsageError
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.benchmark.tasks import mesh_of
from aerialdojo_gen.dataset.contents import part_name
from aerialdojo_gen.exchange import lerobot_writer, webdataset_writer
from aerialdojo_gen.exchange.folder import MARKER, PartialExport, check_target, whole_folder, write_marker
from aerialdojo_gen.exchange.samples import ExportOptions, Part, plan_parts
from aerialdojo_gen.pipeline.code_digest import code_of
from aerialdojo_gen.pipeline.executors.base import make_executor
from aerialdojo_gen.pipeline.progress import Reporter, duration
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.atomic import atomic_folder
from aerialdojo_gen.store.files import size_of
from aerialdojo_gen.store.root import DataRoot, Where, open_root
from aerialdojo_gen.store.schemas import ACTION_NAMES
from aerialdojo_gen.store.staging import scratch_folder

WRITERS: dict[str, ModuleType] = {"lerobot": lerobot_writer, "webdataset": webdataset_writer}
FRAME = "of the body at the start: x ahead, y left, z up, metres; yaw in radians, counter-clockwise"
LOST = {"routes": ["goal_x_m", "goal_y_m", "goal_z_m", "goal_yaw_rad", "the world's frame of all poses"]}
_MEASURED_PARTS, _MEASURED_STEPS = 6, 24


@dataclass(frozen=True)
class ExportResult:
    """What an export consists of."""

    counts: dict[str, int]  # What there is of everything, by its name
    parts: int  # How many parts it was made of, and how many of them an earlier run had finished
    parts_kept: int


@dataclass(frozen=True)
class Estimate:
    """What an export will take."""

    trajectories: int  # Of the selection; a frame is a step, seen in every view
    frames: int
    parts: int
    cpu_s: float  # Seconds of one core, and on `workers` idle ones
    wall_s: float
    size_bytes: float  # Of the whole export
    workers: int
    measured: int  # Frames that were drawn and encoded to find out

    def __str__(self) -> str:
        size = f"{self.size_bytes / 1e9:.1f} GB" if self.size_bytes >= 1e9 else f"{self.size_bytes / 1e6:.0f} MB"
        each = 1e3 * self.cpu_s / self.frames
        return (
            f"{self.trajectories:,} trajectories, {self.frames:,} frames (measured on {self.measured}: {each:.1f} ms "
            f"CPU, {self.size_bytes / self.frames / 1e3:.1f} kB a frame)\nabout {duration(self.wall_s)} with "
            f"{self.workers} worker{'s' * (self.workers != 1)} on idle cores, {size} on disk"
        )


def export_for_learning(
    format_name: str,
    data: Where,
    out: Path,
    options: ExportOptions,
    *,
    force: bool = False,
    workers: int | None = None,
    reporter: Reporter | None = None,
) -> ExportResult:
    """Write trajectories with what the body sees on them, as a data set for training."""
    writer, root, progress = _writer(format_name, options), open_root(data), reporter or Reporter(quiet=True)
    check_target(out, MARKER, force=force)
    parts = plan_parts(root, options, writer.frames_a_part(options))
    unfinished = PartialExport(out, _request(format_name, root, options, parts))
    with unfinished.locked():
        left = [part for part in parts if not unfinished.part(part.number).is_dir()]
        if unfinished.resumed:
            progress.line(f"going on: {len(parts) - len(left)} of {len(parts)} parts are finished")
        write = partial(_write, format_name, root.url, options, unfinished)
        with progress.bar("export", len(left), "parts") as bar, make_executor("local", workers) as pool:
            for outcome in pool.map(write, left, lambda part: part.scene):
                if isinstance(outcome, AerialDojoError):
                    raise outcome
                bar.advance(frames=outcome)
        with whole_folder(out, MARKER, force=force) as folder:
            scenes, made = sorted({part.scene for part in parts}), [unfinished.part(part.number) for part in parts]
            counts = {"scenes": len(scenes)} | writer.finish(parts, options, made, folder)
            write_marker(
                folder, format_name, FRAME, scenes=scenes, counts=counts, wanted=_requested(options),
                actions=dict(enumerate(ACTION_NAMES[:16])), lost=LOST,
            )  # fmt: skip
        shutil.rmtree(unfinished.folder, ignore_errors=True)
    return ExportResult(counts, len(parts), len(parts) - len(left))


def estimate_for_learning(
    format_name: str, data: Where, options: ExportOptions, workers: int | None = None
) -> Estimate:  # fmt: skip
    """Measure a few trajectories and say what all of them will take; nothing is written."""
    writer, root = _writer(format_name, options), open_root(data)
    parts = plan_parts(root, options, writer.frames_a_part(options))
    drawn = sorted(parts, key=lambda part: rng.rank(options.seed, "estimate", part.scene))[:_MEASURED_PARTS]
    measured = size = 0
    seconds = opening = 0.0
    for part in drawn:
        # The first picture of a scene opens it.
        opening += _measure(writer, root, part.cut(1, 1), options)[0]
        sample = part.cut(2, _MEASURED_STEPS)
        spent, written = _measure(writer, root, sample, options)
        seconds, measured, size = seconds + spent, measured + sample.frames, size + written
    frames = sum(part.frames for part in parts)
    count = workers or make_executor("local").workers
    scenes = len({part.scene for part in parts})
    cpu_s = frames * seconds / measured + scenes * opening / len(drawn)
    return Estimate(
        sum(len(part.index) for part in parts), frames, len(parts), cpu_s, cpu_s / min(count, len(parts)),
        frames * size / measured, count, measured,
    )  # fmt: skip


def _measure(writer: ModuleType, root: DataRoot, sample: Part, options: ExportOptions) -> tuple[float, int]:
    """Seconds of CPU that a part takes, and its bytes."""
    with scratch_folder() as folder:
        begun = time.process_time()
        writer.write_part(root, sample, options, folder)
        return time.process_time() - begun, sum(size_of(path) for path in folder.iterdir())


def _writer(format_name: str, options: ExportOptions) -> ModuleType:
    s = options.sensors
    if format_name == "lerobot" and (s.width % 2 or s.height % 2):
        raise UsageError(f"a video has even --width and --height, not {s.width} x {s.height}")
    if format_name == "lerobot" and options.jpeg_quality:
        raise UsageError("--jpeg-quality is for --format webdataset: LeRobot's pictures are videos")
    return WRITERS[format_name]


def _write(format_name: str, data: str, options: ExportOptions, unfinished: PartialExport, part: Part) -> int:
    with atomic_folder(unfinished.part(part.number), unfinished.folder) as folder:
        WRITERS[format_name].write_part(open_root(data), part, options, folder)
    return part.frames


def _request(format_name: str, root: DataRoot, options: ExportOptions, parts: list[Part]) -> dict[str, Any]:
    """Collect what decides every byte: parts of another request are not reused."""
    scenes = sorted({part.scene for part in parts})
    read, shown = options.source != "render", "image" in options.goal
    return {
        "format": format_name,
        "version": __version__,
        "code": code_of(f"aerialdojo_gen.exchange.{format_name}_writer").digest,
        "wanted": _requested(options),
        "trajectories": [part.index.digest for part in parts],
        "meshes": {} if options.source == "recordings" else {name: mesh_of(root, name)[1] for name in scenes},
        "goals": {name: root.digest(part_name("release/objects", name)) for name in scenes} if shown else {},
        "recordings": {name: _recordings(root, name) for name in scenes} if read else {},
    }


def _requested(options: ExportOptions) -> Any:
    return json.loads(json.dumps(dataclasses.asdict(options)))


def _recordings(root: DataRoot, scene: str) -> list[str]:
    if not root.list("recordings", f"{scene}/*.parquet"):
        return []
    return sorted(store.read_stored(root, "recordings", scene, ("sha256",))["sha256"].to_pylist())
