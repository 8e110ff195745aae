"""The ball from messages of a tracking server: newest, in the world, filtered, never stale."""

import contextlib
import math
import os
import time
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from device_rows import WAIT, row_where

import o80
from o80_devices.ball_tracking.robot_and_ball import RobotAndBall
from o80_devices.ball_tracking.server_messages import (
    SECOND,
    Message,
    Options,
    ServerReason,
    ServerTrack,
)
from o80_devices.ball_tracking.tracking_server import TrackingServer
from o80_devices.cameras.rig import four_cameras
from o80_devices.cameras.throws import Throws
from o80_devices.fakes.tracking_server import FakeTrackingServer, thrown

OFFSET = 1_669_000_000 * SECOND  # of the server's clock
ROOT = Path(__file__).resolve().parent.parent.parent
RECORDED = Path(os.environ.get("O80_DATA", ROOT.parent / "shared" / "data")) / "robot_and_ball_2022"


def test_a_message_is_read_as_it_was_sent() -> None:
    message = Message(5, np.array([1.0, 2.0, 3.0]))
    assert message.encoded() == b'{"time": 5, "obs": [1.0, 2.0, 3.0]}'
    read = Message.decoded(message.encoded())
    assert read.stamp == 5
    assert read.place is not None
    np.testing.assert_array_equal(read.place, [1.0, 2.0, 3.0])
    assert Message.decoded(b'{"time": 5, "obs": null}').place is None


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff",
        b"[]",
        b"7",
        b'{"time": 5}',
        b'{"time": 5.5, "obs": null}',
        b'{"time": true, "obs": null}',
        b'{"time": 99999999999999999999, "obs": null}',
        b'{"time": 5, "obs": [1, 2]}',
        b'{"time": 5, "obs": [1, 2, NaN]}',
        b'{"time": 5, "obs": [1, 2, 1e9]}',
        b'{"time": 5, "obs": [1, 2, 1' + b"0" * 400 + b"]}",  # larger than any float
        b'{"time": 5, "obs": [1, 2, "3"]}',
        b"[" * 100_000,
        b'{"time": ' + b"9" * 5000 + b', "obs": null}',
        b'{"time": 1, "obs": [1e999, 0, 0]}',
        b'{"time": 1, "obs": [true, 0, 0]}',
        '{"time": 1, "obs": "\ud83d"}'.encode("utf-16", "surrogatepass"),
    ],
)
def test_a_message_that_is_none_is_marked_and_the_next_one_is_taken(content: bytes) -> None:
    track = ServerTrack(Options())
    assert track.take(content, SECOND).reason is ServerReason.invalid
    good = track.take(Message(OFFSET, np.zeros(3)).encoded(), 2 * SECOND)
    assert good.reason is ServerReason.seen


@pytest.mark.parametrize(
    "options",
    [
        {"noise": 0.0},
        {"noise": 1e-200},
        {"timeout": math.nan},
        {"latency": -0.001},
        {"latency": math.inf},
        {"translation": (math.nan, 0.0, 0.0)},
        {"rotation": (0.0, 0.0, math.inf)},
    ],
)
def test_an_option_out_of_range_is_named(options: dict[str, Any]) -> None:
    (name,) = options
    with pytest.raises(o80.InvalidArgument, match=f"{name} must be"):
        TrackingServer(Options(**options))


@pytest.mark.parametrize(
    ("rotation", "expected"),
    [((0.0, 0.0, math.pi / 2), [1.0, 3.0, 3.5]), ((math.pi / 2, 0.0, 0.0), [2.0, 1.5, 3.0])],
)
def test_a_place_is_turned_and_moved_into_the_world(
    rotation: tuple[float, float, float], expected: list[float]
) -> None:
    track = ServerTrack(Options(translation=(1.0, 2.0, 3.0), rotation=rotation))
    seen = track.take(Message(OFFSET, np.array([1.0, 0.0, 0.5])).encoded(), SECOND)
    np.testing.assert_allclose(seen.ball.measured, expected)


