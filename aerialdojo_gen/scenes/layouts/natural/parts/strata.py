"""Layered rock that stands on the ground: mesas, buttes, spurs and canyon walls."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
import shapely
from pydantic import BaseModel, ConfigDict, Field
from shapely.affinity import rotate, scale
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from aerialdojo_gen.base.simplex import OpenSimplex
from aerialdojo_gen.scenes.grammar_scatter import slab
from aerialdojo_gen.scenes.ground import polygons_of
from aerialdojo_gen.scenes.kit.natural_ground import blob
from aerialdojo_gen.scenes.layouts.natural.parts.groups import Deck
from aerialdojo_gen.scenes.mesh import Mesh
from aerialdojo_gen.scenes.site import Site
from aerialdojo_gen.scenes.terrain import Terrain
from aerialdojo_gen.scenes.values import At, Degrees, Length

_CAP_M = 0.22


class Rock(BaseModel):
    """A body of layered rock, as a recipe gives it.

    Attributes
    ----------
    name : str
        Its own among the scene's rocks; groups stand on it by that name.
    at : (float, float)
        Middle, world frame, metres.
    radius_m, height_m : float
        Mean radius across, and height above the ground, metres.
    long : float
        Length over width.
    yaw_deg : float
        Direction of its length.
    ragged : float
        How uneven its outline is, 0 to 0.5.
    batter : float
        How far the walls lean back, metres a metre of height.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    at: At
    radius_m: Length
    height_m: Length
    long: Annotated[float, Field(ge=1, le=50)] = 1.0
    yaw_deg: Degrees = 0.0
    ragged: Annotated[float, Field(ge=0, le=0.5)] = 0.2
    batter: Annotated[float, Field(ge=0, le=1)] = 0.14

    def area(self, seed: int) -> Polygon:
        """Plan at its foot, world frame, metres."""
        x, y = self.at
        round_ = blob(x, y, self.radius_m, seed * 17 + _number(self.name), self.ragged, 36)
        stretched = scale(round_, float(np.sqrt(self.long)), 1.0 / float(np.sqrt(self.long)), origin=(x, y))
        return rotate(stretched, self.yaw_deg, origin=(x, y))

    def top(self, seed: int) -> BaseGeometry:
        """Plan of the part of its top that surely carries things."""
        return self.area(seed).buffer(-self.batter * self.height_m - 0.5)


def raise_foot(terrain: Terrain, area: BaseGeometry, rise_m: float, reach_m: float) -> Terrain:
    """Bank scree against a rock: the ground rises by `rise_m` towards it over `reach_m`, metres."""
    corners = terrain.corners()[:, :2]
    t = np.clip(1.0 - shapely.distance(area, shapely.points(corners)) / reach_m, 0.0, 1.0) ** 2
    return replace(terrain, heights_m=terrain.heights_m + rise_m * t.reshape(terrain.heights_m.shape))


def put_up(site: Site, rock: Rock, bands: tuple[str, ...], cap: str = "") -> Deck:
    """Put a rock up in layers of alternating hardness; it takes its ground.

    Parameters
    ----------
    site : Site
        Where; its ground is set.
    rock : Rock
        What.
    bands : tuple of str
        Materials of the layers, from the foot up, repeated.
    cap : str
        Material of a thin layer over it all (snow); empty for none.

    Returns
    -------
    Deck
        Its top.
    """
    seed = site.recipe.seed
    foot = rock.area(seed)
    ring = [site.ground_z(float(x), float(y)) for x, y in shapely.get_coordinates(foot)]
    low, top = min(ring) - 0.6, float(np.mean(ring)) + rock.height_m
    rng = site.rng_for("strata", rock.name)
    count = max(round((top - low) / 1.3), 2)
    cuts = np.linspace(low, top, count + 1)
    cuts[1:-1] += rng.uniform(-0.35, 0.35, size=count - 1)
    noise = OpenSimplex(seed=seed * 13 + _number(rock.name))
    parts: list[tuple[str, Mesh]] = []
    for k in range(count):
        # Hard layers jut out over soft ones; the topmost is hard, and caps the rest.
        hard = 0.28 if (count - 1 - k) % 2 == 0 else -0.12
        inset = rock.batter * (float(cuts[k]) - low) - hard + float(rng.uniform(-0.1, 0.1))
        outline = _weathered(foot.buffer(-max(inset, -0.3)), noise, float(k) * 0.35).intersection(site.extent)
        parts += [(bands[k % len(bands)], slab(p, float(cuts[k]), float(cuts[k + 1]))) for p in polygons_of(outline)]
    if cap:
        parts += [(cap, slab(p, top, top + _CAP_M)) for p in polygons_of(outline.buffer(0.1))]
        top += _CAP_M
    site.add(None, "rock", parts, footprint=foot.buffer(0.3))
    return Deck(rock.top(seed).intersection(site.extent), top)


def _weathered(area: BaseGeometry, noise: OpenSimplex, phase: float) -> BaseGeometry:
    """Notch an outline: every 1.5 m of it moves by up to half a metre, similarly in neighbouring layers."""
    pieces = []
    for p in polygons_of(area):
        xy = shapely.get_coordinates(shapely.segmentize(p.exterior, 1.5))[:-1]
        d = np.array(
            [[noise.noise3(x / 2.2, y / 2.2, phase), noise.noise3(x / 2.2, y / 2.2, phase + 40.0)] for x, y in xy]
        )
        moved = Polygon(xy + 0.5 * d)
        pieces += polygons_of(moved if moved.is_valid else moved.buffer(0))
    return shapely.union_all(pieces)


def _number(name: str) -> int:
    """Turn a name into a small number that is the same on every machine."""
    return sum((k + 1) * ord(c) for k, c in enumerate(name)) % 997
