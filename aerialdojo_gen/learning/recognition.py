"""How a network learns to name what it sees, before it learns to fly."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.learning.exploration_views import NOTHING
from aerialdojo_gen.learning.imitation import Epoch, Learner
from aerialdojo_gen.learning.steps import Pool
from aerialdojo_gen.learning.words import word_targets

# The phase before the references'.
PHASE = -1
# Of patches that show nothing with a name, as many: they are eight tenths of all, and much alike.
_EMPTY = 0.08


def train_patch_classifier(
    learner: Learner,
    exploration: Pool,
    words: tuple[str, ...],
    *,
    after: Callable[[Epoch], None],
    tick: Callable[[int, int, float, float], None],
) -> None:
    """Go through the epochs of a network's sight, from where the progress is."""
    torch, recipe, progress = learner.torch, learner.recipe, learner.progress
    learner.share_cores()
    chances = _word_targets(exploration.names, words)
    size, epochs = recipe.sight.batch_looks, recipe.sight.epochs
    count = -(-exploration.n_steps // size)
    total, done = epochs * count, progress.epoch * count + progress.batch
    started, first = time.monotonic(), done
    while progress.epoch < epochs:
        learner.network.train()
        order = rng.generator(recipe.seed, "sight looks", progress.epoch).permutation(exploration.n_steps)
        for number in range(progress.batch, count):
            draw = rng.generator(recipe.seed, "sight patches", progress.epoch, number)
            rows = np.sort(order[number * size : (number + 1) * size])
            keep, wanted = _select_patches(exploration.shown(rows), chances, draw)
            loss, right = 0.0, 0.0
            if len(keep):
                pictures = torch.from_numpy(exploration.frames(rows)).to(learner.device)
                target = torch.from_numpy(wanted).to(learner.device)
                with learner.autocast():
                    kept = torch.from_numpy(keep).to(learner.device)
                    logits = learner.network.sight(pictures.flatten(0, 1), kept).float()
                cost = torch.nn.functional.cross_entropy(logits, target)
                learner.update(cost, learner.rate(done, total, recipe.sight.learning_rate))
                loss = float(cost.detach())
                right = float((target.gather(1, logits.argmax(1, keepdim=True)) > 0).sum())
            progress.batch, done = number + 1, done + 1
            progress.sums = [a + b for a, b in zip(progress.sums, (loss * len(keep), right, len(keep)), strict=True)]
            tick(done, total, loss, right / max(len(keep), 1))
        left_s = (time.monotonic() - started) / max(done - first, 1) * (total - done)
        sums, epoch = progress.sums, progress.epoch
        progress.epoch, progress.batch, progress.sums = epoch + 1, 0, [0.0, 0.0, 0.0]
        n = max(sums[2], 1.0)
        after(Epoch(PHASE, epoch, sums[0] / n, sums[1] / n, None, left_s))


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
