"""Contact sheets of the kit: every builder with three settings, taken from the plans or varied."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.safe_parse import read_toml
from aerialdojo_gen.rendering.gallery import Image, contact_sheet, look_at
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.kit import kit
from aerialdojo_gen.scenes.model import Scene
from aerialdojo_gen.scenes.plans.build import build_tables

SETTINGS = 3
_WIDTH, _HEIGHT = 272, 204
# By these a number of a builder's first use is varied.
_SCALES = (1.5, 0.6)
# Numbers that show best what a builder can do come first.
_FIRST = ("storeys", "bays", "rows", "count", "height_m", "rise_m", "width_m", "radius_m", "depth_m", "spread_m")


@dataclass(frozen=True)
class Use:
    """A table of a plan that calls a builder."""

    plan: str
    tables: Any  # The plan with this one entry, and what it needs
    entry: str  # Its name there, as `build_tables` has it; empty for a step of the ground
    path: tuple[str | int, ...]  # From there to the table

    @property
    def call(self) -> dict[str, Any]:
        """The builder's table."""
        return dict(reduce(getitem, self.path, self.tables))

    def varied(self, key: str, value: Any) -> Use:
        """Change one argument."""
        tables = copy.deepcopy(self.tables)
        reduce(getitem, self.path, tables)[key] = value
        return replace(self, tables=tables)


def kit_sheets(catalogue: Catalogue, plans: Sequence[Path]) -> Iterator[tuple[str, Image]]:
    """Yield a sheet a module of the kit, named as ``kit-houses``, its builders below each other as plans use them."""
    uses = uses_of(plans)
    modules: dict[str, list[str]] = {}
    for name, one in kit().items():
        modules.setdefault(one.function.__module__.rpartition(".")[2], []).append(name)
    for module, names in sorted(modules.items()):
        pictures, labels = [], []
        for name in names:
            shown = list(_pictures(name, uses.get(name, []), catalogue))
            shown += [(np.full((_HEIGHT, _WIDTH, 3), 240, np.uint8), "")] * (SETTINGS - len(shown))
            pictures += [picture for picture, _ in shown]
            labels += [label for _, label in shown]
        yield f"kit-{module.replace('_', '-')}", contact_sheet(pictures, labels, SETTINGS)


def uses_of(plans: Sequence[Path]) -> dict[str, list[Use]]:
    """Find the calls of each builder in plans, one of every plan first."""
    found: dict[str, list[Use]] = {}
    for path in plans:
        whole = read_toml(path, AssetError)
        head = {key: value for key, value in whole.items() if key not in ("site", "inventory", "moves", "level")}
        for number, step in enumerate(whole.get("ground", {}).get("steps", ())):
            found.setdefault(step["make"], []).append(Use(path.stem, head, "", ("ground", "steps", number)))
        named: list[dict[str, Any]] = []
        for entry in [one for some in whole.get("site", ()) for one in some.get("entries", [some])]:
            tables = {**head, "site": [*named, entry]}
            for inner in _calls(entry):
                use = Use(path.stem, tables, f"site[{len(named)}]", ("site", len(named), *inner))
                found.setdefault(use.call["make"], []).append(use)
            named += [entry] if "as" in entry else []
    return {name: sorted(some, key=lambda use: _rank(use, some)) for name, some in found.items()}


def _rank(use: Use, some: Sequence[Use]) -> int:
    """Number a use among those of its plan."""
    return [other for other in some if other.plan == use.plan].index(use)


def _calls(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if isinstance(value, dict):
        if "make" in value:
            yield path
        for key, inner in value.items():
            yield from _calls(inner, (*path, key))
    elif isinstance(value, list):
        for key, inner in enumerate(value):
            yield from _calls(inner, (*path, key))


def _pictures(name: str, uses: Sequence[Use], catalogue: Catalogue) -> Iterator[tuple[Image, str]]:
    shown: list[Image] = []
    for use, label in settings_of(name, uses):
        picture = _picture(use, catalogue)
        # What cannot be seen of an argument, such as room that it keeps, is no setting.
        if picture is not None and not any(np.array_equal(picture, other) for other in shown):
            yield picture, label
            shown.append(picture)
        if len(shown) == SETTINGS:
            return


def settings_of(name: str, uses: Sequence[Use]) -> Iterator[tuple[Use, str]]:
    """Yield uses with different arguments, then variations of the first."""
    seen: list[dict[str, Any]] = []
    for use in uses:
        call = use.call
        if call not in seen:
            seen.append(call)
            yield use, f"{name}, {use.plan}"
    if not uses:
        return
    call = uses[0].call
    defaults = {key: field.default for key, field in kit()[name].arguments.model_fields.items()}
    for key in sorted(defaults, key=lambda key: (_FIRST.index(key) if key in _FIRST else len(_FIRST), key)):
        for scale in _SCALES:
            value = _scaled(call.get(key, defaults[key]), scale)
            if value is not None:
                yield uses[0].varied(key, value), f"{name}, {key} = {value}"


def _scaled(value: Any, scale: float) -> Any:
    """Scale a number, or the numbers of a short list; None of anything else."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return max(round(value * scale), 1)
    if isinstance(value, float):
        return round(value * scale, 3)
    if isinstance(value, list | tuple) and 0 < len(value) <= 3:
        found = [_scaled(one, scale) for one in value]
        return None if any(isinstance(one, bool) or one is None for one in found) else found
    return None


def _picture(use: Use, catalogue: Catalogue) -> Image | None:
    """Build a use by itself; None where it cannot stand alone."""
    entries: dict[str, str] = {}
    try:
        scene = build_tables(use.plan, use.tables, catalogue, entries)
    except AssetError:
        return None
    made = {node for node, entry in entries.items() if entry == use.entry}
    bounds = [instance.bounds for instance in scene.instances if instance.node in made]
    if bounds:
        return _view(scene, np.array(bounds), 0.48)
    # Paint, or the ground itself: all of it, from higher up.
    return _view(scene, scene.instances[0].bounds[None], 0.9)


def _view(scene: Scene, bounds: Any, up: float) -> Image:
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    reach = max(float(np.linalg.norm(high - low)) / 2, 1.5)
    eye = (low + high) / 2 + 1.8 * reach * np.array([-0.62, -0.62, up])
    return look_at(scene, eye, (low + high) / 2, _WIDTH, _HEIGHT)
