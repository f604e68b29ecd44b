"""Things placed where there is room on a site, kept as the entries of its plan."""

from __future__ import annotations

from typing import Any

from aerialdojo_gen.scenes.grammar import Pose
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.site import MAX_NODES, Site

_MAX_ROWS = 2000


class Placer:
    """Places things on a site that a plan has built, in nobody's way, each as the plan will say it."""

    def __init__(self, site: Site, settle_m: float | None = None) -> None:
        self.site = site
        self._settle_m = settle_m  # Radius that things are settled by where the ground is not level
        self._section = ""
        self.left_out = 0  # Things beyond the most that a scene has
        self._rows: dict[tuple[str, str, float | None, float | None], list[Any]] = {}

    def begin(self, section: str) -> None:
        """Begin a section of the plan, with a comment."""
        self._section = section

    def place(
        self, category: str, pose: Pose, *, phrase: str = "", scale: float = 1.0, on: float | None = None,
        settle_m: float | None = None, variant: str | None = None,
    ) -> bool:  # fmt: skip
        """Place a thing where it has room: the variant that is given, a `DRAWN` one, or the one used least."""
        # The ground is one too.
        if len(self.site.instances) + 1 >= MAX_NODES:
            self.left_out += 1
            return False
        x, y, yaw_deg = round(pose.x, 2), round(pose.y, 2), round(pose.yaw_deg % 360.0, 1)
        settle_m = None if on is not None else settle_m or self._settle_m
        one = Placement(category, x, y, yaw_deg, variant, on, phrase, scale=scale, settle_m=settle_m)
        thing = self.site.place(one, "skip")
        if thing is None:
            return False
        what = f"{category}:{thing.variant}" if thing.variant else category
        row: Any = [what, x, y, yaw_deg]
        if scale != 1.0:
            row = {"what": what, "at": [x, y], "yaw_deg": yaw_deg, "scale": scale}
        self._rows.setdefault((self._section, phrase, on, settle_m), []).append(row)
        return True

    def entries(self) -> tuple[list[dict[str, Any]], dict[int, str]]:
        """Return the entries, and the comments of those that a section begins with."""
        out: list[dict[str, Any]] = []
        sections: dict[int, str] = {}
        for (section, phrase, on, settle_m), rows in self._rows.items():
            if section not in sections.values():
                sections[len(out)] = section
            given = {"phrase": phrase or None, "on": on, "settle_m": settle_m}
            more = {key: value for key, value in given.items() if value is not None}
            out += [{"place": rows[k : k + _MAX_ROWS], **more} for k in range(0, len(rows), _MAX_ROWS)]
        return out, sections
