"""LeRobotDataset v3, written: a Parquet file and a video per camera for every part, then the metadata."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerialdojo_gen.exchange.folder import link_or_copy, write_json
from aerialdojo_gen.exchange.samples import ExportOptions, Part, SampleFrames
from aerialdojo_gen.geometry.motion import DISPLACEMENTS, TURN_RAD
from aerialdojo_gen.learning.labels import labels_at
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import STOP, TURN_LEFT, TURN_RIGHT
from aerialdojo_gen.store.tables import read_file, write_file

# Steps have no duration: a frame a step, at the rate of the recordings.
FPS = 15
VERSION = "v3.0"
FILES_A_CHUNK = 1000
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
# Features that are videos: a view's pictures, its depth, and the goal's picture.
VIEW, DEPTH, GOAL = "observation.images.{}", "observation.depth.{}", "observation.images.goal"
STATE = ("x_ahead_m", "y_left_m", "z_up_m", "yaw_rad", "remaining_actions")
ACTION = ("forward_m", "left_m", "up_m", "turn_rad", "stop")
# Features that are no videos: their type, and the names of their numbers where they have several.
_NUMBERS: dict[str, tuple[str, tuple[str, ...] | None]] = {
    "observation.state": ("float32", STATE),
    "action": ("float32", ACTION),
    "discrete_action": ("int64", None),
    "next.done": ("bool", None),
    "timestamp": ("float32", None),
    **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), ("int64", None)),
}


# What each of the 16 actions does in the body's frame, (16, 5) float32: see `ACTION`.
OF_ACTION = np.zeros((TURN_RIGHT + 1, len(ACTION)), np.float32)
OF_ACTION[:, :3] = DISPLACEMENTS[: TURN_RIGHT + 1]
OF_ACTION[TURN_LEFT, 3], OF_ACTION[TURN_RIGHT, 3] = TURN_RAD, -TURN_RAD
OF_ACTION[STOP, 4] = 1.0


def video_kinds(options: ExportOptions) -> dict[str, str]:
    """Return the features that are videos, and of which kind each is: ``rgb`` or ``depth``."""
    s = options.sensors
    pictures = {VIEW.format(view): "rgb" for view in s.views} if s.rgb else {}
    depths = {DEPTH.format(view): "depth" for view in s.views} if s.depth else {}
    return pictures | ({GOAL: "rgb"} if "image" in options.goal else {}) | depths


def features(options: ExportOptions) -> dict[str, dict[str, Any]]:
    """Return the features of frames: their types, shapes, names, and how videos are to be read."""
    return {key: _video(options, kind) for key, kind in video_kinds(options).items()} | {
        name: {"dtype": dtype, "shape": [len(names) if names else 1], "names": names and [*names]}
        for name, (dtype, names) in _NUMBERS.items()
    }


def frame_schema() -> pa.Schema:
    """Return the columns of ``data/``: all features that are no videos."""
    kinds = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}
    return pa.schema(
        (name, pa.list_(kinds[dtype], len(names)) if names else kinds[dtype])
        for name, (dtype, names) in _NUMBERS.items()
    )


def _video(options: ExportOptions, kind: str) -> dict[str, Any]:
    s = options.sensors
    depth, channels = kind == "depth", 1 if kind == "depth" else 3
    info: dict[str, Any] = {
        "video.height": s.height, "video.width": s.width, "video.codec": "hevc" if depth else "h264",
        "video.pix_fmt": "gray12le" if depth else "yuv420p", "video.fps": FPS, "video.channels": channels,
        "video.g": KEY_EVERY,
        # The first is LeRobot's name of today, the second that of 0.4 and 0.5.
        "is_depth_map": depth, "video.is_depth_map": depth, "has_audio": False,
    }  # fmt: skip
    if depth:
        info |= {
            "video.depth_min": DEPTH_MIN_M, "video.depth_max": s.max_depth_m, "video.shift": DEPTH_SHIFT_M,
            "video.use_log": True, "depth_unit": "m",
        }  # fmt: skip
    names = ["height", "width", "channels"]
    return {"dtype": "video", "shape": [s.height, s.width, channels], "names": names, "info": info}


# Frames are read in any order: every second one is a key frame, as in LeRobot's own videos.
KEY_EVERY = 2
QP = 20
DEPTH_CODES = 4096
# Metres, of LeRobot's logarithmic steps: code 0 is 0 m, which is "nothing within range" here.
DEPTH_MIN_M, DEPTH_SHIFT_M = 0.0, 3.5
_LOW = math.log(DEPTH_MIN_M + DEPTH_SHIFT_M)

_OPTIONS = {
    # A constant quantiser, and nothing that is decided by floating-point numbers: their sums depend on the processor.
    "rgb": ("libx264", "yuv420p", {
        "g": str(KEY_EVERY), "bf": "0", "qp": str(QP), "preset": "veryfast", "flags": "+bitexact+cgop",
        "x264-params": "aq-mode=0:mbtree=0:weightp=0:rc-lookahead=0:scenecut=0:cpu-independent=1",
    }),
    # One thread and no pool: the bytes must not depend on the machine's cores.
    "depth": ("libx265", "gray12le", {
        "g": str(KEY_EVERY), "preset": "ultrafast", "flags": "+bitexact+cgop",
        "x265-params": "lossless=1:bframes=0:pools=none:frame-threads=1:no-info=1:log-level=none",
    }),
}  # fmt: skip


@contextmanager
def clip(path: Path, kind: str, width: int, height: int) -> Iterator[Callable[[NDArray[Any]], None]]:
    """Yield what appends a frame to a video, at even intervals; where the block fails the file stays unfinished."""
    codec, pixels, options = _OPTIONS[kind]
    # Without bitexact the muxer writes the library's version into every file.
    with av.open(str(path), "w", format="mp4", options={"fflags": "+bitexact"}) as container:
        stream: Any = container.add_stream(codec, rate=Fraction(FPS), options=options)
        stream.width, stream.height, stream.pix_fmt = width, height, pixels
        stream.codec_context.thread_count = 1

        def write(frame: NDArray[Any]) -> None:
            form = "rgb24" if kind == "rgb" else pixels
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format=form)))

        yield write
        container.mux(stream.encode())


def depth_codes(depth_m: NDArray[np.float32], most_m: float) -> NDArray[np.uint16]:
    """Depth in metres, up to `most_m`, as LeRobot's logarithmic 12-bit codes; the error is at most half a step."""
    span = math.log(most_m + DEPTH_SHIFT_M) - _LOW
    scaled = (np.log(depth_m + np.float32(DEPTH_SHIFT_M)) - np.float32(_LOW)) * np.float32((DEPTH_CODES - 1) / span)
    return np.rint(scaled).clip(0, DEPTH_CODES - 1).astype(np.uint16)


