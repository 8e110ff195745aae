"""Balls of the fake launcher, tracked: the launch decides what the tracking server publishes."""

import numpy as np
import pytest
from device_rows import row_where

import o80
from o80_devices.ball_launcher.launch_model import LAUNCH_MODEL
from o80_devices.ball_tracking.server_messages import ServerReason
from o80_devices.ball_tracking.tracking_server import TrackingServer
from o80_devices.cameras.flight import Table
from o80_devices.fakes.ball_launcher import PLACE, YAW
from o80_devices.fakes.launched_balls import SECOND, LaunchedBalls, TrackedLauncher

BALL = LAUNCH_MODEL.launch(0.5, 0.5, (1800.0, 1800.0, 400.0))


def test_a_ball_flies_from_the_launcher_and_bounces_on_the_table() -> None:
    balls = LaunchedBalls(PLACE, YAW)
    assert balls.message(5).place is None
    balls.launched(BALL, 10)
    places = [balls.message(10 + round(i / 180 * SECOND)).place for i in range(170)]
    path = np.array([place for place in places if place is not None])
    assert path[0] == pytest.approx(BALL.placed(PLACE, YAW).position)
    low = int(np.argmin(path[:100, 2]))
    table = Table()
    assert path[low, 2] == pytest.approx(table.middle[2] + 0.02, abs=0.03)
    assert (np.abs(path[low, :2] - table.middle[:2]) < table.half).all()
    assert path[low + 10, 2] > path[low, 2]  # it bounced


def test_a_ball_that_lies_is_not_tracked() -> None:
    balls = LaunchedBalls(PLACE, YAW)
    balls.launched(BALL, 0)
    assert balls.message(10 * SECOND).place is None


def test_the_driver_of_a_tracking_server_sees_the_launched_ball(segment: str) -> None:
    robot = o80.robots.load(TrackingServer)
    with (
        TrackedLauncher("tcp://127.0.0.1:0", LaunchedBalls(PLACE, YAW)) as tracked,
        robot.inline(segment, address=tracked.address) as server,
    ):
        row_where(server, lambda row: row.reason == ServerReason.not_seen)
        tracked.launched(BALL)
        row = row_where(server, lambda row: row.reason == ServerReason.seen)
        flown = BALL.placed(PLACE, YAW)
        assert np.linalg.norm(row.measured - flown.position) < 3.0
        assert row.measured[0] == pytest.approx(flown.position[0], abs=0.1)
        assert row.ball == 1
