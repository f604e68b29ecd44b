"""Triangles of several bodies as one soup, and what geometry asks of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.geometry.arrays import Floats, Int32s


class Body(Protocol):
    """What has triangles: an instance, a part of one."""

    @property
    def vertices(self) -> Floats:
        """(n, 3) float64, metres."""

    @property
    def faces(self) -> NDArray[Any]:
        """(m, 3) integers, indices into `vertices`."""


class InstanceLike(Body, Protocol):
    """A named body that stands in the world, as `aerialdojo_gen.scenes.model.Instance` is."""

    @property
    def node(self) -> str:
        """Name, unique among the things."""

    @property
    def bounds(self) -> Floats:
        """Axis-aligned box, (2, 3) float64, metres, world frame: lower corner, upper corner."""

    @property
    def surface(self) -> str:
        """What its surface is known to be, ``"ground"`` for one; empty where that is not known."""


class SceneLike(Protocol):
    """Things and the volume that a drone may fly in among them, as `aerialdojo_gen.scenes.model.Scene` is."""

    @property
    def instances(self) -> Sequence[InstanceLike]:
        """In a stable order."""

    @property
    def bounds(self) -> Floats:
        """Flight volume, (2, 3) float64, metres, world frame: lower corner, upper corner."""


def soup(bodies: Sequence[Body]) -> tuple[Floats, Int32s]:
    """Concatenate the triangles of bodies, none welded: vertices (n, 3) metres and faces (m, 3)."""
    offsets = np.cumsum([0, *(len(body.vertices) for body in bodies[:-1])])
    faces = [body.faces.astype(np.int32) + np.int32(k) for body, k in zip(bodies, offsets, strict=True)]
    return np.concatenate([body.vertices for body in bodies]), np.concatenate(faces)
