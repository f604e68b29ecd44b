"""The light of a scene: where the sun stands by latitude, date and hour, and what the weather makes of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import date
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, Field, field_validator, model_validator

from aerialdojo_gen.base import rng

Weather = Literal["clear", "overcast", "haze", "dusk", "wet"]
WEATHERS: tuple[Weather, ...] = ("clear", "overcast", "haze", "dusk", "wet")
# Lights that a user may choose: the scene's own, one of the weathers, or one drawn.
OWN, RANDOM = "scene", "random"
LIGHTS = (OWN, *WEATHERS, RANDOM)
Sun = tuple[float, float, float]
_TILT_DEG = 23.44
# At dusk the sun is at most so high; a drawn sun stands between these.
_DUSK_DEG, _LOWEST_DEG, _HIGHEST_DEG = 7.0, 12.0, 65.0


class LightHead(BaseModel, frozen=True, extra="forbid"):
    """The table ``[light]`` of a plan: when and where on earth it is, and the weather."""

    latitude_deg: Annotated[float, Field(ge=-90, le=90)] | None = None
    date: Annotated[str, Field(pattern=r"^[0-9]{2}-[0-9]{2}$")] = "06-21"  # Month and day
    hour: Annotated[float, Field(ge=0, le=24)] = 10.0  # Solar time
    weather: Weather = "clear"

    @field_validator("date")
    @classmethod
    def _in_the_calendar(cls, value: str) -> str:
        day_of_year(value)
        return value

    @model_validator(mode="after")
    def _by_day(self) -> LightHead:
        if self.latitude_deg is not None and sun_at(self.latitude_deg, self.date, self.hour)[2] <= 0.0:
            raise ValueError("at this latitude, date and hour the sun is below the horizon")
        return self


def day_of_year(text: str) -> int:
    """Number of a day, ``"06-21"``, in a common year."""
    month, day = (int(part) for part in text.split("-"))
    return date(2026, month, day).timetuple().tm_yday


def sun_at(latitude_deg: float, day: str, hour: float) -> Sun:
    """Unit vector towards the sun (x east, y north, z up) at a solar time of a day, ``"06-21"``."""
    latitude, turn = math.radians(latitude_deg), math.radians(15.0 * (hour - 12.0))
    tilt = -math.radians(_TILT_DEG) * math.cos(2.0 * math.pi * (day_of_year(day) + 10) / 365.0)
    x = -math.cos(tilt) * math.sin(turn)
    y = math.cos(latitude) * math.sin(tilt) - math.sin(latitude) * math.cos(tilt) * math.cos(turn)
    z = math.sin(latitude) * math.sin(tilt) + math.cos(latitude) * math.cos(tilt) * math.cos(turn)
    return x, y, z


@dataclass(frozen=True)
class Light:
    """What lights a scene."""

    sun: Sun  # Towards the sun, world frame
    weather: Weather = "clear"


def chosen_light(own: Light, name: str, seed: int = 0, *key: object) -> Light:
    """Give the light of a name: the scene's own, a weather under the scene's sun, or one drawn by seed and key."""
    if name == OWN:
        return own
    if name == RANDOM:
        draws = rng.generator(seed, "light", *key)
        azimuth = draws.uniform(0.0, 2.0 * math.pi)
        elevation = math.radians(draws.uniform(_LOWEST_DEG, _HIGHEST_DEG))
        weather = WEATHERS[int(draws.integers(len(WEATHERS)))]
        flat = math.cos(elevation)
        own = Light((flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)), weather)
    else:
        own = Light(own.sun, next(weather for weather in WEATHERS if weather == name))
    return Light(_lowered(own.sun), own.weather) if own.weather == "dusk" else own


def _lowered(sun: Sun) -> Sun:
    """Bring the sun down to dusk, in the same direction."""
    (x, y, z), most = sun, math.tan(math.radians(_DUSK_DEG))
    flat = float(np.hypot(x, y))
    x, y, z = (x, y, min(z, flat * most)) if flat > 1e-6 else (1.0, 0.0, most)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length
