"""What anchors and reference pictures leave out, rays and pictures, changes nothing that they say."""

import dataclasses
import math
from collections import Counter

import numpy as np
import pytest
from support.handmade import box, instance, job_of, scene
from support.two_coloured import item_of, world_of

from aerialdojo_gen.base.config.sections import AnchorSampleConfig
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.geometry.cameras import Camera, view_pose
from aerialdojo_gen.geometry.part_visibility import in_picture
from aerialdojo_gen.geometry.rays import instance_caster
from aerialdojo_gen.geometry.viewpoints import shortlist
from aerialdojo_gen.pipeline.scoring.ensemble import scorer_ensemble
from aerialdojo_gen.pipeline.scoring.views import part_shares
from aerialdojo_gen.pipeline.stages.work.anchor_pictures import CandidateViews, best_pictured, fitting_m, steps_back_m
from aerialdojo_gen.pipeline.stages.work.anchor_sample import candidates_of
from aerialdojo_gen.pipeline.stages.work.anchor_world import Candidates
from aerialdojo_gen.pipeline.stages.work.reference_images import MIN_SHARE, instance_map, instance_mask
from aerialdojo_gen.planning.collision import collision_world
from aerialdojo_gen.rendering.backend import open_renderer
from aerialdojo_gen.scenes.model import Anatomy, Instance, Run

CONFIG, RADIUS = AnchorSampleConfig(), Embodiment().radius_m


def kiosk() -> Instance:
    """A thing of four parts that fits no picture from a metre away, with a front, a sign and a knob."""
    plain = instance(
        "kiosk", box((-1.6, -0.9, 0.0), (1.6, 0.9, 2.6)), box((-0.5, 0.9, 1.5), (0.5, 0.96, 2.1)),
        box((1.2, 0.9, 1.0), (1.26, 0.94, 1.06)), box((-0.05, -0.05, 2.6), (0.05, 0.05, 4.0)),
    )  # fmt: skip
    runs = {name: (Run(k, 0, 12),) for k, name in enumerate(("body", "sign", "knob", "mast"))}
    anatomy = Anatomy(0.0, (math.pi / 2,), ("sign", "knob", "mast"), runs)
    return Instance(plain.node, "thing", "", {}, plain.parts, anatomy)


@pytest.fixture(scope="module", params=[0, pytest.param(1, marks=pytest.mark.nightly)])
def world(request):
    """The kiosk among rails, boards and posts."""
    rng = np.random.default_rng(request.param)
    turn, out = rng.uniform(0, 2 * math.pi, 40), rng.uniform(2.2, 7.0, 40)
    low = np.column_stack([out * np.cos(turn), out * np.sin(turn), rng.uniform(0, 2.5, 40)])
    size = rng.uniform(0.02, 0.7, (40, 3))
    return world_of(scene(kiosk(), *(instance(f"bit_{k}", box(low[k], low[k] + size[k])) for k in range(40))))


@pytest.fixture(scope="module")
def found(world, tmp_path_factory) -> Candidates:
    folder = tmp_path_factory.mktemp("job")
    return candidates_of(
        item_of(world.scene.instances[world.index["kiosk"]], "kiosk"), world, job_of("anchor-sample", folder), CONFIG
    )[0]


def step_by_definition(found: Candidates, k: int, most_m: float) -> float:
    """How far to step back, as `steps_back_m` says it: all tries judged, the best taken, of equals the farthest."""
    world, place, yaw = found.world, found.positions_m[k], float(found.yaw_rad[k])
    back = -np.array([math.cos(yaw), math.sin(yaw), 0.0])
    wanted = min(fitting_m(world.scene.instances[found.instance].vertices, place, yaw, 90.0), most_m)
    free = float(world.rays.first_hit(place, back[None])[0][0]) - 0.3
    low, high = world.scene.bounds
    edges = [(b - p) / d - 0.15 for p, d, b in zip(place, back, np.where(back > 0, high, low), strict=True) if d]
    wanted = min(wanted, free, *edges)
    if wanted < 0.25:
        return 0.0
    worth = []
    tries = [math.floor(100 * share * wanted) / 100 for share in (1.0, 0.85, 0.7, 0.55, 0.4, 0.25)] + [0.0]
    for step in tries:
        at = place + step * back
        points = found.points[in_picture(at[None], np.array([yaw]), found.points, 90.0)[0]]
        seen = world.rays.visible(at, points, found.instance).sum() if len(points) else 0
        blocked = step > 0 and collision_world(world.scene).sphere_in_collision(at, 0.15)
        worth.append(-math.inf if blocked else seen - 2.0 * (len(points) - seen))
    return tries[int(np.argmax(worth))]


def test_all_candidates_at_once_step_back_as_far_as_each_by_the_definition(found):
    most = np.random.default_rng(7).uniform(0.0, 15.0, len(found.positions_m))
    world, where = found.world, (found.positions_m, found.yaw_rad)
    steps = steps_back_m(world, found.instance, found.points, *where, 90.0, most)
    assert steps.tolist() == [step_by_definition(found, k, float(m)) for k, m in enumerate(most)]
    assert len(set(steps.tolist())) > 10
    assert 0.0 in steps


