"""``python -m fuzzing``: a campaign over all parsers, a line each."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fuzzing import campaign
from fuzzing.targets import TARGETS


def main() -> int:
    parser = argparse.ArgumentParser(prog="make fuzz", description=__doc__)
    parser.add_argument("-n", type=int, default=500, help="mutants of each target")
    parser.add_argument("--seed", type=int, default=0, help="another seed makes other mutants")
    parser.add_argument("--target", action="append", choices=TARGETS, help="one target, again for more")
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time")
    parser.add_argument("--save", type=Path, default=Path("fuzz-faults"), help="folder for the inputs of faults")
    asked = parser.parse_args()
    names = asked.target or list(TARGETS)
    faults = 0

    def some(mine: list[str]) -> dict[str, campaign.Outcome]:
        return campaign.run([one for name in mine for one in campaign.mutants(name, asked.n)], asked.seed)

    # A process takes seconds to start: small campaigns have one a job, large ones one a target.
    groups = [[name] for name in names] if asked.n > 2000 else [names[k :: asked.jobs] for k in range(asked.jobs)]
    with ThreadPoolExecutor(asked.jobs) as pool:
        for name, outcome in (pair for outcomes in pool.map(some, groups) for pair in outcomes.items()):
            rate = outcome.ran / max(outcome.seconds, 1e-9)
            print(
                f"{name:18} {outcome.ran:6,} mutants  {outcome.seconds:6.0f} s ({rate:5.0f}/s)"
                f"  {outcome.peak_mib:5} MiB  {len(outcome.faults)} faults",
                flush=True,
            )
            for (kind, where), count in Counter((f["kind"], f["where"]) for f in outcome.faults).most_common():
                alike = [f for f in outcome.faults if (f["kind"], f["where"]) == (kind, where)]
                print(f"    {count:5} {kind} {where}: {alike[0]['index']}: {alike[0]['message'][:150]}", flush=True)
                for fault in alike[:3]:
                    campaign.save(name, asked.seed, fault, asked.save)
            faults += len(outcome.faults)
    print(f"{faults} faults" + (f": their inputs are in {asked.save}" if faults else ""))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
