"""Woods."""

from __future__ import annotations

from collections.abc import Callable

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.wilds import (
    about,
    anywhere,
    bridged,
    brook,
    clearing,
    paths,
    rolling,
    step,
    strewn,
    water,
    winding,
    wood,
)

Point = tuple[float, float]


def write(draft: Draft) -> None:
    """Roll the ground, lay water, ways and clearings as the topology has them, then plant the wood about them."""
    w, d = draft.width_m / 2, draft.depth_m / 2
    rolling(draft, draft.knob("relief_m"))
    draft.section("The floor of the wood")
    patches = [draft.material("patch", k) for k in range(3)]
    draft.make("paint_patches", materials=patches, count=40, radius_m=[2, 6], seed=draft.whole(0, 9999, "patches"))
    _TOPOLOGIES[draft.topology](draft, w, d)
    step(draft, "level_under_things")
    draft.section("Landmarks")
    draft.landmark(anywhere(draft))
    strewn(draft, "wood", 44, (4.0, 4.0))
    draft.fill_slots()
    draft.section("The wood")
    wood(draft, [-w + 1.5, -d + 1.5, w - 1.5, d - 1.5], draft.knob("trees"))


def _cabin(draft: Draft, at: Point, name: str) -> None:
    clearing(draft, name, at, 10.0)
    draft.slot("cabin", *at, draft.number(0, 360, name), (9.0, 9.0))
    about(draft, "yard", at, (7.0, 9.5), 12, (3.0, 3.0))
    draft.take(shapely.Point(at).buffer(10.5))


def _camp(draft: Draft, at: Point, name: str) -> None:
    clearing(draft, name, at, 9.0)
    draft.slot("fire", *at, 0.0, (2.0, 2.0))
    about(draft, "camp", at, (2.6, 3.4), 4, (1.5, 1.5))
    about(draft, "camp", at, (6.0, 8.5), 10, (3.6, 3.6))
    draft.take(shapely.Point(at).buffer(9.5))


