"""Where the body and its goal are: guessed at every step from pictures and words, joined over steps by own motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import torch
from torch import nn
from torch.nn import functional

# Networks reckon places in units of this many metres.
UNIT_M = 10.0
# Places are told as chances of intervals of each axis, headings as those of sectors.
# Intervals reach beyond every scene.
_CELL_M, _STOREY_M, _SECTOR_RAD = 4.0, 2.0, math.radians(15.0)
_AXES = (_CELL_M, 64, -128.0), (_CELL_M, 64, -128.0), (_STOREY_M, 36, -24.0)
_PLACES, _HEADINGS = sum(n for _, n, _ in _AXES), round(2.0 * math.pi / _SECTOR_RAD)
# Intervals to either side of the likeliest one whose mean is a place.
_BESIDE = 2
# Sums over the steps so far: of weights, of the start's heading, of places, of own motion; of the goal's weights and
# places.
SUMS = 1 + 2 + 3 + 3 + 1 + 3
_LEAST = 1e-3


class Guess(NamedTuple):
    """Where things are thought to be, in units of 10 m.

    Attributes
    ----------
    offset : (n, T, 3)
        The goal ahead, left and up of the body, by all steps so far.
    place : (n, T, 164)
        Logits of where the body is in the scene's frame, by the step's pictures alone: 64 intervals of x, 64 of y, 36
        of z.
    heading : (n, T, 24)
        Logits of sectors of the body's yaw, by the step's pictures alone.
    goal : (n, T, 164)
        Logits of where the goal is in the scene's frame, by what is said of it and the step's pictures.
    sure : (n, T, 1)
        Weights of the body's places so far, together.
    """

    offset: Any
    place: Any
    heading: Any
    goal: Any
    sure: Any


class Whereabouts(nn.Module):  # type: ignore[misc]  # torch is looked at by no type checker here
    """Guess where the goal is.

    Own motion is used for one thing alone: to carry guesses of earlier steps over to the present one. So the goal's
    place cannot be read off the actions that a reference takes towards it, which tell it in training and never in
    flight (causal confusion in imitation learning: de Haan, Jayaraman and Levine 2019).

    Parameters
    ----------
    seen, goal, hidden : int
        Numbers of a step's pictures, of a goal, and of the layers between.
    """

    def __init__(self, seen: int, goal: int, hidden: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Linear(seen, hidden), nn.ReLU(inplace=True), nn.Linear(hidden, _PLACES + _HEADINGS + 1)
        )
        self.target = nn.Sequential(
            nn.Linear(seen + goal, hidden), nn.ReLU(inplace=True), nn.Linear(hidden, _PLACES + 1)
        )

    def found(self, seen: Any) -> tuple[Any, Any, Any]:
        """Guess where bodies are by pictures alone: logits of places and headings, and how far to trust them."""
        body = self.body(seen).float()
        return body[..., :_PLACES], body[..., _PLACES:-1], functional.softplus(body[..., -1:]) + _LEAST

    def forward(self, seen: Any, goal: Any, odometry: Any, sums: Any) -> tuple[Guess, Any]:
        """Guess at every step of episodes.

        Parameters
        ----------
        seen : (n, T, seen)
        goal : (n, goal)
        odometry : (n, T, 4)
            x ahead, y left, z up in metres and yaw in radians, in the frame of the start.
        sums : (n, 13)
            Of the steps before.

        Returns
        -------
        Guess
        (n, 13)
            Sums with these steps.
        """
        steps = seen.shape[1]
        seen_at, facing, sure = self.found(seen)
        target = self.target(torch.cat([seen, goal[:, None].expand(-1, steps, -1)], dim=2)).float()
        weight = functional.softplus(target[..., -1:]) + _LEAST
        # The offset's loss teaches which steps to trust; intervals learn by their own, which is steadier.
        place = places(seen_at.detach()) / UNIT_M
        goal_place = places(target[..., :_PLACES].detach()) / UNIT_M
        moved, yaw = odometry[..., :3] / UNIT_M, odometry[..., 3]
        turn = torch.stack([yaw.cos(), yaw.sin()], dim=-1)
        begun = _seen_from(directions(facing.detach()), turn)
        added = torch.cat([sure, sure * begun, sure * place, sure * moved, weight, weight * goal_place], dim=2)
        total = sums[:, None].float() + added.cumsum(dim=1)
        all_sure, start, been, moves, all_weight, goals = total.split([1, 2, 3, 3, 1, 3], dim=2)
        start = functional.normalize(start, dim=-1, eps=1e-4)
        # From the mean place to the goal, in the start's frame: the mean of the moves leads to that place.
        away = goals / all_weight - been / all_sure
        ahead = torch.cat([_seen_from(away[..., :2], start), away[..., 2:]], dim=-1) + moves / all_sure - moved
        offset = torch.cat([_seen_from(ahead[..., :2], turn), ahead[..., 2:]], dim=-1)
        return Guess(offset, seen_at, facing, target[..., :_PLACES], all_sure), total[:, -1]


def _seen_from(vector: Any, by: Any) -> Any:
    """Turn plane vectors back by a heading's cosine and sine: what they are, seen from there."""
    x, y = vector.unbind(-1)
    c, s = by.unbind(-1)
    return torch.stack([c * x + s * y, c * y - s * x], dim=-1)


