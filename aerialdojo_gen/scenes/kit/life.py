"""People, animals and traffic, set out by rules where there is room: groups, herds, birds on what is high."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.base.names import unknown
from aerialdojo_gen.scenes.grammar import Pose, poisson_disc
from aerialdojo_gen.scenes.kit import site_builder
from aerialdojo_gen.scenes.kit.resting import perch_on_wires, seat_people, set_out_traffic
from aerialdojo_gen.scenes.mesh import areas
from aerialdojo_gen.scenes.model import Instance
from aerialdojo_gen.scenes.placement import Placement
from aerialdojo_gen.scenes.site import Site

# Who walks on what: roads, rails, water and beds of plants are left out.
WALKED = (
    "paving", "tiles", "cobbles", "concrete", "boards", "planks", "gravel", "grass", "meadow", "dirt", "sand", "snow",
)  # fmt: skip
_SOFT = frozenset({"grass", "meadow", "sand"})
_AT_WORK = frozenset({"work", "rescue"})
_STAND, _WALK, _SIT, _WORK, _CALL = range(5)
_RIM_M = 4.0  # nobody stands at the edge of the world
_ROOM_M, _NEXT_M = 0.8, 0.35  # free about a group's first, and about those who join them
_APART_M = 1.6
_LEVEL_M = 0.12  # most that the ground rises or falls under two feet
_ON_DECKS, _EDGE_M = 0.4, 0.5
_HERD_M = 9.0
_SEATED, _ON_WIRES = 6, 6
_DRY_M = 0.15
_ELBOW_M = 0.6  # birds stand so far from one another
_PERCH_M = (2.2, 16.0)  # heights of what birds stand on
_LEDGE_M2 = (0.01, 40.0)  # a smaller face bears no bird, and on a large roof they would be lost


@site_builder
def life(
    site: Site, people: int = 0, who: Sequence[str] = ("town",), animals: dict[str, int] | None = None,
    birds: dict[str, int] | None = None, ground: Sequence[str] = WALKED, decks: Sequence[str] = (),
    stream: str = "life", seated: int | None = None, traffic: int | None = None,
) -> None:  # fmt: skip
    """Set out people alone and in groups, animals in herds, birds on what is high, and standing traffic in lanes.

    People come from the variants of ``person`` whose names begin with one of `who`; they and the animals stand on
    ground of the materials `ground`, where it is level and nothing else is. Where there is no room there are fewer.
    Up to two in five of the people stand on structures of the categories `decks`: platforms, jetties, piers.
    Besides, `seated` people (a third as many, six at most) sit on benches, chairs and seats of stands, and `traffic`
    vehicles and riders (one for 30 m of lane, ten at most) stand in lanes, where the entries before have made some.
    """
    dressed = [v.name for v in site.catalogue["person"].variants if v.name.split("_")[0] in who]
    groups = sorted({v.name.split("_")[0] for v in site.catalogue["person"].variants})
    for one in who:
        if one not in groups:
            raise AssetError(unknown("no people", one, groups))
    rng = site.rng_for("life", stream)
    spots = iter(poisson_disc(site.extent.buffer(-_RIM_M), _APART_M, rng, limit=6000))
    wet = [thing.bounds for thing in site.instances if any(p.material.startswith("water") for p in thing.parts)]
    spots = (spot for spot in spots if not _under_water(site, spot, wet))
    above = _on_decks(site, round(_ON_DECKS * people), dressed, decks, site.rng_for("life", stream, "decks"))
    _people(site, people - above, dressed, spots, ground, rng)
    for category, number in (animals or {}).items():
        _herd(site, category, number, spots, ground, rng)
    for category, number in (birds or {}).items():
        _perch(site, category, number, site.rng_for("life", stream, category))
    for category, number in (birds or {}).items():
        perch_on_wires(site, category, min(number, _ON_WIRES), site.rng_for("life", stream, category, "wires"))
    seat_people(site, min(people // 3, _SEATED) if seated is None else seated, dressed)
    set_out_traffic(site, traffic)


def _under_water(site: Site, spot: Pose, wet: Sequence[np.ndarray]) -> bool:
    """Whether the ground lies below the top of a body of water that is about it."""
    over = [z for (x0, y0, _), (x1, y1, z) in wet if x0 <= spot.x <= x1 and y0 <= spot.y <= y1]
    return bool(over) and site.ground_z(spot.x, spot.y) < max(over) + _DRY_M


def _people(
    site: Site, number: int, dressed: Sequence[str], spots: Iterator[Pose], ground: Sequence[str],
    rng: np.random.Generator,
) -> None:  # fmt: skip
    """Place groups of one to three until there are so many people, or no spot is left."""
    order, placed = rng.permutation(len(dressed)), 0
    for spot in spots:
        if placed >= number:
            return
        if not _walkable(site, spot.x, spot.y, ground, _ROOM_M):
            continue
        material = site.ground_material(spot.x, spot.y).partition(":")[0]
        size = min(int(rng.choice([1, 2, 3], p=[0.5, 0.33, 0.17])), number - placed)
        # All of a group do the same: they walk together, sit together, or talk.
        alone = [_WALK, _WALK, _STAND, _CALL]
        together = [_STAND, _STAND, _WALK]
        posture = int(rng.choice(alone if size == 1 else together))
        if material in _SOFT and rng.random() < 0.3:
            posture = _SIT
        first = spot
        for k in range(size):
            chosen = dressed[int(order[placed % len(order)])]
            if chosen.split("_")[0] in _AT_WORK and rng.random() < 0.35:
                posture = _WORK
            pose = first if k == 0 else _group_pose(first, posture, k)
            if k and not _walkable(site, pose.x, pose.y, ground, _NEXT_M):
                continue
            yaw = pose.yaw_deg + float(rng.uniform(-14.0, 14.0))
            person = Placement("person", pose.x, pose.y, yaw, chosen, params={"posture": posture}, settle_m=0.2)
            placed += site.place(person, "skip") is not None


def _on_decks(site: Site, number: int, dressed: Sequence[str], decks: Sequence[str], rng: np.random.Generator) -> int:
    """Place people one by one on the level tops of structures, away from their edges; returns how many."""
    placed = 0
    spots = [spot for thing in site.instances if thing.category in decks for spot in _deck_spots(thing, rng)]
    for k in rng.permutation(len(spots)):
        pose, z = spots[int(k)]
        if placed < number and site.is_free(pose.x, pose.y, _ROOM_M, z + 0.05):
            dress, posture = dressed[int(rng.integers(len(dressed)))], int(rng.choice([_STAND, _STAND, _WALK, _CALL]))
            site.place(Placement("person", *pose, dress, z=z, params={"posture": posture}))
            placed += 1
    return placed


def _deck_spots(thing: Instance, rng: np.random.Generator) -> list[tuple[Pose, float]]:
    """Poses on the height at which a structure has most level surface, and that height."""
    corners, sizes = thing.vertices[thing.faces], areas(thing.vertices, thing.faces)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    level = (np.ptp(corners[:, :, 2], axis=1) < 1e-3) & (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0.0)
    if not level.any():
        return []
    heights, which = np.unique(np.round(corners[level, 0, 2], 2), return_inverse=True)
    k = int(np.argmax(np.bincount(which, weights=sizes[level])))
    top = shapely.union_all(shapely.polygons(corners[level][which == k][:, :, :2]))
    return [(pose, float(heights[k])) for pose in poisson_disc(top.buffer(-_EDGE_M), _APART_M, rng, limit=200)]


def _group_pose(first: Pose, posture: int, k: int) -> Pose:
    """Where another one of a group stands: in step beside those who walk or sit, else before them, turned to them."""
    turn = math.radians(first.yaw_deg)
    if posture in (_WALK, _SIT):
        side = 0.95 * (1 if k == 1 else -1)
        return Pose(first.x - side * math.sin(turn), first.y + side * math.cos(turn), first.yaw_deg)
    away = turn + math.radians(-22.0 if k == 1 else 48.0)
    return Pose(first.x + 1.1 * math.cos(away), first.y + 1.1 * math.sin(away), math.degrees(away) + 180.0)


def _herd(
    site: Site, category: str, number: int, spots: Iterator[Pose], ground: Sequence[str], rng: np.random.Generator
) -> None:
    """Place animals of a category near one another, most of them turned the same way."""
    middle = next((s for s in spots if _walkable(site, s.x, s.y, ground, 1.5)), None)
    if middle is None:
        return
    placed = 0
    for _ in range(40 * number):
        if placed == number:
            return
        away = _HERD_M * math.sqrt(float(rng.random())) * min(1.0, number / 4.0)
        turn = float(rng.uniform(0.0, 2.0 * math.pi))
        x, y = middle.x + away * math.cos(turn), middle.y + away * math.sin(turn)
        yaw = middle.yaw_deg + float(rng.normal(scale=50.0))
        if _walkable(site, x, y, ground, _ROOM_M):
            variants = site.catalogue[category].variants
            chosen = variants[int(rng.integers(len(variants)))].name
            placed += site.place(Placement(category, x, y, yaw, chosen or None, settle_m=0.3), "skip") is not None


def _perch(site: Site, category: str, number: int, rng: np.random.Generator) -> None:
    """Place birds on the tops of structures, two to four on each."""
    ledges = [ledge for thing in site.instances if (ledge := _ledge(site, thing)) is not None]
    placed = 0
    for k in rng.permutation(len(ledges)):
        corners, weights = ledges[int(k)]
        yaw, others = float(rng.uniform(0.0, 360.0)), np.zeros((0, 2))
        for _ in range(min(int(rng.integers(2, 5)), number - placed)):
            face = corners[int(np.searchsorted(np.cumsum(weights) / weights.sum(), rng.random()))]
            u, v = sorted(rng.random(2).tolist())
            x, y, z = (u * face[0] + (v - u) * face[1] + (1.0 - v) * face[2]).tolist()
            turn = yaw + float(rng.normal(scale=40.0))
            crowded = len(others) and float(np.abs(others - (x, y)).max(axis=1).min()) < _ELBOW_M
            taken = not site.is_free(x, y, 0.3, z + 0.05, 0.5)
            if crowded or taken or z - site.ground_z(x, y) < _PERCH_M[0]:
                continue
            others = np.vstack([others, (x, y)])
            site.place(Placement(category, x, y, turn, z=z, solid=False))
            placed += 1
        if placed >= number:
            return


def _ledge(site: Site, thing: Instance) -> tuple[np.ndarray, np.ndarray] | None:
    """Level faces at the top of a structure, corners (n, 3, 3) in metres, and their areas; None where it has none."""
    if thing.category in site.catalogue:
        return None
    low, high = thing.bounds
    middle = (low + high) / 2.0
    above = float(high[2]) - site.ground_z(float(middle[0]), float(middle[1]))
    if not _PERCH_M[0] <= above <= _PERCH_M[1]:
        return None
    corners = thing.vertices[thing.faces]
    sizes = areas(thing.vertices, thing.faces)
    level = np.ptp(corners[:, :, 2], axis=1) < 1e-3
    top = level & (corners[:, :, 2].min(axis=1) > high[2] - 0.02) & (sizes > _LEDGE_M2[0])
    return (corners[top], sizes[top]) if top.any() and float(sizes[top].sum()) < _LEDGE_M2[1] else None


def _walkable(site: Site, x: float, y: float, ground: Sequence[str], room_m: float) -> bool:
    """Whether a person may stand at a point: on the right ground, level enough, with room."""
    if site.ground_material(x, y).partition(":")[0] not in ground:
        return False
    heights = [site.ground_z(x + dx, y + dy) for dx, dy in ((0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25))]
    return max(heights) - min(heights) < _LEVEL_M and site.is_free(x, y, room_m)
