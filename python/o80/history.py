"""Many observations at once."""

from collections.abc import Iterator
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from o80 import _core


class History:
    """Neighbouring observations, oldest first: arrays with a first dimension (T,).

    Filled by one copy; its arrays are views of that copy, `rows`, and change no more. It may hold
    fewer rows than were asked for, never torn ones.
    """

    __slots__ = ("_decoder", "_layout", "rows")

    def __init__(self, decoder: _core.Decoder, rows: NDArray[Any]) -> None:
        self._decoder = decoder
        self._layout = decoder.layout
        self.rows = rows  #: structured array (T,): whole rows, as they stand in the segment

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, index: int) -> _core.Observation: ...
    @overload
    def __getitem__(self, index: slice) -> "History": ...
    def __getitem__(self, index: int | slice) -> "_core.Observation | History":
        if isinstance(index, slice):
            return History(self._decoder, self.rows[index])
        return _core.Observation(self._decoder, self.rows[index].tobytes())

    def __iter__(self) -> Iterator[_core.Observation]:
        return (self[i] for i in range(len(self)))

    @property
    def iteration(self) -> NDArray[np.int64]:
        """Iterations: (T,), each one more than the one before."""
        return self._part("iteration")

    @property
    def time(self) -> NDArray[np.int64]:
        """Times [ns]: (T,)."""
        return self._part("time")

    @property
    def lateness(self) -> NDArray[np.int64]:
        """How long after its due moment each iteration began [ns]: (T,)."""
        return self._part("lateness")

    @property
    def overruns(self) -> NDArray[np.uint32]:
        """Iterations so far that were not done in time: (T,)."""
        return self._part("overruns")

    @property
    def skipped(self) -> NDArray[np.uint32]:
        """Periods so far that were left out to catch up: (T,)."""
        return self._part("skipped")

    @property
    def fresh(self) -> NDArray[np.bool_]:
        """Whether the robot started afresh in that row: (T,)."""
        fresh: NDArray[np.bool_] = self._part("fresh") != 0
        return fresh

    @property
    def halted(self) -> NDArray[np.bool_]:
        """Whether the backend was halted in that row: (T,)."""
        halted: NDArray[np.bool_] = self._part("halted") != 0
        return halted

    def _part(self, name: str) -> NDArray[Any]:
        part: NDArray[Any] = self.rows[name]
        return part

    @property
    def desired(self) -> Any:
        """The states that were asked: (T, actuators), or a record of groups."""
        return self._layout.many(self.rows, "desired")

    @property
    def observed(self) -> Any:
        """The states that were read: (T, actuators), or a record of groups."""
        return self._layout.many(self.rows, "observed")

    @property
    def extended(self) -> Any:
        """Further sensor values: a record with an array (T, ...) for each field."""
        return self._layout.many_extras(self.rows)

    @property
    def active(self) -> NDArray[np.bool_]:
        """Whether a command gave the desired state: (T, actuators)."""
        mask: NDArray[np.bool_] = self._layout.many_masks(self.rows, "active")
        return mask

    @property
    def clamped(self) -> NDArray[np.bool_]:
        """Whether the limits changed the desired state: (T, actuators)."""
        mask: NDArray[np.bool_] = self._layout.many_masks(self.rows, "clamped")
        return mask

    @property
    def braking(self) -> NDArray[np.bool_]:
        """Whether the actuator came to rest without a command: (T, actuators)."""
        mask: NDArray[np.bool_] = self._layout.many_masks(self.rows, "braking")
        return mask

    def flat(self, dtype: Any = None) -> NDArray[Any]:
        """All observed numbers, then all extended ones: (T, numbers), float32 by default."""
        numbers: NDArray[Any] = self._layout.many_flat(self.rows, dtype)
        return numbers

    def __reduce__(self) -> tuple[Any, ...]:
        return History, (self._decoder, self.rows)

    def __repr__(self) -> str:
        if not len(self):
            return "<o80.History of no observation>"
        first, last = int(self.iteration[0]), int(self.iteration[-1])
        return f"<o80.History of {len(self)} observations, {first} to {last}>"
