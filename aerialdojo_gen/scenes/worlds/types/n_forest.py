"""Woods."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from aerialdojo_gen.scenes.worlds import wilds
from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import Point


def write(draft: Draft) -> None:
    """Roll the ground, lay water, ways and clearings as the topology has them, then plant the wood about them."""
    wilds.rolling(draft, draft.knob("relief_m"))
    draft.section("The floor of the wood")
    wilds.patches(draft, "patch", 3, 40, [2, 6])
    _TOPOLOGIES[draft.topology](draft, *draft.half)
    draft.step("level_under_things")
    draft.section("Landmarks")
    draft.landmark(wilds.anywhere(draft))
    wilds.strewn(draft, "wood", 44, (4.0, 4.0))
    draft.fill_slots()
    draft.section("The wood")
    wilds.wood(draft, list(draft.site.grown(-1.5)), draft.knob("trees"))


def _cabin(draft: Draft, at: Point, name: str) -> None:
    wilds.clearing(draft, name, at, 10.0)
    draft.slot("cabin", *at, draft.number(0, 360, name), (9.0, 9.0))
    wilds.about(draft, "yard", at, (7.0, 9.5), 12, (3.0, 3.0))
    draft.take_disc(at, 10.5)


def _camp(draft: Draft, at: Point, name: str) -> None:
    wilds.clearing(draft, name, at, 9.0)
    draft.slot("fire", *at, 0.0, (2.0, 2.0))
    wilds.about(draft, "camp", at, (2.6, 3.4), 4, (1.5, 1.5))
    wilds.about(draft, "camp", at, (6.0, 8.5), 10, (3.6, 3.6))
    draft.take_disc(at, 9.5)


def _creek(draft: Draft, w: float, d: float) -> None:
    ends = ((-w - 1, draft.number(-d / 3, d / 3, "in")), (w + 1, draft.number(-d / 3, d / 3, "out")))
    bed = wilds.brook(draft, "creek", ends, d / 5)
    landing = wilds.bridged(draft, bed, draft.number(0.35, 0.65, "bridge"))
    sign = 1.0 if landing[0][1] < landing[1][1] else -1.0
    outer = [(draft.number(-w / 2, w / 2, "path", k), sign * (2 * k - 1) * d) for k in (0, 1)]
    wilds.paths(draft, {f"path_{k}": (landing[k], outer[k]) for k in (0, 1)}, 6.0, 3)
    for k in range(int(bed.length // 16)):
        p = bed.interpolate(8 + 16 * k)
        side = 1 if draft.chance(0.5, "water", k) else -1
        draft.slot("water", p.x, p.y + side * 5.4, draft.number(0, 360, "water", k), (4.2, 4.2))
    _sites(draft, [_cabin, _camp], 11.0)


def _sites(draft: Draft, kinds: list[Callable[[Draft, Point, str], None]], radius_m: float) -> list[Point]:
    """Lay out sites where the ground is free, far from one another."""
    middles: list[Point] = []
    for k, kind in enumerate(kinds):
        spots = ((x, y) for x, y, _ in wilds.anywhere(draft, 200, radius_m + 2))
        spot = next((p for p in spots if draft.has_room(*p, radius_m)), None)
        if spot is None:
            raise NoRoomError("no room for a clearing")
        kind(draft, spot, f"clearing_{k}")
        middles.append(spot)
    return middles


def _hives(draft: Draft, at: Point, name: str) -> None:
    wilds.clearing(draft, name, at, 8.5)
    wilds.about(draft, "yard", at, (3.0, 7.0), 7, (3.0, 3.0))
    draft.take_disc(at, 9.0)


def _glades(draft: Draft, w: float, d: float) -> None:
    spots = _sites(draft, [_cabin, _camp, _hives], 12.0)
    middle = (sum(x for x, _ in spots) / 3, sum(y for _, y in spots) / 3)
    ends = [*spots, (w, draft.number(-d / 2, d / 2, "east"))]
    wilds.paths(draft, {f"path_{k}": (middle, end) for k, end in enumerate(ends)}, 4.0, 2)


def _hill(draft: Draft, w: float, d: float) -> None:
    at = (draft.number(-w / 4, w / 4, "hill_x"), draft.number(-d / 4, d / 4, "hill_y"))
    radius = draft.number(18, 26, "hill_r")
    draft.step("hill", at=at, radius_m=radius, height_m=draft.number(5, 9, "hill_h"))
    draft.step("level_area", area={"disc": [*at, 5.5]}, blend_m=5)
    wilds.about(draft, "hill", at, (2.5, 5.0), 6, (2.8, 2.8))
    draft.take_disc(at, 6.5)
    rocky = {"disc": [*at, round(radius * 0.8, 1)], "minus": {"disc": [*at, 6.5]}}
    draft.make("strew_rocks", area=rocky, spacing_m=4.0, radius_m=[0.4, 1.3], material="rock:#8b8881", limit=26)
    up, over = (draft.number(-d / 2, d / 2, key) for key in ("up", "over"))
    ends = {"up": ((at[0] + 6, at[1]), (w, up)), "over": ((-w, over), (at[0] - 6, at[1]))}
    wilds.paths(draft, ends, 5.0, 3)
    _sites(draft, [_camp, _cabin], 11.0)


def _pond(draft: Draft, w: float, d: float) -> None:
    at = (draft.number(-w / 4, w / 4, "pond_x"), draft.number(-d / 4, d / 4, "pond_y"))
    radius = draft.number(11, 15, "pond_r")
    draft.step("level_area", area={"disc": [*at, radius + 6]}, blend_m=6)
    draft.step("sink_area", area={"disc": [*at, radius]}, depth_m=1.2, blend_m=3.0)
    draft.areas["water"] = {"blob": [*at, round(radius - 1.5, 1), draft.whole(0, 1999, "pond"), 0.2]}
    wilds.water(draft)
    wilds.about(draft, "water", at, (radius + 2.5, radius + 4.5), 9, (4.2, 4.2))
    draft.take_disc(at, radius + 6)
    wilds.paths(draft, {"round": ((-w, at[1] + radius + 9), (w, at[1] + radius + 7))}, 3.0, 4)
    _sites(draft, [_camp, _cabin], 11.0)


def _ruin(draft: Draft, w: float, d: float) -> None:
    at = (draft.number(-w / 4, w / 4, "ruin_x"), draft.number(-d / 4, d / 4, "ruin_y"))
    draft.step("level_area", area={"disc": [*at, 13]}, blend_m=6)
    wilds.clearing(draft, "ruin_clearing", at, 13.0)
    high = [draft.number(1.4, 6.0, "wall", k) for k in range(5)]
    ends_of = [[[-7, -4.5], [2, -4.5]], [[7, -4.5], [7, 4.5]], [[7, 4.5], [1, 4.5]], [[-2.2, 4.5], [-7, 4.5]],
               [[-7, 4.5], [-7, 1.6]]]  # fmt: skip
    walls: list[dict[str, Any]] = [{"ends": e, "height_m": h} for e, h in zip(ends_of, high, strict=True)]
    walls[0]["openings"] = [[1.2, 2.3, 0.8, 1.3]]
    yaw = draft.number(0, 180, "ruin")
    draft.make("roofless_walls", node="ruin", at=at, yaw_deg=yaw, stone=draft.material("stone"), walls=walls)
    wilds.about(draft, "hill", at, (10.5, 12.5), 8, (2.6, 2.6))
    draft.take_disc(at, 14)
    ends = {
        f"path_{k}": ((at[0] + 13.5 * ux, at[1] + 13.5 * uy), (w * ux + uy * 9, d * uy + ux * 9))
        for k, (ux, uy) in enumerate(((1, 0), (-1, 0), (0, 1)))
    }
    wilds.paths(draft, ends, 4.0, 2)
    _sites(draft, [_camp], 11.0)


_TOPOLOGIES = {
    "creek": _creek, "glades": _glades, "hill": _hill, "pond": _pond, "ruin": _ruin,
}  # fmt: skip