def test_a_camera_that_steps_back_keeps_its_room_to_the_edge_of_the_volume(found):
    low, high = np.array([-3.5, -3.5, -9.0]), np.array([3.5, 3.5, 9.0])
    scene = dataclasses.replace(found.world.scene, bounds=np.stack([low, high]))
    narrow = dataclasses.replace(found.world, scene=scene)
    inside = ((found.positions_m >= low + RADIUS) & (found.positions_m <= high - RADIUS)).all(axis=1)
    places, yaw_rad = found.positions_m[inside], found.yaw_rad[inside]
    most = np.full(len(places), 15.0)
    steps = steps_back_m(narrow, found.instance, found.points, places, yaw_rad, 90.0, most)
    back = -np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad)])
    moved = places[:, :2] + steps[:, None] * back
    room = (np.where(back > 0.0, high[:2] - moved, moved - low[:2]) / np.abs(back)).min(axis=1)[steps > 0.0]
    assert room.min() >= 0.15 - 1e-9
    # Steps are whole centimetres.
    assert (room < 0.165).sum() > 3


def test_candidates_that_are_moved_are_what_they_are_where_they_are_moved_to(found):
    which = np.arange(0, len(found.positions_m), 2)
    places = found.positions_m[which] + np.where(which[:, None] % 4, [0.3, -0.2, 0.1], 0.0)
    moved = found.moved(which, places)
    anew = Candidates(found.world, found.instance, found.points, places, found.yaw_rad[which], RADIUS, CONFIG)
    for name in (
        "positions_m", "yaw_rad", "elevation_deg", "clearance_m", "part_shares", "part_visibility", "off_front_rad",
        "rank",
    ):  # fmt: skip
        np.testing.assert_array_equal(getattr(moved, name), getattr(anew, name), err_msg=name)
    for name in ("visible_fraction", "framed", "shown", "box_fraction", "off_centre"):
        np.testing.assert_array_equal(getattr(moved.views, name), getattr(anew.views, name), err_msg=name)


def test_no_picture_scores_more_than_its_bound_and_the_best_are_those_of_all_pictures(found, monkeypatch):
    picture, taken = CandidateViews.picture, []
    monkeypatch.setattr(CandidateViews, "picture", lambda self, n, *how: taken.append(n) or picture(self, n, *how))
    looked = CandidateViews.of(found, found.seeing(CONFIG.min_visible_fraction))
    away = found.positions_m - found.world.scene.instances[found.instance].centroid
    turn = np.arctan2(away[:, 1], away[:, 0])[looked.which]
    front, apart = found.before_front[looked.which], math.radians(CONFIG.separation_deg)
    lazily = 0
    windows = range(0, len(looked.which) - 6, 18)
    for first in windows:
        few = np.arange(first, first + 6)
        views = [looked.picture(int(n), CONFIG.picture_px) for n in few]
        verdicts = scorer_ensemble(CONFIG, RADIUS).judge("kiosk", views)
        score = np.array([verdict.score for verdict in verdicts])
        assert all(s <= looked.score_bound(int(n)) for n, s in zip(few, score, strict=True))
        taken.clear()
        best, shown = best_pictured("kiosk", looked, few, turn[few], front[few])
        lazily += len(taken)
        assert best.tolist() == shortlist(score, turn[few], CONFIG.shortlist, apart, front[few]).tolist()
        assert [verdict for _, verdict in shown] == [verdicts[n] for n in best]
        assert [view.jpeg() for view, _ in shown] == [views[n].jpeg() for n in best]
    assert 0 < lazily < 6 * len(windows)


def poses(found, n=6):
    for k in range(0, len(found.positions_m), len(found.positions_m) // n):
        ahead = np.array([math.cos(found.yaw_rad[k]), math.sin(found.yaw_rad[k]), 0.0])
        for back in (0.0, 3.0):
            yield view_pose(found.positions_m[k] - back * ahead, float(found.yaw_rad[k]), "front")


def test_shares_of_parts_are_those_of_all_pixels(found):
    thing, camera = found.world.scene.instances[found.instance], Camera(160, 160)
    parts = [thing.faces_of(name) for name in thing.anatomy.identifying_parts]
    caster = instance_caster(thing)
    some = Counter()
    for pose in poses(found):
        visible = instance_map(found.world.rays, camera, pose) == found.instance
        directions = camera.rays()[visible] @ pose[:3, :3].T
        face = caster.first_hit(pose[:3, 3], directions)[1] if visible.any() else np.zeros(0)
        whole = [float(np.isin(face, part).sum()) / visible.size for part in parts]
        assert part_shares(caster, thing, parts, camera, pose, visible) == whole
        least = part_shares(caster, thing, parts, camera, pose, visible, MIN_SHARE)
        assert [share < MIN_SHARE for share in least] == [share < MIN_SHARE for share in whole]
        assert all(a == b for a, b in zip(least, whole, strict=True) if b < MIN_SHARE)
        some.update("shown" if share >= MIN_SHARE else "missing" for share in whole)
    assert min(some["shown"], some["missing"]) > 3


def test_a_mask_mended_by_rays_is_that_of_rays_whatever_was_drawn(found):
    camera, thing = Camera(320, 320), found.world.scene.instances[found.instance]
    rays, shown = found.world.rays, 0
    with open_renderer(found.world.scene) as renderer:
        for pose in poses(found, 4):
            mask = instance_mask(rays, found.instance, thing.vertices, camera, pose)
            drawn = renderer.render(camera, pose, instances=True).instance
            # What no renderer of ours does: all of it a pixel off, and a piece of the object left out.
            shifted = np.roll(drawn, (1, -1), axis=(0, 1))
            holed = drawn.copy()
            holed[100:190, 120:200] = -1
            for what in (drawn, shifted, holed):
                mended = instance_mask(rays, found.instance, thing.vertices, camera, pose, what)
                np.testing.assert_array_equal(mended, mask)
            shown += int(mask.any())
    assert shown > 3
