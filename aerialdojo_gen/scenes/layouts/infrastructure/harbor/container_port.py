"""A container port: quays with cranes and ships, stacks, a bulk pier, and beside it ferry berth and fishing basin."""

from __future__ import annotations

from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import smooth_path
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, columns
from aerialdojo_gen.scenes.layouts.infrastructure.harbor.ferry import build_ferry_berth
from aerialdojo_gen.scenes.layouts.infrastructure.harbor.fishing_basin import build_fishing_basin
from aerialdojo_gen.scenes.layouts.infrastructure.harbor.quays import (
    QUAY_M,
    breakwater,
    container_block,
    dashes,
    fenders,
    hall,
    lay,
    line,
    quay,
    set_out,
)
from aerialdojo_gen.scenes.mesh import merge, translated
from aerialdojo_gen.scenes.shapes import cone
from aerialdojo_gen.scenes.shapes_extruded import sweep
from aerialdojo_gen.scenes.site import Site

_PIER = (-125.0, -58.0, -103.0, 0.0)
# Where there is land, and where a wall of it has the water on its right.
_LAND = [rectangle(-125, 0, 70, 75), rectangle(*_PIER), rectangle(70, -6, 80, 75), rectangle(80, 34, 125, 75),
         rectangle(112, -52, 125, 34)]  # fmt: skip
_EDGES = [
    [(-103.0, -58.0), (-103.0, 0.0)][::-1],
    [(-103.0, 0.0), (44.0, 0.0)],
    [(56.0, 0.0), (70.0, 0.0)],
    [(80.0, -6.0), (80.0, 34.0)],
    [(80.0, 34.0), (112.0, 34.0)],
    [(112.0, 34.0), (112.0, -52.0)],
]
_TIERS = {
    (-98.0, 31.0): [[3, 4, 2, 3, 1], [2, 3, 3, 1, 2]],
    (-66.0, 31.0): [[1, 2, 0, 3, 3], [2, 2, 1, 3, 2]],
    (-34.0, 31.0): [[3, 3, 2, 4, 2], [1, 2, 2, 3, 3]],
    (-2.0, 31.0): [[2, 1, 2]],
    (-98.0, 52.0): [[2, 2, 3, 3, 4], [3, 1, 0, 2, 3]],
    (-66.0, 52.0): [[4, 3, 3, 2, 2], [3, 3, 2, 2, 1]],
    (-34.0, 52.0): [[2, 1, 3, 3, 3], [2, 2, 0, 2, 4]],
}
_EAST, _NORTH, _WEST, _SOUTH = 0.0, 90.0, 180.0, -90.0


def build_port(site: Site) -> None:
    """Build it."""
    _ground(site)
    _quay_side(site)
    _stacks(site)
    _gate(site)
    _bulk_pier(site)
    build_ferry_berth(site)
    build_fishing_basin(site)
    _sea(site)


def _ground(site: Site) -> None:
    site.set_ground(material=site.material("water", "water:#35687c"))
    quay(site, unary_union(_LAND), "asphalt:#6a6b6d")
    fenders(site, _EDGES)
    lay(site, rectangle(-102.0, 1.2, 28.0, 18.0), site.material("apron", "concrete:#a19d94"))
    for y in (3.0, 15.0):
        line(site, [(-102.0, y), (28.0, y)], 0.16, "steel")
        for side in (-0.6, 0.6):
            line(site, [(-102.0, y + side), (28.0, y + side)], 0.12, "marking_yellow")
    for y in (24.0, 47.6, 69.0):
        dashes(site, [(-120.0, y), (30.0, y)])
    for x in (-69.6, -37.6, -5.6, 14.0):
        dashes(site, [(x, 26.0), (x, 70.0)])
    for x, y in _TIERS:
        wide, deep = (12.2, 7.6) if x == -2.0 else (24.9, 12.7)
        box = rectangle(x - 0.5, y - 0.5, x + wide + 0.5, y + deep + 0.5)
        lay(site, box.exterior.buffer(0.08, join_style="mitre"), "marking_yellow")
    lay(site, rectangle(-121.0, -54.0, -107.0, -4.0), site.material("pier", "concrete:#8f8a80"))


