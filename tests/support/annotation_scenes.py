"""Small hand-made scenes for the annotation tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support import handmade

from aerialdojo_gen.annotations.format import Annotations, Landmark, Object
from aerialdojo_gen.annotations.phrases import spoken
from aerialdojo_gen.annotations.vocabulary import Vocabulary
from aerialdojo_gen.scenes.catalogue import load_catalogue
from aerialdojo_gen.scenes.model import Instance, Material, Scene

_RGB = {
    "grey": (128, 128, 128), "red": (190, 40, 30), "blue": (40, 80, 170), "yellow": (230, 200, 40),
    "green": (50, 130, 60),
}  # fmt: skip
PAINTS = {name: Material(name, rgb) for name, rgb in _RGB.items()}


def box(
    node: str, centre: tuple[float, float, float], size: tuple[float, float, float], **attributes: str
) -> Instance:
    """A box on its bottom centre; the category is the node's name without its number."""
    (x, y, z), (w, d, h) = centre, size
    body = handmade.box((x - w / 2, y - d / 2, z), (x + w / 2, y + d / 2, z + h))
    parts = (handmade.part(body, attributes.get("colour", "grey")),)
    return Instance(node, node.rsplit("_", 1)[0], attributes.get("colour", ""), attributes, parts)


def street() -> Scene:
    """A clock tower; northeast of it two red vans and a blue one, with a mailbox, a bench and a lamp by them."""
    van, small = (5.0, 2.0, 2.5), (0.6, 0.6, 1.2)
    instances = (
        box("ground_000", (0, 0, -0.1), (200, 200, 0.1)),
        box("clock_tower_000", (0, 0, 0), (4, 4, 20)),
        box("delivery_van_000", (20, 20, 0), van, colour="red", place="in the yard"),
        box("delivery_van_001", (40, 40, 0), van, colour="red", place="in the yard"),
        box("delivery_van_002", (30, 32, 0), van, colour="blue"),
        box("mailbox_000", (20, 22.5, 0), small, colour="yellow"),
        box("mailbox_001", (-30, 10, 0), small, colour="red"),
        box("bench_000", (40, 43, 0), (2, 0.6, 0.8), colour="green"),
        box("street_lamp_000", (41, 36.5, 0), (0.3, 0.3, 5)),
        box("canopy_000", (-30, 10, 3), (4, 4, 0.2)),
    )
    bounds = np.array([[-80.0, -80.0, 0.0], [80.0, 80.0, 40.0]])
    return Scene("U_Street_0", instances, PAINTS, bounds)


GOOD = {
    "delivery_van_000": "A red delivery van, parked in the yard beside a yellow mailbox.",
    "delivery_van_001": "A red delivery van parked between the bench and the street lamp. It is in the yard.",
    "delivery_van_002": "The blue delivery van. It is a cheerful sight.",
    "mailbox_001": "A red mailbox under the canopy.",
}


def street_vocabulary(scene: Scene | None = None) -> Vocabulary:
    """The words of the street, or of a scene like it."""
    return Vocabulary(scene or street(), load_catalogue(Path(__file__).resolve().parents[2] / "scene_assets"))


def street_annotations(**descriptions: str) -> Annotations:
    """Right annotations of the street, with some descriptions replaced by node."""
    scene = street()
    texts = GOOD | descriptions
    objects = tuple(
        Object(
            id=k,
            name=f"{scene[node].attributes['colour']} {spoken(scene[node].category)}",
            category=scene[node].category,
            description=text,
            node=node,
        )
        for k, (node, text) in enumerate(texts.items())
    )
    return Annotations(scene.name, (Landmark(id=0, name="clock tower", node="clock_tower_000"),), objects)
