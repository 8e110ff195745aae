"""The gateway: a node, the robots that it carries, and the loop that reads them."""

import sys
import threading
import time
from collections.abc import Sequence
from typing import Any

import o80
from o80.cli.stop_request import StopRequest
from o80.errors import MissingExtra
from o80_ros2 import ros
from o80_ros2.source import Source
from o80_ros2.wall_clock import WallClock

USUAL, USUAL_OF_MANY, MANY = 100.0, 20.0, 10
"""Rate of a robot, and of each of more than MANY robots [Hz]."""
BETWEEN_LISTS, BETWEEN_REPORTS, BETWEEN_POLLS = 1.0, 1.0, 0.1
"""Intervals: lists of segments, diagnostics, checks whether a diagnostic has changed [s]."""

SWITCH = 0.0005
"""Longest time for which a thread that publishes keeps those waiting that serve [s]."""


class Gateway:
    """Publishes segments until it is asked to stop."""

    def __init__(self, names: Sequence[str], settings: ros.Settings) -> None:
        """names: of segments; empty for all, also those that start later."""
        handlers = ros.of("rclpy.signals.SignalHandlerOptions").NO
        ros.of("rclpy.init")(signal_handler_options=handlers)
        name, create = settings.robot("o80_ros2"), ros.of("rclpy.create_node")
        self._ends = False
        self._served: list[tuple[Any, Any, threading.Thread]] = []
        # calls that take long have a node and a thread of their own, so that a halt does not wait
        for each in (name, f"{name}_calls"):
            executor = ros.of("rclpy.executors.SingleThreadedExecutor")()
            node = create(each, start_parameter_services=False)
            executor.add_node(node)
            thread = threading.Thread(target=self._serve, args=(executor,))
            self._served.append((node, executor, thread))
        calls, node, self._names, tf = node, self._served[0][0], names, None
        self._node, self._log = node, node.get_logger()
        try:
            tf = node.create_publisher(ros.of("tf2_msgs.msg.TFMessage"), "/tf", 100)
        except MissingExtra:
            self._log.warning("there is no tf2_msgs, which its wheels lack: /tf is not published")
        self._shared = ros.Shared(node, calls, settings, WallClock(), tf)
        self._array = ros.of("diagnostic_msgs.msg.DiagnosticArray")
        self._diagnostics = node.create_publisher(self._array, "/diagnostics", 10)
        self._reported: Any = None
        self._report_at = self._list_at = self._poll_at = 0.0
        self._clock: Any = None  # publisher of /clock, and the time published last [ns]
        self._simulated = -1
        self._sources: dict[str, Source] = {}
        sys.setswitchinterval(SWITCH)
        for *_, thread in self._served:
            thread.start()

    def _serve(self, executor: Any) -> None:
        """Serves messages and calls until the end."""
        while not self._ends:
            try:
                executor.spin()
            except Exception as error:  # of rclpy, if what it waits for is destroyed meanwhile
                self._log.warning(f"continues after {error!r}", throttle_duration_sec=1.0)

    def run(self, stop: StopRequest) -> None:
        """Reads all robots, each at its rate."""
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
            time.sleep(max(0.0005, due - time.monotonic()))

    def _update_sources(self) -> None:
        """Adds segments that are new, and removes those that are gone."""
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
        """The simulated time of the first robot that has one."""
        topics = (each.topics for each in self._sources.values())
        first = next((each for each in topics if each is not None and each.is_simulated), None)
        if first is None or first.time == self._simulated:
            return
        self._simulated, kind = first.time, ros.of("rosgraph_msgs.msg.Clock")
        self._clock = self._clock or self._node.create_publisher(kind, "/clock", 10)
        message = kind()
        message.clock.sec, message.clock.nanosec = divmod(first.time, 10**9)
        self._clock.publish(message)

    def _report(self, now: float) -> None:
        """Publishes /diagnostics, at once when a robot halts, ends or refuses something."""
        found = [source.status() for source in self._sources.values()]
        state = [(level, values.get("halt"), values["refused"]) for level, _, values in found]
        if now < self._report_at and state == self._reported:
            return
        self._report_at, self._reported = now + BETWEEN_REPORTS, state
        status, pair = (
            ros.of(f"diagnostic_msgs.msg.{n}") for n in ("DiagnosticStatus", "KeyValue")
        )
        message = self._array()
        message.header.stamp = self._node.get_clock().now().to_msg()
        for name, (level, text, values) in zip(self._sources, found, strict=True):
            each = status(level=level, name=f"o80: {name}", message=text, hardware_id=name)
            each.values = [pair(key=key, value=str(value)) for key, value in values.items()]
            message.status.append(each)
        self._diagnostics.publish(message)

    def close(self) -> None:
        """Ends the node. Robots and the commands that they have continue."""
        self._ends = True
        for source in self._sources.values():
            source.close(topics=True)
        for node, executor, thread in self._served:
            executor.shutdown()
            thread.join()
            node.destroy_node()
        ros.of("rclpy.try_shutdown")()
