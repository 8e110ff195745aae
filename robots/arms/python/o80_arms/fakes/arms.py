"""A fake SO-101: its servos, and the calibration with which o80 finds them."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from o80_arms import calibration
from o80_arms.calibration import JOINTS, Calibration
from o80_arms.fakes.feetech import FakeChain

RANGES = ((795, 3300), (910, 3185), (944, 3151), (967, 3128), (228, 3867), (2030, 3500))


@dataclass(frozen=True)
class FakeSO101:
    """Servos on a pseudo-terminal, and the file with their calibration."""

    chain: FakeChain
    file: Path

    @property
    def options(self) -> dict[str, Any]:
        """Options of the robot "so101"; a program in Python may answer late."""
        return {
            "port": str(self.chain.port),
            "calibration": str(self.file),
            "answer_timeout": 0.5 if self.chain.tick else 0.1,
        }


@contextmanager
def so101(*, latency: float = 0.001, tick: float | None = None) -> Iterator[FakeSO101]:
    """A calibrated arm that stands in the middle of its ranges.

    latency: of the adapter [s]. tick: time that passes with each reading [s]; the bus then takes
    none, so that bursts are fast and repeatable. None: time passes by the clock.
    """
    with tempfile.TemporaryDirectory() as folder:
        file, port = Path(folder) / "fake.json", Path(folder) / "tty"
        ranges = dict(zip(JOINTS, RANGES, strict=True))
        calibration.write(file, {joint: Calibration(0, *each) for joint, each in ranges.items()})
        chain = (
            FakeChain(port, latency=latency, bus_time=True)
            if tick is None
            else FakeChain(port, tick=tick)
        )
        with chain:
            for number, (smallest, largest) in enumerate(RANGES, 1):
                chain.servos[number].calibrate(0, smallest, largest)
                chain.servos[number].stand_at((smallest + largest) // 2)
            yield FakeSO101(chain, file)
