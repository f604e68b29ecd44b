"""A big works: a rolling hall, a store with a dock, a power house, a process plant, a tank farm, sidings."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_streets import arrow, crossing, parking_row, streets
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy, columns, letters, stairs
from aerialdojo_gen.scenes.layouts.urban.factory.plant import bund, gallery, pipe_bridge, platform_tower
from aerialdojo_gen.scenes.layouts.urban.parts.halls import (
    Hall,
    flat_roof,
    gable_roof,
    overhead_crane,
    put_up_hall,
    saw_roof,
)
from aerialdojo_gen.scenes.layouts.urban.parts.industry import track
from aerialdojo_gen.scenes.layouts.urban.parts.site_yard import aggregate_bays
from aerialdojo_gen.scenes.mesh import merge, translated
from aerialdojo_gen.scenes.shapes import crown
from aerialdojo_gen.scenes.site import Site

MAIN = (-66.0, -38.0, -20.0, -6.0)
STORE = (-68.0, 12.0, -40.0, 36.0)
POWER = (-10.0, 20.0, 8.0, 38.0)
WORKSHOP = (-26.0, 14.0, -17.0, 34.0)


def build_works(site: Site, sign: str) -> None:
    """Build the works on a site of 152 by 124 m."""
    _ground(site)
    _halls(site, sign)
    _power_house(site)
    _plant(site)
    _offices(site)
    _edges(site)


def _ground(site: Site) -> None:
    site.set_ground(material=site.material("yard", "concrete:#9c988e"))
    site.paint(rectangle(-80, -64, 80, -49), site.material("verge", "grass:#6c8a4c"))
    site.paint(rectangle(20, -46, 74, -22), site.material("verge", "grass:#6c8a4c"))
    streets(site, [[(-76, -56), (76, -56)]], lane_m=3.2, pavement_m=1.8)
    roads = [
        [(-8, -56), (-8, 12)],
        [(-72, -1), (72, -1)],
        [(-72, -1), (-72, 44), (26, 44), (26, -1)],
        [(-13, -1), (-13, 44)],
    ]
    streets(site, [*roads], lane_m=3.1, pavement_m=0.0, surface=site.material("road", "asphalt:#5c5e60"))
    site.paint(rectangle(MAIN[0], MAIN[1], MAIN[2], MAIN[3]), "concrete:#8f8c86")
    site.paint(rectangle(STORE[0], STORE[1], STORE[2], STORE[3]), "concrete:#a19c92")
    for y in (-34.0, -28.0, -22.0, -16.0, -10.0):
        site.paint(rectangle(-65, y - 0.07, -21, y + 0.07), "marking_yellow")
    site.paint(disc(42, 40, 13.0), "gravel:#a8a49a")
    site.paint(disc(65, 45, 10.2), "gravel:#a8a49a")
    site.paint(rectangle(-24, 52.8, 75, 61), "gravel:#8a857b")
    site.paint(rectangle(-72, 47, -40, 60), "rubble:#4c4b4a")
    site.paint(ribbon([(20, -24), (74, -24)], 6.0), "asphalt")
    site.paint(rectangle(21, -46, 42, -38.5), "asphalt")
    parking_row(site, 31.5, -45.6, -90.0, 7, bay_m=(2.8, 5.2))
    for y in (55.4, 59.2):
        track(site, [(-20, y), (75, y)])
    crossing(site, -8, -47.4, 0.0, 6.0, 2.4)
    arrow(site, -6.5, -44.0, 90.0)
    arrow(site, -9.5, -40.0, -90.0)


def _halls(site: Site, sign: str) -> None:
    brick, sheet = site.material("hall", "brick:#94523f"), site.material("roof", "corrugated:#7a7f80")
    main = Hall(
        *MAIN,
        8.0,
        brick,
        sheet,
        {
            "s": ((8.0, 13.0, 0.0, 4.8), (32.0, 37.0, 0.0, 4.8)),
            "n": ((19.5, 25.5, 0.0, 5.2), (38.5, 42.5, 0.0, 4.4)),
            "e": ((6.0, 12.0, 0.0, 5.2), (20.0, 26.0, 0.0, 5.2)),
            "w": ((13.0, 18.0, 0.0, 4.8),),
        },
    )
    put_up_hall(site, main, "rolling_hall", saw_roof(main, 4), name=sign, sign_side="e", letter_m=1.1)
    overhead_crane(site, main, -47.0, 6.4)
    store = Hall(
        *STORE,
        7.0,
        site.material("store", "corrugated:#6f8894"),
        "gravel:#a39d92",
        {
            "s": ((4.0, 8.5, 0.0, 4.4), (19.0, 23.5, 0.0, 4.4)),
            "e": ((3.0, 6.5, 1.1, 4.4), (8.5, 12.0, 1.1, 4.4), (14.0, 17.5, 1.1, 4.4)),
            "n": ((11.5, 16.5, 0.0, 4.4),),
        },
        base="blocks:#8b877d",
    )
    put_up_hall(site, store, "warehouse", flat_roof(store, 0.7, 4), name="STORE", sign_side="s", letter_m=1.3)
    dock: Parts = [
        ("concrete", block(STORE[2], 14.0, STORE[2] + 3.4, 31.0, 0.0, 1.1)),
        ("hazard", block(STORE[2] + 3.4, 14.0, STORE[2] + 3.46, 31.0, 0.7, 1.1)),
    ]
    dock += canopy(
        STORE[2] + 0.2,
        13.6,
        STORE[2] + 4.6,
        31.4,
        5.2,
        roof="sheet_metal:#6b7478",
        post="steel",
        posts=[(STORE[2] + 3.1, y) for y in (14.4, 22.5, 30.6)],
        foot_m=1.1,
    )
    dock += stairs((STORE[2] + 1.7, 33.4), -90.0, 1.4, 1.1, 2.4)
    site.add(None, "loading_dock", dock)
    site.occupy(rectangle(STORE[2], 14.0, STORE[2] + 3.4, 31.0), -1.0, 1.05)
    site.occupy(rectangle(STORE[2] + 0.8, 31.0, STORE[2] + 2.6, 33.6), -1.0, 3.0)
    workshop = Hall(
        *WORKSHOP,
        6.0,
        site.material("workshop", "brick:#b08a5c"),
        "roof_tiles:#7d4a3c",
        {
            "e": ((3.0, 7.0, 0.0, 4.2), (12.5, 16.5, 0.0, 4.2)),
            "s": ((2.5, 6.5, 0.0, 4.2),),
        },
    )
    put_up_hall(site, workshop, "workshop", gable_roof(workshop, 3.2))


def _power_house(site: Site) -> None:
    x0, y0, x1, _ = POWER
    building(
        site,
        rectangle(*POWER),
        wall=site.material("power", "facade_industrial:#8a6a5c"),
        roof="gravel:#96918a",
        storeys=4,
        storey_m=3.0,
        category="power_house",
        parapet_m=0.8,
    )
    building(
        site,
        rectangle(x0, y0 - 5.0, x1, y0),
        wall="brick:#8a5546",
        roof="gravel:#a09a90",
        storeys=2,
        storey_m=3.0,
        category="turbine_hall",
        parapet_m=0.5,
    )
    flue: Parts = [("sheet_metal:#9aa0a2", block(x1, 30.0, x1 + 6.4, 32.4, 7.0, 9.0))]
    flue.append(("steel", merge([block(x1 + 2.4, y, x1 + 2.7, y + 0.3, 0.0, 7.0) for y in (30.1, 32.0)])))
    site.add(None, "flue", flue, footprint=rectangle(x1 + 2.2, 30.0, x1 + 2.9, 32.4))
    gallery(
        site, (-30.0, 57.0, 0.6), (-3.0, 38.0, 9.2), site.material("gallery", "corrugated:#7f8f78"), legs=(0.35, 0.78)
    )
    aggregate_bays(site, Frame(-70.5, 53.5, 0.0), ["rubble:#35363a", "rubble:#4a4038"], 7.0, 6.4)
    heap = crown(radii=(7.5, 4.6, 2.6), noise=0.14, seed=4)
    site.add(
        None,
        "coal_heap",
        [("rubble:#313236", translated(heap, (-47.0, 54.0, 0.0)))],
        footprint=disc(-47, 54, 4.6).union(disc(-51, 54, 4)).union(disc(-43, 54, 4)),
    )
    bunker: Parts = [
        ("corrugated:#7f8f78", block(-33.0, 55.0, -29.4, 59.0, 0.0, 3.8)),
        ("iron", block(-33.3, 54.7, -29.1, 59.3, 3.8, 4.0)),
    ]
    site.add(None, "coal_bunker", bunker, footprint=rectangle(-33, 55, -29.4, 59))


def _plant(site: Site) -> None:
    platform_tower(
        site,
        34.0,
        6.5,
        51.0,
        17.5,
        (4.2, 8.4, 12.6),
        (
            (37.6, 12.0, 1.5, 15.5, "sheet_metal:#b9bfc2"),
            (43.0, 13.6, 1.2, 11.0, "paint:#c98a3c"),
            (48.2, 10.4, 1.3, 18.0, "sheet_metal:#d3d6d6"),
        ),
    )
    bund(site, 32.5, -20.4, 73.5, -6.0)
    bund(site, 55.5, 4.0, 74.0, 24.0)
    pipe_bridge(site, [(30.0, -16.0), (30.0, 26.0), (10.5, 26.0)], 5.6, ("#c9a23a", "#8fa3ad", "#b5563c", "#6f9a72"))
    pipe_bridge(site, [(30.0, 3.2), (72.0, 3.2)], 5.6, ("#8fa3ad", "#c9a23a", "#d8d4c8", "#5f86a8"))
    pipe_bridge(site, [(-18.0, 6.5), (30.0, 6.5)], 5.6, ("#b5563c", "#8fa3ad", "#6f9a72"))
    shed: Parts = [
        ("blocks:#98948a", block(14.0, -20.0, 24.0, -10.0, 0.0, 4.4)),
        ("sheet_metal:#5f6a70", block(13.6, -20.4, 24.4, -9.6, 4.4, 4.7)),
    ]
    shed.append(
        ("paint:#3f6f8a", merge([block(15.4 + 3.0 * k, -20.06, 17.2 + 3.0 * k, -20.0, 0.0, 2.8) for k in range(3)]))
    )
    shed.append(("marking", letters("SUBSTATION", 0.55, (19.0, -20.06, 3.3), -90.0, 0.05)))
    site.add(None, "substation", shed, footprint=rectangle(14, -20, 24, -10))
    silo_deck: Parts = [("steel", columns([(x, y) for x in (62.0, 70.0) for y in (28.5, 33.0)], 0.0, 4.6, 0.22))]
    silo_deck.append(("sheet_metal:#7d8488", block(61.4, 27.9, 70.6, 33.6, 4.6, 4.8)))
    site.add(None, "silo_deck", silo_deck)
    for x in (62.0, 70.0):
        for y in (28.5, 33.0):
            site.occupy(disc(x, y, 0.4), 0.0, 4.6)


def _offices(site: Site) -> None:
    building(
        site,
        rectangle(46, -44, 70, -33),
        wall=site.material("office", "facade_office:#b9a58c"),
        roof="gravel:#b0aaa0",
        storeys=3,
        storey_m=3.5,
        category="office_block",
        parapet_m=0.7,
    )
    front: Parts = canopy(
        54.0, -33.0, 62.0, -29.6, 3.0, roof="sheet_metal:#5f6a70", post="chrome", posts=[(54.4, -30.0), (61.6, -30.0)]
    )
    site.add(None, "porch", front)
    building(
        site,
        rectangle(0.0, -38.0, 9.0, -28.0),
        wall=site.material("canteen", "brick:#a8674c"),
        roof="shingles:#5f5a56",
        storeys=1,
        storey_m=3.4,
        roof_kind="hip",
        roof_m=2.4,
        category="canteen",
    )


def _edges(site: Site) -> None:
    for path in (
        [(-75, -49), (-14, -49)],
        [(-2, -49), (75, -49)],
        [(75, -49), (75, 53.0)],
        [(75, 61.4), (-75, 61.4), (-75, -49)],
    ):
        fence(site, path, "wall", site.material("fence", "brick:#8f5c4a"))
    gate: Parts = [("brick:#8f5c4a", merge([block(x - 0.7, -49.7, x + 0.7, -48.3, 0.0, 4.6) for x in (-13.6, -2.4)]))]
    gate.append(("iron", block(-13.2, -49.2, -2.8, -48.8, 4.2, 4.6)))
    site.add(None, "works_gate", gate)
    for x in (-13.6, -2.4):
        site.occupy(rectangle(x - 0.7, -49.7, x + 0.7, -48.3))
    for x, y, yaw in (
        (-4.0, -30.0, 180),
        (-4.0, -12.0, 180),
        (-60.0, 3.0, -90),
        (-30.0, 3.0, -90),
        (56.0, -3.9, 90),
        (14.0, 3.0, -90),
        (-40.0, 47.2, -90),
    ):
        site.place("street_lamp", x, y, yaw)
