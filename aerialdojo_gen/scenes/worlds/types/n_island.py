"""Islands."""

from __future__ import annotations

import math

import shapely

from aerialdojo_gen.scenes.worlds.draft import Draft, NoRoomError
from aerialdojo_gen.scenes.worlds.shapes import SIDES, Point, ahead, point, smoothed, towards
from aerialdojo_gen.scenes.worlds.shores import Isle, build_village, coast, inside, islands, landing
from aerialdojo_gen.scenes.worlds.wilds import about, anywhere, winding


def write(draft: Draft) -> None:
    """Raise the island, and build a village on it."""
    build_village(draft, _TOPOLOGIES[draft.topology](draft, *draft.half))


def _off_shore(draft: Draft, bay_deg: float) -> Point:
    """Middle of an island that lies off the site's, so that the open sea before its bay is wide."""
    return ahead((0, 0), bay_deg + 180, draft.number(8, 15, "middle"))


def _cone(at: Point, radius_m: float, height_m: float, lobes: int) -> dict[str, str]:
    """Formulas of a volcano with a crater."""
    x, y = at
    rim = f"{height_m}*pow(1 - 6.0/{radius_m}, 1.25)"
    return {
        "away": f"hypot(x - {x}, y - {y})",
        "gullies": f"1 + 0.08*sin({lobes}*atan2(y - {y}, x - {x}) + 280*noise)*eased(away, 5, 14)",
        "slopes": f"{height_m}*pow(clip(1 - away/({radius_m}*gullies), 0, 1), 1.25)",
        "cone": f"choose(6.0 - away, {rim} - 4*(1 - eased(away, 2, 6)), slopes)*eased(inland, 2, 14)",
    }


def _knoll(name: str, at: Point, radius_m: float, height_m: float) -> dict[str, str]:
    far = f"hypot(x - {at[0]}, y - {at[1]})/{radius_m}"
    return {f"{name}_far": far, name: f"{height_m}*exp(-({name}_far*{name}_far))*eased(inland, 1, 7)"}


def _volcano(draft: Draft, w: float, d: float) -> Isle:
    bay = draft.number(0, 360, "bay")
    middle = _off_shore(draft, bay)
    land = coast(draft, "coast", middle, (w * 0.72, d * 0.72), [(bay, 0.36, 38)])
    top, height = ahead(middle, bay + 180 + draft.number(-30, 30, "top"), 14), draft.number(13, 18, "height")
    islands(draft, [{"polygon": ["coast"]}], land, draft.knob("relief_m"),
            heights=_cone(top, draft.number(25, 30, "radius"), height, draft.whole(5, 9, "lobes")),
            total="cone")  # fmt: skip
    draft.paint({"blob": [*top, 19, draft.whole(0, 999, "lava"), 0.3]}, draft.material("rock"))
    draft.make("paint_heights", material=draft.material("cliff", "top"), above_m=round(height * 0.7, 1))
    draft.paint({"disc": [*top, 2.6]}, draft.pick(["#e2602a", "#b8402a", "water:#4fb0a8"], "crater"))
    village = inside(land, middle, bay, 13.0)
    heads = [inside(land, village, bay + off, 10.0) for off in (105.0, -105.0)]
    return Isle(land, village, bay, heads, shapely.Point(top).buffer(19.0))


