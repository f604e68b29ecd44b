"""Grammar of layouts: placement of props, always of the variant used least so far."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.site import Site


def next_variant(site: Site, category: str) -> str | None:
    """Name the variant of a category used least on the site so far; None where it has none."""
    names = [v.name for v in site.catalogue[category].variants]
    used = Counter(i.variant for i in site.instances if i.category == category)
    return min(names, key=lambda n: (used[n], names.index(n)), default=None)


def deal(
    site: Site, categories: Sequence[str], poses: Sequence[Pose], place: str = "", **options: Any
) -> list[Instance]:
    """Place props at poses, cycling through the categories, always of the variant used least so far."""
    out: list[Instance] = []
    for pose in poses:
        category = categories[len(out) % len(categories)]
        attributes = {"place": place} if place else None
        thing = site.try_place(
            category, *pose, variant=next_variant(site, category), attributes=attributes, **options
        )
        if thing is not None:
            out.append(thing)
    return out


def put(
    site: Site, category: str, x: float, y: float, yaw_deg: float = 0.0, place: str = "", **options: Any
) -> Instance:
    """Place a prop as of `Site.place`, by default of the variant used least so far."""
    options.setdefault("variant", next_variant(site, category))
    return site.place(category, x, y, yaw_deg, attributes={"place": place} if place else None, **options)
