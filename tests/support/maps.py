"""A small town as a map, and small height models, for the tests of real places."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import shapely

from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.imports.earth import LocalFrame
from aerialdojo_gen.scenes.model import Scene

FRAME = LocalFrame(24.9, 60.2)
HALF_M = 60.0
BUILDINGS = {
    # Name: outline, tags.
    "tall": ([(-50, 12), (-20, 12), (-20, 30), (-50, 30)],
             {"building": "apartments", "height": "21.5", "roof:shape": "flat"}),
    "levels": ([(10, 14), (40, 14), (40, 32), (10, 32)],
               {"building": "office", "building:levels": "4", "roof:shape": "flat"}),
    "house": ([(-45, -40), (-33, -40), (-33, -30), (-45, -30)],
              {"building": "house", "height": "8", "roof:shape": "gabled", "building:colour": "red"}),
    "hall": ([(-16, 40), (4, 40), (4, 56), (-6, 56), (-6, 50), (-16, 50)],
             {"building": "yes", "height": "30 ft", "roof:shape": "hipped", "roof:height": "3"}),
}  # fmt: skip
POINTS = [
    ((-40, 7.6), {"amenity": "bench"}), ((-5, 7.8), {"highway": "bus_stop"}), ((20, -8), {"amenity": "post_box"}),
    ((30, -7.8), {"amenity": "waste_basket"}), ((0, 0), {"highway": "crossing", "crossing": "zebra"}),
    ((20, -30), {"natural": "tree", "height": "9"}), ((30, -36), {"natural": "tree"}),
    ((36, -28), {"natural": "tree"}),
    ((-35, 20), {"amenity": "bench"}), ((26, -44), {"tourism": "artwork", "name": "Ode"}),
]  # fmt: skip
LINES = [
    (
        [(-80, 0), (0, 0), (80, 0)],
        {"highway": "secondary", "name": "Long Street", "lanes": "2", "surface": "asphalt"},
    ),
    ([(0, 0), (0, -80)], {"highway": "residential", "name": "Short Street"}),
    ([(10, -22), (50, -50)], {"highway": "footway"}),
    ([(-80, -70), (80, -70)], {"highway": "primary", "tunnel": "yes", "layer": "-1"}),
]
# A street over another one, with room for its ramps; a hump without room, side by side with a path, over a stream; a
# footbridge over a railway that the map's border cuts.
BRIDGES = [
    ([(-80, -20), (80, -20)], {"highway": "secondary", "lanes": "2", "name": "Low Street"}),
    ([(20, -80), (20, -60)], {"highway": "tertiary", "name": "High Street"}),
    ([(20, -60), (20, -45)], {"highway": "tertiary", "name": "High Street"}),
    ([(20, -45), (20, 0), (20, 5)],
     {"highway": "tertiary", "name": "High Street", "bridge": "yes", "layer": "1", "parking:both": "lane"}),
    ([(20, 5), (20, 80)], {"highway": "tertiary", "name": "High Street"}),
    ([(-80, 20), (-20, 20)], {"waterway": "stream", "width": "4"}),
    ([(-30, 0), (-30, 40)], {"highway": "residential", "bridge": "yes", "name": "Hump"}),
    ([(-25, 0), (-25, 40)], {"highway": "cycleway", "bridge": "yes"}),
    ([(-30, 40), (-30, 50), (-10, 50)], {"highway": "residential"}),
    ([(-25, 40), (-30, 40)], {"highway": "cycleway"}),
    ([(-30, 0), (-25, 0), (0, 0)], {"highway": "residential"}),
    ([(-52, -80), (-52, -30)], {"railway": "rail"}),
    ([(-90, -50), (-40, -50)], {"highway": "footway", "bridge": "yes", "layer": "1"}),
    ([(-40, -50), (-8, -50)], {"highway": "footway"}),
]  # fmt: skip
AREAS = [([(8, -18), (55, -18), (55, -55), (8, -55)], {"leisure": "park", "name": "Old Park"})]


def plan_of(place) -> dict:
    """The plan that was written of a place."""
    return tomllib.loads(place.recipe.read_text(encoding="utf-8"))


def origin_z(place) -> float:
    """The height of the model that is z = 0 in a place."""
    return plan_of(place)["origin"]["z_m"]


def made_by(place, builder: str) -> dict:
    """The one entry of its plan that a builder makes."""
    (entry,) = (one for one in plan_of(place)["site"] if one.get("make") == builder)
    return entry


def box(half_m: float = HALF_M) -> tuple[float, float, float, float]:
    """Bounding box of the town, degrees."""
    (west, east), (south, north) = FRAME.degrees([-half_m, half_m], [-half_m, half_m])
    return float(west), float(south), float(east), float(north)


def write_town(path: Path, *, order: int = 1) -> Path:
    """Write the town as `.osm.pbf`; `order` -1 gives its things other ids, in the other order."""
    return write_map(
        path, [*LINES, *(([*o, o[0]], t) for o, t in [*BUILDINGS.values(), *AREAS])], POINTS, order=order
    )


def write_map(path: Path, lines: list, points: list = (), *, order: int = 1) -> Path:
    """Write ways (points in metres, tags) and points of a map; ways share the points that lie in one place."""
    import osmium

    ids = iter(range(1, 1_000_000))
    nodes, ways = [], []

    def node(x: float, y: float, tags: dict[str, str] | None = None) -> int:
        lon, lat = FRAME.degrees(x, y)
        number = next(ids)
        nodes.append(osmium.osm.mutable.Node(id=number, location=(float(lon), float(lat)), tags=tags or {}))
        return number

    shared: dict[tuple[float, float], int] = {}
    for line, tags in lines[::order]:
        for at in line:
            if at not in shared:
                shared[at] = node(*at)
        ways.append(osmium.osm.mutable.Way(id=len(ways) + 1, nodes=[shared[at] for at in line], tags=tags))
    for at, tags in points[::order]:
        node(*at, tags)
    writer = osmium.SimpleWriter(str(path), overwrite=True)
    for one in nodes:
        writer.add_node(one)
    for one in ways:
        writer.add_way(one)
    writer.close()
    return path


def hill(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Heights of a slope with a hill, metres, at places in metres about the middle."""
    return 100.0 + 0.05 * x + 18.0 * np.exp(-((x - 20.0) ** 2 + (y + 10.0) ** 2) / 900.0)


