"""A robot, and a gateway's source that publishes it into lists."""

from collections.abc import Callable
from typing import Any

import stand_in_ros

import o80
from o80_ros2 import ros
from o80_ros2.source import Source
from o80_ros2.wall_clock import WallClock

OFFSET = 10**18


class Carried:
    """A robot and its source."""

    def __init__(self, robot: o80.Frontend, settings: ros.Settings) -> None:
        self.node, self.monotonic, self.now = stand_in_ros.Node(), 0, 100.0
        self.clock = WallClock(lambda: self.monotonic + OFFSET, lambda: self.monotonic)
        kind = stand_in_ros.of("tf2_msgs.msg.TFMessage")
        self.tf = self.node.create_publisher(kind, "/tf", 100)
        shared = ros.Shared(self.node, settings, self.clock, self.tf)
        self.source = Source(shared, robot.segment)

    def tick(self) -> None:
        """Advances the time, and reads."""
        self.now += 1.0
        self.source.tick(self.now, 100.0)

    def sent(self, topic: str) -> list[Any]:
        """Messages of a topic, relative to the robot's name or absolute."""
        name = topic if topic.startswith("/") else f"/{self.source.name}/{topic}"
        return self.node.published[name].sent

    def send(self, topic: str, message: Any) -> None:
        self.node.subscribed[f"/{self.source.name}/{topic}"](stand_in_ros.Raw(message))

    def call(self, service: str, **parameters: Any) -> tuple[bool, str]:
        return self.node.call(f"/{self.source.name}/{service}", **parameters)


Carry = Callable[..., Carried]
