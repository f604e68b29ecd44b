"""Configuration: one frozen, validated section a stage, read from a pipeline's TOML file.

A key that does not exist is an error that names the file, the key and what was probably meant. Every value has a
default, so that a stage can be called as a library function without a file.
"""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from aerialdojo_gen.agreement import disagreements
from aerialdojo_gen.bounded import read_toml
from aerialdojo_gen.errors import ConfigError, brief

RendererName = Literal["gl", "pybullet"]
# The fastest first.
RENDERERS: tuple[RendererName, ...] = ("gl", "pybullet")


class Section(BaseModel):
    """Base of every section: frozen, and unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Embodiment(Section):
    """The drone's body (paper, section on the embodiment)."""

    radius_m: float = Field(0.25, gt=0, le=10, description="radius of the collision sphere")
    wheelbase_m: float = Field(0.25, gt=0, le=10, description="distance between opposite rotors; told to agents")


class BuildScenesConfig(Section):
    """`build-scenes` has nothing to set: a scene is its recipe."""


class AnnotateImportConfig(Section):
    """Checks of the annotation files."""

    paper_counts: bool = Field(False, description="require the paper's numbers of landmarks and objects")


class ScorerWeights(Section):
    """How much each scorer of candidate anchors counts; one that counts nothing is not asked."""

    geometric: float = Field(1.0, ge=0, description="instance mask, contrast and place in the picture")
    clip: float = Field(0.0, ge=0, description="likeness of picture and name, by a CLIP model in ONNX files")
    vlm: float = Field(0.0, ge=0, description="order that a multimodal model gives")

    @model_validator(mode="after")
    def _somebody_scores(self) -> ScorerWeights:
        if not self.geometric + self.clip + self.vlm:
            raise ValueError("one weight at least must be more than 0")
        return self


class ClipConfig(Section):
    """Files of the clip scorer; relative ones lie beside the pipeline's file."""

    vision: Path = Field(description="image encoder, ONNX")
    text: Path = Field(description="text encoder, ONNX")
    tokenizer: Path = Field(description="tokenizer.json")
    sha256: str = Field("", description="of the three files; filled in by the command")


class VlmConfig(Section):
    """The vlm scorer: any endpoint that speaks OpenAI's chat protocol; its key is OPENAI_API_KEY's."""

    model: str = Field(min_length=1, description="the model's name")
    base_url: str | None = Field(None, description="where the endpoint is; OPENAI_BASE_URL, else OpenAI's own")
    temperature: float | None = Field(0.0, ge=0, le=2, description="of its answers")
    picture_px: int = Field(336, ge=32, le=2048, description="longest side of a picture that it is shown")
    max_tokens: int = Field(1000, ge=16, le=1_000_000, description="longest answer")
    timeout_s: float = Field(60.0, gt=0, le=86_400, description="longest wait for an answer")
    retries: int = Field(4, ge=0, le=20, description="how often a failed request is sent again")


class AnchorSampleConfig(Section):
    """Candidate viewpoints around each object (paper: anchors)."""

    standoff_m: float = Field(1.0, gt=0, le=100, description="distance from the object's surface")
    azimuths: int = Field(16, ge=3, le=720, description="directions in the plane that candidates are placed in")
    elevations_deg: tuple[float, ...] = Field(
        (-15.0, 0.0, 15.0, 30.0),
        min_length=1,
        max_length=64,
        description="elevations of the candidates, seen from the centroid",
    )
    level_heights: tuple[float, ...] = Field(
        (0.2, 0.8),
        max_length=64,
        description="heights of more level candidates around a tall object, 0 bottom, 1 top",
    )
    margin_m: float = Field(
        0.05, ge=0, le=10, description="free space that a candidate needs beyond the body's radius"
    )
    surface_points: int = Field(
        256, ge=8, le=100_000, description="points of the object's surface that rays are cast to"
    )
    fov_deg: float = Field(90.0, gt=0, lt=180, description="field of view of the front camera")
    min_visible_fraction: float = Field(0.3, ge=0, le=1, description="visible fraction below which nothing is seen")
    pictured: int = Field(6, ge=1, le=1000, description="candidates an object that are pictured and scored")
    picture_px: int = Field(96, ge=16, le=1024, description="edge of those pictures")
    shortlist: int = Field(3, ge=1, le=1000, description="anchors kept an object")
    separation_deg: float = Field(45.0, gt=0, le=180, description="wanted azimuth between kept anchors")
    weights: ScorerWeights = ScorerWeights()
    clip: ClipConfig | None = None
    vlm: VlmConfig | None = None


