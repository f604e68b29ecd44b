"""Weights and checkpoints: safetensors files, written whole or not at all; reading them runs nothing."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import MissingPackage, StoreError, UsageError, first_line, no_package
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.learning.encoding import actions_fingerprint
from aerialdojo_gen.learning.loader import torch_package
from aerialdojo_gen.learning.words import Vocabulary
from aerialdojo_gen.store.atomic import atomic_file, make_folder

_FORMAT = "aerialdojo-gen policy 1"


@dataclass(frozen=True)
class PolicyInfo:
    """What a policy is made for: it stands in the file beside the weights."""

    shape: dict[str, Any]  # `aerialdojo_gen.learning.network.Shape`
    vocabulary: Vocabulary
    sensors: Sensors
    release: str  # Fingerprint of the release that it learned from
    actions: str  # Fingerprint of the action set
    named: tuple[str, ...] = ()  # Words that pictures are searched for
    scenes: tuple[str, ...] = ()  # Scenes whose tasks it was trained on, in the order of their numbers
    init: str = ""  # SHA-256 of the weights that its training began with; empty for random ones

    def to_json(self) -> str:
        """Return it as JSON."""
        s, v = self.sensors, self.vocabulary
        return json.dumps({
            "shape": self.shape, "words": v.words, "length": v.length, "release": self.release,
            "actions": self.actions, "named": self.named, "scenes": self.scenes, "init": self.init,
            "sensors": [s.views, s.width, s.height, s.fov_deg, s.max_depth_m],
        })  # fmt: skip


def write(path: Path, tensors: Mapping[str, Any], about: PolicyInfo, state: Mapping[str, Any] | None = None) -> None:
    """Write tensors with what they belong to."""
    make_folder(path.parent)
    named = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    text = {"format": _FORMAT, "about": about.to_json(), "state": json.dumps(dict(state or {}))}
    with atomic_file(path.parent, path.name) as temporary:
        _safetensors().torch.save_file(named, str(temporary), metadata=text)


def read(path: str | Path) -> tuple[dict[str, Any], PolicyInfo, dict[str, Any]]:
    """Read what `write` wrote."""
    torch_package()
    if not Path(path).is_file():
        raise UsageError(f"there are no weights {path}: run {command('train', 'imitation')}")
    try:
        with _safetensors().safe_open(str(path), framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - it is no mapping
        if metadata.get("format") != _FORMAT:
            raise ValueError(f"its format is {metadata.get('format')!r}, not {_FORMAT!r}")
        given, state = loads_json(metadata["about"]), loads_json(metadata["state"])
        views, width, height, fov_deg, max_depth_m = given["sensors"]
        sensors = Sensors(tuple(views), bool(views), bool(views), width, height, fov_deg, max_depth_m)
        words = Vocabulary(given["words"], given["length"])
        # Weights of an earlier version search for nothing, or do not say where they were trained.
        named, scenes = (tuple(map(str, given.get(key, ()))) for key in ("named", "scenes"))
        init = str(given.get("init", ""))
        about = PolicyInfo(given["shape"], words, sensors, given["release"], given["actions"], named, scenes, init)
    except Exception as error:  # safetensors has an error of its own, and a header may say anything
        raise StoreError(f"{path} holds no policy: {first_line(error)}") from None
    if about.actions != actions_fingerprint():
        raise UsageError(
            f"{path} is of another action set: its fingerprint is {about.actions[:16]}, and that of this version is "
            f"{actions_fingerprint()[:16]}"
        )
    return tensors, about, state


def _safetensors() -> Any:
    try:
        importlib.import_module("safetensors.torch")
        return importlib.import_module("safetensors")
    except ImportError:
        raise MissingPackage(no_package("a policy", "safetensors", "train")) from None
