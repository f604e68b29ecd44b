"""Alleys: a back alley among brick tenements, or the lanes of an old market town.

North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from aerialdojo_gen.scenes.grammar_props import deal, put
from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.grammar_streets import crossing, streets
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.layouts.urban.alley.market_lanes import build_lanes
from aerialdojo_gen.scenes.layouts.urban.alley.walls import (
    awning,
    balcony,
    fire_escape,
    light_string,
    passage_house,
    pipe,
    town_house,
    washing_line,
)
from aerialdojo_gen.scenes.mesh import merge
from aerialdojo_gen.scenes.site import Site

_BRICK = "facade_brick"
_STOREY_M = 3.0


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        ``"tenements"`` (76 by 60 m) or ``"market_lanes"`` (74 by 64 m).
    washing_lines : int
        How many lines of washing hang across the lanes, 6 at most.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["tenements", "market_lanes"] = "tenements"
    washing_lines: int = Field(default=3, ge=0, le=6)


def build(site: Site) -> None:
    """Build the alley."""
    parameters: Parameters = site.parameters
    if parameters.plan == "market_lanes":
        build_lanes(site, parameters.washing_lines)
    else:
        _tenements(site, parameters.washing_lines)


def _tenements(site: Site, washing_lines: int) -> None:
    site.set_ground(material=site.material("alley", "cobbles:#77726c"))
    streets(site, [[(33, -30), (33, 30)]], lane_m=2.8, pavement_m=2.6)
    site.paint(rectangle(-38, -0.5, 6, 0.5), "concrete:#6a6864")
    site.paint(rectangle(4.5, 0, 5.5, 30), "concrete:#6a6864")
    site.paint(rectangle(8, 17, 27.6, 30), site.material("square", "paving"), 0.12)
    site.paint(rectangle(-24, 3.2, -9.6, 15), "asphalt:#5c5b59")
    crossing(site, 33, 10, 0, 5.6)
    roofs = _houses(site)
    _on_walls(site)
    _washing(site, washing_lines)
    _on_roofs(site, roofs)
    _landmarks(site)
    _alley_things(site)
    _street_things(site)


def _houses(site: Site) -> dict[str, float]:
    flat, tar = "gravel:#8d877e", "asphalt:#4c4d50"
    roofs = {
        "north-west": town_house(site, (-38, 15, -9.6, 30), 4, f"{_BRICK}:#8f4a3c", flat),
        "west": town_house(site, (-38, 3.2, -24, 14.9), 3, f"{_BRICK}:#a8705a", tar),
        "middle": town_house(site, (-9.5, 3.2, 2, 30), 4, f"{_BRICK}:#7a4438", tar),
        "south-west": town_house(site, (-38, -30, -18, -3.2), 4, f"{_BRICK}:#9c5f48", flat),
        "south": town_house(site, (-12.5, -30, 8, -3.2), 3, f"{_BRICK}:#86503f", tar),
        "east": town_house(site, (8, 2.3, 27.5, 16.9), 3, f"{_BRICK}:#a5523f", flat),
        "south-east": town_house(site, (8.1, -15, 27.5, -1.7), 4, f"{_BRICK}:#6f4038", tar),
    }
    roofs["bridge"] = passage_house(
        site, (9.0, -1.68, 26.5, 2.28), (8.9, -1.7, 26.6, 2.3), 4.2, 1, f"{_BRICK}:#8f4a3c", "brick:#7a4438", tar
    )
    pipes = [
        pipe(x, y, 0.0, 9.0)
        for x, y in ((-37, 3.1), (-10.5, 14.8), (1.7, 3.1), (-17.9, -20), (7.9, -3.1), (2.1, 20), (7.9, 10))
    ]
    site.add("downpipes", "pipes", [("copper", merge(pipes))])
    return roofs


def _on_walls(site: Site) -> None:
    fire_escape(site, 2.0, 20.5, 0.0, 4, _STOREY_M)
    fire_escape(site, -28.0, -3.2, 90.0, 4, _STOREY_M)
    fire_escape(site, -16.5, 15.0, -90.0, 4, _STOREY_M)
    for x, y, yaw, storey, thing in (
        (-3.0, -3.2, 90.0, 1, "planter"), (3.0, -3.2, 90.0, 2, "rocking_chair"), (8.0, 10.5, 180.0, 1, "bicycle"),
        (8.0, 6.0, 180.0, 2, "planter"), (-24.0, 10.0, 0.0, 1, "topiary"), (-24.0, 6.0, 0.0, 2, "rocking_chair"),
        (-18.0, -14.0, 0.0, 2, "planter"), (-6.0, 3.2, -90.0, 2, "garden_gnome"),
    ):  # fmt: skip
        z = storey * _STOREY_M
        wide = 3.4 if thing == "planter" else 3.0
        rail = balcony(site, x, y, yaw, z, width_m=wide, depth_m=1.5)
        cx, cy = rail.centroid[:2]
        along = yaw + 90.0 if thing == "bicycle" else yaw
        put(site, thing, float(cx), float(cy), along, "on a balcony above the alley", z=z, solid=False)
    for x, y, yaw, variant in ((-33.0, 3.2, -90.0, "coffee"), (-2.5, 3.2, -90.0, "books"),
        (-6.0, -3.2, 90.0, "games"),
                               (27.5, 10.0, 0.0, "bakery"), (27.5, -8.0, 0.0, "phones"),
                               (18.0, 17.0, 90.0, "flowers")):  # fmt: skip
        place = "in the alley" if x < 10 else "on the street"
        site.place("storefront", x, y, yaw, variant=variant, attributes={"place": place})
    for x, y, yaw, z in (
        (-27.0, 3.2, -90.0, 3.4),
        (-9.2, -3.2, 90.0, 3.6),
        (8.0, 13.6, 180.0, 3.3),
        (2.0, 9.0, 0.0, 3.4),
    ):
        put(site, "shop_sign", x, y, yaw, "over the alley", z=z)
    for x, y, yaw in ((-20.5, -3.2, 90.0), (8.0, 3.8, 180.0), (-9.5, 8.0, 180.0)):
        put(site, "wall_banner", x, y, yaw, "on a wall of the alley", z=4.2)
    put(site, "wall_clock", 2.0, 13.5, 0.0, "on a wall of the alley", z=5.2)
    awning(site, 8.0, 7.8, 180.0, 3.2, "stripes:#2f6f5a")
    awning(site, -24.0, 8.0, 0.0, 4.0, "stripes:#b8322c")
    for x in (-30.0, -16.0, -2.0):
        light_string(site, (x, 3.1), (x + 1.5, -3.1), 5.6)
    light_string(site, (2.1, 17.0), (7.9, 18.0), 5.4)


def _washing(site: Site, count: int) -> None:
    lines = (((-22.0, 3.15), (-22.5, -3.15), 8.2), ((2.05, 12.0), (7.95, 12.4), 7.4), ((-17.95, -12.0),
        (-12.55, -11.6), 6.8),
             ((-6.0, 3.15), (-5.4, -3.15), 7.6), ((2.05, 24.0), (7.0, 28.0), 8.6), ((-17.95, -22.0),
             (-12.55, -22.4), 7.6))  # fmt: skip
    for a, b, z in lines[:count]:
        washing_line(site, a, b, z)


def _on_roofs(site: Site, roofs: dict[str, float]) -> None:
    for category, x, y, house in (
        ("water_tank", -30.0, 24.0, "north-west"), ("satellite_dish", -16.0, 20.0, "north-west"),
        ("satellite_dish", -32.0, 8.5, "west"), ("weather_station", -26.5, 12.5, "west"),
        ("air_conditioner", -4.0, 24.0, "middle"),
        ("topiary", -4.0, 10.0, "middle"), ("rocking_chair", -6.4, 12.6, "middle"),
        ("solar_panels", -28.0, -18.0, "south-west"),
        ("water_tank", -22.5, -8.5, "south-west"), ("beehive", -4.0, -20.0, "south"),
        ("telescope", 3.0, -12.0, "south"), ("clothes_line", 2.0, -22.0, "south"),
        ("air_conditioner", -6.0, -9.0, "south"), ("satellite_dish", 18.0, 9.0, "east"),
        ("satellite_dish", 12.0, 13.5, "east"),
        ("weather_station", 12.0, -11.0, "south-east"), ("billboard", 22.0, -8.0, "south-east"),
    ):  # fmt: skip
        put(
            site,
            category,
            x,
            y,
            30.0 if category != "billboard" else 0.0,
            "on a roof above the alley",
            z=roofs[house],
        )


def _landmarks(site: Site) -> None:
    site.paint(disc(20.5, 24.0, 4.4), "cobbles:#a3988a", 0.12)
    put(site, "obelisk", 20.5, 24.0)
    put(site, "statue", -20.4, 11.2, -60.0)
    site.paint(rectangle(8.1, -30, 30, -15), site.material("square", "paving"), 0.12)
    put(site, "clock_tower", 21.5, -23.5, 0.0)


def _alley_things(site: Site) -> None:
    things = (
        ("dumpster", -12.0, 2.2, -90), ("cardboard_boxes", -14.6, 2.3, 20), ("gas_cylinder_cage", -27.0, -2.4, 90),
        ("crate_stack", -1.0, 2.2, 0), ("bicycle", -23.0, -2.5, 5),
        ("oil_drums", -18.4, 2.4, 0), ("litter_bin", -36.2, -2.4, 90), ("a_board", -36.6, 2.0, -90),
        ("newspaper_box", -29.0, 2.6, -90), ("vending_machine", -8.2, 2.6, -90), ("scooter", 0.2, -2.4, 170),
        ("pallet_stack", 7.1, 2.0, 10), ("litter_bin", 2.9, -2.4, 90), ("cafe_table", 5.8, 7.8, 0),
        ("fox", 4.6, 15.6, 70),
        ("shopping_cart", 3.2, 25.6, 100), ("traffic_cone", 6.8, 22.6, 0), ("cardboard_boxes", 7.2, 27.8, 90),
        ("skip_container", -15.3, -25.4, 90), ("sawhorse", -17.2, -17.5, -90), ("sawhorse", -13.5, -15.0, 60),
        ("wheelbarrow", -14.0, -9.0, -70), ("wheelie_bin", -17.2, -6.4, 0), ("oil_drums", -13.4, -20.0, 0),
        ("dumpster", -13.5, -6.0, 180),
        ("phone_booth", 10.6, -0.9, 90), ("recycling_bin", 16.0, 1.5, -90), ("motorcycle", 21.6, 0.4, 8),
        ("basketball_hoop", -10.6, 9.6, 180), ("bench", -15.4, 6.4, 90), ("bicycle_rack", -12.0, 13.6, -90),
        ("market_stall", -21.0, 5.4, 0),
    )  # fmt: skip
    for category, x, y, yaw in things:
        place = (
            "in the passage under the houses" if 8.5 < x < 27 and abs(y) < 3 else
            "in the back yard" if x < -9 and y > 3.2 else "in the alley"
        )  # fmt: skip
        deal(site, [category], [Pose(x, y, float(yaw))], place)


def _street_things(site: Site) -> None:
    square = [
        "topiary",
        "cafe_table",
        "bench",
        "planter",
        "kiosk",
        "planter",
        "balloon_stand",
        "urban_tree",
        "urban_tree",
    ]
    spots = [(11.0, 20.0, 0), (14.2, 19.4, 0), (15.0, 26.8, -30), (11.0, 27.6, 90), (25.2, 19.6, 90), (24.8, 27.6, 0),
             (16.0, 22.6, 0), (10.0, 24.0, 0), (26.0, 24.0, 0)]  # fmt: skip
    deal(site, square, [Pose(float(x), float(y), float(a)) for x, y, a in spots], "on the little square")
    street = ["street_lamp", "mailbox", "fire_hydrant", "bus_shelter", "parking_meter", "traffic_light", "litter_bin",
              "advertising_column", "street_lamp"]  # fmt: skip
    ys = [-26.0, -12.5, -4.5, 26.0, -18.0, 13.4, 3.2, 21.5, 16.0]
    deal(site, street, [Pose(29.0, y, 0.0) for y in ys], "on the street")
    deal(site, ["delivery_van", "sedan", "motorcycle"], [Pose(31.6, -8.0, -90.0), Pose(34.4, 18.0, 90.0),
        Pose(34.6, -20.0, 90.0)],
         "in the street")  # fmt: skip
    south = ["food_truck", "bench", "picnic_table", "bicycle", "urban_tree", "urban_tree", "ice_cream_cart"]
    spots2 = [(12.5, -19.5, -90), (26.6, -18.4, 0), (13.6, -26.6, 20), (17.0, -17.0, 10), (26.0, -28.0, 0),
              (10.2, -28.0, 0), (26.4, -22.6, 150)]  # fmt: skip
    deal(site, south, [Pose(float(x), float(y), float(a)) for x, y, a in spots2], "in the yard by the street")
