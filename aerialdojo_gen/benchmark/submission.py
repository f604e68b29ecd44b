"""A submission: the actions of all episodes of a run in one small file, to be flown again and scored elsewhere.

The file is gzipped JSON: it is read within bounds, and nothing in it is code or a path.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import math
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError, model_validator

from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.errors import AerialDojoError, Malformed, UsageError, brief, check_regular
from aerialdojo_gen.base.explain import explain
from aerialdojo_gen.base.safe_parse import MAX_JSON_BYTES, loads_json, read_json
from aerialdojo_gen.base.version import __version__
from aerialdojo_gen.benchmark.agents.simple import SYMBOLS
from aerialdojo_gen.benchmark.episodes import read_run
from aerialdojo_gen.benchmark.metrics import METRICS, PROFILES, episodes_of, summarize
from aerialdojo_gen.benchmark.tasks import Selection, mesh_of, select
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.atomic import atomic_write
from aerialdojo_gen.store.root import DataRoot, Where, open_root

_DIGITS = 6  # of metres and radians: a micrometre
_MAX_ACTIONS = 10_000  # of an episode

Word = Annotated[str, StringConstraints(max_length=200)]
Digest = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
_Actions = Annotated[str, StringConstraints(pattern=rf"^[{SYMBOLS}]+$", max_length=_MAX_ACTIONS)]


class SubmissionRefused(AerialDojoError):  # noqa: N818 - it says what is done with the file
    """A file is no submission, or does not replay on the release that it is scored on."""


class Strict(BaseModel):
    """Base of what is read from a file: no other keys, no conversions, no NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class RunFacts(Strict):
    """What a run was."""

    name: Word
    agent: Word
    agent_options: str = Field(max_length=20_000)  # JSON, without secrets
    told: Word
    program: Word  # Version of this package
    code: Digest  # Of the agent and of what flies it
    splits: list[Word]
    settings: list[Word]
    modalities: list[Word]
    scenes: list[Word]
    limit: int | None
    seed: int
    protocol: Word
    embodiment: dict[Word, float]
    requests: int | None  # To a service; None for an agent without one
    tokens: int | None

    @property
    def selection(self) -> Selection:
        """The tasks that it says it was on."""
        splits, settings, modalities, scenes = map(tuple, (self.splits, self.settings, self.modalities, self.scenes))
        return Selection(splits, settings, modalities, scenes, self.limit, self.seed, self.protocol)


class SceneFacts(Strict):
    """The scene and the tasks that a run saw."""

    mesh_sha256: Digest
    tasks: list[Digest]  # Content of the parts of `tasks` that it was on


class Flown(Strict):
    """Episodes, as columns of one length: what was done, and where it ended."""

    task_id: list[Word]
    actions: list[_Actions]
    termination: list[Literal["stop", "collision", "budget"]]
    x_m: list[float]
    y_m: list[float]
    z_m: list[float]
    yaw_rad: list[float]
    path_length_m: list[float]

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        lengths = {len(getattr(self, name)) for name in type(self).model_fields}
        if len(lengths) != 1 or not self.task_id:
            raise ValueError("the columns of episodes are empty or differ in length")
        if len(set(self.task_id)) != len(self.task_id):
            raise ValueError("a task stands in episodes twice")
        return self

    def digest(self) -> str:
        """Return the SHA-256 of tasks and actions."""
        lines = (f"{task} {actions}\n" for task, actions in zip(self.task_id, self.actions, strict=True))
        return hashlib.sha256("".join(lines).encode()).hexdigest()


class Submission(Strict):
    """What a file of a submission holds."""

    format: Literal["aerialdojo-submission"]
    version: Literal[1]
    run: RunFacts
    scenes: dict[Word, SceneFacts]
    metrics: dict[Word, float | None] | None  # Overall, by the profile aerialdojo; None where goals are withheld
    actions_sha256: Digest
    episodes: Flown


@dataclass(frozen=True)
class Logged:
    """A run's log, as a submission contains it."""

    table: pa.Table  # Its episodes, sorted by scene and task
    flown: Flown
    metrics: dict[str, float | None] | None


def logged(log: DataRoot, run: str) -> Logged:
    """Read a run's log from a submission."""
    table = read_run(log, run)
    steps = read_run(log, run, "steps", ["task_id", "action", "x_m", "y_m", "z_m", "yaw_rad"])
    lengths = table["n_actions"].to_numpy()
    ends = np.cumsum(lengths)
    owners = pc.take(steps["task_id"], pa.array(ends - 1)) if ends[-1] == steps.num_rows else None
    if owners is None or owners.to_pylist() != table["task_id"].to_pylist():
        raise SubmissionRefused(f"the steps of run {run!r} in {log} are not those of its episodes: fly it again")
    numbers = pc.fill_null(steps["action"], len(SYMBOLS) - 1).to_numpy()
    text = np.array(list(SYMBOLS), "S1")[numbers].tobytes().decode()
    last = steps.select(["x_m", "y_m", "z_m", "yaw_rad"]).take(pa.array(ends - 1))
    flown = Flown(
        task_id=table["task_id"].to_pylist(),
        actions=[text[end - n : end] for n, end in zip(lengths.tolist(), ends.tolist(), strict=True)],
        termination=table["termination"].to_pylist(),
        path_length_m=np.round(table["path_length_m"].to_numpy(), _DIGITS).tolist(),
        **{name: np.round(last[name].to_numpy(), _DIGITS).tolist() for name in last.column_names},
    )
    if pc.any(pc.is_nan(table["euclidean_m"])).as_py():
        return Logged(table, flown, None)
    overall = zip(METRICS, summarize(episodes_of(table), PROFILES["aerialdojo"]).overall[1:], strict=True)
    return Logged(table, flown, {name: None if math.isnan(v) else round(v, 9) for name, v in overall})