class ReferenceImagesConfig(Section):
    """Pictures of the objects for image goals."""

    width: int = Field(320, ge=16, le=4096, description="columns, pixels")
    height: int = Field(320, ge=16, le=4096, description="rows, pixels")
    fov_deg: float = Field(90.0, gt=0, lt=180, description="horizontal field of view, as the drone's camera")
    renderer: Literal["auto", "gl", "pybullet"] = Field(
        "auto", description="what draws; auto is the fastest that works, pybullet gives the same bytes anywhere"
    )


class PairObjectsConfig(Section):
    """Candidate tasks: ordered pairs of objects times the start object's anchors."""

    start_variants: int = Field(3, ge=1, le=1000, description="how many anchors of the start object may start a task")
    min_euclidean_m: float = Field(3.0, ge=0, description="d_E at or below which no task is kept")
    max_length_m: float = Field(100.0, gt=0, le=10_000, description="L at or above which no task is kept")
    max_approach_m: float = Field(1.0, ge=0, le=100, description="longest straight Approach at the end of a route")


class Rung(Section):
    """One search of the planner's ladder."""

    weight: float = Field(gt=0, le=1000, description="of the cost-to-go; 1 is plain A*")
    budget: int = Field(ge=1, le=2_000_000, description="most expansions")
    duplicate_cell_m: float = Field(
        0.5, ge=0.01, le=100, description="edge of the cells in which states are duplicates"
    )
    heading_sectors: Literal[1, 2, 3, 4, 6, 8, 12, 24] = Field(1, description="headings told apart in a cell")
    extra_radius_m: float = Field(0.0, ge=0, le=10, description="added to the radius while searching")


class PlanConfig(Section):
    """Reference trajectories."""

    targets_per_part: int = Field(8, ge=1, le=100_000, description="targets whose plans share a shard")
    cell_m: float = Field(0.5, ge=0.05, le=10, description="edge of the cells of clearance grid and cost-to-go")
    margin_m: float = Field(0.002, ge=0, le=10, description="added to the body's radius in the search alone")
    max_length_m: float = Field(100.0, gt=0, le=10_000, description="longest route worth planning")
    length_slack: float = Field(
        1.04, ge=1, le=100, description="the cost-to-go may exceed it by this: it overestimates"
    )
    max_approach_m: float = Field(1.0, gt=0, le=100, description="longest straight Approach at the end")
    min_detour_ratio: float = Field(
        0.0, ge=0, description="no search where a grid path is shorter than this times d_E"
    )
    action_cost_m: float = Field(
        0.02, ge=0, le=100, description="what an action costs beside its metres: breaks ties"
    )
    sideways_actions_per_m: float = Field(
        1.0, ge=0, le=1000, description="what a metre flown sideways counts as: the front camera should see the way"
    )
    clearance_cap_m: float = Field(5.0, gt=0, le=100, description="clearances are known up to this distance")
    prove_by_grid: bool = Field(True, description="leave FCL unasked about legs that the grid proves free")
    ladder: tuple[Rung, ...] = Field(
        (
            Rung(weight=1.05, budget=20_000),
            Rung(weight=1.15, budget=40_000, duplicate_cell_m=0.25, heading_sectors=4, extra_radius_m=0.02),
            Rung(weight=1.15, budget=40_000, duplicate_cell_m=0.25, heading_sectors=4),
        ),
        min_length=1,
        max_length=16,
        description="searches tried in turn until FCL accepts what one of them finds",
    )


class Setting(Section):
    """One length setting (paper: Base, Standard, Long-Horizon)."""

    min_length_m: float = Field(ge=0, description="smallest length that belongs to it")
    max_length_m: float = Field(gt=0, description="smallest length that is too long for it")
    action_budget: int = Field(ge=1, description="most actions an episode may take, Stop included")

    @model_validator(mode="after")
    def _has_room(self) -> Setting:
        if self.min_length_m >= self.max_length_m:
            raise ValueError(
                f"min_length_m = {self.min_length_m:g} must be less than max_length_m = {self.max_length_m:g}"
            )
        return self


