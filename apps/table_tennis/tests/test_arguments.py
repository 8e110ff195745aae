"""Wrong arguments are refused with what to give instead."""

import time
import warnings
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import gymnasium
import pytest
from opened_environment import opened

import o80
import o80_table_tennis
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.task.ball_play import ReturnTask
from o80_table_tennis.task.rewards import OrderedReward


@pytest.fixture
def inline() -> Iterator[TableTennisEnvironment]:
    with closing(opened()) as environment:
        yield environment


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"rig": {"worlds": 2}}, TypeError, r"write rig=.*settings\.RigSettings\(worlds=2\)"),
        ({"task": 3}, TypeError, r"task must be a TaskSettings, got 3: write task=.*\(\.\.\.\)"),
        (
            {"render_mode": "ansi"},
            ValueError,
            "unknown render mode 'ansi'; there are: human, rgb_array",
        ),
    ],
)
def test_what_gymnasium_passes_on_is_checked(
    arguments: dict[str, Any], error: type[Exception], text: str
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of Gymnasium, of modes it does not know
        with pytest.raises(error, match=text):
            gymnasium.make(o80_table_tennis.ACCELERATED, **arguments)


def test_wrong_options_are_refused_with_what_there_is(inline: TableTennisEnvironment) -> None:
    with pytest.raises(ValueError, match="unknown options: bal; reset has ball, flight"):
        inline.reset(options={"bal": 3})
    counted = opened(task=TaskSettings(ball_count=80))
    with closing(counted), pytest.raises(IndexError, match="there are 0 to 79"):
        counted.reset(options={"ball": 80})
    with pytest.raises(ValueError, match="simulated, real"):
        opened(ranges="imagined")
    with pytest.raises(ValueError, match="delay must be less than the 5 iterations"):
        opened(task=TaskSettings(delay=5))
    with pytest.raises(ValueError, match="delay must be less than the 10 iterations"):
        opened(task=TaskSettings(delay=10, repeat=2, chunk_size=3))
    with pytest.raises(ValueError, match="action_steps must be at most chunk_size, got 2"):
        opened(task=TaskSettings(action_steps=2))


def test_another_robot_than_an_arm_is_refused() -> None:
    segment = f"no-arm-{time.monotonic_ns()}"
    with (
        o80.robots.load("two_joints").start(segment),
        pytest.raises(ValueError, match="not a pneumatic arm: it has 2 actuators"),
    ):
        opened(Pacing.REAL_TIME, arm_segment=segment, attach=True)


def test_an_arm_of_another_frequency_is_refused() -> None:
    with o80.robots.load("pam").start(f"slow-{time.monotonic_ns()}", period=0.004) as process:
        with pytest.raises(ValueError, match=r"runs at 250 Hz.*RigSettings\(frequency=250\)"):
            opened(Pacing.REAL_TIME, arm_segment=process.segment, attach=True)
        opened(Pacing.REAL_TIME, arm_segment=process.segment, attach=True, frequency=250.0).close()


@pytest.mark.parametrize(
    ("wrong", "error", "text"),
    [
        ({"pacing": "inline"}, TypeError, r"one of Pacing\.REAL_TIME, .*got 'inline'"),
        ({"worlds": 0}, ValueError, "worlds must be at least 1, got 0"),
        ({"frequency": 0}, ValueError, "frequency must be a positive number"),
        ({"factor": "fine"}, ValueError, "factor must be a positive number, got 'fine'"),
        ({"max_late": -3}, ValueError, "max_late must be at least 0, got -3"),
        ({"task": ReturnTask}, TypeError, r"task must be an object: write ReturnTask\(\)"),
        ({"task": "retrun"}, ValueError, "there are: return, smash"),
        ({"task": 3}, TypeError, "an object with .* no low, high, begin"),
        ({"reward": "publshed"}, ValueError, "there are: ordered, publish"),
        ({"reward": 3}, TypeError, r"an object like .*OrderedReward\(\), got 3"),
        ({"reward": OrderedReward}, TypeError, "or an object like"),
        ({"observation": "ful"}, ValueError, "there are: published, full"),
        ({"observation": 22}, TypeError, "must be one of published, full"),
        ({"noise": 0.005}, TypeError, r"must be NoiseSettings, got 0\.005"),
    ],
)
def test_settings_that_no_rig_and_no_task_can_have_are_refused(
    wrong: dict[str, Any], error: type[Exception], text: str
) -> None:
    settings: Any = RigSettings if hasattr(RigSettings, next(iter(wrong))) else TaskSettings
    with pytest.raises(error, match=text):
        settings(**wrong)
