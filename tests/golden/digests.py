"""Digests of everything a release is made of: the golden file that shows that a change of code changes no data.

    python tests/golden/digests.py data > tests/golden/release.sha256

One line per mesh, and per table and scene: a digest of the rows, without what footers say of the code, and its name.
It leaves out the columns that count rays: of some millions, one along the very edge of a triangle is a hit for Embree
with AVX-512 and a miss without.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from aerialdojo_gen.store.layout import LAYOUT
from aerialdojo_gen.store.root import open_root
from aerialdojo_gen.store.shards import read_info, shards

# Logs of agents, and tables that hold wall times, are no part of a release.
LEFT_OUT = ("episodes", "steps", "timings", "failures", "recordings", "frames")
# Columns that count rays, and pictures that rays draw.
BY_RAYS = (
    "score", "part_", "parts_", "tells_", "visible_fraction", "thumbnail", "target_visible_at_start", "box_",
    "image_fraction",
)  # fmt: skip


def digests(data: Path, scenes: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    """Yield (digest, what) of every mesh and of every table of the scenes, all of them where none is named."""
    names = sorted(scenes or (path.stem for path in (data / "meshes").glob("*.glb")))
    for scene in names:
        yield hashlib.sha256((data / "meshes" / f"{scene}.glb").read_bytes()).hexdigest(), f"meshes/{scene}.glb"
        for table in LAYOUT:
            if table not in LEFT_OUT and shards(data, table, scene):
                infos = [read_info(open_root(data), name) for name in shards(data, table, scene)]
                columns = [sorted(info.columns.items()) for info in infos]
                parts = "\n".join(digest for part in columns for name, digest in part if not name.startswith(BY_RAYS))
                yield hashlib.sha256(parts.encode()).hexdigest(), f"{table}/{scene}"


if __name__ == "__main__":
    for digest, what in digests(Path(sys.argv[1]), sys.argv[2:]):
        print(f"{digest}  {what}")
