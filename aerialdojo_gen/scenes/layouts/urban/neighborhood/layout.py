"""A neighbourhood: detached houses about a turning circle, or brick semis along a lane with a green.

North is +y.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle
from aerialdojo_gen.scenes.grammar_props import deal, put
from aerialdojo_gen.scenes.grammar_scatter import Pose, smooth_path
from aerialdojo_gen.scenes.grammar_streets import crossing, streets
from aerialdojo_gen.scenes.ground import disc, rectangle
from aerialdojo_gen.scenes.kit.structures import Parts, block, canopy
from aerialdojo_gen.scenes.layouts.urban.neighborhood.houses import (
    Lot,
    back_garden,
    enclose,
    front_garden,
    in_drive,
    on_garage,
    on_porch,
    settle,
    tree_line,
    winding_path,
)
from aerialdojo_gen.scenes.site import Site


class Parameters(BaseModel):
    """What a recipe may choose.

    Attributes
    ----------
    plan : str
        `X.
    tree_every_m : float
        Spacing of the trees along the street.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    plan: Literal["turning_circle", "green"] = "turning_circle"
    tree_every_m: float = Field(default=9.0, gt=3.0, le=500.0)


def build(site: Site) -> None:
    """Build the neighbourhood."""
    parameters: Parameters = site.parameters
    if parameters.plan == "green":
        _green(site, parameters.tree_every_m)
    else:
        _turning_circle(site, parameters.tree_every_m)


def _turning_circle(site: Site, tree_every_m: float) -> None:
    site.set_ground(material=site.material("lawn", "grass"))
    streets(site, [[(-44, -31.5), (44, -31.5)]], pavement_m=1.6)
    site.paint(disc(0, 11, 11.2), "paving", 0.12)
    streets(site, [[(0, -30), (0, 8)]], pavement_m=1.6, marks=False)
    site.paint(disc(0, 11, 9.4), "asphalt")
    site.paint(rectangle(-3.25, -34, 3.25, -26), "asphalt")
    site.paint(disc(0, 11, 3.4), site.material("lawn", "grass"), 0.12)
    crossing(site, 0, -26.6, 0, 6.4, 2.4)
    lots = _suburban_lots()
    for lot in lots:
        settle(site, lot)
    gardens = (
        ["trampoline", "garden_swing", "barbecue", "lawn_mower", "birdhouse", "clothes_line"],
        ["swing_set", "hammock", "dog_house", "topiary", "water_barrel", "bird_bath"],
        ["playground_slide", "sandbox", "seesaw", "garden_gnome", "rocking_chair"],
        ["pergola", "garden_gnome", "birdhouse", "telescope", "bird_bath"],
        ["woodshed", "axe_block", "garden_shed", "wheelbarrow", "wheelbarrow"],
        ["above_ground_pool", "barbecue", "clothes_line", "rope_swing", "mountain_bike"],
        ["dome_tent", "rabbit_hutch", "greenhouse", "campfire", "canoe", "picnic_table"],
    )
    fronts = (["bird_bath", "mailbox", "planter"], ["garden_gnome", "mailbox",
        "bicycle"], ["topiary", "mailbox"],
              ["planter", "mailbox", "bench"], ["weather_station", "mailbox"], ["topiary",
              "wheelie_bin", "scooter"],
              ["flagpole", "wheelie_bin", "mountain_bike"])  # fmt: skip
    cars = ("sedan", "pickup_truck", "suv", "hatchback", "delivery_van", "golf_cart", "sedan")
    for k, lot in enumerate(lots):
        enclose(site, lot, "picket" if k % 2 == 0 else "hedge", "board")
        back_garden(site, lot, gardens[k], ["urban_tree", "oak_tree"] if k % 2 else ["birch_tree", "urban_tree"])
        front_garden(site, lot, fronts[k])
        if lot.style.porch_m:
            on_porch(site, lot, ["rocking_chair", "planter"] if k % 2 else ["bench", "planter"])
        if lot.style.garage:
            in_drive(site, lot, cars[k])
            on_garage(site, lot, ("solar_panels", "satellite_dish", "air_conditioner")[k % 3])
    put(site, "water_tower", 33.0, 32.0)
    put(site, "treehouse", -34.5, 32.0, -45.0)
    put(site, "oak_tree", 0.0, 11.0)
    kerb = ["fire_hydrant", "street_lamp", "litter_bin", "recycling_bin", "street_lamp", "dumpster", "parking_meter"]
    spots = [(-4.2, -21.0, 0.0), (4.2, -9.5, 180.0), (-4.2, -5.0, 0.0), (9.4, 4.0, 140.0), (-9.2, 15.5, -30.0),
             (-5.6, -25.8, 90.0), (4.3, -23.0, 180.0)]  # fmt: skip
    deal(site, kerb, [Pose(*s) for s in spots], "at the kerb")
    deal(site, ["ice_cream_cart", "motorcycle", "basketball_hoop"],
         [Pose(4.6, 15.6, -120.0), Pose(-6.4, 8.2, 60.0),
         Pose(-2.4, -13.0, -90.0)], "in the turning circle")  # fmt: skip
    stop = ["bus_shelter", "stop_sign", "newspaper_box", "phone_booth", "direction_sign"]
    deal(site, stop, [Pose(x, -27.3, -90.0) for x in (14.0, 5.4, 18.6, 21.0, -8.0)], "along the main road")
    put(site, "city_bus", 16.0, -30.0, 180.0, "at the bus stop")
    verge = [(x, -38.2) for x in range(-36, 40, int(tree_every_m))]
    tree_line(site, verge, ["urban_tree", "birch_tree"])
    tree_line(site, [(-37.5, -8.0), (-37.5, 13.0), (37.5, -9.0), (37.0, 8.0)], ["spruce_tree", "oak_tree"])


def _suburban_lots() -> list[Lot]:
    style = HouseStyle
    clap, tile = "planks", "shingles"
    yellow = style(width_m=9.4, wall=f"{clap}:#e0c678", roof=f"{tile}:#6b5a50", porch_m=2.2, garage=1)
    blue = style(width_m=8.8, wall=f"{clap}:#7f9fb8", roof=f"{tile}:#4f565e", door="#d9a62e", garage=-1)
    white = style(
        width_m=9.0, depth_m=7.6, wall=f"{clap}:#ece8dc", roof=f"{tile}:#7a4038", porch_m=2.0, door="#2f6f5a"
    )
    green = style(width_m=11, depth_m=8.4, wall=f"{clap}:#8fa383", roof=f"{tile}:#5a5550", roof_kind="hip",
        roof_m=2.9,
                  porch_m=2.4)  # fmt: skip
    brick = style(width_m=9.0, wall="brick:#a85f48", roof=f"{tile}:#57504a", roof_m=3.2, door="#26364f")
    grey = style(width_m=8.8, wall=f"{clap}:#a5a8a6", roof=f"{tile}:#3f4448", door="#b8452e", porch_m=2.0, garage=1)
    red = style(width_m=9.2, storeys=1, depth_m=9.0, wall=f"{clap}:#a4493c", roof=f"{tile}:#4d4742", roof_m=3.0,
                porch_m=2.2, garage=-1)  # fmt: skip
    return [
        Lot(Frame(-15.6, -19.5, 0.0), yellow, "yellow house", 6.2, 9.5, 8.3),
        Lot(Frame(-15.8, -1.8, 0.0), blue, "blue house", 6.2, 9.5, 8.4),
        Lot(Frame(-21.0, 20.0, -22.0), white, "white house", 5.0, 8.0, 7.0),
        Lot(Frame(0.0, 27.2, -90.0), brick, "brick house", 3.4, 5.0, 8.0),
        Lot(Frame(21.4, 16.5, 195.0), green, "green house", 5.2, 6.0, 6.9),
        Lot(Frame(16.2, -2.4, 180.0), grey, "grey house", 6.4, 9.5, 8.4),
        Lot(Frame(16.0, -19.6, 180.0), red, "red house", 6.0, 9.5, 8.2),
    ]


def _green(site: Site, tree_every_m: float) -> None:
    site.set_ground(material=site.material("lawn", "grass"))
    streets(site, [[(-44, -5), (44, -5)], [(1, -5), (1, 37)]], lane_m=2.75, pavement_m=1.7,
            surface=site.material("street", "asphalt:#66625e"), pavement=site.material("pavement",
                "cobbles"))  # fmt: skip
    crossing(site, -8, -5, 90, 5.4, 2.4)
    crossing(site, 1, 4, 0, 5.4, 2.4)
    lots = _village_lots()
    for lot in lots:
        settle(site, lot, drive="cobbles", path="paving:#b89a80")
    gardens = (
        ["garden_shed", "planter", "lawn_mower", "clothes_line", "topiary", "garden_gnome"],
        ["trampoline", "water_barrel", "beehive", "rabbit_hutch", "bird_bath", "barbecue"],
        ["swing_set", "cafe_table", "dog_house", "hammock", "wheelbarrow", "sandbox"],
        ["pergola", "rocking_chair", "telescope", "birdhouse", "garden_gnome", "seesaw"],
        ["playground_slide", "picnic_table", "greenhouse", "dog_house", "barbecue", "clothes_line"],
        ["garden_swing", "water_barrel", "bird_bath", "carved_owl", "lawn_mower", "wheelbarrow"],
        ["bird_bath"],
    )
    fronts = (["planter", "mailbox", "bench"], ["topiary", "mailbox"], ["planter", "mailbox",
        "bicycle"],
              ["bird_bath", "wheelie_bin"], ["planter", "wheelie_bin", "scooter"], ["topiary",
              "mailbox"],
              ["planter", "bird_bath", "bicycle"])  # fmt: skip
    cars = ("hatchback", "sedan", "pickup_truck", "hatchback", "suv", "delivery_van", "sedan")
    for k, lot in enumerate(lots):
        enclose(site, lot, ("wall", "hedge", "railing")[k % 3], "hedge" if k % 2 else "board")
        back_garden(site, lot, gardens[k], ["urban_tree"])
        front_garden(site, lot, fronts[k])
        if lot.style.garage:
            in_drive(site, lot, cars[k])
            on_garage(site, lot, ("satellite_dish", "solar_panels", "weather_station")[k % 3])
    _village_green(site)
    _lane_garages(site)
    _paddock(site)
    kerb = ["litter_bin", "litter_bin", "parking_meter", "litter_bin", "recycling_bin", "fire_hydrant", "phone_booth",
            "direction_sign", "advertising_column", "bus_shelter", "newspaper_box", "traffic_light"]  # fmt: skip
    spots = [(-34.0, -1.2, -90.0), (-20.5, -1.2, -90.0), (-13.0, -8.9, 90.0), (5.2, -8.9, 90.0), (-26.5, -8.9, 90.0),
             (12.5, -1.3, -90.0), (5.6, 0.4, 200.0), (-2.9, 0.2, -45.0), (33.5, -0.4, -90.0), (22.0, -1.4, -90.0),
             (27.0, -1.2, -90.0), (-5.0, -1.2, -90.0)]  # fmt: skip
    deal(site, kerb, [Pose(*s) for s in spots], "at the kerb")
    parked = ["sedan", "motorcycle", "hatchback", "box_truck", "scooter"]
    deal(site, parked, [Pose(-29.0, -6.6, 0.0), Pose(-17.0, -3.4, 180.0), Pose(13.0, -6.6, 0.0),
                        Pose(27.0, -3.6, 180.0), Pose(-0.5, 20.0, -90.0)], "in the street")  # fmt: skip
    step = int(tree_every_m)
    tree_line(site, [(x, -31.0) for x in range(-36, 39, step)], ["urban_tree", "oak_tree"])
    tree_line(site, [(-37.5, y) for y in range(0, 30, step)], ["birch_tree", "urban_tree"])


def _village_green(site: Site) -> None:
    for path in ([(7, 2), (12, 9), (20.5, 13.5)], [(36.5, 3), (28, 9), (20.5, 13.5)], [(20.5, 13.5), (18, 22),
        (9, 29)],
                 [(20.5, 13.5), (29, 21), (35, 30)]):  # fmt: skip
        winding_path(site, smooth_path(path), 1.7, "gravel:#c9b893")
    site.paint(disc(20.5, 13.5, 6.6), "paving:#bfae96", 0.02)
    put(site, "fountain", 20.5, 13.5)
    put(site, "clock_tower", 33.5, 27.0, 200.0)
    shelter: Parts = canopy(8.2, 20.2, 14.0, 26.2, 2.9, roof="roof_tiles:#8a4d3a", post="wood",
                            posts=[(x, y) for x in (8.6, 13.6) for y in (20.6, 25.8)])  # fmt: skip
    shelter.append(("boards:#8d6f4c", block(8.2, 26.0, 14.0, 26.2, 0.0, 2.9)))
    site.add("market_hall", "market_hall", shelter, {"place": "on the green"})
    deal(site, ["market_stall"], [Pose(11.2, 23.6, -90.0)], "under the roof on the green")
    things = ["bench", "litter_bin", "stage", "statue", "kiosk", "ice_cream_cart", "planter", "information_board",
              "topiary", "cafe_table", "picnic_table", "planter", "market_stall", "a_board",
              "bicycle_rack"]  # fmt: skip
    spots = [(14.0, 16.5, -20.0), (26.0, 18.2, 200.0), (25.0, 26.8, -110.0), (33.4, 13.0, 180.0), (10.2, 13.8, 0.0),
             (25.2, 6.6, 120.0), (13.5, 7.2, 60.0), (8.0, 8.0, -60.0), (31.0, 19.6, 30.0), (32.0, 8.6, 120.0),
             (18.4, 28.6, 0.0), (20.8, 5.2, 90.0), (7.2, 16.8, 0.0), (15.6, 20.2, 0.0),
             (29.6, 3.6, 90.0)]  # fmt: skip
    keep = [(c, s) for c, s in zip(things, spots, strict=True) if c != "statue"]
    for category, spot in keep:
        deal(site, [category], [Pose(*spot)], "on the green")
    tree_line(site, [(7.5, 30.0), (29.0, 30.4), (37.4, 20.0), (37.4, 8.0), (28.0, 12.4), (15.0, 11.6)],
              ["urban_tree", "oak_tree", "urban_tree"])  # fmt: skip


def _paddock(site: Site) -> None:
    """Fill the plot behind the dark brick house: hay, a tractor, boats on trestles, a skip."""
    site.paint(rectangle(-18.6, 19.0, -6.4, 36.0), "dirt")
    things = ["tractor", "hay_bales", "skip_container", "mountain_bike", "log_pile", "canoe", "sawhorse", "oil_drums",
              "cardboard_boxes", "basketball_hoop", "stone_well", "quad_bike"]  # fmt: skip
    spots = [(-9.4, 22.0, 100), (-16.6, 21.4, 0), (-14.6, 33.8, 0), (-16.8, 27.0, 90), (-12.4, 20.4, 0),
        (-14.8, 27.0, 90),
             (-8.4, 27.0, 180), (-10.6, 34.2, 0), (-8.2, 31.0, 30), (-18.0, 31.0, -45), (-11.8, 28.0, 0),
             (-12.6, 24.0, 60)]  # fmt: skip
    deal(site, things, [Pose(float(x), float(y), float(a)) for x, y, a in spots], "in the paddock")
    more = ["food_truck", "photo_booth", "flagpole", "golf_cart", "vending_machine", "atm_kiosk"]
    spots = [
        (35.5, -0.6, 180),
        (16.6, 33.0, -90),
        (30.4, 33.4, -90),
        (-37.8, -8.9, 90),
        (10.6, 34.0, -90),
        (14.0, 0.6, 200),
    ]
    deal(site, more, [Pose(float(x), float(y), float(a)) for x, y, a in spots], "by the green")


def _lane_garages(site: Site) -> None:
    """Build a passage house over the lane's end: the lane runs on under it."""
    site.paint(rectangle(-3.3, 25, 5.3, 37), site.material("street", "asphalt:#66625e"))
    wall = "brick:#8f5a46"
    parts: Parts = [
        (wall, block(-4.6, 26.0, -2.4, 31.4, 0.0, 3.4)),
        (wall, block(4.4, 26.0, 6.6, 31.4, 0.0, 3.4)),
        ("facade_brick:#8f5a46", block(-4.6, 26.0, 6.6, 31.4, 3.4, 6.4)),
        ("concrete", block(-4.8, 25.8, 6.8, 31.6, 3.3, 3.45)),
        ("roof_tiles:#6f4a3c", block(-4.9, 25.7, 6.9, 31.7, 6.4, 6.6)),
    ]
    site.add("gate_house", "gate_house", parts, {"place": "over the lane"}, footprint=rectangle(-4.6, 26, -2.4, 31.4))
    site.occupy(rectangle(4.4, 26.0, 6.6, 31.4))
    put(site, "planter", 3.2, 28.4, 180.0, "in the passage under the gate house", z=0.0)
    put(site, "bicycle", -1.7, 29.2, 90.0, "in the passage under the gate house", z=0.0)
    put(site, "solar_panels", 1.0, 28.6, -90.0, "on the gate house", z=6.6)


def _village_lots() -> list[Lot]:
    style = HouseStyle
    tiles, hip = "roof_tiles", "hip"
    one = style(width_m=8.0, depth_m=7.4, wall="brick:#9c5646", roof=f"{tiles}:#7a4638", roof_kind=hip, garage=1)
    two = style(width_m=8.0, depth_m=7.4, wall="plaster:#e6d9bd", roof=f"{tiles}:#a45a40", garage=-1, door="#2f5f9e")
    three = style(width_m=9.0, depth_m=7.4, storeys=2, wall="brick:#b98a6a", roof=f"{tiles}:#5f4a44", roof_m=3.4)
    four = style(width_m=8.0, depth_m=7.2, wall="plaster:#c9a9a0", roof=f"{tiles}:#7a4638", roof_kind=hip, garage=1)
    five = style(width_m=8.2, depth_m=7.4, wall="plaster:#b8c4b0", roof=f"{tiles}:#8a5040", garage=-1, door="#6a3f2a")
    six = style(
        width_m=8.4, depth_m=7.4, wall="brick:#7f4f48", roof=f"{tiles}:#4f4644", roof_kind=hip, door="#e2ded0"
    )
    seven = style(width_m=8.0, depth_m=7.2, wall="plaster:#d8b878", roof=f"{tiles}:#9a5540", garage=1, door="#39513f")
    return [
        Lot(Frame(-28.5, -16.8, 90.0), one, "red brick house", 4.2, 8.0, 7.9),
        Lot(Frame(-11.0, -16.8, 90.0), two, "cream house", 4.2, 8.0, 8.0),
        Lot(Frame(7.6, -16.8, 90.0), three, "tan brick house", 4.2, 8.0, 8.2),
        Lot(Frame(26.0, -16.8, 90.0), four, "pink house", 4.2, 8.0, 8.2),
        Lot(Frame(-28.0, 7.2, -90.0), five, "green house", 4.4, 7.0, 8.2),
        Lot(Frame(-11.4, 7.0, -90.0), six, "dark brick house", 4.2, 7.0, 7.2),
        Lot(Frame(-27.0, 27.4, -90.0), seven, "ochre house", 3.0, 0.9, 8.0),
    ]
