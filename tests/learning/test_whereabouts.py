"""Where a policy thinks its goal to be: carried over by its own motion, and by nothing else of its own."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from aerialdojo_gen.geometry.motion import replay
from aerialdojo_gen.learning.encoding import DeadReckoning
from aerialdojo_gen.learning.labels import to_body_frame

torch = pytest.importorskip("torch", reason="PyTorch is not installed: it is the extra 'train'")

from aerialdojo_gen.learning import network as networks  # noqa: E402 - it needs torch
from aerialdojo_gen.learning.network import UNIT_M, Localization, LocalizationOutput  # noqa: E402

T, SCENES = 9, 3
START, GOAL = np.array([31.0, -12.0, 6.0, 2.3]), np.array([-8.0, 20.0, 9.0])


@pytest.fixture(scope="module")
def flight():
    """Poses of an episode, its own motion, and where the goal is seen from each."""
    actions = np.random.default_rng(3).integers(1, 16, T - 1)
    poses = replay(START, actions.tolist())
    reckoning, moved = DeadReckoning(), []
    for action in [*actions, 0]:
        moved.append(reckoning.odometry)
        reckoning.add(int(action))
    columns = {"pose": poses, "odometry": moved, "offset": to_body_frame(poses, GOAL)}
    rows = {name: torch.from_numpy(np.asarray(value, np.float32)[None]) for name, value in columns.items()}
    return rows | {"mask": torch.ones((1, T), dtype=torch.bool), "scene": torch.tensor([1])}


def interval_logits(value, centres, width):
    """Logits of intervals that have this mean: of the two whose middles are next to it."""
    near = (1.0 - (value[..., None] - centres).abs() / width).clamp(min=0.0)
    return near.log().clamp(min=-80.0)


def place_logits(place):
    x, y, z = place.unbind(-1)
    plane, level = torch.arange(64) * 4.0 - 126.0, torch.arange(36) * 2.0 - 23.0
    axes = (x, plane, 4.0), (y, plane, 4.0), (z, level, 2.0)
    return torch.cat([interval_logits(*axis) for axis in axes], dim=-1)


def heading_logits(yaw):
    """So steep that the mean of the two sectors about it is the yaw, to a hundredth of a degree."""
    sectors = torch.deg2rad(torch.arange(24) * 15.0 - 172.5)
    off = torch.rad2deg(torch.remainder(yaw[..., None] - sectors + np.pi, 2 * np.pi) - np.pi).abs() / 15.0
    return (1.0 - off).clamp(min=0.0).log().clamp(min=-80.0)


def scene_logits(number=1):
    return torch.nn.functional.one_hot(torch.full((1, T), number), SCENES) * 20.0


def error_m(flight, place, yaw, goal, trust):
    """How far off the goal's offset is where a localization guesses this at every step."""
    made = Localization(4, 4, 4, SCENES)
    body = torch.cat([place_logits(place), heading_logits(yaw), scene_logits(), trust], dim=-1)
    # In the place of layers: their outputs.
    for name, value in (("body", body), ("target", place_logits(goal))):
        delattr(made, name)
        setattr(made, name, lambda _, value=value: value)
    guess, _ = made(torch.zeros(1, T, 4), torch.zeros(1, 4), flight["odometry"], torch.zeros(1, made.sums))
    return torch.linalg.vector_norm(guess.offset * UNIT_M - flight["offset"], dim=-1)


def truth(flight):
    goal = torch.from_numpy(GOAL.astype(np.float32)).expand(1, T, 3)
    return flight["pose"][..., :3].clone(), flight["pose"][..., 3].clone(), goal


def test_logits_of_intervals_have_a_mean_place_and_direction():
    draw = torch.Generator().manual_seed(2)
    wide = torch.tensor([120.0, 120.0, 20.0])
    place = (torch.rand(200, 3, generator=draw) * 2.0 - 1.0) * wide
    mean, spread = networks.places(place_logits(place))
    assert torch.allclose(mean, place, atol=1e-3)
    # Of two intervals at most half of one; who has no idea is a quarter of all intervals off, and more.
    assert float((spread / torch.tensor([4.0, 4.0, 2.0])).max()) <= 0.5 + 1e-3
    assert bool((networks.places(torch.zeros(5, 164))[1] > torch.tensor([70.0, 70.0, 20.0])).all())
    yaw = (torch.rand(200, generator=draw) * 2.0 - 1.0) * np.pi
    mean = networks.directions(heading_logits(yaw))
    assert float(torch.linalg.vector_norm(mean, dim=-1).min()) > 10.0
    assert float(networks.directions(torch.zeros(1, 24)).abs().max()) < 1e-5
    turned = torch.atan2(mean[:, 1], mean[:, 0]) - yaw
    assert float((torch.remainder(turned + np.pi, 2 * np.pi) - np.pi).abs().max()) < np.deg2rad(0.1)