def scene_facts(data: DataRoot, rows: pa.Table) -> dict[str, SceneFacts]:
    """Return the digests of the scenes and tasks of a selection, by scene."""
    subsets = sorted(rows["subset"].unique().to_pylist())
    return {
        scene: SceneFacts(
            mesh_sha256=mesh_of(data, scene)[1],
            tasks=[digest for subset in subsets for digest in store.content(data, f"tasks/{subset}", scene)],
        )
        for scene in sorted(rows["scene"].unique().to_pylist())
    }


def write_submission(data: Where, log: Where, run: str, file: Path) -> int:
    """Write a finished run of `evaluate` as a submission; returns the file's bytes."""
    root, written = open_root(data), open_root(log)
    settings: dict[str, Any] = read_json(written.below(f"runs/{run}").local_copy("run.json"))
    found = logged(written, run)
    first = found.table.slice(0, 1).to_pylist()[0]
    requests, *tokens = (
        None if found.table[name].null_count else int(pc.sum(found.table[name]).as_py())
        for name in ("n_requests", "input_tokens", "output_tokens")
    )
    facts = RunFacts(
        name=run, agent=first["agent"], agent_options=first["agent_options"], told=first["told"] or "",
        program=__version__, code=settings["code"], embodiment=settings["embodiment"],
        requests=requests, tokens=None if None in tokens else sum(filter(None, tokens)),
        **{field.name: settings[field.name] for field in fields(Selection)},
    )  # fmt: skip
    rows = select(root, facts.selection)
    check_tasks(rows["task_id"].to_pylist(), found.flown.task_id, f"run {run!r}", "the same command flies the others")
    made = Submission(
        format="aerialdojo-submission", version=1, run=facts, scenes=scene_facts(root, rows), metrics=found.metrics,
        actions_sha256=found.flown.digest(), episodes=found.flown,
    )  # fmt: skip
    text = json.dumps(made.model_dump(), allow_nan=False, separators=(",", ":"))
    packed = gzip.compress(text.encode(), 9, mtime=0)
    if len(text) > MAX_JSON_BYTES:
        raise UsageError(f"run {run!r} is too long for one submission: narrow --split or --setting")
    atomic_write(file.parent, file.name, packed)
    return len(packed)


def read_submission(file: Path) -> Submission:
    """Read a file from outside; `SubmissionRefused` where it is no submission."""
    try:
        check_regular(file)
        with file.open("rb") as packed:
            # Text never grows by packing, so that a larger file is none of ours.
            raw = packed.read(MAX_JSON_BYTES + 1)
    except OSError as error:
        raise SubmissionRefused(f"{file}: cannot be read ({error.strerror})") from None
    try:
        unpack = zlib.decompressobj(wbits=31)
        text = unpack.decompress(raw, MAX_JSON_BYTES + 1)
    except zlib.error:
        raise SubmissionRefused(f"{file} is no submission: it is not gzipped JSON, as evaluate --submission writes it"
                                ) from None  # fmt: skip
    if len(text) > MAX_JSON_BYTES or len(raw) > MAX_JSON_BYTES:
        raise SubmissionRefused(f"{file} is no submission: it has more than {MAX_JSON_BYTES >> 20} MiB of text")
    if not unpack.eof or unpack.unused_data:
        raise SubmissionRefused(f"{file} is damaged: it is cut off, or something follows its end")
    try:
        made = Submission.model_validate(loads_json(text))
    except Malformed as error:
        raise SubmissionRefused(f"{file} is no submission: {brief(str(error))}") from None
    except ValidationError as error:
        raise SubmissionRefused(f"{file} is no submission: {explain(error, Submission)[0]}") from None
    if made.episodes.digest() != made.actions_sha256:
        raise SubmissionRefused(f"{file} is refused: its actions were changed after it was written (other digest)")
    return made


def check_tasks(wanted: Sequence[str], there: Sequence[str], what: str, mend: str) -> None:
    """Hold tasks against those that are to be there."""
    lacking, strange = set(wanted) - set(there), set(there) - set(wanted)
    for ids, fault in ((strange, "has {} tasks of another selection or release beside"), (lacking, "lacks {} of")):
        if ids:
            found = fault.format(f"{len(ids):,}")
            raise SubmissionRefused(
                f"{what} {found} the {len(wanted):,} tasks, such as {brief(min(ids), 60)}: {mend}"
            )


def embodiment_of(body: Embodiment) -> dict[str, float]:
    """Return a body in a submission's form."""
    return {name: float(value) for name, value in body.model_dump().items()}


def described(selection: Selection) -> str:
    """Write a selection as options of `evaluate`."""
    names = {"splits": "split", "settings": "setting", "modalities": "modality", "scenes": "scene"}
    given = asdict(selection)
    words = [f"--{option} {value}" for name, option in names.items() for value in given[name]]
    words += [f"--protocol {selection.protocol}"] if selection.protocol else []
    words += [f"--limit {selection.limit} --seed {selection.seed}"] if selection.limit is not None else []
    return " ".join(words) or "all tasks"
