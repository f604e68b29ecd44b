"""What stands at the gorge: traffic on the bridge, visitors' things on the rims, a camp and animals below."""

from __future__ import annotations

from collections.abc import Callable

from shapely.geometry import LineString

from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import poisson_disc
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.kit.natural_ground import place_wild, settled_z
from aerialdojo_gen.scenes.layouts.infrastructure.parts.rail import things
from aerialdojo_gen.scenes.site import Site

_FOOTWAY_M = 0.12


def furnish_gorge(site: Site, stream_x: Callable[[float], float]) -> None:
    """Put everything in its place, then rocks and trees between."""
    put(site, "obelisk", 48.6, 9.6, 0.0, variant="red_granite", scale=0.7)
    for category, x, y, yaw in (("fire_tower", 48.0, -19.0, 0.0), ("dutch_windmill", -48.0, 19.0, -60.0)):
        put(site, category, x, y, yaw, z=settled_z(site, x, y, 2.0))
    things(site, "on the bridge", [
        ("sedan", -15.0, -1.6, 0.0), ("pickup_truck", 5.0, 1.6, 180.0), ("bicycle", 20.0, -1.8, 0.0),
        ("caravan", -40.0, 1.6, 180.0),
    ], 0.0)  # fmt: skip
    things(site, "on the footway of the bridge", [
        ("emergency_phone", 0.0, -3.9, 90.0), ("lantern", -18.0, 3.95, -90.0), ("lantern", 18.0, -3.95, 90.0),
        ("telescope", -4.0, 3.9, 90.0), ("bench", -24.0, -4.0, 90.0), ("traffic_cone", 8.2, 3.9, 0.0),
    ], _FOOTWAY_M)  # fmt: skip
    things(site, "at the edge of the bridge", [("inspection_gondola", 12.5, 5.55, 90.0),
                                               ("inspection_gondola", -10.5, -5.55, -90.0)], _FOOTWAY_M)  # fmt: skip
    things(site, "at the head of the bridge", [
        ("lion_statue", -31.4, 5.9, 180.0), ("lion_statue", -31.4, -5.9, 180.0), ("lion_statue", 31.4, -6.0, 0.0),
        ("emergency_phone", 33.6, 6.0, -90.0), ("sign_gantry", 49.0, 0.0, 0.0), ("stop_sign", -46.0, 5.6, 180.0),
    ])  # fmt: skip
    things(site, "by the old toll house", [
        ("motorcycle", -30.8, -9.4, 90.0), ("picnic_table", -30.4, -13.2, 0.0),
        ("information_board", -42.8, -10.6, 180.0), ("water_barrel", -33.4, -15.3, 0.0),
        ("flagpole", -43.0, -6.8, 60.0),
        ("planter", -38.2, -6.8, 90.0),
    ])  # fmt: skip
    things(site, "on the viewing platform", [("telescope", 21.6, 11.5, 180.0), ("bench", 25.4, 13.4, -90.0),
                                             ("information_board", 27.0, 9.6, 180.0)], 0.1)  # fmt: skip
    things(site, "in the car park of the viewpoint", [
        ("suv", 33.8, 10.2, 90.0), ("city_bus", 39.6, 10.8, 90.0), ("kiosk", 33.4, 15.0, 180.0),
        ("litter_bin", 30.6, 15.8, 0.0),
        ("bicycle_rack", 44.4, 14.0, 0.0), ("picnic_table", 30.9, 6.9, 90.0),
    ])  # fmt: skip
    _below(site, stream_x)
    _rims(site)
    _growth(site, stream_x)


def _below(site: Site, stream_x: Callable[[float], float]) -> None:
    def bank(dx: float, y: float) -> tuple[float, float]:
        return stream_x(y) + dx, y

    place_wild(site, "at the bottom of the gorge", [
        ("dome_tent", *bank(6.0, 14.0), 200.0), ("campfire", *bank(4.6, 9.4), 0.0),
        ("tent", *bank(-6.4, -13.0), 40.0),
        ("stone_cairn", *bank(-5.4, 8.0), 0.0), ("fallen_log", *bank(5.2, -9.0), 30.0),
        ("canoe", *bank(-4.6, -4.6), 75.0),
        ("deer", *bank(5.4, 24.0), 120.0), ("fox", *bank(-5.2, 20.0), 40.0), ("rock_pile", *bank(5.8, -20.0), 0.0),
        ("totem_pole", *bank(-5.8, 27.0), 0.0), ("wild_boar", *bank(5.6, -28.0), 200.0),
        ("dead_tree", *bank(-6.0, -24.0), 0.0),
        ("camp_chair", *bank(7.0, 11.2), 180.0), ("tree_stump", *bank(-5.0, 1.6), 0.0),
        ("log_bench", *bank(6.4, 5.4), 160.0),
    ])  # fmt: skip
    put(site, "footbridge", stream_x(-17.0), -17.0, 0.0, "across the stream", z=-20.2)
    put(site, "rowing_boat", stream_x(16.0), 16.0, 90.0, "on the stream", z=-20.55)


def _rims(site: Site) -> None:
    place_wild(site, "on the east rim", [
        ("hunting_stand", 33.0, 27.0, 200.0), ("standing_stone", 29.6, -18.0, 0.0), ("stone_arch", 33.0, -24.0, 20.0),
        ("wooden_gate", 38.6, 21.6, 70.0), ("beehive", 30.4, -30.0, 0.0), ("trail_signpost", 36.0, 18.8, 0.0),
    ])  # fmt: skip
    place_wild(site, "on the west rim", [
        ("log_pile", -33.0, 14.0, 0.0), ("ruined_wall", -33.0, 22.0, 30.0), ("hay_bales", -38.0, -24.0, 0.0),
        ("stone_well", -39.6, 12.0, 0.0), ("weather_station", -31.0, -20.0, 0.0), ("tractor", -43.0, -23.0, 40.0),
    ])  # fmt: skip


def _growth(site: Site, stream_x: Callable[[float], float]) -> None:
    stream = LineString([(stream_x(float(y)), float(y)) for y in range(-44, 45, 3)]).buffer(3.2)
    for area in (rectangle(-56, -6.5, 56, 6.5), rectangle(-45, -17, -28, 6), rectangle(19, 5, 45, 18.5), stream,
                 rectangle(-24, -8, 24, 8)):  # fmt: skip
        site.occupy(area, -30.0, 12.0)
    rng = site.rng_for("growth")
    count = 0
    trees = ("pine_tree", "spruce_tree", "birch_tree", "spruce_tree")
    for pose in poisson_disc(site.extent.buffer(-2.5), 4.2, rng):
        z = settled_z(site, pose.x, pose.y, 0.8)
        inside = abs(pose.x) < 26.0
        # The four corners stay open, so that one sees the bridge from them.
        if abs(pose.x) + abs(pose.y) > 68.0:
            continue
        steep = abs(site.ground_z(pose.x + 1.0, pose.y) - site.ground_z(pose.x - 1.0, pose.y))
        if count >= 120 or steep > (1.6 if inside else 2.4) or not site.is_free(pose.x, pose.y, 1.9, z=z):
            continue
        kind = ("boulder", "bush", "boulder", "young_spruce", "fern")[count % 5] if inside else trees[count % 4]
        count += site.try_place(kind, *pose, z=z) is not None