def _atoll(draft: Draft, w: float, d: float) -> Isle:
    """A ring of low land, open at one side, about a lagoon; the village looks on the lagoon."""
    open_deg, turn = draft.number(0, 360, "open"), draft.number(95, 115, "turn")
    turns = [math.radians(open_deg + 180 - turn * 1.4 + turn * 2.8 * k / 100) for k in range(0, 101, 10)]
    arc = [point(w * 0.66 * math.cos(a), d * 0.66 * math.sin(a)) for a in turns]
    draft.lines["reef"] = {"points": arc, "smooth": 1}
    width = draft.number(17, 21, "reef")
    parts, land = [{"ribbon": "reef", "width_m": width, "round_ends": True}], smoothed(arc, 1).buffer(width / 2)
    for k in (1, 5, 9):
        radius = draft.number(13, 17, "islet", k) if k == 5 else draft.number(11.5, 14, "islet", k)
        parts.append({"blob": [*arc[k], radius, draft.whole(0, 999, "islet", k), 0.15]})
        land = land.union(shapely.Point(arc[k]).buffer(radius * 0.92))
    islands(draft, parts, land, round(draft.knob("relief_m") * 0.4, 2), heights={}, total="0")
    return Isle(land, arc[5], towards(arc[5], (0, 0)), [arc[1], arc[9]])


def _ridge(draft: Draft, w: float, d: float) -> Isle:
    """A long island with a rocky ridge along it, a bay at either side."""
    side = draft.pick([90.0, 270.0], "side")
    land = coast(draft, "coast", (0, 0), (w * 0.86, d * 0.64), [(side, 0.3, 30), (side + 155, 0.25, 25)])
    up = -1.0 if side == 90.0 else 1.0
    ends = ((-w * 0.5, up * d * 0.12), (w * 0.5, up * d * 0.2))
    crest = winding(draft, "crest", ends, 6.0, 3)
    height = draft.number(6, 9, "height")
    islands(draft, [{"polygon": ["coast"]}], land, draft.knob("relief_m"),
            heights={"ridge": f"{height}*eased(crest, -11, 2)*(1 + 0.25*noise)*eased(inland, 2, 10)"},
            total="ridge", inland={"crest": {"ribbon": "crest", "width_m": 7}})  # fmt: skip
    draft.paint({"ribbon": "crest", "width_m": 6, "ragged": [1.5, 7, 2]}, draft.material("rock"))
    village = inside(land, (0, -up * d * 0.1), side, 13.0)
    heads = [inside(land, (0, 0), a, 11.0) for a in (0.0, 180.0)]
    return Isle(land, village, side, heads, crest.buffer(8.0))


def _twins(draft: Draft, w: float, d: float) -> Isle:
    """Two islands and a footbridge on piles between them."""
    big = draft.number(0.46, 0.52, "big")
    flip = draft.pick([1.0, -1.0], "flip")
    one, two = (-flip * w * 0.42, draft.number(-4, 4, "one")), (flip * w * 0.56, draft.number(-6, 6, "two"))
    bay = draft.pick([70.0, 110.0, 250.0, 290.0], "bay")
    lands = [coast(draft, "coast", one, (w * big, d * 0.74), [(bay, 0.24, 34)]),
             coast(draft, "small_coast", two, (w * 0.27, d * 0.55))]  # fmt: skip
    land = lands[0].union(lands[1])
    knolls = _knoll("one", ahead(one, bay + 180, 10), draft.number(11, 15, "r1"), draft.number(4, 7, "h1"))
    knolls |= _knoll("two", two, draft.number(8, 11, "r2"), draft.number(3, 6, "h2"))
    islands(draft, [{"polygon": ["coast"]}, {"polygon": ["small_coast"]}], land, draft.knob("relief_m"),
            heights=knolls, total="one + two")  # fmt: skip
    yaw = towards(one, two)
    start, end = landing(lands[0], one, yaw), landing(lands[1], two, yaw + 180)
    span = math.dist(start, end)
    if not 5.0 < span < 45.0:
        raise NoRoomError("no room for the bridge")
    draft.section("The bridge")
    draft.make("pier", at=ahead(start, yaw, -2.4), yaw_deg=round(yaw, 1), length_m=round(span + 4.8, 1),
               width_m=3.0, z=1.9, bay_m=4.6, rail=draft.material("rail"), category="footbridge")  # fmt: skip
    draft.take(shapely.LineString([start, end]).buffer(4.0))
    village = inside(lands[0], one, bay, 14.0)
    return Isle(land, village, bay, [inside(lands[0], one, bay + 150, 12.0), two])


