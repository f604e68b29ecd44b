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
    """The cameras of the body, all taken at once before every action (paper: sensors).

    Attributes
    ----------
    views : tuple of str
        Of `aerialdojo_gen.store.schemas.VIEWS` (a name alone does for one); empty for an agent that flies blind,
        and then nothing is rendered.
    rgb, depth : bool
        Whether pictures, and whether depth, are handed out.
    width, height : int
        Pixels.
    fov_deg : float
        Horizontal field of view, degrees.
    max_depth_m : float
        Range of the depth camera, metres.
    light : str
        ``"scene"`` for the scene's own, ``"random"`` for one of each task, or ``"clear"``, ``"overcast"``,
        ``"haze"``, ``"dusk"``, ``"wet"``.
    """

    views: tuple[str, ...] = VIEWS
    rgb: bool = True
    depth: bool = True
    width: int = 640
    height: int = 640
    fov_deg: float = FOV_DEG
    max_depth_m: float = 65.535
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
    """What holds in every episode of a setting, and may be given to an agent (paper: embodiment, termination).

    Attributes
    ----------
    action_budget : int
        Most actions, Stop included.
    success_radius_m : float
        How near to the goal viewpoint a Stop must be.
    radius_m, wheelbase_m : float
        The body: radius of its collision sphere, distance between opposite rotors.
    sensors : Sensors
        What observations hold.
    """

    action_budget: int
    success_radius_m: float = 3.0
    radius_m: float = RADIUS_M
    wheelbase_m: float = WHEELBASE_M
    sensors: Sensors = BLIND


# What an agent may be given beside the paper's goal, on request.
HINTS = ("heading",)


@dataclass(frozen=True)
class Heading:
    """Which way the body faces at the start, as a compass would show it."""

    direction: str  # The nearest of the eight compass directions: of the same words as `Goal.direction`
    heading_deg: int  # Degrees clockwise from north, 0 to 359


@dataclass(frozen=True, eq=False)
class Goal:
    """The object to be found, as the paper describes it to an agent.

    Attributes
    ----------
    modality : str
        semantic (a description) or image (a picture).
    target_name : str
        What a person would call it.
    landmark, direction : str
        The landmark nearest to it, and one of eight compass directions from there to it.
    description : str or None
        For semantic goals.
    image : (H, W, 3) uint8 or None
        For image goals: the object as the drone's front camera sees it from the goal viewpoint, or, where it would
        not fit into the picture, from `image_distance_m` behind that viewpoint; read-only.
    rules : Rules
    heading : Heading or None
        Of the start pose, where it is given (``--tell heading``); None in the paper's setting.
    image_distance_m : float or None
        For image goals: how far from the goal viewpoint the picture was taken, metres, straight back along the
        camera's axis. A Stop where it was taken fails if that is more than the success radius. None if unknown.
    """

    modality: str
    target_name: str
    landmark: str
    direction: str
    description: str | None
    image: NDArray[np.uint8] | None
    rules: Rules
    heading: Heading | None = None
    image_distance_m: float | None = None


@dataclass(frozen=True, eq=False)
class Observation:
    """What the agent has before it chooses an action. No pose: an agent that wants one reckons it from its actions.

    Attributes
    ----------
    rgb : mapping of str to (H, W, 3) uint8
        By view, sRGB; empty without pictures.
    depth_m : mapping of str to (H, W) float32
        By view, planar depth along the optical axis, metres; 0 where there is nothing within range.
    step : int
        Actions spent so far.
    remaining_actions : int
        Actions left, Stop included.
    refused : bool
        The last action would have left the flight volume: it was spent, and the body did not move.
    """

    step: int
    remaining_actions: int
    refused: bool = False
    rgb: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)
    depth_m: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
