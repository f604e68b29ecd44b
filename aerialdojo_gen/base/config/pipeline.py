"""The whole pipeline file: its sections together, read from TOML and checked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError, model_validator

from aerialdojo_gen.base.config.agreement import disagreements
from aerialdojo_gen.base.config.sections import (
    AnchorSampleConfig,
    AnnotateImportConfig,
    BuildScenesConfig,
    Embodiment,
    FilterConfig,
    PairObjectsConfig,
    PlanConfig,
    ReferenceImagesConfig,
    ReleasedPlanConfig,
    RenderConfig,
    Section,
    SplitConfig,
)
from aerialdojo_gen.base.errors import ConfigError
from aerialdojo_gen.base.explain import explain
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.base.shipped import read_path


class Pipeline(Section):
    """A whole pipeline file."""

    name: str = Field(
        "default", pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", description="what the release says that it was made by"
    )
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
        """Return the section of a stage, by the stage's name (``"anchor-sample"``); else an empty one.

        Where `plan` searches what is released, what decides on that is part of its section, so that its shards are
        stale where that changes.
        """
        section = getattr(self, stage.replace("-", "_"), Section())
        assert isinstance(section, Section)
        if stage == "plan" and self.plan.search == "released":
            values = self.plan.model_dump() | {"kept": self.filter, "prefer_harder": self.split.prefer_harder}
            return ReleasedPlanConfig.model_validate(values)
        return section


def load_pipeline(file: str | Path) -> Pipeline:
    """Read and validate a pipeline file.

    Parameters
    ----------
    file : str or Path
        A TOML file; relative folders in it are relative to its own folder, those after
        ``shipped:`` to what comes with the program.

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
    path = Path(file)
    try:
        raw = read_toml(path, ConfigError, finite=False)
    except FileNotFoundError:
        known = sorted(p.name for p in path.parent.glob("*.toml")) if path.parent.is_dir() else []
        hint = f"; there are {', '.join(known)} in {path.parent}" if known else ""
        raise ConfigError(f"no pipeline file {path}{hint}") from None
    for key in ("scene_assets", "recipes", "annotations"):
        if isinstance(raw.get(key), str):
            raw[key] = read_path(raw[key], path.parent)
    clip = raw.get("anchor-sample", {}).get("clip", {}) if isinstance(raw.get("anchor-sample"), dict) else {}
    for key, value in clip.items() if isinstance(clip, dict) else ():
        if key != "sha256" and isinstance(value, str):
            clip[key] = read_path(value, path.parent)
    try:
        return Pipeline.model_validate(raw)
    except ValidationError as error:
        raise ConfigError("; ".join(f"{path}: {line}" for line in explain(error, Pipeline))) from None


def with_overrides(pipeline: Pipeline, stage: str, **values: Any) -> Pipeline:
    """Return the pipeline with values of one section replaced; None leaves a value as it is.

    Raises
    ------
    ConfigError
        A value is out of range, or contradicts another section's.
    """
    section = getattr(pipeline, stage.replace("-", "_"), Section())
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
