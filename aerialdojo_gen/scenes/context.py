"""One context a scene: its mesh, and what is built on it, shared by all who work on the scene in a process.

A ray caster, a collision world, a clearance grid or a renderer takes tens of megabytes and seconds to build. Each is
a part of the scene's context: made when it is first asked for, and gone when the context is. Contexts are found by
the mesh's digest, few are kept, and the oldest goes before the next scene is read, so that memory stays that of so
many scenes however many are worked on. One more is read ahead where somebody asks for that.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

from aerialdojo_gen.scenes.glb import read_glb
from aerialdojo_gen.scenes.model import Scene

_T = TypeVar("_T")

# For who goes back and forth between scenes: environments, people. A scene takes up to about 200 MB.
SEVERAL = 3
# A scene that was made in memory comes beside the one that is worked on.
_BESIDE = 2

# Of which contexts there are. Each has a lock of its own for its parts: what is made of a scene that is read ahead
# keeps nobody from the scene that is worked on. Nobody asks for a context's lock who holds this one.
_lock = threading.RLock()
_contexts: OrderedDict[Hashable, SceneContext] = OrderedDict()
_ahead: dict[str, SceneContext] = {}
_holders: WeakKeyDictionary[object, int] = WeakKeyDictionary()


class SceneContext:
    """A scene, and what is built on it."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        # Making a part may ask for another one.
        self._lock = threading.RLock()
        self._parts: dict[str, tuple[tuple[Hashable, ...], Any]] = {}

    def part(self, kind: str, make: Callable[[], _T], *given: Hashable) -> _T:
        """Return a part, made by the first who asks; who asks meanwhile waits for it."""
        with self._lock:
            known = self._parts.get(kind)
            if known is None or known[0] != given:
                self.drop(kind)
                known = self._parts[kind] = (given, make())
            part: _T = known[1]
            return part

    def drop(self, kind: str) -> None:
        """Let go of a part, where there is one."""
        with self._lock:
            _, part = self._parts.pop(kind, ((), None))
            if hasattr(part, "close"):
                part.close()

    def release(self) -> None:
        """Let go of all parts; who asks again gets new ones."""
        with self._lock:
            while self._parts:
                self.drop(next(reversed(self._parts)))


def open_scene(mesh: Path, sha256: str, keep: int = 1) -> SceneContext:
    """Return the context of a scene's mesh; it is read where it is not among those kept."""
    with _lock:
        context = _contexts.pop(sha256, None) or _ahead.pop(sha256, None)
        gone = _oldest_beyond(max(keep, *_holders.values(), 1) - 1)
        if context is not None:
            _contexts[sha256] = context
    _release(gone)
    if context is not None:
        return context
    with _lock:
        # Somebody else may have read it meanwhile.
        context = _contexts.get(sha256) or SceneContext(read_glb(mesh, sha256))
        # Of a file without a digest nothing tells whether it is the same the next time.
        _contexts[sha256 or id(context.scene)] = context
        return context


def keep_scene(scene: Scene, sha256: str) -> None:
    """Keep a scene that was just written to a mesh, in the place of others: `open_scene` need not read it."""
    with _lock:
        if sha256 in _contexts:
            return
        gone = _oldest_beyond(max((*_holders.values(), 1)) - 1)
        _contexts[sha256] = SceneContext(scene)
    _release(gone)


def prefetch_mesh(mesh: Path, sha256: str, make: Callable[[SceneContext], object]) -> None:
    """Read a scene and build on it, in a thread beside the work on another one; `open_scene` takes it from there.

    No other scene goes for it: only who works on a scene lets go of what draws it, in the thread that drew.
    """
    with _lock:
        if sha256 in _contexts or sha256 in _ahead:
            return
    context = SceneContext(read_glb(mesh, sha256))
    with _lock:
        _ahead[sha256] = context
    make(context)


def hold_scenes(owner: object, number: int) -> None:
    """Keep so many scenes at least as long as the owner lives, whoever opens another one; 0 for no such wish."""
    with _lock:
        if number:
            _holders[owner] = number
        else:
            _holders.pop(owner, None)


def forget_scene(sha256: str) -> None:
    """Let go of a scene, where it is kept or was read ahead."""
    with _lock:
        gone = [context for kept in (_contexts, _ahead) if (context := kept.pop(sha256, None))]
    _release(gone)


def context_of(scene: Scene) -> SceneContext:
    """Return the context of a scene in memory: that of `open_scene`, or one of its own."""
    with _lock:
        for key, context in _contexts.items():
            if context.scene is scene:
                _contexts.move_to_end(key)
                return context
        for context in _ahead.values():
            if context.scene is scene:
                return context
        gone = _oldest_beyond(max(_BESIDE, *_holders.values(), 1) - 1)
        # The context holds the scene, so that nothing else gets its id as long as this stands.
        context = _contexts[id(scene)] = SceneContext(scene)
    _release(gone)
    return context


def open_contexts() -> tuple[SceneContext, ...]:
    """Those that are kept, the one last asked for at the end."""
    with _lock:
        return tuple(_contexts.values())


def release_scenes() -> None:
    """Let go of all scenes."""
    with _lock:
        gone = [*_oldest_beyond(0), *_ahead.values()]
        _ahead.clear()
    _release(gone)


def _oldest_beyond(number: int) -> list[SceneContext]:
    """Take out those that are more than so many; to be released when the lock is let go."""
    return [_contexts.popitem(last=False)[1] for _ in range(len(_contexts) - number)]


def _release(contexts: list[SceneContext]) -> None:
    """Let go of them one by one, so that none of them is left when the next scene is read."""
    while contexts:
        contexts.pop(0).release()
