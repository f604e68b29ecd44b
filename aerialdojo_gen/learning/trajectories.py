"""A release as a data set: reference trajectories with observations, goals and actions."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base.cli_context import command
from aerialdojo_gen.base.errors import UsageError
from aerialdojo_gen.base.names import as_names, check_known
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.tasks import Selection, draw_evenly, mesh_of, reference_image
from aerialdojo_gen.benchmark.worlds import make_worlds
from aerialdojo_gen.learning import pictures
from aerialdojo_gen.learning.index import Index, read_index
from aerialdojo_gen.learning.labels import PRIVILEGED, labels_at, scatter_rows, split_batch
from aerialdojo_gen.learning.loader import Order
from aerialdojo_gen.learning.words import Vocabulary
from aerialdojo_gen.store.cache import cache_folder
from aerialdojo_gen.store.root import DataRoot, Where, open_root

GOALS = ("text", "tokens", "image")
SOURCES = ("render", "recordings", "auto")
_OF_WORLDS = ("start_seed", "num_worlds", "knobs", "held_out", "n_objects", "worlds_cache")


@dataclass(frozen=True)
class SampleOptions:
    """Which trajectories are samples, and what a sample has; where several names may stand, one may stand alone."""

    setting: str | Sequence[str] = ()  # All where absent
    scene: str | Sequence[str] = ()  # Names or globs; all where absent
    target_split: str | None = None  # "train" or "test" of the split by objects, where the release has it
    # Successful flights of these runs of `evaluate` or `fly` in place of the references.
    run: str | Sequence[str] = ()
    limit: int | None = None  # Draw so many trajectories by `seed`, spread over the scenes
    seed: int = 0
    views: str | Sequence[str] = ("front",)  # Of front, left, right, down
    size: int | tuple[int, int] = 128  # Pixels: edge, or width and height
    rgb: bool = True  # Which pictures; without both nothing is drawn
    depth: bool = True
    goal: str | Sequence[str] = "text"  # Of "text", "tokens", "image"
    # "task": the task's own description; "random": one of its target's, of the task's side, drawn by `seed`.
    paraphrase: str = "task"
    past: int | None = 0  # Steps before a sample's last; None for whole trajectories, each with a T of its own
    # Every so many steps a sample ends, counted back from the Stop: with past = stride - 1 a step is in one sample.
    stride: int = 1
    privileged: str | Sequence[str] = ()  # Of "pose", "goal_distance_m", "actions"
    # "render" draws pictures from the meshes; "recordings" takes the trajectories that have a recording, and reads
    # that; "auto" reads where there is one and draws else. Recorded pictures are lossy and made smaller.
    source: str = "render"
    cache_gb: float = 0.0  # Keep pictures in so many gigabytes of the disk; 0 keeps none
    cache_dir: str | Path | None = None  # Where; learning/ in $AERIALDOJO_CACHE where absent
    # Of the tokens; the words of this selection where absent. Give a test set that of its training set.
    vocabulary: Vocabulary | None = None
    renderer: str = "auto"  # "gl", "pybullet" or "auto"
    max_depth_m: float = 65.535  # Range of the depth camera

    def __post_init__(self) -> None:
        """Check what no list of names checks."""
        check_known("no source", [self.source], SOURCES)
        if self.run and self.source != "render":
            raise UsageError(
                f"recordings are of the references: choose source='render' beside run, not {self.source!r}"
            )
        if (self.past is not None and self.past < 0) or self.stride < 1 or self.cache_gb < 0:
            raise UsageError("past and cache_gb are at least 0, stride at least 1")

    @property
    def sensors(self) -> Sensors:
        """What the body sees."""
        width, height = (self.size, self.size) if isinstance(self.size, int) else self.size
        return Sensors(as_names(self.views), self.rgb, self.depth, width, height, max_depth_m=self.max_depth_m)


class Trajectories:
    """Reference trajectories as samples: a map-style data set for ``torch.utils.data.DataLoader``, or without torch.

    A sample ends at one step of a trajectory and looks back over `past` steps; T = past + 1. All arrays lead with T:

    - ``rgb`` (T, views, H, W, 3) uint8; ``depth_m`` (T, views, H, W) float32, metres, 0 where nothing is in range
    - ``action`` (T,) int64: what the reference does there, 0 to 15; ``previous_action``: 16 at the first step
    - ``remaining_actions`` (T,) int32; ``odometry`` (T, 4) float32: x forward, y left, z up in metres and yaw in
      radians, from the start pose and in its frame, which an agent can reckon from its actions
    - ``mask`` (T,) bool: False before the trajectory's first step, where everything else is 0
    - ``text``, ``tokens`` (length,) int64 or ``image`` (h, w, 3) uint8, as `goal` says; ``has_image`` bool beside
    - ``nav_id`` and ``step`` (int64), which the sample ends at
    - of `privileged`, which no agent may know: ``pose`` (T, 4) float64; ``goal_distance_m`` (T,) float32, the length
      of the shortest way that can be flown; by ``"actions"`` ``action_collides``, ``action_refused`` (T, 16) bool and
      ``action_cost_to_go_m`` (T, 16) float32, infinite where the action collides

    Samples come by number (``data[3]``), many at a time (``data.batch([3, 4, 5])``, drawn together), or in order of
    number (``for sample in data``); `order` has the shuffled batches of an epoch.

    Parameters
    ----------
    release : str, Path or DataRoot, or a sequence of them
        The data directory, in which ``release/`` lies, and beside it ``meshes/`` and ``media/``. Several must have
        scenes of different names; one in which no task fits is left out.
    split : str or sequence of str
    worlds : str or sequence of str, optional
        In place of a release: names of scene types, or globs, whose worlds are samples. Those that the user's cache
        does not have are made first, some half a minute of a core each. Worlds of seeds below 1,000 have no training
        tasks, held-out ones no `split` of ``id_``.
    **options
        The fields of `SampleOptions`; with `worlds` also ``start_seed`` (1000), ``num_worlds`` (1, of every type),
        ``knobs``, ``held_out``, ``n_objects`` and ``worlds_cache``, as of
        `aerialdojo_gen.benchmark.worlds_env.WorldsEnv`, where the last is ``cache``.

    Attributes
    ----------
    index : Index
        The trajectories.
    sensors : Sensors
    vocabulary : Vocabulary
    fingerprint : str
        SHA-256 of what samples are made from: the trajectories and the parameters that shape a sample.

    Raises
    ------
    UsageError
        No task fits, or a value makes no sense.
    StoreError
        There is no release, or a scene's mesh is missing.
    AerialDojoError
        A world could not be made.
    """

    def __init__(
        self,
        release: Where | Sequence[Where] | None = None,
        split: str | Sequence[str] = "id_train",
        *,
        worlds: str | Sequence[str] | None = None,
        **options: Any,
    ) -> None:
        of_worlds = {name: options.pop(name) for name in _OF_WORLDS if name in options}
        own = SampleOptions(**options)
        self.goal = _chosen("goal", own.goal, GOALS)
        self.privileged = _chosen("privileged column", own.privileged, PRIVILEGED)
        self.sensors, self.past, self.stride = own.sensors, own.past, own.stride
        # One modality alone where it is the only one asked for: both instances have the same trajectory.
        modalities = ("image",) if self.goal == ("image",) else ()
        chosen = Selection(as_names(split), as_names(own.setting), modalities, as_names(own.scene), None, own.seed)
        roots = _roots(release, worlds, of_worlds)
        self.index = read_index(roots, chosen, own.target_split, as_names(own.run), own.paraphrase)
        if own.limit is not None:
            self.index = self.index.take(sample_evenly(self.index, own.limit, own.seed))
        self._source = None if self.sensors.blind else self._open_source(own)
        steps = self.index.steps
        ends = np.ones(len(steps), np.int64) if own.past is None else (steps - 1) // own.stride + 1
        self._first = np.concatenate([[0], np.cumsum(ends)])
        self._texts = self.index.goal_texts
        self.vocabulary = own.vocabulary or Vocabulary.of(self._texts)
        self.fingerprint = self._fingerprint()

    def _open_source(self, own: SampleOptions) -> pictures.Source:
        """Open where pictures come from; of recordings alone only the trajectories that have one are kept."""
        # A scene without a mesh is named before the first epoch, not within it.
        for scene, root in self.index.roots.items():
            mesh_of(root, scene)
        if own.source == "recordings":
            self.index = recorded_alone(self.index, self.sensors, "source='render'")
        source: pictures.Source = pictures.RenderedFrames(self.index, self.sensors, own.renderer)
        if own.source != "render":
            source = pictures.RecordedFrames(self.index, self.sensors, source)
        if not own.cache_gb:
            return source
        base = Path(own.cache_dir) if own.cache_dir is not None else cache_folder() / "learning"
        most_bytes = int(own.cache_gb * 1e9)
        return pictures.CachedFrames(source, self.index, self.sensors, base, most_bytes, own.source, own.renderer)

    def __len__(self) -> int:
        """Return the number of samples."""
        return int(self._first[-1])

    def __getitem__(self, number: int) -> dict[str, Any]:
        """Return one sample."""
        return self.__getitems__([number])[0]

    def __getitems__(self, numbers: Sequence[int]) -> list[dict[str, Any]]:
        """Return samples, drawn together; ``torch.utils.data.DataLoader`` asks for a batch by this."""
        batch = self.batch(numbers)
        return [split_batch(batch, k, self.past is None) for k in range(len(numbers))]

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield all samples in the order of their numbers."""
        for begin in range(0, len(self), 32):
            yield from self.__getitems__(range(begin, min(begin + 32, len(self))))

    def order(self, batch_size: int, *, seed: int = 0, epoch: int = 0, start: int = 0, **how: Any) -> Order:
        """Return the batches of an epoch, as lists of numbers: a ``batch_sampler``.

        Parameters
        ----------
        batch_size : int
        seed, epoch : int
        start : int
            The batch to begin with.
        **how
            ``block``, ``streams``, ``shuffle`` and ``drop_last`` of `aerialdojo_gen.learning.loader.Order`.
        """
        return Order(self.index.scene, self._first, batch_size, seed=seed, epoch=epoch, start=start, **how)

    def place(self, number: int) -> tuple[int, int]:
        """Return a sample's trajectory, a row of `index`, and the step that it ends at."""
        if not -len(self) <= number < len(self):
            raise IndexError(f"there are {len(self):,} samples: {number} is none of them")
        number %= len(self)
        k = int(np.searchsorted(self._first, number, side="right")) - 1
        last = int(self.index.steps[k]) - 1
        return k, last - self.stride * int(self._first[k + 1] - 1 - number)

    def batch(self, numbers: Sequence[int]) -> dict[str, Any]:
        """Return samples as one: arrays lead with the sample and T, texts are lists.

        Samples of different T (whole trajectories) are padded at their front to the longest, with ``mask`` False.
        """
        places = [self.place(int(number)) for number in numbers]
        window = max(end + 1 for _, end in places) if self.past is None else self.past + 1
        rows = np.array([k for k, _ in places], np.int64)
        ends = np.array([end for _, end in places], np.int64)
        steps = ends[:, None] + np.arange(1 - window, 1)
        mask = steps >= 0
        out: dict[str, Any] = {"mask": mask, "step": ends, "nav_id": [self.index.nav_id[k] for k, _ in places]}
        out |= self._goals(rows)
        labels = [labels_at(self.index, k, steps[i, mask[i]], self.privileged) for i, (k, _) in enumerate(places)]
        out |= {name: scatter_rows(np.concatenate([of[name] for of in labels]), mask) for name in labels[0]}
        frames = self._frames(np.broadcast_to(rows[:, None], steps.shape)[mask], steps[mask])
        for name, seen in frames.items():
            out[name] = seen.reshape(*mask.shape, *seen.shape[1:]) if mask.all() else scatter_rows(seen, mask)
        return out

    def _goals(self, rows: NDArray[np.int64]) -> dict[str, Any]:
        out: dict[str, Any] = {}
        if "text" in self.goal:
            out["text"] = [self._texts[k] for k in rows]
        if "tokens" in self.goal:
            out["tokens"] = np.stack([self.vocabulary.encode(self._texts[k]) for k in rows])
        if "image" in self.goal:
            ids = [self.index.goal_columns["reference_image_id"][k] for k in rows]
            sources = zip(ids, (self.index.sources[k] for k in rows), strict=True)
            out["image"] = np.stack([self._no_image if i is None else reference_image(*of, i) for i, of in sources])
            out["has_image"] = np.array([i is not None for i in ids])
        return out

    @cached_property
    def _no_image(self) -> NDArray[np.uint8]:
        # Of the selection, not of what was seen before: a batch without a picture is the same whenever it comes.
        for source, image_id in zip(self.index.sources, self.index.goal_columns["reference_image_id"], strict=True):
            if image_id is not None:
                return np.zeros_like(reference_image(*source, image_id))
        return np.zeros((0, 0, 3), np.uint8)

    def _frames(self, trajectories: NDArray[np.int64], steps: NDArray[np.int64]) -> pictures.Frames:
        if self._source is None:
            return {}
        # Windows overlap: what two samples of a batch share is drawn once, a scene after the other.
        keys = np.stack([self.index.scene[trajectories], trajectories, steps])
        (scenes, *drawn), back = np.unique(keys, axis=1, return_inverse=True)
        out = pictures.empty_frames(self.sensors, len(scenes))
        for rows in (np.flatnonzero(scenes == scene) for scene in np.unique(scenes)):
            pictures.put(out, rows, self._source.frames(*(of[rows].astype(np.int64) for of in drawn)))
        return pictures.take(out, np.asarray(back, np.int64).ravel())

    def _fingerprint(self) -> str:
        s = self.sensors
        facts = {
            "trajectories": self.index.digest, "past": self.past, "stride": self.stride, "goal": self.goal,
            "privileged": self.privileged, "words": self.vocabulary.words, "length": self.vocabulary.length,
            "sensors": [s.views, s.rgb, s.depth, s.width, s.height, s.fov_deg, s.max_depth_m],
        }  # fmt: skip
        return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def _roots(
    release: Where | Sequence[Where] | None, worlds: str | Sequence[str] | None, of_worlds: dict[str, Any]
) -> list[DataRoot]:
    if (release is None) == (worlds is None):
        raise UsageError("name either a release or worlds")
    if worlds is not None:
        folder = of_worlds.pop("worlds_cache", None)
        return [open_root(path) for path in make_worlds(worlds, folder=folder, **of_worlds)]
    if of_worlds:
        raise UsageError(f"{', '.join(of_worlds)}: of worlds, not of a release")
    several = [release] if isinstance(release, DataRoot | Path | str) else list(release or ())
    return [open_root(one) for one in several]


def recorded_alone(index: Index, sensors: Sensors, else_: str) -> Index:
    """Keep the trajectories that have a recording; UsageError, which names what to choose else, without any."""
    recorded = pictures.RecordedFrames(index, sensors, pictures.RenderedFrames(index, sensors, "auto"))
    has = np.flatnonzero([recorded.has(k) for k in range(len(index))])
    if not len(has):
        raise UsageError(
            f"none of the {len(index):,} trajectories has a recording of the views asked for: run "
            f"{command('render')}, or choose {else_}"
        )
    return index.take(has)


def sample_evenly(index: Index, limit: int, seed: int) -> NDArray[np.int64]:
    """Draw rows of the index, ascending, spread evenly over the scenes; a larger limit only adds to them."""
    if limit < 1:
        raise UsageError(f"a limit is at least 1, not {limit}")
    return np.array(
        draw_evenly([scene for _, scene in index.sources], index.nav_id, limit, seed, "learning"), np.int64
    )


def _chosen(what: str, given: str | Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    names = as_names(given)
    check_known(f"no {what}", names, known)
    return tuple(name for name in known if name in names)
