"""The policy network: a small CNN for views and goal image, word embeddings, localization, choice of actions.

Where the body and its goal are is estimated at every step from pictures and words, and fused by own motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS
from aerialdojo_gen.geometry.motion import TURNS
from aerialdojo_gen.learning.encoding import PATCH_PX
from aerialdojo_gen.store.schemas import STOP

# Networks reckon places in units of this many metres.
UNIT_M = 10.0
# Places are distributions over intervals of each axis, headings as those of sectors.
# Intervals reach beyond every scene.
_CELL_M, _STOREY_M, _SECTOR_RAD = 4.0, 2.0, math.radians(15.0)
_AXES = (_CELL_M, 64, -128.0), (_CELL_M, 64, -128.0), (_STOREY_M, 36, -24.0)
_PLACES, _HEADINGS = sum(n for _, n, _ in _AXES), round(2.0 * math.pi / _SECTOR_RAD)
# Intervals to either side of the likeliest one whose mean is a place.
_NEIGHBOURS = 2
# Sums over the steps so far: of each axis' weights, of weighted places, of own motion weighted as each axis is (ahead
# and left for x and for y, up for z), of the start's heading; beside them those of the scenes' logits.
_SUMS = 3 + 3 + 5 + 2
_LEAST = 1e-3
# Least variance of a place, in units: what nearby steps have in common cannot be averaged away.
_FLOOR = 0.05


class LocalizationOutput(NamedTuple):
    """Where things are thought to be, in units of 10 m."""

    offset: Any  # (n, T, 3); the goal ahead, left and up of the body, by all steps so far
    place: Any  # (n, T, 164)
    heading: Any  # (n, T, 24); logits of sectors of the body's yaw, by the step's pictures alone
    scene: Any  # (n, T, scenes); logits of the scenes that were learned, by the step's pictures alone
    goal: Any  # (n, T, 164); logits of where the goal is in the scene's frame, by what is said of it and by the scene

    @property
    def scene_nats(self) -> Any:
        """How unsure each step's pictures are of which scene they show: (n, T), nats, 0 where there is no doubt."""
        log_chances = self.scene.log_softmax(dim=-1)
        return -(log_chances.exp() * log_chances).sum(dim=-1)

    def with_goal_offset(self, offset_m: Any) -> LocalizationOutput:
        """Set the goal where an offset (n, T, 3), metres ahead, left and up, says that it is."""
        return self._replace(offset=offset_m / UNIT_M)


