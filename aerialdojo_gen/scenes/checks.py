"""What every built scene keeps to: things stand on something, not in one another, and landmarks are in sight."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
import shapely

from aerialdojo_gen.base.rng import generator
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.scenes.catalogue import Catalogue
from aerialdojo_gen.scenes.model import Instance, Scene
from aerialdojo_gen.scenes.placement import footprint

# They hang on walls.
HUNG = frozenset({"dock_door", "shop_sign", "storefront", "wall_banner", "wall_clock"})
# They bear or span what stands in their outline; trees grow out of hedges.
SPANNING = frozenset(
    {"container_crane", "fire_tower", "freighter", "gantry_crane", "hedge_block", "shipping_container"}
)
SITTER = "sitter"
MIN_TRIANGLES, MAX_TRIANGLES = 10_000, 220_000
_MIN_THINGS = 30  # that tasks may ask for
_MIN_SEEN = 1 / 3  # of the free volume, by each landmark
_VIEWS = 300


def faults(scene: Scene, catalogue: Catalogue) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with a scene: a reason that is counted, and what it is about."""
    if not MIN_TRIANGLES <= scene.n_triangles <= MAX_TRIANGLES:
        yield "triangles", f"{scene.n_triangles:,}"
    things = {(i.category, i.variant, i.attributes.get("colour", "")) for i in targets_of(scene, catalogue)}
    if len(things) < _MIN_THINGS:
        yield "few things to look for", str(len(things))
    for node in floating(scene, catalogue, HUNG, 1.5):
        yield "floats", node
    for one, other in clashes(scene, catalogue, 0.1, SPANNING):
        yield "stands in another", f"{one} and {other}"
    landmarks = [i for i in scene.instances if i.category in catalogue and catalogue[i.category].kind == "landmark"]
    for landmark, share in zip(landmarks, visible_share(scene, landmarks), strict=True):
        if share < _MIN_SEEN:
            yield "landmark is hidden", f"{landmark.node}: seen from {share:.0%}"


def props_of(scene: Scene, catalogue: Catalogue) -> list[Instance]:
    """List a scene's things of the catalogue."""
    return [i for i in scene.instances if i.category in catalogue]


def targets_of(scene: Scene, catalogue: Catalogue) -> list[Instance]:
    """List the things that tasks may ask for, plants left out."""
    targets = set(catalogue.targets)
    return [i for i in scene.instances if i.category in targets and catalogue[i.category].kind != "vegetation"]


def floating(
    scene: Scene,
    catalogue: Catalogue,
    hung: Collection[str] = (),
    reach_m: float = 0.9,
    bearers: Collection[str] = (),
) -> list[str]:
    """List the props that nothing bears: no surface of structure or ground under their feet.

    A prop may reach up to `reach_m` into what it stands on; those of the categories `hung` hang on walls, those of
    the categories `bearers` (ships, say) bear others.
    """
    structure = tuple(i for i in scene.instances if i.category not in catalogue or i.category in bearers)
    cast = RayCaster(Scene(scene.name, structure, scene.materials, scene.bounds))
    out = []
    for prop in props_of(scene, catalogue):
        if prop.category in hung:
            continue
        bottom = float(prop.bounds[0, 2])
        low = prop.vertices[prop.vertices[:, 2] < bottom + 0.25]
        feet = np.array([low[:, :2].mean(axis=0), *low[:: max(len(low) // 8, 1), :2]])
        # Foundations of landmarks reach down 1.4 m, to where the ground has just begun.
        deep_m = 0.15 if catalogue[prop.category].kind == "landmark" else 0.0
        heights = bottom + np.arange(0.05, reach_m + deep_m, 0.15)
        origins = np.array([(x, y, z) for x, y in feet for z in heights])
        distance, _ = cast.first_hit(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)))
        if not (origins[:, 2] - distance > bottom - 0.12).any():
            out.append(prop.node)
    return out


def clashes(
    scene: Scene, catalogue: Catalogue, share: float = 0.2, bearers: Collection[str] = ()
) -> list[tuple[str, str]]:
    """List the pairs of props that stand in one another; those of `bearers` may have others on them.

    Who sits lies in the outline of the seat, and is left out.
    """
    props = [prop for prop in props_of(scene, catalogue) if prop.category != SITTER]
    outlines = [footprint(p, float(p.bounds[0, 2])) for p in props]
    tree = shapely.STRtree(outlines)
    out = []
    for a, b in zip(*tree.query(outlines, predicate="intersects"), strict=True):
        low = max(props[a].bounds[0, 2], props[b].bounds[0, 2])
        high = min(props[a].bounds[1, 2], props[b].bounds[1, 2])
        if a < b and high - low > 0.2 and not {props[a].category, props[b].category} & set(bearers):
            shared = outlines[a].intersection(outlines[b]).area
            if shared > share * min(outlines[a].area, outlines[b].area):
                out.append((props[a].node, props[b].node))
    return out


def visible_share(scene: Scene, things: Sequence[Instance]) -> list[float]:
    """Share, 0 to 1, of drawn points of the flight volume above the ground that see some of each thing."""
    if not things:
        return []
    caster = RayCaster(scene)
    low, high = scene.bounds
    points = generator(0, "seen", scene.name).uniform(low, high, (_VIEWS, 3))
    down, _ = caster.first_hit(points, np.tile([0.0, 0.0, -1.0], (len(points), 1)))
    points = points[np.isfinite(down) & (down > 1.0)]
    shares = []
    for thing in things:
        x, y = thing.centroid[:2]
        bottom, top = thing.bounds[:, 2]
        seen = np.zeros(len(points), bool)
        for part in (0.25, 0.6, 0.92):
            way = np.array([x, y, bottom + part * (top - bottom)]) - points
            away = np.sqrt((way**2).sum(axis=1))
            hit, _ = caster.first_hit(points, way / away[:, None])
            seen |= hit > away - 1.0 - float(np.ptp(thing.bounds[:, :2], axis=0).max()) / 2
        shares.append(float(seen.mean()) if len(points) else 0.0)
    return shares