class FilterConfig(Section):
    """Which candidates become tasks (paper, section on filtering)."""

    min_euclidean_m: float = Field(3.0, ge=0, description="kept: d_E greater than this")
    min_detour_ratio: float = Field(1.05, ge=1, description="kept: κ at least this")
    base: Setting = Setting(min_length_m=5, max_length_m=30, action_budget=90)
    standard: Setting = Setting(min_length_m=30, max_length_m=60, action_budget=180)
    long_horizon: Setting = Setting(min_length_m=60, max_length_m=100, action_budget=300)

    @model_validator(mode="after")
    def _settings_join(self) -> FilterConfig:
        if (self.base.max_length_m, self.standard.max_length_m) != (
            self.standard.min_length_m,
            self.long_horizon.min_length_m,
        ):
            raise ValueError("the settings must join: base.max_length_m = standard.min_length_m, and so on")
        budgets = (self.base.action_budget, self.standard.action_budget, self.long_horizon.action_budget)
        if budgets != tuple(sorted(budgets)):
            raise ValueError(f"longer routes need more actions: action_budget falls in {budgets}")
        return self


class SplitConfig(Section):
    """Train and test, and which tasks the release holds."""

    id_train_fraction: float = Field(0.8, ge=0, le=1, description="share of the tasks of ID scenes that train")
    ood_train_fraction: float = Field(0.2, ge=0, le=1, description="share of the tasks of OOD scenes that train")
    salt: str | None = Field(
        None, min_length=16, max_length=256,
        description="what ids of tasks and pictures are hashed with; made from the seed where absent",
    )  # fmt: skip
    paper_counts: bool = Field(
        False,
        description="release the paper's numbers of tasks, of train and test, and, as near as the kept candidates "
        "allow, its metres of route",
    )


class RenderConfig(Section):
    """Recordings along the trajectories (paper: sensors)."""

    limit: int = Field(2, ge=0, description="trajectories a scene and setting; 0 for all")
    split: Literal["train", "test", "all", "id_train", "id_test", "ood_train", "ood_test"] = Field(
        "train", description="which tasks are recorded"
    )
    renderer: Literal["auto", "gl", "pybullet"] = Field(
        "auto", description="auto: the fastest that draws a known scene right on this machine"
    )
    instances: bool = Field(False, description="record instance id maps too")
    frames: Literal["video", "png"] = Field("video", description="videos, or a folder of PNG files each")
    sampling: Literal["steps", "time"] = Field("steps", description="a frame a pose, or a constant frame rate")
    views: tuple[Literal["front", "left", "right", "down"], ...] = Field(
        ("front", "left", "right", "down"), min_length=1, description="cameras of the body"
    )
    offsets_m: dict[Literal["front", "left", "right", "down"], tuple[float, float, float]] = Field(
        {}, description="where a view's camera sits from the body's centre: x forward, y left, z up; 0 where absent"
    )
    width: int = Field(640, ge=16, le=4096, multiple_of=2, description="columns, pixels")
    height: int = Field(640, ge=16, le=4096, multiple_of=2, description="rows, pixels")
    fov_deg: float = Field(90.0, gt=0, lt=180, description="horizontal field of view")
    fps: float = Field(15.0, ge=0.01, le=240, description="frames a second; for steps, how fast the video plays")
    cruise_m_s: float = Field(3.0, ge=0.01, le=1000, description="speed along the path, for sampling by time")
    yaw_rate_deg_s: float = Field(90.0, ge=0.1, le=36_000, description="speed of turns, for sampling by time")
    crf: int = Field(23, ge=0, le=51, description="quality of the pictures' H.264, lower is better")
    trajectories_per_part: int = Field(8, ge=1, le=100_000, description="trajectories that share a shard")


