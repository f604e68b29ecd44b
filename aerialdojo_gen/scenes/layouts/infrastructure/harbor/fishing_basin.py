"""A fishing basin: jetties with boats, the fish hall with its canopy, nets and crates, a café on the front."""

from __future__ import annotations

from aerialdojo_gen.scenes.grammar_frames import Frame
from aerialdojo_gen.scenes.grammar_houses import HouseStyle, house
from aerialdojo_gen.scenes.grammar_props import put
from aerialdojo_gen.scenes.ground import rectangle
from aerialdojo_gen.scenes.layouts.infrastructure.harbor.quays import QUAY_M, hall, jetty, lay, open_shed, set_out
from aerialdojo_gen.scenes.site import Site

_SOUTH = -90.0


def build_fishing_basin(site: Site) -> None:
    """Build it in the east, its mouth to the south."""
    front = rectangle(70.6, -5.4, 79.4, 74.0).union(rectangle(79.4, 34.6, 124.4, 74.0))
    front = front.union(rectangle(112.6, -51.4, 124.4, 34.6))
    lay(site, front, site.material("front", "cobbles:#928a7e"))
    lay(site, rectangle(82.0, 52.0, 124.0, 57.0), "asphalt")
    for x in (88.4, 103.6):
        jetty(site, (x, 34.0), (x, 8.0), 2.6, 1.3)
    jetty(site, (112.0, 4.0), (104.0, 4.0), 2.2, 1.0)
    _boats(site)
    _hall(site)
    _front(site)
    _east_quay(site)


def _boats(site: Site) -> None:
    afloat = (
        ("fishing_boat", 85.0, 24.0, 90.0, "blue"), ("fishing_boat", 92.0, 27.0, -90.0, "red"),
        ("fishing_boat", 92.0, 14.6, 90.0, "white"), ("fishing_boat", 100.2, 25.6, 90.0, "green"),
        ("sailboat", 107.4, 26.0, -90.0, "blue_furled"), ("sailboat", 106.8, 15.0, 90.0, "wooden_furled"),
        ("motor_yacht", 83.2, 9.0, -90.0, "white"), ("motor_yacht", 99.8, 12.0, -90.0, "wooden"),
        ("rowing_boat", 86.0, 31.0, 70.0, "red_oars_in"), ("rowing_boat", 96.6, 31.4, 10.0, "wooden"),
        ("rowing_boat", 108.6, 1.8, 0.0, "green"), ("rowing_boat", 96.2, 22.0, 80.0, "blue_oars_out"),
        ("fishing_boat", 109.6, -5.0, 90.0, "red"), ("tugboat", 83.8, -7.0, 90.0, "green_orange"),
        ("tugboat", 107.8, -17.6, -90.0, "blue_yellow"), ("sailboat", 109.4, -30.0, 90.0, "red_sails"),
        ("buoy", 96.0, -4.0, 0.0, "red_can"), ("canoe", 110.2, 9.0, 80.0, "red"),
    )  # fmt: skip
    for category, x, y, yaw, variant in afloat:
        place = "in the fishing basin" if y > -3.0 else "at the mouth of the fishing basin"
        put(site, category, x, y, yaw, place, z=0.0, variant=variant)
    put(site, "fish_crates", 88.4, 11.6, 90.0, "on a jetty of the fishing basin", z=1.3)
    put(site, "mooring_bollard", 103.6, 10.4, 90.0, "on a jetty of the fishing basin", z=1.3)
    put(site, "lifebuoy_stand", 103.8, 20.0, 180.0, "on a jetty of the fishing basin", z=1.3)


