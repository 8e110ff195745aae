"""An SO-101 with fake servos, whose time passes with each reading: no test needs a clock."""

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import o80
from o80_arms.fakes.feetech import FakeChain, FakeServo

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
OFFSETS = (-12, 30, 0, 1200, -1, 5)
RANGES = ((750, 3400), (830, 3200), (900, 3100), (860, 3180), (60, 4000), (2000, 3450))


class FakeArm:
    """The fake servos, their calibration file, and the options with which the arm finds both."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.file = folder / "black.json"
        self.file.write_text(json.dumps(calibration(), indent=4))
        self.line = stack.enter_context(FakeChain(folder / "tty", tick=1 / 150))
        for number, each in enumerate(calibration().values(), 1):
            servo = self.line.servos[number]
            servo.calibrate(each["homing_offset"], each["range_min"], each["range_max"])
            servo.stand_at(2100)
        self._stack = stack

    @property
    def options(self) -> dict[str, Any]:
        # a busy machine may be late by seconds; a servo that is silent costs this time
        options = {"port": str(self.line.port), "calibration": str(self.file)}
        return {**options, "answer_timeout": 0.5}

    def servo(self, joint: str) -> FakeServo:
        return self.line.servos[JOINTS.index(joint) + 1]

    @property
    def shown(self) -> list[int]:
        """Position of each servo [steps]."""
        return [servo.shown for servo in self.line.servos.values()]

    def started(self, **options: str | float) -> o80.Frontend:
        every: dict[str, Any] = {**self.options, **options}
        robot: o80.Frontend = o80.robots.load("so101").inline(**every)
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