def _creek(draft: Draft, w: float, d: float) -> None:
    ends = ((-w - 1, draft.number(-d / 3, d / 3, "in")), (w + 1, draft.number(-d / 3, d / 3, "out")))
    bed = brook(draft, "creek", ends, d / 5)
    landing = bridged(draft, bed, draft.number(0.35, 0.65, "bridge"))
    sign = 1.0 if landing[0][1] < landing[1][1] else -1.0
    outer = [(draft.number(-w / 2, w / 2, "path", k), sign * (2 * k - 1) * d) for k in (0, 1)]
    lines = {f"path_{k}": winding(draft, f"path_{k}", (landing[k], outer[k]), 6.0, 3) for k in (0, 1)}
    paths(draft, lines)
    for k in range(int(bed.length // 16)):
        p = bed.interpolate(8 + 16 * k)
        side = 1 if draft.chance(0.5, "water", k) else -1
        draft.slot("water", p.x, p.y + side * 5.4, draft.number(0, 360, "water", k), (4.2, 4.2))
    _sites(draft, [_cabin, _camp], 11.0)


def _sites(draft: Draft, kinds: list[Callable[[Draft, Point, str], None]], radius_m: float) -> list[Point]:
    """Lay out sites where the ground is free, far from one another."""
    found: list[Point] = []
    for k, kind in enumerate(kinds):
        spots = ((x, y) for x, y, _ in anywhere(draft, 200, radius_m + 2))
        spot = next((p for p in spots if draft.is_free(shapely.Point(p).buffer(radius_m))), None)
        if spot is None:
            raise NoRoomError("no room for a clearing")
        kind(draft, spot, f"clearing_{k}")
        found.append(spot)
    return found


def _hives(draft: Draft, at: Point, name: str) -> None:
    clearing(draft, name, at, 8.5)
    about(draft, "yard", at, (3.0, 7.0), 7, (3.0, 3.0))
    draft.take(shapely.Point(at).buffer(9.0))


def _glades(draft: Draft, w: float, d: float) -> None:
    spots = _sites(draft, [_cabin, _camp, _hives], 12.0)
    middle = (sum(x for x, _ in spots) / 3, sum(y for _, y in spots) / 3)
    ends = [*spots, (w, draft.number(-d / 2, d / 2, "east"))]
    lines = {f"path_{k}": winding(draft, f"path_{k}", (middle, end), 4.0, 2) for k, end in enumerate(ends)}
    paths(draft, lines)


def _hill(draft: Draft, w: float, d: float) -> None:
    at = (draft.number(-w / 4, w / 4, "hill_x"), draft.number(-d / 4, d / 4, "hill_y"))
    radius = draft.number(18, 26, "hill_r")
    step(draft, "hill", at=list(at), radius_m=radius, height_m=draft.number(5, 9, "hill_h"))
    step(draft, "level_area", area={"disc": [*at, 5.5]}, blend_m=5)
    about(draft, "hill", at, (2.5, 5.0), 6, (2.8, 2.8))
    draft.take(shapely.Point(at).buffer(6.5))
    rocky = {"disc": [*at, round(radius * 0.8, 1)], "minus": {"disc": [*at, 6.5]}}
    draft.make("strew_rocks", area=rocky, spacing_m=4.0, radius_m=[0.4, 1.3], material="rock:#8b8881", limit=26)
    lines = {
        "up": winding(draft, "up", ((at[0] + 6, at[1]), (w, draft.number(-d / 2, d / 2, "up"))), 5.0, 3),
        "over": winding(draft, "over", ((-w, draft.number(-d / 2, d / 2, "over")), (at[0] - 6, at[1])), 5.0, 3),
    }
    paths(draft, lines)
    _sites(draft, [_camp, _cabin], 11.0)


def _pond(draft: Draft, w: float, d: float) -> None:
    at = (draft.number(-w / 4, w / 4, "pond_x"), draft.number(-d / 4, d / 4, "pond_y"))
    radius = draft.number(11, 15, "pond_r")
    step(draft, "level_area", area={"disc": [*at, radius + 6]}, blend_m=6)
    step(draft, "sink_area", area={"disc": [*at, radius]}, depth_m=1.2, blend_m=3.0)
    draft.areas["water"] = {"blob": [*at, round(radius - 1.5, 1), draft.whole(0, 1999, "pond"), 0.2]}
    water(draft)
    about(draft, "water", at, (radius + 2.5, radius + 4.5), 9, (4.2, 4.2))
    draft.take(shapely.Point(at).buffer(radius + 6))
    lines = {"round": winding(draft, "round", ((-w, at[1] + radius + 9), (w, at[1] + radius + 7)), 3.0, 4)}
    paths(draft, lines)
    _sites(draft, [_camp, _cabin], 11.0)


def _ruin(draft: Draft, w: float, d: float) -> None:
    at = (draft.number(-w / 4, w / 4, "ruin_x"), draft.number(-d / 4, d / 4, "ruin_y"))
    step(draft, "level_area", area={"disc": [*at, 13]}, blend_m=6)
    clearing(draft, "ruin_clearing", at, 13.0)
    high = [draft.number(1.4, 6.0, "wall", k) for k in range(5)]
    walls = [
        {"ends": [[-7, -4.5], [2, -4.5]], "height_m": high[0], "openings": [[1.2, 2.3, 0.8, 1.3]]},
        {"ends": [[7, -4.5], [7, 4.5]], "height_m": high[1]}, {"ends": [[7, 4.5], [1, 4.5]], "height_m": high[2]},
        {"ends": [[-2.2, 4.5], [-7, 4.5]], "height_m": high[3]},
        {"ends": [[-7, 4.5], [-7, 1.6]], "height_m": high[4]},
    ]  # fmt: skip
    yaw = draft.number(0, 180, "ruin")
    draft.make("roofless_walls", node="ruin", at=list(at), yaw_deg=yaw, stone=draft.material("stone"), walls=walls)
    about(draft, "hill", at, (10.5, 12.5), 8, (2.6, 2.6))
    draft.take(shapely.Point(at).buffer(14))
    lines = {}
    for k, (ux, uy) in enumerate(((1, 0), (-1, 0), (0, 1))):
        ends = (at[0] + 13.5 * ux, at[1] + 13.5 * uy), (w * ux + uy * 9, d * uy + ux * 9)
        lines[f"path_{k}"] = winding(draft, f"path_{k}", ends, 4.0, 2)
    paths(draft, lines)
    _sites(draft, [_camp], 11.0)


_TOPOLOGIES: dict[str, Callable[[Draft, float, float], None]] = {
    "creek": _creek, "glades": _glades, "hill": _hill, "pond": _pond, "ruin": _ruin,
}  # fmt: skip
