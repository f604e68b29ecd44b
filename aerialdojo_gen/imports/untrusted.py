"""Read untrusted files: check the type by content, read in a child process with limits, resolve sibling files."""

from __future__ import annotations

import resource
import signal
import struct
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path, PurePosixPath
from urllib.parse import unquote_to_bytes

import tomli

from aerialdojo_gen.base import environment_errors
from aerialdojo_gen.base.errors import AssetError

MAX_MEMORY_BYTES = 6 << 30
MAX_SECONDS = 300
_OUT_OF_MEMORY = 3


def read_in_sandbox(module: str, path: Path, arguments: Sequence[str], max_memory_bytes: int, advice: str) -> None:
    """Run a reader module in a child process, and wait for it."""
    # Not multiprocessing, which would run an unguarded script of the caller a second time.
    command = [sys.executable, "-m", module, str(max_memory_bytes), str(path.resolve()), *arguments]
    try:
        process = subprocess.run(command, capture_output=True, text=True, timeout=MAX_SECONDS, check=False)
    except subprocess.TimeoutExpired:
        raise AssetError(f"{path}: reading takes more than {MAX_SECONDS} s: {advice}") from None
    if process.returncode:
        raise AssetError(f"{path}: {_failure_reason(process, max_memory_bytes, advice)}")


def _failure_reason(process: subprocess.CompletedProcess[str], max_memory_bytes: int, advice: str) -> str:
    """Explain the exit status of a reader process."""
    out, err = (text.strip().splitlines() for text in (process.stdout, process.stderr))
    if process.returncode == _OUT_OF_MEMORY or environment_errors.is_out_of_memory(process.stderr):
        return f"needs more than {_memory_limit(max_memory_bytes) >> 20:,} MB of memory to read: {advice}"
    number = -process.returncode
    if number == signal.SIGXCPU:
        return f"reading takes more than {MAX_SECONDS} s: {advice}"
    if number == signal.SIGKILL:
        return f"its reader was killed (signal 9), by the system if memory ran out: try again, or {advice}"
    if number > 0:
        return f"its reader crashed (signal {number}, {signal.strsignal(number)}): the file may be damaged"
    return out[-1] if out else f"its reader failed ({err[-1][:160] if err else 'without a reason'})"


def _memory_limit(most: int) -> int:
    """Return the limit on address space, or the caller's own if that is lower."""
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    return most if hard == resource.RLIM_INFINITY else min(most, hard)


def exit_status(read: Callable[[list[str]], str]) -> int:
    """Apply the limits of the command line to this process, read, and print the error."""
    memory, *arguments = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_AS, (_memory_limit(int(memory)),) * 2)
    # At the hard limit the kernel sends SIGKILL, which hides the cause.
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_SECONDS, MAX_SECONDS + 5))
    try:
        fault = read(arguments)
    except MemoryError:
        return _OUT_OF_MEMORY
    print(fault)
    return 1 if fault else 0


_MAX_BYTES = 256 << 20


class SiblingFiles:
    """Files in the folder of a mesh file and below, and no others."""

    def __init__(self, path: Path) -> None:
        self._folder = path.resolve().parent
        self.loaded: dict[str, bytes] = {}
        self.missing: list[str] = []

    def get(self, name: str) -> bytes:
        """Read a file; FileNotFoundError if it is missing, too large or elsewhere."""
        path = self._resolve(name.strip())
        if path is None or path.stat().st_size > _MAX_BYTES:
            self.missing.append(name)
            raise FileNotFoundError(name)
        if name not in self.loaded:
            self.loaded[name] = path.read_bytes()
        return self.loaded[name]

    __getitem__ = get  # trimesh reads files by name

    def _resolve(self, name: str) -> Path | None:
        """Resolve a name; absolute paths of other machines by their last part, as exporters write them."""
        plain = name.replace("\\", "/")
        # map_Kd may have options before the name: "-s 1 1 1 wall.png".
        for candidate in (plain, PurePosixPath(plain).name, plain.split(" ")[-1]):
            try:
                path = (self._folder / candidate).resolve()
                if candidate and path.is_relative_to(self._folder) and path.is_file():
                    return path
            except (OSError, ValueError):
                continue
        return None


_HEAD = 1024
# First bytes of supported formats.
_MESHES = (
    (b"glTF", ".glb"), (b"ply\n", ".ply"), (b"ply\r", ".ply"), (b"Kaydara FBX Binary", ".fbx"),
)  # fmt: skip
_ENCRYPTED = 1
_PAGES = (b"<!doctype html", b"<html")


def mismatch(path: Path, suffixes: tuple[str, ...]) -> str:
    """Describe a file whose content does not match its suffix; empty if it does."""
    with path.open("rb") as file:
        head = file.read(_HEAD)
    if not head:
        return "is empty (0 bytes): it was not written or not downloaded whole"
    if len(head) == _HEAD and not any(head):
        return "begins with zeros alone: it was not written or not downloaded whole"
    if head[:4] == b"PK\x03\x04":
        locked = len(head) >= 8 and struct.unpack_from("<H", head, 6)[0] & _ENCRYPTED
        how = "unpack it with its password" if locked else "unpack it"
        return f"is {'an encrypted' if locked else 'a'} ZIP archive: {how}, and give the mesh in it"
    for start, message in tomli.loads(Path(__file__).with_name("file_types.toml").read_text("utf-8")).items():
        if head.startswith(unquote_to_bytes(start)):
            return message
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    if text.lower().startswith(_PAGES):
        return "is a web page, not a mesh: download the file itself"
    suffix = path.suffix.lower()
    for begin, own in _MESHES:
        if head.startswith(begin) and suffix != own:
            kind, right = own[1:].upper(), path.with_suffix(own).name
            if own in suffixes:
                return f"is a {kind} file by its content: rename it to {right}"
            return f"is a {kind} file, which is not read: export it as GLB"
    point_cloud = (
        suffix == ".ply" and b"element vertex" in head and b"end_header" in head and b"element face" not in head
    )
    return "holds points and no faces: mesh it first (CloudCompare, Open3D, MeshLab)" if point_cloud else ""