class Localization(nn.Module):  # type: ignore[misc]  # no type checker sees torch here
    """Estimates where the goal is.

    Own motion has one use: to carry estimates of earlier steps over to the present one. Of the pictures the goal's
    estimate gets no more than which scene they show. So the goal's place cannot be read off the actions that a
    reference takes towards it, nor off what is seen on the way, which reveal it in training and never in flight
    (causal confusion in imitation learning: de Haan, Jayaraman and Levine 2019).
    """

    def __init__(self, seen: int, goal: int, hidden: int, scenes: int) -> None:
        super().__init__()
        self.scenes = scenes
        self.body = nn.Sequential(
            nn.Linear(seen, hidden), nn.ReLU(inplace=True), nn.Linear(hidden, _PLACES + _HEADINGS + scenes + 1)
        )
        self.target = nn.Sequential(
            nn.Linear(goal + scenes, hidden), nn.ReLU(inplace=True), nn.Linear(hidden, _PLACES)
        )

    @property
    def sums(self) -> int:
        """Numbers that are carried from step to step."""
        return _SUMS + self.scenes

    def locate(self, seen: Any) -> tuple[Any, Any, Any, Any]:
        """Localize bodies by pictures alone: logits of places, headings, scenes, and how far to trust them."""
        place, heading, scene, trust = self.body(seen).float().split([_PLACES, _HEADINGS, self.scenes, 1], dim=-1)
        return place, heading, scene, functional.softplus(trust) + _LEAST

    def forward(self, seen: Any, goal: Any, odometry: Any, sums: Any) -> tuple[LocalizationOutput, Any]:
        """Estimate poses for steps (n, T) of episodes from features and odometry; also the sums (n, sums) after."""
        steps = seen.shape[1]
        seen_at, facing, scene, trust = self.locate(seen)
        # The offset's loss teaches which steps to trust; intervals learn by their own, which is steadier.
        place, spread = places(seen_at.detach())
        place, weight = place / UNIT_M, trust / ((spread / UNIT_M).square() + _FLOOR**2)
        moved, yaw = odometry[..., :3] / UNIT_M, odometry[..., 3]
        turn = torch.stack([yaw.cos(), yaw.sin()], dim=-1)
        begun = _rotate_back(directions(facing.detach()), turn) * trust
        moves = torch.cat(
            [weight[..., :1] * moved[..., :2], weight[..., 1:2] * moved[..., :2], weight[..., 2:] * moved[..., 2:]],
            dim=-1,
        )
        added = torch.cat([weight, weight * place, moves, begun, scene.detach()], dim=2)
        total = sums[:, None].float() + added.cumsum(dim=1)
        weights, been, moves, start, known = total.split([3, 3, 5, 2, self.scenes], dim=2)
        turned = torch.linalg.vector_norm(start, dim=-1, keepdim=True)
        start = start / turned.clamp(min=1e-4)
        where = known.softmax(dim=-1)
        target = self.target(torch.cat([goal[:, None].expand(-1, steps, -1), where.to(goal.dtype)], dim=2)).float()
        goal_at, _ = places(target.detach())
        # The mean place minus where own motion leads from the start, turned as the start faced, is the start.
        c, s = start.unbind(-1)
        moved_start = torch.stack(
            [c * moves[..., 0] - s * moves[..., 1], s * moves[..., 2] + c * moves[..., 3], moves[..., 4]], dim=-1
        )
        away = goal_at / UNIT_M - (been - moved_start) / weights
        ahead = torch.cat([_rotate_back(away[..., :2], start), away[..., 2:]], dim=-1) - moved
        offset = torch.cat([_rotate_back(ahead[..., :2], turn), ahead[..., 2:]], dim=-1)
        return LocalizationOutput(offset, seen_at, facing, scene, target), total[:, -1]


def _rotate_back(vector: Any, by: Any) -> Any:
    """Turn plane vectors back by a heading's cosine and sine: what they are, seen from there."""
    x, y = vector.unbind(-1)
    c, s = by.unbind(-1)
    return torch.stack([c * x + s * y, c * y - s * x], dim=-1)


def places(logits: Any) -> tuple[Any, Any]:
    """Return the means about each axis' likeliest part, and the spreads of all chances: (..., 164) to (..., 3), m."""
    out, spread = [], []
    for one, (width, n, low) in zip(logits.split([n for _, n, _ in _AXES], dim=-1), _AXES, strict=True):
        number = torch.arange(n, device=logits.device)
        middle = low + (number + 0.5) * width
        near = (number - one.argmax(dim=-1, keepdim=True)).abs() <= _NEIGHBOURS
        place = (one.masked_fill(~near, -torch.inf).softmax(dim=-1) * middle).sum(dim=-1, keepdim=True)
        out.append(place)
        spread.append((one.softmax(dim=-1) * (middle - place).square()).sum(dim=-1, keepdim=True).sqrt())
    return torch.cat(out, dim=-1), torch.cat(spread, dim=-1)


def directions(logits: Any) -> Any:
    """Return the mean directions of sectors: (..., 24) to (..., 2), the shorter the less is known."""
    yaw = (torch.arange(_HEADINGS, device=logits.device) + 0.5) * _SECTOR_RAD - math.pi
    mean = logits.softmax(dim=-1) @ torch.stack([yaw.cos(), yaw.sin()], dim=-1)
    length = torch.linalg.vector_norm(mean, dim=-1, keepdim=True)
    # The concentration of a von Mises distribution with that mean, at most some 20: Mardia and Jupp 2000, as Banerjee
    # et al. 2005 simplify it for two dimensions.
    return mean * (2.0 - length.square()) / (1.05 - length.square())


