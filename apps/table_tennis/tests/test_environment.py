"""The table-tennis environments: one step order in all modes, honest spaces, nothing left."""

import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import o80
import o80_table_tennis
from o80_table_tennis.balls.sources import balls_from
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE, changed_pressures
from o80_table_tennis.task.end import EndRule
from o80_table_tennis.world.arm import MUSCLES
from o80_table_tennis.world.timing import ITERATIONS

STILL = np.zeros(MUSCLES, dtype=np.float32)
PUSH = np.array([1, -1, 0, 0, 0, 0, 0, 0], dtype=np.float32)
ALL_MODES = list(Pacing)
PATIENT = TaskSettings(factor=COARSE, most_late=1_000_000)  # however slow the machine is
WAITING = 10.0  # [s]


def opened(
    pacing: Pacing = Pacing.INLINE, *, task: TaskSettings | None = None, **rig: Any
) -> TableTennisEnvironment:
    return TableTennisEnvironment(rig=RigSettings(pacing=pacing, **rig), task=task or PATIENT)


@pytest.fixture
def inline() -> Iterator[TableTennisEnvironment]:
    with closing(opened()) as environment:
        yield environment


def played_out(environment: TableTennisEnvironment, action: np.ndarray = STILL) -> list[Any]:
    """All steps of an episode."""
    steps = []
    while not steps or not (steps[-1][2] or steps[-1][3]):
        steps.append(environment.step(action))
    return steps


def move_on(environment: TableTennisEnvironment, rows: int) -> None:
    """Lets the arm, which has a clock of its own, get ahead of the environment."""
    arm = environment.rig.arm
    arm.frontend.wait_for(arm.newest + rows, timeout=WAITING)


# ------------------------------------------------------------------------------ Gymnasium


@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
@pytest.mark.parametrize(
    ("name", "options"),
    [
        (o80_table_tennis.ACCELERATED, {}),
        (o80_table_tennis.ACCELERATED, {"processes": True}),
        (o80_table_tennis.ACCELERATED, {"rig": RigSettings(extra_balls=3, twins=2)}),
        (o80_table_tennis.REAL_TIME, {"task": PATIENT}),
    ],
)
def test_gymnasium_finds_nothing_to_complain_of(
    name: str, options: dict[str, Any], render_mode: str | None
) -> None:
    environment = gymnasium.make(name, render_mode=render_mode, **options)
    with closing(environment), warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        check_env(environment.unwrapped)


def test_only_the_environment_by_the_clock_is_nondeterministic() -> None:
    assert not gymnasium.spec(o80_table_tennis.ACCELERATED).nondeterministic
    assert gymnasium.spec(o80_table_tennis.REAL_TIME).nondeterministic


def test_observations_stay_in_their_box_under_wild_actions(inline: TableTennisEnvironment) -> None:
    rng = np.random.default_rng(1)
    observation, _ = inline.reset(seed=2)
    over = False
    while not over:
        assert observation in inline.observation_space
        action = rng.choice([-1.0, 1.0], MUSCLES).astype(np.float32)
        observation, _, terminated, truncated, _ = inline.step(action)
        over = terminated or truncated
    assert observation in inline.observation_space


def test_what_is_returned_is_the_callers_own(inline: TableTennisEnvironment) -> None:
    first, _ = inline.reset(seed=1)
    kept = first.copy()
    second, *_ = inline.step(PUSH)
    second[:] = 7.0
    third, *_ = inline.step(PUSH)

    np.testing.assert_array_equal(first, kept)
    assert not np.shares_memory(second, third)
    assert third in inline.observation_space


@pytest.mark.parametrize("action", [np.zeros(7), np.full(MUSCLES, np.nan)])
def test_a_wrong_action_is_refused(inline: TableTennisEnvironment, action: np.ndarray) -> None:
    inline.reset(seed=1)
    with pytest.raises(ValueError, match="an action"):
        inline.step(action)


