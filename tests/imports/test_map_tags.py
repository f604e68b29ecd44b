"""What tags of OpenStreetMap say, in numbers."""

import pytest

from aerialdojo_gen.imports.map_props import _thing
from aerialdojo_gen.imports.map_tags import bearing_deg


@pytest.mark.parametrize(
    ("said", "bearing"),
    [
        ("0", 0.0), ("N", 0.0), ("360", 360.0), ("92.5", 92.5), ("180°", 180.0), ("sw", 225.0), (" NNW ", 337.5),
        ("361", None), ("-90", None), ("forward", None), ("90-120", None), ("1e2", None), ("", None),
    ],
)  # fmt: skip
def test_directions_are_degrees_or_points_of_the_compass(said, bearing):
    assert bearing_deg({"direction": said}, "direction") == bearing


def test_a_bench_that_faces_north_is_turned_to_it():
    from shapely import Point

    assert _thing("bench", Point(1, 2), {"direction": "0"})["yaw"] == 90.0
    assert _thing("bench", Point(1, 2), {"direction": "E"})["yaw"] == 0.0
    assert "yaw" not in _thing("bench", Point(1, 2), {"direction": "both"})
