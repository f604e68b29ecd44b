"""What an agent is given: the goal, the rules, and an observation before every action. There is nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.constants import FOV_DEG, RADIUS_M, WHEELBASE_M
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import as_names, check_known
from aerialdojo_gen.geometry.cameras import Camera
from aerialdojo_gen.scenes.light import LIGHTS, OWN
from aerialdojo_gen.store.schemas import APPROACH, VIEWS

# The actions that an agent can choose: all but Approach.
N_ACTIONS = APPROACH


@dataclass(frozen=True)
class Sensors:
    """The cameras of the body, all taken at once before every action (paper: sensors)."""

    # A name alone does for one; empty for an agent that flies blind, and then nothing is rendered
    views: tuple[str, ...] = VIEWS
    rgb: bool = True  # Whether pictures, and whether depth, are handed out
    depth: bool = True
    width: int = 640  # Pixels
    height: int = 640
    fov_deg: float = FOV_DEG  # Horizontal field of view, degrees
    max_depth_m: float = 65.535  # Range of the depth camera, metres
    # ``"scene"`` for the scene's own, ``"random"`` for one of each task, or a light's name
    light: str = OWN

    def __post_init__(self) -> None:
        """Refuse what no body carries; give views their one form."""
        object.__setattr__(self, "views", as_names(self.views))
        check_known("no view", self.views, VIEWS)
        if len(set(self.views)) != len(self.views):
            raise UsageError(f"duplicate view in {', '.join(self.views)}")
        check_known("no light", [self.light], LIGHTS)
        if self.max_depth_m <= 0.0:
            raise UsageError(f"a range of depth is above 0 m, not {self.max_depth_m} m")
        try:
            _ = self.camera
        except ValueError as error:
            raise UsageError(str(error)) from None

    @property
    def blind(self) -> bool:
        """Whether there is nothing to render."""
        return not self.views or not (self.rgb or self.depth)

    @property
    def camera(self) -> Camera:
        """Intrinsics, the same for every view."""
        return Camera(self.width, self.height, self.fov_deg)


BLIND = Sensors(views=(), rgb=False, depth=False)


@dataclass(frozen=True)
class Rules:
    """What holds in every episode of a setting, and may be given to an agent (paper: embodiment, termination)."""

    action_budget: int  # Most actions, Stop included
    success_radius_m: float = 3.0  # How near to the goal viewpoint a Stop must be
    radius_m: float = RADIUS_M  # Of the body's collision sphere
    wheelbase_m: float = WHEELBASE_M  # Distance between opposite rotors
    sensors: Sensors = BLIND  # What observations hold


# What an agent may be given beside the paper's goal, on request.
HINTS = ("heading",)


@dataclass(frozen=True)
class Heading:
    """Which way the body faces at the start, as a compass would show it."""

    direction: str  # The nearest of the eight compass directions: of the same words as `Goal.direction`
    heading_deg: int  # Degrees clockwise from north, 0 to 359


@dataclass(frozen=True, eq=False)
class Goal:
    """The object to be found, as the paper describes it to an agent."""

    modality: str  # semantic (a description) or image (a picture)
    target_name: str  # What a person would call it
    landmark: str  # The landmark nearest to it
    direction: str  # One of eight compass directions from there to it
    description: str | None  # For semantic goals
    # For image goals, (H, W, 3) uint8, read-only: the object as the drone's front camera sees it from the goal
    # viewpoint, or, where it would not fit into the picture, from `image_distance_m` behind that viewpoint.
    image: NDArray[np.uint8] | None
    rules: Rules
    heading: Heading | None = None  # Of the start pose, where it is given (``--tell heading``)
    # For image goals: how far from the goal viewpoint the picture was taken, metres, straight back along the camera's
    # axis; None if unknown. A Stop where it was taken fails if that is more than the success radius.
    image_distance_m: float | None = None


@dataclass(frozen=True, eq=False)
class Observation:
    """What an agent has before it chooses an action. No pose: who wants one reckons it from the actions."""

    step: int  # Actions spent so far
    remaining_actions: int  # Actions left, Stop included
    refused: bool = False  # The last action would have left the flight volume: it was spent, and nothing moved
    rgb: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)  # By view: (H, W, 3), sRGB
    # By view: (H, W), planar depth along the optical axis, metres; 0 where there is nothing within range
    depth_m: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
