"""Converts texts of local times to instants. No other place computes with local hours."""

import re
from datetime import UTC, datetime, time, timedelta

from o80.base.errors import InvalidArgument

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MOST = 5  # instants that an error lists


def nanoseconds(instant: datetime) -> int:
    """Converts a datetime with an offset to ns since 1970."""
    return (instant - _EPOCH) // timedelta(microseconds=1) * 1000


def local(at: int) -> datetime:
    """Converts an instant [ns since 1970] to local time, with its offset."""
    return (_EPOCH + timedelta(microseconds=at // 1000)).astimezone()


def instant(text: str, *, within: tuple[int, int] | None = None, is_end: bool = False) -> datetime:
    """Parses "2026-11-24", "2026-11-24 10:02", "10:02:30.5" or "10:02+01:00" as an instant.

    within: first and last time of a recording [ns since 1970]: a time without a date is placed
        within it, or as near as possible. Without it, such a time is of today.
    is_end: a day stands for its end.

    Raises InvalidArgument, also for a time that comes twice or never because the clocks change.
    """
    try:
        if re.match(r"\d{4}-", text):
            given, within = datetime.fromisoformat(text), None
            if len(text) == len("2026-11-24"):
                after = _instants(given + timedelta(days=is_end), 1)[0]
                return after - timedelta(microseconds=is_end)
        elif ":" in text:
            clock = time.fromisoformat(re.sub(r"^(\d):", r"0\1:", text))
            given = datetime.combine(datetime.now(clock.tzinfo), clock)
        else:
            raise ValueError
    except (ValueError, OverflowError):
        raise InvalidArgument(
            f"write 2026-11-24, '2026-11-24 10:02', 10:02 or 10:02:30.5, not '{text}'"
        ) from None
    if within is None:
        return _only(text, _instants(given))
    first, last = (local(each) for each in within)
    begin = datetime.combine(first - timedelta(days=1), given.timetz())
    days = [begin + timedelta(days=n) for n in range((last.date() - first.date()).days + 3)]
    inside = [each for day in days for each in _instants(day) if first <= each <= last]

    def away(day: datetime) -> timedelta:
        at = _instants(day, 1)[0]
        return max(first - at, at - last)

    return _only(text, inside or _instants(min(days, key=away)))


def _instants(given: datetime, most: int = 2) -> list[datetime]:
    """Returns instants at which the local clock shows a time: one; at a clock change two or none.

    most: 1 returns exactly one, the first; for a skipped time the end of the gap.
    """
    if given.tzinfo is not None:
        return [given]
    found = [given.replace(fold=fold).astimezone() for fold in (0, 1)]
    if most == 1 or found[0] == found[1]:
        return found[:1]
    return [each for each in found if local(nanoseconds(each)).replace(tzinfo=None) == given]


def _only(text: str, found: list[datetime]) -> datetime:
    if len(found) == 1:
        return found[0]
    if not found:
        raise InvalidArgument(
            f"no local clock shows '{text}', because the clocks change: write an earlier or a "
            f"later time, or one with an offset such as 02:30+02:00"
        )
    shown = [f"'{each.isoformat(' ', 'auto')}'" for each in found[:_MOST]]
    more = f" and {len(found) - _MOST} more" if len(found) > _MOST else ""
    raise InvalidArgument(f"'{text}' may be {', '.join(shown)}{more}: write which one")
