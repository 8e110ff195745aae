"""O80: any robot of o80 as a robot of LeRobot."""

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from lerobot.cameras import CameraConfig
from lerobot.cameras.utils import make_cameras_from_configs
from lerobot.robots import Robot, RobotConfig
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

import o80
from lerobot_robot_o80.segment import Segment
from o80.base.loop_options import did_you_mean
from o80.datasets.lerobot_numbers import Number

AT_STOP = ("hold", "relax", "rest")
HOMEWARD = 0.5
"""Speed of the motion to the rest position [unit/s]."""


@RobotConfig.register_subclass("o80")
@dataclass(kw_only=True)
class O80Config(RobotConfig):
    """Flags `--robot.NAME` of LeRobot's programs."""

    segment: str  #: name of the segment; by default `o80 run` uses the robot's name
    units: str = ""  #: degrees, normalised, native; "": the units of LeRobot's driver
    fps: float = 30.0  #: actions a second; the motion to each takes about two steps
    #: State after `disconnect`: "hold": the arm holds its last target. "relax": torque off.
    #: "rest": the arm returns to its position at `connect`, then torque off.
    at_stop: str = "hold"
    timeout: float = 5.0  #: timeout of the robot, of its next row, and of its control [s]
    cameras: dict[str, CameraConfig] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.at_stop not in AT_STOP:
            raise ValueError(f"at_stop must be one of {', '.join(AT_STOP)}, got '{self.at_stop}'")
        if not 0 < self.fps < math.inf:
            raise ValueError(f"fps must be positive, got {self.fps:g}")


class O80(Robot):
    """LeRobot's view of an o80 robot that runs in another process.

    The robot's limits apply to all actions. Errors are o80's: a halt raises
    BackendHalted with the halt's text, the end of the process BackendGone.
    """

    config_class = O80Config
    name = "o80"

    def __init__(self, config: O80Config) -> None:
        super().__init__(config)
        self.config = config
        self.segment = Segment(config.segment, config.units, config.timeout)
        self.cameras = make_cameras_from_configs(config.cameras)
        self._held = contextlib.ExitStack()  # control, cameras
        #: Row of the last observation.
        self.seen: o80.Observation | None = None
        self._rest_places: dict[str, float] = {}

    @property
    def observation_features(self) -> dict[str, Any]:
        """Maps each observed number to `float`, and each camera to (height, width, 3)."""
        images = {name: (each.height, each.width, 3) for name, each in self.config.cameras.items()}
        return {**dict.fromkeys(self.segment.numbers(), float), **images}

    @property
    def action_features(self) -> dict[str, type]:
        """Maps each desired number to `float`."""
        return dict.fromkeys(self.segment.numbers("desired"), float)

    @property
    def is_connected(self) -> bool:
        return self.segment.arm is not None

    @property
    def is_calibrated(self) -> bool:
        """Always True: a driver of o80 refuses to start without its calibration."""
        return True

    def calibrate(self) -> None:
        """Does nothing: `o80 arms calibrate` does."""

    def configure(self) -> None:
        """Does nothing: the driver did when it was started."""

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Attaches and takes control; moves nothing.

        Raises TimeoutError without the robot, ControlTaken if another program commands it,
        BackendHalted during a halt, InvalidArgument if `at_stop` needs a missing request.
        """
        with contextlib.ExitStack() as stack:
            arm = self.segment.open()
            stack.callback(self.segment.close)
            if self.config.at_stop != "hold" and "relax" not in arm.requests:
                raise o80.InvalidArgument(f"'{arm.segment}' cannot be relaxed: use at_stop=hold")
            stack.enter_context(arm.control(self.config.timeout))
            self.seen, self._rest_places = self.segment.read()
            for camera in self.cameras.values():
                camera.connect()
                stack.callback(camera.disconnect)
            self._held = stack.pop_all()

    @check_if_not_connected
    def get_observation(self) -> dict[str, Any]:
        """Returns the newest row in LeRobot's units, and an image of each camera."""
        self.seen, found = self.segment.read()
        images = {name: camera.async_read() for name, camera in self.cameras.items()}
        return {**found, **images}

    @check_if_not_connected
    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Sends set-points of all joints or some.

        Targets are clamped to a joint's bounds, also in `action`, which LeRobot stores afterwards.
        Returns `action`. Raises InvalidArgument for an unknown
        name or a number that is not finite.
        """
        arm = self.segment.checked()
        numbers = self.segment.numbers("desired")
        sent = {name: _within(_known(numbers, name), value) for name, value in action.items()}
        self._add(arm, sent, every=1 / self.config.fps)
        arm.pulse(seen=self.seen)
        action.update({name: value * numbers[name].scale for name, value in sent.items()})
        return action

    @check_if_not_connected
    def disconnect(self) -> None:
        """Releases control, after the action of `at_stop`, which is skipped for a halted arm."""
        with self._held:
            arm = self.segment.arm
            if self.config.at_stop == "hold" or arm is None or arm.halted or not arm.alive:
                return
            if self.config.at_stop == "rest":
                numbers = self.segment.numbers("desired")
                places = {
                    name: _within(numbers[name], place)
                    for name, place in self._rest_places.items()
                    if name in numbers
                }
                self._add(arm, places, speed=HOMEWARD, mode="overwrite")
                arm.pulse_and_wait(timeout=60.0)
            arm.request("relax", timeout=self.config.timeout)

    def _add(self, arm: o80.Frontend, places: Mapping[str, float], **pace: Any) -> None:
        """Adds commands to target positions, in the units of rows."""
        numbers = self.segment.numbers("desired")
        states: dict[str, Any] = {}
        for name, place in places.items():
            number = numbers[name]
            if number.field:
                states.setdefault(number.actuator, {})[number.field] = place
            else:
                states[number.actuator] = place
        for actuator, state in states.items():
            arm.add_command(actuator, state, **pace)


def _known(numbers: Mapping[str, Number], name: str) -> Number:
    if name not in numbers:
        known = did_you_mean(name, list(numbers)) or f": there are {', '.join(numbers)}"
        raise o80.InvalidArgument(f"the robot has no '{name}'{known}")
    return numbers[name]


def _within(number: Number, value: Any) -> float:
    """Converts a number or scalar tensor to the unit of rows, and clamps it to the bounds."""
    place = float(value) / number.scale
    if not math.isfinite(place):
        raise o80.InvalidArgument(f"'{number.name}' must be a finite number, got {float(value)}")
    return min(max(place, number.minimum), number.maximum)
