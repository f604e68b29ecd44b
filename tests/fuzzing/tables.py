"""Models' answers, shards, recordings, journals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from fuzzing.cases import Case, Target, made
from support import court

from aerialdojo_gen.benchmark import episodes
from aerialdojo_gen.benchmark.llm.answer import parse_answer
from aerialdojo_gen.pipeline.scoring.vlm import read_order
from aerialdojo_gen.rendering import finished
from aerialdojo_gen.rendering.codecs import PngWriter, VideoWriter
from aerialdojo_gen.rendering.reader import read_recording
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.root import open_root


def _answers() -> list[Case]:
    return [
        {"answer.json": b'{"thought": "Nothing here.", "action": "MoveForward3"}'},
        {"answer.txt": b'<think>It is there.</think>\n```json\n{"action": "Stop"}\n```'},
        {"answer.json": b'{"order": [3, 1, 2, 5, 4]}'},
        {"answer.txt": b'```\n{"order": [1, 2, 3, 4, 5]}\n```'},
    ]


def _read_answer(folder: Path) -> None:
    text = next(folder.iterdir()).read_bytes().decode("utf-8", "surrogateescape")
    try:
        read_order(text, 5)
    except ValueError as error:  # what it is to raise: it asks the model again, in these words
        str(error).encode()
    answer = parse_answer(text)
    json.dumps(answer.model_dump()).encode()
    answer.thought.encode()


_TABLES = ("scenes", "objects", "anchors", "routes/train")


def _shards() -> list[Case]:
    whole = made(court.write_inputs)
    paths = {store.shard_name(table, court.SCENE) for table in _TABLES}
    return [{path: raw} for path, raw in whole.items() if path in paths]


def _read_shard(folder: Path) -> None:
    path = next(p for p in folder.rglob("*.parquet"))
    table = next(t for t in _TABLES if folder / store.shard_name(t, court.SCENE) == path)
    json.dumps(vars(store.read_info(path.parent, path.name)))
    store.read_scene(folder, table, court.SCENE).to_pylist()


_FINGERPRINT = "f" * 64
_NAV = f"media/{court.SCENE}/nav_a"


def recording_row(folder: str, modality: str = "rgb") -> dict:
    """A row of `recordings` of a file of four bytes."""
    suffix = {"rgb": "mp4", "depth": "mkv"}[modality]
    return {
        "scene": court.SCENE, "nav_id": "n", "view": "front", "modality": modality,
        "path": f"{folder}/front_{modality}.{suffix}", "stream": 0, "left_px": 0, "top_px": 0, "depth_step": None,
        "sampling": "steps", "n_frames": 1, "fps": 15.0, "width": 16, "height": 16, "fov_deg": 90.0, "codec": "h264",
        "renderer": "gl", "device": "x", "bytes": 4, "sha256": "0" * 64, "ok": True, "flags": [],
    }  # fmt: skip


def _notes() -> list[Case]:
    rows = [recording_row(_NAV, modality) for modality in ("depth", "rgb")]
    note = json.dumps({"fingerprint": _FINGERPRINT, "recordings": rows}).encode()
    return [{f"{_NAV}/recording.json": note, **{row["path"]: b"xxxx" for row in rows}}]


def _find(folder: Path) -> None:
    from aerialdojo_gen.store.schemas import RECORDINGS
    from aerialdojo_gen.store.tables import check_table, from_rows

    rows = finished.find(open_root(folder), _NAV, _FINGERPRINT)
    if rows is not None:
        check_table(RECORDINGS, from_rows(RECORDINGS, rows))
        assert all((folder / row["path"]).resolve().is_relative_to(folder.resolve()) for row in rows)


def _recordings() -> list[Case]:
    matrix = [[8, 0, 8], [0, 8, 8], [0, 0, 1]]
    camera = json.dumps({"K": matrix, "body_from_camera": np.eye(4).tolist(), "fov_deg": 90.0})
    colour = np.arange(16 * 16 * 3, dtype=np.uint8).reshape(16, 16, 3)

    def videos(folder: Path) -> None:
        for modality, suffix in (("rgb", "mp4"), ("depth", "mkv")):
            path = folder / f"front_{modality}.{suffix}"
            with VideoWriter(path, [modality], 16, 16, 15.0, comment=camera) as writer:
                for k in range(3):
                    writer.write({"rgb": colour + k, "depth": colour[..., 0].astype(np.uint16) + k})

    def pictures(folder: Path) -> None:
        for modality in ("rgb", "depth"):
            writer = PngWriter(folder / f"front_{modality}", modality, comment=camera)
            for k in range(2):
                writer.write({"rgb": colour + k, "depth": colour[..., 0].astype(np.uint16) + k})

    return [made(videos), made(pictures)]


def _read_recording(folder: Path) -> None:
    recording = read_recording(str(folder))
    for video in (*recording.rgb.values(), *recording.depth_m.values()):
        for k in range(min(len(video), 5)):
            assert np.asarray(video[k]).size
    json.dumps(recording.cameras)


def _journals() -> list[Case]:
    record = {"episode": {"success": True, "spl": 0.5}, "steps": {"action": [1, 2, 0]}}
    return [{"x.jsonl": b"".join(json.dumps({"task_id": f"t{k}"} | record).encode() + b"\n" for k in range(3))}]


TARGETS = {
    "answer": Target(_answers, _read_answer, names_the_file=False), "shard": Target(_shards, _read_shard),
    "recording-note": Target(_notes, _find, ".json"), "recording": Target(_recordings, _read_recording),
    "journal": Target(_journals, lambda folder: json.dumps([*episodes.read_journal(folder / "x.jsonl")]).encode()),
}  # fmt: skip
