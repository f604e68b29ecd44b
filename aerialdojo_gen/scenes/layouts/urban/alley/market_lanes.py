"""The lanes of an old market town: plastered houses with shutters, a piazza, archways, stalls and awnings."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_props import deal, put
from aerialdojo_gen.scenes.grammar_scatter import Pose
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, canopy, deck
from aerialdojo_gen.scenes.layouts.urban.alley.walls import (
    Box,
    awning,
    balcony,
    light_string,
    passage_house,
    town_house,
    washing_line,
)
from aerialdojo_gen.scenes.site import Site

_STOREY_M = 3.0
_ARCADE_M = 3.6
_HOUSES: dict[str, tuple[Box, int, str, str]] = {
    "a": ((-37, 2.5, -24, 15.9), 3, "#e0c9a0", "hip"),
    "b": ((-37, 16, -24, 32), 2, "#d8a878", "gable"),
    "c": ((-37, -16, -24, -2.5), 2, "#c98f78", "flat"),
    "d": ((-37, -32, -24, -16.1), 3, "#e6d8b8", "hip"),
    "e": ((-19.5, 2.5, -8, 11.9), 2, "#d9b98a", "flat"),
    "f": ((-19.5, 12, -2, 32), 3, "#c9785f", "hip"),
    "g": ((-19.5, -32, 2, -10.1), 3, "#e3cfae", "gable"),
    "h": ((-19.5, -10, -8, -2.5), 2, "#b8c0a8", "flat"),
    "i": ((3, 12.1, 11.9, 32), 3, "#e0b878", "gable"),
    "j": ((12, 7, 24, 32), 2, "#d8cbb0", "flat"),
    "k": ((24.1, 7, 37, 18.9), 3, "#c98a6a", "hip"),
    "l": ((24.1, 19, 37, 32), 2, "#e6dcc2", "gable"),
    "m": ((7, -32, 19.9, -10.1), 2, "#cfa07a", "flat"),
    "n": ((10, -10, 19.9, 2), 3, "#e3c690", "hip"),
    "o": ((20, -32, 37, -16.1), 3, "#d0b49a", "gable"),
    "p": ((31, -16, 37, 2), 2, "#b9886c", "flat"),
}


def build_lanes(site: Site, washing_lines: int) -> None:
    """Build the market lanes; at most six lines of washing hang across them."""
    site.set_ground(material=site.material("lanes", "cobbles:#a09484"))
    site.paint(rectangle(-8, -10, 12, 12), site.material("piazza", "paving:#cdb898"))
    site.paint(disc(1.4, 1.4, 6.2), "tiles:#c9a98a")
    site.paint(rectangle(20, -16, 31, -4), "tiles:#bf9070")
    tops = _houses(site)
    _arcade(site)
    _on_walls(site)
    _across(site, washing_lines)
    _on_roofs(site, tops)
    put(site, "fountain", 1.4, 1.4)
    put(site, "clock_tower", 25.6, -12.0, 90.0)
    _stalls(site)
    _lane_things(site)


def _houses(site: Site) -> dict[str, float]:
    tiles = site.material("roof", "roof_tiles:#b8643f")
    tops = {
        name: town_house(
            site, outline, storeys, f"shutters:{tint}", "tiles:#b08a70" if kind == "flat" else tiles, kind=kind
        )
        for name, (outline, storeys, tint, kind) in _HOUSES.items()
    }
    tops["arch"] = passage_house(site, (20, -4, 30.9, 2), (23.5, -4.1, 27.5, 2.1), 3.6, 1, "shutters:#d8a888",
                                 "plaster:#c99a7a", "tiles:#b08a70")  # fmt: skip
    tops["lane arch"] = passage_house(site, (-24, 20, -19.5, 27), (-24.1, 19.9, -19.4, 27.1),
        3.8, 1, "shutters:#e0c9a0",
                                      "plaster:#c99a7a", "tiles:#b08a70")  # fmt: skip
    return tops


def _arcade(site: Site) -> None:
    """Build an arcade with a terrace on top along the piazza's south-west corner."""
    posts = [(-7.6 + 3.2 * k, -6.3) for k in range(3)] + [(-4.4, y) for y in (-9.6,)]
    parts: Parts = deck(rectangle(-8, -10.0, -0.4, -6.0), _ARCADE_M, floor="tiles:#c9a98a", under="plaster:#e6d8b8",
                        posts=posts, post="stone", post_radius_m=0.3)  # fmt: skip
    site.add("arcade", "arcade", parts, {"place": "on the piazza"})
    for category, x, y in (("topiary", -5.8, -8.0), ("cafe_table", -2.6, -8.0), ("planter", -7.3, -6.7)):
        put(site, category, x, y, 0.0, "on the terrace over the arcade", z=_ARCADE_M)
    deal(site, ["bench", "a_board", "newspaper_box"], [Pose(-7.0, -8.6, 0.0), Pose(-3.0, -7.2, 90.0),
        Pose(-0.9, -9.2, 180.0)],
         "under the arcade")  # fmt: skip
    roof = canopy(4.0, -8.8, 9.6, -4.0, 3.1, roof="stripes:#2f6f8f", post="wood", posts=[(4.3, -8.5), (9.3, -8.5),
        (4.3, -4.3), (9.3, -4.3)])  # fmt: skip
    site.add("market_roof", "canopy", roof, {"place": "on the piazza"})