def places(logits: Any) -> Any:
    """Return places that logits tell, metres, (..., 164) to (..., 3): the mean about each axis' likeliest part."""
    out = []
    for one, (width, n, low) in zip(logits.split([n for _, n, _ in _AXES], dim=-1), _AXES, strict=True):
        number = torch.arange(n, device=logits.device)
        near = (number - one.argmax(dim=-1, keepdim=True)).abs() <= _BESIDE
        chance = one.masked_fill(~near, -torch.inf).softmax(dim=-1)
        out.append((chance * (low + (number + 0.5) * width)).sum(dim=-1))
    return torch.stack(out, dim=-1)


def directions(logits: Any) -> Any:
    """Return the mean directions of sectors: (..., 24) to (..., 2), cosine and sine of the yaw."""
    yaw = (torch.arange(_HEADINGS, device=logits.device) + 0.5) * _SECTOR_RAD - math.pi
    mean = logits.softmax(dim=-1) @ torch.stack([yaw.cos(), yaw.sin()], dim=-1)
    return functional.normalize(mean, dim=-1, eps=1e-4)


def missed(guess: Guess, batch: Mapping[str, Any]) -> Any:
    """Return the loss of guesses: of the goal seen from the body, and of what that was guessed from.

    Parameters
    ----------
    guess : Guess
    batch : mapping of str to Tensor
        ``mask``, ``offset`` and ``pose`` as `aerialdojo_gen.learning.steps.Pool.batch` gives them.

    Returns
    -------
    ()
        In 10 m; beside it the mean cross-entropies of the intervals.
    """
    mask = batch["mask"]
    offset, pose = batch["offset"][mask] / UNIT_M, batch["pose"][mask]
    # Turned by the yaw: seen from a heading of as much to the other side.
    back = torch.stack([pose[:, 3].cos(), -pose[:, 3].sin()], dim=-1)
    away_m = torch.cat([_seen_from(offset[:, :2], back), offset[:, 2:]], dim=-1) * UNIT_M
    own = astray(guess.place[mask], guess.heading[mask], pose)
    return (
        functional.smooth_l1_loss(guess.offset[mask], offset) + own + _unlike(guess.goal[mask], pose[:, :3] + away_m)
    )


def astray(place: Any, heading: Any, pose: Any) -> Any:
    """Return the loss of guesses of where bodies are: logits (m, 164) and (m, 24) of poses (m, 4)."""
    sector = (torch.remainder(pose[:, 3] + math.pi, 2.0 * math.pi) / _SECTOR_RAD - 0.5)[:, None]
    number = torch.arange(_HEADINGS, device=pose.device)
    apart = torch.remainder(number - sector + _HEADINGS / 2, _HEADINGS) - _HEADINGS / 2
    turned = functional.cross_entropy(heading, (1.0 - apart.abs()).clamp(min=0.0))
    return turned + _unlike(place, pose[:, :3])


def _unlike(logits: Any, place_m: Any) -> Any:
    """Cross-entropy of intervals: of each axis the two whose middles the place lies between, by how near it is."""
    total = 0.0
    split = logits.split([n for _, n, _ in _AXES], dim=-1)
    for one, at, (width, n, low) in zip(split, place_m.unbind(-1), _AXES, strict=True):
        where = ((at - low) / width - 0.5).clamp(0.0, n - 1.0)[:, None]
        chance = (1.0 - (torch.arange(n, device=at.device) - where).abs()).clamp(min=0.0)
        total = total + functional.cross_entropy(one, chance)
    return total
