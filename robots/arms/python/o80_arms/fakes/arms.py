"""Fake arms: servos, and a calibration file for the driver."""

import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from o80_arms import calibration
from o80_arms.calibration import JOINTS, Calibration
from o80_arms.dynamixel import KOCH_LEADER
from o80_arms.fakes import dynamixel, feetech
from o80_arms.fakes.chain import FakeChain

RANGES = ((795, 3300), (910, 3185), (944, 3151), (967, 3128), (228, 3867), (2030, 3500))


@dataclass(frozen=True)
class FakeArm:
    """Servos on a pseudo-terminal, and their calibration file."""

    chain: FakeChain[Any]
    file: Path

    @property
    def options(self) -> dict[str, Any]:
        """Options of the robot, with a long timeout because a fake in Python may answer late."""
        return {
            "port": str(self.chain.port),
            "calibration": str(self.file),
            "answer_timeout": 0.5 if self.chain.tick else 0.1,
        }


def so101(*, latency: float = 0.001, tick: float | None = None) -> AbstractContextManager[FakeArm]:
    """Creates a calibrated SO-101 in the middle of its ranges.

    latency: of the adapter [s]. tick: simulated time per reading [s]; the bus then takes no
    time, so that bursts are fast and repeatable. None: the clock's time.
    """
    return _arm(feetech.FakeChain, latency, tick)


def koch(*, latency: float = 0.001, tick: float | None = None) -> AbstractContextManager[FakeArm]:
    """Creates a calibrated Koch, as `so101`."""
    return _arm(dynamixel.FakeChain, latency, tick)


def koch_leader(
    *, latency: float = 0.001, tick: float | None = None
) -> AbstractContextManager[FakeArm]:
    """Creates a calibrated leader of a Koch, as `so101`."""
    return _arm(partial(dynamixel.FakeChain, models=KOCH_LEADER), latency, tick)


so101_leader = so101  # the same servos


@contextmanager
def _arm(make: Any, latency: float, tick: float | None) -> Iterator[FakeArm]:
    with tempfile.TemporaryDirectory() as folder:
        file, port = Path(folder) / "fake.json", Path(folder) / "tty"
        ranges = dict(zip(JOINTS, RANGES, strict=True))
        calibration.write(file, {joint: Calibration(0, *each) for joint, each in ranges.items()})
        timing = {"latency": latency, "bus_time": True} if tick is None else {"tick": tick}
        with make(port, **timing) as chain:
            for number, (smallest, largest) in enumerate(RANGES, 1):
                chain.servos[number].calibrate(0, smallest, largest)
                chain.servos[number].stand_at((smallest + largest) // 2)
            yield FakeArm(chain, file)
