"""Anchors: where they are, what they see, of things with a front and identifying parts too, and a person's choice."""

import logging
import math

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from support.handmade import box, instance, job_of, mesh_of, scene, write_rows, write_scene, xyz

from aerialdojo_gen.base.config.sections import AnchorSampleConfig
from aerialdojo_gen.base.config.shared import Embodiment
from aerialdojo_gen.base.errors import AnnotationError, StoreError
from aerialdojo_gen.geometry.cameras import Camera, project, view_pose
from aerialdojo_gen.geometry.frames import wrap_angle_rad
from aerialdojo_gen.geometry.part_visibility import FRONT_RAD, Patch, in_picture, off_front_rad, visible_shares
from aerialdojo_gen.geometry.rays import RayCaster
from aerialdojo_gen.geometry.surface import Surface
from aerialdojo_gen.geometry.viewpoints import shortlist
from aerialdojo_gen.pipeline.stages.work import anchor_sample
from aerialdojo_gen.pipeline.stages.work.anchor_choice import is_same
from aerialdojo_gen.pipeline.stages.work.anchor_pictures import fitting_m
from aerialdojo_gen.pipeline.stages.work.anchor_sample import World, anchors_of
from aerialdojo_gen.scenes.model import Anatomy, Instance, Run
from aerialdojo_gen.store import schemas
from aerialdojo_gen.store.tables import check_table

CONFIG = AnchorSampleConfig()
RADIUS = Embodiment().radius_m


def item(thing, object_id=0):
    return {"object_id": object_id, "name": thing.node, "mesh_node": thing.node, **xyz(thing.centroid)}


def find(place, node, tmp_path, config=CONFIG, seed=0):
    job = job_of("anchor-sample", tmp_path, seed=seed)
    return anchors_of(item(place[node]), World.of(place, RADIUS, CONFIG.margin_m), job, config)[:2]


def place_of(row):
    return np.array([row["x_m"], row["y_m"], row["z_m"]])


BALL = instance("ball", trimesh.creation.icosphere(3, radius=0.6).apply_translation([2.0, 1.0, 1.5]))
BUS = instance("bus", box((-5.0, -1.2, 0.3), (5.0, 1.2, 3.2)), box((-4.0, -1.3, 0.0), (4.0, -1.0, 0.8)))
MAST = trimesh.creation.cylinder(0.15, 7.0).apply_translation([0, 0, 3.5])
PYLON = instance("pylon", MAST, box((-0.2, -2.0, 5.5), (0.2, 2.0, 8.0)))
ARCH = instance(
    "arch", box((-4, -0.3, 0), (-3.4, 0.3, 5)), box((3.4, -0.3, 0), (4, 0.3, 5)), box((-4, -0.3, 5), (4, 0.3, 5.6))
)
CONE = instance("cone", trimesh.creation.cone(0.2, 0.6).apply_translation([0, 0, 0.0]))
SHAPES = [BALL, BUS, PYLON, ARCH, CONE]


@pytest.mark.parametrize("thing", SHAPES, ids=[t.node for t in SHAPES])
def test_anchors_in_the_open_are_where_they_must_be_on_sides_45_degrees_apart(thing, tmp_path):
    place = scene(thing)
    rows, rejected = find(place, thing.node, tmp_path)
    assert len(rows) == 3
    assert [r["anchor_id"] for r in rows] == [0, 1, 2]
    assert [r["selected"] for r in rows] == [True, False, False]
    scores = [r["score"] for r in rows]
    assert scores == sorted(scores, reverse=True)
    assert min(scores) > 0.0
    assert max(scores) <= 1.0
    for r in rows:
        p = place_of(r)
        _, (own,), _ = trimesh.proximity.closest_point(mesh_of(thing), [p])
        assert r["surface_distance_m"] == pytest.approx(own, abs=1e-9)
        facing = thing.centroid[:2] - p[:2]
        assert facing @ [math.cos(r["yaw_rad"]), math.sin(r["yaw_rad"])] == pytest.approx(np.linalg.norm(facing))
        # The ground hides nothing of what stands on it from somebody above the ground.
        assert r["visible_fraction"] == 1.0
        assert (p >= place.bounds[0] + RADIUS).all()
        assert (p <= place.bounds[1] - RADIUS).all()
    assert sum(rejected.values()) + len(rows) >= 48
    angle = [math.atan2(*(place_of(r) - thing.centroid)[[1, 0]]) for r in rows]
    apart = [abs(float(wrap_angle_rad(a - b))) for k, a in enumerate(angle) for b in angle[:k]]
    assert min(apart) >= math.radians(44.99)


