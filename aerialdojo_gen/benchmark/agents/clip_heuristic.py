"""CLIP-H: a baseline that learns nothing, and moves towards the view that looks most like the goal to CLIP."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.config.sections import ClipConfig
from aerialdojo_gen.base.errors import AssetError, UsageError
from aerialdojo_gen.benchmark.agents.base import AgentBase, Odometer
from aerialdojo_gen.benchmark.agents.depth_map import free_ahead_m
from aerialdojo_gen.benchmark.agents.goal import Goal, Observation, Sensors
from aerialdojo_gen.geometry.motion import DISPLACEMENTS
from aerialdojo_gen.pipeline.scoring.clip import ClipScorer, digest
from aerialdojo_gen.store.schemas import ACTION_NAMES, MOVE_DOWN_1, STOP, TURN_LEFT

_OPPOSITE = {"left": "right", "right": "left"}


class ClipHeuristicAgent(AgentBase):
    """CLIP-H of UAV-ON (Xiao et al. 2025), by the authors' ``policies/cliph.py``; docs/evaluate.md has the rule."""

    sensors = Sensors(width=224, height=224)

    def __init__(
        self,
        vision: str,
        text: str,
        tokenizer: str,
        stop: float = 0.30,  # Cosine of a view and a semantic goal's description at which it stops
        stop_image: float = 0.90,  # That of a view and an image goal's picture
        descend_m: float = 5.0,  # It moves down only where nothing in any view is as near as this
        boundary_m: float = 50.0,  # It turns left instead of leaving a square of twice this edge around its start
        clearance_m: float = 0.0,  # Free depth that a move must leave ahead; 0 to look at no depth, as CLIP-H
        move_m: int = 1,  # Length of a level move: 1, 3 or 5 m
    ) -> None:
        if move_m not in (1, 3, 5):
            raise ValueError(f"move_m is 1, 3 or 5, not {move_m}")
        self._config = ClipConfig(vision=Path(vision), text=Path(text), tokenizer=Path(tokenizer), sha256="")
        self._clip = ClipScorer(self._config)
        self._stops = {"semantic": stop, "image": stop_image}
        self._descend_m, self._boundary_m, self._clearance_m = descend_m, boundary_m, clearance_m
        sides = {"front": "Forward", "left": "Left", "right": "Right"}
        level = {view: ACTION_NAMES.index(f"Move{side}{move_m}") for view, side in sides.items()}
        self._moves = level | {"down": MOVE_DOWN_1}

    def check(self) -> str:
        """Embed a picture and a word before the run; AssetError where the two encoders do not belong together."""
        grey = np.full((1, 224, 224, 3), 128, np.uint8)
        picture, word = self._clip.embed_pictures(grey)[0], self._clip.embed_text("a car")
        if picture.shape != word.shape:
            raise AssetError(
                f"{self._config.vision} and {self._config.text} are encoders of two models: their embeddings have "
                f"{picture.size} and {word.size} numbers"
            )
        return f"{self._config.vision.name}, {self._config.text.name}: embeddings of {word.size} numbers"

    def used_options(self) -> dict[str, Any]:
        """Return the options with their defaults, and the digest of the model's files, for the log."""
        paths = {name: str(getattr(self._config, name)) for name in ("vision", "text", "tokenizer")}
        numbers = {name: getattr(self, f"_{name}") for name in ("descend_m", "boundary_m", "clearance_m")}
        stops = {"stop": self._stops["semantic"], "stop_image": self._stops["image"]}
        move = {"move_m": int(ACTION_NAMES[self._moves["front"]][-1])}
        return paths | stops | numbers | move | {"sha256": digest(self._config)}

    def reset(self, goal: Goal) -> None:
        """Begin an episode."""
        self._sensors = goal.rules.sensors
        self._views = [view for view in self._moves if view in self._sensors.views]
        if "front" not in self._views or not (self._sensors.rgb and self._sensors.depth):
            raise UsageError("the agent clip needs pictures and depth, of the front view at least")
        if goal.image is not None:
            self._wanted = self._clip.embed_pictures(goal.image[None])[0]
        else:
            self._wanted = self._clip.embed_text(goal.description or goal.target_name)
        self._stop_at = self._stops[goal.modality]
        self._radius_m = goal.rules.radius_m
        self._body = Odometer()
        self._before, self._said = STOP, ""

    def answer(self) -> str:
        """Return the cosines behind the last action."""
        return self._said

    def act(self, observation: Observation) -> int:
        """Compare the views with the goal, choose."""
        self._body.add(self._before, observation.refused)
        cosines = self._clip.embed_pictures(np.stack([observation.rgb[view] for view in self._views])) @ self._wanted
        self._said = ", ".join(f"{view} {cosine:.3f}" for view, cosine in zip(self._views, cosines, strict=True))
        ranked = [self._views[k] for k in np.argsort(-cosines, kind="stable")]
        if cosines.max() >= self._stop_at:
            return STOP
        towards = self._choose(ranked, observation.depth_m)
        action = self._moves[towards] if towards else TURN_LEFT
        after = self._body.place + self._body.displacement(action)
        if observation.refused or np.abs(after[:2]).max() > self._boundary_m:
            action = TURN_LEFT
        self._before = action
        return action

    def _choose(self, ranked: list[str], depth_m: Mapping[str, NDArray[np.float32]]) -> str:
        """Choose the best view that may be moved towards; empty if none may."""
        opposite = _OPPOSITE.get(ranked[0], "")
        if opposite and self._before == self._moves[opposite]:
            ranked = ranked[1:]
        nearest_m = min(float(np.where(depth > 0.0, depth, np.inf).min()) for depth in depth_m.values())
        if nearest_m <= self._descend_m:
            ranked = [view for view in ranked if view != "down"]
        return next((view for view in ranked if self._is_free(view, depth_m[view])), "")

    def _is_free(self, view: str, depth_m: NDArray[np.float32]) -> bool:
        if not self._clearance_m:
            return True
        metres = float(np.abs(DISPLACEMENTS[self._moves[view]]).sum())
        return metres + self._clearance_m <= free_ahead_m(depth_m, self._sensors, self._radius_m)
