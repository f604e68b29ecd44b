import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from support.handmade import instance, job_of, scene, write_rows, write_scene, xyz

from aerialdojo_gen.base.config.sections import PairObjectsConfig
from aerialdojo_gen.base.errors import StoreError
from aerialdojo_gen.pipeline.stages.work import pair_objects
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store.tables import check_table

SCENE = "U_Test_0"


def anchor_rows(places, variants=3):
    """Anchors of objects at places: variant k stands k × 0.5 m north of the first, the middle one is selected."""
    return [
        {"object_id": o, "anchor_id": a, **xyz((x, y + 0.5 * a, z)), "selected": a == variants // 2}
        for o, (x, y, z) in enumerate(places)
        for a in range(variants)
    ]


def things(data: Path, rows):
    """A scene with a ball 3 m south of each object's first anchor, and the tables that tell of it."""
    first = {row["object_id"]: row for row in reversed(rows)}
    ball = trimesh.creation.icosphere(2, radius=0.4)
    balls = [
        instance(f"ball_{k}", ball.copy().apply_translation([row["x_m"], row["y_m"] - 3.0, row["z_m"]]))
        for k, row in first.items()
    ]
    write_scene(data, scene(*balls, half=120.0))
    write_rows(data, "objects", [{"object_id": k, "mesh_node": f"ball_{k}"} for k in first])


def pair(data: Path, rows, config=None):
    config = config or PairObjectsConfig()
    write_rows(data, "anchors", rows)
    things(data, rows)
    out = pair_objects.run(job_of("pair-objects", data), config)
    check_table(schemas.PAIRS, out.tables["pairs"])
    assert out.rows_out == out.tables["pairs"].num_rows
    assert out.rows_in == out.rows_out + sum(out.counts.values())
    return out


def test_every_start_anchor_meets_every_other_objects_selected_anchor(tmp_path):
    places = [(7.0 * (k % 4), 7.0 * (k // 4), 2.0 + k) for k in range(11)]
    out = pair(tmp_path, anchor_rows(places))
    rows = out.tables["pairs"].to_pylist()
    ids = [r["pair_id"] for r in rows]
    assert ids == sorted(ids)
    assert len(set(ids)) == len(ids) == 11 * 10 * 3
    assert ids.index("10_0__2") < ids.index("2_0__10")
    assert {(r["start_object_id"], r["start_anchor_id"], r["target_object_id"]) for r in rows} == {
        (s, a, t) for s in range(11) for a in range(3) for t in range(11) if s != t
    }
    for r in rows:
        assert r["pair_id"] == f"{r['start_object_id']}_{r['start_anchor_id']}__{r['target_object_id']}"
        (sx, sy, sz), (tx, ty, tz) = places[r["start_object_id"]], places[r["target_object_id"]]
        expected = math.dist((sx, sy + 0.5 * r["start_anchor_id"], sz), (tx, ty + 0.5, tz))
        assert r["euclidean_m"] == pytest.approx(expected, abs=1e-12)


def test_pairs_that_are_too_close_or_whose_shortest_route_is_as_long_as_the_limit_are_counted(tmp_path):
    """As `filter` has it: more than 3 m, and L is less than 100 m."""
    for metres, approach_m, close, far in (
        (3.0, 1.0, 2, 0), (3.001, 1.0, 0, 0), (99.999, 0.0, 0, 0), (100.0, 0.0, 0, 2), (100.4, 1.0, 0, 0),
        (100.42, 1.0, 0, 2),
    ):  # fmt: skip
        rows = anchor_rows([(-50.0, 0.0, 2.0), (metres - 50.0, 0.0, 2.0)], variants=1)
        found = pair(tmp_path, rows, PairObjectsConfig(max_approach_m=approach_m))
        assert found.counts == {"too_close": close, "too_far": far}


def test_points_of_two_objects_are_drawn_apart():
    balls = [instance(f"ball_{k}", trimesh.creation.icosphere(2, radius=0.4)) for k in range(2)]
    first, second = (pair_objects.surface_points(SCENE, k, ball, 16)[0] for k, ball in enumerate(balls))
    assert not (first == second).any()
    assert (pair_objects.surface_points(SCENE, 0, balls[0], 16)[0] == first).all()


def test_start_variants_limits_starts_and_not_goals(tmp_path):
    rows = anchor_rows([(0.0, 0.0, 2.0), (20.0, 0.0, 2.0)])
    out = pair(tmp_path, rows, PairObjectsConfig(start_variants=1))
    assert out.tables["pairs"]["pair_id"].to_pylist() == ["0_0__1", "1_0__0"]
    assert out.tables["pairs"]["euclidean_m"].to_pylist() == pytest.approx([math.hypot(20, 0.5)] * 2)


def test_a_scene_without_anchors_or_with_one_object_has_no_pairs(tmp_path):
    assert pair(tmp_path, []).rows_in == 0
    assert pair(tmp_path, anchor_rows([(0.0, 0.0, 2.0)])).rows_in == 0


def test_an_object_that_the_mesh_lacks_is_named(tmp_path):
    rows = anchor_rows([(0.0, 0.0, 2.0), (20.0, 0.0, 2.0)])
    pair(tmp_path, rows)
    nodes = ("ball_0", "gone")
    write_rows(tmp_path, "objects", [{"object_id": k, "mesh_node": node} for k, node in enumerate(nodes)])
    with pytest.raises(StoreError, match="object 1 is not in the scene's mesh: run aerialdojo-gen annotate-import"):
        pair_objects.run(job_of("pair-objects", tmp_path), PairObjectsConfig())


moves = st.one_of(
    st.tuples(st.just("flat"), st.sampled_from([1.0, 3.0, 5.0]), st.integers(0, 23)),
    st.tuples(st.just("up"), st.sampled_from([-2.0, -1.0, 1.0, 2.0]), st.just(0)),
)


@settings(max_examples=100)
@given(st.lists(moves, max_size=40), st.floats(0, 1), st.floats(-math.pi / 2, math.pi / 2), st.floats(0, 2 * math.pi))
def test_no_route_of_the_action_set_is_shorter_than_the_bound(route, approach, elevation, azimuth):
    p, length = np.zeros(3), approach
    for kind, step, heading in route:
        a = heading * math.pi / 12
        p = p + (np.array([0, 0, step]) if kind == "up" else step * np.array([math.cos(a), math.sin(a), 0]))
        length += abs(step)
    flat = math.cos(elevation)
    goal = p + approach * np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])
    bound = pair_objects.length_bound_m(np.zeros((1, 3)), goal[None], 1.0)
    assert length >= bound[0] - 1e-9


def test_the_bound_is_met_by_a_diagonal_approach():
    goal = np.array([[99.7, 0.0, 0.8]])
    assert pair_objects.length_bound_m(np.zeros((1, 3)), goal, 1.0)[0] == pytest.approx(
        (99.7 - math.sqrt(0.5)) + (0.8 - math.sqrt(0.5)) + 1.0
    )
