"""Configuration: one frozen, validated section a stage, read from a pipeline's TOML file.

A key that does not exist is an error that names the file, the key and what was probably meant. Every value has a
default, so that a stage can be called as a library function without a file. What several stages read of one thing
stands once, in [embodiment], [camera] or [task].
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from aerialdojo_gen.base.config.shared import Section, Setting, shared

RendererName = Literal["gl", "pybullet"]
# The fastest first.
RENDERERS: tuple[RendererName, ...] = ("gl", "pybullet")


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
    timeout_s: float = Field(60.0, gt=0, le=86_400, description="longest wait for a whole answer")
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
    tell_elevations_deg: tuple[float, ...] = Field(
        (0.0, 20.0, 40.0),
        max_length=64,
        description="elevations of more candidates around each part that tells what the object is",
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
    fov_deg: float = shared("camera.fov_deg")
    min_visible_fraction: float = Field(0.3, ge=0, le=1, description="visible fraction below which nothing is seen")
    pictured: int = Field(6, ge=1, le=1000, description="candidates an object that are pictured and scored")
    picture_px: int = Field(
        96, ge=16, le=1024, description="edge of those pictures; 320 at least for the scorers clip and vlm"
    )
    step_back_m: float = Field(
        15.0, ge=0, le=1000, description="how far a reference picture may step back until its object fits"
    )
    shortlist: int = Field(3, ge=1, le=1000, description="anchors kept an object")
    separation_deg: float = Field(45.0, gt=0, le=180, description="wanted azimuth between kept anchors")
    weights: ScorerWeights = ScorerWeights()
    clip: ClipConfig | None = None
    vlm: VlmConfig | None = None


class ReferenceImagesConfig(Section):
    """Pictures of the objects for image goals."""

    step_back_m: float = Field(
        15.0, ge=0, le=1000, description="most that is stepped back from the anchor; 0 takes the picture there"
    )

    width: int = Field(320, ge=16, le=4096, description="columns, pixels")
    height: int = Field(320, ge=16, le=4096, description="rows, pixels")
    fov_deg: float = shared("camera.fov_deg")
    renderer: Literal["auto", "gl", "pybullet"] = Field(
        "auto", description="what draws; auto is the fastest that works, pybullet gives the same bytes anywhere"
    )


class DescribeConfig(Section):
    """The objects' descriptions."""

    paraphrases: int = Field(5, ge=1, le=50, description="texts an object, of several levels, none twice")


class PairObjectsConfig(Section):
    """Candidate tasks: ordered pairs of objects times the start object's anchors."""

    start_variants: int = Field(3, ge=1, le=1000, description="how many anchors of the start object may start a task")
    min_euclidean_m: float = shared("task.min_euclidean_m")
    max_length_m: float = shared("task.long_horizon.max_length_m")
    max_approach_m: float = shared("task.max_approach_m")
    surface_points: int = Field(
        1024, ge=1, le=100_000, description="points of a target's surface that are looked for from the starts"
    )


class SearchAttempt(Section):
    """One search of the planner's ladder."""

    weight: float = Field(gt=0, le=1000, description="of the cost-to-go; 1 is plain A*")
    budget: int = Field(ge=1, le=2_000_000, description="most expansions")
    duplicate_cell_m: float = Field(
        0.5, ge=0.01, le=100, description="edge of the cells in which states are duplicates"
    )
    heading_sectors: Literal[1, 2, 3, 4, 6, 8, 12, 24] = Field(1, description="headings told apart in a cell")
    extra_radius_m: float = Field(0.0, ge=0, le=10, description="added to the radius while searching")
    tolerance_growth_m: float = Field(
        0.004,
        ge=0,
        le=1,
        description="a route is taken though another may be cheaper by 0.15 m, and by this an expansion: at most 1 m",
    )


class FilterConfig(Section):
    """Which candidates become tasks (paper, section on filtering)."""

    min_detour_ratio: float = Field(1.05, ge=1, description="kept: κ at least this")
    min_plan_detour: float = Field(
        1.0, ge=1, le=1000, description="kept: L at least this times the shortest L without obstacles"
    )
    max_visible_at_start: float = Field(
        1.0, ge=0, le=1, description="kept: at most this share of the target in view at the start"
    )
    min_euclidean_m: float = shared("task.min_euclidean_m")
    base: Setting = shared("task.base")
    standard: Setting = shared("task.standard")
    long_horizon: Setting = shared("task.long_horizon")


class QuotaConfig(Section):
    """What decides which candidates are released by the paper's counts; no section of the file, but made of some."""

    search_margin: float = 0.25
    prefer_harder: float = 0.0
    rules: FilterConfig = FilterConfig()


