"""Named surfaces: `scene_assets/materials.toml` and colours, resolved to `Material`s."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import pydantic_core
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError, model_validator

from aerialdojo_gen.base import safe_parse
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.explain import explain
from aerialdojo_gen.base.names import nearest
from aerialdojo_gen.scenes.model import Material
from aerialdojo_gen.scenes.noise import balanced, texture_rng
from aerialdojo_gen.scenes.textures_built import BUILT
from aerialdojo_gen.scenes.textures_facade import Layout, draw_facade
from aerialdojo_gen.scenes.textures_natural import NATURAL

_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
Model = TypeVar("Model", bound=BaseModel)


class _Entry(BaseModel, frozen=True, extra="forbid"):
    """A surface of the file."""

    colour: Annotated[str, Field(pattern="^#[0-9a-fA-F]{6}$")]
    texture: str | None = None
    tile_m: Annotated[float, Field(ge=0.01, le=1000)] = 1.0
    layouts: dict[Annotated[str, Field(pattern=r"^[^\W\d]\w*$")], Layout] = {}  # Of a façade, in place of a texture

    @model_validator(mode="after")
    def _one_pattern(self) -> _Entry:
        if self.texture is not None and self.layouts:
            raise ValueError("it has a texture or layouts, not both")
        return self


class MaterialLibrary:
    """The surfaces of `materials.toml`, made on first use.

    A material's specification is a name (``"brick"``), a name with a colour (``"brick:#8a4b3c"``) or a bare colour
    (``"#8a4b3c"``); of a façade also a name with a colour or none, and a layout (``"facade_flats::loggias"``).
    """

    def __init__(self, entries: dict[str, _Entry], source: str) -> None:
        self._entries = entries
        self._source = source
        self._cache: dict[str, Material] = {}
        self._checked: set[str] = set()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all surfaces, sorted."""
        return tuple(sorted(self._entries))

    def check(self, spec: str, where: str) -> None:
        """Raise an `AssetError` that begins with `where` if `spec` names no material."""
        if spec in self._checked:
            return
        name, colour, layout = _split(spec)
        if _COLOUR.fullmatch(spec):
            return
        if name.startswith("#") or (name in self._entries and colour and not _COLOUR.fullmatch(colour)):
            raise AssetError(f"{where}: colour of material {spec!r} is not of the form #rrggbb")
        if name not in self._entries:
            raise AssetError(f"{where}: unknown material {name!r}{nearest(name, self._entries)} (see {self._source})")
        known = self.layouts(name)
        if layout and layout not in known:
            raise AssetError(f"{where}: {name} has no layout {layout!r}{nearest(layout, known)} (see {self._source})")
        self._checked.add(spec)

    def layouts(self, spec: str) -> tuple[str, ...]:
        """Names of the layouts that a façade comes in; none of other surfaces."""
        entry = self._entries.get(_split(spec)[0])
        return tuple(entry.layouts) if entry else ()

    def laid_out(self, spec: str, draw: int, flush: bool = False) -> str:
        """Give a façade the layout that a number draws, unless its specification names one.

        Before flush ones balconies can be built.
        """
        (name, colour, layout), known = _split(spec), self.layouts(spec)
        if flush and known:
            known = tuple(k for k, one in self._entries[name].layouts.items() if one.flush) or known
        return spec if layout or not known else f"{name}:{colour}:{known[draw % len(known)]}"

    def __getitem__(self, spec: str) -> Material:
        """Make or look up the material of a specification; its name is the specification."""
        if spec not in self._cache:
            self.check(spec, "material")
            name, colour, _ = _split(spec)
            entry = self._entries.get(name) or _Entry(colour=spec)
            rgb = parse_colour(colour or entry.colour)
            image = None
            if entry.layouts:
                layout = _split(self.laid_out(spec, 0))[2]
                image = _bytes(
                    draw_facade(entry.layouts[layout], np.array(rgb, float), entry.tile_m, f"{name} {layout}")
                )
            elif entry.texture is not None:
                image = make_texture(entry.texture, rgb)
            mean = rgb if image is None else tuple(int(c) for c in image.reshape(-1, 3).mean(axis=0).round())
            self._cache[spec] = Material(spec, (mean[0], mean[1], mean[2]), image, entry.tile_m)
        return self._cache[spec]

    def tile_m(self, spec: str) -> float:
        """Edge of a texture tile of a material, metres; 1 for a flat colour."""
        self.check(spec, "material")
        entry = self._entries.get(_split(spec)[0])
        return 1.0 if entry is None else entry.tile_m


def load_materials(path: Path) -> MaterialLibrary:
    """Read `materials.toml`."""
    entries = {}
    for name, body in read_toml(path).items():
        where = f"{path}: material {name!r}"
        entry = entries[name] = validated(_Entry, body, where)
        refuse_unknown([] if entry.texture is None else [entry.texture], TEXTURES, where, "texture")
    return MaterialLibrary(entries, path.name)


def _split(spec: str) -> tuple[str, str, str]:
    """Give the name, the colour and the layout of a specification, empty where it has none."""
    name, colour, layout = (*spec.split(":", 2), "", "")[:3]
    return name, colour, layout


def parse_colour(text: str) -> tuple[int, int, int]:
    """Read ``"#rrggbb"`` as sRGB, 0-255."""
    return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)


def refuse_unknown(body: Iterable[Any], known: Iterable[str], where: str, what: str = "key") -> None:
    """Raise an `AssetError` for the first key, or name of another thing, that is not among the known ones."""
    names = list(known)
    for key in body:
        if key not in names:
            raise AssetError(f"{where}: unknown {what} {key!r}{nearest(str(key), names)}")


def validated(model: type[Model], body: Any, where: str) -> Model:
    """Validate a table strictly against its model; an `AssetError` names the key."""
    try:
        # As JSON, because only there a list is a strict tuple: "nan" and false are numbers to a lenient model.
        return model.model_validate_json(pydantic_core.to_json(body), strict=True)
    except ValidationError as error:
        raise AssetError(f"{where}: {'; '.join(explain(error, model))}") from error


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
    image = TEXTURES[name](base, texture_rng(name))
    if name in NATURAL:
        image = balanced(image, base)
    return _bytes(image)


def _bytes(image: NDArray[np.float64]) -> NDArray[np.uint8]:
    out = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    out.flags.writeable = False
    return out
