"""Sections of a pipeline file that several stages read: the drone's body, its camera, and what a task is."""

from __future__ import annotations

from operator import attrgetter
from types import SimpleNamespace
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from aerialdojo_gen.base.constants import FOV_DEG, NEAR_GOAL_M, RADIUS_M, SUCCESS_RADIUS_M, WHEELBASE_M


class Section(BaseModel):
    """Base of every section: frozen, and unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Embodiment(Section):
    """The drone's body (paper, section on the embodiment)."""

    radius_m: float = Field(RADIUS_M, gt=0, le=10, description="radius of the collision sphere")
    wheelbase_m: float = Field(
        WHEELBASE_M, gt=0, le=10, description="distance between opposite rotors; told to agents"
    )

    @model_validator(mode="after")
    def _rotors_are_inside(self) -> Embodiment:
        if self.wheelbase_m > 2 * self.radius_m:
            raise ValueError(
                f"wheelbase_m = {self.wheelbase_m:g} must be at most twice radius_m = {self.radius_m:g}: the rotors "
                "stick out of the collision sphere"
            )
        return self


class CameraConfig(Section):
    """The drone's camera: anchors are chosen, goals pictured and recordings made with it."""

    fov_deg: float = Field(FOV_DEG, gt=0, lt=180, description="horizontal field of view")


class Setting(Section):
    """One length setting (paper: Base, Standard, Long-Horizon)."""

    min_length_m: float = Field(ge=0, description="smallest length that belongs to it")
    max_length_m: float = Field(gt=0, le=10_000, description="smallest length that is too long for it")
    action_budget: int = Field(ge=1, description="most actions an episode may take, Stop included")

    @model_validator(mode="after")
    def _has_room(self) -> Setting:
        if self.min_length_m >= self.max_length_m:
            raise ValueError(
                f"min_length_m = {self.min_length_m:g} must be less than max_length_m = {self.max_length_m:g}"
            )
        return self


class TaskConfig(Section):
    """What a task is (paper, section on filtering)."""

    min_euclidean_m: float = Field(
        3.0, ge=SUCCESS_RADIUS_M, description="kept: d_E greater than this; a Stop at the start must not succeed"
    )
    max_approach_m: float = Field(
        1.0, gt=0, le=NEAR_GOAL_M, description="longest straight Approach at the end of a route; agents cannot fly it"
    )
    base: Setting = Setting(min_length_m=5, max_length_m=30, action_budget=90)
    standard: Setting = Setting(min_length_m=30, max_length_m=60, action_budget=180)
    long_horizon: Setting = Setting(min_length_m=60, max_length_m=100, action_budget=300)

    @model_validator(mode="after")
    def _settings_join(self) -> TaskConfig:
        if (self.base.max_length_m, self.standard.max_length_m) != (
            self.standard.min_length_m,
            self.long_horizon.min_length_m,
        ):
            raise ValueError("the settings must join: base.max_length_m = standard.min_length_m, and so on")
        budgets = (self.base.action_budget, self.standard.action_budget, self.long_horizon.action_budget)
        if budgets != tuple(sorted(budgets)):
            raise ValueError(f"longer routes need more actions: action_budget falls in {budgets}")
        return self


_DEFAULTS = SimpleNamespace(camera=CameraConfig(), task=TaskConfig(), searched_quota=None)


def shared(path: str) -> Any:
    """Declare a value that a stage reads and that is set elsewhere: `Pipeline` takes it from its attribute `path`."""
    return Field(attrgetter(path)(_DEFAULTS), json_schema_extra={"shared": path})


def shared_values(section: type[BaseModel]) -> dict[str, str]:
    """Name the values of a section that are set elsewhere, with the attribute of `Pipeline` that has them."""
    extras = {name: field.json_schema_extra for name, field in section.model_fields.items()}
    return {name: str(extra["shared"]) for name, extra in extras.items() if isinstance(extra, dict)}