def _quay_side(site: Site) -> None:
    for x, variant in ((-72.0, "blue"), (-18.0, "yellow_loaded")):
        put(site, "container_crane", x, 9.0, _SOUTH, variant=variant)
    put(site, "freighter", -66.0, -5.1, _EAST, "alongside the container quay", z=0.0, variant="blue_loaded")
    put(site, "freighter", -15.0, -5.1, _WEST, "alongside the container quay", z=0.0, variant="red_loaded")
    west, east = "below the blue crane", "below the yellow crane"
    set_out(site, [
        ("reach_stacker", -91.0, 22.0, 8.0), ("shipping_container", -72.0, 8.6, _EAST),
        ("straddle_carrier", -58.6, 21.6, _EAST), ("forklift", -84.6, 8.4, 150.0), ("box_truck", -47.0, 20.6, _WEST),
        ("steel_coils", -93.6, 9.6, _EAST), ("crate_stack", -59.0, 10.6, 20.0), ("oil_drums", -62.0, 5.8, _EAST),
        ("shipping_container", -88.8, 11.4, _NORTH), ("traffic_cone", -66.8, 12.0, 0.0),
        ("site_light_tower", -77.0, 19.8, _EAST), ("pallet_stack", -81.6, 12.6, 30.0),
        ("golf_cart", -67.6, 18.8, 160.0),
    ], west)  # fmt: skip
    set_out(site, [
        ("straddle_carrier", -30.6, 21.4, _WEST), ("shipping_container", -18.0, 9.0, _EAST),
        ("reach_stacker", -4.0, 21.0, 185.0), ("forklift", -30.0, 9.0, 40.0), ("generator", -6.4, 11.4, _NORTH),
        ("ibc_tank", -8.8, 6.2, 0.0), ("shipping_container", 4.0, 11.0, _NORTH), ("barrier", -33.6, 12.6, _NORTH),
        ("pipe_stack", 13.0, 9.0, _NORTH), ("control_cabinet", -26.0, 6.6, _NORTH), ("oil_drums", 8.6, 6.2, 0.0),
        ("delivery_van", 14.0, 20.6, 5.0),
    ], east)  # fmt: skip
    edge = "at the edge of the container quay"
    for x in (-92.0, -78.0, -50.0, -36.0, -6.0, 10.0):
        put(site, "mooring_bollard", x, 1.5, _SOUTH, edge)
    for x in (-83.6, -25.6):
        put(site, "lifebuoy_stand", x, 1.5, _NORTH, edge)
    ropes = [((-87.0, -4.0, 3.1), (-92.0, 1.5, 2.7)), ((-45.0, -4.6, 3.2), (-36.0, 1.5, 2.7)),
             ((6.0, -4.4, 3.1), (10.0, 1.5, 2.7)), ((-36.0, -4.6, 3.2), (-36.0, 1.3, 2.6))]  # fmt: skip
    site.add(None, "mooring_lines", [("#c9a96a", merge([sweep(path=[a, ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2,
             min(a[2], b[2]) - 0.3), b], radius=0.06, sides=4) for a, b in ropes]))])  # fmt: skip


def _stacks(site: Site) -> None:
    for (x, y), tiers in _TIERS.items():
        container_block(site, x, y, tiers, z=QUAY_M)
    top = "on top of a stack of containers"
    for category, x, y, height, yaw in (
        ("shipping_container", -91.9, 32.2, 3, _EAST), ("shipping_container", -27.9, 39.9, 4, _EAST),
        ("shipping_container", -59.9, 56.0, 3, _EAST), ("shipping_container", 4.1, 32.2, 2, _EAST),
    ):  # fmt: skip
        put(site, category, x, y, yaw, top, z=QUAY_M + 2.59 * height - 0.04)
    masts: Parts = []
    for x, y in ((-69.6, 49.0), (-5.6, 49.0), (-101.6, 26.0), (25.0, 26.0)):
        masts.append(("steel", columns([(x, y)], QUAY_M, 19.0, 0.22, 6)))
        masts.append(("#33373b", block(x - 1.6, y - 0.3, x + 1.6, y + 0.3, 19.0, 19.4)))
        masts.append(("light", merge([block(x + s - 0.3, y - 0.4, x + s + 0.3, y + 0.4, 18.7, 19.0)
                                      for s in (-1.1, 0.0, 1.1)])))  # fmt: skip
        site.occupy(disc(x, y, 0.6, 8))
    site.add(None, "light_masts", masts)


