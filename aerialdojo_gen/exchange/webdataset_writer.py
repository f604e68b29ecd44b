"""WebDataset shards, written: a tar file a part, and in it pictures and JSON of every step."""

from __future__ import annotations

import io
import json
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.errors import StoreError, brief
from aerialdojo_gen.base.pictures import FRAME_PNG, encode_jpeg, encode_png
from aerialdojo_gen.exchange.folder import link_or_copy, write_json
from aerialdojo_gen.exchange.samples import ExportOptions, Part, SampleFrames
from aerialdojo_gen.learning.labels import labels_at
from aerialdojo_gen.rendering.codecs import to_stored
from aerialdojo_gen.store.layout import is_plain
from aerialdojo_gen.store.root import DataRoot

SHARD = "shard-{:06d}.tar"
# Pixels of a shard, some hundred megabytes; and steps at most.
_PIXELS, _STEPS = 1 << 27, 4096
_FILE = "shard.tar"


def frames_a_part(options: ExportOptions) -> int:
    """Return how many steps a shard has at least, unless its scene has fewer."""
    s = options.sensors
    return min(_STEPS, max(64, _PIXELS // (len(s.views) * s.width * s.height)))


def write_part(root: DataRoot, part: Part, options: ExportOptions, folder: Path) -> None:
    """Write the shard of a part."""
    sample_frames = SampleFrames(root, part, options)
    kind = "jpg" if options.jpeg_quality else "png"
    # The oldest form of the three has neither times of a finer kind nor names of users: the same bytes everywhere.
    with tarfile.open(folder / _FILE, "w", format=tarfile.USTAR_FORMAT) as tar:
        for k in range(len(part.index)):
            # A release of somebody else's may call a route what points outside the folder that a tar is unpacked in.
            if not is_plain(name := str(part.index.nav_id[k])):
                raise StoreError(
                    f"routes of {part.scene} in {root}: nav_id {brief(repr(name), 60)} cannot name a file"
                )
            rows = _to_json(part, k, options)
            goal = _picture(sample_frames.goal(k), options) if "image" in options.goal else None
            for begin, frames in sample_frames.frames(k):
                for i in range(len(next(iter(frames.values())))):
                    step = rows[begin + i]
                    key = f"{step['nav_id']}-{step['step']:04d}"
                    images = {
                        name: dict(zip(options.sensors.views, of[i], strict=True)) for name, of in frames.items()
                    }
                    for view, rgb in images.get("rgb", {}).items():
                        _add(tar, f"{key}.{view}.{kind}", _picture(rgb, options))
                    if "depth_m" in images:
                        file = io.BytesIO()
                        stored = {view: to_stored(depth_m) for view, depth_m in images["depth_m"].items()}
                        np.savez_compressed(file, **stored)  # type: ignore[arg-type]
                        _add(tar, f"{key}.depth.npz", file.getvalue())
                    if goal is not None:
                        _add(tar, f"{key}.goal.{kind}", goal)
                    _add(tar, f"{key}.json", json.dumps(step, ensure_ascii=False).encode())


def _to_json(part: Part, k: int, options: ExportOptions) -> list[dict[str, Any]]:
    """Return the JSON of every step of a trajectory."""
    index = part.index
    n = int(index.steps[k])
    labels = labels_at(index, k, np.arange(n))
    whole: dict[str, Any] = {
        "nav_id": index.nav_id[k], "scene": part.scene, "split": part.splits[k], "setting": part.settings[k],
        "n_steps": n, "task": part.texts[k],
    }  # fmt: skip
    hints = ["target_name", "landmark", "direction", "description"] if "text" in options.goal else []
    hints += ["reference_image_id", "image_distance_m"] if "image" in options.goal else []
    whole |= {name: index.goal_columns[name][k] for name in hints}
    rows = zip(*(values.tolist() for values in labels.values()), strict=True)
    return [{**whole, "step": step, **dict(zip(labels, row, strict=True))} for step, row in enumerate(rows)]


def _picture(rgb: NDArray[np.uint8], options: ExportOptions) -> bytes:
    return encode_jpeg(rgb, options.jpeg_quality) if options.jpeg_quality else encode_png(rgb, FRAME_PNG)


def _add(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    member = tarfile.TarInfo(name)
    member.size, member.mode = len(content), 0o644
    tar.addfile(member, io.BytesIO(content))


def finish(parts: list[Part], options: ExportOptions, made: list[Path], folder: Path) -> dict[str, int]:
    """Put the shards in their places, and list them; see `aerialdojo_gen.exchange.lerobot_writer.finish`."""
    del options
    shards = []
    for part, source in zip(parts, made, strict=True):
        name = SHARD.format(part.number)
        link_or_copy(source / _FILE, folder / name)
        shards.append({"url": name, "nsamples": part.frames, "filesize": (source / _FILE).stat().st_size})
    # The list that WebDataset's own reader of indexed shards takes.
    write_json(folder / "index.json", {"__kind__": "wids-shard-index-v1", "wids_version": 1, "shardlist": shards})
    trajectories, samples = sum(len(part.index) for part in parts), sum(part.frames for part in parts)
    return {"trajectories": trajectories, "samples": samples, "shards": len(parts)}