def test_right_guesses_say_where_the_goal_is_and_one_sure_look_is_remembered(flight):
    """What is wildly wrong and unsure afterwards does not matter: own motion carries the one good look on."""
    place, yaw, goal = truth(flight)
    trust = torch.randn(1, T, 1, generator=torch.Generator().manual_seed(1))
    assert float(error_m(flight, place, yaw, goal, trust).max()) < 0.1
    place[:, 1:] += 40.0
    yaw[:, 1:] = 1.0
    sure = torch.full((1, T, 1), -20.0)
    sure[:, 0] = 50.0
    assert float(error_m(flight, place, yaw, goal, sure).max()) < 0.2
    # The same looks, all trusted alike, are far off.
    assert float(error_m(flight, place, yaw, goal, 0.0 * sure)[0, -1]) > 10.0


def test_the_loss_falls_only_where_each_guess_is_right(flight):
    """No logits have a smaller loss than those of the truth: each guess moved off it costs more."""
    place, yaw, goal = truth(flight)
    right = LocalizationOutput(
        flight["offset"] / UNIT_M, place_logits(place), heading_logits(yaw), scene_logits(), place_logits(goal),
    )  # fmt: skip
    least = float(networks.offset_loss(right, flight))
    assert float(networks.offset_loss(right._replace(offset=right.offset + 0.5), flight)) == pytest.approx(
        least + 0.125
    )
    for wrong in (
        {"place": place_logits(place + 3.0)}, {"goal": place_logits(goal - 3.0)},
        {"heading": heading_logits(yaw + 0.5)}, {"scene": scene_logits(2)},
    ):  # fmt: skip
        assert float(networks.offset_loss(right._replace(**wrong), flight)) > least + 1.0


@pytest.fixture(scope="module")
def episode():
    torch.manual_seed(0)
    network = networks.Network(networks.Shape(50, 1, 32, 2, (8, 8, 8), 16, 8, 24)).eval()
    draw = torch.Generator().manual_seed(5)
    given = {
        "pictures": torch.randint(0, 256, (2 * T, 1, 32, 32, 4), dtype=torch.uint8, generator=draw),
        "odometry": torch.randn(2, T, 4, generator=draw),
        "mask": torch.ones((2, T), dtype=torch.bool),
    }
    images = torch.randint(0, 256, (2, 32, 32, 4), dtype=torch.uint8, generator=draw)
    with torch.no_grad():
        goal = network.encode_goal(torch.randint(1, 50, (2, 64), generator=draw), images, torch.tensor([True, False]))
    return network, goal, given


def test_flown_step_by_step_it_chooses_as_it_learned(episode):
    network, goal, given = episode
    with torch.no_grad():
        all_at_once, end = network(goal=goal, **given)
        memory, pictures = None, given["pictures"].reshape(2, T, 1, 32, 32, 4)
        for k in range(T):
            at = [given[name][:, k : k + 1] for name in ("odometry", "mask")]
            output, memory = network(pictures[:, k], goal, *at, memory)
            assert torch.allclose(output.logits[:, 0], all_at_once.logits[:, k], atol=1e-5)
            assert torch.allclose(output.estimate.offset[:, 0], all_at_once.estimate.offset[:, k], atol=1e-4)
    assert torch.allclose(memory, end, atol=1e-5)


def test_choices_teach_the_guess_nothing(episode):
    network, goal, given = episode
    output, _ = network(goal=goal.detach(), **given)
    output.logits.sum().backward()
    assert all(p.grad is None or not p.grad.any() for p in network.whereabouts.parameters())
    assert network.choice[0].weight.grad.any()


TURN = {14: 51.0, 15: 50.0}


