"""A post that is red on one side only: which viewpoint shows it as "red" is then known."""

from __future__ import annotations

import numpy as np
from support import handmade
from support.handmade import box, ground, instance

from aerialdojo_gen.base.config.sections import AnchorSampleConfig
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.pipeline.scoring.base import AnchorView, CandidateMeasures
from aerialdojo_gen.pipeline.stages.work.anchor_world import World
from aerialdojo_gen.scenes.model import Instance, Material, Part, Scene

RED, BLUE = Material("red", (220, 30, 30)), Material("blue", (30, 40, 210))
EMBODIMENT = Embodiment()


def part(low, high, material) -> Part:
    return handmade.part(box(low, high), material)


def yard(*things: Instance, colours: tuple[Material, ...] = ()) -> Scene:
    materials = {m.name: m for m in (Material("grey", (128, 128, 128)), RED, BLUE, *colours)}
    return Scene("U_Test_0", (ground(20.0), *things), materials, np.array([[-20.0, -20.0, 0.0], [20.0, 20.0, 12.0]]))


# Red looks north (+y), blue everywhere else.
POST = Instance(
    "post", "thing", "", {},
    (part((-0.5, -0.5, 0.3), (0.5, 0.45, 2.0), "blue"), part((-0.5, 0.45, 0.3), (0.5, 0.5, 2.0), "red")),
)  # fmt: skip


def world_of(place: Scene) -> World:
    return World.of(place, EMBODIMENT.radius_m, AnchorSampleConfig().margin_m)


def item_of(thing: Instance, name: str) -> dict:
    x, y, z = thing.centroid.tolist()
    return {"object_id": 0, "name": name, "mesh_node": thing.node, "x_m": x, "y_m": y, "z_m": z}


def plain_view(rgb: tuple[int, int, int], size: int = 32) -> AnchorView:
    """A view of one colour, all of it the object."""
    whole = np.ones((size, size), np.bool_)
    return AnchorView(np.full((size, size, 3), rgb, np.uint8), whole, whole, ~whole, CandidateMeasures(1.0, 0.0, 1.0))


def redness(rgb: np.ndarray) -> float:
    return float(rgb[..., 0].astype(float).mean() - rgb[..., 1:].astype(float).mean())


def sign(node: str = "sign") -> Instance:
    """A board, 2 m wide and 4 cm thick, that faces east and west."""
    return instance(node, box((-0.02, -1.0, 1.0), (0.02, 1.0, 2.2)), box((-0.02, -0.03, 0.0), (0.02, 0.03, 1.0)))
