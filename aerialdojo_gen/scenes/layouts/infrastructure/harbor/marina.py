"""A marina below a fishing village: a mole with a lighthouse, jetties of boats, a boatyard, houses on terraces."""

from __future__ import annotations

from shapely.geometry import LineString
from shapely.ops import unary_union

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle, house
from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.grammar_scatter import Pose, smooth_path
from aerialdojo_gen.scenes.ground import rectangle, ribbon
from aerialdojo_gen.scenes.kit.structures import Parts, block, stairs
from aerialdojo_gen.scenes.layouts.infrastructure.harbor.quays import (
    QUAY_M,
    breakwater,
    fenders,
    hall,
    jetty,
    lay,
    line,
    open_shed,
    quay,
    set_out,
)
from aerialdojo_gen.scenes.mesh import merge, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes_extruded import profile
from aerialdojo_gen.scenes.site import Site

_MIDDLE_M, _UPPER_M = 5.2, 8.6
_MIDDLE_Y, _UPPER_Y = 25.0, 38.5
_EDGES = [[(-62.0, 8.0), (30.0, 8.0)], [(38.0, 8.0), (38.0, -32.0)]]
_JETTIES = (-38.0, -14.0, 10.0)
_MOLE = smooth_path([(-58.0, 8.0), (-58.0, -28.0), (-44.0, -42.0), (-16.0, -43.0)], 2)


def build_marina(site: Site) -> None:
    """Build it."""
    _ground(site)
    _terraces(site)
    _village(site)
    _quay_things(site)
    _jetties(site)
    _boatyard(site)
    _mole(site)


def _ground(site: Site) -> None:
    site.set_ground(material=site.material("water", "water:#3f8a94"))
    land = unary_union([rectangle(-65, 8, 65, 52), rectangle(38, -32, 65, 8)])
    quay(site, land, "cobbles:#9a9184", "stone:#8d867a")
    fenders(site, _EDGES, 6.0)
    lay(site, rectangle(38.8, -31.2, 64.4, 12.0), site.material("yard", "concrete:#a39e92"))
    lay(site, ribbon([(-64.0, 14.2), (64.0, 14.2)], 4.6), "asphalt:#6c6a68")
    line(site, [(-64.0, 11.7), (38.0, 11.7)], 0.3, "stone")


def _terraces(site: Site) -> None:
    wall = site.material("terrace_wall", "blocks:#a0937c")
    for y, z, material in ((_MIDDLE_Y, _MIDDLE_M, "paving:#b0a48e"), (_UPPER_Y, _UPPER_M, "grass:#6f8f4a")):
        site.paint(rectangle(-65.0, y, 65.0, 52.0), site.material(f"terrace_{y:.0f}", material), z, wall)
        gaps = [ribbon([(x, y - 1.0), (x, y + 1.0)], 3.0) for x in (-30.0, 22.0)]
        rail = LineString([(-65.0, y + 0.2), (65.0, y + 0.2)]).buffer(0.15, cap_style="flat")
        rail = rail.difference(unary_union(gaps))
        stretches = [p.bounds for p in getattr(rail, "geoms", [rail])]
        parts: Parts = [(wall, merge([block(x0, y0, x1, y1, z, z + 0.7) for x0, y0, x1, y1 in stretches]))]
        site.add(None, "terrace_parapet", parts)
    for x in (-30.0, 22.0):
        parts = stairs((x, _MIDDLE_Y - 5.0), 90.0, 2.4, _MIDDLE_M - QUAY_M, 5.0, z_m=QUAY_M, tread="stone")
        parts += stairs((x, _UPPER_Y - 5.2), 90.0, 2.4, _UPPER_M - _MIDDLE_M, 5.2, z_m=_MIDDLE_M, tread="stone")
        site.add(None, "stairs", parts)
        for y in (_MIDDLE_Y - 2.5, _UPPER_Y - 2.6):
            site.occupy(rectangle(x - 1.6, y - 2.8, x + 1.6, y + 2.8))


