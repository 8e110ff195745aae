"""Selects observations of a history from the arguments of a call."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from o80.base.argument_checks import whole_or_none
from o80.base.errors import InvalidArgument

LONGEST = 2.0**62  # duration [ns], 146 years


@dataclass(frozen=True)
class Selection:
    """Observations by number, by the last seconds, or by iterations and times."""

    n: int | None
    since: int | None
    until: int | None
    duration: int | None  #: before the newest observation [ns]
    from_time: int | None  #: [ns]
    to_time: int | None  #: [ns]

    @classmethod
    def checked(
        cls,
        n: int | None,
        since: int | None,
        until: int | None,
        seconds: float | None,
        from_time: int | None,
        to_time: int | None,
    ) -> Self:
        """Makes a selection from the arguments of a call. Raises InvalidArgument."""
        ends = since, until, from_time, to_time
        if (n is not None) + (seconds is not None) + any(end is not None for end in ends) > 1:
            raise InvalidArgument(
                "give either n, or seconds, or any of since, until, from_time and to_time"
            )
        return cls(
            n=whole_or_none(n, "n, the number of observations,", 0),
            since=whole_or_none(since, "since"),
            until=whole_or_none(until, "until"),
            duration=None if seconds is None else _nanoseconds(seconds),
            from_time=whole_or_none(from_time, "from_time"),
            to_time=whole_or_none(to_time, "to_time"),
        )

    def range(
        self,
        oldest: int,
        newest: int,
        iteration_at: Callable[[int], int],
        newest_time: Callable[[], int],
    ) -> tuple[int, int]:
        """First and last iteration between oldest and newest; empty if first is above last.

        iteration_at: returns the newest iteration at or before a time, `oldest - 1` if there is
            none.
        """
        first, last = oldest, newest
        if newest < oldest:
            return first, last
        if self.n is not None:
            first = max(first, newest + 1 - self.n)
        if self.duration is not None:
            first = max(first, iteration_at(newest_time() - self.duration) + 1)
        if self.since is not None:
            first = max(first, self.since)
        if self.until is not None:
            last = min(last, self.until)
        if self.from_time is not None:
            first = max(first, iteration_at(self.from_time - 1) + 1)
        if self.to_time is not None:
            last = min(last, iteration_at(self.to_time))
        return first, last


def _nanoseconds(seconds: float) -> int:
    if isinstance(seconds, (bool, str)) or not math.isfinite(seconds) or seconds < 0:
        raise InvalidArgument(f"seconds must be a finite number of at least 0, got {seconds!r}")
    return round(min(seconds * 1e9, LONGEST))