def test_a_step_needs_an_episode(inline: TableTennisEnvironment) -> None:
    with pytest.raises(gymnasium.error.ResetNeeded, match="no episode has begun: call reset"):
        inline.step(STILL)
    inline.reset(seed=1)
    played_out(inline)
    with pytest.raises(gymnasium.error.ResetNeeded, match="the episode is over: call reset"):
        inline.step(STILL)


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"rig": {"twins": 2}}, TypeError, r"write rig=.*settings\.RigSettings\(twins=2\)"),
        ({"task": 3}, TypeError, r"task must be a TaskSettings, got 3: write task=.*\(\.\.\.\)"),
        ({"render_mode": "human"}, ValueError, "use 'rgb_array', whose render.. returns pictures"),
        ({"render_mode": "ansi"}, ValueError, "unknown render mode 'ansi'; there are: rgb_array"),
    ],
)
def test_what_gymnasium_passes_on_is_checked(
    arguments: dict[str, Any], error: type[Exception], text: str
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of Gymnasium, of modes it does not know
        with pytest.raises(error, match=text):
            gymnasium.make(o80_table_tennis.ACCELERATED, **arguments)


def test_without_a_renderer_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "OpenGL", None)
    with closing(gymnasium.make(o80_table_tennis.ACCELERATED, render_mode="rgb_array")) as made:
        made.reset(seed=1)
        with pytest.raises(o80.MissingExtra, match=r'pip install "o80-table-tennis\[rendering\]"'):
            made.render()


# ------------------------------------------------------------------------------ the step


@pytest.mark.parametrize("pacing", ALL_MODES)
def test_every_step_is_five_iterations_of_the_arm_and_five_of_each_twin(pacing: Pacing) -> None:
    with closing(opened(pacing, twins=2, extra_balls=1)) as environment:
        environment.reset(seed=1)
        steps = played_out(environment)
        summary, statistics = environment.summary, environment.statistics()

        assert summary.steps == len(steps)
        assert summary.arm_last - summary.arm_first == ITERATIONS * len(steps)
        assert summary.twin_last - summary.twin_first == ITERATIONS * len(steps)
        assert statistics.steps == statistics.exact_steps == len(steps)
        twins = [twin.frontend.published for twin in environment.rig.twins]
        assert twins == [summary.twin_last] * 2


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_an_action_acts_from_the_iteration_it_is_meant_for(delay: int) -> None:
    task = TaskSettings(factor=COARSE, delay=delay)
    with closing(opened(task=task)) as environment:
        environment.reset(seed=1)
        arm = environment.rig.arm
        k, before = arm.newest, arm.asked
        environment.step(PUSH)
        asked = arm.frontend.history(since=k + 1, until=k + ITERATIONS).desired

        start = np.array(arm.start_pressures)
        wanted = arm.range.raw(changed_pressures(before, PUSH, factor=COARSE))
        np.testing.assert_array_equal(asked[:delay], np.tile(start, (delay, 1)))
        np.testing.assert_array_equal(asked[delay:], np.tile(wanted, (ITERATIONS - delay, 1)))


@pytest.mark.parametrize("pacing", ALL_MODES)
def test_every_twin_mirrors_every_row_of_the_arm_bit_for_bit(pacing: Pacing) -> None:
    with closing(opened(pacing, twins=2, extra_balls=1)) as environment:
        environment.reset(seed=1)
        for _ in range(20):
            environment.step(PUSH)
        rig, rows = environment.rig, 20 * ITERATIONS
        # the arm may have moved on by its own clock
        last = environment.rig.row
        arm = rig.arm.frontend.history(since=last + 1 - rows, until=last).extended
        for twin in rig.twins:
            seen = twin.frontend.history(rows).observed.joints
            np.testing.assert_array_equal(seen["position"], arm.joint_positions)
            np.testing.assert_array_equal(seen["velocity"], arm.joint_velocities)
        assert np.abs(arm.joint_velocities[:, 0]).max() > 0.5


