"""Calibrations of an arm in LeRobot's form: a file, and the same numbers in the servos."""

import json
import os
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Self

import o80
from o80.base.finite import json_text
from o80_arms.bus import TURN, Bus, DynamixelBus

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
KEYS = ("homing_offset", "range_min", "range_max")  # keys of LeRobot's files
MODEL_RANGES = (220, 200, 194, 190, 320, 110)  # of the published arm [deg]


class CalibrationError(o80.Error):
    """A calibration is missing or invalid."""


LARGEST_OFFSET = 2047  # limit of an STS3215


@dataclass(frozen=True)
class Calibration:
    """Calibration of a joint, as in its servo and in LeRobot's file [steps]."""

    offset: int
    smallest: int
    largest: int

    @classmethod
    def of_servo(cls, bus: Bus, servo: int) -> Self:
        return cls(*(bus.read(servo, each) for each in (bus.OFFSET, bus.SMALLEST, bus.LARGEST)))

    @classmethod
    def of_motion(cls, smallest: int, largest: int, bus: Bus | type[Bus] = Bus) -> Self:
        """Computes a calibration from a joint's range of motion, in encoder steps without offset.

        The middle of the range becomes the middle of the shown positions, so that the wrap from
        4095 to 0 is as far away as possible.
        """
        offset = min((smallest + largest) // 2 % TURN - (TURN // 2 - 1), LARGEST_OFFSET)
        middle, half = TURN // 2 - 1, min((largest - smallest) // 2, TURN // 2 - 1)
        return cls(-bus.OFFSET_SIGN * offset, middle - half, middle + half)

    def write(self, bus: Bus, servo: int) -> None:
        with bus.unlocked(servo):
            for register, value in (
                (bus.OFFSET, self.offset),
                (bus.SMALLEST, self.smallest),
                (bus.LARGEST, self.largest),
                (bus.MODE, bus.modes[servo - 1]),
            ):
                bus.write(servo, register, value)

    def __str__(self) -> str:
        return f"offset {self.offset}, range {self.smallest}..{self.largest}"


def folder() -> Path:
    """Returns LeRobot's folder of calibrations."""
    if own := os.environ.get("HF_LEROBOT_CALIBRATION"):
        return Path(own)
    cache = Path(os.environ.get("HF_HOME", Path.home() / ".cache" / "huggingface"))
    return Path(os.environ.get("HF_LEROBOT_HOME", cache / "lerobot")) / "calibration"


def folders_of(bus: Bus, leader: bool) -> list[str]:
    """Returns LeRobot's folder names for this type of arm, the newest first."""
    names = ("koch",) if isinstance(bus, DynamixelBus) else ("so", "so101", "so100")
    return [
        f"teleoperators/{name}_leader" if leader else f"robots/{name}_follower" for name in names
    ]


def files(bus: Bus) -> list[Path]:
    """Lists LeRobot's calibration files for this type of arm."""
    folders = folders_of(bus, False) + folders_of(bus, True)
    return [file for each in folders for file in sorted((folder() / each).glob("*.json"))]


def find(name: str, folders: Sequence[str]) -> Path:
    """Finds the file of a name, which may be a path. Raises CalibrationError if there is none."""
    if "/" in name or name.endswith(".json"):
        return Path(name)
    for each in folders:
        if (file := folder() / each / f"{name}.json").exists():
            return file
    raise CalibrationError(f"there is no calibration '{name}' in {folder() / folders[0]}")


def place_for(name: str, folders: Sequence[str]) -> Path:
    """Returns the file to which a calibration of this name is written."""
    own = "/" in name or name.endswith(".json")
    return Path(name) if own else folder() / folders[0] / f"{name}.json"


def read(file: Path) -> dict[str, Calibration]:
    """Reads the joints of a file. Raises CalibrationError for an invalid file."""
    try:
        content = json.loads(file.read_text(encoding="utf-8-sig"))
        joints = {joint: Calibration(*(content[joint][each] for each in KEYS)) for joint in JOINTS}
        for joint, each in joints.items():
            numbers = each.offset, each.smallest, each.largest
            are_integers = all(isinstance(number, int) for number in numbers)
            if not are_integers or not 0 <= each.smallest < each.largest < TURN:
                raise ValueError(f"{joint} has {each}")
        return joints
    except (OSError, ValueError, KeyError, TypeError) as error:
        why = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise CalibrationError(
            f"{file} is not a calibration of an arm: {why}. `o80 arms calibrate --take NAME` makes "
            f"one from the values in the servos"
        ) from None


def write(file: Path, joints: dict[str, Calibration]) -> None:
    """Writes a file in LeRobot's format."""
    content = {
        joint: {
            "id": number,
            "drive_mode": 0,
            **dict(zip(KEYS, astuple(joints[joint]), strict=True)),
        }
        for number, joint in enumerate(JOINTS, 1)
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json_text(content, indent=4))


def doubts(joints: dict[str, Calibration]) -> list[str]:
    """Describes suspiciously small ranges: the middle of a range moved by hand becomes 0."""
    found = []
    for joint, degrees in zip(JOINTS, MODEL_RANGES, strict=True):
        moved = (joints[joint].largest - joints[joint].smallest) * 360 / (TURN - 1)
        if joint not in ("wrist_roll", "gripper") and moved < 0.85 * degrees:
            found.append(
                f"{joint} was moved through only {moved:.0f} of {degrees} deg during its "
                f"calibration: its zero may be wrong by up to {(degrees - moved) / 2:.0f} deg"
            )
    return found
