"""Begin a training with the weights of another: words and scenes keep their numbers, new ones get the next."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.learning import checkpoints
from aerialdojo_gen.learning.loader import torch_package
from aerialdojo_gen.learning.policy import network_of
from aerialdojo_gen.learning.recipe import ModelConfig
from aerialdojo_gen.learning.words import Vocabulary
from aerialdojo_gen.store.files import file_digest

# Layers whose last output is no word and no scene: it stays the last when words or scenes are added.
_LAST_STAYS = ("sight.words.", "whereabouts.body.2.")


@dataclass(frozen=True)
class InitialWeights:
    """Weights that a training begins with, and what they were made for."""

    path: str
    sha256: str
    tensors: dict[str, Any]  # By the names that they have in the network
    about: checkpoints.PolicyInfo

    def check_fit(self, sensors: Sensors, model: ModelConfig) -> None:
        """Refuse a recipe with other views or sizes; UsageError names the key."""
        own = self.about.sensors
        pairs = {"[data] views": (list(own.views), list(sensors.views)), "[data] size_px": (own.width, sensors.width)}
        sizes = model.model_dump(mode="json").items()
        pairs |= {f"[model] {key}": (self.about.shape[key], value) for key, value in sizes}
        for key, (its, ours) in pairs.items():
            if its != ours:
                raise UsageError(
                    f"{self.path} does not fit the recipe: its {key} is {its}, and the recipe's is {ours}"
                )

    def vocabulary(self, own: Vocabulary) -> Vocabulary:
        """Return its vocabulary with the words that only the training has, after them."""
        return Vocabulary(joined(self.about.vocabulary.words, own.words), self.about.vocabulary.length)

    def copy_to(self, network: Any) -> None:
        """Give a network these weights; what it has beyond them (new words, new scenes, a sight) stays as it is."""
        with torch_package().no_grad():
            for name, tensor in network.state_dict().items():
                given = self.tensors.get(name)
                if given is None:
                    continue
                if name.startswith(_LAST_STAYS):
                    tensor[-1], tensor, given = given[-1], tensor[: len(given) - 1], given[:-1]
                tensor[tuple(slice(n) for n in given.shape)] = given


def read_initial_weights(path: str | Path) -> InitialWeights:
    """Read weights of `train`; UsageError or StoreError where there are none to begin with."""
    tensors, about, _ = checkpoints.read(path)
    network = network_of(about, tensors, str(path))
    if not about.scenes:
        raise UsageError(
            f"{path} does not say which scenes it was trained on (an older version wrote it): train it again"
        )
    return InitialWeights(str(path), file_digest(Path(path)), network.state_dict(), about)


def joined(first: Iterable[str], more: Iterable[str]) -> tuple[str, ...]:
    """Join names, each once, in their order."""
    return tuple(dict.fromkeys((*first, *more)))