def depths_of_codes_m(most_m: float) -> NDArray[np.float64]:
    """Return the depths that codes stand for, (4096,) float64, metres."""
    steps = np.arange(DEPTH_CODES) * ((math.log(most_m + DEPTH_SHIFT_M) - _LOW) / (DEPTH_CODES - 1))
    return np.clip(np.exp(steps + _LOW) - DEPTH_SHIFT_M, DEPTH_MIN_M, most_m)


QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Stats = dict[str, list[Any]]
Counts = dict[str, NDArray[np.int64]]


def row_stats(values: NDArray[Any]) -> Stats:
    """Statistics of the rows of an (n, d) array: d numbers each, and the count."""
    table = np.asarray(values, np.float64).reshape(len(values), -1)
    stats: Stats = {name: getattr(table, name)(axis=0).tolist() for name in ("min", "max", "mean", "std")}
    levels = np.quantile(table, list(QUANTILES.values()), axis=0)
    return {**stats, "count": [len(table)], **dict(zip(QUANTILES, levels.tolist(), strict=True))}


def count_stats(counts: NDArray[np.int64], values: NDArray[np.float64], frames: int) -> Stats:
    """Statistics of pictures from counts (channels, n) of the values (n,), shaped (channels, 1, 1) as LeRobot's."""
    total = counts.sum(axis=1).astype(np.float64)
    mean = counts @ values / total
    # Of the differences, not of the squares: those of large values cancel.
    deviation = np.sqrt(np.einsum("cv,cv->c", counts, (values[None] - mean[:, None]) ** 2) / total)
    reached = np.cumsum(counts, axis=1)
    least, most = (counts > 0).argmax(axis=1), -1 - (counts[:, ::-1] > 0).argmax(axis=1)
    stats = {"min": values[least], "max": values[most], "mean": mean, "std": deviation}
    for name, level in QUANTILES.items():
        stats[name] = values[(reached >= np.ceil(level * total)[:, None]).argmax(axis=1)]
    shaped: Stats = {name: of.reshape(-1, 1, 1).tolist() for name, of in stats.items()}
    return {**shaped, "count": [frames]}


