"""The ray caster of the scene that is drawn."""

from __future__ import annotations

import weakref

from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes.model import Scene

# Of the last scene: the next rays are then cheap, and memory stays that of one scene.
_casters: list[tuple[weakref.ref[Scene], RayCaster]] = []


def ray_caster(scene: Scene) -> RayCaster:
    """Return a ray caster of the scene, kept until that of another scene is asked for."""
    if not _casters or _casters[0][0]() is not scene:
        _casters[:] = [(weakref.ref(scene), RayCaster(scene))]
    return _casters[0][1]
