"""Loading a release for learning: trajectories as arrays, in an order that can be repeated and resumed.

>>> from aerialdojo_gen.learning import Loader, Trajectories  # doctest: +SKIP
>>> data = Trajectories("data", split="id_train", views=("front", "down"), size=128)  # doctest: +SKIP
>>> for batch in Loader(data, batch_size=32):  # doctest: +SKIP
...     batch["rgb"]  # (32, 1, 2, 128, 128, 3) uint8

NumPy is enough; worker processes and tensors need PyTorch, the extra ``train``.
"""

from aerialdojo_gen.learning.labels import collate
from aerialdojo_gen.learning.loader import Loader
from aerialdojo_gen.learning.trajectories import Trajectories
from aerialdojo_gen.learning.vector import Flattened, OwnScenes, ProgressReward, make_vec
from aerialdojo_gen.learning.words import Vocabulary

__all__ = ["Flattened", "Loader", "OwnScenes", "ProgressReward", "Trajectories", "Vocabulary", "collate", "make_vec"]
