"""Texts in batches of observations that stay up to date."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from gymnasium.spaces import Text
from gymnasium.vector.utils import read_from_shared_memory

_read = read_from_shared_memory.dispatch(Text)


class GoalText(Text):
    """A `gymnasium.spaces.Text` for asynchronous vector environments.

    Those read shared memory once, and count on arrays to be views of it from then on; strings are not (Gymnasium
    1.4).
    """


class _LiveTexts(Sequence[str]):
    """Strings of shared memory, read when they are looked at; a deep copy is a tuple of what they are now."""

    def __init__(self, space: GoalText, memory: Any, n: int) -> None:
        self._space, self._memory, self._n = space, memory, n

    def _now(self) -> tuple[str, ...]:
        return tuple(str(text) for text in _read(self._space, self._memory, self._n))

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, index: Any) -> Any:
        return self._now()[index]

    def __iter__(self) -> Iterator[str]:
        return iter(self._now())

    def __repr__(self) -> str:
        return repr(self._now())

    def __deepcopy__(self, _memo: dict[int, Any]) -> tuple[str, ...]:
        return self._now()


@read_from_shared_memory.register(GoalText)
def _read_live_texts(space: GoalText, shared_memory: Any, n: int = 1) -> _LiveTexts:
    return _LiveTexts(space, shared_memory, n)
