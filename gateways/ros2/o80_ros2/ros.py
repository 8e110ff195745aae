"""Packages and names of ROS 2, and common parts of the gateway."""

import importlib
import math
import re
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from o80.errors import MissingExtra
from o80.recording.epoch import topic_of
from o80_ros2.wall_clock import WallClock

LONGEST = 0.1  # longest wait for messages; then the end is polled [s]


def of(path: str) -> Any:
    """Imports a name of ROS 2, such as std_msgs.msg.String. Raises MissingExtra if missing."""
    module, _, name = path.rpartition(".")
    try:
        return getattr(importlib.import_module(module), name)
    except ImportError as error:
        raise MissingExtra(
            f"`o80 ros2` needs {module}, which this Python does not find: on a machine with ROS 2 "
            "source its setup.bash and install o80-ros2 into a venv with --system-site-packages; "
            'elsewhere, on Linux with x86-64, pip install "o80-ros2[kilted]" (or [jazzy])',
            name=module,
        ) from error


@dataclass(frozen=True)
class Settings:
    """Options of the command."""

    rates: Mapping[str, float]  #: by segment, "": all others [Hz]; 0: every row
    command: bool = False
    step: int | None = None  #: iterations of the service `step`; None: no such service
    prefix: str = ""

    def robot(self, segment: str) -> str:
        """Namespace of a robot's topics: prefix and segment, spelled as in recordings."""
        return topic_of(self.prefix + segment).lstrip("/")

    def joints(self, names: Iterable[str]) -> list[str]:
        return names_of(self.prefix + (name or f"joint_{i}") for i, name in enumerate(names))


class Served:
    """Node for one thread only: with two, rclpy loses wake-ups and can hang."""

    def __init__(self, name: str) -> None:
        self.node = of("rclpy.create_node")(name, start_parameter_services=False)
        self._executor = of("rclpy.executors.SingleThreadedExecutor")()
        self._executor.add_node(self.node)
        self._ends = False
        self._thread = threading.Thread(target=self.serve, args=(math.inf,))

    def serve(self, until: float) -> None:
        """Handles messages and calls until a time of the monotonic clock [s]."""
        while (left := until - time.monotonic()) > 0 and not self._ends:
            try:
                self._executor.spin_once(timeout_sec=min(left, LONGEST))
            except Exception as error:  # of rclpy, for example after an unreadable message
                text = f"continues after {error!r}"
                self.node.get_logger().warning(text, throttle_duration_sec=1.0)

    def start(self) -> None:
        """Starts a thread that serves the node until `close`."""
        self._thread.start()

    def close(self) -> None:
        self._ends = True
        if self._thread.ident:
            self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()


@dataclass(frozen=True)
class Shared:
    """Common parts of a gateway's robots. tf: publisher of /tf; None without tf2_msgs."""

    node: Any
    settings: Settings
    clock: WallClock
    tf: Any


def names_of(given: Iterable[str]) -> list[str]:
    """Converts to unique ROS names: letters, digits and underscores, no digit first."""
    found: list[str] = []
    for name in given:
        plain = re.sub(r"[^A-Za-z0-9_]+", "_", name)
        plain = f"x_{plain}" if plain[:1].isdigit() else plain
        found.append(f"{plain}_{len(found)}" if plain in found else plain)
    return found
