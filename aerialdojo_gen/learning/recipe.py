"""The recipe of a training: every key with its meaning, unit, default and bounds."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError, model_validator

from aerialdojo_gen.base.cli_context import PROGRAM
from aerialdojo_gen.base.config.shared import Section
from aerialdojo_gen.base.errors import ConfigError
from aerialdojo_gen.base.explain import explain
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.base.shipped import home

View = Literal["front", "left", "right", "down"]
SettingName = Literal["base", "standard", "long_horizon"]


class DataConfig(Section):
    """What is learned from, and what the body sees."""

    split: Literal["id_train", "ood_train", "train"] = Field("id_train", description="split of the release")
    settings: tuple[SettingName, ...] = Field(("base",), description="of the tasks; all where empty")
    scenes: tuple[str, ...] = Field((), description="names or globs; all of the split where empty")
    target_split: Literal["train", "test"] | None = Field(
        None, description="side of the split by objects, so that the other side's targets are held out"
    )
    runs: tuple[str, ...] = Field(
        (),
        description="runs of evaluate or fly whose successful flights are learned from, in place of the references",
    )
    limit: int | None = Field(None, ge=1, description="most trajectories, drawn evenly over the scenes")
    views: tuple[View, ...] = Field(("front",), description="cameras; none for a blind policy")
    size_px: int = Field(64, ge=32, le=256, description="edge of the pictures; a multiple of 16")
    looks: int = Field(0, ge=0, description="pictures a scene from within 3 m of its references, turned at random")
    validation_share: float = Field(
        0.02, ge=0, lt=0.5, description="trajectories that are kept for the accuracy on what was not trained on"
    )

    @model_validator(mode="after")
    def _check_images(self) -> DataConfig:
        if self.size_px % 16:
            raise ValueError("size_px is halved four times: a multiple of 16")
        if len(set(self.views)) != len(self.views):
            raise ValueError("duplicate view in views")
        return self


class ModelConfig(Section):
    """The policy's sizes."""

    channels: tuple[int, int, int] = Field((64, 96, 128), description="of the three layers of the CNN")
    features: int = Field(256, ge=8, le=4096, description="numbers that a view, or the goal's picture, becomes")
    word_features: int = Field(96, ge=4, le=2048, description="numbers that a word of the goal becomes")
    hidden: int = Field(384, ge=8, le=4096, description="width of the layers that choose, place and warn")


class TrainingConfig(Section):
    """Behaviour cloning."""

    epochs: int = Field(10, ge=1, le=10_000, description="times that every step is gone through")
    batch_steps: int = Field(2048, ge=1, le=1_000_000, description="steps of trajectories a batch has, at most")
    learning_rate: float = Field(1e-3, gt=0, le=1, description="of AdamW at most; it falls to a tenth by a cosine")
    weight_decay: float = Field(0.01, ge=0, le=1, description="of AdamW")
    warmup_batches: int = Field(50, ge=0, description="batches in which the learning rate rises to its highest")
    gradient_norm: float = Field(1.0, gt=0, description="gradients are scaled down to this norm")
    image_share: float = Field(0.5, ge=0, le=1, description="share of pictures among goals that have both forms")
    goal_weight: float = Field(
        1.0, ge=0, description="of the tasks beside the choice: where body and goal are, which actions are blocked"
    )
    looks: int = Field(
        256, ge=0, description="pictures from anywhere beside a batch: where they are, and what is in the way"
    )
    checkpoint_s: float = Field(60.0, gt=0, description="seconds between checkpoints")


class SightConfig(Section):
    """What objects look like: learned from the looks about, for scenes that there is no map of."""

    epochs: int = Field(4, ge=0, le=10_000, description="times that every look is gone through; 0 for no sight")
    batch_looks: int = Field(128, ge=1, le=100_000, description="looks a batch has")
    learning_rate: float = Field(2e-3, gt=0, le=1, description="as in [train]")


class DaggerConfig(Section):
    """DAgger: the policy flies, the planner says what it should have done, and it learns from both (Ross 2011)."""

    rounds: int = Field(3, ge=0, le=100, description="times that it flies and learns")
    episodes: int = Field(6000, ge=1, description="flown a round, of the training trajectories")
    epochs: int = Field(4, ge=1, description="over all that there is by then, a round")
    learning_rate: float = Field(5e-4, gt=0, le=1, description="as in [train]")
    teacher_share: float = Field(0.2, ge=0, le=1, description="steps at which the teacher's action is flown instead")


class SmallConfig(Section):
    """What `--small` replaces."""

    scenes: tuple[str, ...] = Field(("U_Mall_0", "N_Forest_0", "I_Harbor_0"), min_length=1, description="of the data")
    limit: int | None = Field(1500, ge=1, description="most trajectories")
    size_px: int = Field(32, ge=32, le=256, multiple_of=16, description="edge of the pictures, of [data]")
    epochs: int = Field(6, ge=1, description="of [train]")
    batch_steps: int = Field(256, ge=1, le=1_000_000, description="of [train]: few steps are to be many batches")
    rounds: int = Field(2, ge=0, le=100, description="of [dagger]")
    dagger_episodes: int = Field(300, ge=1, description="of [dagger], a round")
    dagger_epochs: int = Field(2, ge=1, description="of [dagger], a round")


class Recipe(Section):
    """A training: `aerialdojo-gen train FILE`."""

    name: str = Field("imitation", pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$", description="of its folder")
    seed: int = Field(0, ge=0, description="of weights, orders and draws")
    data: DataConfig = Field(default_factory=DataConfig)
    model: ModelConfig = Field(default_factory=ModelConfig)
    train: TrainingConfig = Field(default_factory=TrainingConfig)
    sight: SightConfig = Field(default_factory=SightConfig)
    dagger: DaggerConfig = Field(default_factory=DaggerConfig)
    small: SmallConfig = Field(default_factory=SmallConfig)

    def reduced(self) -> Recipe:
        """Return the recipe that `--small` trains by."""
        s = self.small
        data = self.data.model_copy(update={"scenes": s.scenes, "limit": s.limit, "size_px": s.size_px})
        train = self.train.model_copy(update={"epochs": s.epochs, "batch_steps": s.batch_steps})
        flown = {"rounds": s.rounds, "episodes": s.dagger_episodes, "epochs": s.dagger_epochs}
        small = {"data": data, "train": train, "dagger": self.dagger.model_copy(update=flown)}
        return self.model_copy(update={"name": f"{self.name}-small", **small})


def recipe_file(given: str | Path) -> Path:
    """Find a recipe: as a path, else by its name among those that come with the program."""
    path, shipped = Path(given), home() / "pipelines" / "baselines"
    if path.is_file():
        return path
    if path.parent == Path() and (named := shipped / f"{path.name.removesuffix('.toml')}.toml").is_file():
        return named
    known = ", ".join(sorted(file.stem for file in shipped.glob("*.toml")))
    raise ConfigError(f"no recipe {path}; by name, as in {PROGRAM} train imitation: {known}")


def load_recipe(file: str | Path) -> Recipe:
    """Read and validate a recipe."""
    path = recipe_file(file)
    raw = read_toml(path, ConfigError, finite=False)
    try:
        return Recipe.model_validate(raw)
    except ValidationError as error:
        raise ConfigError("; ".join(f"{path}: {line}" for line in explain(error, Recipe))) from None