class PlanConfig(Section):
    """Reference trajectories."""

    search: Literal["all", "released"] = Field(
        "all",
        description="all: every candidate; released: as many as the paper's numbers need, the first that [split] "
        "would draw, by predicted lengths",
    )
    search_margin: float = Field(
        0.25, ge=0.02, le=100, description="released: how many more are searched than are released"
    )
    targets_per_part: int = Field(8, ge=1, le=100_000, description="targets whose plans share a shard")
    cell_m: float = Field(0.5, ge=0.05, le=10, description="edge of the cells of clearance grid and cost-to-go")
    margin_m: float = Field(0.002, ge=0, le=10, description="added to the body's radius in the search alone")
    max_length_m: float = shared("task.long_horizon.max_length_m")
    length_slack: float = Field(
        1.04, ge=1, le=100, description="the cost-to-go may exceed a task's longest by this: it overestimates"
    )
    max_approach_m: float = shared("task.max_approach_m")
    min_detour_ratio: float = Field(
        0.0, ge=0, description="no search where a grid path is shorter than this times d_E"
    )
    action_cost_m: float = Field(
        0.02, ge=0, le=100, description="what an action costs beside its metres: breaks ties"
    )
    sideways_actions_per_m: float = Field(
        0.5, ge=0, le=1000, description="what a metre flown sideways counts as: the front camera should see the way"
    )
    clearance_preference_m: float = Field(
        1.0, gt=0, le=10, description="clearance below which a metre costs more than a metre"
    )
    clearance_weight: float = Field(
        1.4, ge=0, le=10, description="what a metre at a surface costs beside itself, in metres; 0 for no preference"
    )
    max_approach_angle_deg: float = Field(
        60.0, gt=0, le=180, description="largest angle between the Approach and the final heading, where avoidable"
    )
    approach_detour_m: float = Field(
        3.3, ge=0, le=100, description="what an Approach at a larger angle costs beside its length, in metres"
    )
    clearance_cap_m: float = Field(5.0, gt=0, le=100, description="clearances are known up to this distance")
    prove_by_grid: bool = Field(True, description="leave FCL unasked about legs that the grid proves free")
    ladder: tuple[SearchAttempt, ...] = Field(
        (
            SearchAttempt(weight=1.08, budget=20_000),
            SearchAttempt(weight=1.15, budget=8_000, duplicate_cell_m=0.25, heading_sectors=4, extra_radius_m=0.02),
            SearchAttempt(weight=1.15, budget=25_000, duplicate_cell_m=0.25, heading_sectors=4),
        ),
        min_length=1,
        max_length=16,
        description="searches tried in turn until FCL accepts what one of them finds",
    )
    quota: QuotaConfig | None = shared("searched_quota")


class SplitConfig(Section):
    """Train and test, and which tasks the release holds."""

    id_train_fraction: float = Field(0.8, ge=0, le=1, description="share of the tasks of ID scenes that train")
    ood_train_fraction: float = Field(0.2, ge=0, le=1, description="share of the tasks of OOD scenes that train")
    held_out_fraction: float = Field(
        0.2, ge=0, le=1, description="share of each scene's objects that the split by objects holds out"
    )
    salt: str | None = Field(
        None, min_length=16, max_length=256,
        description="what ids of tasks and pictures are hashed with; made from the seed where absent",
    )  # fmt: skip
    paper_counts: bool = Field(
        False,
        description="release the paper's numbers of tasks, of train and test, and, as near as the kept candidates "
        "allow, its metres of route",
    )
    prefer_harder: float = Field(
        0.0, ge=0, le=100,
        description="how much harder candidates are preferred where paper_counts leaves a choice; 0 is not at all",
    )  # fmt: skip

    @property
    def quota(self) -> QuotaConfig | None:
        """What decides the last draw; None if all kept candidates are released."""
        return QuotaConfig(prefer_harder=self.prefer_harder) if self.paper_counts else None


# What a profile of recordings sets where nothing else is said.
PROFILES: dict[str, dict[str, object]] = {
    "full": {},
    "training": {
        "width": 320, "height": 320, "layout": "tiled", "depth_step": 0.008, "crf": 28, "preset": "veryfast",
    },
}  # fmt: skip


class RenderConfig(Section):
    """Recordings along the trajectories (paper: sensors)."""

    profile: Literal["full", "training"] = Field(
        "full", description="training: 320 px, all views in one file, depth to 0.4 %; other keys override it"
    )
    limit: int = Field(2, ge=0, description="trajectories a scene and setting; 0 for all")
    split: Literal["train", "test", "all", "id_train", "id_test", "ood_train", "ood_test"] = Field(
        "train", description="which tasks are recorded"
    )
    renderer: Literal["auto", "gl", "pybullet"] = Field(
        "auto", description="auto: the fastest that draws a known scene right on this machine"
    )
    instances: bool = Field(False, description="record instance id maps too")
    light: Literal["scene", "clear", "overcast", "haze", "dusk", "wet", "random"] = Field(
        "scene", description="the scene's own light, a weather, or one drawn for each trajectory"
    )
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
    fov_deg: float = shared("camera.fov_deg")
    fps: float = Field(15.0, ge=0.01, le=240, description="frames a second; for steps, how fast the video plays")
    cruise_m_s: float = Field(3.0, ge=0.01, le=1000, description="speed along the path, for sampling by time")
    yaw_rate_deg_s: float = Field(90.0, ge=0.1, le=36_000, description="speed of turns, for sampling by time")
    crf: int = Field(23, ge=0, le=51, description="quality of the pictures' H.264, lower is better")
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium"] = Field(
        "ultrafast", description="x264's effort: a slower one makes smaller files"
    )
    depth_step: float = Field(
        0.0, ge=0, le=0.1, description="stored depths grow by this share from 0.1 m on; 0 for whole millimetres"
    )
    layout: Literal["files", "tiled"] = Field(
        "files", description="a file a view and modality, or one file a trajectory with the views side by side"
    )
    trajectories_per_part: int = Field(8, ge=1, le=100_000, description="trajectories that share a shard")

    @model_validator(mode="before")
    @classmethod
    def _take_the_profile(cls, given: object) -> object:
        if not isinstance(given, dict) or not isinstance(given.get("profile", "full"), str):
            return given
        return PROFILES.get(given.get("profile", "full"), {}) | given

    @model_validator(mode="after")
    def _tiles_are_video(self) -> RenderConfig:
        if self.layout == "tiled" and self.frames == "png":
            raise ValueError('layout = "tiled" is one video a trajectory: frames = "png" makes loose files')
        return self
