"""Texts of local times: the clocks change, recordings last over midnight."""

import time
from collections.abc import Iterator

import pytest

import o80
from o80.base.local_time import instant, local, nanoseconds


@pytest.fixture(autouse=True)
def berlin(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The clocks change on 29 March and on 25 October 2026."""
    with monkeypatch.context() as zone:
        zone.setenv("TZ", "Europe/Berlin")
        time.tzset()
        yield
    time.tzset()


def within(first: str, last: str) -> tuple[int, int]:
    return nanoseconds(instant(first)), nanoseconds(instant(last))


@pytest.mark.parametrize(
    ("text", "first", "last", "found"),
    [
        ("03:30", "2026-10-25 00:30", "2026-10-25 05:00", "2026-10-25 03:30:00+01:00"),
        ("2:30", "2026-10-25 02:10+02:00", "2026-10-25 02:50+02:00", "2026-10-25 02:30:00+02:00"),
        ("02:30+01:00", "2026-10-25 00:30", "2026-10-25 05:00", "2026-10-25 02:30:00+01:00"),
        ("04:00", "2026-03-29 00:30", "2026-03-29 05:00", "2026-03-29 04:00:00+02:00"),
        ("00:30", "2026-11-24 23:00", "2026-11-25 01:00", "2026-11-25 00:30:00+01:00"),
        ("22:00", "2026-11-24 23:00", "2026-11-25 01:00", "2026-11-24 22:00:00+01:00"),
        ("02:00", "2026-11-24 23:00", "2026-11-25 01:00", "2026-11-25 02:00:00+01:00"),
        ("2026-11-26 10:02", "2026-11-24", "2026-11-27", "2026-11-26 10:02:00+01:00"),
        ("10:02:30.5", "2026-11-24 10:00", "2026-11-24 11:00", "2026-11-24 10:02:30.500000+01:00"),
    ],
)
def test_a_time_is_that_within_the_recording(text: str, first: str, last: str, found: str) -> None:
    assert str(instant(text, within=within(first, last))) == found


@pytest.mark.parametrize(
    ("text", "first", "last", "cure"),
    [
        ("02:30", "2026-10-25 00:30", "2026-10-25 05:00", "02:30:00\\+02:00.*02:30:00\\+01:00"),
        ("02:30", "2026-03-29 00:30", "2026-03-29 05:00", "the clocks change"),
        ("10:02", "2026-11-24 09:00", "2026-11-26 12:00", "2026-11-24 10:02.*2026-11-26 10:02"),
        ("2026-10-25 02:30", "2026-10-25", "2026-10-26", "\\+02:00.*\\+01:00"),
        ("noon", "2026-10-25", "2026-10-26", "2026-11-24 10:02"),
    ],
)
def test_a_time_that_is_not_one_is_refused(text: str, first: str, last: str, cure: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=cure):
        instant(text, within=within(first, last))


def test_every_hour_of_a_year_is_found_by_its_text() -> None:
    for hour in range(365 * 24):
        at = nanoseconds(instant("2026-01-01")) + hour * 3600 * 10**9
        assert nanoseconds(instant(str(local(at)))) == at
        assert instant(f"{local(at):%H:%M}", within=(at, at + 1)) == local(at)