def _skerries(draft: Draft, w: float, d: float) -> Isle:
    """An islet with a deep inlet and two knolls, skerries about it."""
    bay = draft.pick(SIDES, "bay") + draft.number(-20, 20, "bay_off")
    land = coast(draft, "coast", (0, 0), (w * 0.68, d * 0.7), [(bay, 0.62, 20)])
    parts: list[dict[str, object]] = [{"polygon": ["coast"]}]
    islets: list[shapely.Point] = []
    for x, y, _ in anywhere(draft, 120, 7.0):
        spot, radius = shapely.Point(x, y), draft.number(2.4, 4.6, "skerry", x)
        off = abs((towards((0, 0), (x, y)) - bay + 180) % 360 - 180)
        near = land.distance(spot) < radius + 5.0 or any(spot.distance(o) < 16 for o in islets)
        if len(islets) < 6 and not near and off > 28.0:
            islets.append(spot)
            parts.append({"blob": [x, y, radius, draft.whole(0, 999, "blob", x), 0.35]})
    main = land
    for spot in islets:
        land = land.union(spot.buffer(4.0))
    knolls: dict[str, str] = {}
    middle = ahead((0, 0), bay + 180, 12)
    heads = [inside(main, middle, bay + off, 15.0) for off in (125.0, -115.0)]
    for k, head in enumerate(heads):
        knolls |= _knoll(f"knoll_{k}", head, draft.number(10, 13, "r", k), draft.number(3.5, 8, "h", k))
    islands(draft, parts, land, draft.knob("relief_m"), heights=knolls, total="knoll_0 + knoll_1")
    return Isle(land, inside(main, middle, bay, 15.0), bay, heads)


def _fort(draft: Draft, w: float, d: float) -> Isle:
    """A table of rock with a ruined fort, a village at its foot."""
    bay = draft.number(0, 360, "bay")
    middle = _off_shore(draft, bay)
    land = coast(draft, "coast", middle, (w * 0.73, d * 0.72), [(bay, 0.3, 34)])
    at, height = ahead(middle, bay + 180, 12), draft.number(7, 10, "height")
    islands(draft, [{"polygon": ["coast"]}], land, draft.knob("relief_m"), total="table",
            heights={"away": f"hypot(x - {at[0]}, y - {at[1]}) + 2*noise",
                     "table": f"{height}*(1 - eased(away, 15, 21))"})  # fmt: skip
    draft.step("level_area", area={"disc": [*at, 11.5]}, blend_m=3)
    draft.paint({"blob": [*at, 12.5, draft.whole(0, 999, "court"), 0.12]}, draft.material("rock"))
    draft.section("The fort")
    high = [draft.number(1.6, 4.5, "wall", k) for k in range(5)]
    ends = [[[-8, -6], [-1.5, -6]], [[1.5, -6], [8, -6]], [[8, -6], [8, 6]], [[8, 6], [-2, 6]], [[-8, 6], [-8, -6]]]
    draft.make("roofless_walls", node="fort", at=at, yaw_deg=draft.number(0, 180, "fort"),
               stone=draft.material("stone"),
               walls=[{"ends": e, "height_m": h} for e, h in zip(ends, high, strict=True)])  # fmt: skip
    about(draft, "lookout", at, (2.0, 4.6), 5, (2.8, 2.8))
    village = inside(land, middle, bay, 13.0)
    heads = [inside(land, village, bay + off, 10.0) for off in (105.0, -105.0)]
    return Isle(land, village, bay, heads, shapely.Point(at).buffer(21.0))


_TOPOLOGIES = {
    "volcano": _volcano, "atoll": _atoll, "ridge": _ridge, "twins": _twins, "skerries": _skerries, "fort": _fort,
}  # fmt: skip
