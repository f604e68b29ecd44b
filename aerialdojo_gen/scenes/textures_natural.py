"""Textures of ground, plants, rock, wood and water; see `aerialdojo_gen.scenes.materials`."""

from __future__ import annotations

import numpy as np

from aerialdojo_gen.scenes.noise import Floats, Texture, cells, fractal, leaves, shade, value_noise


def grass(colour: Floats, rng: np.random.Generator) -> Floats:
    """Lawn: short blades in clumps, drawn for 4 m."""
    clumps = fractal(256, 12, 3, rng, 0.7)
    blades = value_noise(256, 128, rng, 64) + value_noise(256, 64, rng, 128)
    image = shade(colour, 1.0 + 0.045 * clumps + 0.17 * blades)
    image[..., 0] += 6.0 * clumps
    return image


def meadow(colour: Floats, rng: np.random.Generator) -> Floats:
    """Rough grass with dry tufts and small flowers, drawn for 4 m."""
    image = shade(colour, 1.0 + 0.12 * fractal(256, 8, 4, rng, 0.8))
    dry = np.clip(fractal(256, 5, 3, rng) - 0.6, 0, 1)[..., None]
    image = image * (1 - 0.5 * dry) + np.array([168.0, 154.0, 90.0]) * 0.5 * dry
    for tint in ((235, 225, 120), (240, 240, 235)):
        y, x = rng.integers(0, 256, size=(2, 55))
        image[y, x] = tint
        image[y, (x + 1) % 256] = tint
    return image


def dirt(colour: Floats, rng: np.random.Generator) -> Floats:
    """Trodden earth with small stones, drawn for 4 m."""
    image = shade(colour, 1.0 + 0.09 * fractal(256, 5, 5, rng, 0.65))
    return _pebbles(image, rng, 260, 0.012, 0.25)


def gravel(colour: Floats, rng: np.random.Generator) -> Floats:
    """Loose stones, drawn for 2 m."""
    first, second, owner = cells(256, 2600, rng)
    tone = rng.uniform(0.84, 1.14, size=2600)[owner]
    joint = np.clip((second - first) / 0.006, 0.66, 1.0)
    warm = rng.uniform(-6, 6, size=2600)[owner]
    image = shade(colour, tone * joint)
    image[..., 0] += warm
    image[..., 2] -= warm
    return image


def sand(colour: Floats, rng: np.random.Generator) -> Floats:
    """Sand with wind ripples, drawn for 3 m."""
    warp = value_noise(256, 4, rng) * 0.35 + value_noise(256, 8, rng) * 0.15
    y = np.arange(256)[:, None] / 256
    ripples = np.sin(2 * np.pi * (8 * y + warp))
    grain = rng.uniform(-1, 1, size=(256, 256))
    return shade(colour, 1.0 + 0.05 * ripples + 0.035 * grain + 0.03 * fractal(256, 4, 3, rng))


def snow(colour: Floats, rng: np.random.Generator) -> Floats:
    """Snow with soft drifts and a little glitter, drawn for 5 m."""
    drift = fractal(256, 4, 4, rng, 0.45)
    image = shade(colour, 0.97 + 0.028 * drift + 0.01 * rng.uniform(-1, 1, size=(256, 256)))
    image[..., 2] += 3.0 * np.clip(-drift, 0, 2)
    return image


def rock(colour: Floats, rng: np.random.Generator) -> Floats:
    """Weathered rock with lichen and fine cracks, drawn for 2 m."""
    base = fractal(256, 5, 6, rng, 0.7)
    bands = value_noise(256, 3, rng, 18)
    ridge = np.abs(fractal(256, 7, 4, rng, 0.6))
    crack = np.clip(ridge / 0.05, 0.78, 1.0)
    image = shade(colour, (1.0 + 0.13 * base + 0.07 * bands) * crack)
    lichen = np.clip(fractal(256, 9, 4, rng) - 1.2, 0, 0.6)[..., None]
    return image * (1 - lichen) + (colour * 0.6 + np.array([78.0, 80.0, 60.0])) * lichen


def bark(colour: Floats, rng: np.random.Generator) -> Floats:
    """Upright ridges of bark, drawn for 1 m."""
    warp = value_noise(128, 4, rng) * 0.8 + value_noise(128, 8, rng) * 0.3
    x = np.arange(128)[None, :] / 128
    ridges = np.sin(2 * np.pi * (10 * x + warp)) + 0.6 * value_noise(128, 16, rng, 6)
    breaks = value_noise(128, 12, rng, 24)
    return shade(colour, 1.0 + 0.2 * ridges + 0.1 * breaks)


def birch_bark(colour: Floats, rng: np.random.Generator) -> Floats:
    """White bark with dark level scars, drawn for 1 m."""
    image = shade(colour, 1.0 + 0.05 * value_noise(128, 8, rng, 32))
    for _ in range(34):
        y, x, w = int(rng.integers(128)), int(rng.integers(128)), int(rng.integers(6, 30))
        h = int(rng.integers(1, 4))
        rows, columns = (y + np.arange(h)) % 128, (x + np.arange(w)) % 128
        image[np.ix_(rows, columns)] *= rng.uniform(0.2, 0.45)
    return image