def _village(site: Site) -> None:
    colours = ("#b8493c", "#e2d6b4", "#4f7f8c", "#d9a24a", "#8aa08a", "#f0ece0", "#a5623f", "#5a6f94")
    roofs = ("roof_tiles:#a0523a", "shingles:#55585c", "roof_tiles:#8a4534")
    front = (-56.0, -49.6, -43.2, -36.8, -23.0, -16.6, -10.2, -3.8, 2.6, 9.0, 15.4, 29.0, 35.4)
    for k, x in enumerate(front):
        style = HouseStyle(width_m=6.2, depth_m=6.0, storeys=2 + k % 2, storey_m=2.6, wall=f"planks:{colours[k % 8]}",
                           roof=roofs[k % 3], door=colours[(k + 3) % 8], roof_m=2.6, overhang_m=0.15,
                           chimney=k % 2 == 0)  # fmt: skip
        house(site, Frame(x, 20.2, -90.0), style, z=QUAY_M)
    for k, x in enumerate((-54.0, -42.0, -17.0, -5.0, 8.0, 36.0, 49.0)):
        style = HouseStyle(width_m=8.0, depth_m=6.4, storeys=1 + k % 2, wall=f"plaster:{colours[(k * 3 + 1) % 8]}",
                           roof=roofs[(k + 1) % 3], door=colours[(k + 5) % 8])  # fmt: skip
        house(site, Frame(x, 34.2, -90.0), style, z=_MIDDLE_M)
    hall(site, 44.0, 17.0, 62.0, 23.6, 4.6, wall=site.material("chandlery", "brick:#a5644c"),
         roof="roof_tiles:#6a5a50", doors="planks:#2f5a6a", name="SHIP CHANDLER", ridge_m=2.2,
         category="chandlery")  # fmt: skip
    put(site, "village_church", 4.0, 45.0, 180.0, z=_UPPER_M, variant="white")
    upper = "on the upper terrace below the church"
    set_out(site, [("bench", -14.0, 41.0, -90.0), ("telescope", -25.0, 41.4, -90.0),
                   ("stone_cairn", -44.0, 45.0, 0.0),
                   ("flagpole", 24.0, 43.6, 0.0), ("weather_station", 44.0, 44.0, 0.0)], upper)  # fmt: skip
    middle = "on the middle terrace"
    set_out(site, [("clothes_line", -26.0, 30.6, 0.0), ("bird_bath", 1.4, 29.0, 0.0), ("bicycle", 15.6, 28.0, 10.0),
                   ("barbecue", 42.4, 29.4, 0.0), ("beehive", 58.4, 31.0, -90.0)], middle)  # fmt: skip
    trees = [Pose(x, y, 31.0 * x) for x, y in ((-58, 46), (-50, 48.5), (-34, 48), (-22, 47), (20, 48.5),
                                               (34, 47.5), (52, 48),
                                             (60, 42), (-61, 30), (60, 36.6), (-34, 42))]  # fmt: skip
    for k, pose in enumerate(trees):
        site.try_place(("pine_tree", "birch_tree", "urban_tree")[k % 3], *pose)


def _quay_things(site: Site) -> None:
    place = "on the village quay"
    set_out(site, [
        ("fish_crates", -45.6, 11.0, -90.0), ("mooring_bollard", -50.0, 9.4, -90.0),
        ("anchor_monument", -28.6, 14.2, -90.0),
        ("fuel_pump", -20.0, 9.8, -90.0), ("lifebuoy_stand", -5.4, 9.2, 90.0), ("cafe_table", -8.6, 14.6, 0.0),
        ("food_truck", 2.4, 12.4, -90.0), ("mooring_bollard", 20.0, 9.4, -90.0), ("scooter", 13.0, 15.6, 20.0),
        ("delivery_van", 26.0, 13.6, 180.0), ("seagull_statue", 22.4, 12.0, -90.0),
        ("pickup_truck", -57.0, 13.6, 0.0),
    ], place)  # fmt: skip
    for x, y, yaw in ((-41.6, 10.6, 30.0), (-54.0, 10.8, 120.0), (6.4, 9.8, 0.0)):
        put(site, "net_heap", x, y, yaw)


