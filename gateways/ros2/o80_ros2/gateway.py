"""The gateway: a node, the published robots, and the loop that reads them."""

import time
from collections.abc import Sequence
from typing import Any

import o80
from o80.base.stop_request import StopRequest
from o80.errors import MissingExtra
from o80_ros2 import ros
from o80_ros2.source import Source
from o80_ros2.wall_clock import WallClock

USUAL, USUAL_OF_MANY, MANY = 100.0, 20.0, 10
"""Default rate [Hz], and the rate with more than MANY robots."""
BETWEEN_LISTS, BETWEEN_REPORTS, BETWEEN_POLLS = 1.0, 1.0, 0.1
"""Intervals of segment lists, of diagnostics, and of polls for changed diagnostics [s]."""

LEAST = 0.0005  # least time for messages and calls between two readings [s]


class Gateway:
    """Publishes segments until a stop is requested."""

    def __init__(self, names: Sequence[str], settings: ros.Settings) -> None:
        """names: of segments; empty: all, also those that start later."""
        none = ros.of("rclpy.signals.SignalHandlerOptions").NO
        ros.of("rclpy.init")(signal_handler_options=none)
        self._served, self._names, tf = ros.Served(settings.robot("o80_ros2")), names, None
        node, self._log = self._served.node, self._served.node.get_logger()
        try:
            tf = node.create_publisher(ros.of("tf2_msgs.msg.TFMessage"), "/tf", 100)
        except MissingExtra:
            self._log.warning("the package tf2_msgs is not installed: /tf is not published")
        self._shared = ros.Shared(node, settings, WallClock(), tf)
        self._array = ros.of("diagnostic_msgs.msg.DiagnosticArray")
        self._diagnostics = node.create_publisher(self._array, "/diagnostics", 10)
        self._reported: Any = None
        self._report_at = self._list_at = self._poll_at = 0.0
        self._clock: Any = None  # publisher of /clock
        self._simulated = -1  # last published time [ns]
        self._sources: dict[str, Source] = {}

    def run(self, stop: StopRequest) -> None:
        """Reads and publishes all robots, each at its rate, until `stop`."""
        while not stop.requested:
            now = time.monotonic()
            if now >= self._list_at:
                self._list_at = now + BETWEEN_LISTS
                self._update_sources()
            usual = USUAL_OF_MANY if len(self._sources) > MANY else USUAL
            for source in self._sources.values():
                if source.due <= now:
                    source.tick(now, usual)
            self._publish_clock()
            if now >= self._poll_at:
                self._poll_at = now + BETWEEN_POLLS
                self._report(now)
            due = min([self._poll_at, *(each.due for each in self._sources.values())])
            self._served.serve(max(due, time.monotonic() + LEAST))

    def _update_sources(self) -> None:
        """Adds new segments, and removes those that have ended."""
        alive = [each.name for each in o80.segments() if each.alive]
        carried = {source.name: segment for segment, source in self._sources.items()}
        for segment in self._names or alive:
            name = self._shared.settings.robot(segment)
            if (other := carried.setdefault(name, segment)) != segment:
                text = f"'{segment}' and '{other}' would both be /{name}: rename '{segment}'"
                self._log.warning(f"{text}, which is left out", once=True)
            elif segment not in self._sources:
                self._sources[segment] = Source(self._shared, segment)
                waits = "" if segment in alive else ", and is waited for"
                self._log.info(f"'{segment}' is /{name}{waits}")
        for segment, source in list(self._sources.items()):
            if not self._names and segment not in alive and source.gone:
                self._sources.pop(segment).close(topics=True)
        if step := self._shared.clock.update():
            self._log.warning(f"the wall clock was set by {step * 1e-9:+.3f} s: stamps follow it")

    def _publish_clock(self) -> None:
        """Publishes the time of the first robot with simulated time."""
        topics = (each.topics for each in self._sources.values())
        first = next((each for each in topics if each and each.is_simulated), None)
        if not first or first.time == self._simulated:
            return
        self._simulated, kind = first.time, ros.of("rosgraph_msgs.msg.Clock")
        self._clock = self._clock or self._served.node.create_publisher(kind, "/clock", 10)
        message = kind()
        message.clock.sec, message.clock.nanosec = divmod(first.time, 10**9)
        self._clock.publish(message)

    def _report(self, now: float) -> None:
        """Publishes /diagnostics, at once after a halt, an end or a refusal."""
        found = [source.status() for source in self._sources.values()]
        state = [(level, values.get("halt"), values["refused"]) for level, _, values in found]
        if now < self._report_at and state == self._reported:
            return
        self._report_at, self._reported = now + BETWEEN_REPORTS, state
        status, pair = (
            ros.of(f"diagnostic_msgs.msg.{n}") for n in ("DiagnosticStatus", "KeyValue")
        )
        message = self._array()
        message.header.stamp = self._served.node.get_clock().now().to_msg()
        for name, (level, text, values) in zip(self._sources, found, strict=True):
            each = status(level=level, name=f"o80: {name}", message=text, hardware_id=name)
            each.values = [pair(key=key, value=str(value)) for key, value in values.items()]
            message.status.append(each)
        self._diagnostics.publish(message)

    def close(self) -> None:
        """Closes the node. Robots continue, with their commands."""
        for source in self._sources.values():
            source.close(topics=True)
        self._served.close()
        ros.of("rclpy.try_shutdown")()