def foliage(colour: Floats, rng: np.random.Generator) -> Floats:
    """Leaves, lit above and dark between, drawn for 2 m."""
    depth = np.clip(0.55 + 0.12 * fractal(256, 8, 3, rng), 0.35, 0.8)
    tints = np.array([[1.0, 1.0, 1.0], [1.15, 1.1, 0.85], [0.82, 0.9, 0.9], [0.7, 0.82, 0.75], [1.25, 1.18, 0.8]])
    return leaves(shade(colour, depth), "foliage leaves", 900, (9.0, 17.0), colour * tints)


def needles(colour: Floats, rng: np.random.Generator) -> Floats:
    """Conifer twigs: fine hanging strokes, drawn for 1.5 m."""
    strokes = value_noise(256, 128, rng, 20) + 0.7 * value_noise(256, 64, rng, 40)
    tiers = np.sin(2 * np.pi * (5 * np.arange(256)[:, None] / 256 + 0.2 * value_noise(256, 6, rng)))
    return shade(colour, np.clip(1.0 + 0.26 * strokes + 0.16 * tiers, 0.4, 1.6))


def leaf_litter(colour: Floats, rng: np.random.Generator) -> Floats:
    """Forest floor: fallen leaves, twigs and moss on earth, drawn for 3 m."""
    image = shade(colour * 0.82, 1.0 + 0.13 * fractal(256, 8, 5, rng, 0.75))
    tints = np.array([[1.2, 1.05, 0.9], [0.85, 0.84, 0.85], [1.32, 1.0, 0.7], [1.05, 1.12, 0.8], [0.7, 0.68, 0.7]])
    image = leaves(image, "fallen leaves", 1300, (5.0, 10.0), colour * tints)
    green = np.clip(fractal(256, 10, 3, rng) - 0.9, 0, 0.7)[..., None]
    return image * (1 - 0.6 * green) + colour * np.array([0.72, 1.05, 0.6]) * 0.6 * green


def moss(colour: Floats, rng: np.random.Generator) -> Floats:
    """Moss cushions, drawn for 2 m."""
    lumps = fractal(256, 12, 4, rng, 0.7)
    return shade(colour, np.clip(1.0 + 0.15 * lumps, 0.5, 1.5))


def water(colour: Floats, rng: np.random.Generator) -> Floats:
    """Small waves with bright crests, drawn for 6 m."""
    wave = fractal(256, 5, 4, rng, 0.55)
    crest = np.clip(1.0 - np.abs(wave) / 0.25, 0.0, 1.0)
    foam = np.clip(fractal(256, 9, 3, rng) - 1.1, 0, 1)
    return shade(colour, 1.0 + 0.09 * wave + 0.16 * crest) + 60.0 * (foam * crest)[..., None]


def mud(colour: Floats, rng: np.random.Generator) -> Floats:
    """Wet silt with small puddles, drawn for 4 m."""
    base = fractal(256, 8, 6, rng, 0.8)
    puddle = np.clip((fractal(256, 7, 4, rng, 0.45) - 1.1) * 3, 0, 1)[..., None]
    image = shade(colour, 1.0 + 0.1 * base + 0.03 * rng.uniform(-1, 1, size=(256, 256)))
    return image * (1 - 0.55 * puddle) + (colour * 0.4 + np.array([78.0, 84.0, 90.0])) * 0.55 * puddle


def rubble(colour: Floats, rng: np.random.Generator) -> Floats:
    """Broken masonry in dust, drawn for 3 m."""
    first, second, owner = cells(256, 420, rng)
    # Every lump is lit from one side, as if it lay tilted.
    tilt = np.gradient(first)
    lean = rng.uniform(-1, 1, size=(420, 2))
    light = 1.0 + 18.0 * (tilt[0] * lean[owner, 0] + tilt[1] * lean[owner, 1])
    tone = rng.uniform(0.72, 1.2, size=420)[owner] * np.clip(light, 0.75, 1.25)
    edge = np.clip((second - first) / 0.012, 0.68, 1.0)
    image = shade(colour, tone * edge * (1 + 0.08 * fractal(256, 16, 4, rng, 0.7)))
    brick = (rng.uniform(size=420) < 0.13)[owner][..., None]
    image = np.where(brick, image * np.array([0.98, 0.62, 0.52]), image)
    dust = np.clip(0.5 + 0.5 * fractal(256, 9, 4, rng), 0, 1)[..., None]
    return image * (1 - 0.6 * dust) + colour * 0.6 * dust * (1 + 0.06 * fractal(256, 32, 3, rng))[..., None]


def thatch(colour: Floats, rng: np.random.Generator) -> Floats:
    """Straw or reed laid in courses, drawn for 1.5 m."""
    straw = value_noise(128, 64, rng, 8) + value_noise(128, 32, rng, 16)
    course = (np.arange(128)[:, None] * 4 / 128) % 1.0
    return shade(colour, np.clip(0.78 + 0.3 * course + 0.14 * straw, 0.4, 1.5))


def _pebbles(image: Floats, rng: np.random.Generator, count: int, radius: float, contrast: float) -> Floats:
    first, _, owner = cells(len(image), count, rng)
    tone = 1.0 + contrast * rng.uniform(-1, 1, size=count)[owner]
    size = radius * rng.uniform(0.3, 1.2, size=count)[owner]
    return np.where((first < size)[..., None], image * tone[..., None], image)


NATURAL: dict[str, Texture] = {
    f.__name__: f
    for f in (grass, meadow, dirt, gravel, sand, snow, rock, bark, birch_bark, foliage, needles, leaf_litter, moss,
              water, mud, rubble, thatch)
}  # fmt: skip
