"""Textures of masonry, paving, roofs, metal, glass and cloth; see `aerialdojo_gen.scenes.materials`."""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.scenes.noise import Floats, Texture, fractal, shade, texture_rng, value_noise

_LIGHT = np.array([205.0, 198.0, 188.0])


def cobbles(colour: Floats, rng: np.random.Generator) -> Floats:
    """Cobblestones, drawn for 1.5 m."""
    y, x = np.mgrid[0:256, 0:256] / 32.0
    row = np.floor(y)
    across = x + 0.5 * (row % 2) + 0.12 * value_noise(256, 8, rng)
    up = y + 0.1 * value_noise(256, 8, rng)
    column, row = np.floor(across).astype(int) % 8, np.floor(up).astype(int) % 8
    tone = rng.uniform(0.82, 1.15, size=(8, 8))[row, column]
    dome = (((across % 1.0 - 0.5) ** 2) ** 2 + ((up % 1.0 - 0.5) ** 2) ** 2) * 16.0
    return shade(colour, tone * np.clip(1.08 - 0.7 * dome, 0.5, 1.08) * (1 + 0.04 * fractal(256, 16, 3, rng)))


def asphalt(colour: Floats, rng: np.random.Generator) -> Floats:
    """Asphalt with grit and faint repairs, drawn for 4 m."""
    grit = rng.uniform(-1, 1, size=(256, 256)) + value_noise(256, 128, rng)
    stains = fractal(256, 3, 4, rng)
    ridge = np.abs(fractal(256, 3, 4, rng))
    crack = np.where(ridge < 0.025, 0.82, 1.0)
    return shade(colour, (1.0 + 0.09 * grit + 0.05 * stains) * crack)


def concrete(colour: Floats, rng: np.random.Generator) -> Floats:
    """Cast concrete with form joints and tie holes, drawn for 3 m."""
    value = 1.0 + 0.035 * fractal(256, 4, 5, rng) + 0.03 * rng.uniform(-1, 1, size=(256, 256))
    value[:, :2] *= 0.82
    value[:2] *= 0.82
    for y in (64, 192):
        for x in (64, 192):
            value[y - 2 : y + 2, x - 2 : x + 2] *= 0.72
    return shade(colour, value)


def plaster(colour: Floats, rng: np.random.Generator) -> Floats:
    """Rendered wall with soft stains, drawn for 3 m."""
    streaks = value_noise(256, 24, rng, 3)
    grain = rng.uniform(-1, 1, size=(256, 256))
    return shade(colour, 1.0 + 0.025 * fractal(256, 4, 5, rng) + 0.02 * streaks + 0.02 * grain)


def planks(colour: Floats, rng: np.random.Generator) -> Floats:
    """Level boards with grain, 8 to a tile, drawn for 1.2 m."""
    grain = value_noise(256, 6, rng, 128) + 0.6 * value_noise(256, 12, rng, 64)
    value = 1.0 + 0.09 * grain
    for k in range(8):
        rows = slice(k * 32, k * 32 + 32)
        value[rows] *= rng.uniform(0.82, 1.12)
        value[k * 32 : k * 32 + 3] *= 0.5
        end = int(rng.integers(256))
        value[rows, end : end + 2] *= 0.6
    return shade(colour, value)


def boards(colour: Floats, _rng: np.random.Generator) -> Floats:
    """Upright boards with grain, 8 to a tile, drawn for 1.2 m."""
    return np.ascontiguousarray(planks(colour, texture_rng("planks")).transpose(1, 0, 2))


def logs(colour: Floats, rng: np.random.Generator) -> Floats:
    """Stacked round logs of a cabin wall, 4 to a tile, drawn for 1 m."""
    t = (np.arange(128)[:, None] * 4 / 128) % 1.0
    round_ = np.sqrt(np.clip(1.0 - (2 * t - 1) ** 2, 0.05, 1.0))
    grain = value_noise(128, 5, rng, 64)
    return shade(colour, (0.45 + 0.62 * round_) * (1 + 0.09 * grain))


def roof_tiles(colour: Floats, rng: np.random.Generator) -> Floats:
    """Rounded tiles in overlapping courses, 8 by 8, drawn for 2 m."""
    y, x = np.mgrid[0:256, 0:256] / 32.0
    course = np.floor(y)
    shift = x + 0.5 * (course % 2)
    tone = rng.uniform(0.82, 1.14, size=(8, 8))[course.astype(int) % 8, np.floor(shift).astype(int) % 8]
    arch = 0.72 + 0.36 * np.sin(np.pi * (shift % 1.0))
    lip = 0.62 + 0.45 * np.clip((1.0 - y % 1.0) * 3.0, 0, 1)
    return shade(colour, tone * arch * lip)


def corrugated(colour: Floats, rng: np.random.Generator) -> Floats:
    """Upright ribs of sheet metal, 8 to a tile, drawn for 2.4 m."""
    x = np.arange(128) * 8 / 128 % 1.0
    ribs = np.interp(x, [0, 0.1, 0.42, 0.52, 0.9, 1.0], [0.78, 1.1, 1.1, 0.66, 0.66, 0.78])
    rust = np.clip(value_noise(128, 20, rng, 3) - 0.75, 0, 1)
    return shade(colour, ribs[None, :] * (1 + 0.03 * fractal(128, 4, 4, rng)) * (1 - 0.5 * rust))


def metal(colour: Floats, rng: np.random.Generator) -> Floats:
    """Brushed metal plates with seams, drawn for 2 m."""
    value = 1.0 + 0.05 * value_noise(128, 8, rng, 128) + 0.02 * fractal(128, 4, 3, rng)
    value[:2] *= 0.72
    value[2:3] *= 1.15
    value[:, :2] *= 0.78
    return shade(colour, value)


