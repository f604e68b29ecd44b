"""A trained policy: its weights, in safetensors files whose reading runs nothing, and the agent that flies by them.

``evaluate --agent policy --option weights=FILE`` flies it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import StoreError, UsageError, first_line
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.benchmark.agents.base import AgentBase
from aerialdojo_gen.benchmark.agents.goal import N_ACTIONS, Goal, Observation, Sensors
from aerialdojo_gen.learning.encoding import DeadReckoning, actions_fingerprint, goal_picture, packed
from aerialdojo_gen.learning.loader import torch_package
from aerialdojo_gen.learning.recipe import ModelConfig
from aerialdojo_gen.learning.search import LOST_NATS, Search
from aerialdojo_gen.learning.words import Vocabulary, goal_text, word_targets
from aerialdojo_gen.store.atomic import atomic_file, make_folder
from aerialdojo_gen.store.files import file_digest

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


def write_weights(path: Path, tensors: Mapping[str, Any], about: PolicyInfo, state: Mapping[str, Any]) -> None:
    """Write tensors with what they belong to, and what else there is to know, which must be JSON."""
    make_folder(path.parent)
    named = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    text = {"format": _FORMAT, "about": about.to_json(), "state": json.dumps(state)}
    with atomic_file(path.parent, path.name) as temporary:
        torch_package(name="safetensors").torch.save_file(named, str(temporary), metadata=text)


def read_weights(path: str | Path) -> tuple[dict[str, Any], PolicyInfo, dict[str, Any]]:
    """Read what `write_weights` wrote."""
    torch_package()
    if not Path(path).is_file():
        raise UsageError(f"there are no weights {path}: run {command('train', 'imitation')}")
    try:
        with torch_package(name="safetensors").safe_open(str(path), framework="pt") as file:
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


# Layers whose last output is no word and no scene: it stays the last when words or scenes are added.
_LAST_STAYS = ("sight.words.", "whereabouts.body.2.")


@dataclass(frozen=True)
class InitialWeights:
    """Weights that a training begins with, and what they were made for."""

    path: str
    sha256: str
    tensors: dict[str, Any]  # By the names that they have in the network
    about: PolicyInfo

    def check_fit(self, sensors: Sensors, model: ModelConfig) -> None:
        """Refuse a recipe with other views or sizes; UsageError names the key."""
        own, sizes = self.about.sensors, model.model_dump(mode="json").items()
        pairs = {"[data] views": (list(own.views), list(sensors.views)), "[data] size_px": (own.width, sensors.width)}
        pairs |= {f"[model] {key}": (self.about.shape[key], value) for key, value in sizes}
        for key, (its, ours) in pairs.items():
            if its != ours:
                raise UsageError(
                    f"{self.path} does not fit the recipe: its {key} is {its}, and the recipe's is {ours}"
                )

    def vocabulary(self, own: Vocabulary) -> Vocabulary:
        """Return its vocabulary with the words that only the training has, after them."""
        return Vocabulary(joined(self.about.vocabulary.words, own.words), self.about.vocabulary.length)

    def copy_to(self, network: Any) -> None:
        """Give a network these weights; what it has beyond them (new words, new scenes, a sight) stays as it is."""
        with torch_package().no_grad():
            for name, tensor in network.state_dict().items():
                given = self.tensors.get(name)
                if given is None:
                    continue
                if name.startswith(_LAST_STAYS):
                    tensor[-1], tensor, given = given[-1], tensor[: len(given) - 1], given[:-1]
                tensor[tuple(slice(n) for n in given.shape)] = given


def read_initial_weights(path: str | Path) -> InitialWeights:
    """Read weights of `train`; UsageError or StoreError where there are none to begin with."""
    network, about = read_network(path)
    if not about.scenes:
        raise UsageError(
            f"{path} does not say which scenes it was trained on (an older version wrote it): train it again"
        )
    return InitialWeights(str(path), file_digest(Path(path)), network.state_dict(), about)


def joined(first: Iterable[str], more: Iterable[str]) -> tuple[str, ...]:
    """Join names, each once, in their order."""
    return tuple(dict.fromkeys((*first, *more)))


# Tokens of a text: what is longer is no description.
_LONGEST = 1024


class Policy(AgentBase):
    """Flies what a network says, the most likely action at each step."""

    def __init__(
        self, weights: str = "", any_release: bool = False, device: str = "cpu", sha256: str | None = None
    ) -> None:
        torch = self._torch = torch_package()
        if not weights:
            raise UsageError("a policy needs weights: --option weights=data/policies/imitation/policy.safetensors")
        # An observation is too little work to be shared, and the cores have a worker each.
        torch.set_num_threads(1)
        network, self._about = read_network(weights)
        self._sha256, self._weights = file_digest(Path(weights)), weights
        if sha256 is not None and sha256 != self._sha256:
            raise UsageError(f"{weights} has changed since the run began: give another --run")
        self._any_release, self._device = any_release, device
        self.network = network.to(device).eval()
        self.sensors = self._about.sensors

    def check(self) -> str:
        """Nothing is asked for that could fail: the weights were read."""
        return ""

    def settled(self) -> dict[str, Any]:
        """Return the weights' digest, for the instances that fly and for the log."""
        return {"sha256": self._sha256}

    def used_options(self) -> dict[str, Any]:
        """Return the options for the log, and what the weights record of their training."""
        return {
            "weights": self._weights, "sha256": self._sha256, "any_release": self._any_release,
            "device": self._device, "trained_on": list(self._about.scenes), "init": self._about.init,
        }  # fmt: skip

    def suits(self, release: str) -> None:
        """Refuse a release of other scenes."""
        if release != self._about.release and not self._any_release:
            raise UsageError(
                f"{self._weights} learned from another release: its fingerprint is {self._about.release[:16]}, and "
                f"that of this one is {release[:16]}; to fly here all the same: --option any_release=true"
            )

    def reset(self, goal: Goal) -> None:
        """Begin an episode: read the goal once."""
        torch, about = self._torch, self._about
        text = goal_text(goal.target_name, goal.landmark, goal.direction, goal.description)
        tokens = torch.from_numpy(about.vocabulary.encode(text)[None]).to(self._device)
        image = torch.from_numpy(goal_picture(goal.image, about.shape["size_px"])[None]).to(self._device)
        shown = torch.tensor([goal.image is not None], device=self._device)
        with torch.inference_mode():
            self._goal = self.network.encode_goal(tokens, image, shown)
        self._reckoning, self._previous, self._memory = DeadReckoning(), N_ACTIONS, None
        self._doubt: list[float] = []
        # Looks that nothing was searched in: what is known needs no search, and it takes half as long as all else.
        self._unsearched: list[tuple[Any, NDArray[np.float32]]] = []
        words = word_targets([goal.target_name], about.named)[0]
        self._search = Search(words, self.sensors) if about.named else None

    def act(self, observation: Observation) -> int:
        """Observe, update the memory, choose."""
        torch, device, sensors = self._torch, self._device, self.sensors
        if self._previous != N_ACTIONS:
            self._reckoning.add(self._previous, bool(observation.refused))
        pictures = None
        if sensors.views:
            rgb = np.stack([observation.rgb[view] for view in sensors.views])
            depth_m = np.stack([observation.depth_m[view] for view in sensors.views])
            pictures = torch.from_numpy(packed(rgb, depth_m, sensors)[None]).to(device)
        odometry = torch.from_numpy(self._reckoning.odometry[None, None]).to(device)
        with torch.inference_mode():
            step = torch.ones((1, 1), dtype=torch.bool, device=device)
            seen = self.network.features(pictures, self._goal, step)
            memory = self.network.blank(1).to(device) if self._memory is None else self._memory
            estimate, self._memory = self.network.whereabouts(seen, self._goal, odometry, memory)
            if self._search is not None and pictures is not None:
                self._doubt.append(float(estimate.scene_nats[0, 0]))
                self._unsearched.append((pictures[0], self._reckoning.odometry))
                if np.mean(self._doubt) > LOST_NATS:
                    self._notice(self._search)
                    away = self._search.towards(self._reckoning.odometry, observation.remaining_actions)
                    estimate = estimate.with_goal_offset(torch.from_numpy(away[None, None]).to(device))
            output = self.network.choose(seen, estimate)
        back = torch.from_numpy(self._reckoning.back[None, None]).to(device)
        self._previous = int(output.actions(back)[0, 0])
        return self._previous

    def _notice(self, search: Search) -> None:
        """Search what was seen so far: a map that was trusted may turn out to be of somewhere else."""
        for pictures, odometry in self._unsearched:
            chances = self.network.sight(pictures).log_softmax(dim=-1).flatten(0, 1)
            search.observe(chances.cpu().numpy(), pictures.cpu().numpy(), odometry)
        self._unsearched.clear()


