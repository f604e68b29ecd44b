"""Terraces of narrow gabled houses about shared gardens: allotments, glasshouses, an orchard, a workshop."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_buildings import building
from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle, house
from aerialdojo_gen.scenes.grammar_props import deal, put
from aerialdojo_gen.scenes.grammar_scatter import Pose, smooth_path
from aerialdojo_gen.scenes.grammar_streets import crossing, parking_row, streets
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.parking import park_cars
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy, columns, letters
from aerialdojo_gen.scenes.mesh import merge, rotated, rotation, translated
from aerialdojo_gen.scenes.shapes_extruded import prism
from aerialdojo_gen.scenes.site import Site

_PITCH_M = 6.6
_TINTS = (
    ("red", "brick:#a5523f"), ("yellow", "plaster:#e3c66a"), ("white", "plaster:#ece6d8"), ("blue", "planks:#6f93ae"),
    ("brown", "brick:#7f5a46"), ("green", "planks:#86a07a"), ("pink", "plaster:#d9a598"),
)  # fmt: skip


def build_terraces(site: Site, occupancy: float) -> None:
    """Build the terraces; `occupancy` is the share of the parking bays that is taken, 0 to 1."""
    bays = _ground(site)
    _terrace(site, Frame(-21.8, 25.0, -90.0), 5, 0, "north terrace")
    _terrace(site, Frame(18.2, 25.0, -90.0), 5, 2, "north-east terrace")
    _terrace(site, Frame(-3.0, -25.0, 90.0), 8, 4, "south terrace")
    _terrace(site, Frame(-37.0, 0.5, 0.0), 4, 1, "west terrace")
    _hall(site)
    _gardens(site)
    _things(site)
    park_cars(site, bays, occupancy, "in the shared car park")


def _ground(site: Site) -> list[Pose]:
    site.set_ground(material=site.material("lawn", "grass"))
    streets(site, [[(39, -42), (39, 42)]], lane_m=2.8, pavement_m=1.8)
    lane = site.material("lane", "cobbles:#a3948a")
    for lane_path in ([(-31, 18.2), (36, 18.2)], [(-31, -18.2), (36, -18.2)], [(-30.2, -18.2), (-30.2, 18.2)]):
        site.paint(ribbon(lane_path, 3.0), lane)
    for path in ([(-30, 0), (-12, 1), (0, 0), (14, -1), (26, 1)], [(0, -18), (1, -8), (0, 0), (-1, 9), (0, 18)]):
        site.paint(ribbon(smooth_path(path), 1.8, round_ends=True), "gravel:#cbb892")
    site.paint(disc(0, 0, 6.6), "paving:#bfae96")
    site.paint(rectangle(26, -31, 36.2, -11), "asphalt")
    crossing(site, 39, 8, 0, 5.6, 2.4)
    return parking_row(site, 27.0, -21.0, 180.0, 7)


def _terrace(site: Site, frame: Frame, count: int, first: int, name: str) -> None:
    """Put up a row of houses wall to wall, with front steps, back gardens and chimneys, and things about each."""
    front = ["planter", "bicycle", "bench", "planter", "mailbox", "topiary", "scooter", "garden_gnome"]
    back = [
        "barbecue",
        "garden_shed",
        "trampoline",
        "clothes_line",
        "rabbit_hutch",
        "garden_swing",
        "playground_slide",
        "dog_house",
        "sandbox",
    ]
    for k in range(count):
        colour, wall = _TINTS[(first + 2 * k) % len(_TINTS)]
        v = (k - (count - 1) / 2) * _PITCH_M
        style = HouseStyle(
            width_m=_PITCH_M, depth_m=8.6, storeys=3 if (k + first) % 3 == 1 else 2, storey_m=2.8, wall=wall,
            roof=("roof_tiles:#7a4638", "shingles:#4f5458", "roof_tiles:#a55a40")[(k + first) % 3], roof_m=3.4,
            door=("#26364f", "#8a2f2a", "#39513f", "#d9a62e")[k % 4], overhang_m=0.0, chimney=k % 2 == 0,
        )  # fmt: skip
        at = Frame(*frame.at(0.0, v), frame.yaw_deg)
        house(site, at, style, {"colour": colour, "place": name})
        whose = f"the {colour} house of the {name}"
        deal(site, [front[(k + first) % 8]], [at.pose(6.6, 2.0, 90.0)], f"in front of {whose}")
        deal(site, [back[(k + 2 * first) % len(back)]], [at.pose(-7.4, 0.2, 180.0)], f"behind {whose}")
        if k:
            fence(site, at.path([(-4.4, -_PITCH_M / 2), (-9.6, -_PITCH_M / 2)]), "board")
    half = count * _PITCH_M / 2
    fence(site, frame.path([(-4.4, -half), (-9.8, -half), (-9.8, half), (-4.4, half)]), "hedge")


def _hall(site: Site) -> None:
    plan = rectangle(24.0, -5.0, 35.0, 7.0)
    extra: Parts = [
        ("marking", letters("WORKSHOP", 0.7, (23.98, 1.0, 3.3), 180.0, 0.06)),
        ("window", block(23.9, -0.6, 24.05, 2.6, 0.0, 2.8)),
        *canopy(
            20.6,
            -4.6,
            24.0,
            6.6,
            3.0,
            roof="corrugated:#8a5238",
            post="wood",
            posts=[(20.9, -4.3), (20.9, 1), (20.9, 6.3)],
        ),
    ]
    building(site, plan, wall="planks:#a8774a", roof="corrugated:#6f5a4c",
        storeys=2, storey_m=2.4, roof_kind="gable", roof_m=2.6,
             z=0.0, category="workshop", attributes={"material": "wooden"}, extra=extra)  # fmt: skip
    deal(
        site,
        ["axe_block", "sawhorse", "bench"],
        [Pose(22.3, y, 180.0) for y in (-3.4, 3.6, 5.6)],
        "under the roof of the workshop",
    )
    shed: Parts = [("wood", columns([(x, y) for x in (-27.4, -21.0) for y in (11.2, 15.4)], 0.0, 2.5, 0.1, 6))]
    shed.append(("corrugated:#5f7466", block(-27.8, 10.8, -20.6, 15.8, 2.5, 2.65)))
    shed.append(("boards:#8d6f4c", block(-27.6, 15.5, -20.8, 15.7, 0.0, 2.4)))
    site.add("bicycle_shed", "shelter", shed, {"material": "wooden"})
    deal(site, ["bicycle_rack", "bicycle", "wheelbarrow"], [Pose(-25.8, 13.2, -90.0), Pose(-22.9, 13.6, -90.0),
        Pose(-21.6, 13.2, -80.0)],
         "under the roof of the bicycle shed")  # fmt: skip


def _gardens(site: Site) -> None:
    """Lay out raised beds, two glasshouses and an orchard."""
    for k, (x, y) in enumerate([(-25 + 4.2 * i, y) for i in range(5) for y in (-13.6, -9.6, -5.6)]):
        if (x, y) == (-25 + 4.2 * 4, -5.6):
            continue
        site.paint(rectangle(x - 1.5, y - 1.0, x + 1.5, y + 1.0), "soil", 0.25, "wood")
        green = ("foliage:#5f8f3c", "foliage:#86a04a", "foliage:#4a7a4f")[k % 3]
        rows = [
            block(x - 1.3, y - 0.75 + 0.55 * r, x + 1.3, y - 0.5 + 0.55 * r, 0.2, 0.45 + 0.12 * (k % 3))
            for r in range(3)
        ]
        site.add(
            None, "vegetable_bed", [(green, merge(rows))], footprint=rectangle(x - 1.5, y - 1.0, x + 1.5, y + 1.0)
        )
    for x, y in ((9.0, -12.4), (16.5, -12.4)):
        gable = rotated(prism(size=(6.0, 4.4, 1.5)), rotation(0.0, 0.0, 90.0))
        parts: Parts = [
            ("glass:#a9c6c0", translated(gable, (x, y, 2.0))),
            ("#e9ece6", merge([block(x - 2.3, y - 3.1, x + 2.3, y - 2.98, 1.9, 2.06),
            block(x - 2.3, y + 2.98, x + 2.3, y + 3.1, 1.9, 2.06)])),
            ("#e9ece6", merge([block(u - 0.06, v - 0.06, u + 0.06, v + 0.06, 0.0, 2.0)
                               for u in (x - 2.2, x + 2.2) for v in (y - 3, y - 1, y + 1, y + 3)])),
            ("glass:#a9c6c0", merge([block(u - 0.03, y - 3.0, u + 0.03, y + 3.0, 0.25, 1.95)
                                     for u in (x - 2.2, x + 2.2)])),
            ("glass:#a9c6c0", block(x - 2.2, y - 3.03, x + 2.2, y - 2.97, 0.25, 1.95)),
            ("stone", merge([block(u - 0.1, y - 3.0, u + 0.1, y + 3.0, 0.0, 0.25) for u in (x - 2.2, x + 2.2)])),
        ]  # fmt: skip
        site.add(None, "glasshouse", parts, {"material": "glass"})
        site.occupy(rectangle(x - 2.4, y - 3.1, x - 2.0, y + 3.1))
        site.occupy(rectangle(x + 2.0, y - 3.1, x + 2.4, y + 3.1))
        deal(site, ["planter", "planter"], [Pose(x, y - 0.8, 0.0)], "in a glasshouse")
    orchard = [Pose(x, y, 50.0 * x) for x in (8.0, 12.6, 17.2) for y in (6.4, 10.8, 15.0)]
    deal(site, ["urban_tree"], [p for k, p in enumerate(orchard) if k != 4], "in the orchard")


def _things(site: Site) -> None:
    put(site, "fountain", 0.0, 0.0)
    put(site, "clock_tower", 30.5, 13.4, 180.0)
    put(site, "statue", -20.0, 4.6, -90.0)
    garden = ["bench", "gazebo", "swing_set", "stone_well", "bird_bath", "picnic_table", "cafe_table", "kiosk",
        "market_stall", "litter_bin",
              "seesaw", "beehive", "wheelbarrow", "wheelbarrow", "carved_owl", "totem_pole", "campfire",
              "litter_bin"]  # fmt: skip
    spots = [(-6.4, 3.2, -20), (-12.6, 10.8, 0), (-6.0, 13.6, 0), (-5.6, -6.6, 0), (-15.0, 5.6, 0),
        (12.6, 10.8, 30), (6.2, 5.0, 0), (6.6, -5.0, 120),
             (15.6, 2.0, -90), (4.8, 6.9, 0), (-2.6, 9.6, 0), (12.7, -9.4, 180), (20.0, -9.0, 0), (-8.4, -2.8, 40),
             (3.6, 14.2, -90),
             (18.0, -5.2, 150), (20.6, 10.4, 0), (-2.4, -9.6, 0)]  # fmt: skip
    deal(site, garden, [Pose(float(x), float(y), float(a)) for x, y, a in spots], "in the shared garden")
    lane = ["litter_bin", "recycling_bin", "phone_booth", "wheelie_bin", "golf_cart", "information_board", "scooter"]
    spots2 = [
        (-29.0, 9.0, 0),
        (-20.0, 16.2, -90),
        (2.6, 16.2, -90),
        (24.6, -9.4, 90),
        (-20.0, -17.4, 2),
        (25.2, 17.0, 180),
        (10.0, 18.8, 4),
    ]
    deal(site, lane, [Pose(float(x), float(y), float(a)) for x, y, a in spots2], "in the lane")
    street = ["street_lamp", "bus_shelter", "mailbox", "fire_hydrant", "parking_meter", "stop_sign", "ev_charger"]
    ys = [-8.0, 22.5, 18.6, 0.5, 28.0, -34.0, 33.0]
    deal(site, street, [Pose(35.3, y, 0.0) for y in ys], "along the street")
    deal(site, ["delivery_van", "hatchback", "motorcycle"], [Pose(40.4, 12.0, 90.0), Pose(37.6, -24.0, -90.0),
        Pose(40.6, -6.0, 90.0)],
         "in the street")  # fmt: skip
    deal(site, ["urban_tree", "oak_tree"], [Pose(-28.0, 6.5, 0.0), Pose(23.6, 12.5, 0.0), Pose(-24.6, 1.4, 20.0)])
