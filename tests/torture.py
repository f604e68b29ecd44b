"""Kill commands, at random and at every call that writes, renames, syncs or removes; repeat them; compare every byte.

    python tests/torture.py -n 100 [--seed 0] [--kind export] [--base DIR]

A case copies a data directory, runs a command in a session of its own, kills the whole session with SIGKILL, and
gives the same command again. The directory then has to hold the files of an undisturbed run, byte for byte, and no
other. Every other case is killed after a random time, the rest at a random one of the calls that an undisturbed run
makes of write, rename, renameat2, fsync, syncfs, mkdir, rmdir, unlink, link and flock (tests/support/preload.py).
"""

from __future__ import annotations

import argparse
import functools
import random  # noqa: TID251 - which kills, not what is generated
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from support.preload import ForkServer

ROOT = Path(__file__).resolve().parent.parent
SCENE, OTHER = "U_Courtyard_0", "U_Courtyard_1"
# Small pictures by the renderer that needs no graphics stack: it is tried how files come to be, not what they show.
SMALL = """
width = 64
height = 64
renderer = "pybullet"
"""


class Kind(NamedTuple):
    """A command to kill."""

    arguments: Callable[[Path, int], list[object]]  # Of the data directory and a number of workers
    # Brings a copy of the finished data to where the command has something to do.
    prepare: Callable[[Path, random.Random], object]


def _run(data: Path, workers: int) -> list[object]:
    return ["run", data.parent / "torture.toml", "--data", data, "--workers", workers]


def _render(frames: str) -> Callable[[Path, int], list[object]]:
    return lambda data, workers: [
        "render", "--pipeline", data.parent / "torture.toml", "--data", data, "--workers", workers,
        "--frames", frames, "--scene", SCENE,
    ]  # fmt: skip


# What `run` finds missing: the tables of a stage or of two, and what they own.
_STAGES = (
    ("scenes", "meshes"), ("landmarks", "objects", "chosen_anchors"), ("references",), ("descriptions",), ("pairs",),
    ("verdicts",), ("release",), ("recordings", "frames", "media"), ("anchors",), ("plans",),
)  # fmt: skip


def _lose_stages(data: Path, rng: random.Random) -> None:
    for tables in rng.sample(_STAGES, 3):
        for table in tables:
            shutil.rmtree(data / table)


def _lose_recordings(data: Path, _rng: random.Random, scene: str = SCENE) -> None:
    for table in ("recordings", "frames", "media"):
        shutil.rmtree(data / table / scene)


def _older(folder: str, marker: str) -> Callable[[Path, random.Random], None]:
    """An earlier export or import, of other files, that is to be replaced."""

    def prepare(data: Path, rng: random.Random) -> None:
        if rng.random() < 0.75:
            (data / folder / "deep").mkdir(parents=True)
            for path in (marker, "old.txt", "deep/old.txt"):
                (data / folder / path).write_text("{}", encoding="utf-8")

    return prepare


KINDS = {
    "run": Kind(_run, _lose_stages),
    "render-video": Kind(_render("video"), _lose_recordings),
    "render-png": Kind(_render("png"), _lose_recordings),
    "export": Kind(
        # The release's own pictures: the small ones that the format asks for are drawn.
        lambda data, _: ["export", "--format", "aerialdojo", "--picture-size", 0, "--data", data,
                         "--out", data / "exports/a", "--force"],
        _older("exports/a", "export.json"),
    ),
    "import": Kind(
        lambda data, _: ["import-benchmark", data.parent / "exported", "--format", "aerialdojo", "--data", data,
                         "--name", "a", "--force"],
        _older("imported/a", "import.json"),
    ),
    "evaluate": Kind(
        lambda data, workers: ["evaluate", "--agent", "oracle", "--limit", 40, "--run", "a", "--data", data,
                               "--workers", workers],
        lambda _data, _rng: None,
    ),
}  # fmt: skip


# What the server of the commands imports; what takes seconds the first time, a child has from here: Numba, all props,
# which sources a stage imports.
IMPORTS = f"""
import importlib
from pathlib import Path
for name in (
    "aerialdojo_gen.pipeline.stages.work.render", "aerialdojo_gen.pipeline.stages.work.plan",
    "aerialdojo_gen.pipeline.stages.work.anchor_sample", "aerialdojo_gen.benchmark.runner",
    "aerialdojo_gen.exchange.exporting", "aerialdojo_gen.exchange.importing", "aerialdojo_gen.cli.app",
    "pandas",  # PyArrow does, as soon as it is given a list
    "pyarrow.dataset", "scipy.spatial",
):
    importlib.import_module(name)
from aerialdojo_gen.geometry import portable
from aerialdojo_gen.pipeline import runner
from aerialdojo_gen.scenes.catalogue import load_catalogue
portable.exp([0.0])
load_catalogue(Path({str(ROOT / "scene_assets")!r}))
for stage in runner.STAGES:
    runner.stage_code(stage.name)
"""
COMMAND = "from aerialdojo_gen.cli import app; app.main()"


