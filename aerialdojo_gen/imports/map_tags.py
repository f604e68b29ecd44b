"""Numbers and colours from OpenStreetMap tags: heights, levels, widths, materials."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from matplotlib.colors import CSS4_COLORS

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.safe_parse import read_toml

Tags = Mapping[str, str]

_NUMBER = re.compile(r"\s*(\d{1,5}(?:\.\d{1,6})?)\s*(m|metres|meters|ft|feet|')?\s*")
_COLOUR = re.compile(r"#(?:[0-9a-fA-F]{3}){1,2}")
_BEARING = re.compile(r"\d{1,3}(?:\.\d{1,6})?")
_POINTS = ("N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW")
_FOOT_M = 0.3048
# What tags become.
TABLES = read_toml(Path(__file__).with_name("map.toml"), AssetError)


def by_word(table: Mapping[str, str]) -> dict[str, str]:
    """Return the keys of a table by each of the words of its values."""
    return {word: key for key, words in table.items() for word in words.split()}


SURFACES = by_word(TABLES["surfaces"])


def metres(tags: Tags, *keys: str) -> float | None:
    """Read a length in metres or feet by the first key that has one; None if none has."""
    for key in keys:
        match = _NUMBER.fullmatch(tags.get(key, "").replace(",", "."))
        if match:
            value = float(match[1]) * (_FOOT_M if match[2] in ("ft", "feet", "'") else 1.0)
            if value > 0.0:
                return value
    return None


def bearing_deg(tags: Tags, *keys: str) -> float | None:
    """Read a bearing, degrees from north or one of 16 compass points; None if no key has one."""
    for key in keys:
        text = tags.get(key, "").strip().upper().removesuffix("°")
        if text in _POINTS:
            return 22.5 * _POINTS.index(text)
        if _BEARING.fullmatch(text) and float(text) <= 360.0:
            return float(text)
    return None


def count(tags: Tags, *keys: str) -> int | None:
    """Read a whole number above 0, rounded; None if no key has one."""
    number = metres(tags, *keys)
    return None if number is None else max(round(number), 1)


def colour(tags: Tags, *keys: str) -> str:
    """Read a colour as ``"#rrggbb"``; empty if there is none."""
    for key in keys:
        text = tags.get(key, "").strip().lower().replace(" ", "").replace("_", "")
        text = str(CSS4_COLORS.get(text, text)).lower()
        if _COLOUR.fullmatch(text):
            return text if len(text) == 7 else "#" + "".join(2 * c for c in text[1:])
    return ""


def below_ground(tags: Tags) -> bool:
    """Whether a thing is in a tunnel, underground or indoors."""
    tunnel = tags.get("tunnel", "no") not in ("no", "building_passage", "avalanche_protector")
    layer = tags.get("layer", "0")
    under = layer.startswith("-") or tags.get("location") in ("underground", "indoor")
    return tunnel or under or tags.get("indoor", "no") != "no" or tags.get("level", "0").startswith("-")
