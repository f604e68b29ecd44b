"""Named surfaces: `scene_assets/materials.toml` and colours, resolved to `Material`s."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import safe_parse
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.scenes.model import Material
from aerialdojo_gen.scenes.noise import balanced
from aerialdojo_gen.scenes.textures_built import BUILT
from aerialdojo_gen.scenes.textures_natural import NATURAL

_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
_KEYS = {"texture", "colour", "tile_m"}
_SMALLEST_TILE_M, _LARGEST_TILE_M = 0.01, 1000.0


class MaterialLibrary:
    """The surfaces of `materials.toml`, made on first use.

    A material's specification is a name (``"brick"``), a name with a colour (``"brick:#8a4b3c"``) or a bare colour
    (``"#8a4b3c"``).
    """

    def __init__(self, entries: dict[str, tuple[str | None, str, float]], source: str) -> None:
        self._entries = entries
        self._source = source
        self._cache: dict[str, Material] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all surfaces, sorted."""
        return tuple(sorted(self._entries))

    def check(self, spec: str, where: str) -> None:
        """Raise an `AssetError` that begins with `where` if `spec` names no material."""
        name, _, colour = spec.partition(":")
        if _COLOUR.fullmatch(spec) or (name in self._entries and (not colour or _COLOUR.fullmatch(colour))):
            return
        if name in self._entries or name.startswith("#"):
            raise AssetError(f"{where}: colour of material {spec!r} is not of the form #rrggbb")
        raise AssetError(f"{where}: unknown material {name!r}{nearest(name, self._entries)} (see {self._source})")

    def __getitem__(self, spec: str) -> Material:
        """Make or look up the material of a specification; its name is the specification."""
        if spec not in self._cache:
            self.check(spec, "material")
            name, _, colour = spec.partition(":")
            texture, default, tile_m = self._entries.get(name, (None, spec, 1.0))
            rgb = parse_colour(colour or default)
            image = None if texture is None else make_texture(texture, rgb)
            mean = rgb if image is None else tuple(int(c) for c in image.reshape(-1, 3).mean(axis=0).round())
            self._cache[spec] = Material(spec, (mean[0], mean[1], mean[2]), image, tile_m)
        return self._cache[spec]

    def tile_m(self, spec: str) -> float:
        """Edge of a texture tile of a material, metres; 1 for a flat colour."""
        return self[spec].tile_m


def load_materials(path: Path) -> MaterialLibrary:
    """Read `materials.toml`."""
    entries = {}
    for name, body in read_toml(path).items():
        where = f"{path}: material {name!r}"
        if not isinstance(body, dict):
            raise AssetError(f"{where} is no table")
        refuse_unknown(body, _KEYS, where)
        texture, colour, tile_m = body.get("texture"), body.get("colour"), body.get("tile_m", 1.0)
        if texture is not None and (not isinstance(texture, str) or texture not in TEXTURES):
            raise AssetError(f"{where}: unknown texture {texture!r}{nearest(str(texture), TEXTURES)}")
        if not isinstance(colour, str) or not _COLOUR.fullmatch(colour):
            raise AssetError(f"{where}: colour must be of the form #rrggbb, got {colour!r}")
        if not isinstance(tile_m, int | float) or not _SMALLEST_TILE_M <= tile_m <= _LARGEST_TILE_M:
            raise AssetError(f"{where}: tile_m must be {_SMALLEST_TILE_M:g} to {_LARGEST_TILE_M:g} m, got {tile_m!r}")
        entries[name] = (texture, colour, float(tile_m))
    return MaterialLibrary(entries, path.name)


def parse_colour(text: str) -> tuple[int, int, int]:
    """Read ``"#rrggbb"`` as sRGB, 0-255."""
    return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)


def refuse_unknown(body: Iterable[str], known: Iterable[str], where: str) -> None:
    """Raise an `AssetError` for the first key that is not among the known ones."""
    names = set(known)
    for key in body:
        if key not in names:
            raise AssetError(f"{where}: unknown key {key!r}{nearest(key, names)}")


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; an `AssetError` names it and the line that cannot be read."""
    try:
        return safe_parse.read_toml(path, AssetError)
    except FileNotFoundError as error:
        raise AssetError(f"{path}: cannot be read ({error.strerror})") from None


TEXTURES = {**NATURAL, **BUILT}


@lru_cache(maxsize=256)
def make_texture(name: str, colour: tuple[int, int, int]) -> NDArray[np.uint8]:
    """Draw one of `TEXTURES` in a base colour: (H, W, 3) uint8 sRGB, 64 to 256 pixels a side, seamless, read-only."""
    base = np.array(colour, dtype=np.float64)
    image = TEXTURES[name](base)
    if name in NATURAL:
        image = balanced(image, base)
    out = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    out.flags.writeable = False
    return out
