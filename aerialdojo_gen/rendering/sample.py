"""Which trajectories of a scene are recorded, and in which shard."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from aerialdojo_gen.base import rng
from aerialdojo_gen.base.config.sections import RenderConfig
from aerialdojo_gen.store import shards as store
from aerialdojo_gen.store.layout import partition as partition_of
from aerialdojo_gen.store.root import Where
from aerialdojo_gen.store.schemas import SETTINGS


def tables(config: RenderConfig, scene: str) -> tuple[str, ...]:
    """Return the route tables to record of a scene; none if the configured split excludes it."""
    *partition, subset = config.split.split("_")
    if partition and partition[0] != partition_of(scene):
        return ()
    return ("routes/train", "routes/test") if subset == "all" else (f"routes/{subset}",)


def choose_trajectories(rows: Iterable[Mapping[str, Any]], limit: int, seed: int) -> list[str]:
    """Draw a sample of each length setting."""
    by_setting: dict[str, list[str]] = {setting: [] for setting in SETTINGS}
    for row in rows:
        by_setting[row["setting"]].append(row["nav_id"])
    return sorted(
        nav_id
        for ids in by_setting.values()
        for nav_id in sorted(ids, key=lambda i: (rng.rank(seed, "render", i), i))[: limit or None]
    )


def routes(data: Where, scene: str, config: RenderConfig, columns: list[str] | None = None) -> Iterator[Any]:
    """Yield the rows of the route tables to record of a scene."""
    for table in tables(config, scene):
        yield from store.read_scene(data, table, scene, columns).to_pylist()


def n_parts(data: Where, scene: str, config: RenderConfig) -> int:
    """Count the shards of a scene: `trajectories_per_part` recordings each, at least one shard."""
    rows = routes(data, scene, config, ["nav_id", "setting"])
    # Their number does not depend on the seed.
    return max(1, -(-len(choose_trajectories(rows, config.limit, 0)) // config.trajectories_per_part))
