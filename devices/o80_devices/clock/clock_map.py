"""The map from stamps of a device to the monotonic clock of this machine."""

from __future__ import annotations

import math
from dataclasses import dataclass

from o80.errors import InvalidArgument
from o80_devices.clock.lower_envelope import LowerEnvelope

SECOND = 1e9  # [ns]
MILLISECOND = 1e6  # [ns]

SETTLE = 10  # number of late buckets that prove a clock set back
RECENT = 2  # buckets whose least delay counts as an error, in case the clock was set back

UNKNOWN = 10.0 * MILLISECOND  # error of the first point of all
STEP = 5.0 * MILLISECOND  # smaller jumps are delays
STEP_SCATTERS = 10.0  # the same limit in mean delays
REORDERED = 0.2 * SECOND  # a stamp older by less is a late packet, not a restart
OLD_IN_A_ROW = 10  # number of consecutive late packets that prove a restart
USUAL_RATE = 1e-4  # usual difference of two quartz clocks' rates


@dataclass(frozen=True)
class Capture:
    """Capture time of a value."""

    time: int  #: [ns] on the monotonic clock of this machine
    error: int  #: estimated error of the time [ns], about two standard deviations
    epoch: int  #: increases when the device's clock has jumped or restarted


class ClockMap:
    """Maps stamps of a device to capture times, based on the arrival times of the stamps.

    The delay from capture to arrival varies, and is at least `latency`. The map is
    the line below all arrivals of the last 30 s, minus `latency`: the line follows the drift of
    the device's clock, and queued packets do not move it. Capture times never
    decrease and are never later than the arrival.

    The stamps determine rate, jumps and restarts, but not the least delay. Measure that delay
    (`o80 latency`) and pass it as `latency`.
    """

    def __init__(
        self,
        *,
        tick: float = 1.0,
        wrap: int | None = None,
        latency: float = 0.0,
        latency_error: float = 0.0,
    ) -> None:
        """tick: unit of a stamp [ns]: 1000 for microseconds, 1e9 / 300 for frames at 300 Hz.

        wrap: number of stamps after which the counter wraps, such as 2**32.
        latency, latency_error: least delay from capture to arrival, and its error [s].
        """
        if not 0 < tick < math.inf:
            raise InvalidArgument(f"tick must be positive and finite [ns], got {tick}")
        if wrap is not None and wrap < 2:
            raise InvalidArgument(f"wrap must be at least 2, got {wrap}")
        if not (0 <= latency < math.inf and 0 <= latency_error < math.inf):
            raise InvalidArgument(
                "latency and latency_error must be finite and at least 0 s, got "
                f"{latency}, {latency_error}"
            )
        self._tick = tick
        self._wrap = wrap
        self._latency = round(latency * SECOND)
        self._own_error = latency_error * SECOND + (tick if tick > 1.0 else 0.0)
        self._epoch = -1
        self._envelope = LowerEnvelope(0.0, USUAL_RATE)
        self._scatter: float | None = None  # of the previous epoch [ns]
        self._first = self._first_arrival = 0
        self._last = self._last_arrival = 0
        self._last_old = 0
        self._old_in_a_row = 0
        self._time: int | None = None
        self._restarted = False

    # ------------------------------------------------------------------ the map

    def capture(self, stamp: int, arrival: int) -> Capture | None:
        """Returns the capture time for a stamp; None if the stamp is old or repeated.

        Drop data without a capture time.

        stamp: [ticks]. arrival: [ns] on the monotonic clock (`time.monotonic_ns`).
        """
        arrival = max(arrival, self._last_arrival)
        if self._epoch < 0 or self._restarted:
            self._begin_epoch(stamp, arrival)
        else:
            stamp = self._unwrapped(stamp, arrival)
            if self._is_old(stamp):
                return None
            x, y = self._point(stamp, arrival)
            if stamp <= self._last or self._was_set_forward(x, y) or self._was_set_back():
                self._begin_epoch(stamp, arrival)
        self._last, self._last_arrival, self._old_in_a_row = stamp, arrival, 0
        x, y = self._point(stamp, arrival)
        self._envelope.add(x, y)
        return self._capture(x, arrival)

    def restarted(self) -> None:
        """Begins an epoch, because the device may have restarted, as after a reconnection."""
        self._restarted = True

    @property
    def rate(self) -> float:
        """Relative lag of the device's clock behind this machine's: 1e-6 is a microsecond a
        second."""
        return self._envelope.rate

    def _capture(self, x: float, arrival: int) -> Capture:
        earliest = self._first_arrival + round(x + self._envelope.at(x)) - self._latency
        time = min(earliest, arrival - self._latency)
        if self._time is not None:
            time = min(max(time, self._time), arrival)
        self._time = time
        error = self._line_error(x) + self._own_error + abs(time - earliest)
        return Capture(time, round(error), self._epoch)

    def _line_error(self, x: float) -> float:
        """Error of the line at x [ns]."""
        envelope = self._envelope
        if envelope.buckets <= RECENT:
            count = envelope.count
            before = UNKNOWN if self._scatter is None else 4.0 * self._scatter
            return (3.0 * envelope.scatter() + before / count) / math.sqrt(count)
        recent = envelope.least_above(RECENT)
        rate = envelope.rate_error * envelope.from_middle(x)
        return recent + rate + envelope.error

    # ------------------------------------------------------------------ jumps of the clock

    def _unwrapped(self, stamp: int, arrival: int) -> int:
        """Unwraps a stamp, to the value nearest to the expected one."""
        if self._wrap is None:
            return stamp
        expected = self._last + round((arrival - self._last_arrival) / self._tick)
        half = self._wrap // 2
        return expected + (stamp - expected + half) % self._wrap - half

    def _is_old(self, stamp: int) -> bool:
        """Whether a stamp is repeated or out of order, and not the sign of a restart."""
        if stamp > self._last:
            return False
        behind = (self._last - stamp) * self._tick
        if stamp == self._last or behind < REORDERED:
            continues = self._old_in_a_row == 0 or stamp > self._last_old
            self._old_in_a_row = self._old_in_a_row + 1 if continues else 1
            self._last_old = stamp
            return self._old_in_a_row < OLD_IN_A_ROW
        return False

    def _point(self, stamp: int, arrival: int) -> tuple[float, float]:
        x = (stamp - self._first) * self._tick
        return x, (arrival - self._first_arrival) - x

    def _step(self, but_last: int = 0) -> float:
        """Least lateness that is no delay [ns], without the newest `but_last` buckets."""
        return max(STEP, STEP_SCATTERS * self._envelope.scatter(but_last))

    def _was_set_forward(self, x: float, y: float) -> bool:
        """Whether a point implies an arrival before the capture."""
        above = self._envelope.above(x, y)
        if above > -STEP:
            return False
        return above < -self._step() - self._line_error(x)

    def _was_set_back(self) -> bool:
        """Whether all values have been late for longer than a queue can explain."""
        envelope = self._envelope
        return (
            envelope.buckets > SETTLE
            and envelope.least_above(RECENT) > STEP
            and envelope.newest_count(SETTLE) >= 2 * SETTLE
            and envelope.least_above(SETTLE) > self._step(but_last=SETTLE)
        )

    def _begin_epoch(self, stamp: int, arrival: int) -> None:
        """Forgets the offset between the clocks, and keeps the rate."""
        before = self._envelope
        if before:
            self._scatter = before.scatter(but_last=SETTLE) or before.scatter()
            self._envelope = LowerEnvelope(before.rate, before.rate_error)
        self._epoch += 1
        self._restarted = False
        self._first, self._first_arrival = stamp, arrival
