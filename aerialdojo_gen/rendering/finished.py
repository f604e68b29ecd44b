"""Finished trajectories: one folder each, committed atomically, so that a killed run loses at most one trajectory.

``media/<scene>/<nav_id>/`` holds the videos and ``recording.json``: the rows of `recordings`, and the fingerprint of
their inputs. A trajectory whose folder is up to date is not rendered again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.base.safe_parse import read_json
from aerialdojo_gen.store.root import DataRoot
from aerialdojo_gen.store.schemas import RECORDINGS
from aerialdojo_gen.store.tables import check_table, from_rows

MANIFEST = "recording.json"
# Settings that do not change a trajectory's own files.
_SELECTION = {"limit", "split", "trajectories_per_part"}


def trajectory_fingerprint(code: str, mesh_sha256: str, route: Mapping[str, Any], config: RenderConfig) -> str:
    """Hash the inputs of a trajectory's recording."""
    facts = {
        "code": code,
        "mesh": mesh_sha256,
        "route": {name: route[name] for name in ("nav_id", "x_m", "y_m", "z_m", "yaw_rad", "action")},
        "config": config.model_dump(mode="json", exclude=_SELECTION),
    }
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def find(data: DataRoot, folder: str, fingerprint: str, *, verify: bool = False) -> list[dict[str, Any]] | None:
    """Return the rows of a finished trajectory; None where there is none, or it is stale or damaged."""
    try:
        note = read_json(data.local_copy(f"{folder}/{MANIFEST}"))
    except (OSError, StoreError):
        return None
    if not isinstance(note, dict) or note.get("fingerprint") != fingerprint:
        return None
    rows = note.get("recordings")
    if not isinstance(rows, list) or not _are_recordings(rows, folder):
        return None
    files = {(row["path"], row["bytes"], row["sha256"] if verify else "") for row in rows}
    return rows if all(data.is_whole(*file, reread=True) for file in files) else None


def _are_recordings(rows: list[Any], folder: str) -> bool:
    """Whether these are rows of `recordings`, each of a file in the trajectory's own folder."""
    try:
        table = check_table(RECORDINGS, from_rows(RECORDINGS, rows))
    except StoreError:
        return False
    paths = [path.rpartition("/") for path in table["path"].to_pylist()]
    return bool(rows) and all(own == folder and name not in ("", ".", "..") for own, _, name in paths)


def note(folder: Path, fingerprint: str, rows: list[dict[str, Any]]) -> None:
    """Write the manifest of a trajectory's folder."""
    text = json.dumps({"fingerprint": fingerprint, "recordings": rows}, indent=1)
    (folder / MANIFEST).write_text(text, encoding="utf-8")