def _on_walls(site: Site) -> None:
    for x, y, yaw, variant in (
        (-30.0, 2.5, -90.0, "bakery"), (-14.0, 2.5, -90.0, "fashion"), (-13.5, -2.5, 90.0, "shoes"),
        (-30.5, -2.5, 90.0, "flowers"), (10.0, -4.0, 180.0, "books"), (17.8, 7.0, -90.0, "coffee"),
        (30.5, 7.0, -90.0, "jewels"), (14.8, 2.0, 90.0, "pharmacy"), (-5.0, 12.0, -90.0, "toys"),
        (3.0, 21.0, 180.0, "sport"),
    ):  # fmt: skip
        site.place("storefront", x, y, yaw, variant=variant, attributes={"place": "in the market lanes"})
    for x, y, yaw, storey, thing in (
        (-24.0, 8.0, 0.0, 1, "planter"), (-24.0, -9.0, 0.0, 1, "planter"),
        (-19.5, 16.0, 180.0, 2, "rocking_chair"),
        (-2.0, 18.0, 0.0, 1, "topiary"), (3.0, 27.0, 180.0, 2, "planter"), (-8.0, 6.6, 0.0, 1, "cafe_table"),
        (2.0, -16.0, 0.0, 2, "rocking_chair"), (7.0, -21.0, 180.0, 1, "bicycle"), (10.0, -1.6, 180.0, 2, "topiary"),
        (31.0, -10.0, 180.0, 1, "planter"), (25.2, -16.1, 90.0, 2, "bird_bath"), (22.4, 7.0, -90.0, 1, "telescope"),
        (-19.5, -22.0, 180.0, 1, "rocking_chair"),
    ):  # fmt: skip
        z = storey * _STOREY_M
        depth = 2.4 if thing in ("cafe_table",) else 1.4
        rail = balcony(site, x, y, yaw, z, width_m=3.4 if thing == "planter" else 2.8, depth_m=depth, rail="#3a4a44")
        cx, cy = rail.centroid[:2]
        put(site, thing, float(cx), float(cy), yaw + (90.0 if thing == "bicycle" else 0.0),
            "on a balcony over the lanes",
            z=z, solid=False)  # fmt: skip
    for x, y, yaw in (
        (-24.0, 4.0, 0.0),
        (-19.5, -6.0, 180.0),
        (-2.0, 14.0, 0.0),
        (7.0, -14.0, 180.0),
        (28.0, 2.0, 90.0),
    ):
        put(site, "shop_sign", x, y, yaw, "over the lanes", z=3.2)
    for x, y, yaw in ((12.0, 10.0, 180.0), (2.0, -25.0, 0.0), (-24.0, -24.0, 0.0)):
        put(site, "wall_banner", x, y, yaw, "on a wall of the lanes", z=2.6)
    put(site, "wall_clock", -8.0, 3.4, 0.0, "above the piazza", z=4.4)
    cloths = ("stripes:#b8322c", "stripes:#2f6f5a", "fabric:#d9a441", "stripes:#3f6fa8")
    for k, (x, y, yaw) in enumerate(((-24.0, 12.0, 0.0), (-19.5, -14.0, 180.0), (-2.0, 24.0, 0.0), (3.0, 15.4, 180.0),
                                     (2.0, -20.5, 0.0), (33.5, 7.0, -90.0), (-8.0, 9.6, 0.0))):  # fmt: skip
        awning(site, x, y, yaw, 3.0, cloths[k % 4])


def _across(site: Site, count: int) -> None:
    lines = (((-23.95, 10.0), (-19.55, 10.3), 5.4), ((-1.95, 20.5), (2.95, 20.2), 7.4), ((2.05, -18.5),
        (6.95, -18.9), 5.4),
             ((-23.95, -12.0), (-19.55, -12.4), 5.4), ((30.0, 6.95), (30.3, 2.05), 5.2), ((-1.95, 28.0),
             (2.95, 28.4), 6.6))  # fmt: skip
    for a, b, z in lines[:count]:
        washing_line(site, a, b, z)
    for a, b, z in (((-7.95, 6.0), (11.95, 9.0), 6.4), ((-7.95, -4.0), (9.95, -6.0), 6.2), ((-12.0, 2.45),
        (-11.5, -2.45), 5.0),
                    ((16.0, 6.95), (16.5, 2.05), 5.2)):  # fmt: skip
        light_string(site, a, b, z)