def test_visible_fraction_is_the_share_that_others_leave(tmp_path):
    panel = instance("panel", box((-0.05, -0.9, 0.0), (0.05, 0.9, 1.8)))
    # A board before the lower half of the panel, seen level from 1 m in front.
    board = instance("board", box((0.1, -4.0, 0.0), (0.12, 4.0, 0.9)))
    config = AnchorSampleConfig(elevations_deg=(0.0,), surface_points=2000, min_visible_fraction=0.0, shortlist=16)
    rows, _ = find(scene(panel, board), "panel", tmp_path, config)
    front = max(rows, key=lambda r: r["x_m"] - abs(r["y_m"]))
    assert abs(front["y_m"]) < 1e-6
    # The sight line over the board's edge from z 0.9 at 0.93 m goes on level: just the upper half is left.
    assert front["visible_fraction"] == pytest.approx(0.5, abs=0.03)
    back = min(rows, key=lambda r: r["x_m"] + abs(r["y_m"]))
    assert back["visible_fraction"] == 1.0


def clear_sight(mesh, origin, points):
    """By trimesh's own ray caster, in float64: whether nothing stands before each point."""
    way = points - origin
    length = np.linalg.norm(way, axis=1)
    caster = trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    hits, ray, _ = caster.intersects_location(np.tile(origin, (len(points), 1)), way / length[:, None])
    nearest = np.full(len(points), np.inf)
    np.minimum.at(nearest, ray, np.linalg.norm(hits - origin, axis=1))
    return nearest >= length - 5e-3


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.nightly)])
def test_anchors_among_clutter_agree_with_trimesh(seed, tmp_path):
    rng = np.random.default_rng(seed)
    target = instance("target", box((-0.7, -0.4, 0.0), (0.6, 0.5, 1.7)), box((-0.2, -0.2, 1.7), (0.2, 0.2, 2.4)))
    # Twigs and boards, most of them between the target and where its anchors are.
    turn, out = rng.uniform(0, 2 * math.pi, 30), rng.uniform(1.0, 1.4, 30)
    low = np.column_stack([out * np.cos(turn), out * np.sin(turn), rng.uniform(0, 2.0, 30)])
    size = rng.uniform(0.03, 0.5, (30, 3))
    clutter = [instance(f"twig_{k}", box(low[k] - size[k] / 2, low[k] + size[k] / 2)) for k in range(30)]
    place = scene(target, *clutter)
    config = AnchorSampleConfig(shortlist=8, min_visible_fraction=0.2, surface_points=1500)
    rows, rejected = find(place, "target", tmp_path, config)
    assert len(rows) >= 3
    assert rejected["in_collision"] > 0
    assert min(r["visible_fraction"] for r in rows) < 0.9
    own, whole = mesh_of(target), trimesh.util.concatenate([mesh_of(i) for i in place.instances])
    for r in rows:
        p = place_of(r)
        _, (to_own, *_), _ = trimesh.proximity.closest_point(own, [p])
        _, (to_any, *_), _ = trimesh.proximity.closest_point(whole, [p])
        assert to_own == pytest.approx(1.0, abs=1e-3)
        assert to_any == pytest.approx(r["clearance_m"], abs=1e-4)
        assert to_any > RADIUS + CONFIG.margin_m - 1e-6
        points = np.asarray(trimesh.sample.sample_surface(own, 1200, seed=seed)[0])
        forward = np.array([math.cos(r["yaw_rad"]), math.sin(r["yaw_rad"]), 0.0])
        ahead = (points - p) @ forward
        aside = (points - p) @ [-forward[1], forward[0], 0.0]
        points = points[(ahead > 0) & (np.abs(aside) <= ahead) & (np.abs(points[:, 2] - p[2]) <= ahead)]
        points = points[clear_sight(own, p, points)]
        assert r["visible_fraction"] == pytest.approx(clear_sight(whole, p, points).mean(), abs=0.12)
        assert r["visible_fraction"] >= 0.2


