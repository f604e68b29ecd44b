"""Textures of façades: rows of windows, curtain walls, shopfronts; see `aerialdojo_gen.scenes.materials`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aerialdojo_gen.scenes.noise import Floats, fractal, shade, texture_rng, value_noise

Generator = Callable[[Floats], Floats]
_SIZE = 256
_FRAME = np.array([232.0, 230.0, 224.0])
_DARK_FRAME = np.array([58.0, 60.0, 64.0])


def facade_flats(colour: Floats) -> Floats:
    """Block of flats: 2 by 2 framed windows with sills and curtains, drawn for 6.4 m (a storey of 3.2 m)."""
    rng = texture_rng("facade_flats")
    image = _wall(colour, rng)
    for k, (y, x) in enumerate((y, x) for y in (28, 156) for x in (34, 162)):
        _window(image, rng, y, x, 72, 60, _FRAME, mullions=1, lit=k == 2)
        image[y + 72 : y + 78, x - 5 : x + 65] = colour * 0.72 + 40
    image[:4] *= 0.86
    image[128:132] *= 0.86
    return image


def facade_office(colour: Floats) -> Floats:
    """Office: ribbon windows between bands of the colour, drawn for 7 m (two storeys of 3.5 m)."""
    rng = texture_rng("facade_office")
    image = _wall(colour, rng)
    for y in (30, 158):
        image[y : y + 70] = _glass(rng, 70, _SIZE, 0.9)
        for x in range(0, _SIZE, 64):
            image[y : y + 70, x : x + 4] = _DARK_FRAME
        image[y - 3 : y] = _FRAME * 0.8
        image[y + 70 : y + 73] = colour * 0.7
    return image


def facade_brick(colour: Floats) -> Floats:
    """Brick house front: sash windows under stone lintels, drawn for 6 m (two storeys of 3 m)."""
    rng = texture_rng("facade_brick")
    rows, size = 42, _SIZE
    y, x = np.mgrid[0:size, 0:size]
    row = y * rows // size
    across = (x * 22 / size + 0.5 * (row % 2)) % 22
    tone = 1.0 + 0.13 * rng.uniform(-1, 1, size=(rows, 22))[row, np.floor(across).astype(int)]
    seam = ((y * rows / size) % 1.0 < 0.18) | (across % 1.0 < 0.1)
    image = np.where(seam[..., None], colour * 0.55 + 85.0, shade(colour, tone))
    for top in (26, 154):
        for left in (38, 166):
            image[top - 10 : top, left - 6 : left + 58] = (214.0, 206.0, 190.0)
            _window(image, rng, top, left, 80, 52, _FRAME, mullions=1, lit=False)
            image[top + 38 : top + 42, left : left + 52] = _FRAME
            image[top + 80 : top + 86, left - 6 : left + 58] = (200.0, 192.0, 178.0)
    return image


def facade_industrial(colour: Floats) -> Floats:
    """Factory: ribbed sheet below a band of small panes, drawn for 6 m."""
    rng = texture_rng("facade_industrial")
    x = np.arange(_SIZE) * 16 / _SIZE % 1.0
    image = shade(colour, np.broadcast_to(np.where(x < 0.5, 1.06, 0.86)[None, :], (_SIZE, _SIZE)).copy())
    image *= (1 + 0.03 * fractal(_SIZE, 4, 4, rng))[..., None]
    image[40:104, :] = _glass(rng, 64, _SIZE, 0.8)
    for k in range(0, _SIZE, 32):
        image[40:104, k : k + 3] = _DARK_FRAME
    for k in (40, 70, 101):
        image[k : k + 3] = _DARK_FRAME
    return image


def curtain_wall(colour: Floats) -> Floats:
    """Glass curtain wall tinted by the colour: 4 by 2 panes in thin frames, drawn for 6 m."""
    rng = texture_rng("curtain_wall")
    image = np.empty((_SIZE, _SIZE, 3))
    for y in range(0, _SIZE, 128):
        for x in range(0, _SIZE, 64):
            rise = np.linspace(1.22, 0.82, 128)[:, None]
            tone = rng.uniform(0.88, 1.1) * (rise + 0.03 * value_noise(128, 4, rng)[:, :64])
            image[y : y + 128, x : x + 64] = shade(colour, tone)
            image[y + 100 : y + 128, x : x + 64] *= 0.8
    image[:, np.arange(_SIZE) % 64 < 3] = _DARK_FRAME * 1.3
    image[np.arange(_SIZE) % 128 < 4] = _DARK_FRAME * 1.5
    return image


def glass(colour: Floats) -> Floats:
    """A single pane with slanting reflections, drawn for 2 m."""
    y, x = np.mgrid[0:128, 0:128] / 128.0
    streak = np.sin(2 * np.pi * (x + y)) + 0.5 * np.sin(2 * np.pi * (2 * x + 2 * y) + 1.0)
    return shade(colour, 1.0 + 0.12 * streak)


def shopfront(colour: Floats) -> Floats:
    """Shop window with goods behind it above a plinth of the colour, drawn for 4 m wide and high."""
    rng = texture_rng("shopfront")
    image = _wall(colour, rng)
    image[40:216, 8:248] = _glass(rng, 176, 240, 1.15)
    for _ in range(16):
        x, w = int(rng.integers(12, 216)), int(rng.integers(10, 26))
        h = int(rng.integers(20, 70))
        goods = rng.uniform(60, 225, size=3)
        image[212 - h : 212, x : x + w] = image[212 - h : 212, x : x + w] * 0.45 + goods * 0.55
    for x in (8, 86, 166, 244):
        image[40:216, x : x + 4] = _DARK_FRAME
    image[36:41] = image[214:219] = _DARK_FRAME
    return image


def shutters(colour: Floats) -> Floats:
    """Southern house: shuttered windows in plaster, drawn for 6 m (two storeys of 3 m)."""
    rng = texture_rng("shutters")
    image = _wall(colour, rng)
    for top in (30, 158):
        for left in (44, 172):
            _window(image, rng, top, left, 70, 40, _FRAME, mullions=1, lit=False)
            for x in (left - 22, left + 42):
                image[top : top + 70, x : x + 20] = (72.0, 104.0, 84.0)
                image[top : top + 70 : 5, x : x + 20] *= 0.72
    return image


def _wall(colour: Floats, rng: np.random.Generator) -> Floats:
    grain = rng.uniform(-1, 1, size=(_SIZE, _SIZE))
    return shade(colour, 1.0 + 0.03 * fractal(_SIZE, 4, 4, rng) + 0.025 * grain)


def _glass(rng: np.random.Generator, height: int, width: int, tone: float) -> Floats:
    rise = np.linspace(1.25, 0.75, height)[:, None] * np.ones((1, width))
    panes = rng.uniform(0.85, 1.15, size=8)[np.arange(width) * 8 // width][None, :]
    return shade(np.array([92.0, 116.0, 136.0]) * tone, rise * panes)


def _window(
    image: Floats, rng: np.random.Generator, y: int, x: int, h: int, w: int, frame: Floats, mullions: int, lit: bool
) -> None:
    image[y - 4 : y + h, x - 4 : x + w + 4] = frame
    image[y : y + h - 4, x : x + w] = _glass(rng, h - 4, w, 0.85)
    if lit:
        image[y : y + h - 4, x : x + w] = np.array([226.0, 196.0, 138.0])
    curtain = int(w * rng.uniform(0.12, 0.3))
    image[y : y + h - 4, x : x + curtain] = image[y : y + h - 4, x : x + curtain] * 0.35 + 140.0
    for k in range(1, mullions + 1):
        middle = x + w * k // (mullions + 1)
        image[y : y + h - 4, middle - 2 : middle + 2] = frame


FACADES: dict[str, Generator] = {
    f.__name__: f
    for f in (facade_flats, facade_office, facade_brick, facade_industrial, curtain_wall, glass, shopfront, shutters)
}