# Steps of a part: a video of so many is some MB to 200 MB large, as LeRobot's own are.
FRAMES_A_PART = 2048
_FACTS = "part.json"


def frames_a_part(options: ExportOptions) -> int:
    """Return how many steps a part has at least, unless its scene has fewer."""
    del options
    return FRAMES_A_PART


def write_part(root: DataRoot, part: Part, options: ExportOptions, folder: Path) -> None:
    """Write the files of a part: its data, its videos, and ``part.json`` with what is counted of them."""
    sums = _no_counts(options)
    frames: list[dict[str, NDArray[Any]]] = []
    episodes: list[dict[str, Stats]] = []
    with ExitStack() as stack:
        s = options.sensors
        clips = {
            key: stack.enter_context(clip(folder / f"{key}.mp4", kind, s.width, s.height))
            for key, kind in video_kinds(options).items()
        }
        sample_frames = SampleFrames(root, part, options)
        for k in range(len(part.index)):
            frames.append(_columns(part, k))
            counts = _write_videos(sample_frames, k, options, clips)
            episodes.append({name: row_stats(values) for name, values in frames[-1].items()})
            episodes[-1] |= _describe_counts(counts, options, int(part.index.steps[k]))
            for key, count in counts.items():
                sums[key] += count
    columns = {name: list(np.concatenate([of[name] for of in frames])) for name in frame_schema().names}
    write_file(folder / "data.parquet", pa.table(columns, schema=frame_schema()))
    facts = {"stats": episodes, "counts": {key: count.tolist() for key, count in sums.items()}}
    (folder / _FACTS).write_text(json.dumps(facts), encoding="utf-8")


def _no_counts(options: ExportOptions) -> Counts:
    shapes = {"rgb": (3, 256), "depth": (1, DEPTH_CODES)}
    return {key: np.zeros(shapes[kind], np.int64) for key, kind in video_kinds(options).items()}


def _columns(part: Part, k: int) -> dict[str, NDArray[Any]]:
    n = int(part.index.steps[k])
    steps = np.arange(n)
    labels = labels_at(part.index, k, steps)
    return {
        "observation.state": np.column_stack([labels["odometry"], labels["remaining_actions"]]).astype(np.float32),
        "action": OF_ACTION[labels["action"]],
        "discrete_action": labels["action"],
        "next.done": steps == n - 1,
        "timestamp": (steps / FPS).astype(np.float32),
        "frame_index": steps,
        "episode_index": np.full(n, part.first_episode + k),
        "index": part.first_frame + int(part.index.first[k]) + steps,
        "task_index": np.full(n, part.tasks[k]),
    }


def _write_videos(
    sample_frames: SampleFrames, k: int, options: ExportOptions, clips: Mapping[str, Callable[[NDArray[Any]], None]]
) -> Counts:
    """Write what a trajectory sees into the videos, and count its values."""
    s = options.sensors
    counts = _no_counts(options)

    def write(key: str, frames: NDArray[Any], times: int = 1) -> None:
        channels = [frames] if frames.ndim == 3 else np.moveaxis(frames, -1, 0)
        counts[key] += times * np.stack([_counted(one, counts[key].shape[1]) for one in channels])
        for frame in frames:
            for _ in range(times):
                clips[key](frame)

    for _, frames in sample_frames.frames(k):
        for v, view in enumerate(s.views):
            if "rgb" in frames:
                write(VIEW.format(view), frames["rgb"][:, v])
            if "depth_m" in frames:
                write(DEPTH.format(view), depth_codes(frames["depth_m"][:, v], s.max_depth_m))
    if GOAL in clips:
        write(GOAL, sample_frames.goal(k)[None], int(sample_frames.part.index.steps[k]))
    return counts


def _counted(values: NDArray[Any], n: int) -> NDArray[np.int64]:
    # Counts are 32-bit floats here, exact for as few pixels as are held at a time.
    rows = np.ascontiguousarray(values).reshape(-1, values.shape[-1])
    return cv2.calcHist([rows], [0], None, [n], [0, n]).ravel().astype(np.int64)


def _describe_counts(counts: Counts, options: ExportOptions, frames: int) -> dict[str, Stats]:
    values = {"rgb": np.arange(256) / 255.0, "depth": depths_of_codes_m(options.sensors.max_depth_m)}
    kinds = video_kinds(options)
    return {key: count_stats(count, values[kinds[key]], frames) for key, count in counts.items()}


