"""The closed loop: a Gymnasium environment over the released tasks, agents, and their evaluation (paper: benchmark).

Importing this package registers the environment: ``gymnasium.make("AerialDojo-v0", data="data", split="ood_test")``,
or ``worlds="N_*", start_seed=1000, num_worlds=200`` for worlds that are made as episodes come to them.
"""

from typing import Any

import gymnasium

gymnasium.register("AerialDojo-v0", entry_point="aerialdojo_gen.benchmark.worlds_env:make")


def __getattr__(name: str) -> Any:
    # The environment brings numba and FCL with it, and metrics over a finished log need neither.
    if name == "AerialDojoEnv":
        from aerialdojo_gen.benchmark.env import AerialDojoEnv

        return AerialDojoEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = ["AerialDojoEnv"]
