"""How large a picture is, by the first bytes of its file: a kilobyte may ask for gigabytes of pixels."""

from __future__ import annotations

import struct


def image_size(file: bytes | memoryview) -> tuple[int, int] | None:
    """Read an image's width and height, pixels, without decoding it; None where it is of no kind that is read."""
    if file[:8] == b"\x89PNG\r\n\x1a\n" and len(file) >= 24:
        width, height = struct.unpack(">II", file[16:24])
        return int(width), int(height)
    if file[:3] == b"\xff\xd8\xff":
        return _jpeg_size(file)
    if file[:2] == b"BM" and len(file) >= 26:
        width, height = struct.unpack("<ii", file[18:26])
        return abs(width), abs(height)
    if file[:4] == b"RIFF" and file[8:12] == b"WEBP" and len(file) >= 30:
        return _webp_size(file)
    return None


def _webp_size(file: bytes | memoryview) -> tuple[int, int] | None:
    kind = file[12:16]
    if kind == b"VP8X":
        return 1 + int.from_bytes(file[24:27], "little"), 1 + int.from_bytes(file[27:30], "little")
    if kind == b"VP8L":
        bits = int.from_bytes(file[21:25], "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    width, height = struct.unpack("<HH", file[26:30])
    return width & 0x3FFF, height & 0x3FFF


def _jpeg_size(file: bytes | memoryview) -> tuple[int, int] | None:
    at = 2
    while at + 9 < len(file) and file[at] == 0xFF:
        kind = file[at + 1]
        if kind == 0xFF:
            at += 1
            continue
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">HH", file[at + 5 : at + 9])
            return int(width), int(height)
        at += 2 if 0xD0 <= kind <= 0xD9 else 2 + struct.unpack(">H", file[at + 2 : at + 4])[0]
    return None