def _jetties(site: Site) -> None:
    for k, x in enumerate(_JETTIES):
        jetty(site, (x, 8.0), (x, -26.0), 2.6, 1.2)
        for y in (-3.0, -13.0, -23.0):
            jetty(site, (x + 1.3, y), (x + 7.0, y), 1.0, 0.9)
            if k:
                jetty(site, (x - 1.3, y), (x - 7.0, y), 1.0, 0.9)
    afloat = (
        ("sailboat", -33.6, -7.6, 0.0, "white_sails"), ("sailboat", -33.6, -18.0, 180.0, "blue_furled"),
        ("motor_yacht", -22.8, -9.0, 0.0, "white"), ("sailboat", -18.8, -20.4, 180.0, "wooden_furled"),
        ("fishing_boat", -8.6, 1.0, 180.0, "blue"), ("sailboat", -9.4, -7.6, 180.0, "red_sails"),
        ("motor_yacht", -6.6, -18.0, 180.0, "navy"), ("rowing_boat", 5.6, 2.6, 40.0, "red_oars_in"),
        ("fishing_boat", 3.8, -8.2, 0.0, "red"), ("sailboat", 5.2, -18.4, 0.0, "blue_furled"),
        ("motor_yacht", 18.2, -8.2, 180.0, "wooden"), ("sailboat", 14.8, -17.6, 180.0, "white_sails"),
        ("fishing_boat", -47.4, 4.4, 0.0, "green"), ("tugboat", 32.4, -12.0, 90.0, "blue_yellow"),
    )  # fmt: skip
    for category, x, y, yaw, variant in afloat:
        put(site, category, x, y, yaw, "at the jetties of the marina", z=0.0, variant=variant)
    put(site, "lifebuoy_stand", -38.0, -25.0, 90.0, "at the end of a jetty", z=1.2)
    put(site, "deck_chair", 10.0, -25.0, -90.0, "at the end of a jetty", z=1.2)


def _boatyard(site: Site) -> None:
    roof = hall(site, 50.0, -28.0, 63.0, -8.0, 8.4, wall=site.material("boat_shed", "corrugated:#3f6a7c"),
                roof="sheet_metal:#8a9298", doors="planks:#d9d2c0", name="BOATYARD", facing_deg=180.0,
                category="boat_shed")  # fmt: skip
    set_out(site, [("air_conditioner", 56.0, -24.0, 0.0), ("solar_panels", 57.0, -13.0, 180.0)],
            "on the roof of the boat shed", roof)  # fmt: skip
    open_shed(site, 52.0, -4.0, 63.0, 8.0, 4.2, "corrugated:#8a4a3c")
    set_out(site, [("pallet_stack", 60.0, 4.6, 0.0), ("oil_drums", 55.6, 5.0, 0.0), ("sawhorse", 57.4, -0.6, 20.0)],
            "under the roof of the timber store")  # fmt: skip
    set_out(site, [
        ("harbour_crane", 43.2, -24.0, 180.0), ("forklift", 45.0, -2.0, 60.0),
        ("dinghy_on_trailer", 42.6, -12.0, 80.0),
        ("rebar_bundle", 46.0, 5.0, 90.0), ("mooring_bollard", 39.4, -17.6, 180.0),
        ("navigation_beacon", 40.4, -30.0, 0.0),
        ("box_truck", 44.6, 11.0, 180.0),
    ], "in the boatyard")  # fmt: skip
    slope = profile(points=[(0.0, -0.4), (9.0, QUAY_M - 0.3), (9.0, QUAY_M), (0.0, -0.05)], width=6.0)
    turned = translated(rotated(slope, rotation(0.0, 0.0, 90.0)), (34.4, -1.0, 0.0))
    rails = [block(34.4 + s - 0.08, -1.0, 34.4 + s + 0.08, 8.0, -0.3, 0.2) for s in (-3.1, 3.1)]
    site.add("slipway", "slipway", [("concrete:#8f8a80", turned), ("wood", merge(rails))])
    put(site, "canoe", 34.4, 6.4, 90.0, "at the head of the slipway", z=1.35)


def _mole(site: Site) -> None:
    breakwater(site, _MOLE)
    head = (-10.0, -43.0)
    body = [(site.material("mole", "concrete"), block(head[0] - 6, head[1] - 6, head[0] + 6, head[1] + 6, -0.3, 2.6))]
    site.add("mole_head", "mole_head", body)
    put(site, "lighthouse", *head, 180.0, z=2.6, variant="stone")
    place = "on the mole"
    set_out(site, [("navigation_beacon", -57.8, -10.0, 0.0), ("bench", -45.4, -38.8, 60.0),
                   ("pier_kiosk", -58.0, 2.6, 0.0)], place, 2.6)  # fmt: skip
    for x, y, variant in ((8.0, -46.0, "green_cone"), (24.0, -36.0, "red_can"), (-26.0, -33.0, "yellow")):
        put(site, "buoy", x, y, 0.0, "at the mouth of the harbour" if x > 0 else "behind the mole", z=0.0,
            variant=variant)  # fmt: skip
    put(site, "rowing_boat", 48.0, -44.0, 30.0, "off the boatyard", z=0.0, variant="green")
    put(site, "sailboat", 36.0, -44.0, 150.0, "at the mouth of the harbour", z=0.0, variant="red_sails")
