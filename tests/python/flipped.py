"""A recorded run with a flipped bit."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import o80
from o80.replaying.recorded_run import FileRun


@dataclass(frozen=True)
class Flipped:
    """Recorded run in which one bit of a row is flipped."""

    run: FileRun
    row: int
    byte: int
    bit: int
    segment: str = "flipped"
    number: int = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.run, name)

    def blocks(self) -> Iterator[o80.History]:
        for block in self.run.blocks():
            raw = bytearray(block.rows.tobytes())
            place = self.row - int(block.iteration[0])
            if 0 <= place < len(block):
                raw[place * block.rows.itemsize + self.byte] ^= self.bit
            yield o80.History(block._decoder, np.frombuffer(bytes(raw), block.rows.dtype))
