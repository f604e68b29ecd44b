"""What a picture leaves out as hidden could not have been seen: pictures are those of all triangles, to the bit."""

from contextlib import nullcontext

import numpy as np
import pytest
from support.flying import town
from support.rendered import boxes_and_a_wall, courtyard, same_picture

from aerialdojo_gen import GlRenderer
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.bodies import draw_bodies
from aerialdojo_gen.rendering.gl import clip_from_world
from aerialdojo_gen.rendering.gl_target import read_picture
from aerialdojo_gen.rendering.gl_tiles import Tiles
from aerialdojo_gen.rendering.picture import FAR_M, NEAR_M
from aerialdojo_gen.rendering.world import PyBulletRenderer
from aerialdojo_gen.store.schemas import VIEWS


def clips_of(camera, poses):
    return np.stack([clip_from_world(camera, pose, NEAR_M, FAR_M) for pose in poses])


def chosen(renderer, camera, poses, tiles):
    """What the views of one place draw, by view and kind; without tiles nothing is left out behind anything."""
    eye, none = np.ascontiguousarray(poses[0][:3, 3]), Tiles.empty(len(poses), camera.width, camera.height)
    found = [
        d.kind.chunks.visible_indices(clips_of(camera, poses), eye, tiles or none, tiles is not None and d.kind.hides)
        for d in renderer._sets
    ]
    return [[of_kind[v] for of_kind in found] for v in range(len(poses))]


def count(visible):
    """Triangles of views."""
    return sum(len(kind) // 3 for view in visible for kind in view)


def anywhere(world, n, seed):
    """Poses inside of things and below the ground too."""
    draw = np.random.default_rng(seed)
    return np.column_stack([draw.uniform(*world.bounds, (n, 3)), draw.uniform(-np.pi, np.pi, n)])


@pytest.mark.parametrize("make", [courtyard, town])
@pytest.mark.parametrize(("width", "height", "fov"), [(320, 320, 90.0), (203, 117, 70.0), (130, 257, 110.0)])
def test_pictures_are_those_of_all_triangles(make, width, height, fov):
    world, camera, less, more = make(), Camera(width, height, fov), 0, 0
    with GlRenderer(world) as renderer:
        for place in anywhere(world, 5, width):
            poses = [view_pose(place[:3], place[3], view) for view in VIEWS]
            clips, every = clips_of(camera, poses), chosen(renderer, camera, poses, None)
            less += count(chosen(renderer, camera, poses, Tiles.empty(4, width, height)))
            more += count(every)
            for v, picture in enumerate(renderer.render_views(camera, poses)):
                full = renderer.draw_triangles(camera, poses[v], clips[v], every[v])
                assert same_picture(picture, read_picture(full, camera, False))
    assert less <= more
    assert less < more or (make, width) != (town, 320), "so large a picture of a town has something to leave out"


@pytest.mark.parametrize(("width", "height"), [(320, 320), (203, 117)])
def test_what_tiles_say_is_drawn_is_at_least_as_near(width, height):
    world, camera, known = town(), Camera(width, height, 90.0), 0
    with GlRenderer(world) as renderer:
        for place in anywhere(world, 8, 7):
            poses, tiles = [view_pose(place[:3], place[3], view) for view in VIEWS], Tiles.empty(4, width, height)
            chosen(renderer, camera, poses, tiles)

            def pixels(of_tiles):
                return np.repeat(np.repeat(of_tiles, 8, axis=0), 8, axis=1)[:height, :width]

            for v, picture in enumerate(renderer.render_views(camera, poses)):
                row, column = np.mgrid[:height, :width] % 8
                bit = pixels(tiles.covered[v]) >> (8 * row + column).astype(np.uint64)
                part = np.where(bit & np.uint64(1) == 1, pixels(tiles.part[v]), 0.0)
                said = np.maximum(pixels(tiles.whole[v]), part)
                assert (1.0 / picture.depth_m >= said).all()
                known += int((said > 0.0).sum())
    assert known > 8 * 4 * width * height / 10, "tiles that know nothing would say nothing wrong"


def test_what_stands_behind_a_wall_is_not_drawn():
    """Two hundred boxes behind a wall are left out, but for its triangles' seam; those on this side are not."""
    eye = np.array([0.0, 0.0, 3.0])
    poses = [view_pose(eye, yaw, "front") for yaw in (0.0, np.pi)]
    with GlRenderer(boxes_and_a_wall()) as renderer:
        camera = Camera(320, 320, 90.0)
        visible = chosen(renderer, camera, poses, Tiles.empty(2, 320, 320))
        every = chosen(renderer, camera, poses, None)
        assert count(visible[:1]) < count(every[:1]) / 3
        assert count(visible[1:]) > 0.9 * count(every[1:]) > 100
        assert renderer.render(camera, poses[0]).depth_m[160, 160] == pytest.approx(10.0, abs=1e-3)
        # The same for pictures of bodies, which are culled by pixels.
        small, nearness = Camera(128, 128, 90.0), np.zeros((2, 128, 128), np.float32)
        cullings = renderer.bodies()._cullings
        visible = [c.visible_indices(clips_of(small, poses), eye, 128, 128, nearness) for c in cullings]
        ahead, behind = (sum(len(kind[v]) // 3 for kind in visible) for v in (0, 1))
        assert ahead < 40
        assert behind > 100


@pytest.mark.parametrize(
    ("kind", "make", "size"),
    [(GlRenderer, make, size) for make in (courtyard, town)
     for size in ((64, 64, 90.0), (33, 17, 70.0), (128, 96, 110.0), (1, 1, 90.0))]
    + [(PyBulletRenderer, courtyard, (24, 16, 90.0))],
)  # fmt: skip
def test_pictures_of_many_bodies_are_those_of_each(kind, make, size):
    """In whatever order sizes come; instance ids are those of each, and change nothing else."""
    world, camera, views = make(), Camera(*size), ("down", "front", "right")
    poses = anywhere(world, 10 if kind is GlRenderer else 4, size[0])
    instance = np.full((len(poses), 3, size[1], size[0]), -9, np.int32)
    with kind(world) as renderer, kind(world) if kind is GlRenderer else nullcontext(renderer) as plain:
        rgb, depth_m = draw_bodies(renderer, camera, poses, views, instance)
        other, _ = draw_bodies(renderer, Camera(20, 20, 90.0), poses[:3], ["left"])
        without = draw_bodies(renderer, camera, poses, views)
        empty, _ = draw_bodies(renderer, camera, np.empty((0, 4)), views)
        for k, pose in enumerate(poses):
            for v, view in enumerate(views):
                picture = plain.render(camera, view_pose(pose[:3], pose[3], view), instances=True)
                assert (rgb[k, v] == picture.rgb).all(), (k, view)
                assert (depth_m[k, v] == picture.depth_m).all(), (k, view)
                assert (instance[k, v] == picture.instance).all(), (k, view)
    assert (rgb == without[0]).all()
    assert (depth_m == without[1]).all()
    assert (other.shape, empty.shape) == ((3, 1, 20, 20, 3), (0, *rgb.shape[1:]))
    assert len(np.unique(rgb)) > (20 if size[0] > 1 else 5)
    assert len(np.unique(instance)) > 3
