"""What a start shows of a target: the four views as cameras have them, and what stands in the way."""

import math

import numpy as np
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.handmade import box, instance, scene

from aerialdojo_gen.base.constants import VIEWS
from aerialdojo_gen.geometry.cameras import Camera, project, view_pose
from aerialdojo_gen.geometry.rays import TriangleRayCaster, instance_caster
from aerialdojo_gen.geometry.soup import soup
from aerialdojo_gen.geometry.start_visibility import start_visibility, view_towards
from aerialdojo_gen.geometry.surface import Surface

places = st.tuples(*[st.floats(-50, 50)] * 3)
BALL = instance("ball", trimesh.creation.icosphere(3, radius=0.5).apply_translation([10.0, 0.0, 2.0]))
POINTS = Surface.of(BALL).sample(64, np.random.default_rng(0))


def seen(*others, x=0.0, z=2.0, yaw=0.0):
    world = TriangleRayCaster(*soup(scene(BALL, *others).instances))
    share, view = start_visibility(world, instance_caster(BALL), POINTS, [[x, 0.0, z, yaw]])
    return float(share[0]), VIEWS[view[0]] if view[0] >= 0 else None


@given(places, places, st.floats(-math.pi, math.pi))
def test_a_view_has_the_points_that_its_camera_has(point, place, yaw):
    camera = Camera(100, 100, 90.0)
    assume(min(abs(np.subtract(point, place))) > 1e-9)
    holds = []
    for view in VIEWS:
        uv, depth = project(camera, view_pose(place, yaw, view), np.array(point))
        # A point on the border of two views may be of either.
        assume(abs(depth) > 1e-6 and np.abs(np.abs(uv - 50.0) - 50.0).min() > 1e-6)
        holds.append(bool(depth > 0 and (np.abs(uv - 50.0) <= 50.0).all()))
    assert sum(holds) <= 1
    found = view_towards(*np.subtract(point, place), math.cos(yaw), math.sin(yaw))
    assert found == (holds.index(True) if any(holds) else -1)


def test_what_hides_it_counts_and_the_targets_own_back_does_not():
    assert seen() == (1.0, "front")
    assert seen(x=10.0, z=8.0) == (1.0, "down")
    assert seen(x=10.0, z=1.0) == (0.0, None)
    assert seen(instance("wall", box((5, -3, 0), (5.2, 3, 4)))) == (0.0, None)
    share, view = seen(instance("half", box((5, 0, 0), (5.2, 3, 4))))
    assert 0.3 < share < 0.7
    assert view == "front"
    assert seen(instance("low", box((5, -3, 0), (5.2, 3, 1))), yaw=math.radians(47.0)) == (1.0, "right")


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), number=st.sampled_from([1, 15, 64, 300]))
def test_triangles_that_hide_points_for_certain_change_nothing(seed, number):
    """Most rays are never cast: shares and views are those that rays to all points give."""
    rng = np.random.default_rng(seed)
    points = Surface.of(BALL).sample(number, np.random.default_rng(0))
    low = np.column_stack([rng.uniform(-9, 7, (6, 2)), np.zeros(6)])
    high = low + rng.uniform(0.1, 5.0, (6, 3))
    world = scene(BALL, *(instance(f"box_{k}", box(a, b)) for k, (a, b) in enumerate(zip(low, high, strict=True))))
    caster, own = TriangleRayCaster(*soup(world.instances)), instance_caster(BALL)
    poses = np.column_stack([rng.uniform(-14, 20, (20, 2)), rng.uniform(0, 7, 20), rng.uniform(-3, 3, 20)])
    view = np.array(
        [[view_towards(*p - pose[:3], math.cos(pose[3]), math.sin(pose[3])) for p in points] for pose in poses]
    )
    ends = poses[:, None, :3], points[None]
    rays = [np.broadcast_to(end, (20, number, 3)).reshape(-1, 3) for end in ends]
    seen = caster.unobstructed(*rays).reshape(view.shape) & (view >= 0)
    whole = (own.unobstructed(*rays).reshape(view.shape) | seen).sum(axis=1)
    share, best = start_visibility(caster, own, points, poses)
    assert (share == np.where(seen.any(axis=1), seen.sum(axis=1) / np.maximum(whole, 1), 0.0)).all()
    votes = np.stack([(seen & (view == k)).sum(axis=1) for k in range(len(VIEWS))], axis=1)
    assert (best == np.where(seen.any(axis=1), votes.argmax(axis=1), -1)).all()
