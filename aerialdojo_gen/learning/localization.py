"""Where the body and its goal are: estimated at every step from pictures and words, fused by own motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import torch
from torch import nn
from torch.nn import functional

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
    apart = torch.remainder(sectors - sector + _HEADINGS / 2, _HEADINGS) - _HEADINGS / 2
    turned = functional.cross_entropy(heading, (1.0 - apart.abs()).clamp(min=0.0))
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