def rust(colour: Floats, rng: np.random.Generator) -> Floats:
    """Rusted steel in flakes, drawn for 2 m."""
    f = fractal(256, 5, 5, rng, 0.65)
    mix = np.clip(0.5 + 0.5 * fractal(256, 4, 5, rng), 0, 1)[..., None]
    return shade(colour, 1 + 0.12 * f) * (1 - 0.55 * mix) + np.array([104.0, 62.0, 42.0]) * 0.55 * mix


def fabric(colour: Floats, rng: np.random.Generator) -> Floats:
    """Woven cloth with soft folds, drawn for 1 m."""
    y, x = np.mgrid[0:128, 0:128]
    weave = np.where((x // 2 + y // 2) % 2 == 0, 1.06, 0.93)
    return shade(colour, weave * (1.0 + 0.08 * value_noise(128, 6, rng, 2)))


def stripes(colour: Floats, rng: np.random.Generator) -> Floats:
    """Awning stripes, the colour and cream, 4 pairs to a tile, drawn for 2 m."""
    band = (np.arange(128) * 8 // 128) % 2 == 0
    base = np.where(band[None, :, None], colour, np.array([242.0, 236.0, 222.0]))
    return np.asarray(base * (1 + 0.03 * value_noise(128, 32, rng))[..., None])


def hazard(colour: Floats, _rng: np.random.Generator) -> Floats:
    """Diagonal warning stripes, the colour and black, drawn for 1 m."""
    y, x = np.mgrid[0:128, 0:128]
    band = ((x + y) * 4 // 128) % 2 == 0
    return np.where(band[..., None], colour, np.array([32.0, 32.0, 34.0]))


def checker(colour: Floats, _rng: np.random.Generator) -> Floats:
    """Chequerboard of the colour and near-white, 8 by 8, drawn for 4 m."""
    y, x = np.mgrid[0:128, 0:128] // 16
    return np.where(((x + y) % 2 == 0)[..., None], colour, np.array([238.0, 236.0, 230.0]))


def chain_link(colour: Floats, _rng: np.random.Generator) -> Floats:
    """Diamond wire mesh over a darker ground, drawn for 0.8 m."""
    y, x = np.mgrid[0:128, 0:128] / 16.0
    wire = np.minimum(np.abs((x + y) % 1.0 - 0.5), np.abs((x - y) % 1.0 - 0.5)) * 2
    return np.where((wire < 0.22)[..., None], colour, colour * 0.42 + 14.0)


def glass(colour: Floats, _rng: np.random.Generator) -> Floats:
    """A single pane with slanting reflections, drawn for 2 m."""
    y, x = np.mgrid[0:128, 0:128] / 128.0
    streak = np.sin(2 * np.pi * (x + y)) + 0.5 * np.sin(2 * np.pi * (2 * x + 2 * y) + 1.0)
    return shade(colour, 1.0 + 0.12 * streak)


def _courses(
    colour: Floats, rng: np.random.Generator, rows: int, columns: int, joint: int, mortar: Floats, spread: float
) -> Floats:
    size = 256
    y, x = np.mgrid[0:size, 0:size]
    row = y * rows // size
    across = (x * columns / size + 0.5 * (row % 2)) % columns
    column = np.floor(across).astype(int)
    tone = 1.0 + spread * rng.uniform(-1, 1, size=(rows, columns))[row, column]
    local_y = y - row * size / rows
    seam = (local_y < joint) | ((across - column) * size / columns < joint)
    edge = (local_y < joint + 2) & ~seam
    value = tone * (1 + 0.05 * fractal(size, 16, 3, rng)) * np.where(edge, 1.1, 1.0)
    image = shade(colour, value)
    joints = shade(mortar, 1 + 0.06 * rng.uniform(-1, 1, size=(size, size)))
    return np.where(seam[..., None], joints, image)


def _slabs(
    colour: Floats, rng: np.random.Generator, size: int, count: int, joint: int, spread: float, dark: float
) -> Floats:
    y, x = np.mgrid[0:size, 0:size]
    step = size // count
    tone = 1.0 + spread * rng.uniform(-1, 1, size=(count, count))[y // step, x // step]
    seam = (y % step < joint) | (x % step < joint)
    value = tone * (1 + 0.03 * fractal(size, 8, 4, rng))
    return shade(colour, np.where(seam, dark, value))


BUILT: dict[str, Texture] = {
    # Running bond with mortar joints for 1 m, ashlar or concrete blocks for 1.6 m, slabs for 2 m, glazed tiles for
    # 1.2 m, and flat shingles for 2 m.
    "brick": lambda colour, rng: _courses(colour, rng, 8, 4, 3, _LIGHT * 0.92, 0.13),
    "blocks": lambda colour, rng: _courses(colour, rng, 4, 2, 3, colour * 0.66, 0.07),
    "paving": lambda colour, rng: _slabs(colour, rng, 256, 4, 3, 0.10, 0.66),
    "tiles": lambda colour, rng: _slabs(colour, rng, 128, 8, 1, 0.05, 0.72),
    "shingles": lambda colour, rng: _courses(colour, rng, 10, 6, 2, colour * 0.5, 0.16),
} | {
    f.__name__: f
    for f in (cobbles, asphalt, concrete, plaster, planks, boards, logs, roof_tiles, corrugated, metal, rust, glass,
              fabric, stripes, hazard, checker, chain_link)
}  # fmt: skip