def _check_shapes(about: PolicyInfo, shape: Any) -> None:
    """Refuse what the weights cannot take; that shape holds for them has been seen. ValueError says what."""
    sensors, vocabulary, edge = about.sensors, about.vocabulary, shape.size_px
    if len(sensors.views) != shape.views or len(vocabulary) != shape.words:
        raise ValueError(
            f"{len(sensors.views)} views and {len(vocabulary)} words, for weights of {shape.views} and {shape.words}"
        )
    if sensors.views and (sensors.width, sensors.height) != (edge, edge):
        raise ValueError(f"pictures of {sensors.width} x {sensors.height}, for weights of {edge} x {edge}")
    if len(about.named) != shape.named:
        raise ValueError(f"{len(about.named)} words to search for, for weights of {shape.named}")
    if about.scenes and len(about.scenes) != shape.scenes:
        raise ValueError(f"{len(about.scenes)} scenes, for weights of {shape.scenes}")
    if vocabulary.length > _LONGEST:
        raise ValueError(f"texts of {vocabulary.length} tokens, {_LONGEST} at most")


def read_network(path: str | Path) -> tuple[Any, PolicyInfo]:
    """Make the network that weights are of; StoreError where they do not fit it."""
    from aerialdojo_gen.learning.network import Network, Shape

    tensors, about, _ = read_weights(path)
    try:
        shape = Shape(**{**about.shape, "channels": tuple(about.shape["channels"])})
        # Of no memory until the file's own tensors are in it: a shape may say anything.
        with torch_package().device("meta"):
            network = Network(shape)
        network.load_state_dict({name.removeprefix("network."): t for name, t in tensors.items()}, assign=True)
        network.float()
        _check_shapes(about, shape)
    except (RuntimeError, TypeError, ValueError, KeyError) as error:
        raise StoreError(f"{path} holds no policy of this version: {first_line(error)}") from None
    return network, about