def test_the_ball_starts_with_the_first_step(inline: TableTennisEnvironment) -> None:
    flight = balls_from(None).flight(7)
    observation, _ = inline.reset(seed=1, options={"ball": 7})
    np.testing.assert_allclose(observation[16:19], flight.positions[0], rtol=1e-6)
    np.testing.assert_allclose(observation[19:22], flight.velocities[0], rtol=1e-6)
    for step in range(1, 10):
        observation, *_ = inline.step(STILL)
        np.testing.assert_allclose(observation[16:19], flight.positions[5 * step], rtol=1e-6)


def test_the_observation_is_the_state_after_the_action(inline: TableTennisEnvironment) -> None:
    inline.reset(seed=1)
    observation, *_ = inline.step(PUSH)
    row = inline.rig.arm.frontend.latest()

    np.testing.assert_array_equal(observation[:4], row.extended.joint_positions.astype(np.float32))
    normalised = inline.rig.arm.range.normalised(np.array(row.observed))
    np.testing.assert_allclose(observation[8:16], normalised, rtol=1e-6)


# ------------------------------------------------------------------------------ episodes


def test_a_missed_ball_costs_how_far_it_was_missed(inline: TableTennisEnvironment) -> None:
    inline.reset(seed=1, options={"ball": 0})
    steps = played_out(inline)

    assert [reward for _, reward, *_ in steps[:-1]] == [0.0] * (len(steps) - 1)
    _, reward, terminated, truncated, info = steps[-1]
    assert (terminated, truncated, info["hit"]) == (True, False, False)
    assert reward == -info["smallest_distance"] < 0
    assert info["end"] in ("passed", "floor")
    distances = [info["smallest_distance"] for *_, info in steps]
    assert distances == sorted(distances, reverse=True)


def test_an_episode_out_of_steps_is_truncated_and_paid() -> None:
    task = TaskSettings(end=EndRule(most_steps=12))
    with closing(opened(task=task)) as environment:
        environment.reset(seed=1)
        steps = played_out(environment)

        _, reward, terminated, truncated, info = steps[-1]
        assert (len(steps), terminated, truncated) == (12, False, True)
        assert info["end"] == "out of steps"
        assert reward == -info["smallest_distance"]


def test_the_seed_chooses_the_ball_and_so_do_the_options(inline: TableTennisEnvironment) -> None:
    drawn = [inline.reset(seed=seed)[0] for seed in (1, 2, 1)]
    np.testing.assert_array_equal(drawn[0], drawn[2])
    assert not np.array_equal(drawn[0], drawn[1])

    flight = balls_from(None).flight(3)
    by_number, _ = inline.reset(options={"ball": 3})
    by_flight, _ = inline.reset(options={"flight": flight})
    np.testing.assert_array_equal(by_number, by_flight)


def test_wrong_options_are_refused_with_what_there_is(inline: TableTennisEnvironment) -> None:
    with pytest.raises(ValueError, match="unknown options: bal; reset knows ball, flight"):
        inline.reset(options={"bal": 3})
    with pytest.raises(IndexError, match="there are 0 to 79"):
        inline.reset(options={"ball": 80})
    with pytest.raises(ValueError, match="simulated, real"):
        opened(ranges="imagined")
    with pytest.raises(ValueError, match="within its step"):
        TaskSettings(delay=5)


def test_extra_balls_are_judged_as_if_each_were_played_alone() -> None:
    actions = np.random.default_rng(4).uniform(-1, 1, (300, MUSCLES)).astype(np.float32)
    with closing(opened(extra_balls=5, twins=2)) as environment:
        _, info = environment.reset(seed=5)
        balls, played = info["virtual"]["balls"], 0
        paid, ended_after = np.zeros(5), np.zeros(5, dtype=int)
        over = False
        while not over:
            _, _, terminated, truncated, info = environment.step(actions[played])
            played += 1
            virtual = info["virtual"]
            assert virtual["observations"].shape == (5, 22)
            paid += virtual["rewards"]
            ended_after[virtual["ended"] & (ended_after == 0)] = played
            over = terminated or truncated
        assert virtual["ended"].all()

    # those whose own end came before that of the ball that was played
    whole = np.flatnonzero(ended_after < played)
    with closing(opened()) as alone:
        for ball in whole:
            alone.reset(seed=5, options={"ball": int(balls[ball])})
            for step in range(ended_after[ball]):
                _, reward, terminated, _, info = alone.step(actions[step])
            assert terminated
            assert reward == pytest.approx(paid[ball], abs=1e-6)
            assert info["hit"] == virtual["hits"][ball]


