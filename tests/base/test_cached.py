"""Results of methods that are kept in their object."""

from __future__ import annotations

from aerialdojo_gen.base.cached import cached_method


class Scaled:
    def __init__(self, by: int) -> None:
        self.by, self.calls = by, 0

    @cached_method
    def times(self, n: int, more: int = 0) -> int:
        self.calls += 1
        return self.by * n + more


def test_a_result_is_made_once_for_each_object_and_arguments():
    two, three = Scaled(2), Scaled(3)
    for _ in range(2):
        assert [two.times(5), two.times(6), two.times(5, 1), two.times(5, more=2)] == [10, 12, 11, 12]
        assert three.times(5) == 15
    assert (two.calls, three.calls) == (4, 1)
