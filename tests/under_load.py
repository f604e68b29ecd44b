"""Make ten small scenes of the dataset on a machine that is busy, and look at what came of it.

    python tests/under_load.py [--burners 10] [--pipeline aerialdojo-200k --scene D_Flood_1]

The run must end well, a second one must find nothing to do, `validate` must find no fault, and nothing half-made may
be left.
"""

from __future__ import annotations

import argparse
import contextlib
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

# Those with the fewest pairs to plan.
SCENES = (
    "D_Explosion_0", "D_Flood_0", "D_Flood_1", "I_Bridge_0", "I_Bridge_1", "I_Harbor_1", "N_Snowfield_0", "U_Alley_0",
    "U_Park_0", "U_ParkingLot_1",
)  # fmt: skip

# Ends also where whoever started it was killed.
BURNER = """
import os
parent = os.getppid()
while os.getppid() == parent:
    sum(range(10**6))
"""


@contextlib.contextmanager
def load(processes: int) -> Iterator[None]:
    """Keep so many processes busy for nothing."""
    burners = [subprocess.Popen([sys.executable, "-c", BURNER]) for _ in range(processes)]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


def cli(*arguments: str) -> str:
    """Run a command, and show and return what it says; AssertionError where it fails."""
    command = [sys.executable, "-m", "aerialdojo_gen.cli", *arguments]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
    print(done.stderr, flush=True)
    assert done.returncode == 0, f"{' '.join(arguments)} ended with {done.returncode}"
    return done.stderr


def main() -> None:
    """Try it; a traceback where something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--burners", type=int, default=10, help="processes that load the machine")
    parser.add_argument("--pipeline", default="aerialdojo-200k")
    parser.add_argument("--scene", action="append", help="these instead, repeatable")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="aerialdojo-under-load-") as folder:
        run = ["run", given.pipeline, *(given.scene or SCENES), "--data", folder]
        with load(given.burners):
            cli(*run)
            again = cli(*run)
        assert "nothing to do: all" in again, "the second run computed something"
        cli("validate", "--data", folder)
        left = list(Path(folder).rglob(".aerialdojo-*"))
        assert not left, f"left half-made: {left}"


if __name__ == "__main__":
    main()
