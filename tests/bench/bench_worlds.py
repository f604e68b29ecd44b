"""What making worlds costs, how many draws are refused and why, and how unlike the worlds of a type are.

    python tests/bench/bench_worlds.py [--types U_* N_Coast] [--worlds 20] [--held-out 2] [--sheets DIR]
        [--digests FILE]

Makes worlds of every type and prints a Markdown table. Times are CPU seconds of a world, the refused draws before it
among them. *Near*: share of the objects that have one of the same category within 5 m in another world of the type,
mean over pairs of worlds (wanted: at most 10 %). *Alike*: share of the objects whose mesh, turned and moved, another
world has too, mean over pairs (at most 20 %). *Relief*: median over pairs of the correlation of the heights seen from
above, metre by metre about the middle (at most 0.3). Objects are what tasks may ask for, plants left out.
`--sheets` writes a picture a type of the paper's two scenes, the first eight worlds and two that are held out;
`--digests` makes 68 worlds of each type and appends the SHA-256 of their plans, for `tests/golden/worlds.sha256`.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import resource
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from itertools import permutations
from pathlib import Path

import numpy as np
from common import ASSETS

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.rendering.gallery import scenes_sheet, write_picture
from aerialdojo_gen.scenes.catalogue import Catalogue, load_catalogue
from aerialdojo_gen.scenes.checks import targets_of
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.scenes.plans.build import build_plan
from aerialdojo_gen.scenes.worlds.kinds import load_type, type_names
from aerialdojo_gen.scenes.worlds.make import MAX_DRAWS, make_world
from aerialdojo_gen.scenes.worlds.world import World

NEAR_M = 5.0
# Seeds whose plans have digests in the repository; the first are those that are measured.
SEEDS = (*range(1000, 1048), *range(200, 210), *range(10))


@dataclass
class Made:
    """What is kept of a world."""

    name: str
    seconds: float
    digest: str  # Of its plan
    topology: str
    refused: list[str]
    nodes: int
    triangles: int
    places: dict[str, np.ndarray]  # (n, 2) by category
    meshes: Counter[str]
    heights: np.ndarray  # Seen from above, a metre apart
    scene: Scene | None  # Where it is to be pictured


def mesh_digest(thing: Instance) -> str:
    """Digest of a mesh's shape that turning and moving does not change.

    Of sums over all edges, not of each edge: a place far out moves vertices by the last bit of float32.
    """
    corners = [thing.vertices[thing.faces[:, k]] - thing.centroid for k in range(3)]
    a, b, c = corners
    edges = np.linalg.norm(np.concatenate([b - a, c - b, a - c]), axis=1)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    volume = (a * np.cross(b, c)).sum() / 6
    high = float(np.ptp(thing.bounds[:, 2]))
    sizes = f"{edges.mean():.4f} {np.sqrt((edges**2).mean()):.4f} {area:.2f} {volume:.2f} {high:.3f}"
    return hashlib.sha256(f"{thing.category} {len(edges)} {sizes}".encode()).hexdigest()


def heights_of(scene: Scene) -> np.ndarray:
    """Heights seen from above in the middle of each square metre, (x, y), the site's middle in the middle."""
    low, high = scene.bounds
    half = np.floor(np.minimum(-low[:2], high[:2])).astype(int)
    x, y = (np.arange(-h, h) + 0.5 for h in half)
    from_ = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((len(x), len(y)), high[2] + 50)], -1)
    away, _ = RayCaster(scene).first_hit(from_.reshape(-1, 3), np.tile([0.0, 0.0, -1.0], (len(x) * len(y), 1)))
    return np.where(np.isfinite(away), high[2] + 50 - away, 0.0).reshape(len(x), len(y))


def reason_of(reason: str, what: str) -> str:
    """Reason of a refused draw without the numbers of nodes and shares, so that like ones are counted together."""
    return re.sub(r"(_?\d[\d,.]*%?)+", "", f"{reason}: {what}" if what else reason).strip(" :")


def plan_digest(text: str) -> str:
    """SHA-256 of a plan."""
    return hashlib.sha256(text.encode()).hexdigest()


def made(world: World, catalogue: Catalogue, pictured: bool) -> Made | str:
    """Make a world and keep what is measured; the error where none is made."""
    begun = time.process_time()
    try:
        found = make_world(world, ASSETS, catalogue)
    except AssetError as error:
        return str(error)
    seconds = time.process_time() - begun
    things = targets_of(found.scene, catalogue)
    places: dict[str, list[np.ndarray]] = {}
    for thing in things:
        places.setdefault(thing.category, []).append(thing.centroid[:2])
    return Made(
        world.name, seconds, plan_digest(found.text), found.topology,
        [reason_of(*one) for one in found.refused], len(found.scene.instances),
        found.scene.n_triangles, {category: np.array(at) for category, at in places.items()},
        Counter(mesh_digest(thing) for thing in things), heights_of(found.scene), found.scene if pictured else None,
    )  # fmt: skip


def near(one: Made, other: Made) -> float:
    """Share of one world's objects with one of the same category near the same place in the other."""
    hits = total = 0
    for category, at in one.places.items():
        total += len(at)
        if category in other.places:
            away = np.linalg.norm(at[:, None] - other.places[category], axis=2)
            hits += int((away.min(axis=1) <= NEAR_M).sum())
    return hits / total


