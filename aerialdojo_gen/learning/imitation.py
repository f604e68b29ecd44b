"""Behaviour cloning: a network learns to name what it sees, then to do at each step what the teacher does there."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.learning.loader import torch_package
from aerialdojo_gen.learning.network import UNIT_M, LocalizationOutput, Network, PolicyOutput, offset_loss, pose_loss
from aerialdojo_gen.learning.parts import NOTHING
from aerialdojo_gen.learning.recipe import Recipe
from aerialdojo_gen.learning.steps import Pool
from aerialdojo_gen.learning.words import word_targets
from aerialdojo_gen.pipeline.executors.local import own_cores

# Batches of like lengths are put together from so many: padding costs time.
_CHUNK = 24
# Weight of the warning's mean loss: what is in the way is soon seen, and the same pictures are to show places.
_WARNING = 4.0
# Pictures are kept on the accelerator where they take at most this share of what is free there.
_RESIDENT = 0.7


@dataclass
class Progress:
    """Where a training is: JSON, for a checkpoint."""

    phase: int = 0  # -1 for what objects look like, 0 for the references, then the round of DAgger
    epoch: int = 0  # Of the phase; batches that are done
    batch: int = 0
    sums: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])


# How well a network does on steps that it was not trained on: share of right actions, how far off it thinks goals are
# (metres, medians over all steps and over first ones), and the shares of blocked and of free actions told.
Assessment = dict[str, float | None]


class TrainingLog(Protocol):
    """Receives a training's progress; loss and accuracy are of choices given the goal's place."""

    def on_batch(self, done: int, total: int, loss: float, accuracy: float) -> None:
        """After so many batches of all."""

    def on_epoch(self, row: dict[str, Any], epochs: int, left_s: float) -> None:
        """After an epoch: its line of the history, how many epochs there are, and seconds left."""


def epoch_batches(
    lengths: NDArray[np.int64], most_steps: int, seed: int, phase: int, epoch: int
) -> list[NDArray[np.int64]]:
    """Batches of episodes of like lengths, shuffled, of at most `most_steps` steps each, padding included."""
    draw = rng.generator(seed, "learning batches", phase, epoch)
    order = draw.permutation(np.flatnonzero(lengths > 0))
    size = max(1, int(_CHUNK * most_steps / max(float(lengths.mean()), 1.0)))
    batches: list[NDArray[np.int64]] = []
    for begin in range(0, len(order), size):
        chunk = order[begin : begin + size]
        chunk = chunk[np.argsort(-lengths[chunk], kind="stable")]
        while len(chunk):
            n = max(1, most_steps // int(lengths[chunk[0]]))
            batches.append(chunk[:n])
            chunk = chunk[n:]
    return [batches[k] for k in draw.permutation(len(batches))]


def blocked_loss(logits: Any, blocked: Any) -> Any:
    """Return the loss of chances that actions are blocked: logits (m, 16) and bool (m, 16) to ()."""
    functional = torch_package().nn.functional
    return _WARNING * functional.binary_cross_entropy_with_logits(logits.float(), blocked.float())


class Learner:
    """A network, the moments of its gradients, and what it learns by."""

    def __init__(self, network: Network, recipe: Recipe, device: str, phase: int) -> None:
        self.torch = torch_package()
        self.network = network.to(device)
        self.recipe, self.device = recipe, device
        self.begin(phase)
        # Steps of the pool that are not kept back.
        self._about: list[tuple[Pool, Any, NDArray[np.int64]]] = []

    def state(self) -> dict[str, Any]:
        """Return all tensors that a training goes on from: weights, and moments of gradients."""
        named = {f"network.{name}": t for name, t in self.network.state_dict().items()}
        for number, moments in self._moments.items():
            named |= {f"optimiser.{number}.{name}": t for name, t in moments.items()}
        return named

    def restore(self, tensors: Mapping[str, Any], progress: Mapping[str, Any]) -> None:
        """Go on from a checkpoint."""
        weights = {n.removeprefix("network."): t for n, t in tensors.items() if n.startswith("network.")}
        self.network.load_state_dict(weights)
        for name, tensor in tensors.items():
            if name.startswith("optimiser."):
                _, number, what = name.split(".", 2)
                moved = tensor if what == "step" else tensor.to(self.device)
                self._moments.setdefault(int(number), {})[what] = moved
        self.progress = Progress(**progress)

    def begin(self, phase: int) -> None:
        """Begin a phase, without moments of gradients."""
        self.progress = Progress(phase)
        self._moments: dict[int, dict[str, Any]] = {}

    def share_cores(self) -> None:
        """Use the cores that are ours: sums depend on how many, and who flew in this process before left it one."""
        self.torch.set_num_threads(own_cores())

    def autocast(self) -> Any:
        """Return what a network is to run in: half as many bits on an accelerator."""
        return self.torch.autocast(self.device, self.torch.bfloat16, enabled=self.device != "cpu")

    def update(self, loss: Any, rate: float) -> None:
        """Descend a loss, (), by one step of AdamW."""
        # The function: PyTorch's class imports its compiler, which takes seconds.
        from torch.optim.adamw import adamw

        torch, train = self.torch, self.recipe.train
        self.network.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), train.gradient_norm)
        learned = {k: p for k, p in enumerate(self.network.parameters()) if p.grad is not None}
        for k in learned.keys() - self._moments.keys():
            first, second = (torch.zeros_like(learned[k], memory_format=torch.preserve_format) for _ in range(2))
            self._moments[k] = {"step": torch.tensor(0.0), "exp_avg": first, "exp_avg_sq": second}
        steps, first, second = (
            [self._moments[k][name] for k in learned] for name in ("step", "exp_avg", "exp_avg_sq")
        )
        with torch.no_grad():
            adamw(
                [*learned.values()], [p.grad for p in learned.values()], first, second, [], steps, amsgrad=False,
                beta1=0.9, beta2=0.999, lr=rate, weight_decay=train.weight_decay, eps=1e-8, maximize=False,
            )  # fmt: skip

    def learn(
        self, pool: Pool, exploration: Pool | None, held_out: NDArray[np.bool_], epochs: int, learning_rate: float,
        log: TrainingLog,
    ) -> None:  # fmt: skip
        """Train through a phase's epochs, from where the progress is; `held_out` (n,) are not learned from."""
        self.share_cores()
        anywhere = np.flatnonzero(np.repeat(~held_out, pool.lengths))
        lengths = np.where(held_out, 0, pool.lengths)
        frames = self._frames(pool)
        self._about = [(pool, frames, anywhere)]
        if exploration is not None:
            self._about.append((exploration, self._frames(exploration), np.arange(exploration.n_steps)))

        def batches(epoch: int) -> list[NDArray[np.int64]]:
            return epoch_batches(lengths, self.recipe.train.batch_steps, self.recipe.seed, self.progress.phase, epoch)

        self.run_epochs(
            epochs, batches, learning_rate, log,
            step=lambda episodes, rate: self._step(pool, frames, episodes, rate),
            assess=lambda: self.assess(pool, frames, held_out),
        )  # fmt: skip

    def run_epochs(
        self, epochs: int, batches: Callable[[int], list[NDArray[np.int64]]], learning_rate: float,
        log: TrainingLog, *, step: Callable[[NDArray[np.int64], float], tuple[float, float, int]],
        assess: Callable[[], Assessment | None] = lambda: None,
    ) -> None:  # fmt: skip
        """Go on through epochs; `step` learns a batch, and returns its mean loss, how many are right, of how many."""
        p, counts = self.progress, [len(batches(epoch)) for epoch in range(epochs)]
        total, done = sum(counts), sum(counts[: p.epoch]) + p.batch
        started, first = time.monotonic(), done
        while p.epoch < epochs:
            self.network.train()
            for batch in batches(p.epoch)[p.batch :]:
                loss, right, n = step(batch, self.rate(done, total, learning_rate))
                p.batch, done = p.batch + 1, done + 1
                p.sums = [a + b for a, b in zip(p.sums, (loss * n, right, n), strict=True)]
                log.on_batch(done, total, loss, right / max(n, 1))
            left_s = (time.monotonic() - started) / max(done - first, 1) * (total - done)
            mean_loss, accuracy = (value / max(p.sums[2], 1.0) for value in p.sums[:2])
            row: dict[str, Any] = {"phase": p.phase, "epoch": p.epoch, "loss": mean_loss, "accuracy": accuracy}
            p.epoch, p.batch, p.sums = p.epoch + 1, 0, [0.0, 0.0, 0.0]
            log.on_epoch(row | {"kept_back": assess()}, epochs, left_s)

    def assess(self, pool: Pool, frames: Any, chosen: NDArray[np.bool_]) -> Assessment | None:
        """See how well the network does on some episodes; None without any."""
        lengths = np.where(chosen, pool.lengths, 0)
        if not lengths.any():
            return None
        self.network.eval()
        right, off, first, blocked_at, free = [], [], [], [], []
        with self.torch.no_grad():
            for episodes in epoch_batches(lengths, self.recipe.train.batch_steps, 0, 0, 0):
                batch = self._batch(pool, frames, episodes, rng.generator(0, "kept back"))
                (output, estimate), mask = self._forward(batch, teacher_forced=False), batch["mask"]
                right.append((output.logits.argmax(-1) == batch["label"])[mask])
                predicted, is_so = output.blocked[mask] > 0.0, batch["blocked"][mask]
                blocked_at.append(predicted[is_so])
                free.append(~predicted[~is_so])
                away = self.torch.linalg.vector_norm(estimate.offset * UNIT_M - batch["offset"], dim=-1)
                off.append(away[mask])
                first.append(away[:, 0])
        median = [float(self.torch.cat(one).median()) for one in (off, first)]
        rates = [self.torch.cat(one).float() for one in (right, blocked_at, free)]
        accuracy, *shares = (float(one.mean()) if len(one) else None for one in rates)
        names = ("accuracy", "goal_off_m", "goal_off_at_start_m", "blocked_told", "free_told")
        return dict(zip(names, (accuracy, *median, *shares), strict=True))

    def rate(self, done: int, total: int, highest: float) -> float:
        """Learning rate after so many of all batches of a phase."""
        warm = min(1.0, (done + 1) / (self.recipe.train.warmup_batches + 1))
        return highest * warm * (0.1 + 0.9 * 0.5 * (1.0 + math.cos(math.pi * done / max(total, 1))))

    def _frames(self, pool: Pool) -> Any:
        """All pictures on the accelerator where there is room; else None, and batches read their own."""
        if self.device == "cpu" or not self.recipe.data.views:
            return None
        size = sum(part.frames.nbytes for part in pool.parts)
        free, _ = self.torch.cuda.mem_get_info()
        if size > _RESIDENT * free:
            return None
        shape = (pool.n_steps, *pool.parts[0].frames.shape[1:])
        out = self.torch.empty(shape, dtype=self.torch.uint8, device=self.device)
        at = 0
        for part in pool.parts:
            n = len(part.frames)
            out[at : at + n] = self.torch.from_numpy(np.array(part.frames)).to(self.device)
            at += n
        return out

    def _batch(
        self, pool: Pool, frames: Any, episodes: NDArray[np.int64], draw: np.random.Generator
    ) -> dict[str, Any]:
        by_image = draw.random(len(episodes)) < self.recipe.train.image_share
        arrays = pool.batch(episodes, by_image)
        rows = arrays.pop("rows")
        out = {name: self.torch.from_numpy(value).to(self.device) for name, value in arrays.items()}
        if self.recipe.data.views:
            out["pictures"] = self._pictures(pool, frames, rows)
        return out

    def _forward(self, batch: dict[str, Any], *, teacher_forced: bool) -> tuple[PolicyOutput, LocalizationOutput]:
        """Estimate where goals are; choose by that, or by the true offset if teacher-forced."""
        # A choice is learned beside the true offset: beside wrong estimates it learns not to go by them.
        network = self.network
        with self.autocast():
            goal = network.encode_goal(batch["tokens"], batch["images"], batch["goal_by_image"])
            seen = network.features(batch.get("pictures"), goal, batch["mask"])
            blank = network.blank(len(seen)).to(self.device)
            estimate, _ = network.whereabouts(seen, goal, batch["odometry"], blank)
            return network.choose(
                seen, estimate.with_goal_offset(batch["offset"]) if teacher_forced else estimate
            ), estimate

    def _views_loss(self, draw: np.random.Generator) -> Any:
        """Loss of the place predicted from pictures of the whole scene: one episode's are too similar."""
        n = self.recipe.train.looks
        about = [(pool, frames, rows) for pool, frames, rows in self._about if len(rows)]
        if not (n and self.recipe.data.views and about):
            return 0.0
        looks = []
        for k, (pool, frames, rows) in enumerate(about):
            chosen = np.sort(draw.choice(rows, (n + k) // len(about)))
            at = (self.torch.from_numpy(one).to(self.device) for one in pool.places(chosen))
            looks.append((self._pictures(pool, frames, chosen), *at))
        pictures, pose, number, blocked = (self.torch.cat(same) for same in zip(*looks, strict=True))
        with self.autocast():
            seen = self.network.encode_pictures(pictures.flatten(0, 1)).reshape(n, -1)
            place, heading, scene, _ = self.network.whereabouts.locate(seen)
            blocked_at = self.network.blocked(seen)
        return pose_loss(place, heading, scene, pose, number) + blocked_loss(blocked_at, blocked)

    def _pictures(self, pool: Pool, frames: Any, rows: NDArray[np.int64]) -> Any:
        if frames is None:
            return self.torch.from_numpy(pool.frames(rows)).to(self.device)
        return frames[self.torch.from_numpy(rows).to(self.device)]

    def _step(self, pool: Pool, frames: Any, episodes: NDArray[np.int64], rate: float) -> tuple[float, float, int]:
        functional, p = self.torch.nn.functional, self.progress
        draw = rng.generator(self.recipe.seed, "learning goals", p.phase, p.epoch, p.batch)
        batch = self._batch(pool, frames, episodes, draw)
        # What is dropped out is drawn anew at every batch, so that a resumed training draws the same.
        self.torch.manual_seed(int(draw.integers(2**31)))
        (output, estimate), mask = self._forward(batch, teacher_forced=True), batch["mask"]
        logits, label = output.logits[mask].float(), batch["label"][mask]
        loss = functional.cross_entropy(logits, label)
        touches = blocked_loss(output.blocked[mask], batch["blocked"][mask])
        where = offset_loss(estimate, batch) + touches + self._views_loss(draw)
        self.update(loss + self.recipe.train.goal_weight * where, rate)
        right = (logits.argmax(-1) == label).sum()
        return float(loss.detach()), float(right), int(mask.sum())


# Of patches that show nothing with a name, as many: they are eight tenths of all, and much alike.
_EMPTY = 0.08


def train_patch_classifier(learner: Learner, exploration: Pool, words: tuple[str, ...], log: TrainingLog) -> None:
    """Go through the epochs of a network's sight, from where the progress is."""
    torch, recipe, progress = learner.torch, learner.recipe, learner.progress
    learner.share_cores()
    # Chances of words by object, (objects + 1, words + 1); the last row and the last word are of no object.
    chances = np.pad(word_targets(exploration.names, words), ((0, 1), (0, 1)))
    chances[-1, -1] = 1.0
    size = recipe.sight.batch_looks

    def batches(epoch: int) -> list[NDArray[np.int64]]:
        order = rng.generator(recipe.seed, "sight looks", epoch).permutation(exploration.n_steps)
        return [np.sort(order[begin : begin + size]) for begin in range(0, len(order), size)]

    def step(rows: NDArray[np.int64], rate: float) -> tuple[float, float, int]:
        draw = rng.generator(recipe.seed, "sight patches", progress.epoch, progress.batch)
        # Patches to learn from. An object of whose name no word is known teaches nothing.
        shown = exploration.shown(rows).ravel()
        named = (shown >= 0) & (chances.sum(axis=1)[shown] > 0.0)
        keep = np.flatnonzero(named | ((shown == NOTHING) & (draw.random(len(shown)) < _EMPTY)))
        if not len(keep):
            return 0.0, 0.0, 0
        wanted = chances[np.where(shown[keep] == NOTHING, len(chances) - 1, shown[keep])]
        arrays = (exploration.frames(rows), keep, wanted)
        pictures, kept, target = (torch.from_numpy(array).to(learner.device) for array in arrays)
        with learner.autocast():
            logits = learner.network.sight(pictures.flatten(0, 1), kept).float()
        cost = torch.nn.functional.cross_entropy(logits, target)
        learner.update(cost, rate)
        right = (target.gather(1, logits.argmax(1, keepdim=True)) > 0).sum()
        return float(cost.detach()), float(right), len(keep)

    learner.run_epochs(recipe.sight.epochs, batches, recipe.sight.learning_rate, log, step=step)
