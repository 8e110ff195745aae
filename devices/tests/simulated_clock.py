"""A device with a clock of its own, and a network whose delays vary above the least one."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

SECOND = 1e9  # [ns]

Delay = Callable[[random.Random], float]


def exponential(mean: float) -> Delay:
    return lambda draw: draw.expovariate(1.0 / mean)


def uniform(mean: float) -> Delay:
    return lambda draw: draw.uniform(0.0, 2.0 * mean)


def heavy_tailed(mean: float) -> Delay:
    """Packets may wait for a hundred times the mean."""
    return lambda draw: min(100.0, draw.paretovariate(1.5) - 1.0) * mean


@dataclass(frozen=True)
class Packet:
    captured: float  #: [ns] on the clock of this machine
    stamp: int  #: [ticks] of the device
    arrival: int  #: [ns]


@dataclass(frozen=True)
class Device:
    frequency: float = 300.0  # [Hz]
    tick: float = 1.0  # [ns]
    rate: float = 50e-6  # the device's clock runs so much faster
    latency: float = 0.002  # the least delay [s]
    delay: Delay = field(default_factory=lambda: exponential(0.0005))
    seconds: float = 20.0
    jumps: Sequence[tuple[float, float]] = ()  # (when, how far) [s] the device's clock is set
    silences: Sequence[tuple[float, float]] = ()  # (from, to) [s]
    queues: Sequence[tuple[float, float, float]] = ()  # (from, to, further delay) [s]

    def packets(self, seed: int = 0) -> Iterator[Packet]:
        draw = random.Random(seed)
        begin = draw.uniform(0.0, 1e6)
        arrival = 0
        for frame in range(round(self.seconds * self.frequency)):
            now = frame / self.frequency
            delay = self.latency + self.delay(draw)
            delay += sum(more for begun, end, more in self.queues if begun <= now < end)
            if any(begun <= now < end for begun, end in self.silences):
                continue
            device = begin + now * (1.0 + self.rate)
            device += sum(by for when, by in self.jumps if now >= when)
            # packets do not overtake each other
            arrival = max(arrival, round((now + delay) * SECOND))
            yield Packet(now * SECOND, int(device * SECOND / self.tick), arrival)