def heights(cell_m: float, half_m: float) -> np.ndarray:
    """The hill's heights on a grid, rows from north to south."""
    at = np.arange(-half_m, half_m + 1e-9, cell_m)
    x, y = np.meshgrid(at, at[::-1])
    return hill(x, y)


def ground_z(scene: Scene, places: np.ndarray) -> np.ndarray:
    """What a plumb line meets of a scene's ground at places (n, 2), metres."""
    ground = RayCaster(Scene("ground", (scene["ground"],), scene.materials, scene.bounds))
    origins = np.column_stack([places, np.full(len(places), 500.0)])
    return 500.0 - ground.first_hit(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)))[0]


def same_scene(a: Scene, b: Scene) -> bool:
    """Whether two scenes have the same nodes, to the bit."""
    return [i.node for i in a.instances] == [i.node for i in b.instances] and all(
        np.array_equal(one.vertices, other.vertices) for one, other in zip(a.instances, b.instances, strict=True)
    )


def write_geotiff(
    path: Path, z: np.ndarray, crs: str, west: float, north: float, dx: float, dy: float, nodata: float | None = None
) -> Path:
    """Write heights whose north-western cell has its corner at (west, north)."""
    import rasterio
    from rasterio.transform import from_origin

    with rasterio.open(
        path, "w", driver="GTiff", height=z.shape[0], width=z.shape[1], count=1, dtype="float32", crs=crs or None,
        transform=from_origin(west, north, dx, dy), nodata=nodata,
    ) as file:  # fmt: skip
        file.write(z.astype(np.float32), 1)
    return path


def hill_tif(path: Path) -> Path:
    """Write the hill as a GeoTIFF in degrees, 2 m apart, 120 m wide."""
    west, _, _, north = box(61.0)
    east_m, north_m = FRAME.metres_a_degree
    return write_geotiff(path, heights(2.0, 60.0), "EPSG:4326", west, north, 2.0 / east_m, 2.0 / north_m)


def crowded(seed: int, n: int = 40) -> list[tuple[list[tuple[float, float]], dict[str, str]]]:
    """Make up buildings, rings in metres with tags: stars of up to 60 corners that overlap and leave the town."""
    rng = np.random.default_rng(seed)
    out = []
    while len(out) < n:
        (x, y), k = rng.uniform(-HALF_M - 2, HALF_M + 2, 2), int(rng.integers(3, 60))
        angle, radius = np.sort(rng.uniform(0, 2 * np.pi, k)), rng.uniform(0.3, 16, k)
        ring = np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])
        if shapely.Polygon(ring).is_valid:
            out.append((list(map(tuple, ring.tolist())), {"building": "yes", "height": "9"}))
    return out
