"""A small coloured scene for tests of rendering."""

from __future__ import annotations

import numpy as np
from support import handmade

from aerialdojo_gen.rendering.picture import Picture
from aerialdojo_gen.scenes.model import Instance, Material, Scene

CHECKS = np.kron([[0, 1], [1, 0]], np.ones((8, 8))).astype(np.uint8)
MATERIALS = {
    "grass": Material(
        "grass", (90, 130, 70), (CHECKS[..., None] * 60 + np.array([60, 100, 40])).astype(np.uint8), 2.0
    ),
    "grey": Material("grey", (140, 140, 140)),
    "red": Material("red", (210, 30, 30)),
    "blue": Material("blue", (40, 70, 190)),
}


def block(node: str, low: tuple[float, float, float], high: tuple[float, float, float], material: str) -> Instance:
    mesh = handmade.box(low, high)
    # A projection along the diagonal, so that no face is without texture.
    uv = (mesh.vertices[:, :2] + mesh.vertices[:, 2:]) / MATERIALS[material].tile_m
    return Instance(node, "thing", "", {}, (handmade.part(mesh, material, uv),))


def courtyard() -> Scene:
    """A court of 16 m between walls, 8 m high, with a red cube and a blue one in it; its middle is the origin."""
    walls = [
        block("east", (8, -9, 0), (9, 9, 8), "grey"),
        block("west", (-9, -9, 0), (-8, 9, 8), "grey"),
        block("north", (-8, 8, 0), (8, 9, 8), "grass"),
        block("south", (-8, -9, 0), (8, -8, 8), "grey"),
    ]
    cubes = [block("red_cube", (5, 1, 1), (6, 2, 2), "red"), block("blue_cube", (-3, -6, 0), (-1, -4, 2), "blue")]
    ground = block("ground", (-12, -12, -1), (12, 12, 0), "grass")
    return Scene(
        "U_Court_0", (ground, *walls, *cubes), MATERIALS, np.array([[-12.0, -12.0, 0.0], [12.0, 12.0, 12.0]])
    )


def boxes_and_a_wall() -> Scene:
    """A wall 10 m to the east with two hundred boxes behind it, and as many to the west."""
    wall = handmade.instance("wall", handmade.box((10, -80, 0), (10.5, 80, 60)))
    boxes = [
        handmade.instance(
            f"box_{x}_{k}", handmade.box((x, k % 40 - 20, k // 40), (x + 0.5, k % 40 - 19.5, k // 40 + 0.5))
        )
        for x in (14, -14) for k in range(200)
    ]  # fmt: skip
    return handmade.scene(wall, *boxes, half=90.0, ceiling=70.0)


def same_picture(one: Picture, other: Picture) -> bool:
    """Whether two pictures are equal to the bit."""
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("rgb", "depth_m", "instance"))
