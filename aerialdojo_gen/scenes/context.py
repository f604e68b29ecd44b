"""One context per scene: its mesh and what is built on it, shared within a process.

A ray caster, a collision world, a clearance grid or a renderer takes tens of megabytes and seconds to build. Each is
a part of the scene's context, built on first use and released with it. Contexts are cached by the mesh's digest; the
oldest is evicted before the next scene is read, which bounds memory. One more can be prefetched.
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

# For environments and viewers, which switch between scenes. A scene takes up to about 200 MB.
SEVERAL = 3
# A scene made in memory is kept in addition to the current one.
_KEEP_IN_MEMORY = 2

# Guards the tables below. Each context has a lock of its own for its parts, so that prefetching does not block the
# current scene; it is never acquired while this one is held.
_lock = threading.RLock()
_contexts: OrderedDict[Hashable, SceneContext] = OrderedDict()
_prefetched: dict[str, SceneContext] = {}
_holders: WeakKeyDictionary[object, int] = WeakKeyDictionary()


class SceneContext:
    """A scene and what is built on it."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        # Reentrant: building a part may need another one.
        self._lock = threading.RLock()
        self._parts: dict[str, tuple[tuple[Hashable, ...], Any]] = {}

    def part(self, kind: str, make: Callable[[], _T], *key: Hashable) -> _T:
        """Return a part, built by the first caller; concurrent callers wait for it."""
        with self._lock:
            cached = self._parts.get(kind)
            if cached is None or cached[0] != key:
                self.drop(kind)
                cached = self._parts[kind] = (key, make())
            part: _T = cached[1]
            return part

    def drop(self, kind: str) -> None:
        """Release a part, if it was built."""
        with self._lock:
            _, part = self._parts.pop(kind, ((), None))
            if hasattr(part, "close"):
                part.close()

    def release(self, *but: str) -> None:
        """Release all parts but some kinds; they are built again on the next use."""
        with self._lock:
            for kind in [kind for kind in reversed(self._parts) if kind not in but]:
                self.drop(kind)


def open_scene(mesh: Path, sha256: str, keep: int = 1) -> SceneContext:
    """Return the context of a scene's mesh, read unless cached."""
    with _lock:
        context = _contexts.pop(sha256, None) or _prefetched.pop(sha256, None)
        evicted = _evict(max(keep, *_holders.values(), 1) - 1)
        if context is not None:
            _contexts[sha256] = context
    _release(evicted)
    if context is not None:
        return context
    with _lock:
        # Another thread may have read it meanwhile.
        context = _contexts.get(sha256) or SceneContext(read_glb(mesh, sha256))
        # A file without a digest may have changed the next time.
        _contexts[sha256 or id(context.scene)] = context
        return context


def cache_scene(scene: Scene, sha256: str) -> None:
    """Cache a scene that was just written to a mesh: `open_scene` need not read it."""
    with _lock:
        if sha256 in _contexts:
            return
        evicted = _evict(max((*_holders.values(), 1)) - 1)
        _contexts[sha256] = SceneContext(scene)
    _release(evicted)


def prefetch_mesh(mesh: Path, sha256: str, make: Callable[[SceneContext], object]) -> None:
    """Read a scene and build on it in a background thread, for `open_scene`.

    It evicts no other scene: a renderer must be released in the thread that drew with it.
    """
    with _lock:
        if sha256 in _contexts or sha256 in _prefetched:
            return
    context = SceneContext(read_glb(mesh, sha256))
    with _lock:
        _prefetched[sha256] = context
    make(context)


def hold_scenes(owner: object, number: int) -> None:
    """Keep at least so many scenes while the owner lives; 0 withdraws the request."""
    with _lock:
        if number:
            _holders[owner] = number
        else:
            _holders.pop(owner, None)


def release_scene(sha256: str) -> None:
    """Release a scene, cached or prefetched."""
    with _lock:
        evicted = [context for kept in (_contexts, _prefetched) if (context := kept.pop(sha256, None))]
    _release(evicted)


def context_of(scene: Scene) -> SceneContext:
    """Return the context of a scene in memory: that of `open_scene`, or one of its own."""
    with _lock:
        for key, context in _contexts.items():
            if context.scene is scene:
                _contexts.move_to_end(key)
                return context
        for context in _prefetched.values():
            if context.scene is scene:
                return context
        evicted = _evict(max(_KEEP_IN_MEMORY, *_holders.values(), 1) - 1)
        # The context holds the scene, so its id stays unique while cached.
        context = _contexts[id(scene)] = SceneContext(scene)
    _release(evicted)
    return context


def open_contexts() -> tuple[SceneContext, ...]:
    """Cached contexts, the most recently used last."""
    with _lock:
        return tuple(_contexts.values())


def release_scenes() -> None:
    """Release all scenes."""
    with _lock:
        evicted = [*_evict(0), *_prefetched.values()]
        _prefetched.clear()
    _release(evicted)


def _evict(number: int) -> list[SceneContext]:
    """Remove the oldest contexts beyond a number; to be released after the lock."""
    return [_contexts.popitem(last=False)[1] for _ in range(len(_contexts) - number)]


def _release(contexts: list[SceneContext]) -> None:
    """Release contexts one by one, so that none is left when the next scene is read."""
    while contexts:
        contexts.pop(0).release()
