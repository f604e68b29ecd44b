"""A scene's files as one tar archive, the same bytes for the same files."""

from __future__ import annotations

import shutil
import tarfile
from pathlib import Path


def pack(folder: Path, archive: Path) -> None:
    """Move all files below a folder into a tar archive, by name; the folder is gone afterwards.

    Owners, times and modes are the same for all: the archive depends on names and contents alone. Files that are
    links to one another stay so.
    """
    with tarfile.open(archive, "w", format=tarfile.PAX_FORMAT) as tar:
        for path in sorted(folder.rglob("*")):
            entry = tar.gettarinfo(path, path.relative_to(folder).as_posix())
            entry.uid = entry.gid = 0
            entry.uname = entry.gname = ""
            entry.mtime = 0
            entry.mode = 0o755 if entry.isdir() else 0o644
            if entry.isreg():
                with path.open("rb") as file:
                    tar.addfile(entry, file)
            else:
                tar.addfile(entry)
    shutil.rmtree(folder)
