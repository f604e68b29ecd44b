"""Work for executors to do, which their processes import: small, and with every way to end."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.pipeline.executors.base import TaskQueue, at_end


@dataclass(frozen=True)
class Chore:
    """A task: its number, its scene, and a folder where traces are left."""

    number: int
    scene: str = ""
    folder: Path = Path()
    kind: str = ""

    @property
    def label(self) -> str:
        return f"chore {self.number}"


def square(chore):
    return chore.number, chore.number**2


def wait_for_the_others(chore):
    """Number 0 ends when all others have: the order of finishing is not that of giving."""
    done = chore.folder / str(chore.number)
    if chore.number == 0:
        # The third begins when the second's result was taken: two at least are known by then.
        until(lambda: len(list(chore.folder.iterdir())) >= 3)
    done.touch()
    return chore.number


def where(chore):
    # Long enough that no process does all before another one has started.
    time.sleep(0.05)
    return chore.scene, os.getpid(), os.environ.get("AERIALDOJO_TRIED")


def meet(chore):
    """Wait until another scene has begun: no process does all while another one starts."""
    (chore.folder / chore.scene).touch()
    until(lambda: len(list(chore.folder.iterdir())) >= 2)
    return where(chore)


def fail(chore):
    if chore.kind == "expected":
        raise AssetError(f"{chore.label} has no mesh")
    if chore.kind == "defect":
        raise ZeroDivisionError(f"{chore.label} has a defect")
    return chore.number


def die_once(chore):
    """Number 1 kills its process the first time, and every time if it is of the kind "always"."""
    trace = chore.folder / f"died-{chore.number}"
    if chore.number == 1 and (chore.kind == "always" or not trace.exists()):
        trace.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return chore.number


def sleep(chore):
    (chore.folder / f"{os.getpid()}").touch()
    time.sleep(600)


def wait_for_go(chore):
    (chore.folder / f"{os.getpid()}").touch()
    until(lambda: (chore.folder / "go").exists())
    return chore.number


def talk(chore, link):
    """Tell of three things, or stop before."""
    told = 0
    for k in range(3):
        if link.stopped():
            break
        link.send((chore.number, k))
        told += 1
    return told


class Steps(TaskQueue):
    """Scenes that take `steps` steps each, one after the other; a step's `parts` chores can be done together."""

    def __init__(self, scenes, steps, parts, folder, alone_at=()):
        super().__init__((), lambda chore: chore.scene)
        self._steps, self._parts, self._folder, self._alone_at = steps, parts, folder, alone_at
        self._left, self.order = dict.fromkeys(scenes, 0), []
        for scene in scenes:
            self._step(scene, 0)

    @property
    def alone(self):
        return False

    def on_done(self, task, _outcome):
        self.order.append((task.scene, task.number))
        self._left[task.scene] -= 1
        if not self._left[task.scene] and task.number + 1 < self._steps:
            self._step(task.scene, task.number + 1)

    def _step(self, scene, number):
        self._left[scene] = self._parts
        self._add([Chore(number, scene, self._folder)] * self._parts)

    def _should_join(self, scene):
        return scene not in self._alone_at


def go_on_until_stopped(chore, link):
    link.send(chore.number)
    until(link.stopped)
    return chore.number


def take_turns(_chore, link):
    return [link.turn(1000.0) for _ in range(2)]


def keep_until_the_end(chore):
    at_end(lambda: (chore.folder / f"closed-{os.getpid()}").touch())
    (chore.folder / f"open-{os.getpid()}").touch()
    return chore.number


def until(true, seconds=60.0, why="it did not come to it"):
    """Wait until a function gives something true, and give it."""
    end = time.monotonic() + seconds
    while not (found := true()):
        assert time.monotonic() < end, why
        time.sleep(0.02)
    return found


def until_empty(session):
    """Wait until no process of a session is alive (zombies are not)."""

    def is_empty():
        for stat in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                fields = stat.read_text().rsplit(")", 1)[1].split()
                if int(fields[3]) == session and fields[0] != "Z":
                    return False
        return True

    until(is_empty)


def compute_and_sign(task):
    """Compute a shard, and leave a note of the process that did."""
    # Here alone: what it imports takes ten times as long as all else in a process that does chores.
    from aerialdojo_gen.pipeline.task import compute

    done = compute(task)
    job = task.job
    note = job.roots.data.path.with_name("notes") / f"{job.scene} {job.stage} {job.part}"
    note.write_text(f"{os.getpid()}")
    return done
