"""A scene's file, `scene_assets/scenes/<scene>.toml`: what plans and imported scenes have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, Field, model_validator

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.portable import unit
from aerialdojo_gen.scenes.light import LightHead, sun_at
from aerialdojo_gen.scenes.materials import read_toml, validated

_MAX_TEXT = 200
Side = Literal["train", "held_out", "plain"]  # Which designs of their categories the things of a scene have
Positive = Annotated[float, Field(gt=0, le=1e6)]
# Ground is cut into cells of a metre or so: larger sites than this take gigabytes, and more than a drone can fly.
Extent = Annotated[float, Field(ge=2, le=1000)]
Height = Annotated[float, Field(gt=0, le=1000)]
Place = Annotated[float, Field(ge=-1e5, le=1e5)]
# Of a foreign file: maps count metres from the equator.
Mapped = Annotated[float, Field(ge=-1e7, le=1e7)]
Colour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]


def _above(sun: tuple[float, float, float]) -> tuple[float, float, float]:
    if sun[2] <= 0.0:
        raise ValueError("the sun must stand above the horizon (z > 0)")
    return sun


_Direction = Annotated[float, Field(ge=-1e6, le=1e6)]
Sun = Annotated[tuple[_Direction, _Direction, _Direction], AfterValidator(_above)]


HorizonKind = Literal[
    "", "none", "city", "town", "suburb", "works", "fields", "woods", "mountains", "alps", "snow", "desert", "canyon",
    "coast", "tropics", "flood",
]  # fmt: skip


class Level(BaseModel, frozen=True, extra="forbid"):
    """A round place that is levelled for what stands on it."""

    at: tuple[Place, Place]  # (x, y); middle, metres, world frame
    radius_m: Annotated[float, Field(ge=0, le=50)] = 0.5
    z_m: Place | None = None  # Height; the mean of the old ones by default
    blend_m: Annotated[float, Field(ge=0, le=50)] = 2.0  # Width of the slope about it


class Move(BaseModel, frozen=True, extra="forbid"):
    """Displacement of one node from where its plan places it."""

    by_m: tuple[Place, Place] = (0.0, 0.0)  # World frame, metres; what stands on the ground keeps its height above it
    up_m: Place = 0.0  # Upwards, metres
    turn_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0  # Counter-clockwise, about its origin
    place: Annotated[str, Field(min_length=1, max_length=_MAX_TEXT)] | None = None


class Origin(BaseModel, frozen=True, extra="forbid"):
    """Geographic position of the origin of a real place's scene."""

    lon_deg: Annotated[float, Field(ge=-180, le=180)] | None = None  # Longitude and latitude, WGS 84
    lat_deg: Annotated[float, Field(ge=-90, le=90)] | None = None
    x_m: Annotated[float, Field(ge=-1e9, le=1e9)] | None = None
    y_m: Annotated[float, Field(ge=-1e9, le=1e9)] | None = None
    z_m: Annotated[float, Field(ge=-1e5, le=1e5)] = 0.0  # The height that is z = 0, metres


class HorizonHead(BaseModel, frozen=True, extra="forbid"):
    """What lies beyond the flight volume."""

    kind: HorizonKind = ""  # The scene type's own where empty
    seed: Annotated[int, Field(ge=-(2**31), lt=2**31)] = 0
    hills_m: Annotated[float, Field(ge=0, le=1000)] | None = None  # Height of the farthest hills; the kind's own
    ground: Annotated[str, Field(max_length=60)] = ""  # Material of the land; that of the scene's edge


class SceneHead(BaseModel, frozen=True, extra="forbid"):
    """What a scene's file says of the scene as a whole."""

    seed: Annotated[int, Field(ge=-(2**31), lt=2**31)] = 0  # Of everything drawn in the scene
    size_m: tuple[Extent, Extent]  # Extent along x and y, metres; the origin lies in the middle
    ceiling_m: Height  # Highest z that a drone may fly at, metres
    # Of the built scene, counter-clockwise; everything else in the file is in the frame before it, but the sun.
    turn_deg: Literal[0, 90, 180, 270] = 0
    sky: Colour = "#96bee6"
    sun: Sun = (0.45, -0.35, 0.82)  # Direction towards the sun, of any length
    light: LightHead = LightHead()
    horizon: HorizonHead = HorizonHead()
    designs: Side = "train"  # Which designs of their categories things have
    palette: dict[str, str] = {}  # Materials by the file's names for them
    inventory: dict[str, Annotated[int, Field(ge=0, le=100_000)]] = {}  # Least number of instances by category
    attribution: Annotated[str, Field(max_length=500)] = ""
    origin: Origin | None = None  # Where on earth that is
    level: Annotated[tuple[Level, ...], Field(max_length=200)] = ()
    moves: Annotated[dict[str, Move], Field(max_length=500)] = {}

    @model_validator(mode="after")
    def _a_real_place_keeps_its_north(self) -> SceneHead:
        if self.origin is not None and self.turn_deg:
            raise ValueError("turn_deg: a real place, with [origin], is not turned")
        return self

    @property
    def sun_direction(self) -> tuple[float, float, float]:
        """Unit vector towards the sun, world frame: of `light` where that says a latitude."""
        light = self.light
        if light.latitude_deg is not None:
            return sun_at(light.latitude_deg, light.date, light.hour)
        x, y, z = unit(np.array(self.sun)).tolist()
        return x, y, z


class Cut(BaseModel, frozen=True, extra="forbid"):
    """A box that a person drew around a thing for which a foreign mesh has no node."""

    node: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_]{0,79}$")  # Of the new node
    category: str = Field(pattern=r"^[a-z0-9][a-z0-9_]{0,59}$")
    low_m: tuple[Place, Place, Place]  # (x, y, z); corners, metres, world frame
    high_m: tuple[Place, Place, Place]


class Imported(BaseModel, frozen=True, extra="forbid"):
    """Source and settings of a scene that ``add-scene`` imported from a mesh."""

    source: str  # Name and digest of the mesh file
    source_sha256: str
    up: Literal["y", "z"]  # The file's axis that pointed up
    scale: Positive  # Metres a unit of the file
    crop_m: tuple[Mapped, Mapped, Positive] | None = None  # The circle that was kept, metres, in the file's axes
    box_m: tuple[Mapped, Mapped, Mapped, Mapped] | None = None  # The rectangle that was kept
    origin_m: tuple[Mapped, Mapped, Mapped] | None = None  # (x, y, z) or None
    ceiling_m: Positive  # Highest z that a drone may fly at, metres
    sky: Colour = "#96bee6"
    sun: Sun = (0.45, -0.35, 0.82)  # (float, float, float); direction towards the sun, of any length
    cuts: Annotated[tuple[Cut, ...], Field(max_length=1000)] = ()


def load_imported(path: Path) -> Imported | None:
    """Read the table ``[imported]`` of a scene's file; None where it is a plan."""
    return imported_of(path, read_toml(path))


def imported_of(path: Path, body: dict[str, Any]) -> Imported | None:
    """Check the table ``[imported]`` of what a scene's file says; None where it is a plan."""
    if "imported" not in body:
        return None
    if set(body) != {"imported"} or not isinstance(body["imported"], dict):
        raise AssetError(f"{path}: a scene is imported or a plan: remove all other keys than [imported]")
    return validated(Imported, body["imported"], f"{path}: imported")
