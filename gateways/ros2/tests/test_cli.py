"""The command, and what it says where there is no ROS."""

import pytest
from typer.testing import CliRunner

import o80
from o80_ros2 import cli
from o80_ros2.wall_clock import WallClock


def test_rates_are_numbers_or_every_row_for_all_or_for_one_segment() -> None:
    assert cli.rates_of(["50", "arm=all", "camera=10"]) == {"": 50.0, "arm": 0.0, "camera": 10.0}
    for wrong in ("0", "-1", "arm=fast", "nan", "1e9"):
        with pytest.raises(o80.InvalidArgument, match="--rate"):
            cli.rates_of([wrong])
    found = CliRunner().invoke(cli.app, ["arm", "--rate", "fast"])
    assert isinstance(found.exception, o80.InvalidArgument), "options may stand behind names"


def test_without_rclpy_one_sentence_says_what_to_install() -> None:
    found = CliRunner().invoke(cli.app, [])
    assert isinstance(found.exception, o80.MissingExtra)
    assert "setup.bash" in str(found.exception)
    assert "o80-ros2[kilted]" in str(found.exception)


def test_a_correction_of_the_wall_clock_is_no_step() -> None:
    now, wall = [0], [10**18]
    clock = WallClock(lambda: wall[0], lambda: now[0])
    now[0], wall[0] = 10**9, 10**18 + 10**9 + 10**6
    assert clock.update() == 0
    assert clock.row_time(10**18 + 10**6 + 5) == 5
    wall[0] += 10**10
    assert clock.update() == 10**10
    for stamp in (wall[0] - 5 * 10**9, wall[0]):
        with pytest.raises(o80.InvalidArgument, match="wall clock was set"):
            clock.row_time(stamp)
    now[0], wall[0] = now[0] + 2 * 10**9, wall[0] + 2 * 10**9
    assert clock.row_time(wall[0]) == now[0], "once messages from before are surely gone"
