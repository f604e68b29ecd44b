"""A whole training: references drawn once, behaviour cloning, rounds of DAgger; resumable."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import json
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.errors import Malformed, UsageError
from aerialdojo_gen.base.names import check_known
from aerialdojo_gen.base.safe_parse import loads_json, read_json
from aerialdojo_gen.benchmark.agents.goal import Sensors
from aerialdojo_gen.benchmark.tasks import Selection
from aerialdojo_gen.dataset.contents import release_fingerprint
from aerialdojo_gen.learning import policy
from aerialdojo_gen.learning.collect import collect, parts_of, view_parts
from aerialdojo_gen.learning.encoding import actions_fingerprint
from aerialdojo_gen.learning.index import Index, read_index
from aerialdojo_gen.learning.loader import torch_package
from aerialdojo_gen.learning.parts import DaggerRound, Part
from aerialdojo_gen.learning.recipe import Recipe
from aerialdojo_gen.learning.steps import Pool, Steps
from aerialdojo_gen.learning.trajectories import sample_evenly
from aerialdojo_gen.learning.words import Vocabulary, name_vocabulary
from aerialdojo_gen.pipeline.executors.base import make_executor
from aerialdojo_gen.pipeline.progress import Rate, Reporter, duration
from aerialdojo_gen.store.atomic import atomic_file, atomic_write, make_folder
from aerialdojo_gen.store.files import file_digest
from aerialdojo_gen.store.root import DataRoot, LocalRoot, Where, open_root

_SETTINGS, _CHECKPOINT, _HISTORY = "training.json", "checkpoint.safetensors", "history.jsonl"
# Of what precedes the rounds of DAgger.
_PHASES = {-1: "sight", 0: "imitation"}
# Seconds between progress lines.
_REPORT_EVERY_S = 15.0


@dataclass(frozen=True)
class TrainingResult:
    """Weight files of a training: after the references alone, and the last."""

    imitation: Path
    policy: Path


def train(
    data: Where,
    recipe: Recipe,
    *,
    out: str | Path | None = None,
    cache: str | Path | None = None,
    init: str | Path | None = None,
    device: str = "auto",
    workers: int | None = None,
    renderer: str = "auto",
    restart: bool = False,
    reporter: Reporter | None = None,
) -> TrainingResult:
    """Train a policy; `aerialdojo-gen train` in the library.

    On a CPU the weights depend on the release, the recipe, the renderer, the version of PyTorch and the number of
    cores alone: also where it was killed and went on.

    Parameters
    ----------
    data : DataRoot, Path or str
        The data directory, with a release and its meshes.
    recipe : Recipe
    out : str or Path, optional
        Folder of the weights and checkpoints; ``policies/NAME`` in the data directory where absent.
    cache : str or Path, optional
        Folder of what was drawn; ``policies/cache`` in the data directory where absent. Other recipes use it too.
    init : str or Path, optional
        Weights of another training to begin with, such as those of the ID scenes; random ones where absent. Their
        words and scenes keep their numbers, and new ones are added.
    device : str
        ``cpu``, ``cuda``, or ``auto`` for a GPU where there is one.
    workers : int, optional
        Processes that draw and fly; all cores where absent.
    renderer : str
        ``gl``, ``pybullet`` or ``auto``.
    restart : bool
        Forget an earlier training of this name.
    reporter : Reporter, optional

    Returns
    -------
    TrainingResult

    Raises
    ------
    MissingPackage
        There is no PyTorch.
    UsageError
        No task fits, the folder has another training's checkpoint, or the initial weights do not fit the recipe.
    StoreError
        There is no release, or a scene's mesh is missing.
    """
    check_known("no device", [device], ("auto", "cpu", "cuda"))
    root = open_root(data)
    # A missing release is reported before a missing package.
    release_fingerprint(root)
    torch = torch_package("train")
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    if device == "cuda" and not torch.cuda.is_available():
        raise UsageError("PyTorch finds no GPU here: --device cpu, or install its CUDA wheel")
    if not isinstance(root, LocalRoot) and (out is None or cache is None):
        raise UsageError("a training writes to a disk: give --out and --cache beside a release in an object store")
    base = root.path if isinstance(root, LocalRoot) else Path()
    folder = Path(out) if out is not None else base / "policies" / recipe.name
    drawn = Path(cache) if cache is not None else base / "policies" / "cache"
    make_folder(folder)
    with open_root(folder).lock():
        given = None if init is None else policy.read_initial_weights(init)
        own = _Training(root, recipe, folder, drawn, given, device, workers, renderer, reporter or Reporter(True))
        return own.run(restart)


class _Training:
    def __init__(
        self, root: DataRoot, recipe: Recipe, folder: Path, cache: Path, init: policy.InitialWeights | None,
        device: str, workers: int | None, renderer: str, reporter: Reporter,
    ) -> None:  # fmt: skip
        from aerialdojo_gen.learning.imitation import Learner
        from aerialdojo_gen.learning.network import Network, Shape

        torch = torch_package("train")
        self._recipe, self._folder, self._init = recipe, folder, init
        self._workers, self._reporter = workers, reporter
        d, m = recipe.data, recipe.model
        sensors = Sensors(d.views, bool(d.views), bool(d.views), d.size_px, d.size_px)
        # What all parts of the training data have in common.
        self._common = Part(root, Selection((d.split,)).splits, d.settings, sensors, renderer, cache, d.runs)
        self._index, named = self._read_index()
        vocabulary, scenes, words = Vocabulary.of(self._index.goal_texts), self._index.scenes, named
        if init is not None:
            init.check_fit(sensors, m)
            vocabulary = init.vocabulary(vocabulary)
            scenes, words = policy.joined(init.about.scenes, scenes), policy.joined(init.about.named, named)
        shape = Shape(
            words=len(vocabulary), views=len(d.views), size_px=d.size_px, scenes=len(scenes), named=len(words),
            **dict(m),
        )  # fmt: skip
        self._about = policy.PolicyInfo(
            asdict(shape), vocabulary, sensors, release_fingerprint(root), actions_fingerprint(), words, scenes,
            "" if init is None else init.sha256,
        )  # fmt: skip
        torch.manual_seed(recipe.seed)
        if device == "cpu":
            # As use_deterministic_algorithms(True), which imports PyTorch's compiler too: seconds.
            torch.set_deterministic_debug_mode("error")
            # Not needed, as no tensor is read before it is written, and costs a tenth of the time.
            torch.utils.deterministic.fill_uninitialized_memory = False
        network = Network(shape)
        if init is not None:
            init.copy_to(network)
        # The patch classifier is trained before the references.
        self._first = -1 if named else 0
        self._learner = Learner(network, recipe, device, self._first)
        self._reported = self._kept = time.monotonic()
        self._tensorboard: Any = None
        self._exploration: Pool | None = None

    def run(self, restart: bool) -> TrainingResult:
        recipe, learner, report = self._recipe, self._learner, self._reporter
        if restart:
            # The weights too: a phase that has some counts as done. The settings last, for a kill in between.
            for name in ("sight", "imitation", "policy", "dagger-*"):
                for path in self._folder.glob(f"{name}.safetensors"):
                    path.unlink()
            for name in (_CHECKPOINT, _HISTORY, _SETTINGS):
                (self._folder / name).unlink(missing_ok=True)
        self._check_settings()
        self._resume()
        index = self._index
        report.line(
            f"train {recipe.name}: {len(index):,} trajectories of {len(index.scenes)} scenes, "
            f"{int(index.steps.sum()):,} steps; {self._about.shape['words']:,} words; "
            f"{sum(p.numel() for p in learner.network.parameters()):,} weights on {learner.device}"
        )
        if self._init is not None:
            about, known = self._about, self._init.about
            words, scenes = len(known.vocabulary), len(known.scenes)
            report.line(
                f"train {recipe.name}: begins with {self._init.path}, scenes known: {scenes:,}, new: "
                f"{len(about.scenes) - scenes:,}; words known: {words:,}, new: {len(about.vocabulary) - words:,}"
            )
        with contextlib.suppress(ImportError):
            boards = importlib.import_module("torch.utils.tensorboard")
            self._tensorboard = boards.SummaryWriter(str(self._folder / "tensorboard"))
        parts = self._collect(parts_of(self._common, index, recipe.seed), "drawing references")
        d = recipe.data
        if d.looks and d.views:
            views = view_parts(self._common, index.scenes, d.looks, recipe.seed, d.target_split)
            self._exploration = self._pool(self._collect(views, "rendering extra views"))
        for phase in range(self._first, recipe.dagger.rounds + 1):
            if phase > 0:
                flown = self._weights(phase - 1)
                flying = DaggerRound(flown, file_digest(flown), recipe.seed, phase, recipe.dagger.teacher_share)
                tasks = parts_of(replace(self._common, dagger_round=flying), self._drawn(phase), recipe.seed)
                parts += self._collect(tasks, f"round {phase}: flying")
            if phase < learner.progress.phase or self._weights(phase).is_file():
                continue
            if phase > learner.progress.phase:
                learner.begin(phase)
            self._learn(parts, phase)
            weights = {n: t for n, t in learner.state().items() if n.startswith("network.")}
            policy.write_weights(self._weights(phase), weights, self._about, asdict(learner.progress))
            self._save_checkpoint()
        last = self._folder / "policy.safetensors"
        # Its bytes, so that they stay the same: who began with these weights, or flies them, goes by their digest.
        with atomic_file(self._folder, last.name) as temporary:
            shutil.copyfile(self._weights(recipe.dagger.rounds), temporary)
        report.line(f"train {recipe.name}: weights in {last}")
        return TrainingResult(self._weights(0), last)

    def _read_index(self) -> tuple[Index, tuple[str, ...]]:
        """Read the training trajectories, and the words that images will be searched for."""
        d = self._recipe.data
        index = read_index(self._common.data, Selection((d.split,), d.settings, (), d.scenes), d.target_split, d.runs)
        named: tuple[str, ...] = ()
        if d.looks and d.views and self._recipe.sight.epochs:
            # Of all targets, independent of the limit on trajectories.
            targets = set(zip(index.scene.tolist(), index.goal_columns["target_name"], strict=True))
            named = name_vocabulary(str(name) for _, name in sorted(targets, key=str))
        return (index if d.limit is None else index.take(sample_evenly(index, d.limit, self._recipe.seed))), named

    def _weights(self, phase: int) -> Path:
        return self._folder / f"{_PHASES.get(phase, f'dagger-{phase}')}.safetensors"

    def _drawn(self, phase: int) -> Index:
        """Draw a round's tasks, without those kept for validation."""
        index, free = self._index, np.flatnonzero(~self._held_out(self._index.nav_id)).tolist()
        free.sort(key=lambda k: rng.rank(self._recipe.seed, "dagger tasks", phase, index.nav_id[k]))
        return index.take(np.array(sorted(free[: self._recipe.dagger.episodes]), np.int64))

    def _collect(self, parts: list[Part], what: str) -> list[Steps]:
        with make_executor("local", self._workers) as executor:
            return collect(parts, executor, self._reporter, what)

    def _pool(self, parts: list[Steps]) -> Pool:
        return Pool(parts, self._about.scenes, self._about.vocabulary)

    def _held_out(self, nav_ids: Sequence[str]) -> NDArray[np.bool_]:
        share = self._recipe.data.validation_share * 2.0**64
        return np.array([rng.rank(self._recipe.seed, "kept back", n) < share for n in nav_ids], np.bool_)

    def _learn(self, parts: list[Steps], phase: int) -> None:
        train, dagger = self._recipe.train, self._recipe.dagger
        self._rate, self._what = Rate(), _PHASES.get(phase, f"round {phase}")
        if phase < 0 and self._exploration is not None:
            from aerialdojo_gen.learning.imitation import train_patch_classifier

            train_patch_classifier(self._learner, self._exploration, self._about.named, self)
            return
        epochs, rate = (dagger.epochs, dagger.learning_rate) if phase else (train.epochs, train.learning_rate)
        pool = self._pool(parts)
        self._learner.learn(pool, self._exploration, self._held_out(pool.nav_id.tolist()), epochs, rate, self)

    def on_batch(self, done: int, total: int, loss: float, accuracy: float) -> None:
        per_s, now = self._rate.per_s(done), time.monotonic()
        if self._tensorboard is not None:
            self._tensorboard.add_scalar(f"{self._what}/loss", loss, done)
            self._tensorboard.add_scalar(f"{self._what}/accuracy", accuracy, done)
        if now - self._reported >= _REPORT_EVERY_S:
            self._reported = now
            left = f", {duration((total - done) / per_s)} left" if per_s else ""
            self._reporter.line(
                f"{self._what}: batch {done:,} of {total:,}, loss {loss:.3f}, accuracy {accuracy:.1%}{left}"
            )
        if now - self._kept >= self._recipe.train.checkpoint_s:
            self._save_checkpoint()

    def on_epoch(self, row: dict[str, Any], epochs: int, left_s: float) -> None:
        kept = f" (kept back: {_describe(row['kept_back'])})" if row["kept_back"] else ""
        self._reporter.line(
            f"{self._what}: epoch {row['epoch'] + 1} of {epochs}, loss {row['loss']:.3f}, accuracy "
            f"{row['accuracy']:.1%}{kept}, {duration(left_s)} left"
        )
        with (self._folder / _HISTORY).open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        self._save_checkpoint()

    def _save_checkpoint(self) -> None:
        progress = asdict(self._learner.progress)
        policy.write_weights(self._folder / _CHECKPOINT, self._learner.state(), self._about, progress)
        self._kept = time.monotonic()

    def _resume(self) -> None:
        path = self._folder / _CHECKPOINT
        if path.is_file():
            tensors, _, state = policy.read_weights(path)
            self._learner.restore(tensors, state)
        # An epoch in the history but not in the checkpoint is repeated.
        p, file = self._learner.progress, self._folder / _HISTORY
        if file.is_file():
            rows = [row for row in _rows(file) if (row["phase"], row["epoch"]) < (p.phase, p.epoch)]
            atomic_write(self._folder, _HISTORY, "".join(json.dumps(row) + "\n" for row in rows))

    def _check_settings(self) -> None:
        """Write the training's settings; UsageError if the folder was begun with others."""
        recipe = self._recipe.model_dump(mode="json", exclude={"small", "name"})
        recipe["train"].pop("checkpoint_s")
        own = {"recipe": hashlib.sha256(json.dumps(recipe, sort_keys=True).encode()).hexdigest(),
               "release": self._about.release, "trajectories": self._index.digest,
               "action set": self._about.actions, "set of initial weights": self._about.init or "none"}  # fmt: skip
        path = self._folder / _SETTINGS
        if path.is_file():
            before = read_json(path, UsageError)
            for name, value in own.items():
                old = str(before.get(name, "none")) if isinstance(before, dict) else "none"
                if old != value:
                    raise UsageError(
                        f"{self._folder} was begun with another {name}: its fingerprint is {old[:16]}, and that of "
                        f"this one is {value[:16]}; give --restart, or another --out"
                    )
        atomic_write(self._folder, _SETTINGS, json.dumps(own, indent=2) + "\n")


def _rows(file: Path) -> Iterator[dict[str, Any]]:
    """Read a history; the last line may be cut short."""
    for line in file.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            yield loads_json(line)
        except Malformed:
            return


def _describe(kept: dict[str, Any]) -> str:
    """Describe an `Assessment`: the accuracy on what was not trained on."""
    shares = [(kept["blocked_told"], "blocked"), (kept["free_told"], "free")]
    parts = [f"{share:.1%} of {what}" for share, what in shares if share is not None]
    suffix = f"; {' and '.join(parts)} actions told" if parts else ""
    off = f"{kept['goal_off_at_start_m']:.1f} m at the start, {kept['goal_off_m']:.1f} m in all"
    return f"{kept['accuracy']:.1%}; goal off by {off}{suffix}"