def test_an_object_in_a_sealed_room_has_no_anchor(tmp_path):
    lamp = instance("lamp", box((-0.2, -0.2, 1.0), (0.2, 0.2, 1.8)))
    walls = [
        box((-4, -4, 0), (-3.8, 4, 4)), box((3.8, -4, 0), (4, 4, 4)), box((-4, -4, 0), (4, -3.8, 4)),
        box((-4, 3.8, 0), (4, 4, 4)), box((-4, -4, 3.8), (4, 4, 4)),
    ]  # fmt: skip
    rows, rejected = find(scene(lamp, instance("room", *walls)), "lamp", tmp_path)
    assert rows == []
    assert rejected["unreachable"] >= 24
    door = [*walls[:1], box((3.8, -4, 0), (4, -1.5, 4)), box((3.8, 1.5, 0), (4, 4, 4)), *walls[2:]]
    rows, _ = find(scene(lamp, instance("room", *door)), "lamp", tmp_path)
    assert len(rows) == 3


def test_an_anchor_stays_inside_the_flight_volume(tmp_path):
    bench = instance("bench", box((14.0, -1.0, 0.0), (14.9, 1.0, 0.9)))
    rows, rejected = find(scene(bench), "bench", tmp_path)
    assert rejected["out_of_bounds"] > 0
    assert all(r["x_m"] <= 15.0 - RADIUS for r in rows)


def test_an_open_mesh_with_normals_inward_is_judged_by_what_is_seen(tmp_path):
    turned = trimesh.Trimesh(BALL.vertices, BALL.faces[:, ::-1], process=False)
    rows, _ = find(scene(BALL), "ball", tmp_path)
    other, _ = find(scene(instance("ball", turned)), "ball", tmp_path)
    assert [r["visible_fraction"] for r in other] == [1.0] * 3
    assert [r["score"] for r in other] == pytest.approx([r["score"] for r in rows], abs=0.03)


def test_same_seed_same_rows_and_another_seed_other_sample_points(tmp_path):
    tree = instance("tree", *[
        trimesh.creation.icosphere(2, radius=0.8).apply_translation([0.5 * k, 0.3 * k * (-1) ** k, 2 + 0.4 * k])
        for k in range(4)
    ])  # fmt: skip
    hedge = instance("hedge", box((-3, 1.9, 0), (3, 2.2, 2.5)))
    place = scene(tree, hedge)
    first, again, other = (find(place, "tree", tmp_path, seed=s)[0] for s in (0, 0, 1))
    assert first == again
    assert [r["score"] for r in first] != [r["score"] for r in other]


def test_shortlist_prefers_sides_apart_then_score():
    azimuth = np.radians([0.0, 10.0, 45.0, 90.0, 180.0])
    assert shortlist(np.array([0.9, 0.89, 0.8, 0.7, 0.1]), azimuth, 3, math.radians(45)).tolist() == [0, 2, 3]
    assert shortlist(np.array([0.5, 0.9]), np.radians([0.0, 5.0]), 3, math.radians(45)).tolist() == [1, 0]
    # No third one is 45° from both: the better of those that lack least wins, and ranks follow the score.
    azimuth = np.radians([0.0, 60.0, 20.0, 5.0])
    assert shortlist(np.array([0.9, 0.3, 0.6, 0.6]), azimuth, 3, math.radians(45)).tolist() == [0, 2, 1]
    assert shortlist(np.zeros(0), np.zeros(0), 3, math.radians(45)).tolist() == []


