"""Capture times from the stamps of simulated devices, whose truth is known."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from simulated_clock import SECOND, Device, Packet, exponential, heavy_tailed, uniform

import o80
from o80_devices.clock import Capture, ClockMap

MILLISECOND = 1e6  # [ns]

Mapped = list[tuple[Packet, Capture]]


def mapped(device: Device, clock: ClockMap | None = None, seed: int = 0) -> Mapped:
    """Packets that were not dropped, each with its capture time."""
    clock = clock or ClockMap(latency=device.latency, tick=device.tick)
    found = []
    for packet in device.packets(seed):
        capture = clock.capture(packet.stamp, packet.arrival)
        if capture is not None:
            found.append((packet, capture))
    return found


def between(found: Mapped, begin: float, end: float = 1e9) -> Mapped:
    """Packets captured in a span of time [s]."""
    return [each for each in found if begin * SECOND <= each[0].captured < end * SECOND]


def worst(found: Mapped) -> float:
    """The largest error [ns]."""
    return max(abs(capture.time - packet.captured) for packet, capture in found)


def share_within(found: Mapped) -> float:
    """Share of the captures that are as near to the truth as they say."""
    good = sum(abs(each.time - packet.captured) <= each.error for packet, each in found)
    return good / len(found)


def assert_in_order(found: Mapped) -> None:
    """Capture times never decrease, and nothing is captured after it arrived."""
    assert all(one.time <= two.time for (_, one), (_, two) in pairwise(found))
    assert all(capture.time <= packet.arrival for packet, capture in found)


# ---------------------------------------------------------------------- properties


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    frequency=st.sampled_from([10.0, 60.0, 180.0, 300.0]),
    rate=st.floats(-150e-6, 150e-6),
    mean=st.floats(1e-5, 5e-3),
    kind=st.sampled_from([exponential, uniform, heavy_tailed]),
    jump=st.one_of(st.floats(-1e4, -0.2), st.floats(0.1, 1e4)),
    seed=st.integers(0, 1000),
)
def test_a_capture_is_as_near_as_it_says(frequency, rate, mean, kind, jump, seed) -> None:  # type: ignore[no-untyped-def]
    device = Device(frequency=frequency, rate=rate, delay=kind(mean), jumps=[(12.0, jump)])
    found = mapped(device, seed=seed)
    assert_in_order(found)
    assert share_within(found) > 0.9
    assert found[-1][1].epoch >= 1


@settings(max_examples=300, deadline=None)
@given(
    packets=st.lists(st.tuples(st.integers(-(2**63), 2**63), st.integers(0, 10**10)), min_size=1),
    wrap=st.none() | st.integers(2, 2**40),
    tick=st.sampled_from([1.0, 1000.0, 1e9 / 300]),
)
def test_no_stamps_make_time_run_backwards(packets, wrap, tick) -> None:  # type: ignore[no-untyped-def]
    clock = ClockMap(wrap=wrap, tick=tick, latency=0.001)
    last, arrival = None, 0
    for stamp, later in packets:
        arrival += later
        capture = clock.capture(stamp, arrival)
        if capture is not None:
            assert capture.time <= arrival
            assert capture.error >= 0
            assert last is None or capture.time >= last
            last = capture.time


@settings(max_examples=20, deadline=None)
@given(wrap=st.sampled_from([2**16, 2**24, 2**32]), seed=st.integers(0, 100))
def test_a_counter_that_wraps_is_as_good_as_one_that_does_not(wrap: int, seed: int) -> None:
    device = Device(tick=1e6, seconds=200.0, frequency=20.0, silences=[(40.0, 60.0)])
    wraps = ClockMap(tick=1e6, wrap=wrap)
    whole = ClockMap(tick=1e6)
    for packet in device.packets(seed):
        expected = whole.capture(packet.stamp, packet.arrival)
        assert wraps.capture(packet.stamp % wrap, packet.arrival) == expected


# ---------------------------------------------------------------------- the line


def test_delays_above_the_least_do_not_move_the_capture() -> None:
    found = mapped(Device(delay=exponential(0.005)))
    assert worst(between(found, 10.0)) < 0.1 * MILLISECOND  # the mean delay is 5 ms


def test_the_rate_of_a_clock_is_found() -> None:
    clock = ClockMap()
    mapped(Device(rate=-80e-6, seconds=30.0), clock)
    assert clock.rate == pytest.approx(80e-6, abs=2e-6)


def test_packets_of_a_stalled_reader_keep_their_capture_times() -> None:
    """A packet that waited in the socket of a stopped process was not captured when it was read."""
    packets = list(Device().packets())
    clock = ClockMap(latency=0.002)
    until = int(10.7 * SECOND)
    found = []
    for packet in packets:
        stalled = 10.0 * SECOND < packet.arrival < until
        capture = clock.capture(packet.stamp, until if stalled else packet.arrival)
        assert capture is not None
        found.append((packet, capture))
    assert worst(between(found, 9.0, 11.0)) < 0.1 * MILLISECOND


def test_the_error_tells_of_a_line_that_may_be_wrong() -> None:
    """In a queue all packets are late, or the clock was set back: nobody can know which at once."""
    found = mapped(Device(queues=[(10.0, 13.0, 0.02)]))
    assert worst(between(found, 10.0, 13.0)) < 0.1 * MILLISECOND
    assert min(each.error for _, each in between(found, 11.5, 13.0)) > 19 * MILLISECOND
    assert max(each.error for _, each in between(found, 15.0)) < MILLISECOND
    assert found[-1][1].epoch == 0


def test_a_coarse_stamp_is_an_error_of_a_tick() -> None:
    found = mapped(Device(tick=1e6))
    assert all(each.error >= 1e6 for _, each in found)
    assert share_within(found) > 0.95


def test_the_error_of_the_latency_is_part_of_the_error() -> None:
    device = Device()
    found = mapped(device, ClockMap(latency=0.003, latency_error=0.001))
    assert share_within(found) > 0.95


def test_frame_numbers_are_stamps() -> None:
    found = mapped(Device(rate=0.0, tick=SECOND / 300))
    assert worst(found[-1:]) < 0.1 * MILLISECOND


# ---------------------------------------------------------------------- jumps and silence


@pytest.mark.parametrize("jump", [-1e5, -5.0, -0.3, 0.05, 5.0, 1e5])
def test_a_clock_that_is_set_begins_an_epoch_at_once(jump: float) -> None:
    found = mapped(Device(jumps=[(10.0, jump)]))
    assert_in_order(found)
    assert len(found) == 6000
    assert [each.epoch for _, each in found] == [0] * 3000 + [1] * 3000
    assert worst(between(found, 10.0)) < MILLISECOND
    assert share_within(between(found, 10.0)) > 0.95


@pytest.mark.parametrize("jump", [-0.15, -0.05])
def test_a_clock_set_back_by_little_drops_some_packets_before_it_is_believed(jump: float) -> None:
    found = mapped(Device(jumps=[(10.0, jump)]))
    assert_in_order(found)
    assert 0 < 6000 - len(found) < 10
    assert found[-1][1].epoch == 1
    assert worst(between(found, 10.1)) < MILLISECOND


def test_a_slow_sensor_whose_clock_was_set_back_is_right_after_some_seconds() -> None:
    found = mapped(Device(frequency=10.0, jumps=[(15.0, -0.15)], seconds=40.0))
    assert_in_order(found)
    assert share_within(between(found, 16.0)) > 0.9
    assert worst(between(found, 22.0)) < MILLISECOND


def test_a_restart_that_is_told_is_an_epoch_however_small_the_jump() -> None:
    clock = ClockMap(latency=0.002)
    found = []
    for packet in Device(jumps=[(10.0, -0.1)]).packets():
        if packet.captured == 10.0 * SECOND:
            clock.restarted()
        capture = clock.capture(packet.stamp, packet.arrival)
        assert capture is not None
        found.append((packet, capture))
    assert_in_order(found)
    assert [each.epoch for _, each in found] == [0] * 3000 + [1] * 3000
    assert share_within(between(found, 10.0)) > 0.95


def test_a_restarted_device_keeps_the_rate_that_was_found() -> None:
    clock = ClockMap(latency=0.002)
    found = mapped(Device(rate=150e-6, jumps=[(20.0, -1e5)], seconds=21.0), clock)
    assert found[-1][1].epoch == 1
    assert clock.rate == pytest.approx(-150e-6, abs=2e-6)


@pytest.mark.parametrize("until", [11.0, 30.0, 310.0])
def test_silence_is_no_jump(until: float) -> None:
    device = Device(silences=[(10.0, until)], seconds=until + 10.0)
    found = mapped(device)
    assert_in_order(found)
    assert found[-1][1].epoch == 0
    assert share_within(between(found, until)) > 0.95
    assert worst(between(found, until + 5.0)) < 0.1 * MILLISECOND


def test_a_long_silence_after_a_short_time_is_no_jump() -> None:
    """The rate is hardly known yet: 80 ppm are 24 ms in five minutes."""
    found = mapped(Device(rate=80e-6, silences=[(2.0, 302.0)], seconds=310.0))
    assert_in_order(found)
    assert found[-1][1].epoch == 0
    assert share_within(between(found, 302.0)) > 0.9


def test_packets_that_come_faster_than_those_before_do_not_turn_time_back() -> None:
    clock = ClockMap()
    late = 4_000_000
    first = clock.capture(0, late)
    second = clock.capture(1_000_000, late)  # of 1 kHz: 1 ms less of delay
    third = clock.capture(2_000_000, late)
    assert first is not None
    assert second is not None
    assert third is not None
    assert [first.time, second.time, third.time] == [late, late, late]
    assert third.error >= 1_000_000


def test_repeated_and_overtaken_packets_are_dropped() -> None:
    packets = list(Device(seconds=1.0).packets())
    clock = ClockMap()
    for packet in packets:
        assert clock.capture(packet.stamp, packet.arrival) is not None
        assert clock.capture(packet.stamp, packet.arrival) is None
    for _ in range(100):  # a device that hangs sends its last frame again and again
        assert clock.capture(packets[-1].stamp, packets[-1].arrival) is None
    assert clock.capture(packets[-3].stamp, packets[-1].arrival) is None


# ---------------------------------------------------------------------- mistakes


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"tick": float("inf")}, "tick must be positive and finite"),
        ({"tick": 0}, "tick must be positive and finite"),
        ({"wrap": 1}, "wrap must be at least 2, got 1"),
        ({"latency": -0.1}, "latency and latency_error must be finite and at least 0 s, got -0.1"),
        (
            {"latency": float("inf")},
            "latency and latency_error must be finite and at least 0 s, got inf",
        ),
    ],
)
def test_a_mistake_is_told(options: dict[str, float], text: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        ClockMap(**options)  # type: ignore[arg-type]