def test_rows_without_a_new_message_have_no_ball_and_silence_is_told() -> None:
    track = ServerTrack(Options(timeout=0.05))
    now = 10 * SECOND
    assert track.silent(now).reason is ServerReason.silent
    message = Message(OFFSET, np.zeros(3)).encoded()
    assert track.take(message, now).reason is ServerReason.seen
    between = track.silent(now + SECOND // 100)
    assert between.reason is ServerReason.no_new_message
    assert np.isnan(between.ball.position).all()
    assert track.take(message, now + SECOND // 50).reason is ServerReason.no_new_message
    assert track.silent(now + SECOND // 10).reason is ServerReason.silent


def test_no_ball_is_marked() -> None:
    track = ServerTrack(Options())
    assert track.take(Message(OFFSET, None).encoded(), SECOND).reason is ServerReason.not_seen


def test_a_message_that_was_held_up_is_not_used() -> None:
    track = ServerTrack(Options(max_age=0.1))
    for frame in range(100):
        at = frame * SECOND // 180
        track.take(Message(OFFSET + at, np.zeros(3)).encoded(), SECOND + at)
    at = 100 * SECOND // 180
    held = track.take(Message(OFFSET + at, np.zeros(3)).encoded(), SECOND + at + SECOND // 2)
    assert held.reason is ServerReason.late


def test_thrown_balls_are_numbered_and_their_velocity_is_better_than_by_differences() -> None:
    track, throws = ServerTrack(Options()), Throws(four_cameras(), 3)
    balls, errors, differences = set(), [], []
    before: np.ndarray | None = None
    for at, message in islice(thrown(3, 0.003), round(180 * 5.4)):
        seen = track.take(Message(OFFSET + at, message.place).encoded(), SECOND + at)
        if message.place is None:
            assert seen.reason is ServerReason.not_seen
        elif before is not None and seen.reason is ServerReason.seen:
            true = throws.at(at / SECOND)
            balls.add(seen.ball.ball)
            assert seen.ball.ball == true.number
            errors.append(np.linalg.norm(seen.ball.velocity - true.velocity))
            differences.append(np.linalg.norm((message.place - before) * 180.0 - true.velocity))
        before = message.place
    assert len(balls) > 2
    assert np.median(errors) < 0.2 * np.median(differences)


def test_the_driver_takes_the_newest_message_and_marks_the_end_of_the_server(
    segment: str,
) -> None:
    tracker = o80.robots.load(TrackingServer)
    with (
        contextlib.closing(FakeTrackingServer("tcp://127.0.0.1:0")) as server,
        tracker.inline(segment, address=server.address, translation=(0.0, 0.0, 1.0)) as robot,
    ):
        end, stamp = time.monotonic() + WAIT, OFFSET
        while robot.latest().extended["reason"] != ServerReason.seen:
            assert time.monotonic() < end
            for _ in range(20):
                stamp += SECOND // 180
                server.publish(Message(stamp, np.array([0.1, 0.2, 0.3])))
            time.sleep(0.02)
            robot.burst(1)
        row = robot.latest().extended
        assert row["stamp"] == stamp, "an older message was taken"
        assert row["capture_time"] > 0
        np.testing.assert_allclose(row["measured"], [0.1, 0.2, 1.3])
        robot.burst(1)
        row = robot.latest().extended
        assert row["capture_time"] == 0
        assert np.isnan(row["position"]).all()
        server.close()
        row_where(robot, lambda row: row.reason == ServerReason.silent)


def test_a_line_that_is_no_row_is_named(tmp_path: Path) -> None:
    (tmp_path / "recording").write_text("((1, 2, [0, 0], [0, 0, 0]), (3, [0]*4, [0]*4))\n")
    with pytest.raises(o80.InvalidArgument, match="line 1"):
        RobotAndBall.load(tmp_path / "recording")


@pytest.mark.recordings("robot_and_ball_2022")
@pytest.mark.parametrize("name", ["o80_robot_ball_002", "o80_robot_ball_003"])
def test_a_recording_is_played_as_the_tracker_would_have_sent_it(name: str) -> None:
    recording = RobotAndBall.load(RECORDED / name)
    track = ServerTrack(Options())
    stamps, places, seen_rows = [], [], 0
    for at, message in recording.messages():
        stamps.append(message.stamp)
        seen = track.take(message.encoded(), at)
        assert (seen.capture is None) or seen.capture.time <= at
        if message.place is not None and seen.reason is ServerReason.seen:
            seen_rows += 1
            places.append(np.linalg.norm(seen.ball.position - message.place))
    assert (np.diff(stamps) > 0).all()
    assert seen_rows > 0.9 * len(recording.first_rows())
    assert np.median(places) < 0.01


@pytest.mark.recordings("robot_and_ball_2022")
def test_the_two_clocks_of_a_recording_are_joined() -> None:
    recording = RobotAndBall.load(RECORDED / "o80_robot_ball_002")
    rows, times = recording.capture_times()
    assert len(rows) > 200
    assert (np.diff(times) >= 0).all()
    age = recording.time[rows] - times
    assert (age >= 0).all()
    assert np.median(age) < 0.01 * SECOND