def whole_run(place, objects, data, seed=0, chosen=()):
    """The stage on real tables and a real mesh file."""
    write_scene(data, place)
    write_rows(data, "objects", [item(thing, k) for k, thing in enumerate(objects)])
    write_rows(data, "chosen_anchors", chosen)
    return anchor_sample.run(job_of("anchor-sample", data, seed=seed), CONFIG)


def test_the_stage_accounts_for_every_candidate_and_names_objects_without_anchors(tmp_path, caplog):
    walled = instance("safe", box((8, 8, 0.5), (9, 9, 1.5)))
    vault = instance("vault", box((5, 5, 0), (12, 12, 6)))
    bus = instance("bus", box((-6.0, -1.2, 0.3), (4.0, 1.2, 3.2)))
    with caplog.at_level(logging.WARNING):
        out = whole_run(scene(bus, walled, vault), [bus, walled], tmp_path)
    table = check_table(schemas.ANCHORS, out.tables["anchors"])
    assert table["object_id"].to_pylist() == [0, 0, 0]
    reasons = {k: n for k, n in out.counts.items() if k != "no_anchor"}
    assert out.rows_in == out.rows_out + sum(reasons.values())
    assert out.rows_out == 3
    assert out.rows_in >= 2 * 48
    assert out.counts["no_anchor"] == 1
    assert "object 1 (safe) has no anchor: unreachable" in caplog.text


def test_an_object_of_another_scene_is_refused_in_one_line(tmp_path):
    with pytest.raises(StoreError, match=r"object 0 \(ball\) has the mesh node 'ball', which is not in the scene"):
        whole_run(scene(BUS), [BALL], tmp_path)


def choice(position, yaw_rad):
    return {"object_id": 0, **xyz(position), "yaw_rad": yaw_rad}


def test_the_anchor_that_a_person_chose_comes_first_and_is_selected(tmp_path):
    place = scene(BALL, BUS)
    by_itself = whole_run(place, [BALL, BUS], tmp_path)
    auto = by_itself.tables["anchors"].to_pylist()
    third = auto[2]
    rounded = choice([round(v, 3) for v in place_of(third)], math.radians(round(math.degrees(third["yaw_rad"]), 2)))
    out = whole_run(place, [BALL, BUS], tmp_path, chosen=[rounded])
    rows = out.tables["anchors"].to_pylist()
    assert [(r["object_id"], r["anchor_id"]) for r in rows] == [(o, k) for o in (0, 1) for k in range(3)]
    assert [place_of(r).tolist() for r in rows[:3]] == [place_of(auto[k]).tolist() for k in (2, 0, 1)]
    assert [r["selected_by"] for r in rows[:3]] == ["annotation", "auto", "auto"]
    assert [r["selected"] for r in rows[:3]] == [True, False, False]
    assert rows[3:] == auto[3:]

    by_hand = choice(BALL.centroid + np.array([0.0, 1.75, 0.0]), -math.pi / 2)
    out = whole_run(place, [BALL, BUS], tmp_path, chosen=[by_hand])
    placed, *others = out.tables["anchors"].to_pylist()[:3]
    assert place_of(placed).tolist() == [by_hand[f"{a}_m"] for a in "xyz"]
    assert (placed["selected"], placed["selected_by"]) == (True, "annotation")
    assert placed["surface_distance_m"] == pytest.approx(1.15, abs=0.02)
    assert placed["visible_fraction"] > 0.95
    assert [place_of(r).tolist() for r in others] == [place_of(r).tolist() for r in auto[:2]]
    # The shortlist's last gave way to the one placed by hand, which is a candidate more.
    assert out.counts["not_shortlisted"] == by_itself.counts["not_shortlisted"] + 1
    assert out.rows_in == by_itself.rows_in + 1


