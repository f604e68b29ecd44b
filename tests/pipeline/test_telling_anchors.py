"""Anchors of things whose front and telling parts are known, and pictures that step back until they fit."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.handmade import box, instance, job_of, scene

from aerialdojo_gen.base.config.sections import AnchorSampleConfig
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.geometry.cameras import Camera, project, view_pose
from aerialdojo_gen.geometry.part_visibility import FRONT_RAD, Patch, in_picture, off_front_rad, visible_shares
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.pipeline.stages.work.anchor_sample import anchors_of
from aerialdojo_gen.pipeline.stages.work.anchor_world import World
from aerialdojo_gen.pipeline.stages.work.camera_pullback import fitting_m
from aerialdojo_gen.scenes.model import Anatomy, Instance, Run

CONFIG, RADIUS = AnchorSampleConfig(), Embodiment().radius_m
NORTH = math.pi / 2


def told(thing: Instance, fronts=(), tells=(), runs=()) -> Instance:
    """The same thing with an anatomy: for every name the part that has it, a box of twelve faces."""
    anatomy = Anatomy(0.0, tuple(fronts), tuple(tells), {name: (Run(part, 0, 12),) for name, part in runs})
    return Instance(thing.node, thing.category, thing.variant, thing.attributes, thing.parts, anatomy)


# A cabinet with a dial on its north side.
CABINET = told(
    instance("cabinet", box((-0.4, -0.3, 0.0), (0.4, 0.3, 1.9)), box((-0.2, 0.3, 1.2), (0.2, 0.32, 1.6))),
    fronts=[NORTH], tells=["dial"], runs=[("case", 0), ("dial", 1)],
)  # fmt: skip


def anchors(place, node, tmp_path, config=CONFIG):
    x, y, z = place[node].centroid.tolist()
    item = {"object_id": 0, "name": node, "mesh_node": node, "x_m": x, "y_m": y, "z_m": z}
    return anchors_of(item, World.of(place, RADIUS, CONFIG.margin_m), job_of("anchor-sample", tmp_path), config)[0]


def test_a_thing_is_looked_at_from_its_front_where_its_telling_part_is_seen(tmp_path):
    best = anchors(scene(CABINET), "cabinet", tmp_path)[0]
    assert best["off_front_rad"] <= math.radians(30)
    assert best["y_m"] > 0.3
    assert best["part_tells"] > 0.5
    assert best["no_front_reason"] is None


def test_without_an_anatomy_nothing_is_said_of_fronts(tmp_path):
    plain = Instance("cabinet", "cabinet", "", {}, CABINET.parts)
    rows = anchors(scene(plain), "cabinet", tmp_path)
    assert {(r["off_front_rad"], r["part_tells"], r["part_front"], r["no_front_reason"]) for r in rows} == {
        (None,) * 4
    }


def test_a_front_against_a_wall_is_told_as_such(tmp_path):
    wall = instance("wall", box((-9.0, 0.6, 0.0), (9.0, 1.0, 6.0)))
    best = anchors(scene(CABINET, wall), "cabinet", tmp_path)[0]
    assert best["off_front_rad"] > FRONT_RAD
    assert best["no_front_reason"] in ("in_collision", "not_visible", "unreachable", "no_surface")


def test_the_shortlist_has_a_view_from_the_front_where_there_is_one(tmp_path):
    # In the north a hedge of posts spoils the view, and leaves some.
    posts = [instance(f"post{k}", box((x, 0.9, 0.0), (x + 0.06, 0.96, 3.0))) for k, x in enumerate((-0.6, 0.0, 0.6))]
    rows = anchors(scene(CABINET, *posts), "cabinet", tmp_path)
    assert any(row["off_front_rad"] <= FRONT_RAD for row in rows)


def test_a_lamp_high_on_its_pole_is_seen_from_where_it_is(tmp_path):
    lamp = told(
        instance("lamp", box((-0.06, -0.06, 0.0), (0.06, 0.06, 6.8)), box((0.06, -0.2, 6.5), (1.2, 0.2, 6.7))),
        tells=["head"], runs=[("head", 1)],
    )  # fmt: skip
    best = anchors(scene(lamp), "lamp", tmp_path)[0]
    pose = view_pose((best["x_m"], best["y_m"], best["z_m"]), best["yaw_rad"], "front")
    uv, depth = project(Camera(320, 320), pose, lamp.vertices[lamp.faces[lamp.faces_of("head")]].mean(axis=1))
    assert ((uv > 0) & (uv < 320) & (depth[:, None] > 0)).all(axis=1).mean() > 0.5


@settings(max_examples=100, deadline=None)
@given(
    st.floats(0.2, 12), st.floats(0.2, 12), st.floats(0.2, 12), st.floats(1.0, 4.0), st.floats(-math.pi, math.pi),
    st.floats(-1, 1),
)  # fmt: skip
def test_as_far_back_as_it_fits_a_thing_fits_and_no_nearer(dx, dy, dz, away, yaw, rise):
    corners = np.array(np.meshgrid([-dx / 2, dx / 2], [-dy / 2, dy / 2], [0, dz])).reshape(3, -1).T
    reach = math.hypot(dx, dy) / 2 + away
    eye = np.array([-reach * math.cos(yaw), -reach * math.sin(yaw), dz / 2 + rise])
    back = fitting_m(corners, eye, yaw, 90.0)

    def fits(s):
        place = eye - s * np.array([math.cos(yaw), math.sin(yaw), 0.0])
        return bool(in_picture(place[None], np.array([yaw]), corners, 90.0).all())

    assert fits(back + 1e-6)
    if back > 0.5:
        assert not fits(back - 0.06 * (reach + back + dz) - 0.5)


def test_a_post_between_is_stepped_round(tmp_path):
    bus = instance("bus", box((-4.0, -1.2, 0.3), (4.0, 1.2, 3.2)))
    # Before the middle of the south side stand a post and a booth: one hides, the other only takes the eye.
    post = instance("post", box((-0.3, -4.0, 0.0), (0.3, -3.4, 4.0)))
    booth = instance("booth", box((1.0, -4.4, 0.0), (2.0, -3.4, 2.4)))
    wall = instance("wall", box((-20.0, 2.0, 0.0), (20.0, 2.2, 6.0)))
    place = scene(told(bus, fronts=[-NORTH]), post, booth, wall)
    best = anchors(place, "bus", tmp_path)[0]
    assert best["off_front_rad"] <= FRONT_RAD
    assert best["part_unoccluded"] > 0.9
    assert best["part_open"] > 0.9


def test_seen_share_counts_what_faces_the_camera_in_the_picture_and_unhidden():
    panel = instance("panel", box((-0.5, 0.0, 1.0), (0.5, 0.02, 2.0)))
    wall = instance("wall", box((-0.5, -1.0, 0.0), (0.5, -0.9, 3.0)))
    north = Surface(panel.vertices, panel.faces[np.isclose(panel.vertices[panel.faces][..., 1], 0.02).all(axis=1)])
    eyes = np.array([[0.0, 1.5, 1.5], [0.0, -2.5, 1.5], [1.4, 0.3, 1.5], [0.0, 1.5, 1.5]])
    yaws = np.array([-NORTH, NORTH, math.pi, NORTH])
    rays = RayCaster(scene(panel, wall))
    patch = Patch.of(north, 200, np.random.default_rng(0), rays, (0.0, 1.0, 0.0))
    assert patch.lit[:, 0].all() or patch.lit[:, 1].all()
    front, behind, edge, turned = visible_shares(eyes, yaws, [patch], rays, 90.0)[:, 0]
    assert front > 0.9
    assert behind == turned == 0.0
    assert 0.0 < edge < 0.5
    dark = Patch.of(north, 200, np.random.default_rng(0), rays, (0.0, -1.0, 0.0))
    assert visible_shares(eyes[:1], yaws[:1], [dark], rays, 90.0)[0, 0] == pytest.approx(0.8 * front)


@settings(max_examples=100, deadline=None)
@given(st.floats(-math.pi, math.pi), st.lists(st.floats(-math.pi, math.pi), min_size=1, max_size=2))
def test_off_front_is_the_angle_to_the_nearest_front(azimuth, fronts):
    place = np.array([[4.0 + math.cos(azimuth), 5.0 + math.sin(azimuth), 6.3]])
    wanted = min(math.acos(max(-1.0, min(1.0, math.cos(azimuth - f)))) for f in fronts)
    assert off_front_rad(place, (4.0, 5.0, 6.0), fronts)[0] == pytest.approx(wanted, abs=1e-6)
