"""Textures of façades, drawn from layouts: rows of bays with openings; see `aerialdojo_gen.scenes.materials`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, Field, StringConstraints, model_validator

from aerialdojo_gen.scenes.noise import Floats, fractal, shade, texture_rng, value_noise

SIZE = 512
_SKY, _DEEP = np.array([140.0, 162.0, 178.0]), np.array([58.0, 74.0, 86.0])
_LINEN, _LAMP = np.array([222.0, 216.0, 202.0]), np.array([232.0, 200.0, 138.0])
Metres = Annotated[float, Field(ge=0, le=20)]
Share = Annotated[float, Field(ge=0, le=1)]
Colour = Annotated[str, StringConstraints(pattern=r"^#[0-9a-fA-F]{6}$")]
Paint = Annotated[float, Field(ge=0, le=3)] | Colour  # A factor of what is there, or a colour
_NONE = "-"


class Opening(BaseModel, frozen=True, extra="forbid"):
    """A window, door or loggia of a bay, metres."""

    size: tuple[Metres, Metres] = (1.2, 1.5)  # Width and height
    sill: Metres = 0.9  # Above the floor
    at: Annotated[float, Field(ge=-10, le=10)] = 0.0  # Right of the bay's middle
    panes: tuple[Annotated[int, Field(ge=1, le=24)], Annotated[int, Field(ge=1, le=24)]] = (2, 1)
    frame: Colour = "#e8e6e0"
    frame_m: Metres = 0.07
    arch: Metres = 0.0  # Rise of a round head
    trim: Paint = 1.0  # Of sill and lintel
    trim_m: Metres = 0.0  # Height of the lintel
    shutters: Colour | None = None
    rail: Colour | None = None  # Bars before a French window
    parapet: Paint | None = None  # Of a balcony
    fill: Colour | None = None  # In place of glass
    tint: Share = 0.0  # Share of the wall's colour in the glass
    recess: bool = False  # A loggia, with a glass door at its back
    goods: bool = False  # Behind a shop window
    curtains: Share = 0.0  # Share of the windows that have them
    blinds: Share = 0.0
    lit: Share = 0.0
    cooler: Share = 0.0  # Air conditioner below


class Layout(BaseModel, frozen=True, extra="forbid"):
    """Openings of the bays of a tile, and what runs across it."""

    rows: Annotated[list[str], Field(min_length=1, max_length=8)]  # Openings by name, bay by bay, "-" for none
    openings: dict[str, Opening]
    storeys: Annotated[int, Field(ge=1, le=8)] = 4  # Of a tile
    wall: Annotated[str, Field(pattern="^(plain|brick|ribs|panels|boards)$")] = "plain"
    bands: list[tuple[Metres, Metres, Paint]] = []  # Above the floor, height, paint
    pilasters: list[tuple[Annotated[int, Field(ge=1, le=8)], Metres, Paint]] = []  # Every so many bays, width, paint

    @model_validator(mode="after")
    def _fits(self) -> Layout:
        """Check that the bays of all rows are as many, and that walls of half a tile end between bays."""
        counts = {len(row.split()) for row in self.rows}
        if len(counts) > 1 or self.bays % 2 or not 2 <= self.bays <= 16 or self.storeys % len(self.rows):
            raise ValueError("rows: each has the same even number of bays up to 16, and the storeys are whole rounds")
        unknown = {name for row in self.rows for name in row.split()} - {*self.openings, _NONE}
        if unknown:
            raise ValueError(f"rows: no opening {min(unknown)!r}")
        return self

    @property
    def bays(self) -> int:
        """Number of bays across a tile."""
        return len(self.rows[0].split())

    @property
    def flush(self) -> bool:
        """Whether it has no balconies."""
        return not any(one.rail or one.recess or one.parapet is not None for one in self.openings.values())


def draw_facade(layout: Layout, colour: Floats, tile_m: float, name: str) -> Floats:
    """Draw a tile of a layout: (SIZE, SIZE, 3), a storey's floor at the lower edge; the pattern is the name's."""
    rng = texture_rng(name)
    wall = _Wall(_SURFACES[layout.wall](colour, rng), SIZE / tile_m, rng, colour)
    bay, storey = tile_m / layout.bays, tile_m / layout.storeys
    for every, width, paint in layout.pilasters:
        for k in range(0, layout.bays, every):
            # Half of it on each side, over the tile's border.
            for x in (k * bay, k * bay + tile_m):
                wall.paint(x - width / 2, 0.0, width, tile_m, paint)
                wall.paint(x + width / 2 - 0.06, 0.0, 0.06, tile_m, 0.8)
    for k in range(layout.storeys):
        for low, height, paint in layout.bands:
            wall.paint(0.0, k * storey + low, tile_m, height, paint)
            wall.paint(0.0, k * storey + low - 0.06, tile_m, 0.06, 0.8)
    for k in range(layout.storeys):
        for b, what in enumerate(layout.rows[k % len(layout.rows)].split()):
            if what != _NONE:
                wall.opening(layout.openings[what], (b + 0.5) * bay, k * storey)
    return wall.image


@dataclass(frozen=True)
class _Wall:
    image: Floats
    px_m: float
    rng: np.random.Generator
    colour: Floats

    def view(self, x: float, z: float, width: float, height: float) -> Floats:
        """The part of the image over a rectangle, metres from the lower left corner."""
        left, right = (min(max(round(v * self.px_m), 0), SIZE) for v in (x, x + width))
        low, high = (min(max(SIZE - round(v * self.px_m), 0), SIZE) for v in (z, z + height))
        return self.image[high:low, left:right]

    def paint(self, x: float, z: float, width: float, height: float, paint: Any) -> None:
        """Paint a rectangle: a number multiplies what is there."""
        view = self.view(x, z, width, height)
        view[...] = view * paint if isinstance(paint, float) else _rgb(paint)

    def opening(self, one: Opening, middle: float, floor: float) -> None:
        """Draw an opening in the bay about `middle`, in the storey from `floor`."""
        (w, h), z = one.size, floor + one.sill
        x = middle + one.at - w / 2
        kept = self.view(x - one.frame_m, z + h - one.arch, w + 2 * one.frame_m, one.arch + one.frame_m).copy()
        if one.trim_m:
            self.paint(x - 0.15, z + h - one.arch, w + 0.3, one.trim_m + one.arch, one.trim)
            kept = self.view(x - one.frame_m, z + h - one.arch, w + 2 * one.frame_m, one.arch + one.frame_m).copy()
            self.paint(x - 0.12, z - 0.2, w + 0.24, 0.14, one.trim)
            self.paint(x - 0.12, z - 0.28, w + 0.24, 0.08, 0.78)
        self.paint(x - one.frame_m, z - one.frame_m, w + 2 * one.frame_m, h + 2 * one.frame_m, one.frame)
        if one.recess:
            self.paint(x, z, w, h, 0.42)
            self._panes(one, x + 0.25 * w, z, 0.5 * w, 0.8 * h)
        else:
            self._panes(one, x, z, w, h)
        if one.arch:
            self._head(one, x, z + h, w, kept)
        for left in (x - w / 2 - 0.06, x + w + 0.06) if one.shutters else ():
            self.paint(left, z, w / 2, h, one.shutters)
            self.view(left, z, w / 2, h)[::3] *= 0.74
        self._before(one, x, z, w, floor)

    def _panes(self, one: Opening, x: float, z: float, w: float, h: float) -> None:
        pane = self.view(x, z, w, h)
        rows, columns = pane.shape[:2]
        pane[...] = _rgb(one.fill) if one.fill else self._glass(one, rows, columns)
        draws = self.rng.uniform(size=4)
        if one.goods:
            self._goods(x, z, w, h)
        if draws[0] < one.lit:
            pane[...] = pane * 0.5 + _LAMP * 0.5
        if draws[1] < one.curtains:
            share = int(columns * self.rng.uniform(0.12, 0.3))
            for side in (pane[:, :share], pane[:, columns - share :]):
                side[...] = side * 0.3 + _LINEN * 0.62
        elif draws[2] < one.blinds:
            part = pane[: int(rows * self.rng.uniform(0.25, 0.95))]
            part[...] = part * 0.15 + _LINEN * 0.76
            part[::3] *= 0.88
        if draws[3] < one.cooler:
            self.paint(x + 0.1 * w, z - 0.75, 0.8, 0.55, "#d9d9d4")
            self.paint(x + 0.1 * w + 0.12, z - 0.68, 0.4, 0.4, 0.72)
            self.paint(x + 0.1 * w, z - 0.85, 0.8, 0.1, 0.7)
        for k in range(1, one.panes[0]):
            self.paint(x + w * k / one.panes[0] - one.frame_m / 2, z, one.frame_m, h, one.frame)
        for k in range(1, one.panes[1]):
            self.paint(x, z + h * k / one.panes[1] - one.frame_m / 2, w, one.frame_m, one.frame)
        # The wall is thick: head and one side cast shade on the pane.
        self.paint(x, z + h - 0.12, w, 0.12, 0.62)
        self.paint(x, z, 0.07, h, 0.8)

    def _glass(self, one: Opening, rows: int, columns: int) -> Floats:
        """Sky above, the dark of the room below, by the pane."""
        rise = np.linspace(1.0, 0.0, rows)[:, None]
        tone = self.rng.uniform(0.86, 1.14, size=one.panes[0])[np.arange(columns) * one.panes[0] // max(columns, 1)]
        slant = 0.05 * np.sin(rise * 2.0 + np.linspace(0.0, 3.0, columns) + self.rng.uniform(0.0, 6.0))
        clear = _DEEP + (_SKY - _DEEP) * (rise * self.rng.uniform(0.35, 0.8))[..., None]
        tinted = self.colour * (0.82 + 0.36 * rise)[..., None]
        return shade(clear * (1.0 - one.tint) + tinted * one.tint, tone * (1.0 + slant))

    def _goods(self, x: float, z: float, w: float, h: float) -> None:
        for _ in range(5):
            at, wide, high = self.rng.uniform((0.0, 0.2, 0.3), (0.8, 0.6, 0.75))
            view = self.view(x + at * w, z, min(wide, (1.0 - at) * w), high * h)
            view[...] = view * 0.45 + self.rng.uniform(60.0, 225.0, size=3) * 0.55

    def _head(self, one: Opening, x: float, top: float, w: float, kept: Floats) -> None:
        """Put back the wall about a round head."""
        view = self.view(x - one.frame_m, top - one.arch, w + 2 * one.frame_m, one.arch + one.frame_m)
        rows, columns = view.shape[:2]
        across = np.linspace(-1.0, 1.0, columns)
        limit = (1.0 - np.sqrt(np.clip(1.0 - across * across, 0.0, 1.0))) * rows
        outside = np.arange(rows)[:, None] < limit[None, :]
        view[outside] = kept[outside]

    def _before(self, one: Opening, x: float, z: float, w: float, floor: float) -> None:
        """Draw what stands before an opening: bars, or a balcony with the shade below it."""
        if one.rail:
            self.paint(x - 0.05, z + 0.95, w + 0.1, 0.07, one.rail)
            self.view(x - 0.05, z, w + 0.1, 0.95)[:, ::4] = _rgb(one.rail)
        if one.parapet is not None:
            x, w = (x, w) if one.recess else (x - 0.35, w + 0.7)
            self.paint(x, floor - 0.18, w, 1.18, self.colour.tolist() if one.recess else "#d8d5cc")
            self.paint(x, floor, w, 0.95, one.parapet)
            self.paint(x, floor - 0.18, w, 0.08, 0.75)
            self.paint(x, floor - 0.7, w, 0.52, 0.66)


def _rgb(paint: Any) -> Floats:
    return np.array([int(paint[k : k + 2], 16) for k in (1, 3, 5)] if isinstance(paint, str) else paint, dtype=float)


def _plain(colour: Floats, rng: np.random.Generator) -> Floats:
    streaks = value_noise(SIZE, 48, rng, 4)
    return shade(colour, 1.0 + 0.03 * fractal(SIZE, 4, 5, rng) + 0.015 * streaks)


def _brick(colour: Floats, rng: np.random.Generator) -> Floats:
    rows, columns = 84, 44
    y, x = np.mgrid[0:SIZE, 0:SIZE]
    row = y * rows // SIZE
    across = (x * columns / SIZE + 0.5 * (row % 2)) % columns
    tone = 1.0 + 0.13 * rng.uniform(-1, 1, size=(rows, columns))[row, np.floor(across).astype(int)]
    seam = ((y * rows / SIZE) % 1.0 < 0.17) | (across % 1.0 < 0.1)
    return np.where(seam[..., None], colour * 0.55 + 85.0, shade(colour, tone))


def _ribs(colour: Floats, rng: np.random.Generator) -> Floats:
    rib = np.where(np.arange(SIZE) * 32 / SIZE % 1.0 < 0.5, 1.06, 0.86)
    return shade(colour, rib[None, :] * (1.0 + 0.03 * fractal(SIZE, 4, 4, rng)))


def _panels(colour: Floats, rng: np.random.Generator) -> Floats:
    """Slabs of a storey by a bay, each of its own tone."""
    tone = np.kron(rng.uniform(0.93, 1.06, size=(4, 4)), np.ones((SIZE // 4, SIZE // 4)))
    image = shade(colour, tone + 0.025 * fractal(SIZE, 4, 5, rng))
    for k in (0, 1, 2):
        image[k :: SIZE // 4] *= 0.8
        image[:, k :: SIZE // 4] *= 0.8
    return image


def _boards(colour: Floats, rng: np.random.Generator) -> Floats:
    grain = value_noise(SIZE, 64, rng, 8)
    board = rng.uniform(0.88, 1.1, size=64)[np.arange(SIZE) * 64 // SIZE][None, :]
    gap = np.where(np.arange(SIZE) % 8 < 1, 0.72, 1.0)[None, :]
    return shade(colour, board * gap * (1.0 + 0.05 * grain))


_SURFACES = {"plain": _plain, "brick": _brick, "ribs": _ribs, "panels": _panels, "boards": _boards}