class Bench:
    """Where cases are tried: a finished data directory, and what undisturbed runs make of it."""

    def __init__(self, folder: Path, base: Path) -> None:
        self._folder = folder
        # Its last section is that of recordings, which SMALL goes on with.
        text = (ROOT / "pipelines" / "smoke.toml").read_text(encoding="utf-8").replace('"../', f'"{ROOT}/')
        (folder / "torture.toml").write_text(text + SMALL, encoding="utf-8")
        self._base = base
        self.server = ForkServer(IMPORTS, COMMAND)
        self._whole: dict[str, dict[str, bytes]] = {}
        self._seconds: dict[str, float] = {}
        self._calls: dict[str, int] = {}

    def _command(self, arguments: list[object], env: dict[str, str] | None = None, kill_after: float = -1.0) -> int:
        """Run a command, killed after so many seconds where that is not negative; returns its exit status."""
        said = self._folder / "stderr"
        code = self.server.run(arguments, env or {}, said, kill_after)
        if code not in (0, -signal.SIGKILL):
            raise AssertionError(
                f"{' '.join(map(str, arguments))} ended with {code}: {said.read_text(encoding='utf-8')}"
            )
        return code

    def close(self) -> None:
        """End its processes."""
        self.server.close()

    @functools.cached_property
    def _small(self) -> Path:
        """The finished data with small recordings."""
        small = self._folder / "small"
        shutil.copytree(self._base, small)
        for scene in SCENE, OTHER:
            _lose_recordings(small, random.Random(0), scene)
        self._command(_run(small, 2))
        return small

    @functools.cached_property
    def exported(self) -> Path:
        """What there is to import."""
        out = self._folder / "exported"
        self._command(["export", "--format", "aerialdojo", "--data", self._base, "--out", out])
        return out

    def _copy(self, name: str, rng: random.Random) -> Path:
        data = self._folder / "data"
        shutil.rmtree(data, ignore_errors=True)
        shutil.copytree(self._small if name.startswith("r") else self._base, data)
        if name == "import":
            assert self.exported.is_dir()
        KINDS[name].prepare(data, rng)
        return data

    def undisturbed(self, name: str) -> None:
        """Note what a command leaves that nothing disturbs, how long it takes, and how many calls it makes."""
        if name in self._whole:
            return
        data = self._copy(name, random.Random(0))
        counter = self._folder / "counter"
        counter.unlink(missing_ok=True)
        started = time.monotonic()
        self._command(KINDS[name].arguments(data, 1), _aimed(counter, 10**9))
        self._seconds[name] = time.monotonic() - started
        self._calls[name] = counter.stat().st_size
        self._whole[name] = files_of(data)

    def case(self, name: str, rng: random.Random, aimed: bool) -> str:
        """Kill a command and repeat it; say whether it was ``"killed"`` or ``"finished"`` before the kill."""
        self.undisturbed(name)
        data = self._copy(name, rng)
        arguments = KINDS[name].arguments(data, rng.choice((1, 1, 1, 2)))
        if aimed:
            counter = self._folder / "counter"
            counter.unlink(missing_ok=True)
            at = rng.randint(1, self._calls[name])
            code = self._command(arguments, _aimed(counter, at))
            how = f"killed at call {at} of {self._calls[name]}"
        else:
            after = rng.uniform(0, self._seconds[name])
            code = self._command(arguments, kill_after=after)
            how = f"killed after {after:.2f} s"
        self._command(arguments)
        whole, found = self._whole[name], files_of(data)
        wrong = sorted(path for path in whole.keys() | found.keys() if whole.get(path) != found.get(path))
        assert not wrong, f"{name}, {how}: {', '.join(wrong[:8])}"
        return "killed" if code else "finished"


def _aimed(counter: Path, at: int) -> dict[str, str]:
    return {
        "PRELOAD_COUNTER": str(counter), "PRELOAD_KILL_AT": str(at),
        "PRELOAD_KILL_GROUP": "1", "PRELOAD_WRITES": "1",
    }  # fmt: skip


def files_of(data: Path) -> dict[str, bytes]:
    """Every file of a data directory but the locks, and every folder that holds nothing."""
    found = {}
    for path in data.rglob("*"):
        name = path.relative_to(data).as_posix()
        if path.is_file() and path.name != ".lock":
            # How long an episode took is another time every time.
            found[name] = b"" if name.startswith("timings/") else path.read_bytes()
        elif path.is_dir() and not any(path.iterdir()):
            found[f"{name}/"] = b""
    return found


def main() -> None:
    """Try cases and print what became of them; exit status 1 where one failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=100, help="cases")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", action="append", choices=KINDS, help="these alone, repeatable")
    parser.add_argument("--base", type=Path, help="a finished run of pipelines/smoke.toml; made where absent")
    asked = parser.parse_args()
    kinds = asked.kind or list(KINDS)
    with tempfile.TemporaryDirectory(prefix="aerialdojo-torture-") as folder:
        base: Path | None = asked.base
        if base is None:
            base = Path(folder) / "smoke"
            command = [sys.executable, "-m", "aerialdojo_gen.cli", "run", "pipelines/smoke.toml", "--data", str(base)]
            subprocess.run(command, cwd=ROOT, check=True)
        bench = Bench(Path(folder), base)
        became: Counter[tuple[str, str]] = Counter()
        for k in range(asked.n):
            name, aimed = kinds[k // 2 % len(kinds)], k % 2 == 1
            try:
                outcome = bench.case(name, random.Random(f"{asked.seed}/{k}"), aimed)
            except AssertionError as error:
                outcome = "FAILED"
                print(f"case {k}: {error}", flush=True)
            became[name, outcome] += 1
            print(f"{k + 1}/{asked.n} {name} {'aimed' if aimed else 'random'}: {outcome}", flush=True)
        bench.close()
    for name in kinds:
        print(f"{name}: " + ", ".join(f"{n} {what}" for (of, what), n in sorted(became.items()) if of == name))
    failed = sum(n for (_, what), n in became.items() if what == "FAILED")
    print(f"{asked.n} cases, {failed} failed")
    raise SystemExit(bool(failed))


if __name__ == "__main__":
    main()
