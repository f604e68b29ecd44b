"""``render``: recordings along the trajectories of the release."""

from __future__ import annotations

import re
import time
from dataclasses import asdict
from typing import Annotated

import typer

from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.cli import options
from aerialdojo_gen.cli.common import StageOptions, print_json, stage_command
from aerialdojo_gen.dataset.build import default_workers, open_pipeline

app = typer.Typer()

_SECONDS = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}


@stage_command(app, "render")
def render(
    common: StageOptions, replace: options.Replace = False,
    split: Annotated[str | None, typer.Option(
        "--split", help="train, test, all, id_train, id_test, ood_train or ood_test.")] = None,
    limit: Annotated[int | None, typer.Option(
        "--limit", min=0, help="Maximum number of trajectories per scene and setting, not in total; 0 for all.  "
        "(default: the pipeline's)")] = None,
    profile: Annotated[str | None, typer.Option(
        "--profile", help="full (640 px, one file per view) or training (320 px, depth to 0.4 %, one file "
        "per trajectory).")] = None,
    renderer: Annotated[str | None, typer.Option(
        "--renderer", help="auto (the fastest that works on this machine), gl or pybullet.")] = None,
    sampling: Annotated[str | None, typer.Option(
        "--sampling", help="steps: one frame per pose; time: constant frame rate.")] = None,
    frames: Annotated[str | None, typer.Option("--frames", help="video, or png for one file per frame.")] = None,
    light: Annotated[str | None, typer.Option(
        "--light", help="scene (its own), clear, overcast, haze, dusk, wet, or random: one drawn for each "
        "trajectory.")] = None,
    instances: Annotated[bool, typer.Option("--instances", help="Record instance id maps too.")] = False,
    shard: Annotated[str | None, typer.Option(
        "--shard", metavar="I/N", help="Record the I-th of N parts, e.g. 2/8. All parts copied into one folder "
        "equal a run on one machine.")] = None,
    budget: Annotated[str | None, typer.Option(
        "--budget", help="Stop after this time, e.g. 90m or 2h; the same command continues.")] = None,
    verify: Annotated[bool, typer.Option(
        "--verify", help="Read every recording, and record those again whose content has changed.")] = False,
    estimate: Annotated[bool, typer.Option(
        "--estimate", help="Measure a few trajectories and estimate time and size for all; record nothing.")] = False,
    prune: Annotated[bool, typer.Option(
        "--prune", help="Remove the recordings of trajectories that the release no longer has, and record nothing."
    )] = False,
    as_json: options.Json = False,
) -> None:  # fmt: skip
    """Record four RGB-D views along trajectories of the release."""
    from aerialdojo_gen.pipeline.options import RunLimits

    if prune:
        _prune(common)
        return
    limits = RunLimits(
        share_of(shard) if shard else (0, 1), time.time() + duration_s(budget) if budget else None, verify
    )
    overrides: dict[str, object] = {
        **profile_keys(profile), "split": split, "limit": limit, "renderer": renderer, "sampling": sampling,
        "frames": frames, "light": light, "instances": instances or None,
    }  # fmt: skip
    if estimate:
        _estimate(common, limits.share, overrides, as_json)
        return
    if as_json:
        raise UsageError("--json goes with --estimate: what was recorded stands in the tables recordings and frames")
    common.run_until("render", scenes=_scenes_of(split, common), replace=replace, limits=limits, **overrides)


def _prune(common: StageOptions) -> None:
    from aerialdojo_gen.dataset.contents import prune_recordings

    if common.chosen:
        raise UsageError("--prune looks at all scenes: leave the scenes out")
    gone = prune_recordings(common.data)
    print(f"{len(gone):,} recordings removed: the release does not have their trajectories")


def profile_keys(profile: str | None) -> dict[str, object]:
    """Return what a profile sets: on the command line it goes before the pipeline's own keys."""
    from aerialdojo_gen.base.config.sections import PROFILES, RenderConfig

    if profile is None:
        return {}
    keys = {key for values in PROFILES.values() for key in values}
    defaults = {key: RenderConfig.model_fields[key].default for key in keys}
    return defaults | PROFILES.get(profile, {}) | {"profile": profile}


def _scenes_of(split: str | None, common: StageOptions) -> list[str] | None:
    """Leave out the scenes that a split such as id_train has nothing of: their recordings stay as they are."""
    if split is None or "_" not in split:
        return common.chosen
    from aerialdojo_gen.pipeline import runner
    from aerialdojo_gen.store import shards as store

    config, roots = open_pipeline(common.pipeline, common.data)
    scenes = runner.chosen_scenes(config, roots, common.chosen)
    chosen = [name for name in scenes if store.partition(name) == split.split("_")[0]]
    if not chosen:
        raise UsageError(f"--split {split} has none of the scenes {', '.join(scenes[:5])}")
    return chosen


def _estimate(common: StageOptions, share: tuple[int, int], overrides: dict[str, object], as_json: bool) -> None:
    from aerialdojo_gen.base.config.pipeline import with_overrides
    from aerialdojo_gen.dataset.contents import scenes_in_release
    from aerialdojo_gen.pipeline import runner
    from aerialdojo_gen.rendering.estimate import estimate

    config, roots = open_pipeline(common.pipeline, common.data, reads=True)
    scenes_in_release(roots.data)
    config = with_overrides(config, "render", **overrides)
    scenes = runner.chosen_scenes(config, roots, common.chosen)
    workers = common.workers or default_workers()
    estimated = estimate(roots.data, scenes, config.render, config.seed, workers, share[1])
    if as_json:
        print_json(asdict(estimated))
    else:
        print(estimated)


def share_of(text: str) -> tuple[int, int]:
    """Read ``I/N``, I from 1 to N, as (I - 1, N); UsageError for anything else."""
    match = re.fullmatch(r"(\d+)/(\d+)", text)
    if not match or not 1 <= int(match[1]) <= int(match[2]):
        raise UsageError(f"--shard {text}: write I/N with I from 1 to N, e.g. 2/8")
    return int(match[1]) - 1, int(match[2])


def duration_s(text: str) -> float:
    """Read a duration such as ``2h``, ``90m`` or ``1h30m``, seconds; UsageError for anything else."""
    if not re.fullmatch(r"(\d+(\.\d+)?[smhd])+", text):
        raise UsageError(f"--budget {text}: write a duration such as 45s, 90m, 2h or 1h30m")
    return sum(float(value) * _SECONDS[unit] for value, unit in re.findall(r"(\d+(?:\.\d+)?)([smhd])", text))
