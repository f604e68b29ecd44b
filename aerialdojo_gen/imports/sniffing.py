"""What a file is by its first bytes, where that is not what its name says: told with what to do about it."""

from __future__ import annotations

import struct
from pathlib import Path

_HEAD = 1024
# What begins so is this, and what to do about it.
_OTHERS = (
    (b"\x1f\x8b", "is compressed by gzip: unpack it first"),
    (b"7z\xbc\xaf\x27\x1c", "is a 7z archive: unpack it, and give the mesh in it"),
    (b"Rar!", "is a RAR archive: unpack it, and give the mesh in it"),
    (b"BZh", "is compressed by bzip2: unpack it first"),
    (b"\xfd7zXZ", "is compressed by xz: unpack it first"),
    (b"\x28\xb5\x2f\xfd", "is compressed by Zstandard: unpack it first"),
    (b"BLENDER", "is a Blender file: export it as GLB (File, Export, glTF 2.0)"),
    (b"%PDF", "is a PDF: export the mesh itself, as GLB"),
    (b"\x89PNG", "is a PNG picture: give the mesh, and leave its textures beside it"),
    (b"\xff\xd8\xff", "is a JPEG picture: give the mesh, and leave its textures beside it"),
    (b"II*\0", "is a TIFF picture: give the mesh"),
    (b"MM\0*", "is a TIFF picture: give the mesh"),
    (b"LASF", "is a LAS point cloud: mesh it first (CloudCompare, Open3D, OpenDroneMap)"),
    (b"version https://git-lfs", "is a Git LFS pointer: fetch the file itself (git lfs pull)"),
    (b"-----BEGIN PGP", "is encrypted by PGP: decrypt it first"),
    (b"Salted__", "is encrypted by OpenSSL: decrypt it first"),
    (b"age-encryption.org", "is encrypted by age: decrypt it first"),
    (b"SQLite format 3", "is an SQLite database: export the mesh itself, as GLB"),
)
# Formats that are read, by their first bytes.
_MESHES = (
    (b"glTF", ".glb"), (b"ply\n", ".ply"), (b"ply\r", ".ply"), (b"Kaydara FBX Binary", ".fbx"),
)  # fmt: skip
_ENCRYPTED = 1
_PAGES = (b"<!doctype html", b"<html")


def mismatch(path: Path, suffixes: tuple[str, ...]) -> str:
    """Say what a file is, where it cannot be what its name says."""
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
    for begin, said in _OTHERS:
        if head.startswith(begin):
            return said
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    if text.lower().startswith(_PAGES):
        return "is a web page, not what it was to download: download the file itself"
    suffix = path.suffix.lower()
    for begin, own in _MESHES:
        if head.startswith(begin) and suffix != own:
            return _rename(path, own, suffixes)
    point_cloud = (
        suffix == ".ply" and b"element vertex" in head and b"end_header" in head and b"element face" not in head
    )
    return "holds points and no faces: mesh it first (CloudCompare, Open3D, MeshLab)" if point_cloud else ""


def _rename(path: Path, own: str, suffixes: tuple[str, ...]) -> str:
    kind = own[1:].upper()
    if own not in suffixes:
        return f"is a {kind} file, which is not read: export it as GLB"
    return f"is a {kind} file by its content: rename it to {path.with_suffix(own).name}"
