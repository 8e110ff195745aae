"""The laws of balls for Python: those of the simulation, and estimates that rest on them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from o80.base.arrays import FloatArray
from o80_mujoco.balls import (
    Air,
    BallFilter,
    Platform,
    accelerations,
    bounced,
    path,
    predicted_flight,
)

AIR = Air(drag=0.11, magnus=0.01, spin_decay=0.5, saturation=0.06)
PLATFORM = Platform(
    height=0.78,
    low=(-0.8, 0.0),
    high=(0.8, 2.7),
    restitution=(0.5, 0.5, 0.9),
    friction=0.25,
    radius=0.02,
)
BALL = np.array([0.1, 2.9, 1.4, 0.2, -4.0, 2.0, 60.0, 5.0, -10.0])


def random_balls(count: int) -> FloatArray:
    random = np.random.default_rng(5)
    scale = [1.0, 1.0, 1.0, 5.0, 5.0, 5.0, 100.0, 100.0, 100.0]
    return random.uniform(-1, 1, (count, 9)) * scale


def test_a_path_leads_there_and_back() -> None:
    balls = random_balls(50)
    there = path(balls, 0.01, 30, AIR)
    assert there.shape == (31, 50, 9)
    np.testing.assert_array_equal(there[0], balls)
    back = path(there[-1], -0.01, 30, AIR)
    np.testing.assert_allclose(back[-1], balls, atol=1e-6)


def test_small_steps_agree_with_the_accelerations() -> None:
    balls, step = random_balls(50), 1e-4
    rate = (path(balls, step, 1, AIR)[1] - path(balls, -step, 1, AIR)[1]) / (2 * step)
    np.testing.assert_allclose(rate[:, :3], balls[:, 3:6], atol=1e-6)
    np.testing.assert_allclose(rate[:, 3:6], accelerations(balls, AIR), atol=1e-5)
    np.testing.assert_allclose(rate[:, 6:], -0.5 * balls[:, 6:], atol=1e-5)


def test_each_ball_may_have_its_own_drag() -> None:
    balls, drags = random_balls(3), np.array([0.0, 0.11, 0.5])
    found = path(balls, 0.01, 5, AIR, drags)
    for number, drag in enumerate(drags):
        air = Air(drag=drag, magnus=0.01, spin_decay=0.5, saturation=0.06)
        alone = path(balls[number : number + 1], 0.01, 5, air)
        np.testing.assert_array_equal(found[:, number], alone[:, 0])


def test_a_predicted_flight_touches_the_platform_and_nothing_beside_it() -> None:
    nodes = predicted_flight(BALL, AIR, PLATFORM, 1.5, 0.02)
    bounce = np.flatnonzero(nodes[:, 10])
    assert len(bounce) == 1
    for node in bounce:
        before, after = nodes[node - 1 : node + 1]
        assert before[0] == after[0]
        assert before[3] == pytest.approx(0.78, abs=1e-9)
        np.testing.assert_array_equal(after[1:10], PLATFORM.bounced(before[None, 1:10])[0])
        assert after[6] == pytest.approx(-0.9 * before[6])
    assert np.diff(nodes[:, 0]).min() == 0.0
    assert nodes[-1, 0] == pytest.approx(1.5)

    beside = BALL + np.eye(9)[0]
    assert predicted_flight(beside, AIR, PLATFORM, 1.5, 0.02)[-1, 3] < 0.0
    free = predicted_flight(BALL, AIR, None, 0.2, 0.02)
    np.testing.assert_allclose(free[-1, 1:10], path(BALL[None], 0.02, 10, AIR)[-1, 0])


def test_a_platform_bounces_as_a_surface_that_looks_up() -> None:
    balls = random_balls(50)
    balls[:, 5] = -np.abs(balls[:, 5])
    found = PLATFORM.bounced(balls)
    for ball, after in zip(balls, found, strict=True):
        alike = bounced(ball, (0, 0, 1), (0, 0, 0), (0.5, 0.5, 0.9), 0.25, radius=0.02)
        np.testing.assert_allclose(after, alike, atol=1e-12)


def test_a_moving_surface_is_a_surface_at_rest_for_one_who_moves_along() -> None:
    ball, velocity = BALL.copy(), np.array([1.0, -2.0, 0.5])
    ball[3:6] = [0.3, -1.0, -4.0]
    normal = (0.6, 0.0, 0.8)
    along = ball.copy()
    along[3:6] -= velocity
    moving = bounced(ball, normal, velocity.tolist(), (0.8, 0.8, 0.8), radius=0.02)
    resting = bounced(along, normal, (0, 0, 0), (0.8, 0.8, 0.8), radius=0.02)
    np.testing.assert_allclose(moving[3:6], resting[3:6] + velocity, atol=1e-12)
    np.testing.assert_allclose(moving[6:], resting[6:], atol=1e-9)


def made_filter(count: int) -> BallFilter:
    return BallFilter(
        count=count,
        air=AIR,
        platform=PLATFORM,
        before=np.full((3, 24), 0.1),
        after=np.full((2, 24), 0.05),
        step=0.01,
        mean_spin=20.0,
    )


def test_wrong_arguments_are_refused() -> None:
    each, seen = made_filter(2), np.zeros((2, 6))
    with pytest.raises(IndexError, match="which"):
        each.begin(seen, np.array([0, 2]))
    none: dict[str, Any] = {"before": np.zeros((0, 24)), "after": np.zeros((1, 24))}
    count: dict[str, Any] = {"count": 1, "step": 0.01, "mean_spin": 0.0}
    far = np.eye(9)[2] + np.eye(9)[1]
    wrong: list[tuple[Callable[[], object], str]] = [
        (lambda: each.step(seen, np.zeros(1, np.bool_)), "one measurement for each ball"),
        (lambda: path(BALL[None], 0.01, 1, AIR, np.zeros(2)), "one value for each ball"),
        (lambda: path(BALL[None], 0.01, -1, AIR), "count"),
        (lambda: path(BALL[None], np.nan, 1, AIR), "step must be a finite number"),
        (lambda: predicted_flight(BALL[:6], AIR, PLATFORM, 1.0, 0.02), "9 numbers"),
        (lambda: predicted_flight(BALL, AIR, PLATFORM, 1.0, 0.0), "at most 1000000 steps"),
        (lambda: predicted_flight(far, Air(), PLATFORM, 1e7, 1e3), "more than a million"),
        (lambda: BallFilter(air=AIR, platform=PLATFORM, **count, **none), "gains"),
        (lambda: bounced(BALL, (0, 0, 2), (0, 0, 0), (1, 1, 1), radius=0.02), "normal .* length 1"),
    ]
    for call, words in wrong:
        with pytest.raises(ValueError, match=words):
            call()


@pytest.mark.parametrize("name", ["drag", "magnus", "spin_decay", "gravity", "saturation"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_air_has_finite_numbers(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be a finite number"):
        Air(**{name: value})


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"radius": 0.0}, "radius must be positive"),
        ({"inertia": -1.0}, "inertia must be positive"),
        ({"friction": np.nan}, "friction must be 0 or more"),
        ({"restitution": (1, np.nan, 1)}, "restitution must be a finite number"),
        ({"height": np.inf}, "height must be a finite number"),
        ({"low": (0, 2)}, "low must be less than high"),
    ],
)
def test_a_platform_that_no_ball_can_bounce_on_is_refused(wrong: dict[str, Any], text: str) -> None:
    right = {"height": 0.0, "low": (0, 0), "high": (1, 1), "restitution": (1, 1, 1)}
    with pytest.raises(ValueError, match=text):
        Platform(**{**right, "radius": 0.02, **wrong})


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"step": 0.0}, "step must be positive"),
        ({"step": np.nan}, "step must be a finite number"),
        ({"mean_spin": np.inf}, "mean_spin must be a finite number"),
    ],
)
def test_a_filter_without_a_clock_is_refused(wrong: dict[str, Any], text: str) -> None:
    gains = np.zeros((1, 24))
    right = {"count": 1, "air": AIR, "platform": PLATFORM, "before": gains, "after": gains}
    with pytest.raises(ValueError, match=text):
        BallFilter(**{**right, "step": 0.01, "mean_spin": 0.0, **wrong})


def test_an_estimate_without_measurements_flies_by_the_law() -> None:
    each = made_filter(1)
    each.begin(BALL[None, :6])
    ball = np.concatenate([BALL[:6], [20.0, 0.0, 0.0]])
    for _ in range(10):
        each.step(np.zeros((1, 6)), np.ones(1, np.bool_))
    expected = path(ball[None], 0.01, 10, AIR)[-1, 0]
    np.testing.assert_array_equal(each.estimates(0.3)[0, :7], expected[:7])