def offset_loss(estimate: LocalizationOutput, batch: Mapping[str, Any]) -> Any:
    """Loss of the goal offset, in units of 10 m, and mean cross-entropies of the intervals."""
    mask = batch["mask"]
    offset, pose = batch["offset"][mask] / UNIT_M, batch["pose"][mask]
    # Turned by the yaw: seen from a heading of as much to the other side.
    back = torch.stack([pose[:, 3].cos(), -pose[:, 3].sin()], dim=-1)
    away_m = torch.cat([_rotate_back(offset[:, :2], back), offset[:, 2:]], dim=-1) * UNIT_M
    scene = batch["scene"][:, None].expand(mask.shape)[mask]
    own = pose_loss(estimate.place[mask], estimate.heading[mask], estimate.scene[mask], pose, scene)
    at_goal = _interval_loss(estimate.goal[mask], pose[:, :3] + away_m)
    return functional.smooth_l1_loss(estimate.offset[mask], offset) + own + at_goal


def pose_loss(place: Any, heading: Any, scene: Any, pose: Any, number: Any) -> Any:
    """Cross-entropy loss of place (m, 164), heading (m, 24) and scene (m, scenes) logits against poses (m, 4)."""
    sector = (torch.remainder(pose[:, 3] + math.pi, 2.0 * math.pi) / _SECTOR_RAD - 0.5)[:, None]
    sectors = torch.arange(_HEADINGS, device=pose.device)
    distance = torch.remainder(sectors - sector + _HEADINGS / 2, _HEADINGS) - _HEADINGS / 2
    turned = functional.cross_entropy(heading, (1.0 - distance.abs()).clamp(min=0.0))
    return turned + _interval_loss(place, pose[:, :3]) + functional.cross_entropy(scene, number)


def _interval_loss(logits: Any, place_m: Any) -> Any:
    """Cross-entropy of intervals: of each axis the two whose middles the place lies between, by how near it is."""
    total = 0.0
    split = logits.split([n for _, n, _ in _AXES], dim=-1)
    for one, at, (width, n, low) in zip(split, place_m.unbind(-1), _AXES, strict=True):
        where = ((at - low) / width - 0.5).clamp(0.0, n - 1.0)[:, None]
        chance = (1.0 - (torch.arange(n, device=at.device) - where).abs()).clamp(min=0.0)
        total = total + functional.cross_entropy(one, chance)
    return total


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
        fine = functional.relu(self.patches(cut)).permute(0, 3, 1, 2)
        middle = functional.relu(self.halved(fine))
        coarse = functional.relu(self.quartered(middle))
        joined = 0.0
        for layer, of in zip(self.joined, (fine, middle, coarse), strict=True):
            joined = joined + functional.interpolate(layer(of), (rows, columns), mode="bilinear", align_corners=False)
        flat = functional.relu(joined).permute(0, 2, 3, 1).reshape(n * rows * columns, _WIDTH)
        return self.words(flat).view(n, rows * columns, -1) if keep is None else self.words(flat[keep])


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
        words = functional.relu(self.phrase(self.words(tokens).transpose(1, 2)))
        words = words.masked_fill((tokens == 0)[:, None], 0.0).amax(dim=2)
        shown = self.encode_pictures(images) * goal_by_image[:, None]
        return self.goal(torch.cat([words, shown, goal_by_image[:, None].float()], dim=1))

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
    waves = [f(away_m * (2.0 * np.pi / length)) for length in _WAVES_M for f in (torch.sin, torch.cos)]
    return torch.cat([away_m / _FAR_M, *waves, towards, torch.log1p(flat)], dim=-1)
