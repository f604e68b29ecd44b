"""What a scene type may hold, as data: `scene_assets/types/<type>.toml`."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.light import Weather
from aerialdojo_gen.scenes.materials import validated

Range = tuple[float, float]
Weights = Annotated[dict[str, Annotated[float, Field(gt=0)]], Field(min_length=1)]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Knob(_Strict):
    """A quantity of a world that a seed draws and a user may set."""

    low: float
    high: float
    whole: bool = False  # Whether it is an integer
    about: str  # One line for the page of worlds

    @model_validator(mode="after")
    def _ordered(self) -> Knob:
        if self.low > self.high:
            raise ValueError("low must not be above high")
        return self


class Ring(_Strict):
    """Slots about the middle of a place."""

    slots: str  # Their kind
    number: Annotated[int, Field(ge=1, le=40)] = 1
    away_m: Range = (0.0, 0.0)  # How far from the middle
    room_m: Range = (3.0, 3.0)


class Place(_Strict):
    """A round level place in open country, such as a camp or a yard, with what belongs to it."""

    radius_m: Annotated[float, Field(gt=0)]
    rings: list[Ring]


class Topology(_Strict):
    """One arrangement of a type."""

    about: str
    places: list[str] = []  # Places of the type that it has
    horizon: str = ""  # Kind of the country beyond, where that is not the type's
    held_out: bool = False  # Used by worlds of ``--held-out`` alone
    size_m: tuple[Range, Range] | None = None  # In place of the type's


class Palette(_Strict):
    """Colours and materials of one look of a type, its season among them."""

    held_out: bool = False
    sky: list[str] = []  # Colours; of several, a world draws one
    weather: list[Weather] = ["clear"]
    materials: dict[str, str | list[str]]  # By role; of several, a world or a house draws one


class Slots(_Strict):
    """What may stand at the places of one kind."""

    of: Weights  # Categories, ``category`` or ``category:variant``, and how often they come
    held_out: list[str] = []  # Of these, those of ``--held-out`` alone
    most: Annotated[int, Field(ge=1)] = 3  # Instances of a category at these slots of a world
    share: Range = (0.6, 1.0)  # Of the slots, how many are filled
    sure: bool = False  # Whether there is room where they are offered, as on walls and between parapets


class Life(_Strict):
    """People and animals of a type: arguments of the builder ``life``, from least to most."""

    people: tuple[int, int]
    who: Annotated[list[str], Field(min_length=1)]
    animals: dict[str, tuple[int, int]] = {}
    birds: dict[str, tuple[int, int]] = {}
    ground: list[str] = []  # Materials that they stand on, where these are not the builder's own
    decks: list[str] = []  # Categories of structures on which people stand too


class SceneType(_Strict):
    """A scene type."""

    about: str  # One line for the page of worlds
    size_m: tuple[Range, Range]
    ceiling_m: Range
    turns: bool = False  # Whether a world may lie any way round: what is laid out always runs along x, or faces south
    topologies: Annotated[dict[str, Topology], Field(min_length=4)]
    knobs: dict[str, Knob] = {}
    palettes: Annotated[dict[str, Palette], Field(min_length=2)]
    landmarks: Weights
    n_landmarks: tuple[int, int] = (1, 3)
    overhanging: list[str] = []  # Landmarks that others may stand under, such as cranes with their jibs
    latitude_deg: Range | None = None  # Of either hemisphere; without it the sun stands where it does by default
    places: dict[str, Place] = {}
    slots: dict[str, Slots]
    life: Life

    @model_validator(mode="after")
    def _something_on_both_sides(self) -> SceneType:
        for kind, some in (("topologies", self.topologies), ("palettes", self.palettes)):
            if len({one.held_out for one in some.values()}) != 2:
                raise ValueError(f"{kind}: some must be held out, and some not")
        for name, topology in self.topologies.items():
            if stray := set(topology.places) - set(self.places):
                raise ValueError(f"topologies {name}: no place {min(stray)!r}")
        if stray := {ring.slots for place in self.places.values() for ring in place.rings} - set(self.slots):
            raise ValueError(f"places: no slots {min(stray)!r}")
        return self


def type_names(scene_assets: Path) -> list[str]:
    """List the types that have a table."""
    return sorted(path.stem for path in (scene_assets / "types").glob("*.toml"))


@cache
def load_type(name: str, scene_assets: Path, catalogue: Catalogue) -> SceneType:
    """Read a type's table; an `AssetError` names the file and the key."""
    path = scene_assets / "types" / f"{name}.toml"
    if not path.is_file():
        raise AssetError(unknown("no generator of the type", name, type_names(scene_assets)))
    kind = validated(SceneType, read_toml(path, AssetError), str(path))
    for where, weights in [("landmarks", kind.landmarks), *((f"slots {k}", s.of) for k, s in kind.slots.items())]:
        for what in weights:
            category, _, variant = what.partition(":")
            if category not in catalogue:
                raise AssetError(f"{path}: {where}: {unknown('no category', category, catalogue)}")
            if variant:
                catalogue[category].variant(variant)
    for name_, slots in kind.slots.items():
        if stray := sorted(set(slots.held_out) - set(slots.of)):
            raise AssetError(f"{path}: slots {name_}: held_out: {stray[0]!r} is not in 'of'")
    return kind
