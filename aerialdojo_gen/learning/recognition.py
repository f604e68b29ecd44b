"""How a network learns to name what it sees, before it learns to fly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.learning.exploration_views import NOTHING
from aerialdojo_gen.learning.imitation import Learner, TrainingLog
from aerialdojo_gen.learning.steps import Pool
from aerialdojo_gen.learning.words import word_targets

# Of patches that show nothing with a name, as many: they are eight tenths of all, and much alike.
_EMPTY = 0.08


def train_patch_classifier(learner: Learner, exploration: Pool, words: tuple[str, ...], log: TrainingLog) -> None:
    """Go through the epochs of a network's sight, from where the progress is."""
    torch, recipe, progress = learner.torch, learner.recipe, learner.progress
    learner.share_cores()
    chances = _word_targets(exploration.names, words)
    size = recipe.sight.batch_looks

    def batches(epoch: int) -> list[NDArray[np.int64]]:
        order = rng.generator(recipe.seed, "sight looks", epoch).permutation(exploration.n_steps)
        return [np.sort(order[begin : begin + size]) for begin in range(0, len(order), size)]

    def step(rows: NDArray[np.int64], rate: float) -> tuple[float, float, int]:
        draw = rng.generator(recipe.seed, "sight patches", progress.epoch, progress.batch)
        keep, wanted = _select_patches(exploration.shown(rows), chances, draw)
        if not len(keep):
            return 0.0, 0.0, 0
        pictures = torch.from_numpy(exploration.frames(rows)).to(learner.device)
        target = torch.from_numpy(wanted).to(learner.device)
        with learner.autocast():
            kept = torch.from_numpy(keep).to(learner.device)
            logits = learner.network.sight(pictures.flatten(0, 1), kept).float()
        cost = torch.nn.functional.cross_entropy(logits, target)
        learner.update(cost, rate)
        right = (target.gather(1, logits.argmax(1, keepdim=True)) > 0).sum()
        return float(cost.detach()), float(right), len(keep)

    count = -(-exploration.n_steps // size)
    learner.run_epochs([count] * recipe.sight.epochs, batches, recipe.sight.learning_rate, log, step=step)


def _word_targets(names: list[str], words: tuple[str, ...]) -> NDArray[np.float32]:
    """Chances of words by object, (objects + 1, words + 1); the last row and the last word are of no object."""
    out = np.zeros((len(names) + 1, len(words) + 1), np.float32)
    out[:-1, :-1] = word_targets(names, words)
    out[-1, -1] = 1.0
    return out


def _select_patches(
    shown: NDArray[np.int64], chances: NDArray[np.float32], draw: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Choose patches to learn from: their numbers, and the chances of their words."""
    flat = shown.ravel()
    # An object of whose name no word is known tells nothing.
    told = (flat >= 0) & (chances.sum(axis=1)[flat] > 0.0)
    keep = np.flatnonzero(told | ((flat == NOTHING) & (draw.random(len(flat)) < _EMPTY)))
    return keep, chances[np.where(flat[keep] == NOTHING, len(chances) - 1, flat[keep])]
