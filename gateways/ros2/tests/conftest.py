"""Gateways without rclpy."""

from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from typing import Any

import pytest
import stand_in_ros
from carried import Carried, Carry

import o80
from o80_ros2 import ros


@pytest.fixture
def carry(monkeypatch: pytest.MonkeyPatch) -> Iterator[Carry]:
    """Publishes a robot: carry(robot, prefix=..., rates=..., command=..., step=...)."""
    monkeypatch.setattr(ros, "of", stand_in_ros.of)
    with ExitStack() as stack:

        def carried(robot: o80.Frontend, **given: Any) -> Carried:
            settings = ros.Settings(**{"rates": {"": 0.0}, "command": True, **given})
            made = Carried(robot, settings)
            monkeypatch.setattr(ros, "Served", partial(stand_in_ros.Served, made.node))
            stack.callback(made.source.close)
            made.tick()
            return made

        yield carried
