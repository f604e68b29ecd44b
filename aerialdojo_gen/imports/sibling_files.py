"""Files that a mesh file refers to: of its own folder and below, and no other."""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Any

_MAX_BYTES = 256 << 20


class SiblingFiles:
    """Gives the files beside a mesh file."""

    def __init__(self, path: Path) -> None:
        self._folder = path.resolve().parent
        self.given: dict[str, bytes] = {}
        self.missing: list[str] = []

    def get(self, name: str) -> bytes:
        """Read a file; FileNotFoundError where there is none, or it is too large or elsewhere."""
        wanted = self._found(name.strip())
        if wanted is None or wanted.stat().st_size > _MAX_BYTES:
            self.missing.append(name)
            raise FileNotFoundError(name)
        if name not in self.given:
            self.given[name] = wanted.read_bytes()
        return self.given[name]

    def _found(self, name: str) -> Path | None:
        """Look a name up; other machines' full paths by their last part, as exporters write them."""
        plain = name.replace("\\", "/")
        # map_Kd may have options before the name: "-s 1 1 1 wall.png".
        for told in (plain, PurePosixPath(plain).name, plain.split(" ")[-1]):
            try:
                wanted = (self._folder / told).resolve()
                if told and wanted.is_relative_to(self._folder) and wanted.is_file():
                    return wanted
            except (OSError, ValueError):
                continue
        return None

    def keys(self) -> list[str]:
        """Nothing: what is there is found by asking."""
        return []

    def namespaced(self, namespace: str) -> Any:
        """Return itself: names are looked up in one folder."""
        return self

    def write(self, name: str, data: bytes) -> None:
        """Refuse."""
        raise PermissionError(name)