class Pipeline(Section):
    """A whole pipeline file."""

    name: str = Field("default", pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")
    seed: int = Field(0, ge=0, description="seed of every random draw")
    scenes: tuple[str, ...] = Field(("*",), description="names or globs of the scenes to make")
    stages: tuple[str, ...] | None = Field(None, description="stages that `run` runs; all where absent")
    scene_assets: Path | None = Field(None, description="folder of props and materials, relative to the file")
    recipes: Path | None = Field(None, description="folder of recipes; scene_assets/scenes where absent")
    annotations: Path | None = Field(None, description="folder of annotation files, relative to the file")
    embodiment: Embodiment = Embodiment()
    build_scenes: BuildScenesConfig = Field(BuildScenesConfig(), alias="build-scenes")
    annotate_import: AnnotateImportConfig = Field(AnnotateImportConfig(), alias="annotate-import")
    anchor_sample: AnchorSampleConfig = Field(AnchorSampleConfig(), alias="anchor-sample")
    reference_images: ReferenceImagesConfig = Field(ReferenceImagesConfig(), alias="reference-images")
    pair_objects: PairObjectsConfig = Field(PairObjectsConfig(), alias="pair-objects")
    plan: PlanConfig = PlanConfig()
    filter: FilterConfig = FilterConfig()
    split: SplitConfig = SplitConfig()
    render: RenderConfig = RenderConfig()

    @model_validator(mode="after")
    def _sections_agree(self) -> Pipeline:
        faults = disagreements(self)
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def section(self, stage: str) -> Section:
        """Return the section of a stage, by the stage's name (``"anchor-sample"``)."""
        section = getattr(self, stage.replace("-", "_"))
        assert isinstance(section, Section)
        return section


def load_pipeline(path: Path) -> Pipeline:
    """Read and validate a pipeline file.

    Parameters
    ----------
    path : Path
        A TOML file; relative folders in it are relative to its own folder.

    Returns
    -------
    Pipeline
        With absolute folders.

    Raises
    ------
    ConfigError
        The file does not exist, is not TOML, has a key that does not exist, a value out of range, or sections that
        contradict each other; every fault is named.
    """
    try:
        raw = read_toml(path, ConfigError, finite=False)
    except FileNotFoundError:
        known = sorted(p.name for p in path.parent.glob("*.toml")) if path.parent.is_dir() else []
        hint = f"; there are {', '.join(known)} in {path.parent}" if known else ""
        raise ConfigError(f"no pipeline file {path}{hint}") from None
    for key in ("scene_assets", "recipes", "annotations"):
        if isinstance(raw.get(key), str):
            raw[key] = (path.parent / raw[key]).resolve()
    clip = raw.get("anchor-sample", {}).get("clip", {}) if isinstance(raw.get("anchor-sample"), dict) else {}
    for key, value in clip.items() if isinstance(clip, dict) else ():
        if key != "sha256" and isinstance(value, str):
            clip[key] = (path.parent / value).resolve()
    try:
        return Pipeline.model_validate(raw)
    except ValidationError as error:
        raise ConfigError("; ".join(f"{path}: {line}" for line in explain(error, Pipeline))) from None


# What people read; a file may have thousands of faults.
_MOST_FAULTS = 20


def explain(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Turn a validation error into one line a fault, with the nearest known key for an unknown one.

    Parameters
    ----------
    error : pydantic.ValidationError
        What validating against `model` raised.
    model : type of BaseModel
        The model, to look up the keys that exist.

    Returns
    -------
    list of str
        E.g. ``["[plan] unknown key 'wieght': did you mean 'weight'?"]``; of many faults the first and how many more.
    """
    lines: list[str] = []
    for fault in error.errors():
        if not fault["loc"]:
            # Of the whole: what it says names its keys itself.
            lines += str(fault["ctx"]["error"]).split("; ") if "ctx" in fault else [fault["msg"]]
            continue
        *where, last = [str(part) for part in fault["loc"]] or [""]
        table = f"[{'.'.join(where)}] " if where else ""
        if fault["type"] == "extra_forbidden":
            known = _keys_at(model, where)
            near = difflib.get_close_matches(last, known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known keys: {', '.join(known)}"
            lines.append(f"{table}unknown key {last!r}: {hint}")
        else:
            lines.append(f"{table}{last} = {_short(fault.get('input'))}: {fault['msg']}")
    told = [brief(line) for line in lines[:_MOST_FAULTS]]
    return [*told, f"and {len(lines) - _MOST_FAULTS} more faults"] if len(lines) > _MOST_FAULTS else told


def _keys_at(model: type[BaseModel], where: list[str]) -> list[str]:
    for name in where:
        fields = {(f.alias or key): f for key, f in model.model_fields.items()}
        inner = fields[name].annotation if name in fields else None
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return []
        model = inner
    return sorted(f.alias or key for key, f in model.model_fields.items())


def _short(value: Any) -> str:
    return brief(repr(value), 60)


def with_overrides(pipeline: Pipeline, stage: str, **values: Any) -> Pipeline:
    """Return the pipeline with values of one section replaced; None leaves a value as it is.

    Raises
    ------
    ConfigError
        A value is out of range, or contradicts another section's.
    """
    section = pipeline.section(stage)
    given = {key: value for key, value in values.items() if value is not None}
    try:
        changed = type(section).model_validate(section.model_dump() | given)
    except ValidationError as error:
        raise ConfigError("; ".join(explain(error, type(section)))) from None
    whole = pipeline.model_copy(update={stage.replace("-", "_"): changed})
    faults = disagreements(whole)
    if faults:
        raise ConfigError("; ".join(faults))
    return whole
