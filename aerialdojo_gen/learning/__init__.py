"""Loading a release for learning: trajectories as arrays, in an order that can be repeated and gone on with.

>>> from aerialdojo_gen.learning import Loader, Trajectories  # doctest: +SKIP
>>> data = Trajectories("data", split="id_train", views=("front", "down"), size=128)  # doctest: +SKIP
>>> for batch in Loader(data, batch_size=32):  # doctest: +SKIP
...     batch["rgb"]  # (32, 1, 2, 128, 128, 3) uint8

NumPy is enough; worker processes and tensors need PyTorch, the extra ``train``.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from aerialdojo_gen.learning.loader import Loader
    from aerialdojo_gen.learning.trajectories import Trajectories, collate
    from aerialdojo_gen.learning.words import Vocabulary

__all__ = ["Loader", "Trajectories", "Vocabulary", "collate"]

_HOMES = {
    "Loader": "aerialdojo_gen.learning.loader",
    "Trajectories": "aerialdojo_gen.learning.trajectories",
    "Vocabulary": "aerialdojo_gen.learning.words",
    "collate": "aerialdojo_gen.learning.trajectories",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)
