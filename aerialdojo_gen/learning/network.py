"""The policy network: a small CNN for views and goal image, word embeddings, localization, choice of actions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.geometry.motion import TURNS
from aerialdojo_gen.learning.encoding import PATCH_PX
from aerialdojo_gen.learning.localization import UNIT_M, Localization, LocalizationOutput
from aerialdojo_gen.store.schemas import STOP

_WIDTH = 128


def as_patches(pictures: Any) -> Any:
    """Cut pictures into patches, -1 to 1: (n, H, W, 4) uint8 to (n, H / 4, W / 4, 64)."""
    n, height, width, bytes_a_pixel = pictures.shape
    rows, columns = height // PATCH_PX, width // PATCH_PX
    cut = pictures.view(n, rows, PATCH_PX, columns, PATCH_PX, bytes_a_pixel).transpose(2, 3)
    return cut.reshape(n, rows, columns, -1).float().div(127.5).sub(1.0)


class PatchClassifier(nn.Module):  # type: ignore[misc]  # no type checker sees torch here
    """Chances that the words of objects' names name what a patch of a picture shows.

    Objects of a kind look alike in every scene: what is learned here holds in scenes that were never seen. It shares
    nothing with the network that localizes, which learns scenes by heart.
    """

    def __init__(self, words: int, channels: tuple[int, int, int]) -> None:
        super().__init__()
        fine, middle, coarse = channels
        self.patches = nn.Linear(4 * PATCH_PX**2, fine)
        self.halved = nn.Conv2d(fine, middle, 3, stride=2, padding=1)
        self.quartered = nn.Conv2d(middle, coarse, 3, stride=2, padding=1)
        # A patch's own pixels, and what surrounds it, of two sizes.
        self.joined = nn.ModuleList(nn.Conv2d(n, _WIDTH, 1) for n in channels)
        self.words = nn.Linear(_WIDTH, words + 1)
        self.to(memory_format=torch.channels_last)

    def forward(self, pictures: Any, keep: Any = None) -> Any:
        """Name patches of pictures (n, H, W, 4): logits (patches, words + 1), the last of no object."""
        cut = as_patches(pictures)
        n, rows, columns, _ = cut.shape
        fine = functional.relu(self.patches(cut))
        fine = fine.permute(0, 3, 1, 2)
        middle = functional.relu(self.halved(fine))
        coarse = functional.relu(self.quartered(middle))
        known = 0.0
        for layer, of in zip(self.joined, (fine, middle, coarse), strict=True):
            known = known + functional.interpolate(
                layer(of), size=(rows, columns), mode="bilinear", align_corners=False
            )
        flat = functional.relu(known).permute(0, 2, 3, 1).reshape(n * rows * columns, _WIDTH)
        if keep is not None:
            return self.words(flat[keep])
        return self.words(flat).view(n, rows * columns, -1)


# Wave lengths of the sines that encode places, metres; beside them the place itself.
_WAVES_M = (4.0, 12.0, 36.0, 108.0)
_FAR_M = 30.0
_BEARING = 3 * (2 * len(_WAVES_M) + 1) + 3
_DROPOUT = 0.1
# Where a policy stops, metres: within the 3 m of success by what it may be mistaken.
ARRIVED_M = 2.0
# Chances of actions are multiplied by this power of the chance that they are free.
CAUTION = 3.0
_NEVER = 1e6


@dataclass(frozen=True)
class Shape:
    """Sizes of a network."""

    words: int  # Numbers of the vocabulary, padding and the unknown word among them
    views: int  # Pictures of a step, and their edge
    size_px: int
    scenes: int  # That are learned
    channels: tuple[int, int, int]
    features: int  # See `aerialdojo_gen.learning.recipe.ModelConfig`
    word_features: int
    hidden: int
    named: int = 0  # Words that pictures are searched for; without any there is nothing that searches


class PolicyOutput(NamedTuple):
    """What comes out."""

    logits: Any  # (n, T, 16); of the actions
    blocked: Any  # (n, T, 16); logits of each action's touching a surface or leaving the flight volume
    estimate: LocalizationOutput  # Where the goal is thought to be, or was said to be

    def actions(self, back: Any) -> Any:
        """Choose the likeliest free action, (n, T), never a turn that leads back; Stop within 2 m of the goal."""
        free = functional.logsigmoid(-self.blocked.float())
        moving = self.logits.float() + CAUTION * free
        moving[..., STOP] = -torch.inf
        likeliest = moving.argmax(dim=-1, keepdim=True)
        turns = torch.from_numpy(TURNS[:N_ACTIONS] != 0).to(moving.device)
        # Where all of them lead back, any but Stop.
        onward = (moving - _NEVER * (turns | back)).argmax(dim=-1)
        chosen = torch.where(back.gather(-1, likeliest)[..., 0], onward, likeliest[..., 0])
        near = torch.linalg.vector_norm(self.estimate.offset, dim=-1) * UNIT_M <= ARRIVED_M
        return chosen.masked_fill(near, STOP)


class Network(nn.Module):  # type: ignore[misc]  # no type checker sees torch here
    """Actions from pictures, goal and own motion.

    What it remembers is its map: where pictures of earlier steps put the body. A memory of its own, a GRU beside the
    map or no more than the action before, went on turning once it had begun to turn, for that is what references do
    (the copycat problem of imitation learning: Wen et al. 2020). The planner needs none: its route from a pose
    depends on nothing before.
    """

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.shape = shape
        patches, *channels = shape.channels
        # Patches of 4 x 4 pixels first, as one product of matrices: layers of few channels are what takes a CPU long.
        self.patches = nn.Linear(4 * PATCH_PX**2, patches)
        # The first not in place: what it is given is a view, whose gradient would be copied, a fifth of the time.
        layers: list[Any] = [nn.ReLU()]
        before = patches
        for n in channels:
            layers += [nn.Conv2d(before, n, 3, stride=2, padding=1), nn.ReLU(inplace=True)]
            before = n
        edge = shape.size_px // 16
        self.eye = nn.Sequential(
            *layers, nn.Flatten(), nn.Linear(before * edge * edge, shape.features), nn.LayerNorm(shape.features)
        ).to(memory_format=torch.channels_last)
        # By hand, as `nn.Embedding` does: where a tensor has no memory its `normal_` imports a compiler, for seconds.
        table = torch.empty(shape.words, shape.word_features)
        if not table.is_meta:
            nn.init.normal_(table)
            table[0] = 0.0
        self.words = nn.Embedding.from_pretrained(table, freeze=False, padding_idx=0)
        self.phrase = nn.Conv1d(shape.word_features, shape.features, 3, padding=1)
        # Whether the goal is a picture stands beside what it shows.
        self.goal = nn.Sequential(nn.Linear(2 * shape.features + 1, shape.features), nn.ReLU(inplace=True))
        # Without pictures the estimate is by words alone.
        pictured = max(shape.views, 1) * shape.features
        self.whereabouts = Localization(pictured, shape.features, shape.hidden, shape.scenes)
        self.choice = nn.Sequential(
            nn.Linear(pictured + _BEARING, shape.hidden), nn.ReLU(inplace=True), nn.Dropout(_DROPOUT),
            nn.Linear(shape.hidden, shape.hidden), nn.ReLU(inplace=True), nn.Linear(shape.hidden, N_ACTIONS),
        )  # fmt: skip

        self.blocked = nn.Sequential(
            nn.Linear(pictured, shape.hidden), nn.ReLU(inplace=True), nn.Linear(shape.hidden, N_ACTIONS)
        )
        # The last, so that the others begin as they do without it.
        self.sight = PatchClassifier(shape.named, shape.channels) if shape.named else None

    def encode_pictures(self, pictures: Any) -> Any:
        """Encode pictures: (n, H, W, 4) uint8 to (n, features)."""
        patches = self.patches(as_patches(pictures))
        # As they lie in memory, channels last: on a CPU convolutions take half the time so.
        return self.eye(patches.permute(0, 3, 1, 2))

    def encode_goal(self, tokens: Any, images: Any, goal_by_image: Any) -> Any:
        """Encode goals from tokens (n, length) and pictures (n, H, W, 4) uint8; (n, features)."""
        said = functional.relu(self.phrase(self.words(tokens).transpose(1, 2)))
        said = said.masked_fill((tokens == 0)[:, None], 0.0).amax(dim=2)
        shown = self.encode_pictures(images) * goal_by_image[:, None]
        return self.goal(torch.cat([said, shown, goal_by_image[:, None].float()], dim=1))

    def forward(
        self, pictures: Any, goal: Any, odometry: Any, mask: Any, memory: Any = None
    ) -> tuple[PolicyOutput, Any]:
        """Policy outputs for steps (n, T) of episodes, odometry in the start's frame; also the memory (n, sums)."""
        memory = self.blank(len(mask)).to(odometry.device) if memory is None else memory
        seen = self.features(pictures, goal, mask)
        estimate, memory = self.whereabouts(seen, goal, odometry, memory)
        return self.choose(seen, estimate), memory

    def features(self, pictures: Any, goal: Any, mask: Any) -> Any:
        """Encode what is seen at steps, (n, T, ...); of who sees nothing, the goal. Parameters are `forward`'s."""
        n, steps = mask.shape
        if pictures is None:
            return goal[:, None].expand(n, steps, -1)
        encoded = self.encode_pictures(pictures.flatten(0, 1)).reshape(len(pictures), -1)
        flat = torch.zeros(n * steps, encoded.shape[1], dtype=encoded.dtype, device=encoded.device)
        rows = mask.flatten().nonzero()[:, 0]
        return flat.index_copy(0, rows, encoded).reshape(n, steps, -1)

    def choose(self, seen: Any, estimate: LocalizationOutput) -> PolicyOutput:
        """Choose actions by what is seen, (n, T, ...), and where the goal is thought to be, and by nothing else."""
        # With the goal's words a choice learns routes of the training's scenes by heart, and beside a map that is
        # still poor it learns not to go by the map.
        logits = self.choice(torch.cat([seen, bearing(estimate).to(seen.dtype)], dim=2))
        return PolicyOutput(logits, self.blocked(seen), estimate)

    def blank(self, n: int) -> Any:
        """Return the memory of n episodes that begin: (n, sums)."""
        return torch.zeros(n, self.whereabouts.sums)


def bearing(estimate: LocalizationOutput) -> Any:
    """Where the goal is thought to be, as numbers: (n, T, 30); choices teach it nothing."""
    away_m = estimate.offset.detach() * UNIT_M
    flat = torch.linalg.vector_norm(away_m[..., :2], dim=-1, keepdim=True)
    towards = away_m[..., :2] / (flat + 0.5)
    return torch.cat([_waves(away_m), towards, torch.log1p(flat)], dim=-1)


def _waves(place_m: Any) -> Any:
    waves = [f(place_m * (2.0 * np.pi / length)) for length in _WAVES_M for f in (torch.sin, torch.cos)]
    return torch.cat([place_m / _FAR_M, *waves], dim=-1)