def _gate(site: Site) -> None:
    lay(site, rectangle(9.0, 26.0, 19.0, 75.0), "asphalt")
    dashes(site, [(14.0, 27.0), (14.0, 74.0)])
    hall(site, -2.0, 50.0, 7.0, 66.0, 6.0, wall=site.material("office", "facade_office:#b9bfc0"), roof="gravel",
         doors="sheet_metal:#4a6a86", name="PORT OFFICE", facing_deg=0.0, category="port_office")  # fmt: skip
    wall = "chain_link"
    for a, b in (((-125.0, 73.6), (8.0, 73.6)), ((20.0, 73.6), (68.0, 73.6))):
        fence_line = [(*a, QUAY_M + 1.1), (*b, QUAY_M + 1.1)]
        site.add(None, "port_fence", [(wall, sweep(path=fence_line, section=(0.06, 2.2)))])
    set_out(site, [
        ("guard_booth", 22.2, 66.0, _WEST), ("boom_gate", 18.0, 69.4, _SOUTH), ("stop_sign", 20.6, 60.6, _NORTH),
        ("box_truck", 11.6, 57.6, _SOUTH), ("city_bus", 16.4, 45.6, _NORTH), ("flagpole", 23.0, 55.0, _SOUTH),
        ("motorcycle", 21.8, 50.6, 20.0),
    ], "at the port gate")  # fmt: skip


def _bulk_pier(site: Site) -> None:
    place = "on the bulk pier"
    put(site, "freighter", -97.6, -33.0, _NORTH, "alongside the bulk pier", z=0.0, variant="rusty_empty")
    put(site, "harbour_crane", -108.4, -30.0, _EAST, place, variant="green_grab")
    heaps: Parts = []
    for x, y, radius, colour in ((-118.4, -16.0, 5.0, "#2c2c2e"), (-118.6, -28.0, 5.2, "#8a6a4a"),
                                 (-118.4, -40.0, 4.4, "#c9b487")):  # fmt: skip
        body = translated(cone(radius=radius, height=radius * 0.62, segments=18), (x, y, QUAY_M - 0.02))
        heaps.append((f"gravel:{colour}", body))
        site.occupy(disc(x, y, radius))
    site.add(None, "bulk_heaps", heaps)
    set_out(site, [
        ("wheel_loader", -110.6, -15.0, 160.0), ("dump_truck", -109.6, -46.0, 80.0),
        ("conveyor_belt", -117.0, -5.0, 0.0),
        ("skip_container", -106.6, -7.6, _NORTH), ("navigation_beacon", -114.0, -55.0, 0.0),
        ("portable_toilet", -122.6, -49.6, 0.0), ("lifebuoy_stand", -104.0, -40.6, _WEST),
        ("mooring_bollard", -104.2, -12.0, _EAST), ("mooring_bollard", -104.2, -52.0, _EAST),
    ], place)  # fmt: skip
    put(site, "generator", -97.6, -36.4, _NORTH, "on the deck of the rusty cargo ship", z=3.5)
    put(site, "crate_stack", -97.6, -27.4, 0.0, "on the deck of the rusty cargo ship", z=3.5)
    put(site, "tugboat", -113.0, -64.6, _EAST, "off the bulk pier", z=0.0)
    put(site, "silo_cluster", -114.6, 12.0, 0.0, "behind the bulk pier")
    put(site, "pickup_truck", -107.4, 22.0, _NORTH, "behind the bulk pier")


def _sea(site: Site) -> None:
    path = smooth_path([(118.0, -51.0), (112.0, -62.0), (76.0, -66.0), (34.0, -60.0)], 2)
    breakwater(site, path)
    head = (28.0, -59.0)
    body = [(site.material("mole", "concrete"), block(head[0] - 6, head[1] - 6, head[0] + 6, head[1] + 6, -0.3, 2.6))]
    site.add("mole_head", "mole_head", body)
    put(site, "lighthouse", *head, _EAST, z=2.6, variant="red_white")
    mole = "on the breakwater"
    set_out(site, [("bench", 60.0, -63.8, _NORTH), ("telescope", 44.0, -61.6, _NORTH),
                   ("lifebuoy_stand", 84.0, -65.2, _SOUTH),
                   ("navigation_beacon", 104.0, -63.0, 0.0)], mole, 2.6)  # fmt: skip
    for category, x, y, yaw, variant in (
        ("buoy", 8.0, -44.0, 0.0, "red_can"), ("buoy", 20.0, -26.0, 30.0, "green_cone"),
        ("buoy", 70.0, -48.0, 60.0, "yellow"), ("buoy", -40.0, -30.0, 0.0, "green_cone"),
        ("sailboat", 84.0, -46.0, 200.0, "white_sails"), ("motor_yacht", 30.0, -40.0, 120.0, "navy"),
        ("tugboat", -50.0, -22.0, 170.0, "black_red"),
    ):  # fmt: skip
        place = "in the fairway" if x < 60 else "behind the breakwater"
        put(site, category, x, y, yaw, place, z=0.0, variant=variant)
