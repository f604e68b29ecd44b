"""What a recipe says of a town: buildings, streets, areas and things, in metres about the scene's middle."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from shapely.geometry import Polygon

from aerialdojo_gen.scenes.layouts.places.parts.heights import Heights
from aerialdojo_gen.scenes.values import At, Degrees, Line

Name = Annotated[str, Field(max_length=80)]
Kind = Annotated[str, Field(pattern=r"^[a-z0-9_]{1,40}$")]
Wide = Annotated[float, Field(ge=0.3, le=60)]
Tall = Annotated[float, Field(ge=0.5, le=500)]


def _ring(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    plan = Polygon(points)
    if not plan.is_valid or plan.area < 0.5:
        raise ValueError("an outline is a simple polygon of half a square metre or more")
    return points


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("a span runs from a place to one farther along")
    return span


Ring = Annotated[tuple[At, ...], Field(min_length=3, max_length=1000), AfterValidator(_ring)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Body(_Table):
    """A part of a building: a plan between two heights.

    Attributes
    ----------
    outline, holes : points
        Metres.
    base_m, top_m : float
        Over the lowest ground about the building; the roof is within the top.
    roof : str
        Form.
    roof_m : float
        Height of the roof over the eaves, metres.
    """

    outline: Ring
    holes: Annotated[tuple[Ring, ...], Field(max_length=100)] = ()
    base_m: Annotated[float, Field(ge=0, le=400)] = 0.0
    top_m: Tall
    roof: Literal["flat", "gabled", "hipped", "dome"] = "flat"
    roof_m: Annotated[float, Field(ge=0, le=60)] = 0.0

    @property
    def plan(self) -> Polygon:
        """Its plan."""
        return Polygon(self.outline, self.holes)


class Building(_Table):
    """A building.

    Attributes
    ----------
    category : str
        What it is: ``"house"``, ``"church"``, ``"office_building"``.
    bodies : tuple of Body
        What it is made of.
    wall, roofing : str
        Materials.
    colour : str
        Of its walls, as a person says it; empty for none.
    shops : bool
        Whether there are shop windows along its ground floor.
    canopy : bool
        A roof on posts.
    name, street : str
        As on the map.
    """

    category: Kind = "building"
    bodies: Annotated[tuple[Body, ...], Field(min_length=1, max_length=100)]
    wall: str
    roofing: str = "concrete:#77787a"
    colour: Name = ""
    shops: bool = False
    canopy: bool = False
    name: Name = ""
    street: Name = ""


class Road(_Table):
    """A street or a path.

    Attributes
    ----------
    kind : str
        Main streets have traffic; all but paths have lanes, and cars may stand along side streets.
    line : points
        Its middle line, metres.
    width_m, pavement_m : float
        Of the carriageway, and of the raised pavement on either side; 0 for none.
    lanes : int
        Number of lanes.
    oneway, marks, parking : bool
        Whether it is one-way, has lane marks, has cars along its kerbs.
    surface : str
        Material.
    raised : bool
        Of paths: as high as pavements.
    bridge : int or None
        Which of the bridges, counted from 0, it lies on or climbs to.
    name : str
        As on the map.
    """

    kind: Literal["main", "side", "service", "path"]
    line: Line
    width_m: Wide
    pavement_m: Annotated[float, Field(ge=0, le=20)] = 0.0
    lanes: Annotated[int, Field(ge=1, le=12)] = 1
    oneway: bool = False
    marks: bool = False
    parking: bool = False
    surface: str = "asphalt"
    raised: bool = False
    bridge: Annotated[int, Field(ge=0)] | None = None
    name: Name = ""


class Bridge(_Table):
    """A deck that streets, paths or rails lie on, with its ramps.

    Attributes
    ----------
    line : points
        Middle line from the foot of one ramp to that of the other, points at equal distances, metres.
    heights_m : tuple of float
        Height of the road at those points over the straight line between the ground at both ends.
    span_m : (from, to)
        What of the line is bridge; before and behind it are ramps, metres along it.
    depth_m : float
        Thickness of the deck.
    rails : tuple of points
        Middle lines of tracks on it.
    name : str
        As on the map.
    """

    line: Line
    heights_m: Annotated[tuple[Annotated[float, Field(ge=0, le=60)], ...], Field(min_length=2, max_length=3000)]
    span_m: Annotated[tuple[Annotated[float, Field(ge=0)], Annotated[float, Field(ge=0)]], AfterValidator(_rising)]
    depth_m: Annotated[float, Field(ge=0.1, le=5)] = 0.8
    rails: Annotated[tuple[Line, ...], Field(max_length=100)] = ()
    name: Name = ""

    @model_validator(mode="after")
    def _paired(self) -> Bridge:
        if len(self.line) != len(self.heights_m):
            raise ValueError("line and heights_m of a bridge must have as many points")
        return self


class Area(_Table):
    """A piece of ground.

    Attributes
    ----------
    material : str
        What it shows.
    outline, holes : points
        Metres.
    grows : str
        What grows there by rule: ``"wood"`` and ``"park"`` trees, ``"scrub"`` bushes, else nothing.
    parking : bool
        Whether it is a car park.
    name : str
        As on the map.
    """

    material: str
    outline: Ring
    holes: Annotated[tuple[Ring, ...], Field(max_length=200)] = ()
    grows: Literal["", "wood", "park", "scrub"] = ""
    parking: bool = False
    name: Name = ""

    @property
    def plan(self) -> Polygon:
        """Its plan."""
        return Polygon(self.outline, self.holes)


class Thing(_Table):
    """A prop of the catalogue where the map has it.

    Attributes
    ----------
    category : str
        Key of the catalogue.
    at : (x, y)
        Metres.
    yaw : float or None
        Direction of its front, degrees; towards the nearest street where absent.
    scale : float
        Its size beside the catalogue's.
    """

    category: Kind
    at: At
    yaw: Degrees | None = None
    scale: Annotated[float, Field(ge=0.3, le=3)] = 1.0


class Barrier(_Table):
    """A wall, a fence or a hedge along a line, metres."""

    kind: Literal["wall", "fence", "hedge"]
    line: Line
    height_m: Annotated[float, Field(ge=0.3, le=20)] = 1.1


class Rule(_Table):
    """What stands along the streets though the map does not say so: shares of what there could be, 0 to 1."""

    parked: Annotated[float, Field(ge=0, le=1)] = 0.55
    driving: Annotated[float, Field(ge=0, le=1)] = 0.35
    furniture: Annotated[float, Field(ge=0, le=1)] = 0.6
    lamps: bool = True


_MOST = 1000


class Parameters(_Table):
    """What a recipe may say of a town.

    Attributes
    ----------
    ground : str
        Material of what nothing is said of.
    heights : Heights, optional
        The ground's; level where absent.
    buildings, roads, bridges, areas, things, barriers
        What there is.
    rails : tuple of points
        Middle lines of tracks let into the street.
    crossings, signals : tuple of (x, y)
        Zebra crossings and traffic lights, metres.
    rule : Rule
        What is added by rule.
    drive_on : str
        The side of the street that is driven on.
    """

    ground: str = "paving:#9a978f"
    heights: Heights | None = None
    buildings: Annotated[tuple[Building, ...], Field(max_length=_MOST)] = ()
    roads: Annotated[tuple[Road, ...], Field(max_length=_MOST)] = ()
    bridges: Annotated[tuple[Bridge, ...], Field(max_length=_MOST)] = ()
    areas: Annotated[tuple[Area, ...], Field(max_length=_MOST)] = ()
    things: Annotated[tuple[Thing, ...], Field(max_length=_MOST)] = ()
    barriers: Annotated[tuple[Barrier, ...], Field(max_length=_MOST)] = ()
    rails: Annotated[tuple[Line, ...], Field(max_length=_MOST)] = ()
    crossings: Annotated[tuple[At, ...], Field(max_length=_MOST)] = ()
    signals: Annotated[tuple[At, ...], Field(max_length=_MOST)] = ()
    rule: Rule = Rule()
    drive_on: Literal["right", "left"] = "right"

    @model_validator(mode="after")
    def _there(self) -> Parameters:
        for k, road in enumerate(self.roads):
            if road.bridge is not None and road.bridge >= len(self.bridges):
                raise ValueError(f"roads.{k}: bridge {road.bridge} is none of {len(self.bridges)}, counted from 0")
        return self


__all__ = ["Area", "Barrier", "Body", "Bridge", "Building", "Parameters", "Road", "Rule", "Thing"]