# ------------------------------------------------------------------------------ by the clock


def test_a_caller_who_pauses_too_long_loses_the_episode() -> None:
    task = TaskSettings(most_late=200)
    with closing(opened(Pacing.REAL_TIME, task=task)) as environment:
        environment.reset(seed=1)
        move_on(environment, 300)  # before the first step there is all the time in the world
        environment.step(STILL)
        twin = environment.rig.twins[0].frontend.published
        move_on(environment, 201)
        observation, reward, terminated, truncated, info = environment.step(STILL)

        assert (reward, terminated, truncated) == (0.0, False, True)
        assert info["stalled"]
        assert observation in environment.observation_space
        assert environment.rig.twins[0].frontend.published == twin
        assert environment.statistics().stalled_episodes == 1
        with pytest.raises(gymnasium.error.ResetNeeded):
            environment.step(STILL)


def test_an_action_that_comes_late_acts_at_once_and_is_counted() -> None:
    with closing(opened(Pacing.REAL_TIME)) as environment:
        environment.reset(seed=1)
        environment.step(STILL)
        k = environment.rig.row
        environment.rig.arm.frontend.wait_for(k + 7, timeout=WAITING)
        before = environment.statistics()
        environment.step(PUSH)
        after = environment.statistics()

        assert after.late_actions == before.late_actions + 1
        assert after.largest_lateness >= 2
        assert after.exact_steps == after.steps == 2


def test_a_real_arm_goes_back_to_its_start_by_commands() -> None:
    with closing(opened(Pacing.REAL_TIME)) as environment:
        first, _ = environment.reset(seed=1)
        for _ in range(40):
            environment.step(PUSH)
        moved = environment.rig.arm.newest
        again, _ = environment.reset()
        rows = environment.rig.arm.frontend.history(since=moved)

        assert not rows.fresh.any()  # no teleport
        assert np.abs(np.diff(rows.extended.joint_positions, axis=0)).max() < 0.05
        np.testing.assert_allclose(again[:4], first[:4], atol=0.06)


# ------------------------------------------------------------------------------ beside it


def test_pictures_show_what_moves() -> None:
    environment = TableTennisEnvironment(render_mode="rgb_array")
    with closing(environment):
        environment.reset(seed=1)
        first = environment.render()
        for _ in range(30):
            environment.step(PUSH)
        second = environment.render()

    assert first.shape == second.shape == (480, 640, 3)
    assert first.dtype == np.uint8
    assert (first != second).any()


@pytest.mark.parametrize("pacing", ALL_MODES)
def test_closing_leaves_nothing_behind(pacing: Pacing) -> None:
    environment = opened(pacing, twins=2, extra_balls=1)
    rig = environment.rig
    names = {rig.arm.frontend.segment, *(twin.frontend.segment for twin in rig.twins)}
    assert names <= {segment.name for segment in o80.segments()}
    environment.close()
    environment.close()

    left = {segment.name for segment in o80.segments() if segment.life == "running"}
    assert not names & left


def test_an_arm_that_runs_already_can_be_attached_to() -> None:
    settings = {"frequency": 500.0, "period": 0.002}
    with o80.robots.load("pam").start(f"pam-test-{time.monotonic_ns()}", **settings) as process:
        with closing(
            opened(Pacing.REAL_TIME, arm_segment=process.segment, attach=True)
        ) as environment:
            environment.reset(seed=1)
            environment.step(STILL)
            assert environment.statistics().exact_steps == 1
        assert process.alive
