"""A scene's recipe: `scene_assets/scenes/<scene>.toml`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
import pydantic_core
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from aerialdojo_gen.common.explain import explain
from aerialdojo_gen.errors import AssetError, brief
from aerialdojo_gen.scenes.materials import read_toml

Model = TypeVar("Model", bound=BaseModel)
# Of a layout's parameters: metres, degrees and counts all stay far below.
_LARGEST, _MOST_ENTRIES, _LONGEST = 2000.0, 1000, 200
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


class Level(BaseModel):
    """A round place that is levelled for what stands on it.

    Attributes
    ----------
    at : (x, y)
        Middle, metres, world frame.
    radius_m : float
        Of what is level; the ground about it slopes back to its old height.
    z_m : float or None
        Height; the mean of the old ones by default.
    blend_m : float
        Width of the slope about it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    at: tuple[Place, Place]
    radius_m: Annotated[float, Field(ge=0, le=50)] = 0.5
    z_m: Place | None = None
    blend_m: Annotated[float, Field(ge=0, le=50)] = 2.0


class Move(BaseModel):
    """How far one node stands from where its layout puts it.

    Attributes
    ----------
    by_m : (dx, dy)
        World frame, metres; what stands on the ground keeps its height above it.
    up_m : float
        Upwards, metres.
    turn_deg : float
        Counter-clockwise, about its origin.
    place : str or None
        What descriptions say of where it is now; what the layout says by default.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    by_m: tuple[Place, Place] = (0.0, 0.0)
    up_m: Place = 0.0
    turn_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0
    place: Annotated[str, Field(min_length=1, max_length=_LONGEST)] | None = None


class Origin(BaseModel):
    """Where the origin of a real place's scene lies.

    Attributes
    ----------
    lon_deg, lat_deg : float or None
        Longitude and latitude, WGS 84.
    x_m, y_m : float or None
        In the metres of the model that its heights are from, where that does not say where on earth they are.
    z_m : float
        The height that is z = 0, metres.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    lon_deg: Annotated[float, Field(ge=-180, le=180)] | None = None
    lat_deg: Annotated[float, Field(ge=-90, le=90)] | None = None
    x_m: Annotated[float, Field(ge=-1e9, le=1e9)] | None = None
    y_m: Annotated[float, Field(ge=-1e9, le=1e9)] | None = None
    z_m: Annotated[float, Field(ge=-1e5, le=1e5)] = 0.0


class Recipe(BaseModel):
    """What a scene is made from.

    Attributes
    ----------
    layout : str
        Type of `aerialdojo_gen.layouts`.
    seed : int
        Of everything drawn in the scene.
    size_m : (float, float)
        Extent along x and y, metres; the origin lies in the middle.
    ceiling_m : float
        Highest z that a drone may fly at, metres.
    sky : str
        ``"#rrggbb"``.
    sun : (float, float, float)
        Direction towards the sun, of any length.
    palette : dict of str to str
        Materials by the layout's names for them.
    parameters : dict
        The layout's own.
    inventory : dict of str to int
        Least number of instances of a category that the built scene must have.
    attribution : str
        Whose data the scene is made of, and under which licence, where it is of a real place.
    origin : Origin or None
        Where on earth that is.
    level : tuple of Level
        Places levelled in the layout's ground, in their order.
    moves : dict of str to Move
        Props that stand elsewhere than the layout puts them, by node; whatever else it places stays where it is.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    layout: str
    seed: Annotated[int, Field(ge=-(2**31), lt=2**31)] = 0
    size_m: tuple[Extent, Extent]
    ceiling_m: Height
    sky: Colour = "#96bee6"
    sun: Sun = (0.45, -0.35, 0.82)
    palette: dict[str, str] = {}
    parameters: dict[str, Any] = {}
    inventory: dict[str, Annotated[int, Field(ge=0, le=100_000)]] = {}
    attribution: Annotated[str, Field(max_length=500)] = ""
    origin: Origin | None = None
    level: Annotated[tuple[Level, ...], Field(max_length=200)] = ()
    moves: Annotated[dict[str, Move], Field(max_length=500)] = {}

    @property
    def sun_direction(self) -> tuple[float, float, float]:
        """Unit vector towards the sun, world frame."""
        x, y, z = np.array(self.sun) / np.linalg.norm(self.sun)
        return float(x), float(y), float(z)


class Cut(BaseModel):
    """A box that a person drew around a thing for which a foreign mesh has no node.

    Attributes
    ----------
    node, category : str
        Of the new node.
    low_m, high_m : (x, y, z)
        Corners, metres, world frame.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    node: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_]{0,79}$")
    category: str = Field(pattern=r"^[a-z0-9][a-z0-9_]{0,59}$")
    low_m: tuple[Place, Place, Place]
    high_m: tuple[Place, Place, Place]


