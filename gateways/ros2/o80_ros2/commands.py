"""Converts ROS 2 messages and calls to commands of one robot, through an ordinary frontend."""

import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, cast

import numpy as np

import o80
from o80.errors import Error, InvalidArgument
from o80_ros2 import ros
from o80_ros2.topics import desired_numbers

PATIENCE, RESUME = 30.0, 5.0
"""Timeouts: of a request or step, which the robot may still finish; of a resume [s]."""
SLOW = 0.5  # longest interval of a stream of set-points [s]
SLACK = 1.01  # tolerance of the speed limit, because times are rounded to iterations
LARGEST = 1 << 19  # largest message [bytes]; rclpy needs seconds for larger ones


class Commands:
    """Receives the messages and calls for one robot."""

    def __init__(self, shared: ros.Shared, arm: o80.Frontend, refuse: Any) -> None:
        """refuse: callback for a refusal: subject and reason."""
        self._shared, self._arm, self._refuse = shared, arm, refuse
        self._name = shared.settings.robot(arm.segment)
        self._actuators = shared.settings.joints(each.name for each in arm.actuators)
        self._desired = [*desired_numbers(arm.schema)]
        self._plans: dict[tuple[int, ...], Any] = {}
        self._sent: deque[tuple[str, Any]] = deque(maxlen=64)  # batches that have not ended
        self._moves: Any = None  # the batch of the newest trajectory
        self._last = self._every = 0.0  # time of the last set-point, mean interval [s]
        self._made: list[Callable[[], object]] = []  # destroy subscriptions and services
        self._calls = ros.Served(f"{self._name}_calls")  # slow calls do not delay a halt
        calls, halt = self._calls.node, partial(o80.halt, arm.segment, "requested over ROS 2")
        if (n := shared.settings.step) and arm.bursting:
            step = partial(arm.burst, n, timeout=PATIENCE)
            self._trigger("step", lambda: f"iteration {step().iteration}", calls)
        if shared.settings.command:
            for kind, name, take, depth in (
                ("trajectory_msgs.msg.JointTrajectory", "joint_trajectory", self._trajectory, 1000),
                ("std_msgs.msg.Float64MultiArray", "commands", self._set_points, 1),
            ):
                taken = partial(self._attempt, name, partial(self._read, ros.of(kind), take))
                self._make(shared.node, "subscription", kind, name, taken, depth, raw=True)
            self._trigger("halt", lambda: f"halt {halt()} is requested", shared.node)
            ended = ("there was no halt", "the halt has ended")
            self._trigger("resume", lambda: ended[arm.resume(timeout=RESUME)], calls)
            requests = [each["name"] for each in arm.schema["requests"]]
            for request, path in zip(requests, ros.names_of(requests), strict=True):
                self._serve_request(request, f"requests/{path}")
        self._calls.start()

    def close(self) -> None:
        """Closes the frontend, which ends all waits; removes topics and services."""
        self._arm.close()
        self._calls.close()
        for destroy in self._made:
            destroy()

    def poll(self) -> None:
        """Reports commands that the backend rejected; keeps a trajectory alive until its end."""
        for _ in range(len(self._sent)):
            what, batch = self._sent.popleft()
            if not batch.ended:
                self._sent.append((what, batch))
            elif (end := batch[0]).status == o80.Status.REJECTED:
                self._refuse(what, f"{end.reason} {end.text}")
        if self._moves is not None and not self._moves.ended:
            with suppress(Error):
                self._arm.keep_alive()

    def _attempt(self, what: str, run: Callable[..., str | None], *given: Any) -> tuple[bool, str]:
        """Calls `run`; returns True and the text, or False and the reason of a refusal."""
        try:
            return True, run(*given) or ""
        except (Error, ValueError, TypeError, OverflowError) as error:
            with suppress(Error):
                self._arm.forget_added()
            self._refuse(what, error)
            return False, str(error)

    def _make(self, node: Any, what: str, kind: str, name: str, *rest: Any, **more: Any) -> None:
        """Creates a subscription or a service."""
        create, destroy = (getattr(node, f"{verb}_{what}") for verb in ("create", "destroy"))
        made = create(ros.of(kind), f"/{self._name}/{name}", *rest, **more)
        self._made += [partial(destroy, made)] if node is self._shared.node else []

    def _read(self, kind: type, take: Callable[[Any], None], data: bytes) -> None:
        if len(data) > LARGEST:
            raise InvalidArgument(f"it has {len(data)} bytes, but at most {LARGEST} are read")
        take(ros.of("rclpy.serialization.deserialize_message")(data, kind))

    def _set_points(self, message: Any) -> None:
        """Sends a set-point for each actuator, in order."""
        if len(message.data) != len(self._actuators):
            raise InvalidArgument(
                f"{len(self._actuators)} actuators need a number each, got {len(message.data)}"
            )
        interval = time.monotonic() - self._last
        self._last += interval
        mean = 0.8 * self._every + 0.2 * interval if self._every else interval
        self._every = mean if interval < SLOW else 0.0
        every = self._every if self._every > self._arm.period else None
        self._arm.add_command(None, list(message.data), mode="overwrite", every=every)
        self._sent.append(("commands", self._arm.pulse()))

    def _trajectory(self, message: Any) -> None:
        """Sends a trajectory as a chunk that begins at the stamp, or now without one."""
        arm, names = self._arm, list(message.joint_names)
        if not {*names} <= {*self._actuators} or len({*names}) < max(1, len(names)):
            there = ", ".join(self._actuators)
            raise InvalidArgument(f"joint_names must be from {there}, each once; got {names}")
        chosen = tuple(self._actuators.index(name) for name in names)
        if not message.points or {len(p.positions) for p in message.points} != {len(names)}:
            raise InvalidArgument(f"each point needs {len(names)} positions, one for each joint")
        rows = np.array([each.positions for each in message.points], float)
        times = np.array([nanoseconds(each.time_from_start) for each in message.points])
        if times[0] < 0 or (np.diff(times) <= 0).any():
            raise InvalidArgument("time_from_start must not be negative, and must rise")

        newest, period = cast(Any, arm.latest()), arm.schema["period"]
        stamp, begin = nanoseconds(message.header.stamp), newest.time
        if stamp:
            is_simulated = arm.schema["clock"] == "simulated"
            begin = stamp if is_simulated else self._shared.clock.row_time(stamp)
        anchor = newest.iteration + round((begin - newest.time) / period)
        due = anchor + np.rint(times / period).astype(np.int64)
        kept = np.append(np.diff(due) > 0, True)  # of several points in an iteration, the last one
        rows, due = rows[kept], due[kept]
        if due[-1] <= newest.iteration:
            ago = (newest.iteration - int(due[-1])) * arm.period
            raise InvalidArgument(f"it is past: its last point was due {ago:.3f} s ago")
        anchor = min(anchor, newest.iteration)
        rows, due = rows[due > anchor], due[due > anchor]
        numbers = [self._desired[each] for each in chosen]
        now = np.array([np.ndarray((), each.dtype, newest, each.offset) for each in numbers])
        start = [] if stamp else [(anchor, now)]  # the position at a future stamp is unknown
        self._check_speeds(names, chosen, [*start, *zip(due, rows, strict=True)])
        if chosen not in self._plans:
            self._plans[chosen] = arm.chunks(list(chosen), step=1)
        plan = self._plans[chosen]
        sent = plan.send(rows, seen=anchor, due=due, fixed=bool(stamp), final=True)
        self._moves = sent.batch
        self._sent.append(("joint_trajectory", sent.batch))

    def _check_speeds(self, names: list[str], chosen: tuple[int, ...], way: Sequence[Any]) -> None:
        """Raises InvalidArgument if a joint would exceed its speed limit."""
        limits = np.array([self._arm.actuators[each].limits.speed for each in chosen])
        due, rows = map(np.array, zip(*way, strict=True))
        speeds = np.abs(np.diff(rows, axis=0)) / (np.diff(due)[:, None] * self._arm.period)
        for i, j in np.argwhere(speeds > SLACK * limits):
            raise InvalidArgument(
                f"'{names[j]}' would need a speed of {speeds[i, j]:.4g} to reach "
                f"{rows[i + 1, j]:.4g} in time, its limit is {limits[j]:.4g}"
            )

    def _trigger(self, name: str, run: Callable[[], str], node: Any) -> None:
        def serve(_: Any, answer: Any) -> Any:
            answer.success, answer.message = self._attempt(name, run)
            return answer

        self._make(node, "service", "std_srvs.srv.Trigger", name, serve)

    def _serve_request(self, request: str, path: str) -> None:
        """Creates a service for a driver's request, with the fields as parameters by name."""
        value_of = ros.of("rclpy.parameter.parameter_value_to_python")

        def serve(call: Any, answer: Any) -> Any:
            def run() -> str:
                fields = {each.name: value_of(each.value) for each in call.parameters}
                self._arm.request(request, timeout=PATIENCE, **fields)
                return f"{request} has ended"

            answer.result.successful, answer.result.reason = self._attempt(path, run)
            return answer

        kind = "rcl_interfaces.srv.SetParametersAtomically"
        self._make(self._calls.node, "service", kind, path, serve)


def nanoseconds(time: Any) -> int:
    """Converts a Time or Duration of ROS to [ns]."""
    return int(time.sec) * 10**9 + int(time.nanosec)
