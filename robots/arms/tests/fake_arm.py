"""Arms with fake servos, whose time advances with each reading, so that no test needs a clock."""

import json
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import o80
from o80_arms.dynamixel import KOCH_LEADER
from o80_arms.fakes import dynamixel, feetech

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
OFFSETS = (-12, 30, 0, 1200, -1, 5)
RANGES = ((750, 3400), (830, 3200), (900, 3100), (860, 3180), (60, 4000), (2000, 3450))


class FakeArm:
    """Fake servos, their calibration file, and the options of an arm that uses both."""

    def __init__(self, folder: Path, stack: ExitStack, kind: str = "so101") -> None:
        self.kind = kind
        self.file = folder / "black.json"
        self.file.write_text(json.dumps(calibration(), indent=4))
        make: Any = {
            "so101": feetech.FakeChain,
            "koch": dynamixel.FakeChain,
            "koch_leader": partial(dynamixel.FakeChain, models=KOCH_LEADER),
        }[kind]
        self.line: Any = stack.enter_context(make(folder / "tty", tick=1 / 150))
        for number, each in enumerate(calibration().values(), 1):
            servo = self.line.servos[number]
            servo.calibrate(each["homing_offset"], each["range_min"], each["range_max"])
            servo.stand_at(2100)
            if kind != "so101":  # LeRobot's settings
                servo.put(dynamixel.RETURN_DELAY, 0)
                servo.put(servo.MODE, 5 if number == 6 else 4)
                servo.keep()
        self._stack = stack

    @property
    def options(self) -> dict[str, Any]:
        # a busy machine may be late by seconds; a silent servo costs this time
        options = {"port": str(self.line.port), "calibration": str(self.file)}
        return {**options, "answer_timeout": 0.5}

    def servo(self, joint: str) -> Any:
        return self.line.servos[JOINTS.index(joint) + 1]

    @property
    def servos(self) -> list[Any]:
        return list(self.line.servos.values())

    @property
    def shown(self) -> list[int]:
        """Position of each servo [steps]."""
        return [servo.shown for servo in self.servos]

    @property
    def torque(self) -> list[int]:
        return [servo.torque for servo in self.servos]

    @property
    def strengths(self) -> list[float]:
        return [round(servo.strength, 2) for servo in self.servos]

    def started(self, **options: str | float) -> o80.Frontend:
        every: dict[str, Any] = {**self.options, **options}
        robot: o80.Frontend = o80.robots.load(self.kind).inline(**every)
        return self._stack.enter_context(robot)


def calibration() -> dict[str, dict[str, int]]:
    return {
        joint: {
            "id": number,
            "drive_mode": 0,
            "homing_offset": offset,
            "range_min": smallest,
            "range_max": largest,
        }
        for number, (joint, offset, (smallest, largest)) in enumerate(
            zip(JOINTS, OFFSETS, RANGES, strict=True), 1
        )
    }
