"""The whole pipeline file: its sections together, read from TOML and checked."""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path
from typing import Any

from pydantic import Field, SerializerFunctionWrapHandler, ValidationError, model_serializer, model_validator

from aerialdojo_gen.base.config.sections import (
    AnchorSampleConfig,
    AnnotateImportConfig,
    BuildScenesConfig,
    DescribeConfig,
    FilterConfig,
    PairObjectsConfig,
    PlanConfig,
    QuotaConfig,
    ReferenceImagesConfig,
    RenderConfig,
    SplitConfig,
)
from aerialdojo_gen.base.config.shared import CameraConfig, Embodiment, Section, TaskConfig, shared_values
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
    camera: CameraConfig = CameraConfig()
    task: TaskConfig = TaskConfig()
    build_scenes: BuildScenesConfig = Field(BuildScenesConfig(), alias="build-scenes")
    annotate_import: AnnotateImportConfig = Field(AnnotateImportConfig(), alias="annotate-import")
    anchor_sample: AnchorSampleConfig = Field(AnchorSampleConfig(), alias="anchor-sample")
    reference_images: ReferenceImagesConfig = Field(ReferenceImagesConfig(), alias="reference-images")
    describe: DescribeConfig = DescribeConfig()
    pair_objects: PairObjectsConfig = Field(PairObjectsConfig(), alias="pair-objects")
    plan: PlanConfig = PlanConfig()
    filter: FilterConfig = FilterConfig()
    split: SplitConfig = SplitConfig()
    render: RenderConfig = RenderConfig()

    @model_validator(mode="after")
    def _sections_agree(self) -> Pipeline:
        faults = [*self.fill_shared(), *_disagreements(self)]
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @model_serializer(mode="wrap")
    def _without_shared(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # As in a file: a value stands where it is set.
        values: dict[str, Any] = dump(self)
        for attribute, section in self._sections():
            key = type(self).model_fields[attribute].alias or attribute
            for name in shared_values(type(section)):
                values.get(attribute, values.get(key, {})).pop(name, None)
        return values

    def _sections(self) -> list[tuple[str, Section]]:
        return [(name, value) for name, value in self if isinstance(value, Section)]

    def fill_shared(self) -> list[str]:
        """Give each section the values that it shares; say where one says something else."""
        faults = []
        # From the last: the rules of `filter` are complete before they become a part of what `plan` reads.
        for attribute, section in reversed(self._sections()):
            paths = shared_values(type(section))
            values = {name: attrgetter(path)(self) for name, path in paths.items()}
            for name, value in values.items():
                if name in section.model_fields_set and getattr(section, name) != value:
                    table, _, key = paths[name].partition(".")
                    remedy = f"set [{table}] {key}" if key else "leave it out"
                    faults.append(f"[{attribute.replace('_', '-')}] {name} is no key of this section: {remedy}")
            section = section.model_copy(update=values)
            section.model_fields_set.difference_update(values)
            object.__setattr__(self, attribute, section)
        return faults

    @property
    def searched_quota(self) -> QuotaConfig | None:
        """What decides which candidates `plan` searches; None if it searches all."""
        if self.plan.search == "all":
            return None
        return QuotaConfig(
            search_margin=self.plan.search_margin, prefer_harder=self.split.prefer_harder, rules=self.filter
        )

    def section(self, stage: str) -> Section:
        """Return the section of a stage, by the stage's name (``"anchor-sample"``); else an empty one."""
        section = getattr(self, stage.replace("-", "_"), Section())
        assert isinstance(section, Section)
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
        own = section.model_dump(exclude=set(shared_values(type(section))))
        changed = type(section).model_validate(own | given)
    except ValidationError as error:
        raise ConfigError("; ".join(explain(error, type(section)))) from None
    whole = pipeline.model_copy(update={stage.replace("-", "_"): changed})
    faults = whole.fill_shared() or _disagreements(whole)
    if faults:
        raise ConfigError("; ".join(faults))
    return whole


def _disagreements(pipeline: Pipeline) -> list[str]:
    """Find what contradicts another section, so that no stage undoes another's work."""
    anchor, plan, kept, radius = pipeline.anchor_sample, pipeline.plan, pipeline.filter, pipeline.embodiment.radius_m
    extra_m = [attempt.extra_radius_m for attempt in plan.ladder]
    thinnest, thickest = plan.margin_m + min(extra_m), radius + plan.margin_m + max(extra_m)
    rules = (
        (
            anchor.standoff_m > radius + anchor.margin_m,
            f"[anchor-sample] standoff_m = {anchor.standoff_m:g} must be more than [embodiment] radius_m + "
            f"[anchor-sample] margin_m = {radius + anchor.margin_m:g}: every anchor would touch its object",
        ),
        (
            thinnest <= anchor.margin_m,
            f"[anchor-sample] margin_m = {anchor.margin_m:g} must be at least [plan] margin_m plus the smallest "
            f"extra_radius_m of its ladder = {thinnest:g}: routes could not leave their anchors",
        ),
        (
            plan.clearance_cap_m > thickest,
            f"[plan] clearance_cap_m = {plan.clearance_cap_m:g} must be more than [embodiment] radius_m + [plan] "
            f"margin_m + the largest extra_radius_m of its ladder = {thickest:g}: nothing would be free",
        ),
        (
            plan.min_detour_ratio <= kept.min_detour_ratio,
            f"[plan] min_detour_ratio = {plan.min_detour_ratio:g} must be at most [filter] min_detour_ratio = "
            f"{kept.min_detour_ratio:g}: routes that filter would keep are never searched",
        ),
        (
            plan.search == "all" or pipeline.split.paper_counts,
            '[plan] search = "released" needs [split] paper_counts = true: without them all that is kept is '
            'released; leave it out, or set search = "all"',
        ),
    )
    return [text for holds, text in rules if not holds]