class Imported(BaseModel):
    """Where a scene comes from that ``add-scene`` made of a mesh, and what may still be set of it.

    Attributes
    ----------
    source, source_sha256 : str
        Name and digest of the mesh file.
    up : str
        The file's axis that pointed up.
    scale : float
        Metres a unit of the file.
    crop_m : (x, y, radius) or None
        The circle that was kept, metres, in the file's axes.
    box_m : (x0, y0, x1, y1) or None
        The rectangle that was kept.
    origin_m : (x, y, z) or None
        Where the scene's origin lies in the file's axes, after `up` and `scale`, metres; equal in tiles of a place.
    ceiling_m : float
        Highest z that a drone may fly at, metres.
    sky : str
        ``"#rrggbb"``.
    sun : (float, float, float)
        Direction towards the sun, of any length.
    cuts : tuple of Cut
        Things that people boxed out of it, with the annotation tool.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    source: str
    source_sha256: str
    up: Literal["y", "z"]
    scale: Positive
    crop_m: tuple[Mapped, Mapped, Positive] | None = None
    box_m: tuple[Mapped, Mapped, Mapped, Mapped] | None = None
    origin_m: tuple[Mapped, Mapped, Mapped] | None = None
    ceiling_m: Positive
    sky: Colour = "#96bee6"
    sun: Sun = (0.45, -0.35, 0.82)
    cuts: Annotated[tuple[Cut, ...], Field(max_length=1000)] = ()


def load_imported(path: Path) -> Imported | None:
    """Read the table ``[imported]`` of a recipe; None where it is a recipe with a layout."""
    body = read_toml(path)
    if "imported" not in body:
        return None
    if set(body) != {"imported"} or not isinstance(body["imported"], dict):
        raise AssetError(f"{path}: a scene is imported or has a layout: nothing may stand beside [imported]")
    return validated(Imported, body["imported"], f"{path}: imported")


def load_recipe(path: Path) -> Recipe:
    """Read a recipe; an `AssetError` names the file, the key, and the nearest known key."""
    body = read_toml(path)
    recipe = validated(Recipe, body, str(path))
    _check_parameters(recipe.parameters, (), path)
    return recipe


def _check_parameters(value: Any, keys: tuple[str, ...], path: Path) -> None:
    """Hold whatever a layout takes against bounds, before it becomes a count of things, a length or an array."""
    where = f"{path}: parameters: {brief('.'.join(keys))}"
    if isinstance(value, dict | list):
        if len(value) > _MOST_ENTRIES:
            raise AssetError(f"{where} has {len(value):,} entries, {_MOST_ENTRIES:,} are the most")
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            _check_parameters(inner, (*keys, str(key)), path)
    elif isinstance(value, int | float) and abs(value) > _LARGEST:
        raise AssetError(f"{where} must lie within {_LARGEST:,.0f}, got {value:g}")
    elif isinstance(value, str) and len(value) > _LONGEST:
        raise AssetError(f"{where} has {len(value):,} characters, {_LONGEST} are the most")


def validated(model: type[Model], body: dict[str, Any], where: str) -> Model:
    """Check a table against its model, a number a number; an `AssetError` says what is wrong at which key."""
    try:
        # As JSON, because only there a list is a strict tuple: "nan" and false are numbers to a lenient model.
        return model.model_validate_json(pydantic_core.to_json(body), strict=True)
    except ValidationError as error:
        raise AssetError(f"{where}: {'; '.join(explain(error, model))}") from error
