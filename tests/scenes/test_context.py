"""One context a scene: found by content, bounded, shared, and gone when it goes."""

import gc
import hashlib
import shutil
import threading
import weakref
from dataclasses import replace

import numpy as np
import pybullet
import pytest

from aerialdojo_gen.base.config.sections import PlanConfig
from aerialdojo_gen.base.errors import AssetError
from aerialdojo_gen.pipeline.stages.work.anchor_world import World
from aerialdojo_gen.pipeline.stages.work.plan import _planner
from aerialdojo_gen.planning.clearance import ClearanceGrid
from aerialdojo_gen.planning.collision import CollisionWorld, collision_world
from aerialdojo_gen.rendering.backend import close_renderers, probe_scene, scene_renderer
from aerialdojo_gen.rendering.casters import ray_caster, triangle_caster
from aerialdojo_gen.rendering.checks import scene_solid
from aerialdojo_gen.rendering.orthographic import orthographic_pictures
from aerialdojo_gen.rendering.raycast import ray_renderer
from aerialdojo_gen.rendering.world import PyBulletRenderer
from aerialdojo_gen.scenes.context import cache_scene, context_of, open_contexts, open_scene, release_scenes
from aerialdojo_gen.scenes.glb import write_glb


@pytest.fixture(autouse=True)
def _nothing_kept():
    release_scenes()
    yield
    release_scenes()


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    """Four scenes on disk, with their digests."""
    folder, found = tmp_path_factory.mktemp("meshes"), []
    for k in range(4):
        path = folder / f"{k}.glb"
        write_glb(replace(probe_scene(), name=f"Probe_{k}"), path)
        found.append((path, hashlib.sha256(path.read_bytes()).hexdigest()))
    return found


def test_the_same_content_has_one_context_wherever_it_lies(meshes, tmp_path):
    path, digest = meshes[0]
    copy = shutil.copyfile(path, tmp_path / "copy.glb")
    context = open_scene(path, digest)
    assert open_scene(copy, digest) is context
    assert context_of(context.scene) is context
    # What is kept is not asked for again: the file may be gone.
    copy.unlink()
    assert open_scene(copy, digest) is context
    unknown = open_scene(path, "", keep=3)
    assert context_of(unknown.scene) is unknown is not open_scene(meshes[1][0], "", keep=3)
    release_scenes()
    with pytest.raises(AssetError, match=r"copy\.glb"):
        open_scene(copy, digest)
    with pytest.raises(AssetError, match="is not the mesh"):
        open_scene(path, meshes[1][1])
    assert not open_contexts()


def test_a_scene_that_was_just_written_is_not_read(meshes, tmp_path):
    before = open_scene(*meshes[1])
    scene = replace(probe_scene(), name="Probe_0")
    cache_scene(scene, meshes[0][1])
    assert before not in open_contexts()
    assert open_scene(tmp_path / "nowhere.glb", meshes[0][1]).scene is scene
    cache_scene(probe_scene(), meshes[0][1])
    assert open_scene(*meshes[0]).scene is scene


@pytest.mark.parametrize("keep", [1, 3])
def test_so_many_are_kept_and_the_one_not_asked_for_longest_goes(meshes, keep):
    contexts = [open_scene(*mesh, keep) for mesh in meshes[:3]]
    assert list(open_contexts()) == contexts[-keep:]
    assert open_scene(*meshes[2], keep) is contexts[2]
    if keep == 3:
        assert open_scene(*meshes[0], keep) is contexts[0]
        assert open_contexts() == (contexts[1], contexts[2], contexts[0])
        last = open_scene(*meshes[3], keep)
        assert open_contexts() == (contexts[2], contexts[0], last)
        # Who needs one scene lets go of the others.
        assert open_scene(*meshes[0]) is contexts[0]
        assert open_contexts() == (contexts[0],)


