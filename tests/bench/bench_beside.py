"""CPU, time and memory of making scenes, beside another checkout's, one after the other in turn.

    python tests/bench/bench_beside.py [OTHER] [--scenes U_Mall_0 I_Harbor_0] [--until filter] [--rounds 1]

`OTHER` is a checkout of another commit whose kernels are compiled (`make env` there, or a first run); it is run with
this environment's Python unless it has one of its own in `.venv`. Every scene is made from nothing, up to a stage, in
one process, first by the other checkout and then by this one, and so on. Prints a Markdown table of medians. Without
`OTHER` this checkout is measured twice, which shows how far figures differ by themselves.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

HERE = Path(__file__).resolve().parents[2]
SCENES = ["U_Mall_0", "I_Harbor_0", "N_Forest_0", "N_Mountain_0", "U_Alley_0", "D_Flood_0"]


def made(checkout: Path, scene: str, until: str) -> tuple[float, float, float]:
    """Make a scene: seconds of CPU, seconds, and the process's largest memory in MB."""
    own = checkout / ".venv" / "bin" / "python"
    with tempfile.TemporaryDirectory() as data:
        command = [
            str(own) if own.exists() else sys.executable, "-m", "aerialdojo_gen.cli", until, "--scene", scene,
            "--pipeline", "pipelines/aerialdojo-200k.toml", "--data", data, "--workers", "1",
        ]  # fmt: skip
        begun = time.monotonic()
        process = subprocess.Popen(
            command, cwd=checkout, env={**os.environ, "PYTHONPATH": str(checkout)}, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert process.stderr is not None
        messages = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        if status:
            raise SystemExit(f"{checkout}: {scene}: exit status {status}\n{messages}")
    return usage.ru_utime + usage.ru_stime, time.monotonic() - begun, usage.ru_maxrss / 1024


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", type=Path, nargs="?", default=HERE)
    parser.add_argument("--scenes", nargs="+", default=SCENES)
    parser.add_argument("--until", default="filter")
    parser.add_argument("--rounds", type=int, default=1)
    options = parser.parse_args()
    print("| scene | CPU s | other's | ratio | s | other's | MB | other's |\n|---|--:|--:|--:|--:|--:|--:|--:|")
    total = [0.0, 0.0]
    for scene in options.scenes:
        rounds = [
            [made(checkout, scene, options.until) for checkout in (options.other.resolve(), HERE)]
            for _ in range(options.rounds)
        ]
        (cpu, s, mb), (other_cpu, other_s, other_mb) = (
            [median(one[k][n] for one in rounds) for n in range(3)] for k in (1, 0)
        )
        print(
            f"| {scene} | {cpu:.1f} | {other_cpu:.1f} | {other_cpu / cpu:.2f} | {s:.0f} | {other_s:.0f} "
            f"| {mb:,.0f} | {other_mb:,.0f} |",
            flush=True,
        )
        total = [total[0] + cpu, total[1] + other_cpu]
    print(f"| all | {total[0]:.1f} | {total[1]:.1f} | {total[1] / total[0]:.2f} | | | | |")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
