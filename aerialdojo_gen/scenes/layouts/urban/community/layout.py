"""A residential community: a gated estate of flats about a garden, or terraced houses about shared allotments.

North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from aerialdojo_gen.scenes.grammar_fences import fence
from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_props import deal, put
from aerialdojo_gen.scenes.grammar_scatter import Pose, smooth_path
from aerialdojo_gen.scenes.grammar_streets import crossing, parking_row, streets
from aerialdojo_gen.scenes.ground import disc, rectangle, ribbon
from aerialdojo_gen.scenes.kit.parking import park_cars
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy, columns, letters
from aerialdojo_gen.scenes.layouts.urban.community.estate import Slab, furnish_balconies, furnish_roof, put_up
from aerialdojo_gen.scenes.layouts.urban.community.terraces import build_terraces
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"estate"`` (132 by 112 m) or ``"terraces"`` (94 by 84 m).
    occupancy : float
        Share of the parking bays that is taken.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["estate", "terraces"] = "estate"
    occupancy: float = Field(default=0.5, ge=0.0, le=1.0)


def build(site: Site) -> None:
    """Build the community."""
    parameters: Parameters = site.parameters
    if parameters.plan == "terraces":
        build_terraces(site, parameters.occupancy)
    else:
        _estate(site, parameters.occupancy)


def _estate(site: Site, occupancy: float) -> None:
    bays = _ground(site)
    _flats(site)
    _gate(site)
    _garden_structures(site)
    _landmarks(site)
    _garden_things(site)
    _court_and_playground(site)
    _edges(site)
    park_cars(site, bays, occupancy, "beside the ring road")


def _ground(site: Site) -> list[Pose]:
    site.set_ground(material=site.material("lawn", "grass"))
    ring = [(-57, -45), (57, -45), (57, 46), (-57, 46), (-57, -45)]
    streets(site, [ring, [(0, -56), (0, -40)]], lane_m=2.8, pavement_m=1.8, marks=False)
    site.paint(rectangle(-12, -42.5, 12, -24), site.material("plaza", "paving"), 0.12)
    path = site.material("path", "gravel:#cbb892")
    loops = (
        [(0, -24), (0, 24)], [(-34, 0), (34, 0)], [(-27, 28), (-27, 10), (-8, 4), (0, 0)], [(27, 28), (27, 10),
        (9, 5), (0, 0)],
        [(-30, -24), (-27, -12), (-8, -5), (0, 0)], [(30, -24), (27, -12), (8, -5), (0, 0)],
    )  # fmt: skip
    for line in loops:
        site.paint(ribbon(smooth_path(line), 2.4, round_ends=True), path)
    site.paint(disc(0, 0, 8.5), site.material("plaza", "paving"))
    site.paint(disc(-19, 15, 4.4), path)
    site.paint(rectangle(12, 9, 31, 22), site.material("play", "#c9905a"))
    site.paint(rectangle(-31, -21, -13, -8), site.material("court", "#3f6f8a"))
    for line in (rectangle(-30.6, -20.6, -13.4, -8.4).exterior, disc(-22, -14.5, 1.8).exterior):
        site.paint(line.buffer(0.05), "marking")
    site.paint(rectangle(-22.05, -20.6, -21.95, -8.4), "marking")
    bays = []
    for x, yaw in ((-52.2, 180.0), (52.2, 0.0)):
        for y, count in ((-25.0, 9), (22.0, 9)):
            side = 1 if yaw == 0.0 else -1
            site.paint(
                rectangle(min(x - side * 3.4, x + side * 4.0), y - 12, max(x - side * 3.4, x + side * 4.0), y + 12),
                "asphalt",
            )
            bays += parking_row(site, x - side * 3.0, y, yaw + 180.0, count, bay_m=(2.6, 5.0))
    for x, y, yaw in ((0, -41.0, 0.0), (-20, -45, 90.0), (57, 0, 0.0), (-57, 0, 0.0)):
        crossing(site, x, y, yaw, 5.6, 2.6)
    return bays


def _slabs(site: Site) -> list[Slab]:
    one, two = site.material("flats", "facade_flats:#c9b295"), site.material("flats_two", "facade_flats:#b0b8ba")
    red, teal, ochre = "#a5523f", "#3f7a78", "#c98f3a"
    return [
        Slab(Frame(-27, 31.5, -90.0), 36, 11, 5, one, red, "block A"),
        Slab(Frame(27, 31.5, -90.0), 36, 11, 6, two, teal, "block B"),
        Slab(Frame(41.5, -3, 180.0), 32, 11, 5, one, ochre, "block C"),
        Slab(Frame(29, -31.5, 90.0), 30, 10, 4, two, red, "block D"),
        Slab(Frame(-29, -31.5, 90.0), 30, 10, 4, one, teal, "block E"),
        Slab(Frame(-41.5, -3, 0.0), 32, 11, 6, two, ochre, "block F"),
    ]


def _flats(site: Site) -> None:
    balconies = (["rocking_chair", "planter", "bicycle"], ["rocking_chair", "planter", "topiary"],
                 ["telescope", "planter", "clothes_line"], ["bicycle", "topiary"], ["rocking_chair", "garden_gnome"],
                 ["rocking_chair", "mountain_bike", "bird_bath"])  # fmt: skip
    roofs = (["water_tank", "solar_panels", "satellite_dish"], ["gazebo", "solar_panels", "weather_station"],
             ["air_conditioner", "satellite_dish", "beehive"], ["solar_panels", "topiary", "water_tank"],
             ["satellite_dish", "air_conditioner"], ["weather_station", "water_tank", "billboard"])  # fmt: skip
    arches = ("bicycle_rack", "vending_machine", "mailbox", "scooter", "recycling_bin", "bench")
    for slab, things, top, arch in zip(_slabs(site), balconies, roofs, arches, strict=True):
        put_up(site, slab)
        furnish_balconies(site, slab, things)
        furnish_roof(site, slab, top)
        turn = 90.0 if arch != "bicycle_rack" else 0.0
        deal(site, [arch], [slab.frame.pose(1.5, 1.9, turn)], f"in the archway of {slab.name}")
        side = slab.length_m / 2 - 4.0
        front = (
            ["planter", "bench", "litter_bin"]
            if arch in ("mailbox", "scooter")
            else ["planter", "mailbox", "bicycle"]
        )
        deal(site, front, [slab.frame.pose(slab.depth_m / 2 + 2.6, v, 0.0) for v in (side, -side, -side + 3.4)],
             f"in front of {slab.name}")  # fmt: skip
        deal(site, ["wheelie_bin", "air_conditioner", "motorcycle"],
             [slab.frame.pose(-slab.depth_m / 2 - 1.5, v, 180.0) for v in (side - 1.0, -side + 1.0)],
             f"behind {slab.name}")  # fmt: skip


def _gate(site: Site) -> None:
    wall = site.material("gate", "brick:#8f5a46")
    parts: Parts = [(wall, merge([block(x - 0.8, -51.4, x + 0.8, -49.8, 0.0, 5.2) for x in (-6.4, 6.4)]))]
    parts.append(("roof_tiles:#6f4a3c", block(-8.0, -52.0, 8.0, -49.2, 5.2, 5.6)))
    parts.append(("concrete", block(-7.2, -51.3, 7.2, -49.9, 4.4, 5.2)))
    parts.append(("marking", letters("GARDEN COURT", 0.55, (0.0, -51.32, 4.52), -90.0, 0.05)))
    site.add("estate_gate", "gate", parts, {"material": "brick"}, footprint=rectangle(-7.2, -51.4, -5.6, -49.8))
    site.occupy(rectangle(5.6, -51.4, 7.2, -49.8))
    put(site, "guard_booth", 8.6, -39.8, 180.0, "inside the gate")
    put(site, "boom_gate", -3.6, -48.8, 90.0, "at the gate")
    put(site, "stop_sign", 4.6, -51.8, -90.0, "at the gate")
    for a, b in (((-64, -50.6), (-7.2, -50.6)), ((7.2, -50.6), (64, -50.6)), ((-64, -50.6), (-64, 53)),
        ((64, -50.6), (64, 53)),
                 ((-64, 53), (64, 53))):  # fmt: skip
        fence(site, [a, b], "wall", "brick:#a8735c")
    deal(site, ["flagpole", "planter", "information_board", "litter_bin"],
         [Pose(-9.6, -39.0, -90.0), Pose(-5.0, -36.5, 0.0), Pose(-9.0, -34.0, -90.0),
         Pose(5.0, -38.0, 90.0)], "inside the gate")  # fmt: skip


def _garden_structures(site: Site) -> None:
    """Build the pergola between gate and fountain, and the community hall in the north."""
    posts = [(x, y) for x in (-2.2, 2.2) for y in (-22.0, -18.0, -14.0, -10.5)]
    parts: Parts = [("wood", columns(posts, 0.0, 2.9, 0.12, 6))]
    parts.append(("wood", merge([block(x - 0.08, -22.6, x + 0.08, -10.0, 2.9, 3.1) for x in (-2.2, 2.2)])))
    parts.append(
        (
            "wood",
            merge([block(-2.9, y - 0.06, 2.9, y + 0.06, 3.1, 3.25) for y in [-22.2 + 0.9 * k for k in range(14)]]),
        )
    )
    parts.append(("hedge:#5f8a4a", block(-2.4, -20.5, 2.4, -12.0, 3.25, 3.5)))
    site.add("pergola", "pergola", parts, {"material": "wooden"})
    hall: Parts = [
        ("planks:#a8774a", block(-7.4, 31.0, 7.4, 39.5, 0.0, 4.4)),
        ("curtain_wall", block(-6.4, 30.9, 6.4, 31.0, 0.3, 3.8)),
        ("sheet_metal:#5f6a6c", block(-7.8, 30.6, 7.8, 39.9, 4.4, 4.7)),
        ("marking", letters("COMMUNITY HALL", 0.5, (0.0, 26.9, 3.66), -90.0, 0.06)),
        *canopy(-7.0, 27.0, 7.0, 31.0, 3.6, roof="sheet_metal:#5f6a6c", post="wood", posts=[(-6.6, 27.4), (0, 27.4),
            (6.6, 27.4)]),
    ]  # fmt: skip
    site.add(
        "community_hall", "community_hall", hall, {"material": "wooden"}, footprint=rectangle(-7.4, 31, 7.4, 39.5)
    )
    deal(site, ["cafe_table", "a_board", "bench",
        "phone_booth"], [Pose(x, 29.2, -90.0) for x in (-4.5, -1.5, 2.2, 5.2)],
         "under the canopy of the hall")  # fmt: skip
    for category, x in (("solar_panels", -3.5), ("weather_station", 3.6)):
        put(site, category, x, 35.0, -90.0, "on the roof of the hall", z=4.7)
    for k, (x, y) in enumerate(((12.5, -9.5), (-11.5, 8.0))):
        for r in (3.2, 5.2):
            ring = disc(x, y, r, 12)
            gap = ring.exterior.difference(
                rectangle(x - 1.2, y - 9, x + 1.2, y) if (r > 4) ^ (k == 1) else rectangle(x - 9, y - 1.2, x, y + 1.2)
            )
            for leg in getattr(gap, "geoms", [gap]):
                fence(site, [(float(u), float(v)) for u, v in leg.coords], "hedge")
        put(site, ("topiary", "carved_owl")[k], x, y, 0.0, "inside a ring of hedges")


def _landmarks(site: Site) -> None:
    put(site, "fountain", 0.0, 0.0)
    put(site, "clock_tower", 0.0, 22.5, -90.0)
    put(site, "water_tower", 27.5, -17.0)
    put(site, "statue", -28.0, 5.0, 0.0)


def _garden_things(site: Site) -> None:
    put(site, "gazebo", -19.0, 15.0, 0.0, "in the garden")
    deal(site, ["cafe_table"], [Pose(-25.5, 21.5, 0.0)], "in the garden")
    garden = ["bench", "litter_bin", "litter_bin", "bird_bath", "picnic_table", "planter", "planter", "topiary",
        "birdhouse",
              "information_board", "hammock", "kiosk", "ice_cream_cart", "weather_station", "market_stall",
              "recycling_bin"]  # fmt: skip
    spots = [(-6.6, 6.6, -45), (6.4, 6.8, 225), (-6.8, -6.4, 45), (-24.5, 8.0, 0), (-10.5, 18.0, 30),
        (6.8, -6.6, 135), (-3.4, 11.5, 0),
             (-10.0, 24.0, 0), (18.0, 3.0, 180), (-14.0, 2.4, -90), (21.0, -6.0, 60), (14.5, 2.8, -90),
             (-4.5, -15.5, 0),
             (30.5, 4.0, 90), (-18.5, -3.4, 90), (4.0, -13.0, 180)]  # fmt: skip
    deal(site, garden, [Pose(float(x), float(y), float(a)) for x, y, a in spots], "in the garden")
    trees = [(-31, 18), (-13, 11), (-31, 12), (5.5, 14), (-7, 16), (9, -17), (18, -3.5), (31, -8), (-10, -14),
        (-6, -21), (31, 2.5),
             (-33, -5), (8, 10), (-24, 23.5), (8, -21.5), (-16, 21), (15, -20), (-33, 24), (33, 23.5)]  # fmt: skip
    deal(
        site,
        ["urban_tree", "birch_tree", "urban_tree", "oak_tree"],
        [Pose(float(x), float(y), 37.0 * x) for x, y in trees],
    )


def _court_and_playground(site: Site) -> None:
    put(site, "basketball_hoop", -30.0, -14.5, 0.0, "on the ball court")
    put(site, "basketball_hoop", -14.0, -14.5, 180.0, "on the ball court")
    put(site, "goal_post", -22.0, -8.8, -90.0, "on the ball court")
    deal(site, ["ball_cart", "referee_chair", "bench"], [Pose(-17.0, -19.8, 90.0), Pose(-22.0, -20.0, 90.0),
        Pose(-27.0, -20.2, 90.0)],
         "on the ball court")  # fmt: skip
    play = ["playground_slide", "swing_set", "spring_rider", "trampoline", "seesaw", "sandbox", "inflatable_castle"]
    spots = [(15.5, 13.0, 0), (20.5, 19.0, 90), (20.0, 11.2, 45), (28.0, 12.2, 0), (24.0, 14.6, 200),
        (14.6, 19.6, 0), (28.0, 18.6, 180)]  # fmt: skip
    deal(site, play, [Pose(float(x), float(y), float(a)) for x, y, a in spots], "in the playground")
    fence(site, [(12, 22), (12, 16.5)], "picket", "#d9a62e")
    fence(site, [(31, 9), (31, 22), (12, 22)], "picket", "#3f8fa8")


def _edges(site: Site) -> None:
    lamps = [Pose(x, y, yaw) for x in (-36.0, 0.0, 36.0) for y, yaw in ((-41.2, -90.0), (42.2, 90.0))]
    deal(site, ["street_lamp"], lamps, "at the ring road")
    ring = ["fire_hydrant", "bus_shelter", "parking_meter", "crossing_sign", "ev_charger", "bicycle_rack", "dumpster",
            "newspaper_box", "direction_sign", "skip_container", "golf_cart", "traffic_cone"]  # fmt: skip
    spots = [(-20.0, -41.4, -90), (22.0, -41.0, -90), (61.0, -22.0, 180), (53.3, 3.0, 0), (61.0, 14.0, 180),
        (61.4, 30.0, 180),
             (-61.2, 34.0, 0), (-12.0, -40.8, -90), (-53.2, 3.0, 180), (-61.2, -30.0, 90), (-61.2, 8.0, 90),
             (40.0, -48.4, 90)]  # fmt: skip
    deal(site, ring, [Pose(float(x), float(y), float(a)) for x, y, a in spots], "at the ring road")
    deal(site, ["delivery_van", "hatchback", "motorcycle"], [Pose(-32.0, -46.4, 0.0), Pose(20.0, 47.4, 180.0),
        Pose(58.2, -32.0, 90.0)],
         "in the ring road")  # fmt: skip
    trees = [Pose(x, y, 31.0 * k) for k, x in enumerate(range(-54, 58, 12)) for y in (51.0,)]
    deal(site, ["urban_tree"], trees)
