"""The archive sent to the machines of a cluster: the package and the read-only folders.

Its bytes depend on the files' content alone, so that a cluster that has it already does not receive it again. It
includes Numba's compiled kernels: compiling them takes half a minute.
"""

from __future__ import annotations

import contextlib
import json
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.base.kernel_cache import folder_name

MAX_BYTES = 200 << 20
_NAMES = "bundled.json"
_KERNELS = (".nbi", ".nbc")
_EPOCH = (1980, 1, 1, 0, 0, 0)


def pack(target: Path, folders: Sequence[Path]) -> None:
    """Write the archive."""
    package = Path(__file__).resolve().parents[2]
    files: dict[str, Path] = {}
    names: dict[str, str] = {}
    # Without machine code of other versions of the sources.
    kernels = {folder for folder in package.rglob("__pycache__/kernels/*") if _is_current(folder)}
    for path in _files(package):
        if "__pycache__" not in path.relative_to(package).parts or (
            path.parent in kernels and path.suffix in _KERNELS
        ):
            files[f"{package.name}/{path.relative_to(package).as_posix()}"] = path
    # In a checkout these folders are next to the package, in a wheel inside it.
    siblings = [package.parent / name for name in ("pipelines", "scene_assets") if (package.parent / name).is_dir()]
    for number, folder in enumerate(dict.fromkeys([*siblings, *folders])):
        if folder.is_relative_to(package):
            names[str(folder)] = f"{package.name}/{folder.relative_to(package).as_posix()}"
            continue
        names[str(folder)] = folder.name if folder in siblings else f"bundled/{number}"
        files |= {f"{names[str(folder)]}/{p.relative_to(folder).as_posix()}": p for p in _files(folder)}
    size = sum(path.stat().st_size for path in files.values())
    if size > MAX_BYTES:
        raise UsageError(
            f"the package and {', '.join(map(str, folders))} have {size >> 20} MB: no more than {MAX_BYTES >> 20} MB "
            "are sent to a cluster; remove files that are no recipe, prop or annotation"
        )
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(zipfile.ZipInfo(_NAMES, _EPOCH), json.dumps(names, sort_keys=True))
        for name, path in sorted(files.items()):
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), _bytes(path), zipfile.ZIP_DEFLATED)


def _files(folder: Path) -> Iterator[Path]:
    yield from (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.name.startswith("."))


def _is_current(kernels: Path) -> bool:
    source = kernels.parents[2] / f"{kernels.name.rpartition('-')[0]}.py"
    return source.is_file() and folder_name(source) == kernels.name


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise AssetError(f"cannot read {path}: {error.strerror}") from None


class Unpacked:
    """An archive that Ray has unpacked."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._names: dict[str, str] = {}
        with contextlib.suppress(FileNotFoundError):
            self._names = json.loads((folder / _NAMES).read_text(encoding="utf-8"))

    def place(self, path: Path) -> Path:
        """Return the unpacked location of a path in a packed folder; any other path unchanged."""
        for above in (path, *path.parents):
            if str(above) in self._names:
                return self._folder / self._names[str(above)] / path.relative_to(above)
        return path
