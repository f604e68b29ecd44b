"""Triangles of the OpenGL renderer: what is left out as hidden could not have been seen; which edges are smooth."""

import numpy as np
import pytest
from support.flying import town
from support.rendered import boxes_and_a_wall, courtyard

from aerialdojo_gen import GlRenderer
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.gl import clip_from_world
from aerialdojo_gen.rendering.gl_geometry import VERTEX, smooth
from aerialdojo_gen.rendering.gl_programs import read_pixels
from aerialdojo_gen.rendering.picture import FAR_M, NEAR_M
from aerialdojo_gen.rendering.world import PyBulletRenderer
from aerialdojo_gen.scenes.mesh import Mesh
from aerialdojo_gen.scenes.shapes import box, sphere
from aerialdojo_gen.store.schemas import VIEWS


def culled(renderer, camera, poses, hides=True):
    """What the views of one place draw, by view and kind, and their nearness; without hiding, nothing is left out."""
    clips = np.stack([clip_from_world(camera, pose, NEAR_M, FAR_M) for pose in poses])
    eye, nearness = poses[0][:3, 3].copy(), np.zeros((len(poses), camera.height, camera.width), np.float32)
    found = [d.kind.chunks.visible_indices(clips, eye, nearness, hides and d.kind.hides) for d in renderer._sets]
    return list(zip(*found, strict=True)), clips, nearness


def count(visible):
    """Triangles of views."""
    return sum(len(kind) // 3 for view in visible for kind in view)


def anywhere(world, n, seed):
    """Poses inside of things and below the ground too."""
    draw = np.random.default_rng(seed)
    return np.column_stack([draw.uniform(*world.bounds, (n, 3)), draw.uniform(-np.pi, np.pi, n)])


@pytest.mark.parametrize("make", [courtyard, town])
@pytest.mark.parametrize(
    "size",
    [(320, 320, 90.0), (203, 117, 70.0), (130, 257, 110.0), (64, 64, 90.0), (33, 17, 70.0), (1, 1, 90.0)],
)
def test_pictures_are_those_of_all_triangles(make, size):
    world, camera, less, more, known = make(), Camera(*size), 0, 0, 0
    with GlRenderer(world) as renderer:
        for place in anywhere(world, 5, size[0]):
            poses = [view_pose(place[:3], place[3], view) for view in VIEWS]
            chosen, _, nearness = culled(renderer, camera, poses)
            every, clips, _ = culled(renderer, camera, poses, hides=False)
            less, more, known = less + count(chosen), more + count(every), known + int((nearness > 0.0).sum())
            for v, picture in enumerate(renderer.render_views(camera, poses)):
                rgb, depth_m = np.empty_like(picture.rgb), np.empty_like(picture.depth_m)
                read_pixels(renderer.draw_triangles(camera, poses[v], clips[v], every[v]), rgb, depth_m)
                assert np.array_equal(picture.rgb, rgb)
                assert np.array_equal(picture.depth_m, depth_m)
                # What is said to be drawn is at least as near.
                assert (1.0 / depth_m >= nearness[v]).all()
    assert less <= more
    if size[0] == 320:
        assert less < more or make is courtyard, "so large a picture of a town has something to leave out"
        assert known > 5 * 4 * 320 * 320 / 10, "who knows nothing would say nothing wrong"


def test_what_stands_behind_a_wall_is_not_drawn():
    """Two hundred boxes behind a wall are left out, but for its triangles' seam; those on this side are not."""
    poses = [view_pose((0.0, 0.0, 3.0), yaw, "front") for yaw in (0.0, np.pi)]
    with GlRenderer(boxes_and_a_wall()) as renderer:
        camera = Camera(320, 320, 90.0)
        visible, every = (culled(renderer, camera, poses, hides)[0] for hides in (True, False))
        assert count(visible[:1]) < 40 < count(every[:1]) / 3
        assert count(visible[1:]) > 0.9 * count(every[1:]) > 100
        assert renderer.render(camera, poses[0]).depth_m[160, 160] == pytest.approx(10.0, abs=1e-3)


@pytest.mark.parametrize(
    ("kind", "make", "size"),
    [(GlRenderer, make, size) for make in (courtyard, town) for size in ((64, 64, 90.0), (128, 96, 110.0))]
    + [(PyBulletRenderer, courtyard, (24, 16, 90.0))],
)
def test_pictures_of_many_bodies_are_those_of_each(kind, make, size):
    """In whatever order sizes come, also of bodies that hover; instance ids change nothing else."""
    world, camera, views = make(), Camera(*size), ("down", "front", "right")
    poses = anywhere(world, 10 if kind is GlRenderer else 4, size[0])
    poses[1, :3] = poses[2, :3] = poses[0, :3]
    instance = np.full((len(poses), 3, size[1], size[0]), -9, np.int32)
    with kind(world) as renderer:
        rgb, depth_m = renderer.render_bodies(camera, poses, views, instance)
        other, _ = renderer.render_bodies(Camera(20, 20, 90.0), poses[:3], ["left"])
        without = renderer.render_bodies(camera, poses, views)
        empty, _ = renderer.render_bodies(camera, np.empty((0, 4)), views)
        for k, pose in enumerate(poses):
            for v, view in enumerate(views):
                picture = renderer.render(camera, view_pose(pose[:3], pose[3], view), instances=True)
                assert (rgb[k, v] == picture.rgb).all(), (k, view)
                assert (depth_m[k, v] == picture.depth_m).all(), (k, view)
                assert (instance[k, v] == picture.instance).all(), (k, view)
    assert (rgb == without[0]).all()
    assert (depth_m == without[1]).all()
    assert (other.shape, empty.shape) == ((3, 1, 20, 20, 3), (0, *rgb.shape[1:]))
    assert len(np.unique(rgb)) > 20
    assert len(np.unique(instance)) > 3


def rows_of(body: Mesh) -> np.ndarray:
    corners = body.vertices[body.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows = np.zeros((len(corners), 3), VERTEX)
    rows["position"], rows["normal"] = corners, (normal / np.linalg.norm(normal, axis=1, keepdims=True))[:, None]
    return rows


def test_each_group_is_smooth_by_its_own_angle_and_what_has_none_is_flat() -> None:
    ball, crate = rows_of(sphere(radius=1.0)), rows_of(box(size=[1.0, 2.0, 3.0]))
    two = np.concatenate([ball[::2], ball[1::2]])  # Of two materials
    rows = np.concatenate([ball, ball, two, crate])
    flat = rows["normal"].copy()
    smooth(rows, np.repeat([1, -1, 0, 2], [*[len(ball)] * 3, len(crate)]), np.array([0.7, 0.999, 0.45]))
    soft, others = np.split(np.arange(len(rows)), [2 * len(ball), 3 * len(ball)])[1], np.ones(len(rows), bool)
    others[soft] = False
    np.testing.assert_allclose(rows["normal"][others], flat[others], atol=1e-6)
    out = rows["position"][soft] / np.linalg.norm(rows["position"][soft], axis=2, keepdims=True)
    assert (rows["normal"][soft] * out).sum(axis=2).min() > 0.99
    assert (flat[soft] * out).sum(axis=2).min() < 0.98