@pytest.mark.parametrize(
    ("moved_m", "turned_deg", "same"),
    [(0.0, 0.0, True), (0.0019, 0.0, True), (0.0021, 0.0, False), (0.0, 0.019, True), (0.0, -0.021, False)],
)
@pytest.mark.parametrize("yaw_deg", [0.0, 180.0, -179.995])
def test_a_choice_is_a_sampled_anchor_up_to_the_digits_of_its_file(yaw_deg, moved_m, turned_deg, same):
    """Also where the yaw is due west, which files write as 180° or as -180°."""
    row = choice(np.array([1.0, 2.0, 3.0]), math.radians(yaw_deg))
    for turns in (-1, 0, 1):
        chosen = choice(np.array([1.0, 2.0, 3.0 - moved_m]), math.radians(yaw_deg + turned_deg + 360.0 * turns))
        assert is_same(row, chosen) is same


@pytest.mark.parametrize(
    ("away", "yaw", "why"),
    [
        ((0, 0.8, 0), -math.pi / 2, "in collision: the nearest surface is 0.20 m away"),
        ((0, 4.0, 0), -math.pi / 2, "too far: 3.40 m"),
        ((0, 1.6, 0), math.pi / 2, "does not see the object"),
        ((0, 0, 500.0), 0.0, "outside the flight volume"),
    ],
)
def test_a_chosen_anchor_that_will_not_do_is_named(tmp_path, away, yaw, why):
    with pytest.raises(AnnotationError, match=rf"object 0 \(ball\) will not do: .*{why}.*annotate --scene U_Test_0"):
        whole_run(scene(BALL), [BALL], tmp_path, chosen=[choice(BALL.centroid + away, yaw)])


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


def test_a_thing_is_looked_at_from_its_front_where_its_telling_part_is_seen(tmp_path):
    best = find(scene(CABINET), "cabinet", tmp_path)[0][0]
    assert best["off_front_rad"] <= math.radians(30)
    assert best["y_m"] > 0.3
    assert best["part_tells"] > 0.5
    assert best["no_front_reason"] is None


def test_without_an_anatomy_nothing_is_said_of_fronts(tmp_path):
    plain = Instance("cabinet", "cabinet", "", {}, CABINET.parts)
    rows = find(scene(plain), "cabinet", tmp_path)[0]
    assert {(r["off_front_rad"], r["part_tells"], r["part_front"], r["no_front_reason"]) for r in rows} == {
        (None,) * 4
    }


def test_a_front_against_a_wall_is_told_as_such(tmp_path):
    wall = instance("wall", box((-9.0, 0.6, 0.0), (9.0, 1.0, 6.0)))
    best = find(scene(CABINET, wall), "cabinet", tmp_path)[0][0]
    assert best["off_front_rad"] > FRONT_RAD
    assert best["no_front_reason"] in ("in_collision", "not_visible", "unreachable", "no_surface")


def test_the_shortlist_has_a_view_from_the_front_where_there_is_one(tmp_path):
    # In the north a hedge of posts spoils the view, and leaves some.
    posts = [instance(f"post{k}", box((x, 0.9, 0.0), (x + 0.06, 0.96, 3.0))) for k, x in enumerate((-0.6, 0.0, 0.6))]
    rows = find(scene(CABINET, *posts), "cabinet", tmp_path)[0]
    assert any(row["off_front_rad"] <= FRONT_RAD for row in rows)


def test_a_lamp_high_on_its_pole_is_seen_from_where_it_is(tmp_path):
    lamp = told(
        instance("lamp", box((-0.06, -0.06, 0.0), (0.06, 0.06, 6.8)), box((0.06, -0.2, 6.5), (1.2, 0.2, 6.7))),
        tells=["head"], runs=[("head", 1)],
    )  # fmt: skip
    best = find(scene(lamp), "lamp", tmp_path)[0][0]
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
    best = find(place, "bus", tmp_path)[0][0]
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
