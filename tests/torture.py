"""Kill commands, at random and at every call that writes, renames, syncs or removes; repeat them; compare every byte.

    python tests/torture.py -n 100 [--seed 0] [--kind export] [--base DIR]

A case copies a data directory, runs a command in a session of its own, kills the whole session with SIGKILL, and gives
the same command again. The directory then has to hold the files of an undisturbed run, byte for byte, and no other. An
odd case is killed after a random time, an even one at a random call, of those that an undisturbed run makes, of write,
rename, renameat2, fsync, syncfs, mkdir, rmdir, unlink, link or flock (tests/preload.py).
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from preload import library

ROOT = Path(__file__).resolve().parent.parent
SCENE, OTHER = "U_Courtyard_0", "U_Courtyard_1"
# Small pictures by the renderer that needs no graphics stack: what is tried is how files come to be, not what they show.
SMALL = """
width = 64
height = 64
renderer = "pybullet"
"""


@dataclass(frozen=True)
class Kind:
    """A command to kill.

    Attributes
    ----------
    arguments : callable
        ``(data, workers) -> list of str``: the command.
    prepare : callable
        ``(data, random)``: brings a copy of the finished data to where the command has something to do.
    """

    arguments: Callable[[Path, int], list[str]]
    prepare: Callable[[Path, random.Random], None]


def _pipeline(data: Path) -> str:
    return str(data.parent / "torture.toml")


def _run(data: Path, workers: int) -> list[str]:
    return ["run", _pipeline(data), "--data", str(data), "--workers", str(workers)]


def _render(frames: str) -> Callable[[Path, int], list[str]]:
    return lambda data, workers: [
        "render", "--pipeline", _pipeline(data), "--data", str(data), "--workers", str(workers), "--frames", frames,
        "--scene", SCENE,
    ]  # fmt: skip


def _export(data: Path, _workers: int) -> list[str]:
    return ["export", "--format", "aerialdojo", "--data", str(data), "--out", str(data / "exports" / "a"), "--force"]


def _import(data: Path, _workers: int) -> list[str]:
    source = str(data.parent / "exported")
    return ["import-benchmark", source, "--format", "aerialdojo", "--data", str(data), "--name", "a", "--force"]


def _evaluate(data: Path, workers: int) -> list[str]:
    return [
        "evaluate", "--agent", "oracle", "--limit", "40", "--run", "a", "--data", str(data), "--workers", str(workers)
    ]  # fmt: skip


# What `run` finds missing: the tables of a stage or of two, and what they own.
_STAGES = (
    ("scenes", "meshes"), ("landmarks", "objects", "chosen_anchors"), ("references",), ("pairs",), ("verdicts",),
    ("release",), ("recordings", "frames", "media"), ("anchors",), ("plans",),
)  # fmt: skip


def _lose_stages(data: Path, rng: random.Random) -> None:
    for tables in rng.sample(_STAGES, 3):
        for table in tables:
            shutil.rmtree(data / table)


def _lose_recordings(data: Path, _rng: random.Random) -> None:
    for table in ("recordings", "frames", "media"):
        shutil.rmtree(data / table / SCENE, ignore_errors=True)


def _older(folder: str, marker: str) -> Callable[[Path, random.Random], None]:
    """An earlier export or import, of other files, that is to be replaced."""

    def prepare(data: Path, rng: random.Random) -> None:
        if rng.random() < 0.75:
            (data / folder / "deep").mkdir(parents=True)
            for path in (marker, "old.txt", "deep/old.txt"):
                (data / folder / path).write_text("{}", encoding="utf-8")

    return prepare


def _nothing(_data: Path, _rng: random.Random) -> None:
    pass


KINDS = {
    "run": Kind(_run, _lose_stages),
    "render-video": Kind(_render("video"), _lose_recordings),
    "render-png": Kind(_render("png"), _lose_recordings),
    "export": Kind(_export, _older("exports/a", "export.json")),
    "import": Kind(_import, _older("imported/a", "import.json")),
    "evaluate": Kind(_evaluate, _nothing),
}


class Bench:
    """Where cases are tried: a finished data directory, and what undisturbed runs make of it.

    Parameters
    ----------
    folder : Path
        Scratch space.
    base : Path
        The data directory of a run of pipelines/smoke.toml.
    """

    def __init__(self, folder: Path, base: Path) -> None:
        self._folder = folder
        text = (ROOT / "pipelines" / "smoke.toml").read_text(encoding="utf-8").replace('"../', f'"{ROOT}/')
        (folder / "torture.toml").write_text(text + SMALL, encoding="utf-8")
        self._base = folder / "base"
        shutil.copytree(base, self._base)
        _lose_recordings(self._base, random.Random(0))
        self._command(_run(self._base, 2))
        export = ["export", "--format", "aerialdojo", "--data", str(self._base), "--out", str(folder / "exported")]
        self._command(export)
        self._whole: dict[str, dict[str, bytes]] = {}
        self._seconds: dict[str, float] = {}
        self._calls: dict[str, int] = {}

    def _command(self, arguments: list[str], env: dict[str, str] | None = None, kill_after: float = -1.0) -> int:
        """Run a command, killed after so many seconds where that is not negative; returns its exit status."""
        process = subprocess.Popen(
            [sys.executable, "-m", "aerialdojo_gen.cli", *arguments, *([] if _is_quiet(arguments) else ["--quiet"])],
            cwd=ROOT, env=os.environ | (env or {}), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            start_new_session=True,
        )  # fmt: skip
        try:
            _, said = process.communicate(timeout=kill_after if kill_after >= 0 else 900)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            _, said = process.communicate()
        wait_until_empty(process.pid)
        if process.returncode not in (0, -signal.SIGKILL):
            raise AssertionError(f"{' '.join(arguments)} ended with {process.returncode}: {said}")
        return process.returncode

    def _copy(self, name: str, rng: random.Random) -> Path:
        data = self._folder / "data"
        shutil.rmtree(data, ignore_errors=True)
        shutil.copytree(self._base, data)
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
        """Kill a command and repeat it.

        Returns
        -------
        str
            ``"killed"``, or ``"finished"`` where it came to its end before the kill.

        Raises
        ------
        AssertionError
            Files are missing, of other bytes, or left over; or a command failed.
        """
        self.undisturbed(name)
        data = self._copy(name, rng)
        arguments = KINDS[name].arguments(data, rng.choice((1, 2)))
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


def _is_quiet(arguments: list[str]) -> bool:
    return arguments[0] in ("export", "import-benchmark")


def _aimed(counter: Path, at: int) -> dict[str, str]:
    return {
        "LD_PRELOAD": str(library()), "PRELOAD_COUNTER": str(counter), "PRELOAD_KILL_AT": str(at),
        "PRELOAD_KILL_GROUP": "1", "PRELOAD_WRITES": "1",
    }  # fmt: skip


def wait_until_empty(session: int) -> None:
    """Wait until no process of a session is alive."""
    for _ in range(2000):
        alive = 0
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = stat.read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue
            alive += int(fields[3]) == session and fields[0] != "Z"
        if not alive:
            return
        time.sleep(0.02)
    raise AssertionError("processes outlived their parent")


def files_of(data: Path) -> dict[str, bytes]:
    """Every file of a data directory but the locks, and every folder that holds nothing."""
    found = {}
    for path in data.rglob("*"):
        name = path.relative_to(data).as_posix()
        if path.is_file() and path.name != ".lock":
            found[name] = path.read_bytes()
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
        base = asked.base
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
    for name in kinds:
        print(f"{name}: " + ", ".join(f"{n} {what}" for (of, what), n in sorted(became.items()) if of == name))
    failed = sum(n for (_, what), n in became.items() if what == "FAILED")
    print(f"{asked.n} cases, {failed} failed")
    raise SystemExit(bool(failed))


if __name__ == "__main__":
    main()
