"""Files and folders into data roots, and back."""

from __future__ import annotations

from aerialdojo_gen.store.root import DataRoot


def write(root: DataRoot, name: str, data: bytes) -> None:
    with root.commit(name) as path:
        path.write_bytes(data)


def fill(root: DataRoot, folder: str, files: dict[str, bytes]) -> None:
    with root.commit_folder(folder) as path:
        for name, data in files.items():
            (path / name).parent.mkdir(exist_ok=True)
            (path / name).write_bytes(data)


def read_folder(root: DataRoot, folder: str) -> dict[str, bytes]:
    here = root.local_copy(folder)
    return {p.relative_to(here).as_posix(): p.read_bytes() for p in here.rglob("*") if p.is_file()}
