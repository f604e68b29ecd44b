"""Make ten small scenes of the dataset on a machine that ten other processes keep busy, and look at what came of it.

The run must end well, a second one must find nothing to do, `validate` must find no fault, and nothing half-made may
be left.
"""

import contextlib
import subprocess
import sys
import tempfile
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


def cli(*arguments: str) -> str:
    """Run a command, and show and return what it says; AssertionError where it fails."""
    command = [sys.executable, "-m", "aerialdojo_gen.cli", *arguments]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
    print(done.stderr, flush=True)
    assert done.returncode == 0, f"{' '.join(arguments)} ended with {done.returncode}"
    return done.stderr


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="aerialdojo-under-load-") as folder:
        run = ["run", "aerialdojo-200k", *SCENES, "--data", folder]
        with contextlib.ExitStack() as burners:
            for _ in range(10):
                burners.callback(subprocess.Popen([sys.executable, "-c", BURNER]).kill)
            cli(*run)
            again = cli(*run)
        assert "nothing to do: all" in again, "the second run computed something"
        cli("validate", "--data", folder)
        left = list(Path(folder).rglob(".aerialdojo-*"))
        assert not left, f"left half-made: {left}"
