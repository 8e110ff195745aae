"""The ball launcher as a robot, beside a fake one in the same process."""

import math
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

import o80
from o80_devices.ball_launcher import BallLauncher, LastLaunch, Status
from o80_devices.ball_launcher.driver import Options
from o80_devices.ball_launcher.messages import State
from o80_devices.fakes.ball_launcher import Behaviour, FakeLauncher

PATIENCE = 60.0  # [s] longer than anything here takes on any machine
ROBOT = "o80_devices.ball_launcher:BallLauncher"


class Served:
    """A fake launcher in a thread."""

    def __init__(self, behaviour: Behaviour) -> None:
        self.fake = FakeLauncher(behaviour)
        self.address = self.fake.bind("tcp://127.0.0.1:0")
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._ends.is_set():
            self.fake.step(time.monotonic_ns(), wait=0.01)

    def die(self) -> None:
        self._ends.set()
        self._thread.join()
        self.fake.close()


@pytest.fixture
def served() -> Iterator[Served]:
    made = Served(Behaviour(state_time=0.0, launch_time=0.05, magazine=1))
    yield made
    made.die()


@pytest.fixture
def robot(served: Served) -> Iterator[o80.Frontend]:
    # no heartbeats: a busy machine would miss them
    launcher = o80.robots.load(ROBOT)
    with launcher.inline(
        "test-launcher", address=served.address, heartbeat_timeout=0.0
    ) as frontend:
        yield frontend


def until(robot: o80.Frontend, field: str, value: object) -> None:
    """Steps the robot until a field has the value."""
    end = time.monotonic() + PATIENCE
    while robot.latest().extended[field] != value:
        assert time.monotonic() < end, robot.latest().extended
        robot.burst(1)
        time.sleep(0.001)


def test_commands_reach_the_launcher_and_come_back_as_observed(
    served: Served, robot: o80.Frontend
) -> None:
    until(robot, "status", Status.ready)
    assert robot.latest().extended["capture_time"] > 0
    robot.add_command(None, [0.4, 0.6, 0.3, 0.3, 0.35], iterations=1)
    robot.pulse()
    robot.burst(1)
    until(robot, "status", Status.ready)
    assert list(robot.latest().observed) == pytest.approx([0.4, 0.6, 0.3, 0.3, 0.35])
    assert served.fake.state == State(0.4, 0.6, 0.3, 0.3, 0.35).rounded()


def test_a_target_outside_the_limits_is_refused(robot: o80.Frontend) -> None:
    with pytest.raises(o80.Error, match="phi"):
        robot.add_command("phi", 1.5, duration=1.0)


def test_a_halt_stops_the_motors(served: Served, robot: o80.Frontend) -> None:
    until(robot, "status", Status.ready)
    robot.add_command(["top_left_motor", "bottom_motor"], [0.5, 0.5], iterations=1)
    robot.pulse()
    robot.burst(1)
    until(robot, "status", Status.ready)
    assert served.fake.state.top_left_motor == 0.5
    number = robot.halt("a person is at the table")
    robot.burst(1)
    until(robot, "status", Status.setting)
    until(robot, "status", Status.ready)
    assert served.fake.state == State()
    robot.resume(number)
    robot.burst(5)
    assert served.fake.state == State()
    assert list(robot.latest().desired) == [0.5, 0.5, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "options",
    [
        {"launch_timeout": 0.5},
        {"state_timeout": 0.0},
        {"stop_timeout": -1.0},
        {"heartbeat_timeout": 0.0001},
        {"heartbeat_timeout": math.nan},
        {"phi": math.nan},
    ],
)
def test_an_option_out_of_range_is_named(options: dict[str, Any]) -> None:
    (name,) = options
    with pytest.raises(o80.InvalidArgument, match=f"{name} must be"):
        BallLauncher(Options(**options))


def test_a_stop_without_connection_says_that_the_motors_may_turn(
    served: Served, robot: o80.Frontend, capsys: pytest.CaptureFixture[str]
) -> None:
    until(robot, "status", Status.ready)
    served.die()
    until(robot, "status", Status.disconnected)
    robot.close()
    assert "so its motors cannot be stopped" in capsys.readouterr().err


def test_a_stop_while_a_state_is_set_is_confirmed_after_it(
    served: Served, robot: o80.Frontend
) -> None:
    """The launcher takes requests of two connections in turn: the older one may come second."""
    until(robot, "status", Status.ready)
    served.fake._behaviour = Behaviour(state_time=0.2)
    robot.add_command("bottom_motor", 0.5, iterations=1)
    robot.pulse()
    robot.burst(1)
    end = time.monotonic() + PATIENCE
    while served.fake.requests[-1].state != State(bottom_motor=0.5):
        assert time.monotonic() < end
        robot.burst(1)
    robot.close()
    assert served.fake.state == State()
    assert served.fake.busy is None
    assert [request.state for request in served.fake.requests[-2:]] == [State(), State()]


def test_without_a_launcher_no_value_is_given_and_it_comes_back(
    served: Served, robot: o80.Frontend
) -> None:
    until(robot, "status", Status.ready)
    served.die()
    until(robot, "status", Status.disconnected)
    assert robot.latest().extended["capture_time"] == 0
    successor = FakeLauncher(Behaviour(state_time=0.0))
    successor.bind(served.address)
    end = time.monotonic() + PATIENCE
    while robot.latest().extended["status"] != Status.ready:
        assert time.monotonic() < end, robot.latest().extended
        robot.burst(1)
        successor.step(time.monotonic_ns(), wait=0.001)
    successor.close()


def test_launches_are_counted_and_say_how_they_ended(served: Served, robot: o80.Frontend) -> None:
    until(robot, "status", Status.ready)
    robot.request("launch", timeout=PATIENCE)
    extended = robot.latest().extended
    assert extended["last_launch"] == LastLaunch.completed
    assert extended["launch_time"] > 0
    with pytest.raises(o80.RequestRejected, match="magazine"):
        robot.request("launch", timeout=PATIENCE)
    extended = robot.latest().extended
    assert extended["completed"] == 1
    assert extended["rejected"] == 1
    assert len(served.fake.launches) == 1