def _on_roofs(site: Site, tops: dict[str, float]) -> None:
    for category, x, y, house in (
        ("satellite_dish", -31.0, -12.0, "c"), ("topiary", -29.0, -6.0, "c"), ("rocking_chair", -32.4, -6.2, "c"),
        ("clothes_line", -34.0, -10.0, "c"), ("bird_bath", -26.4, -13.6, "c"),
        ("water_tank", -11.0, 6.0, "e"), ("planter", -15.5, 9.5, "e"), ("solar_panels", 18.0, 22.0, "j"),
        ("gazebo", 18.0, 13.0, "j"), ("planter", 14.2, 28.0, "j"), ("air_conditioner", 13.5, -26.0, "m"),
        ("topiary", 12.0, -15.0, "m"), ("beehive", 16.4, -19.0, "m"), ("rabbit_hutch", 8.6, -30.0, "m"),
        ("hammock", 17.0, -12.5, "m"), ("garden_swing", 22.0, 27.0, "j"), ("water_barrel", 22.8, 9.0, "j"),
        ("birdhouse", 13.4, 9.0, "j"), ("garden_gnome", 22.6, 20.0, "j"), ("trampoline", 14.6, 18.0, "j"),
        ("barbecue", -17.6, 4.4, "e"), ("dog_house", -35.0, -4.6, "c"), ("weather_station", -18.4, -9.0, "h"),
        ("telescope", 33.0, 0.6, "p"), ("birdhouse", 22.0, 0.2, "arch"), ("pergola", 15.0, -28.6, "m"),
        ("barbecue", 9.0, -22.0, "m"), ("bird_bath", -12.0, -6.0, "h"),
        ("cafe_table", -16.0, -6.4, "h"), ("weather_station", 34.0, -4.0, "p"), ("satellite_dish", 34.0, -11.0, "p"),
        ("satellite_dish", 28.0, -1.0, "arch"), ("topiary", -21.7, 23.5, "lane arch"),
    ):  # fmt: skip
        put(site, category, x, y, 200.0, "on a roof terrace", z=tops[house])


def _stalls(site: Site) -> None:
    piazza = ["market_stall", "market_stall", "ice_cream_cart", "kiosk", "market_stall", "bench", "planter",
        "phone_booth",
              "balloon_stand", "food_truck", "bicycle_rack", "litter_bin", "information_board"]  # fmt: skip
    spots = [(-4.4, 8.6, -45), (6.7, -6.4, 90), (8.6, 6.4, 200), (8.2, 9.8, -90), (-5.6, 1.8, 0), (-3.4, -3.4, 45),
        (6.6, -2.6, 135),
             (11.0, 3.2, 180), (3.2, 8.8, -90), (-3.0, 14.0, 90), (-6.6, -1.4, 0), (0.4, 10.6, -90),
             (-6.2, 5.0, 0)]  # fmt: skip
    deal(site, piazza, [Pose(float(x), float(y), float(a)) for x, y, a in spots], "on the piazza")


def _lane_things(site: Site) -> None:
    things = (
        ("bicycle", -33.6, -1.9, 4), ("cafe_table", -34.8, 1.0, 0), ("planter", -26.0, 1.9, 0),
        ("scooter", -18.0, 1.8, 0),
        ("clothes_rack", -17.5, -1.7, 90), ("a_board", -10.0, 1.7, -90), ("litter_bin", -9.4, -1.8, 90),
        ("water_barrel", -23.3, 18.4, 0), ("bicycle", -20.2, 29.4, 90), ("cardboard_boxes", -23.0, 25.0, 0),
        ("market_stall", -21.7, 14.0, 90), ("wheelbarrow", -20.4, -8.0, 80), ("oil_drums", -23.4, -6.0, 0),
        ("motorcycle", -20.3, -18.6, 90), ("wheelie_bin", -23.0, -28.8, 0), ("crate_stack", -23.3, -19.0, 90),
        ("pallet_stack", -20.4, -25.0, 0),
        ("litter_bin", -22.0, 0.0, 0), ("litter_bin", 0.4, 16.0, 90), ("newspaper_box", -1.4, 22.4, 0),
        ("vending_machine", 2.4, 29.6, 180),
        ("shopping_cart", -0.9, 30.4, 60), ("clothes_rack", 2.1, 24.4, 90), ("market_stall", 4.5, -13.2, 90),
        ("scooter", 6.3, -17.0, 95), ("litter_bin", 2.6, -22.6, 0), ("fox", 4.8, -26.0, 80),
        ("recycling_bin", 6.3, -29.0, 180),
        ("mailbox", 13.0, 6.3, -90), ("bench", 21.0, 2.6, 90), ("market_stall", 33.6, 4.6, 180),
        ("planter", 26.0, 5.9, 0),
        ("a_board", 12.2, 3.2, 160), ("bicycle", 28.6, 6.3, 0), ("stone_well", 22.6, -7.0, 0),
        ("topiary", 29.0, -6.0, 0),
        ("picnic_table", 29.2, -8.6, 90), ("topiary", 20.8, -15.2, 0), ("rocking_chair", 30.0, -14.6, 120),
        ("urban_tree", 21.8, -11.0, 0), ("water_barrel", 23.9, -1.0, 0), ("motorcycle", 26.6, -0.4, 88),
    )  # fmt: skip
    for category, x, y, yaw in things:
        place = (
            "in the courtyard"
            if x > 20 and y < -4
            else "in the archway"
            if x > 23 and y < 2
            else "in the market lanes"
        )
        deal(site, [category], [Pose(x, y, float(yaw))], place)