@pytest.mark.parametrize(
    ("logits", "blocked", "away_m", "back", "chosen"),
    [
        ({0: 9.0, 5: 8.0}, {}, 1.9, (), 0),  # it stops where it thinks to have arrived
        ({5: 8.0}, {}, 1.9, (), 0),
        ({0: 9.0, 5: 8.0}, {}, 2.1, (), 5),  # and nowhere else, likely as it may be
        (TURN, {}, 30.0, (), 14),
        (TURN | {3: 8.0}, {}, 30.0, (14,), 3),  # who would come back goes on: by no turn,
        (TURN | {3: 8.0}, {}, 30.0, (14, 3), 1),  # and by nothing that leads back;
        (TURN, {}, 30.0, range(16), 14),  # where all lead back by anything but Stop
        ({3: 9.0, 2: 8.0}, {3: 20.0, 2: -4.6}, 30.0, (), 2),  # likely but surely blocked, then blocked 1 in 100
        ({3: 9.0, 2: 8.0}, {3: 20.0, 2: 2.2}, 30.0, (), 1),  # and 9 in 10
    ],
)
def test_of_likely_actions_it_takes_one_that_is_free_and_leads_on(logits, blocked, away_m, back, chosen):
    def row(of, rest, kind=torch.float32):
        out = torch.full((1, 1, 16), rest, dtype=kind)
        for action, value in of.items():
            out[..., action] = value
        return out

    estimate = LocalizationOutput(torch.tensor([[[0.6, 0.0, -0.8]]]) * away_m / UNIT_M, *[None] * 4)
    output = networks.PolicyOutput(row({1: 4.0, 2: 3.9} | logits, 0.0), row(blocked, -20.0), estimate)
    assert output.actions(row(dict.fromkeys(back, True), False, torch.bool)).item() == chosen


def test_what_was_refused_is_not_tried_again_from_there():
    reckoning = DeadReckoning()
    reckoning.add(2, refused=True)
    assert not reckoning.odometry.any()
    assert reckoning.back.nonzero()[0].tolist() == [2]
    reckoning.add(14)
    assert reckoning.back.nonzero()[0].tolist() == [15], "a turn aside it is another action"


@example([14] * 11, 14)
@example([14] * 12, 14)  # half a circle, of 24 headings
@example([14] * 12 + [10], 12)
@example([2, *[15] * 6] * 4, 2)  # about a square: its last side leads to where it began
@given(st.lists(st.integers(1, 15), max_size=40), st.integers(1, 15))
def test_only_what_leads_back_is_marked_so(actions, last):
    """By poses that are replayed: the same place and heading as before, or turns beyond half a circle."""
    reckoning = DeadReckoning()
    for action in actions:
        reckoning.add(action)
    poses = replay(np.zeros(4), [*actions, last])
    there, been = poses[-1], poses[:-1]
    turned = np.abs(np.angle(np.exp(1j * (been[:, 3] - there[3])))) < 1e-6
    near = np.linalg.norm(been[:, :3] - there[:3], axis=1)
    # Rounded to a grid, so that places half a step apart are one or two.
    same, distinct = bool((turned & (near < 1e-6)).any()), not (turned & (near < 0.5)).any()
    in_a_row = next((k for k, a in enumerate(reversed(actions)) if a < 14), len(actions))
    if last >= 14 and in_a_row >= 12:
        assert reckoning.back[last]
    elif same or distinct:
        assert reckoning.back[last] == same


def test_the_goal_knows_no_more_of_the_pictures_than_the_scene(flight):
    """Other pictures, taken for the same scene, put the goal at the same place."""
    torch.manual_seed(4)
    made = Localization(6, 5, 16, SCENES).eval()
    seen, goal = torch.randn(2, T, 6), torch.randn(1, 5).expand(2, 5)
    with torch.no_grad():
        made.body[2].bias[164 + 24 + 1] += 60.0
        guess, _ = made(seen, goal, flight["odometry"].expand(2, T, 4), torch.zeros(2, made.sums))
        made.body[2].bias[164 + 24 + 1] -= 120.0
        other, _ = made(seen, goal, flight["odometry"].expand(2, T, 4), torch.zeros(2, made.sums))
    assert not torch.allclose(guess.place[0], guess.place[1])
    assert torch.allclose(guess.goal[0], guess.goal[1], atol=1e-5)
    assert not torch.allclose(guess.goal, other.goal, atol=1e-3)
