"""Bridges over valleys: arches, piers, hung and trussed decks, what drives on them, and what is below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import shapely

from aerialdojo_gen.scenes.worlds import wilds
from aerialdojo_gen.scenes.worlds.draft import Draft
from aerialdojo_gen.scenes.worlds.shapes import Box, point

_ROAD_M, _HALF_M = 3.4, 5.0  # Half widths of the roadway and of the deck


class _Valley(NamedTuple):
    """What is bridged: a valley along y that a stream winds through."""

    depth_m: float
    half_m: float
    x_m: float
    swing_m: float
    bend_m: float

    def stream_x(self, y: float) -> float:
        """Where the stream runs."""
        return self.x_m + self.swing_m * math.sin(y / self.bend_m)

    @property
    def span(self) -> tuple[float, float]:
        """Ends of the bridge."""
        reach = self.half_m + self.swing_m + 1.6
        return round(self.x_m - reach, 1), round(self.x_m + reach, 1)


def write(draft: Draft) -> None:
    """Cut a valley, lead a road to it and over it, then places on its rims, a path, and things below."""
    w, d = draft.half
    valley = _Valley(
        draft.knob("depth_m"), draft.number(18, 23, "half"),
        0.0 if draft.topology == "arch" else round(draft.number(-0.12, 0.12, "x") * w, 1),
        draft.number(2, 4.5, "swing"), draft.number(10, 16, "bend"),
    )  # fmt: skip
    stream = {"x_m": valley.x_m, "swing_m": valley.swing_m, "bend_m": valley.bend_m}
    wilds.rolling(draft, draft.number(0.8, 1.8, "relief"), (28, 44), 1.4)
    x0, x1 = valley.span
    draft.step("level_area", area=[round(-w, 1), -7.5, round(w, 1), 7.5], to_m=0, blend_m=8)
    slope = draft.number(11, 14, "slope")
    draft.step("valley", depth_m=valley.depth_m, half_m=valley.half_m, slope_m=slope, stream=stream)
    draft.section("The valley and the road to it")
    wilds.patches(draft, "patch", 3, 34, [2.5, 7], 999)
    draft.make("steep_ground", slope=0.75, **{"as": "faces"})
    draft.paint({"area": "faces", "grow_m": [0.6, 1.2], "plus": {"disc": [0, 0, 0.1]}}, draft.material("rock"))
    draft.make(
        "paint_brook", stream=stream, bank=draft.material("bank"), water=draft.material("water"),
        path=draft.material("path"), path_offset_m=draft.pick([-7.0, 7.0], "side"), free_z=[-30, -3],
    )  # fmt: skip
    for a, b in ((-w, x0 + 0.2), (x1 - 0.2, w)):
        draft.make("bridge_approach", x0=round(a, 1), x1=round(b, 1), road_m=_ROAD_M, half_m=_HALF_M)
    _TOPOLOGIES[draft.topology](draft, valley, x0, x1)
    draft.take(shapely.box(-w, -7.0, w, 7.0))
    _traffic(draft, w, x0, x1)
    _floor(draft, valley, d)
    draft.take(shapely.box(x0 - 2.0, -d, x1 + 2.0, d))
    ends = {}
    for k, (x, sign) in enumerate(((x1 + 7.0, 1), (x0 - 7.0, -1))):
        side = draft.pick([1, -1], "path", k)
        out = x + sign * draft.number(2, 12, "path", k, "out")
        ends[f"path_{k}"] = point(x, side * 7.2), point(out, side * (d + 1))
    wilds.paths(draft, ends, 3.0, 3)
    wilds.open_country(draft, wilds.lay_out(draft), "land", 30, (4.2, 4.2))
    draft.section("The woods")
    draft.make("keep_free", areas=[[round(-w, 1), -8.5, round(w, 1), 8.5]])
    wilds.wood(draft, list(draft.site.grown(-1.5)), draft.knob("trees"), 5.0)


def _traffic(draft: Draft, w: float, x0: float, x1: float) -> None:
    """Offer slots on the road, on the deck and beside it."""
    at = -w + 6.0
    while at < w - 5.0:
        for side, yaw in ((-1, 0.0), (1, 180.0)):
            road = at + 3.0 * side, side * _ROAD_M / 2, yaw, (9.4, 3.1)
            if x0 < at < x1:
                draft.slot("bridge road", *road, on=0.0)
                draft.slot("footway", at, side * 4.15, yaw + 90.0, (1.3, 2.6), on=0.12)
            else:
                draft.slot("road", *road)
                draft.slot("wayside", at, side * 7.4, yaw + 90.0, (3.2, 3.6))
        at += 8.5


def _floor(draft: Draft, valley: _Valley, d: float) -> None:
    """Offer slots beside the stream."""
    for k in range(int((2 * d - 10.0) // 5.2)):
        y = -d + 5.0 + 5.2 * k
        for side in (-1, 1):
            off = side * draft.number(5.2, 9.0, "floor", k, side)
            yaw = draft.number(0, 360, "floor", k, side, "yaw")
            if draft.chance(0.75, "floor", k, side, "has"):
                draft.slot("floor", valley.stream_x(y) + off, y, yaw, (4.6, 4.2))


def _deck(draft: Draft, x0: float, x1: float, girders: list[float], depth_m: float = 0.9) -> None:
    """Lay the deck with its parapets."""
    draft.section("The bridge")
    steel = draft.material("steel")
    draft.add({"node": "bridge_deck", "parts": [
        {"make": "bridge_deck", "x0": x0, "x1": x1, "road_m": _ROAD_M, "half_m": _HALF_M, "depth_m": depth_m,
         "girder": steel, "girders": girders, "girder_m": round(depth_m + 0.4, 2)},
        {"make": "bridge_parapets", "x0": x0, "x1": x1, "half_m": _HALF_M, "frame": steel,
         "pane": draft.pick(["iron", "chain_link", "glass"], "pane")},
    ]})  # fmt: skip


def _block(role: str, corners: list[float], low: float, high: float) -> dict[str, Any]:
    return {"shape": "block", "role": role, "corners": corners, "z": [low, high]}


def _abutments(draft: Draft, valley: _Valley, x0: float, x1: float) -> None:
    """Build abutments of stone under both ends."""
    stone, parts = draft.material("stone"), []
    for x, side in ((x0, 1), (x1, -1)):
        a, b = sorted((round(x - side * 0.6, 2), round(x + side * 5.4, 2)))
        parts.append(_block(stone, [a, -4.6, b, 4.6], round(-0.8 * valley.depth_m, 1), -1.2))
        parts += [_block(stone, [a, y, b, round(y + 0.8, 2)], -6, 1.6) for y in (-_HALF_M - 0.9, _HALF_M + 0.1)]
    draft.add({"node": "abutments", "category": "abutment", "parts": parts})


def _piers_at(x0: float, x1: float, number: int) -> list[float]:
    return [round(x0 + (x1 - x0) * (k + 1) / (number + 1), 1) for k in range(number)]


def _piers(draft: Draft, parts: list[dict[str, Any]], at: Sequence[float], half_x: float, half_y: float) -> None:
    """Build piers at places along the bridge, and keep the ground about them free."""
    draft.add({"node": "bridge_piers", "category": "pier", "parts": parts})
    draft.make("keep_free", areas=[[x - half_x, -half_y, x + half_x, half_y] for x in at], z=[-40, -2])


def _arch(draft: Draft, valley: _Valley, x0: float, x1: float) -> None:
    """A trussed arch of steel under the deck."""
    _deck(draft, x0, x1, [-2.7, 2.7])
    _abutments(draft, valley, x0, x1)
    half, spring = (x1 - x0) / 2 - 6.0, round(-0.62 * valley.depth_m, 1)
    arch: dict[str, Any] = {"make": "truss_arch", "half_span_m": round(half, 1), "spring_z": spring, "crown_z": -1.5,
                            "ribs": [-2.7, 2.7], "material": draft.material("steel")}  # fmt: skip
    draft.add({"node": "bridge_arch", "parts": [arch]})


def _beam(draft: Draft, valley: _Valley, x0: float, x1: float) -> None:
    """Deep beams on slender piers."""
    _deck(draft, x0, x1, [-3.2, 0.0, 3.2], 1.4)
    _abutments(draft, valley, x0, x1)
    stone, at = draft.material("pier"), _piers_at(x0, x1, draft.whole(2, 3, "piers"))
    column = {"shape": "cylinder", "role": stone, "radius": 0.8, "segments": 12, "height": valley.depth_m + 1.5}
    parts = []
    for x in at:
        parts += [{**column, "at": [x, y, -valley.depth_m - 3.0]} for y in (-3.2, 3.2)]
        parts.append(_block(stone, [x - 0.9, -4.2, x + 0.9, 4.2], -2.6, -1.5))
    _piers(draft, parts, at, 1.6, 4.6)


def _stone(draft: Draft, valley: _Valley, x0: float, x1: float) -> None:
    """Arches of stone on thick piers."""
    _deck(draft, x0, x1, [], 0.7)
    stone, piers = draft.material("stone"), _piers_at(x0, x1, draft.whole(3, 4, "piers"))
    parts = [_block(stone, [x - 1.3, -4.6, x + 1.3, 4.6], -valley.depth_m - 2.5, -1.0) for x in piers]
    # The arches are bows of blocks between the piers.
    for a, b in zip([x0, *piers], [*piers, x1], strict=True):
        half = (b - a) / 2 - 1.3
        for k in range(7):
            u0, u1 = -1.0 + 2.0 * k / 7, -1.0 + 2.0 * (k + 1) / 7
            f = max(abs(u0), abs(u1))
            rise = half * (1.0 - math.sqrt(max(0.0, 1.0 - f * f))) * 0.8
            corners = [round((a + b) / 2 + u0 * half, 2), -4.5, round((a + b) / 2 + u1 * half, 2), 4.5]
            parts.append({"shape": "block", "role": stone, "z": [round(-1.7 - rise, 2), -0.9], "corners": corners})
    _piers(draft, parts, piers, 2.0, 5.2)
    _abutments(draft, valley, x0, x1)


def _hung(draft: Draft, valley: _Valley, x0: float, x1: float) -> None:
    """A deck that hangs from cables between two towers."""
    _deck(draft, x0, x1, [-3.6, 3.6])
    _abutments(draft, valley, x0, x1)
    high, steel, pier = draft.number(9.0, 12.0, "towers"), draft.material("steel"), draft.material("pier")
    towers = [round(x0 + 8.0, 1), round(x1 - 8.0, 1)]
    parts: list[dict[str, Any]] = []
    for x in towers:
        low = -valley.depth_m - 2.0
        parts += [_block(pier, [x - 0.8, y, x + 0.8, round(y + 0.7, 2)], low, high) for y in (-5.6, 4.9)]
        parts += [_block(pier, [x - 0.6, -5.6, x + 0.6, 5.6], z, z + 0.7) for z in (-1.8, high - 1.2)]
    middle, span = (towers[0] + towers[1]) / 2, towers[1] - towers[0]
    for y in (-5.25, 5.25):
        shares = [k / 6 - 1.0 for k in range(13)]
        main = [[round(middle + f * span / 2, 2), y, round(1.6 + (high - 1.8) * f * f, 2)] for f in shares]
        path = [[round(x0 - 3.0, 2), y, 0.2], *main, [round(x1 + 3.0, 2), y, 0.2]]
        parts.append({"shape": "sweep", "role": steel, "path": path, "section": [0.26, 0.26]})
        for x, _, z in main[1:-1]:
            parts.append(_block(steel, Box.about(x, y, 0.1, 0.1).rounded(), -0.6, z))
    draft.add({"node": "bridge_towers", "category": "tower", "parts": parts})
    draft.make("keep_free", areas=[[x - 1.6, -6.4, x + 1.6, 6.4] for x in towers], z=[-40, 0])


def _truss(draft: Draft, valley: _Valley, x0: float, x1: float) -> None:
    """A deck between two trusses that rise beside it, on two piers."""
    _deck(draft, x0, x1, [-4.4, 4.4], 1.0)
    _abutments(draft, valley, x0, x1)
    a, b = round(x0 + 1.0, 1), round(x1 - 1.0, 1)
    beams = {
        "make": "lattice_beams", "x": [a, b], "rows": [-5.5, 5.5], "z": [-0.6, draft.number(4.6, 5.6, "high")],
        "material": draft.material("steel"), "panels": max(8, 2 * round((b - a) / 8.0)), "width_m": 0.34,
    }  # fmt: skip
    draft.add({"node": "bridge_truss", "category": "truss", "parts": [beams]})
    stone, at = draft.material("stone"), _piers_at(x0, x1, 2)
    parts = [_block(stone, [x - 1.1, -5.4, x + 1.1, 5.4], -valley.depth_m - 2.5, -1.2) for x in at]
    _piers(draft, parts, at, 1.8, 6.0)


_TOPOLOGIES = {
    "arch": _arch, "beam": _beam, "stone": _stone, "hung": _hung, "truss": _truss,
}  # fmt: skip