@pytest.mark.slow
def test_a_scene_and_all_that_is_built_on_it_are_gone_before_the_next_one_is_read(meshes, monkeypatch):
    """A worker's memory is that of one scene, however many it works on."""
    held, alive_while_reading = [], []
    from aerialdojo_gen.scenes import context as module

    read = module.read_glb

    def reading(*given):
        gc.collect()
        alive_while_reading.append([reference() is not None for reference in held])
        return read(*given)

    monkeypatch.setattr(module, "read_glb", reading)
    for mesh in meshes[:2]:
        place = open_scene(*mesh).scene
        planner = _planner(place, PlanConfig(), 0.25)
        assert _planner(place, PlanConfig(), 0.25) is planner
        world = World.of(place, 0.25, 0.05)
        made = (place, planner, planner.world, world.rays, scene_solid(place), ray_renderer(place),
                orthographic_pictures(place), scene_renderer(place, "pybullet"))  # fmt: skip
        held += [weakref.ref(part) for part in made]
        del place, planner, world, made
    assert alive_while_reading == [[False] * 8 * k for k in range(2)]


def test_one_embree_scene_and_one_fcl_world_for_all(meshes):
    place = open_scene(*meshes[0]).scene
    caster = triangle_caster(place)
    for part in (ray_caster(place)._triangles, scene_solid(place)._caster, ray_renderer(place)._rays,
                 orthographic_pictures(place)._rays):  # fmt: skip
        assert part is caster
    world = World.of(place, 0.25, 0.05)
    renderer = ray_renderer(place)
    planner = _planner(place, PlanConfig(), 0.25)
    # The planner releases what draws, not what casts rays.
    assert world.rays is ray_caster(place)
    assert ray_renderer(place) is not renderer
    assert planner.world is collision_world(place)
    # Two grids of other margins: each asks for its own, and the context keeps the one last made.
    assert (
        world.free
        is not planner.grid
        is ClearanceGrid.of(place, cell_m=0.5, radius_m=0.25, margin_m=PlanConfig().margin_m, cap_m=5.0)
    )


def test_what_draws_is_closed_when_its_scene_goes(meshes):
    path, digest = meshes[0]
    place = open_scene(path, digest).scene
    renderer = scene_renderer(place, "pybullet")
    assert scene_renderer(place, "pybullet", reopen=True) is not renderer
    world = scene_renderer(place, "pybullet")
    client = world._client
    assert pybullet.isConnected(client)
    open_scene(*meshes[1])
    assert not pybullet.isConnected(client)
    assert isinstance(world, PyBulletRenderer)
    again = context_of(place)
    drawn = scene_renderer(place, "pybullet")
    close_renderers()
    assert scene_renderer(place, "pybullet") is not drawn
    assert context_of(place) is again


def test_one_of_a_kind_and_nothing_of_a_part_that_cannot_be_made(meshes):
    context = open_scene(*meshes[0])
    closed = []

    class Part:
        def __init__(self, name):
            self.name = name

        def close(self):
            closed.append(self.name)

    first = context.part("thing", lambda: Part("first"), 1)
    assert context.part("thing", lambda: Part("other"), 1) is first
    assert context.part("thing", lambda: Part("second"), 2).name == "second"
    assert closed == ["first"]

    def failing():
        raise OSError("no room")

    with pytest.raises(OSError, match="no room"):
        context.part("thing", failing, 3)
    assert closed == ["first", "second"]
    assert context.part("thing", lambda: Part("third"), 3).name == "third"
    context.drop("nothing of the kind")
    context.release()
    assert closed == ["first", "second", "third"]


def test_threads_share_what_one_of_them_makes_and_get_right_answers(meshes):
    path, digest = meshes[0]
    points = np.random.default_rng(0).uniform((-1, -1, 0), (2, 2, 2), (400, 3))
    alone = CollisionWorld(open_scene(path, digest).scene)
    expected = [(alone.distance_m(p), alone.sphere_in_collision(p, 0.3)) for p in points]
    release_scenes()
    gate, worlds, wrong = threading.Barrier(8), [], []

    def asking():
        gate.wait()
        world = collision_world(open_scene(path, digest).scene)
        worlds.append(world)
        for p, (distance, touches) in zip(points, expected, strict=True):
            if world.distance_m(p) != distance or world.sphere_in_collision(p, 0.3) != touches:
                wrong.append(p)

    threads = [threading.Thread(target=asking) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(worlds) == 8
    assert len({id(world) for world in worlds}) == 1
    assert not wrong


def test_scenes_made_in_memory_are_bounded_too():
    for k in range(5):
        place = replace(probe_scene(), name=f"Probe_{k}")
        assert ray_caster(place) is ray_caster(place)
        assert len(open_contexts()) <= 2
    assert open_contexts()[-1].scene is place
