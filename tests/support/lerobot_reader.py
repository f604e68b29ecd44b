"""LeRobotDataset v3 read strictly, as its documentation and its own reader have it: what is not as said there fails.

Written from LeRobot 0.6.1 (`lerobot.datasets`), with nothing of it, which wants other versions of many packages.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
import pandas as pd
import pyarrow.parquet as pq

INFO = {
    "codebase_version", "robot_type", "total_episodes", "total_frames", "total_tasks", "chunks_size",
    "data_files_size_in_mb", "video_files_size_in_mb", "fps", "splits", "data_path", "video_path", "features",
}  # fmt: skip
OWN = {"timestamp": "float32"} | dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), "int64")
STATS = {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}
QMAX = 4095


@dataclass
class LeRobot:
    """A dataset, all of it in memory."""

    info: dict[str, Any]
    tasks: list[str]
    episodes: pd.DataFrame
    frames: pd.DataFrame
    stats: dict[str, dict[str, np.ndarray]]
    folder: Path

    def columns(self, key: str) -> np.ndarray:
        """A feature of all frames."""
        return np.stack(self.frames[key].to_list())

    def video(self, key: str, episode: int) -> np.ndarray:
        """What a camera sees in an episode: (n, H, W, 3) uint8, or (n, H, W) metres of depth."""
        row, fps = self.episodes.loc[episode], self.info["fps"]
        at = {"chunk_index": row[f"videos/{key}/chunk_index"], "file_index": row[f"videos/{key}/file_index"]}
        path = self.folder / self.info["video_path"].format(video_key=key, **at)
        wanted = [row[f"videos/{key}/from_timestamp"] + k / fps for k in range(row["length"])]
        assert row[f"videos/{key}/to_timestamp"] == wanted[-1] + 1 / fps or math.isclose(
            row[f"videos/{key}/to_timestamp"], wanted[-1] + 1 / fps
        )
        told = self.info["features"][key]["info"]
        depth = told["is_depth_map"]
        found = {}
        with av.open(str(path)) as container:
            stream = container.streams.video[0]
            assert (stream.width, stream.height) == (told["video.width"], told["video.height"])
            assert (stream.codec_context.name, stream.pix_fmt) == (told["video.codec"], told["video.pix_fmt"])
            assert stream.average_rate == told["video.fps"] == fps
            for frame in container.decode(stream):
                found[float(frame.pts * stream.time_base)] = frame.to_ndarray(format="gray12le" if depth else "rgb24")
        times = np.array(sorted(found))
        nearest = [times[np.abs(times - t).argmin()] for t in wanted]
        assert np.abs(np.array(nearest) - wanted).max() < 1e-4, "LeRobot's tolerance of timestamps"
        pictures = np.stack([found[t] for t in nearest])
        return _metres(pictures, told) if depth else pictures


def _metres(codes: np.ndarray, told: dict[str, Any]) -> np.ndarray:
    low, high, shift = told["video.depth_min"], told["video.depth_max"], told["video.shift"]
    assert told["video.use_log"]
    assert codes.max() <= QMAX
    span = math.log(high + shift) - math.log(low + shift)
    return np.clip(np.exp(codes / QMAX * span + math.log(low + shift)) - shift, low, high)


def load(folder: Path) -> LeRobot:
    """Read a dataset and check that its parts agree."""
    info = json.loads((folder / "meta" / "info.json").read_text())
    assert set(info) == INFO
    assert info["codebase_version"] == "v3.0"
    tasks = pd.read_parquet(folder / "meta" / "tasks.parquet")
    assert tasks.index.name == "task"
    assert tasks["task_index"].to_list() == list(range(info["total_tasks"]))
    assert tasks.index.is_unique
    episodes = _read(folder / "meta" / "episodes", info).set_index("episode_index", drop=False)
    assert episodes.index.to_list() == list(range(info["total_episodes"]))
    frames = _read(folder / "data", info)
    assert len(frames) == info["total_frames"] == episodes["length"].sum()
    features = {name: feature for name, feature in info["features"].items() if feature["dtype"] != "video"}
    assert set(frames.columns) == set(features)
    assert {name: features[name]["dtype"] for name in OWN} == OWN
    for name, feature in features.items():
        _check_column(frames[name].to_numpy(), feature)
    assert frames["index"].to_list() == list(range(len(frames)))
    for number, row in episodes.iterrows():
        own = frames.iloc[row["dataset_from_index"] : row["dataset_to_index"]]
        assert len(own) == row["length"]
        assert set(own["episode_index"]) == {number}
        assert own["frame_index"].to_list() == list(range(len(own)))
        assert np.abs(own["timestamp"] - own["frame_index"] / info["fps"]).max() < 1e-6
        assert list(row["tasks"]) == [tasks.index[k] for k in own["task_index"].unique()]
    stats = json.loads((folder / "meta" / "stats.json").read_text())
    assert set(stats) == set(info["features"])
    found = {key: {name: np.array(value) for name, value in of.items()} for key, of in stats.items()}
    for key, of in found.items():
        assert set(of) == STATS
        feature = info["features"][key]
        shape = (feature["shape"][2], 1, 1) if feature["dtype"] == "video" else tuple(feature["shape"])
        assert all(value.shape == shape for name, value in of.items() if name != "count")
        assert of["count"].tolist() == [len(frames)]
        assert {f"stats/{key}/{name}" for name in STATS} <= set(episodes.columns)
    return LeRobot(info, tasks.index.to_list(), episodes, frames, found, folder)


def _check_column(values: np.ndarray, feature: dict[str, Any]) -> None:
    (n,) = feature["shape"]
    assert feature["names"] is None or len(feature["names"]) == n
    if n == 1:
        assert values.dtype == feature["dtype"]
    else:
        assert {v.shape for v in values} == {(n,)}
        assert {v.dtype for v in values} == {np.dtype(feature["dtype"])}


def _read(folder: Path, info: dict[str, Any]) -> pd.DataFrame:
    """All files of a folder, in the order of their numbers, which have no gap."""
    paths = sorted(folder.glob("*/*.parquet"))
    expected = [
        folder / f"chunk-{k // info['chunks_size']:03d}" / f"file-{k % info['chunks_size']:03d}.parquet"
        for k in range(len(paths))
    ]
    assert paths == expected
    schemas = {str(pq.read_schema(path).remove_metadata()) for path in paths}
    assert len(schemas) == 1, "files of a table have one schema"
    return pd.concat([pd.read_parquet(path) for path in paths], ignore_index=True)
