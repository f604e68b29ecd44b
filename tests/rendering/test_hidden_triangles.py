"""What a picture leaves out as hidden could not have been seen: pictures are those of all triangles, to the bit."""

import numpy as np
import pytest
from support.flying import town
from support.rendered import boxes_and_a_wall, courtyard

from aerialdojo_gen import GlRenderer
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.rendering.gl import clip_from_world
from aerialdojo_gen.rendering.gl_target import read_picture
from aerialdojo_gen.rendering.gl_tiles import Tiles
from aerialdojo_gen.rendering.picture import FAR_M, NEAR_M
from aerialdojo_gen.store.schemas import VIEWS


def chosen(renderer, camera, poses, tiles):
    """What the views of one place draw, by view and kind; without tiles nothing is left out behind anything."""
    clips = np.stack([clip_from_world(camera, pose, NEAR_M, FAR_M) for pose in poses])
    eye = np.ascontiguousarray(poses[0][:3, 3])
    none = Tiles.empty(len(poses), camera.width, camera.height)
    found = [
        d.kind.chunks.visible_indices(clips, eye, tiles or none, tiles is not None and d.kind.hides)
        for d in renderer._sets
    ]
    return clips, [[of_kind[v] for of_kind in found] for v in range(len(poses))]


def count(visible):
    """Triangles of views."""
    return sum(len(kind) // 3 for view in visible for kind in view)


def anywhere(world, n, seed):
    draw = np.random.default_rng(seed)
    for place, yaw in zip(draw.uniform(*world.bounds, (n, 3)), draw.uniform(-np.pi, np.pi, n), strict=True):
        yield [view_pose(place, yaw, view) for view in VIEWS]


@pytest.mark.parametrize("make", [courtyard, town])
@pytest.mark.parametrize(("width", "height", "fov"), [(320, 320, 90.0), (203, 117, 70.0), (130, 257, 110.0)])
def test_pictures_are_those_of_all_triangles(make, width, height, fov):
    """Anywhere, inside of things and below the ground too."""
    world, camera, less, more = make(), Camera(width, height, fov), 0, 0
    with GlRenderer(world) as renderer:
        for poses in anywhere(world, 5, width):
            clips, every = chosen(renderer, camera, poses, None)
            _, visible = chosen(renderer, camera, poses, Tiles.empty(4, width, height))
            less, more = less + count(visible), more + count(every)
            for v, picture in enumerate(renderer.render_views(camera, poses)):
                full = read_picture(renderer.draw_triangles(camera, poses[v], clips[v], every[v]), camera, False)
                assert np.array_equal(picture.depth_m, full.depth_m)
                assert np.array_equal(picture.rgb, full.rgb)
    assert less <= more
    assert less < more or (make, width) != (town, 320), "so large a picture of a town has something to leave out"


@pytest.mark.parametrize(("width", "height"), [(320, 320), (203, 117)])
def test_what_tiles_say_is_drawn_is_at_least_as_near(width, height):
    world, camera, known = town(), Camera(width, height, 90.0), 0
    with GlRenderer(world) as renderer:
        for poses in anywhere(world, 8, 7):
            tiles = Tiles.empty(4, width, height)
            chosen(renderer, camera, poses, tiles)
            for v, picture in enumerate(renderer.render_views(camera, poses)):
                nearness = np.repeat(np.repeat(tiles.whole[v], 8, axis=0), 8, axis=1)[:height, :width]
                bits = np.repeat(np.repeat(tiles.covered[v], 8, axis=0), 8, axis=1)[:height, :width]
                row, column = np.mgrid[:height, :width] % 8
                covered = (bits >> (8 * row + column).astype(np.uint64)) & np.uint64(1) == 1
                part = np.repeat(np.repeat(tiles.part[v], 8, axis=0), 8, axis=1)[:height, :width]
                said = np.maximum(nearness, np.where(covered, part, 0.0))
                assert (1.0 / picture.depth_m >= said).all()
                known += int((said > 0.0).sum())
    assert known > 8 * 4 * width * height / 10, "tiles that know nothing would say nothing wrong"


def test_what_stands_behind_a_wall_is_not_drawn():
    """Two hundred boxes behind a wall are left out, and those on this side of it are not."""
    world = boxes_and_a_wall()
    camera = Camera(320, 320, 90.0)
    with GlRenderer(world) as renderer:
        poses = [view_pose((0.0, 0.0, 3.0), yaw, "front") for yaw in (0.0, np.pi)]
        _, visible = chosen(renderer, camera, poses, Tiles.empty(2, 320, 320))
        _, every = chosen(renderer, camera, poses, None)
        assert count(visible[:1]) < count(every[:1]) / 3, "but for the tiles on the seam of the wall's triangles"
        assert count(visible[1:]) > 0.9 * count(every[1:]) > 100
        picture = renderer.render(camera, poses[0])
        assert picture.depth_m[160, 160] == pytest.approx(10.0, abs=1e-3)


def test_views_of_several_places_are_those_of_each():
    """Views that share no eye, in an order that mixes them."""
    world, camera = courtyard(), Camera(160, 120, 90.0)
    places = list(anywhere(world, 3, 3))
    mixed = [places[k][v] for v in range(4) for k in (1, 0, 2)]
    with GlRenderer(world) as renderer:
        for pose, picture in zip(mixed, renderer.render_views(camera, mixed), strict=True):
            alone = renderer.render(camera, pose)
            assert np.array_equal(alone.rgb, picture.rgb)
            assert np.array_equal(alone.depth_m, picture.depth_m)