def finish(parts: list[Part], options: ExportOptions, made: list[Path], folder: Path) -> dict[str, int]:
    """Put the files of all parts in their places, and write ``meta/``."""
    keys, sums = list(video_kinds(options)), _no_counts(options)
    tables: list[pa.Table] = []
    for part, source in zip(parts, made, strict=True):
        at = {"chunk_index": part.number // FILES_A_CHUNK, "file_index": part.number % FILES_A_CHUNK}
        link_or_copy(source / "data.parquet", folder / DATA_PATH.format(**at))
        for key in keys:
            link_or_copy(source / f"{key}.mp4", folder / VIDEO_PATH.format(video_key=key, **at))
        facts = json.loads((source / _FACTS).read_text(encoding="utf-8"))
        path = folder / EPISODES_PATH.format(**at)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, _episodes(part, facts["stats"], keys, at))
        for key, count in facts["counts"].items():
            sums[key] += np.array(count, np.int64)
        tables.append(read_file(source / "data.parquet"))
    frames = sum(part.frames for part in parts)
    episodes = sum(len(part.index) for part in parts)
    texts = dict(sorted({int(n): t for part in parts for n, t in zip(part.tasks, part.texts, strict=True)}.items()))
    write_file(folder / "meta" / "tasks.parquet", _tasks(list(texts.values())))
    every = pa.concat_tables(tables)
    stats = {name: row_stats(_values(every[name])) for name in frame_schema().names}
    stats |= _describe_counts(sums, options, frames)
    write_json(folder / "meta" / "stats.json", stats)
    info = {
        "codebase_version": VERSION, "robot_type": "aerialdojo", "total_episodes": episodes, "total_frames": frames,
        "total_tasks": len(texts), "chunks_size": FILES_A_CHUNK, "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200, "fps": FPS, "splits": {"train": f"0:{episodes}"}, "data_path": DATA_PATH,
        "video_path": VIDEO_PATH, "features": features(options),
    }  # fmt: skip
    write_json(folder / "meta" / "info.json", info)
    return {"episodes": episodes, "frames": frames, "tasks": len(texts), "videos": len(parts) * len(keys)}


def _values(column: pa.ChunkedArray) -> NDArray[Any]:
    joined = column.combine_chunks()
    if pa.types.is_fixed_size_list(joined.type):
        return np.asarray(joined.flatten()).reshape(-1, joined.type.list_size)
    return np.asarray(joined)


def _episodes(part: Part, stats: list[dict[str, Stats]], keys: list[str], at: dict[str, int]) -> pa.Table:
    index, n = part.index, len(part.index)
    begin, end = index.first[:-1], index.first[1:]
    columns: dict[str, Any] = {
        "episode_index": part.first_episode + np.arange(n),
        "tasks": pa.array([[text] for text in part.texts], pa.list_(pa.string())),
        "length": index.steps,
        "dataset_from_index": part.first_frame + begin,
        "dataset_to_index": part.first_frame + end,
    }
    for prefix in ("data", "meta/episodes", *(f"videos/{key}" for key in keys)):
        columns |= {f"{prefix}/{name}": np.full(n, value) for name, value in at.items()}
    for key in keys:
        columns[f"videos/{key}/from_timestamp"] = begin / FPS
        columns[f"videos/{key}/to_timestamp"] = end / FPS
    columns |= {"nav_id": index.nav_id, "scene": [part.scene] * n, "split": part.splits, "setting": part.settings}
    for name in ("target_name", "landmark", "direction", "reference_image_id"):
        columns[name] = pa.array(index.goal_columns[name], pa.string())
    columns["image_distance_m"] = pa.array(index.goal_columns["image_distance_m"], pa.float64())
    for key in stats[0]:
        for name in stats[0][key]:
            columns[f"stats/{key}/{name}"] = [found[key][name] for found in stats]
    return pa.table(columns)


def _tasks(texts: list[str]) -> pa.Table:
    """Return the table of tasks, whose text pandas takes for the index, as LeRobot looks them up."""
    numbers = {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64"}
    words = {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object"}
    layout = {
        "index_columns": ["task"], "column_indexes": [], "pandas_version": "2.2.0",
        "columns": [{**column, "metadata": None} for column in (numbers, words)],
        "creator": {"library": "pyarrow", "version": pa.__version__},
    }  # fmt: skip
    table = pa.table({"task_index": pa.array(range(len(texts)), pa.int64()), "task": pa.array(texts, pa.string())})
    return table.replace_schema_metadata({"pandas": json.dumps(layout)})
