"""The policy's network: a small CNN for all views and the goal's picture, an embedding of words, a GRU."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from aerialdojo_gen.agents.goal import N_ACTIONS
from aerialdojo_gen.learning.whereabouts import SUMS, UNIT_M, Guess, Whereabouts

# Wave lengths of the sines that tell places apart, metres; beside them the place itself.
_WAVES_M = (4.0, 12.0, 36.0, 108.0)
_FAR_M = 30.0
_ODOMETRY = 3 * (2 * len(_WAVES_M) + 1) + 2
_BEARING = 3 * (2 * len(_WAVES_M) + 1) + 3 + 1
# The action before, none among them, becomes so many numbers.
_ACTION_FEATURES = 32
_BUDGET = 300.0


@dataclass(frozen=True)
class Shape:
    """Sizes of a network.

    Attributes
    ----------
    words : int
        Numbers of the vocabulary, padding and the unknown word among them.
    views, size_px : int
        Pictures of a step, and their edge.
    channels : tuple of int
        Of the CNN's four layers.
    features, word_features, hidden : int
        See `aerialdojo_gen.learning.recipe.ModelConfig`.
    """

    words: int
    views: int
    size_px: int
    channels: tuple[int, int, int, int]
    features: int
    word_features: int
    hidden: int

    def as_json(self) -> dict[str, Any]:
        """Return it as plain values."""
        return asdict(self)


class Network(nn.Module):  # type: ignore[misc]  # torch is looked at by no type checker here
    """Actions from pictures, goal and own motion.

    Parameters
    ----------
    shape : Shape
    """

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.shape = shape
        layers: list[Any] = []
        before = 4
        for n in shape.channels:
            layers += [nn.Conv2d(before, n, 3, stride=2, padding=1), nn.ReLU(inplace=True)]
            before = n
        edge = shape.size_px // 16
        self.eye = nn.Sequential(
            *layers, nn.Flatten(), nn.Linear(before * edge * edge, shape.features), nn.LayerNorm(shape.features)
        ).to(memory_format=torch.channels_last)
        self.words = nn.Embedding(shape.words, shape.word_features, padding_idx=0)
        self.phrase = nn.Conv1d(shape.word_features, shape.features, 3, padding=1)
        # Whether the goal is a picture stands beside what it shows.
        self.goal = nn.Sequential(nn.Linear(2 * shape.features + 1, shape.features), nn.ReLU(inplace=True))
        self.action = nn.Embedding(N_ACTIONS + 1, _ACTION_FEATURES)
        # Who sees nothing guesses by what is said alone.
        pictured = max(shape.views, 1) * shape.features
        self.whereabouts = Whereabouts(pictured, shape.features, shape.features)
        seen = pictured + shape.features + _ACTION_FEATURES + _ODOMETRY + _BEARING + 2
        self.joined = nn.Sequential(nn.Linear(seen, shape.hidden), nn.ReLU(inplace=True))
        self.memory = nn.GRU(shape.hidden, shape.hidden, batch_first=True)
        self.thought = nn.Sequential(nn.Linear(2 * shape.hidden, shape.hidden), nn.ReLU(inplace=True))
        self.choice = nn.Linear(shape.hidden, N_ACTIONS)

    def look(self, pictures: Any) -> Any:
        """Encode pictures: (n, H, W, 4) uint8 to (n, features)."""
        # As they lie in memory, colours last: on a CPU convolutions take half the time so.
        return self.eye(pictures.permute(0, 3, 1, 2).float().div(127.5).sub(1.0))

    def understand(self, tokens: Any, images: Any, told_by_image: Any) -> Any:
        """Encode goals.

        Parameters
        ----------
        tokens : (n, length) int64
        images : (n, H, W, 4) uint8
            Black where the goal has none.
        told_by_image : (n,) bool

        Returns
        -------
        (n, features)
        """
        said = functional.relu(self.phrase(self.words(tokens).transpose(1, 2)))
        said = said.masked_fill((tokens == 0)[:, None], 0.0).amax(dim=2)
        shown = self.look(images) * told_by_image[:, None]
        return self.goal(torch.cat([said, shown, told_by_image[:, None].float()], dim=1))

    def forward(
        self, pictures: Any, goal: Any, previous: Any, odometry: Any, remaining: Any, mask: Any, memory: Any = None
    ) -> tuple[Any, Any, Any]:
        """Choose actions for steps of episodes.

        Parameters
        ----------
        pictures : (m, views, H, W, 4) uint8 or None
            Of the steps that the mask has, row after row.
        goal : (n, features)
            Of the episodes.
        previous : (n, T) int64
            The action before each.
        odometry : (n, T, 4) float32
            x ahead, y left, z up in metres and yaw in radians, in the frame of the start.
        remaining : (n, T) float32
            Actions left.
        mask : (n, T) bool
            Which steps there are: those of an episode come first.
        memory : (1, n, hidden + 13), optional
            Of the steps before; `blank` where absent.

        Returns
        -------
        logits : (n, T, 16)
        guess : Guess
            Where the goal is thought to be.
        memory : (1, n, hidden + 13)
        """
        n, steps = mask.shape
        memory = self.blank(n).to(odometry.device) if memory is None else memory
        seen = goal[:, None].expand(n, steps, -1)
        if pictures is not None:
            looked = self.look(pictures.flatten(0, 1)).reshape(len(pictures), -1)
            flat = torch.zeros(n * steps, looked.shape[1], dtype=looked.dtype, device=looked.device)
            rows = mask.flatten().nonzero()[:, 0]
            seen = flat.index_copy(0, rows, looked).reshape(n, steps, -1)
        guess, sums = self.whereabouts(seen, goal, odometry, memory[0, :, -SUMS:])
        parts = [
            seen, goal[:, None].expand(n, steps, -1), self.action(previous), reckoned(odometry), bearing(guess),
            remaining[..., None] / 30.0, (remaining / _BUDGET).sqrt()[..., None],
        ]  # fmt: skip
        joined = self.joined(torch.cat([part.to(goal.dtype) for part in parts], dim=2))
        kept, last = self.memory(joined, memory[..., :-SUMS].to(joined.dtype).contiguous())
        thought = self.thought(torch.cat([joined, kept], dim=2))
        return self.choice(thought), guess, torch.cat([last.float(), sums[None]], dim=2)

    def blank(self, n: int) -> Any:
        """Return the memory of n episodes that begin: (1, n, hidden + 13)."""
        return torch.zeros(1, n, self.shape.hidden + SUMS)


def reckoned(odometry: Any) -> Any:
    """Places and headings as numbers that tell them apart: (..., 4) to (..., 29)."""
    yaw = odometry[..., 3:]
    return torch.cat([_waves(odometry[..., :3]), torch.sin(yaw), torch.cos(yaw)], dim=-1)


def bearing(guess: Guess) -> Any:
    """Where the goal is thought to be, as numbers: (n, T, 31); choices teach it nothing."""
    away_m = guess.offset.detach() * UNIT_M
    flat = torch.linalg.vector_norm(away_m[..., :2], dim=-1, keepdim=True)
    towards = away_m[..., :2] / (flat + 0.5)
    return torch.cat([_waves(away_m), towards, torch.log1p(flat), guess.sure.detach().log()], dim=-1)


def _waves(place_m: Any) -> Any:
    waves = [f(place_m * (2.0 * np.pi / length)) for length in _WAVES_M for f in (torch.sin, torch.cos)]
    return torch.cat([place_m / _FAR_M, *waves], dim=-1)