def _hall(site: Site) -> None:
    roof = hall(site, 84.0, 57.0, 110.0, 70.0, 6.4, wall=site.material("fish_hall", "brick:#94513f"),
                roof="corrugated:#6f8a8c", doors="sheet_metal:#2f5a6a", name="FISH MARKET")  # fmt: skip
    for category, x, y in (
        ("air_conditioner", 90.0, 63.0),
        ("satellite_dish", 86.4, 67.4),
        ("solar_panels", 98.6, 64.0),
        ("water_tank", 106.6, 66.6),
    ):
        put(site, category, x, y, -90.0, "on the roof of the fish hall", z=roof)
    open_shed(site, 84.0, 40.0, 108.0, 50.0, 3.8, "corrugated:#5a7a86")
    set_out(site, [
        ("fish_crates", 87.0, 46.6, -90.0), ("fish_crates", 93.6, 42.6, 180.0), ("fish_crates", 104.6, 46.8, 20.0),
        ("forklift", 98.4, 45.4, 200.0), ("pallet_stack", 102.6, 42.0, 0.0), ("market_stall", 90.6, 47.0, -90.0),
        ("wheelbarrow", 96.0, 48.0, 60.0),
    ], "under the roof of the fish market")  # fmt: skip
    for x, y, yaw in ((81.6, 44.0, 20.0), (113.8, 38.0, 100.0), (99.0, 37.2, 0.0)):
        put(site, "net_heap", x, y, yaw)


def _front(site: Site) -> None:
    cafe = hall(site, 70.8, 50.4, 79.2, 58.0, 3.4, wall=site.material("cafe", "planks:#d8d2c0"),
                roof="boards:#9a7a54", doors="planks:#3f6a7c", name="CAFE", facing_deg=_SOUTH,
                category="cafe")  # fmt: skip
    set_out(site, [("cafe_table", 73.0, 52.6, 0.0), ("cafe_table", 76.6, 55.6, 0.0), ("topiary", 77.8, 51.8, 0.0),
                   ("deck_chair", 72.6, 56.2, -60.0)], "on the roof terrace of the café", cafe)  # fmt: skip
    put(site, "clock_tower", 75.2, 64.0, -90.0, variant="sandstone")
    place = "on the fishing harbour's west quay"
    set_out(site, [
        ("anchor_monument", 75.0, 46.0, -90.0), ("fuel_pump", 77.6, 12.6, 0.0), ("fuel_pump", 77.6, 18.4, 0.0),
        ("bench", 77.4, 30.0, 0.0), ("seagull_statue", 74.8, -3.6, -90.0), ("motorcycle", 71.8, 20.0, 90.0),
        ("parking_meter", 71.4, 15.0, 90.0),
        ("delivery_van", 72.2, 1.6, 90.0), ("litter_bin", 77.8, 24.2, 0.0), ("mooring_bollard", 78.6, 6.0, 0.0),
        ("scooter", 72.4, 38.0, 80.0), ("a_board", 74.6, 24.4, 0.0), ("bicycle", 72.2, 31.0, 90.0),
        ("navigation_beacon", 78.0, -4.4, 0.0), ("food_truck", 73.0, 8.6, 0.0), ("cafe_table", 76.4, 36.2, 0.0),
    ], place)  # fmt: skip


def _east_quay(site: Site) -> None:
    place = "on the fishing harbour's east quay"
    set_out(site, [
        ("harbour_crane", 118.6, 22.0, 180.0), ("pier_kiosk", 118.0, -8.0, 180.0),
        ("dinghy_on_trailer", 119.4, 8.0, 80.0),
        ("fish_crates", 114.4, 12.4, 180.0), ("lifebuoy_stand", 113.4, -2.0, 0.0),
        ("mooring_bollard", 113.4, 17.0, 180.0),
        ("fuel_pump", 115.0, -20.0, 180.0), ("golf_cart", 121.4, -16.0, 100.0),
        ("deck_chair", 114.8, -28.0, 180.0), ("hatchback", 121.4, 30.0, 90.0), ("crate_stack", 115.0, 30.4, 0.0),
        ("picnic_table", 119.0, -30.6, 0.0), ("flagpole", 121.4, -40.0, 180.0),
    ], place)  # fmt: skip
    colours = ("#b8493c", "#d9b36a", "#5f8a8c", "#e6e0d2")
    for k, colour in enumerate(colours[:3]):
        style = HouseStyle(width_m=6.4, depth_m=7.0, wall=f"planks:{colour}", roof="roof_tiles:#8a4a38", roof_m=3.0,
                           overhang_m=0.2, chimney=k == 1)  # fmt: skip
        house(site, Frame(119.0, 46.0 + 7.4 * k + 8.0, 180.0), style, z=QUAY_M)
