import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from aerialdojo_gen.geometry.triangles import segment_triangle_d2
from aerialdojo_gen.planning.bvh import LEAF, build_bvh
from aerialdojo_gen.planning.bvh_groups import group_boxes, segment_blocker


@settings(max_examples=60, deadline=None)
@given(
    n=st.integers(0, 700), places=st.integers(1, 400), seed=st.integers(0, 2**32 - 1),
    away_m=st.sampled_from([0.0, 1e3, 1e6]),
)  # fmt: skip
def test_a_tree_holds_every_triangle_once_and_finds_what_trying_all_finds(n, places, seed, away_m):
    """Also where many triangles lie at the same place, which no split can part, and far from the origin."""
    rng = np.random.default_rng(seed)
    at = (away_m + rng.uniform(-10, 10, (places, 3)))[rng.integers(0, places, n)]
    triangles = (at[:, None] + rng.uniform(-1, 1, (n, 3, 3))).reshape(n, 9)
    if n and rng.random() < 0.3:
        triangles[:] = triangles[0]
    ordered, boxes, order = build_bvh(triangles)
    assert sorted(order.tolist()) == list(range(n))
    assert np.array_equal(ordered, triangles[order])
    leaves = len(boxes) // 2
    corners = ordered.reshape(-1, 3, 3)
    for node in range(1, 2 * leaves):
        level = node.bit_length() - 1
        span = (leaves >> level) * LEAF
        below = corners[(node - (1 << level)) * span :][:span]
        if len(below):
            assert np.array_equal(boxes[node], np.concatenate([below.min(axis=(0, 1)), below.max(axis=(0, 1))]))
    for _ in range(5):
        p, q, radius = *(away_m + rng.uniform(-11, 11, (2, 3))), rng.uniform(0.05, 2.0)
        near = [k for k in range(n) if segment_triangle_d2(*p, *q, ordered, k, radius) <= radius * radius]
        found = segment_blocker(*p, *q, radius, ordered, group_boxes(boxes))
        assert found in near if near else found == -1