def alike(one: Made, other: Made) -> float:
    """Share of one world's objects whose mesh the other has too."""
    return sum(n for mesh, n in one.meshes.items() if mesh in other.meshes) / one.meshes.total()


def relief(one: Made, other: Made) -> float:
    """Correlation of the heights of two worlds where they overlap; 0 where one is level."""
    common = [min(a, b) for a, b in zip(one.heights.shape, other.heights.shape, strict=True)]
    cuts = []
    for heights in (one.heights, other.heights):
        x, y = ((size - c) // 2 for size, c in zip(heights.shape, common, strict=True))
        cuts.append(heights[x : x + common[0], y : y + common[1]].ravel())
    return 0.0 if min(cut.std() for cut in cuts) < 1e-3 else float(np.corrcoef(*cuts)[0, 1])


def over_pairs(worlds: list[Made], measure) -> list[float]:
    """A measure of all ordered pairs of worlds."""
    return [measure(one, other) for one, other in permutations(worlds, 2)] or [float("nan")]


def row_of(kind: str, worlds: list[Made], failed: int) -> str:
    """A type's line of the table."""
    seconds = [world.seconds for world in worlds]
    refused = sum(len(world.refused) for world in worlds) + failed * MAX_DRAWS
    known = len(load_type(kind, ASSETS, load_catalogue(ASSETS)).topologies)
    return (
        f"| `{kind}` | {len(worlds)} | {np.median(seconds):.1f} | {max(seconds):.1f} "
        f"| {refused / (refused + len(worlds)):.0%} | {np.median([w.nodes for w in worlds]):.0f} "
        f"| {np.median([w.triangles for w in worlds]) / 1e3:.0f} k | {len({w.topology for w in worlds})} of {known} "
        f"| {np.mean(over_pairs(worlds, near)):.0%} | {np.mean(over_pairs(worlds, alike)):.0%} "
        f"| {np.median(over_pairs(worlds, relief)):.2f} |"
    )


def worlds_of(kind: str, options: argparse.Namespace) -> Iterator[World]:
    """Worlds of a type that are asked for."""
    for held_out, number in ((False, options.worlds), (True, options.held_out)):
        yield from (World(kind, seed, held_out=held_out) for seed in SEEDS[:number])


def digests_of(kind: str, worlds: list[Made], catalogue: Catalogue) -> Iterator[str]:
    """Yield a line for the golden file of each world of SEEDS; those that were made already are not made again."""
    known = {world.name: world.digest for world in worlds}
    for world in (World(kind, seed) for seed in SEEDS):
        digest = known.get(world.name) or plan_digest(make_world(world, ASSETS, catalogue).text)
        yield f"{digest}  {world.name}\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--types", nargs="*", default=["*"])
    parser.add_argument("--worlds", type=int, default=20)
    parser.add_argument("--held-out", type=int, default=2)
    parser.add_argument("--sheets", type=Path)
    parser.add_argument("--digests", type=Path)
    options = parser.parse_args()
    catalogue = load_catalogue(ASSETS)
    kinds = [kind for kind in type_names(ASSETS) if any(fnmatch(kind, one) for one in options.types)]
    print(
        "| type | worlds | s, median | s, most | refused | nodes | triangles | topologies | near | alike | relief |"
    )
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
    everything: list[Made] = []
    reasons: Counter[str] = Counter()
    failures: list[str] = []
    meshes: set[str] = set()
    for kind in kinds:
        worlds, failed = [], 0
        for world in worlds_of(kind, options):
            pictured = options.sheets is not None and world.seed in SEEDS[: 2 if world.held_out else 8]
            one = made(world, catalogue, pictured)
            if isinstance(one, str):
                failures.append(one)
                failed += 1
                continue
            worlds.append(one)
            reasons.update(f"{kind}{' held out' * world.held_out}: {reason}" for reason in one.refused)
            meshes |= one.meshes.keys()
        if worlds:
            print(row_of(kind, worlds, failed), flush=True)
        if options.sheets is not None:
            papers = [build_plan(ASSETS / "scenes" / f"{kind}_{k}.toml", catalogue) for k in (0, 1)]
            sheet = scenes_sheet([*papers, *(world.scene for world in worlds if world.scene is not None)])
            write_picture(sheet, options.sheets, f"worlds-{kind}.jpg", 1280)
            for world in worlds:
                world.scene = None
        everything += worlds
        if options.digests is not None:
            with options.digests.open("a", encoding="utf-8") as file:
                file.writelines(digests_of(kind, worlds, catalogue))
    refused = reasons.total() + len(failures) * MAX_DRAWS
    share = refused / max(refused + len(everything), 1)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"\n{len(everything)} worlds, {sum(w.seconds for w in everything):.0f} s of CPU, peak {peak:.0f} MiB; ",
        end="",
    )
    print(f"{share:.1%} of the draws refused; {len(meshes):,} meshes of objects\n")
    for reason, number in reasons.most_common():
        print(f"- {number} x {reason}")
    for failure in failures:
        print(f"- no world: {failure}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
